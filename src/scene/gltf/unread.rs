//! What a file holds beyond the scene that is shown: never read into it, never decoded.

use std::collections::BTreeSet;

use gltf::json::Root;
use gltf::json::mesh::{Primitive, Semantic};

use super::triangles;
use crate::scene::Unread;

/// What is used of a file, by the file's own indices.
pub struct Used {
    /// Meshes that a node of the scene shows.
    pub meshes: BTreeSet<usize>,
    /// Materials of their primitives.
    pub materials: BTreeSet<usize>,
    /// Textures of those.
    pub textures: BTreeSet<usize>,
    /// Images of those.
    pub images: BTreeSet<usize>,
}

/// Lists what is not in use; `image_bytes` is what the images not in use would take decoded.
pub fn list(root: &Root, used: &Used, image_bytes: u64) -> Vec<Unread> {
    let unshown = root.meshes.iter().enumerate().filter(|(index, _)| !used.meshes.contains(index));
    let mesh_bytes = unshown.flat_map(|(_, mesh)| &mesh.primitives).map(|part| bytes(root, part)).sum();
    let kinds = [
        ("meshes", used.meshes.len(), root.meshes.len(), mesh_bytes, "no node of the scene shows them"),
        ("materials", used.materials.len(), root.materials.len(), 0, "no mesh that is shown has them"),
        ("textures", used.textures.len(), root.textures.len(), 0, "no material in use names them"),
        ("images", used.images.len(), root.images.len(), image_bytes, "no material in use shows them"),
    ];
    kinds
        .into_iter()
        .filter(|(_, used, of, ..)| used < of)
        .map(|(what, used, of, bytes, why)| Unread { what, count: of - used, of, bytes, why })
        .collect()
}

/// Positions and normals of a primitive's vertices, corners and objects of its faces.
fn bytes(root: &Root, primitive: &Primitive) -> u64 {
    let positions = triangles::attribute(primitive, Semantic::Positions);
    let vertices = positions.map_or(0, |positions| root.accessors[positions.value()].count.0);
    vertices.saturating_mul(24).saturating_add(triangles::count(root, primitive).0.saturating_mul(16))
}
