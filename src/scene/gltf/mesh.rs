//! From primitives under nodes to world-space objects with faces and vertices of their own.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use glam::{DAffine3, DVec3};
use gltf::json::mesh::Mode;
use gltf::json::validation::Checked;
use gltf::json::{Node, Root};
use rustc_hash::{FxBuildHasher, FxHashSet};

use super::Limits;
use super::accessor::Reader;
use super::buffers::Buffers;
use super::deform::{Vertices, joint_matrices, morph_weights};
use super::document::Document;
use super::materials::MaterialMap;
use super::nodes::Nodes;
use super::notes::Notes;
use super::piece::{Attributes, Dropped, Piece};
use super::{tangents, triangles};
use crate::error::{Error, Result};
use crate::memory;
use crate::scene::mesh::MAX_REACH;
use crate::scene::{Geometry, Material, Object};

/// A primitive under a node of the scene.
struct Part {
    node: usize,
    mesh: usize,
    primitive: usize,
    triangles: usize,
}

/// All that is to be drawn, counted before anything is read.
pub struct Parts {
    list: Vec<Part>,
    other_primitives: u64,
}

impl Parts {
    /// Lists the primitives that the nodes of the scene show, in node order.
    pub fn count(
        document: &Document,
        nodes: &Nodes,
        file: &Path,
        limits: &Limits,
        notes: &Notes,
    ) -> Result<Self> {
        let root = &document.root;
        let mut drawable: BTreeMap<usize, Vec<(usize, u64)>> = BTreeMap::new();
        let mut parts = Self { list: Vec::new(), other_primitives: 0 };
        let limit = limits.max_triangles.min(u64::from(u32::MAX / 3));
        let mut total = 0_u64;
        for &node in &nodes.in_scene {
            let Some(mesh) = root.nodes[node].mesh.map(|mesh| mesh.value()) else { continue };
            let primitives = drawable.entry(mesh).or_insert_with(|| {
                let found = drawable_primitives(root, mesh, notes);
                parts.other_primitives += (root.meshes[mesh].primitives.len() - found.len()) as u64;
                found
            });
            let targets =
                morph_weights(root, &root.nodes[node]).iter().filter(|weight| **weight != 0.0).count();
            for &(primitive, triangles) in primitives.iter() {
                total = total.saturating_add(triangles.saturating_mul(1 + targets as u64));
                if total > limit {
                    let problem =
                        format!("more than {limit} triangles; simplify the model or raise --max-triangles N");
                    return Err(Error::scene(file, label(root, node), problem));
                }
                parts.list.push(Part { node, mesh, primitive, triangles: triangles as usize });
            }
        }
        memory::check(total * memory::FACE_LOADED, &format!("{total} triangles"), memory::SMALLER_SCENE)?;
        Ok(parts)
    }

    /// Materials that the parts use, as the file counts them.
    pub fn materials(&self, document: &Document) -> BTreeSet<Option<usize>> {
        self.list.iter().map(|part| part.material(&document.root)).collect()
    }

    /// Meshes that the parts belong to, as the file counts them.
    pub fn meshes(&self) -> BTreeSet<usize> {
        self.list.iter().map(|part| part.mesh).collect()
    }

    /// Why a scene without a single face is refused, of whose faces these were dropped.
    pub fn nothing_to_draw(&self, dropped: Dropped) -> String {
        let why = match dropped {
            Dropped { not_finite: 0, .. } => "is degenerate",
            Dropped { without_area: 0, .. } => "has a position that is NaN or infinite",
            _ => "is degenerate or has a position that is NaN or infinite",
        };
        match (self.list.len(), self.other_primitives) {
            (0, 0) => "nothing to draw: no node shows a mesh".into(),
            (0, count) => format!("nothing to draw: all {count} primitives are points, lines or empty"),
            (count, _) => format!("nothing to draw: every triangle of {count} primitives {why}"),
        }
    }
}

impl Part {
    fn primitive<'a>(&self, root: &'a Root) -> &'a gltf::json::mesh::Primitive {
        &root.meshes[self.mesh].primitives[self.primitive]
    }

    fn material(&self, root: &Root) -> Option<usize> {
        self.primitive(root).material.map(|material| material.value())
    }
}

/// Primitives of a mesh that have triangles, with their number.
fn drawable_primitives(root: &Root, mesh: usize, notes: &Notes) -> Vec<(usize, u64)> {
    let mut drawable = Vec::new();
    for (index, primitive) in root.meshes[mesh].primitives.iter().enumerate() {
        let (count, rest) = triangles::count(root, primitive);
        let object = || format!("meshes[{mesh}].primitives[{index}]");
        if !triangles::are_faces(primitive) {
            notes.add("primitives", || format!("{}: points and lines are not drawn", object()));
        } else if count == 0 {
            notes.add("primitives", || format!("{}: has no triangle", object()));
        } else {
            drawable.push((index, count));
        }
        if rest > 0 {
            notes.add("primitives", || format!("{}: the last {rest} indices make no triangle", object()));
        }
    }
    drawable
}

/// The name by which messages and the user call what a node shows.
fn label(root: &Root, node: usize) -> String {
    let Node { name, mesh, .. } = &root.nodes[node];
    let mesh_name = || root.meshes[mesh.as_ref()?.value()].name.clone();
    name.clone().or_else(mesh_name).unwrap_or_else(|| format!("node {node}"))
}

/// Objects in node order, and the geometry that they share.
pub struct Assembly {
    /// World position of the origin of `geometry`.
    pub origin: DVec3,
    /// Faces and vertices.
    pub geometry: Geometry,
    /// One for each part that has a face left.
    pub objects: Vec<Object>,
    /// The node of each object.
    pub nodes: Vec<usize>,
    /// Faces that cannot be drawn.
    pub dropped: Dropped,
}

/// Reads the parts of one file.
pub struct Reading<'a> {
    /// Its tree.
    pub root: &'a Root,
    /// Its bytes.
    pub buffers: &'a Buffers<'a>,
    /// Its world transforms.
    pub nodes: &'a Nodes,
    /// For messages.
    pub file: &'a Path,
    /// Where repairs are noted.
    pub notes: &'a Notes,
}

/// Places the vertices of all parts in the world and drops the faces that have no area there.
pub fn assemble(
    reading: &Reading,
    parts: &Parts,
    materials: &[Material],
    material_of: &MaterialMap,
) -> Result<Assembly> {
    let root = reading.root;
    let skins: BTreeMap<usize, Vec<DAffine3>> = parts
        .list
        .iter()
        .filter_map(|part| root.nodes[part.node].skin)
        .map(|skin| (skin.value(), skin))
        .collect::<BTreeMap<_, _>>()
        .into_iter()
        .map(|(index, skin)| (index, joint_matrices(root, reading.buffers, reading.nodes, skin)))
        .collect();
    if !skins.is_empty() {
        reading.notes.add("skins", || "skinned meshes are drawn as their joints stand".into());
    }

    let origin = reading.centre(parts, &skins)?;
    let mut assembly = Assembly {
        origin,
        geometry: Geometry::default(),
        objects: Vec::new(),
        nodes: Vec::new(),
        dropped: Dropped::default(),
    };
    let mut effort_left = tangents::MAX_EFFORT;
    for part in &parts.list {
        let primitive = part.primitive(root);
        let material = material_of[&part.material(root)];
        let name = label(root, part.node);
        let vertices = reading.vertices(part, &skins)?;
        let mut faces = reading.faces(part, &vertices)?;
        let listed = matches!(primitive.mode, Checked::Valid(Mode::Triangles));
        let before = faces.len();
        faces.retain(|[a, b, c]| a != b && b != c && c != a);
        // Strips repeat vertices to turn corners: nothing to remark there.
        let repeated = if listed { before - faces.len() } else { 0 };

        let copies = drop_copies(&mut faces);
        if copies > 0 {
            reading.notes.add("duplicate faces", || format!("{name}: {copies} copies of faces are dropped"));
        }

        let bad_joint = |joint: u32| {
            reading.refuse(part, "attributes.JOINTS_0", format!("joint {joint} of a smaller skin"))
        };
        let mut piece = Piece::place(&vertices, faces, origin).map_err(bad_joint)?;
        if let Some(position) = piece.beyond_reach() {
            let problem = format!(
                "a vertex lies {position} from the scene's centre; more than {MAX_REACH:e} units cannot be drawn: scale the scene down"
            );
            return Err(reading.refuse(part, "attributes.POSITION", problem));
        }
        let mut dropped = piece.drop_degenerate();
        dropped.without_area += repeated;
        note_dropped(dropped, &name, reading.notes);
        assembly.dropped.without_area += dropped.without_area;
        assembly.dropped.not_finite += dropped.not_finite;
        if piece.faces.is_empty() {
            continue;
        }
        let replaced = piece.shade(&vertices).map_err(bad_joint)?;
        if replaced > 0 {
            reading
                .notes
                .add("normals", || format!("{name}: {replaced} normals without direction are replaced"));
        }
        let attributes = Attributes::of(root, reading.buffers, primitive);
        if let Some(slot) = materials[material as usize].normal_texture {
            let made = piece.orient(&vertices, &attributes, slot, &mut effort_left).map_err(bad_joint)?;
            if !made {
                reading.notes.add("tangents", || {
                    format!("{name}: too many faces at one vertex to make tangents: its normal map may look turned")
                });
            }
        }
        let repaired = piece.append(&mut assembly.geometry, &attributes, assembly.objects.len() as u32);
        if repaired > 0 {
            reading.notes.add("attributes", || {
                format!("{name}: {repaired} texture coordinates or colours are out of range")
            });
        }
        let (first_vertex, first_face) =
            assembly.objects.last().map_or((0, 0), |object: &Object| (object.vertices.end, object.faces.end));
        assembly.objects.push(Object {
            name,
            mesh_name: root.meshes[part.mesh].name.clone(),
            material,
            faces: first_face..assembly.geometry.faces.len() as u32,
            vertices: first_vertex..assembly.geometry.positions.len() as u32,
            vt_extra: None,
            vt: false,
        });
        assembly.nodes.push(part.node);
    }
    super::piece::pad(&mut assembly.geometry);
    Ok(assembly)
}

fn note_dropped(dropped: Dropped, name: &str, notes: &Notes) {
    let Dropped { without_area, not_finite } = dropped;
    if without_area > 0 {
        notes.add("degenerate faces", || format!("{name}: {without_area} faces without area are dropped"));
    }
    if not_finite > 0 {
        notes.add("faces at no finite place", || {
            format!("{name}: {not_finite} faces with a position that is NaN or infinite are dropped")
        });
    }
}

impl Reading<'_> {
    fn refuse(&self, part: &Part, attribute: &str, problem: String) -> Error {
        let object = format!("meshes[{}].primitives[{}].{attribute}", part.mesh, part.primitive);
        Error::scene(self.file, object, problem)
    }

    fn vertices<'b>(
        &'b self,
        part: &Part,
        skins: &'b BTreeMap<usize, Vec<DAffine3>>,
    ) -> Result<Vertices<'b>> {
        let node = &self.root.nodes[part.node];
        let joints = node.skin.and_then(|skin| skins.get(&skin.value())).map(Vec::as_slice);
        let weights = morph_weights(self.root, node);
        let world = self.nodes.world[part.node];
        Vertices::new(self.root, self.buffers, part.primitive(self.root), weights, world, joints)
            .ok_or_else(|| self.refuse(part, "attributes", "cannot be read".into()))
    }

    fn faces(&self, part: &Part, vertices: &Vertices) -> Result<Vec<[u32; 3]>> {
        let primitive = part.primitive(self.root);
        let Checked::Valid(mode) = primitive.mode else { return Ok(Vec::new()) };
        let indices = primitive.indices.and_then(|indices| Reader::new(self.root, self.buffers, indices));
        triangles::list(mode, indices.as_ref(), vertices.count(), part.triangles).map_err(|index| {
            self.refuse(
                part,
                "indices",
                format!("index {index}, but there are {} vertices", vertices.count()),
            )
        })
    }

    /// Centre of the box around all vertices that faces use; those at no finite place do not count.
    fn centre(&self, parts: &Parts, skins: &BTreeMap<usize, Vec<DAffine3>>) -> Result<DVec3> {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for part in &parts.list {
            let vertices = self.vertices(part, skins)?;
            for vertex in self.faces(part, &vertices)?.into_iter().flatten() {
                let vertex = vertex as usize;
                // A bad joint number is named where the vertex is placed.
                let Ok(frame) = vertices.frame(vertex) else { continue };
                let position = vertices.position(vertex, &frame);
                if position.is_finite() {
                    low = low.min(position);
                    high = high.max(position);
                }
            }
        }
        let centre = low * 0.5 + high * 0.5;
        Ok(if low.x <= high.x && centre.is_finite() { centre } else { DVec3::ZERO })
    }
}

/// Drops faces that name the same vertices in the same order round as an earlier one, and returns how many: where two
/// surfaces coincide, which of them is seen or met is left to rounding.
fn drop_copies(faces: &mut Vec<[u32; 3]>) -> usize {
    let before = faces.len();
    let mut known = FxHashSet::with_capacity_and_hasher(before, FxBuildHasher);
    faces.retain(|&[a, b, c]| {
        let first = a.min(b).min(c);
        known.insert(if first == a {
            [a, b, c]
        } else if first == b {
            [b, c, a]
        } else {
            [c, a, b]
        })
    });
    before - faces.len()
}
