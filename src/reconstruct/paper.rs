//! The paper's own reconstruction (§4): texture coordinates and colours of the vertices, interpolated by the
//! rasteriser, with its error (Fig. 9). The baseline for the exact one.
//!
//! What §4.2 does to fit colour registers and texture units of its time (pass-through, the choice of equation by
//! the number of units) has no counterpart: three textures are bound and all colours of Eq. 3 interpolated for a
//! single pass, so mode and equation are chosen freely. `GL_MODULATE` and α-blending of §4.1 are the fragment
//! shader's product and additive blending of what it has multiplied with α already.

use std::collections::BTreeMap;

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::leaves::{Group, array_of};
use super::nodes::before;
use crate::constants::*;
use crate::refine::mesh::{Mesh, Vertex};
use crate::refine::samples::{Sample, Samples};
use crate::scene::frustum::{Frustum, Overlap};
use crate::scene::patch::{TargetId, Targets};
use crate::scene::{AlphaMode, Scene, View};
use crate::trace::sample::Node;

/// A vertex: glsl/paper.vert `PaperVertex`. Pairs hold the reflected and the transmitted branch.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct PaperVertex {
    /// Relative to the scene's origin.
    pub position: Vec3,
    /// Coordinates of the primary texture, its transform included.
    pub uv: Vec2,
    /// Alpha without the texture.
    pub alpha: f32,
    /// C_prim: what CT_prim multiplies.
    pub primary_textured: Vec3,
    /// The rest of the local component: emission, and the highlight of a dielectric.
    pub primary_added: Vec3,
    /// α_r and α_t.
    pub attenuation: [Vec3; 2],
    /// C_refl and C_trans: the local component at the first bounce without its texture.
    pub textured: [Vec3; 2],
    /// Texels met there, for undefined faces.
    pub texel: [Vec3; 2],
    /// C_r,comb and C_t,comb: what the first bounce adds untextured, and all later ones with their texels.
    pub comb: [Vec3; 2],
    /// Coordinates of CT_refl and CT_trans.
    pub branch_uv: [Vec2; 2],
}

/// A leaf: glsl/paper.vert `PaperLeaf`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct PaperLeaf {
    /// Its vertices.
    pub vertices: [u32; 3],
    /// Primary, reflected and transmitted texture in the bank; `NO_TEXTURE` for a branch that is not defined.
    pub textures: [u32; 3],
    /// Alpha below it is discarded.
    pub cutoff: f32,
}

/// Everything that one frame draws of leaves in the paper's way.
#[derive(Debug, Default)]
pub struct PaperLeaves {
    /// One record a vertex of the refined mesh.
    pub vertices: Vec<PaperVertex>,
    /// Leaves, by group.
    pub leaves: Vec<PaperLeaf>,
    /// The groups in the order of `leaves`, with the number of leaves of each. A group's arrays are those of
    /// its primary, reflected and transmitted textures.
    pub groups: Vec<(Group, u32)>,
    /// Leaves of specular objects that are defined faces (Fig. 5).
    pub defined: u32,
    /// Other leaves of specular objects (Fig. 6).
    pub undefined: u32,
    /// Components of Eq. 3 that are not zero everywhere, as bits of `COMPONENT_…`.
    pub components: u32,
}

/// Components of Eq. 3 that are not zero at all of `vertices`.
fn components(vertices: &[PaperVertex]) -> u32 {
    let any = |value: fn(&PaperVertex, usize) -> Vec3, branch: usize| {
        vertices.iter().any(|vertex| value(vertex, branch) * vertex.attenuation[branch] != Vec3::ZERO)
    };
    (0..2).fold(COMPONENT_PRIMARY, |components, branch| {
        components
            | if any(|vertex, b| vertex.textured[b], branch) { COMPONENT_REFLECTED << branch } else { 0 }
            | if any(|vertex, b| vertex.comb[b], branch) { COMPONENT_REFLECTED_COMB << branch } else { 0 }
    })
}

/// What a leaf's branches show at the first bounce.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Branches {
    /// The textured target that all three vertices see, by branch.
    pub targets: [Option<TargetId>; 2],
    /// Whether the face is defined: some texture is seen by all vertices, and none by a part of them.
    pub defined: bool,
}

/// Judges a leaf by the samples of its corners (paper §4, Fig. 5 and 6).
pub fn branches(scene: &Scene, targets: &Targets, corners: [Sample; 3]) -> Branches {
    let texture_at = |corner: Sample, branch: usize| {
        let target = first_bounce(corner, branch)?.target;
        let material = scene.materials.get(targets.targets[target as usize].material as usize)?;
        material.base_color_texture.map(|_| target)
    };
    let mut result = Branches { targets: [None; 2], defined: false };
    let mut torn = false;
    for branch in 0..2 {
        let [a, b, c] = corners.map(|corner| texture_at(corner, branch));
        if a == b && b == c {
            result.targets[branch] = a;
        } else {
            torn = true;
        }
    }
    result.defined = !torn && result.targets != [None; 2];
    result
}

fn first_bounce(sample: Sample<'_>, branch: usize) -> Option<&Node> {
    sample.nodes.iter().find(|node| node.bounces == 1 && node.first.index() == branch)
}

/// Assembles the leaves of `mesh`, in parallel and in an order that depends on the mesh alone;
/// `base_textures` are the bank's references of base colours by material.
pub fn assemble(
    scene: &Scene,
    targets: &Targets,
    base_textures: &[u32],
    view: &View,
    mesh: &Mesh,
    samples: &Samples,
) -> PaperLeaves {
    let frustum = Frustum::new(&view.clip_from_eye_relative(), view.eye);
    let vertices: Vec<PaperVertex> = (0..mesh.vertices.len() as u32)
        .into_par_iter()
        .with_min_len(64)
        .map(|index| {
            let vertex = &mesh.vertices[index as usize];
            record(scene, vertex, mesh.position(index), samples.get(index))
        })
        .collect();
    let faces: Vec<u32> = mesh.leaves().collect();
    let built: Vec<(PaperLeaf, Option<bool>, bool)> = faces
        .par_iter()
        .with_min_len(64)
        .map(|&face| {
            let face = &mesh.faces[face as usize];
            let object = &scene.objects[scene.geometry.face_objects[face.base as usize] as usize];
            let cutoff = match scene.materials[object.material as usize].alpha_mode {
                AlphaMode::Mask(cutoff) => cutoff,
                _ => f32::NEG_INFINITY,
            };
            let mut leaf = PaperLeaf { vertices: face.corners, textures: [NO_TEXTURE; 3], cutoff };
            let cut = frustum.of_points(face.corners.map(|v| mesh.position(v))) != Overlap::Inside;
            leaf.textures[0] = base_textures[object.material as usize];
            if !object.vt {
                return (leaf, None, cut);
            }
            let seen = branches(scene, targets, face.corners.map(|v| samples.get(v)));
            for (texture, target) in leaf.textures[1..].iter_mut().zip(seen.targets) {
                if let Some(target) = target {
                    *texture = base_textures[targets.targets[target as usize].material as usize];
                }
            }
            (leaf, Some(seen.defined), cut)
        })
        .collect();

    let components = components(&vertices);
    let mut result = PaperLeaves { vertices, components, ..PaperLeaves::default() };
    let mut groups: BTreeMap<Group, Vec<PaperLeaf>> = BTreeMap::new();
    for (leaf, defined, cut) in built {
        let kind = if defined.is_some() { LEAVES_NODES } else { LEAVES_PLAIN };
        groups
            .entry(Group { kind, arrays: leaf.textures.map(array_of), cut, picture: false })
            .or_default()
            .push(leaf);
        result.defined += u32::from(defined == Some(true));
        result.undefined += u32::from(defined == Some(false));
    }
    result.groups = groups.iter().map(|(&group, leaves)| (group, leaves.len() as u32)).collect();
    result.leaves = groups.into_values().flatten().collect();
    result
}

fn record(scene: &Scene, vertex: &Vertex, position: Vec3, sample: Sample) -> PaperVertex {
    let object = &scene.objects[scene.geometry.face_objects[vertex.base as usize] as usize];
    let material = &scene.materials[object.material as usize];
    let primary = sample.primary;
    let mut record = PaperVertex {
        position,
        uv: material
            .base_color_texture
            .map_or(Vec2::ZERO, |slot| slot.transform(vertex.uv[usize::from(slot.uv_set)])),
        alpha: material.base_color.w * vertex.color.w,
        primary_textured: primary.local.textured,
        primary_added: primary.local.added,
        attenuation: primary.attenuation,
        texel: [Vec3::ONE; 2],
        ..PaperVertex::zeroed()
    };
    for node in sample.nodes {
        let branch = node.first.index();
        let before = |value: Vec3| before(value, primary.attenuation[branch]);
        if node.bounces == 1 {
            record.textured[branch] = before(node.throughput * node.local.textured);
            record.comb[branch] += before(node.throughput * node.local.added);
            record.texel[branch] = node.texel;
            record.branch_uv[branch] = node.uv;
        } else {
            record.comb[branch] += before(node.radiance());
        }
    }
    record
}
