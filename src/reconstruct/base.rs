//! Faces that are drawn without samples: ordinary rasterising beside vertex tracing (paper §4).

use bytemuck::Zeroable;
use glam::{Vec3, Vec4};

use super::leaves::{self, GpuLeaf};
use super::passes::{BaseDraw, BaseFaces};
use super::table::SceneTable;
use super::vertex::{Attributes, VertexLayout};
use crate::constants::NO_TARGET;
use crate::scene::{Geometry, Material, Scene};
use crate::visibility::{Class, Clusters, single_pass};

/// Faces that are drawn without samples: all of them if nothing is traced, else occluders and blended faces.
/// In a single pass those that need samples are drawn too, marked, until leaves take their place. Every light shines
/// on them; the nodes of a marked one are its primary-face code, the bits of a half (see [`single_pass`]).
pub fn faces(
    scene: &Scene,
    table: &SceneTable,
    layout: VertexLayout,
    base_textures: &[u32],
    classes: Option<&[Class]>,
    single_pass: bool,
) -> BaseFaces {
    let mut base = BaseFaces::default();
    let mut opaque: Vec<((bool, bool, u32), usize)> = Vec::new();
    let mut blended: Vec<usize> = Vec::new();
    let array = |object: usize| leaves::array_of(base_textures[scene.objects[object].material as usize]);
    for (index, object) in scene.objects.iter().enumerate() {
        let class = classes.map_or(Class::Occluder, |classes| classes[index]);
        let material = &scene.materials[object.material as usize];
        match class {
            _ if !contains(class, material, single_pass) => {}
            _ if material.is_veil(class == Class::Vt) => blended.push(index),
            _ => opaque.push(((class != Class::Occluder, !material.double_sided, array(index)), index)),
        }
    }
    if opaque.is_empty() && blended.is_empty() {
        return base;
    }
    opaque.sort_unstable();
    let groups = opaque
        .chunk_by(|a, b| a.0 == b.0)
        .map(|group| (group[0].0, false, group.iter().map(|&(_, index)| index).collect::<Vec<_>>()));
    let blended = blended.into_iter().map(|index| {
        let cull = !scene.materials[scene.objects[index].material as usize].double_sided;
        ((false, cull, array(index)), true, vec![index])
    });
    // The scene's vertices that are shown, in the order of the objects.
    let mut shown: Vec<u32> = Vec::new();
    for ((marked, cull, array), blended, objects) in groups.chain(blended) {
        let start = base.leaves.len() as u32;
        let centre = centre(scene, &objects);
        let mut faces: Vec<u32> = Vec::new();
        for object in objects.iter().map(|&index| &scene.objects[index]) {
            let moved = (shown.len() as u32).wrapping_sub(object.vertices.start);
            shown.extend(object.vertices.clone());
            faces.extend(object.faces.clone());
            base.leaves.extend(object.faces.clone().map(|face| GpuLeaf {
                vertices: scene.geometry.faces[face as usize].map(|vertex| vertex.wrapping_add(moved)),
                material: table.material(object.material),
                lit: u32::MAX,
                nodes: if marked { single_pass::code(face).into() } else { 0 },
                first_target: NO_TARGET,
                ..GpuLeaf::zeroed()
            }));
        }
        base.draws.push(BaseDraw {
            clusters: Clusters::new(&scene.geometry, start, &faces),
            centre,
            array,
            cull,
            blended,
            marked,
        });
    }
    base.vertices = layout.pack(shown.len(), |index| attributes(&scene.geometry, shown[index]));
    base
}

fn attributes(geometry: &Geometry, vertex: u32) -> Attributes {
    let index = vertex as usize;
    Attributes {
        position: geometry.positions[index],
        normal: geometry.normals[index],
        uv: [geometry.uv(0, vertex), geometry.uv(1, vertex)],
        color: geometry.color(vertex),
        tangent: geometry.tangents.get(index).copied().unwrap_or(Vec4::X),
    }
}

/// Whether objects of a class and a material are among them.
pub fn contains(class: Class, material: &Material, single_pass: bool) -> bool {
    match class {
        Class::Occluder => true,
        Class::Shadow => material.is_veil(false) || single_pass,
        Class::Vt => single_pass,
    }
}

/// Mean of the vertices of `objects`.
fn centre(scene: &Scene, objects: &[usize]) -> Vec3 {
    let vertices = objects.iter().flat_map(|&object| scene.objects[object].vertices.clone());
    let (sum, count) = vertices
        .fold((Vec3::ZERO, 0_u32), |(sum, count), v| (sum + scene.geometry.positions[v as usize], count + 1));
    sum / count.max(1) as f32
}
