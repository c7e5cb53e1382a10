//! The leaves of the refined mesh as the device draws them: vertices, leaf records, node table.

use std::collections::BTreeMap;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use rayon::prelude::*;

use super::beside::Borders;
use super::blocks::{Blocks, Pixels, SmoothBlock, Sources};
use super::nodes::{Corner, LeafNodes, Matcher};
use super::picture::Quad;
use super::table::{Texel, floats};
use super::vertex::{Attributes, VertexLayout};
use crate::constants::*;
use crate::pixels::leaves::TracedPixel;
use crate::pixels::picture::Picture;
use crate::refine::mesh::{Face, Mesh, Vertex};
use crate::refine::samples::Samples;
use crate::scene::frustum::{Frustum, Overlap};
use crate::scene::{AlphaMode, Object, View};
use crate::trace::shade;
use crate::visibility::IdImage;

/// A leaf: glsl/leaf.glsl `Leaf`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct GpuLeaf {
    /// Its vertices.
    pub vertices: [u32; 3],
    /// First texel of its material in the scene table.
    pub material: u32,
    /// Lights that are not hidden, a byte a corner.
    pub lit: u32,
    /// First texel in the node table: combined colours, then nodes or traced pixels.
    pub nodes: u32,
    /// `LEAF_…`, and the number of nodes above.
    pub flags: u32,
    /// First texel of the patch that the view ray meets after one bounce, or `NO_TARGET`.
    pub first_target: u32,
    /// As `lit`, for that patch; its branch in the top bit.
    pub first_lit: u32,
}

/// What the leaves of one draw have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Group {
    /// `LEAVES_…`.
    pub kind: u32,
    /// Arrays of the bank: of the leaves' own texture, the first patch's, the nodes' ([`MIXED_ARRAYS`] if they
    /// are several).
    pub arrays: [u32; 3],
    /// Whether the frustum may clip them: they are drawn apart, a few at a time (see
    /// [`clusters`](crate::visibility::clusters)).
    pub cut: bool,
    /// Whether it is the picture of pixels that are traced beside the mesh, or of its kind: any face may lie behind.
    pub picture: bool,
}

impl Group {
    /// The group of that picture.
    fn picture(picture: &Picture) -> Self {
        let kind = if picture.depths.is_empty() { LEAVES_TRACED } else { LEAVES_PICTURE };
        Self { kind, arrays: [0; 3], cut: true, picture: true }
    }

    /// That of faces [between](super::between) the centres of pixels.
    pub(super) const BETWEEN: Self = Self { kind: LEAVES_TRACED, arrays: [0; 3], cut: false, picture: true };

    /// The group of leaves that traced pixels cover.
    fn traced(cut: bool) -> Self {
        Self { kind: LEAVES_TRACED, arrays: [0; 3], cut, picture: false }
    }

    /// The group of leaves with own texture `own` and these nodes.
    fn of(specular: bool, own: u32, nodes: &LeafNodes, cut: bool) -> Self {
        let kind = match (specular, nodes.count, nodes.all_kinds) {
            (false, ..) => LEAVES_PLAIN,
            (_, 0, _) => LEAVES_FIRST,
            (_, _, false) => LEAVES_NODES,
            _ => LEAVES_ALL,
        };
        let node_array = if kind == LEAVES_ALL { MIXED_ARRAYS } else { nodes.node_array.unwrap_or(0) };
        Self { kind, arrays: [array_of(own), array_of(nodes.first_texture), node_array], cut, picture: false }
    }
}

/// Array of a texture reference; the first where there is no texture, so that such leaves join a group.
pub fn array_of(reference: u32) -> u32 {
    if reference == NO_TEXTURE { 0 } else { reference & 0xff }
}

/// Whether the first component of Eq. 3 holds all that leaves of kind `kind` show.
pub fn is_primary(kind: u32) -> bool {
    matches!(kind, LEAVES_PLAIN | LEAVES_TRACED | LEAVES_PICTURE)
}

/// Everything that one frame draws of leaves.
#[derive(Debug, Default)]
pub struct Leaves {
    /// Words of the vertices of the refined mesh.
    pub vertices: Vec<u32>,
    /// Leaves, by group.
    pub leaves: Vec<GpuLeaf>,
    /// The groups in the order of `leaves`, with the number of leaves of each.
    pub groups: Vec<(Group, u32)>,
    /// Nodes and traced pixels, in parts that follow one another.
    pub nodes: Vec<Vec<Texel>>,
    /// Leaves of specular objects that are drawn from samples and all of whose paths are shared.
    pub defined: u32,
    /// Other leaves of specular objects that are drawn from samples.
    pub undefined: u32,
    /// Leaves of specular objects whose pixels were traced.
    pub traced: u32,
    /// Shared paths that found no room in their leaf.
    pub overflow: u64,
    /// Whether anything is Gouraud-shaded of reflection and of transmission.
    pub combined: [bool; 2],
    /// Whether all that is blended is among the traced pixels.
    pub veiled: bool,
    /// With several samples a pixel: corners of traced leaves, parts of which get colours of the plain picture.
    pub rest: Vec<([Vec3; 3], Sources)>,
}

impl Leaves {
    /// Components of Eq. 3 that are not zero everywhere, as bits of `COMPONENT_…`; the textured ones count as
    /// present with any specular leaf.
    pub fn components(&self) -> u32 {
        if self.groups.iter().all(|(group, _)| is_primary(group.kind)) {
            return COMPONENT_PRIMARY;
        }
        (0..2).fold(COMPONENT_PRIMARY, |components, branch| {
            components
                | COMPONENT_REFLECTED << branch
                | if self.combined[branch] { COMPONENT_REFLECTED_COMB << branch } else { 0 }
        })
    }
}

/// Pixels that were traced one by one.
#[derive(Debug)]
pub struct Traced<'a> {
    /// Those of leaves.
    pub pixels: Vec<TracedPixel>,
    /// These leaves.
    pub faces: &'a [u32],
    /// Those beside the mesh.
    pub picture: &'a Picture,
    /// Which face every pixel shows, if that was read back.
    pub ids: Option<IdImage<'a>>,
    /// Whether a pixel has several samples that are drawn, and what is [between](super::between) pixels' centres is, too.
    pub is_smooth: bool,
}

/// Assembles the leaves of `mesh` with vertices of `layout`, in parallel and in an order that depends on the mesh alone,
/// and what was `traced`.
pub fn assemble(
    matcher: &Matcher,
    layout: VertexLayout,
    view: &View,
    mesh: &Mesh,
    samples: &Samples,
    traced: Traced,
) -> Leaves {
    let Traced { pixels, faces: pixel_faces, picture, ids, is_smooth } = traced;
    let quad = Quad::new(view, picture);
    let corners = quad.as_ref().map_or(&[][..], |quad| &quad.corners);
    let count = mesh.vertices.len();
    let vertices = layout.pack(count + corners.len(), |index| {
        if let Some(corner) = index.checked_sub(count) {
            return Attributes { position: corners[corner], ..Attributes::default() };
        }
        let Vertex { point, normal, uv, color, tangent, .. } = mesh.vertices[index];
        Attributes { position: mesh.points[point as usize], normal, uv, color, tangent }
    });
    let faces: Vec<u32> = mesh.leaves().collect();
    let mut is_traced = vec![false; mesh.faces.len()];
    for &face in pixel_faces {
        is_traced[face as usize] = true;
    }
    let stage = Stage {
        matcher,
        view,
        mesh,
        samples,
        borders: Borders::find(matcher.targets, mesh, samples, &faces),
        frustum: Frustum::new(&view.clip_from_eye_relative(), view.eye),
        blocks: Blocks::new(matcher.scene, view, mesh, Pixels { traced: &pixels, ids }),
        is_smooth,
    };
    let pieces: Vec<Piece> = faces
        .par_chunks(CHUNK)
        .map(|faces| {
            let mut piece = Piece::default();
            for &face in faces {
                stage.append(face, is_traced[face as usize], &mut piece);
            }
            piece.texels.shrink_to_fit();
            piece
        })
        .collect();
    // Both are large, and what follows is, too.
    drop(stage);
    drop(pixels);

    let mut result = Leaves { vertices, veiled: picture.veiled, ..Leaves::default() };
    let mut groups: BTreeMap<Group, Vec<GpuLeaf>> = BTreeMap::new();
    let mut first = 0;
    // The largest part comes first, so that it is handed over and gone before the device has copies of the others.
    if let Some(quad) = quad {
        let texels = quad.texels();
        groups.entry(Group::picture(picture)).or_default().extend(quad.leaves(count as u32));
        first = texels.len() as u32;
        result.nodes.push(texels);
    }
    for piece in pieces {
        for (group, leaf) in piece.leaves {
            groups.entry(group).or_default().push(GpuLeaf { nodes: leaf.nodes + first, ..leaf });
        }
        first += piece.texels.len() as u32;
        result.nodes.push(piece.texels);
        result.defined += piece.defined;
        result.undefined += piece.undefined;
        result.traced += piece.traced;
        result.overflow += piece.overflow;
        result.rest.extend(piece.rest);
        result.combined = [0, 1].map(|branch| result.combined[branch] || piece.combined[branch]);
    }
    result.groups = groups.iter().map(|(&group, leaves)| (group, leaves.len() as u32)).collect();
    result.leaves = groups.into_values().flatten().collect();
    result
}

/// Leaves that one task assembles.
const CHUNK: usize = 256;

/// Some leaves, in the order of the mesh; their nodes count from the first of `texels`.
#[derive(Default)]
struct Piece {
    leaves: Vec<(Group, GpuLeaf)>,
    texels: Vec<Texel>,
    defined: u32,
    undefined: u32,
    traced: u32,
    overflow: u64,
    combined: [bool; 2],
    rest: Vec<([Vec3; 3], Sources)>,
}

/// What assembling leaves takes.
struct Stage<'a> {
    matcher: &'a Matcher<'a>,
    view: &'a View,
    mesh: &'a Mesh,
    samples: &'a Samples,
    borders: Borders,
    frustum: Frustum,
    blocks: Blocks<'a>,
    is_smooth: bool,
}

/// A leaf of the mesh, and what every way of drawing it needs.
#[derive(Clone, Copy)]
struct Subject<'a> {
    face: u32,
    object: &'a Object,
    /// Its record without nodes.
    leaf: GpuLeaf,
    /// Whether its pixels were traced.
    is_traced: bool,
    /// Whether holes are cut into it: by shading, whatever was traced.
    is_masked: bool,
    /// As [`Group::cut`].
    cut: bool,
}

impl Stage<'_> {
    fn append(&self, face: u32, is_traced: bool, piece: &mut Piece) {
        let subject = self.subject(face, is_traced, piece.texels.len());
        let Subject { object, is_masked, .. } = subject;
        let by_pixels = is_traced
            && !is_masked
            && match self.is_smooth {
                true => self.append_smooth(subject, piece),
                false => self.append_block(subject, piece),
            };
        let defined = if by_pixels { false } else { self.append_sampled(subject, piece) };
        if object.vt {
            // The vertices of a traced leaf may have no sample.
            let count = match (is_traced, defined) {
                (true, _) => &mut piece.traced,
                (false, true) => &mut piece.defined,
                (false, false) => &mut piece.undefined,
            };
            *count += 1;
        }
    }

    /// Leaf `face`, whose nodes will begin at texel `nodes`.
    fn subject(&self, face: u32, is_traced: bool, nodes: usize) -> Subject<'_> {
        let Self { matcher, view, mesh, samples, .. } = *self;
        let scene = matcher.scene;
        let Face { corners, base, .. } = mesh.faces[face as usize];
        let object = &scene.objects[scene.geometry.face_objects[base as usize] as usize];
        let hidden = shade::lights_behind(scene, matcher.shadows, view, base);
        let lit = |i: usize| samples.get(corners[i]).primary.lit & !hidden & 0xff;
        Subject {
            face,
            object,
            leaf: GpuLeaf {
                vertices: corners,
                material: matcher.table.material(object.material),
                lit: (0..3).fold(0, |all, i| all | lit(i) << (8 * i)),
                nodes: nodes as u32,
                first_target: NO_TARGET,
                ..GpuLeaf::zeroed()
            },
            is_traced,
            is_masked: matches!(scene.materials[object.material as usize].alpha_mode, AlphaMode::Mask(_)),
            cut: self.frustum.of_points(corners.map(|v| mesh.position(v))) != Overlap::Inside,
        }
    }

    /// Appends a leaf in the colours of its traced pixels: false, and nothing, if there are none.
    fn append_block(&self, Subject { face, leaf, cut, .. }: Subject, piece: &mut Piece) -> bool {
        let has_block = self.blocks.append(face, &mut piece.texels).is_some();
        if has_block {
            piece.leaves.push((Group::traced(cut), GpuLeaf { flags: LEAF_TRACED, ..leaf }));
        }
        has_block
    }

    /// The same in the colours that several samples of a pixel show of it.
    fn append_smooth(&self, Subject { face, leaf, cut, .. }: Subject, piece: &mut Piece) -> bool {
        let SmoothBlock { has_color, rest, hides } = self.blocks.append_smooth(face, &mut piece.texels);
        let has_rest = rest.is_some();
        let corners = leaf.vertices.map(|vertex| self.mesh.position(vertex));
        piece.rest.extend(rest.map(|rest| (corners, rest)));
        if has_color {
            piece.leaves.push((Group::traced(cut), GpuLeaf { flags: LEAF_TRACED, ..leaf }));
        }
        has_color || has_rest || hides
    }

    /// Appends a leaf in what its corners' samples show; whether these share all paths.
    fn append_sampled(&self, subject: Subject, piece: &mut Piece) -> bool {
        let Self { matcher, view, mesh, samples, .. } = *self;
        let Subject { face, object, mut leaf, is_traced, is_masked, cut } = subject;
        let mut nodes = LeafNodes::default();
        if object.vt {
            let seen = leaf.vertices.map(|v| Corner {
                sample: samples.get(v),
                distance: (!view.orthographic).then(|| view.distance_to(mesh.position(v))),
            });
            // What no traced pixel covers of a traced leaf is Gouraud-shaded: no nodes.
            let room = if is_traced { 0 } else { matcher.room };
            nodes = matcher.leaf_beside(seen, room, &self.borders.around(matcher.targets, mesh, face));
            // Nobody refined what owns no pixel.
            let unrefined = self.is_smooth && !is_masked && !is_traced && !nodes.defined;
            if unrefined && self.blocks.owns_no_pixel(face) && self.append_smooth(subject, piece) {
                return false;
            }
            leaf.flags = nodes.count << LEAF_COUNT_SHIFT;
            if let Some((target, lit)) = nodes.first {
                (leaf.first_target, leaf.first_lit) = (target, lit);
            }
        }
        let shows = |branch: usize| nodes.comb.iter().any(|corner| corner[branch] != Vec3::ZERO);
        let combined = [shows(0), shows(1)];
        if combined[0] || combined[1] {
            leaf.flags |= LEAF_COMBINED;
            piece.combined = [0, 1].map(|branch| piece.combined[branch] || combined[branch]);
            piece.texels.extend(nodes.comb.iter().flatten().map(|comb| floats(comb.extend(0.0))));
        }
        if is_traced && is_masked && self.blocks.append(face, &mut piece.texels).is_some() {
            leaf.flags |= LEAF_TRACED;
        } else {
            piece.texels.extend_from_slice(&nodes.texels);
        }
        piece.overflow += u64::from(nodes.overflow);
        let own = matcher.base_textures[object.material as usize];
        piece.leaves.push((Group::of(object.vt, own, &nodes, cut), leaf));
        nodes.defined
    }
}
