//! The leaves of the refined mesh as the device draws them: vertices, leaf records, node table.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3, Vec4};
use half::f16;
use rayon::prelude::*;

use super::nodes::{Corner, LeafNodes, Matcher};
use super::table::{SceneTable, Texel, floats};
use crate::constants::*;
use crate::refine::mesh::Mesh;
use crate::refine::pixels::TracedPixel;
use crate::refine::samples::Samples;
use crate::scene::{Geometry, Scene, View};

/// A vertex: glsl/leaf.glsl `Vertex`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct GpuVertex {
    position: Vec3,
    normal: Vec3,
    uv: [Vec2; 2],
    color: [f16; 4],
    tangent: [f16; 4],
}

/// A leaf: glsl/leaf.glsl `Leaf`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct GpuLeaf {
    vertices: [u32; 3],
    material: u32,
    lit: u32,
    nodes: u32,
    flags: u32,
    first_target: u32,
    first_lit: u32,
    comb: [[Vec3; 2]; 3],
}

/// What a group of leaves needs of its pipeline: `LEAVES_…`.
pub const GROUPS: [u32; 3] = [LEAVES_PLAIN, LEAVES_FIRST, LEAVES_NODES];

/// Everything that one frame draws of leaves.
#[derive(Debug, Default)]
pub struct Leaves {
    /// Vertices of the refined mesh.
    pub vertices: Vec<GpuVertex>,
    /// Leaves, by group: shadow receivers are the plain ones.
    pub leaves: Vec<GpuLeaf>,
    /// Number of leaves of each of [`GROUPS`].
    pub groups: [u32; GROUPS.len()],
    /// Nodes and traced pixels.
    pub nodes: Vec<Texel>,
    /// Leaves of specular objects all of whose paths are shared.
    pub defined: u32,
    /// Other leaves of specular objects.
    pub undefined: u32,
    /// Shared paths that found no room in their leaf.
    pub overflow: u64,
}

impl GpuVertex {
    fn new(position: Vec3, normal: Vec3, uv: [Vec2; 2], color: Vec4, tangent: Vec4) -> Self {
        let halves = |value: Vec4| value.to_array().map(f16::from_f32);
        Self { position, normal, uv, color: halves(color), tangent: halves(tangent) }
    }
}

/// Vertices of all faces of a scene, for faces that are drawn without samples.
pub fn base_vertices(geometry: &Geometry) -> Vec<GpuVertex> {
    (0..geometry.positions.len() as u32)
        .into_par_iter()
        .map(|v| {
            let tangent = geometry.tangents.get(v as usize).copied().unwrap_or(Vec4::X);
            let uv = [geometry.uv(0, v), geometry.uv(1, v)];
            let index = v as usize;
            GpuVertex::new(geometry.positions[index], geometry.normals[index], uv, geometry.color(v), tangent)
        })
        .collect()
}

/// The leaf record of a face that is drawn without samples: every light shines on it. `code` is its
/// primary-face code, the bits of a half (see [`single_pass`](crate::visibility::single_pass)); 0 for none.
pub fn base_leaf(scene: &Scene, table: &SceneTable, face: u32, code: u16) -> GpuLeaf {
    let object = scene.geometry.face_objects[face as usize];
    GpuLeaf {
        vertices: scene.geometry.faces[face as usize],
        material: table.material(scene.objects[object as usize].material),
        lit: u32::MAX,
        nodes: code.into(),
        first_target: NO_TARGET,
        ..GpuLeaf::zeroed()
    }
}

/// Assembles the leaves of `mesh`, in parallel and in an order that depends on the mesh alone.
pub fn assemble(
    matcher: &Matcher,
    view: &View,
    mesh: &Mesh,
    samples: &Samples,
    traced: &[TracedPixel],
    pixel_faces: &[u32],
) -> Leaves {
    let scene = matcher.scene;
    let vertices = mesh
        .vertices
        .par_iter()
        .map(|v| GpuVertex::new(mesh.points[v.point as usize], v.normal, v.uv, v.color, v.tangent))
        .collect();
    let faces: Vec<u32> = mesh.leaves().collect();
    let traced_faces: rustc_hash::FxHashSet<u32> = pixel_faces.iter().copied().collect();
    let built: Vec<(GpuLeaf, LeafNodes)> = faces
        .par_iter()
        .with_min_len(64)
        .map(|&face| {
            let corners = mesh.faces[face as usize].corners;
            let object = scene.geometry.face_objects[mesh.faces[face as usize].base as usize];
            let object = &scene.objects[object as usize];
            let lit = (0..3).fold(0, |lit, i| {
                lit | (samples.get(corners[i]).primary.lit & 0xff) << (8 * i)
            });
            let mut leaf = GpuLeaf {
                vertices: corners,
                material: matcher.table.material(object.material),
                lit,
                first_target: NO_TARGET,
                ..GpuLeaf::zeroed()
            };
            let mut nodes = LeafNodes { defined: true, ..LeafNodes::default() };
            if object.vt {
                // What no traced pixel covers of a traced leaf is Gouraud-shaded: no nodes.
                let room = if traced_faces.contains(&face) { 0 } else { matcher.room };
                let corners = corners.map(|v| Corner {
                    sample: samples.get(v),
                    distance: (!view.orthographic).then(|| view.distance_to(mesh.position(v))),
                });
                nodes = matcher.leaf(corners, room);
                leaf.comb = nodes.comb;
                leaf.flags = nodes.count << LEAF_COUNT_SHIFT;
                if let Some((target, lit)) = nodes.first {
                    (leaf.first_target, leaf.first_lit) = (target, lit);
                }
            }
            if traced_faces.contains(&face) {
                leaf.flags |= LEAF_TRACED;
            }
            (leaf, nodes)
        })
        .collect();

    let mut result = Leaves { vertices, ..Leaves::default() };
    let blocks = traced_blocks(view, mesh, traced, &traced_faces);
    let mut groups: [Vec<GpuLeaf>; GROUPS.len()] = Default::default();
    for (&face, (mut leaf, nodes)) in faces.iter().zip(built) {
        leaf.nodes = result.nodes.len() as u32;
        if leaf.flags & LEAF_TRACED != 0 {
            match blocks.get(&face) {
                Some(block) => result.nodes.extend(block),
                None => leaf.flags &= !LEAF_TRACED,
            }
        } else {
            result.nodes.extend(&nodes.texels);
        }
        let base = mesh.faces[face as usize].base;
        if !scene.is_vt(base) {
            groups[0].push(leaf);
            continue;
        }
        groups[if nodes.count == 0 { 1 } else { 2 }].push(leaf);
        result.defined += u32::from(nodes.defined);
        result.undefined += u32::from(!nodes.defined);
        result.overflow += u64::from(nodes.overflow);
    }
    result.groups = std::array::from_fn(|group| groups[group].len() as u32);
    result.leaves = groups.concat();
    result
}

/// Radiance of the traced pixels of each traced leaf: a rectangle's corner and size, then its pixels with
/// w = 1 where one was traced.
fn traced_blocks(
    view: &View,
    mesh: &Mesh,
    traced: &[TracedPixel],
    faces: &rustc_hash::FxHashSet<u32>,
) -> rustc_hash::FxHashMap<u32, Vec<Texel>> {
    let mut by_face: rustc_hash::FxHashMap<u32, Vec<TracedPixel>> = rustc_hash::FxHashMap::default();
    for pixel in traced {
        by_face.entry(pixel.face).or_default().push(*pixel);
    }
    debug_assert!(by_face.keys().all(|face| faces.contains(face) && mesh.faces[*face as usize].is_leaf()));
    by_face
        .into_iter()
        .map(|(face, pixels)| {
            let at = |pixel: &TracedPixel| (pixel.index % view.width, pixel.index / view.width);
            let low = pixels.iter().map(at).fold((u32::MAX, u32::MAX), |l, p| (l.0.min(p.0), l.1.min(p.1)));
            let high = pixels.iter().map(at).fold((0, 0), |h, p| (h.0.max(p.0), h.1.max(p.1)));
            let (width, height) = (high.0 - low.0 + 1, high.1 - low.1 + 1);
            let mut block = vec![[0; 4]; 1 + (width * height) as usize];
            block[0] = [low.0, low.1, width, height];
            for pixel in &pixels {
                let (x, y) = at(pixel);
                block[(1 + (y - low.1) * width + x - low.0) as usize] = floats(pixel.radiance.extend(1.0));
            }
            (face, block)
        })
        .collect()
}
