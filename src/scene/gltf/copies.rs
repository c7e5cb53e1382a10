//! Objects that repeat another to the bit, at the same place: doubled nodes and meshes, thousands of them in a broken file.

use std::hash::Hasher;
use std::ops::Range;

use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHasher};

use super::mesh::Assembly;
use super::notes::Notes;
use crate::scene::{AlphaMode, Geometry, Material, Object};

/// Drops every object that equals an earlier one in faces, vertices, material and `extras`: where two surfaces coincide,
/// which of them is seen or met is left to rounding, and the picture is the same. Layers of BLEND cover more than one of
/// them, and stay.
pub fn drop_copies(assembly: &mut Assembly, materials: &[Material], notes: &Notes) {
    let Assembly { geometry, objects, .. } = &*assembly;
    let digests: Vec<u64> = objects.par_iter().map(|object| digest(geometry, object)).collect();
    let mut first_of = FxHashMap::default();
    let mut kept = vec![true; objects.len()];
    for (index, (object, digest)) in objects.iter().zip(digests).enumerate() {
        if materials[object.material as usize].alpha_mode == AlphaMode::Blend {
            continue;
        }
        let first = &objects[*first_of.entry(digest).or_insert(index)];
        if !std::ptr::eq(first, object) && equal(geometry, first, object) {
            kept[index] = false;
            notes.add("duplicate objects", || {
                format!("{}: it repeats {} at the same place and is dropped", object.name, first.name)
            });
        }
    }
    if kept.contains(&false) {
        keep(assembly, &kept);
    }
}

/// What of an object must be equal beside its vertices.
fn traits(object: &Object) -> (u32, Option<bool>, usize, usize) {
    (object.material, object.vt_extra, object.faces.len(), object.vertices.len())
}

/// The bytes of its vertices, attribute by attribute.
fn attributes<'g>(geometry: &'g Geometry, object: &Object) -> [&'g [u8]; 6] {
    fn of<'g, T: bytemuck::NoUninit>(array: &'g [T], vertices: &Range<u32>) -> &'g [u8] {
        let vertices = vertices.start as usize..vertices.end as usize;
        bytemuck::cast_slice(array.get(vertices).unwrap_or_default())
    }
    let vertices = &object.vertices;
    let [first_uvs, second_uvs] = &geometry.uvs;
    [
        of(&geometry.positions, vertices),
        of(&geometry.normals, vertices),
        of(&geometry.tangents, vertices),
        of(first_uvs, vertices),
        of(second_uvs, vertices),
        of(&geometry.colors, vertices),
    ]
}

/// Its faces, over its own vertices.
fn faces<'g>(geometry: &'g Geometry, object: &Object) -> impl Iterator<Item = [u32; 3]> + use<'g> {
    let first = object.vertices.start;
    let faces = object.faces.start as usize..object.faces.end as usize;
    geometry.faces[faces].iter().map(move |face| face.map(|vertex| vertex - first))
}

fn equal(geometry: &Geometry, one: &Object, other: &Object) -> bool {
    traits(one) == traits(other)
        && attributes(geometry, one) == attributes(geometry, other)
        && faces(geometry, one).eq(faces(geometry, other))
}

fn digest(geometry: &Geometry, object: &Object) -> u64 {
    let mut hasher = FxHasher::default();
    std::hash::Hash::hash(&traits(object), &mut hasher);
    attributes(geometry, object).iter().for_each(|bytes| hasher.write(bytes));
    faces(geometry, object).flatten().for_each(|vertex| hasher.write_u32(vertex));
    hasher.finish()
}

/// Leaves the objects that are `kept`, in their order.
fn keep(assembly: &mut Assembly, kept: &[bool]) {
    fn pick<T: Copy>(array: &mut Vec<T>, ranges: &[Range<u32>]) {
        if array.is_empty() {
            return;
        }
        let mut end = 0;
        for range in ranges {
            array.copy_within(range.start as usize..range.end as usize, end);
            end += range.len();
        }
        array.truncate(end);
    }
    let Assembly { geometry, objects, nodes, .. } = assembly;
    let mut keeps = kept.iter().copied();
    objects.retain(|_| keeps.next().unwrap_or(true));
    let mut keeps = kept.iter().copied();
    nodes.retain(|_| keeps.next().unwrap_or(true));

    let vertices: Vec<Range<u32>> = objects.iter().map(|object| object.vertices.clone()).collect();
    pick(&mut geometry.positions, &vertices);
    pick(&mut geometry.normals, &vertices);
    pick(&mut geometry.tangents, &vertices);
    geometry.uvs.iter_mut().for_each(|uvs| pick(uvs, &vertices));
    pick(&mut geometry.colors, &vertices);
    let faces: Vec<Range<u32>> = objects.iter().map(|object| object.faces.clone()).collect();
    pick(&mut geometry.faces, &faces);
    pick(&mut geometry.face_objects, &faces);

    let (mut first_vertex, mut first_face) = (0, 0);
    for (index, object) in objects.iter_mut().enumerate() {
        let moved = object.vertices.start - first_vertex;
        object.vertices = first_vertex..object.vertices.end - moved;
        object.faces = first_face..first_face + object.faces.len() as u32;
        (first_vertex, first_face) = (object.vertices.end, object.faces.end);
        let own = object.faces.start as usize..object.faces.end as usize;
        geometry.faces[own.clone()].as_flattened_mut().iter_mut().for_each(|vertex| *vertex -= moved);
        geometry.face_objects[own].fill(index as u32);
    }
}
