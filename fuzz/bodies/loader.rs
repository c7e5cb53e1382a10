//! Any bytes at all as a glTF file: the loader gives a scene or an error.

use std::path::Path;

use vertex_tracing::scene::gltf::{Limits, load_slice};

/// Does so with one input; returns whether that is a scene.
pub fn loader(bytes: &[u8]) -> bool {
    // Small enough that what is allowed never looks like a leak or a hang.
    let limits = Limits {
        max_triangles: 100_000,
        max_texture_bytes: 16 << 20,
        max_nodes: 10_000,
        max_file_bytes: 16 << 20,
        scene: None,
    };
    let Ok(scene) = load_slice(bytes, None, Path::new("fuzz.glb"), &limits) else { return false };
    let geometry = &scene.geometry;
    assert!(geometry.positions.iter().all(|position| position.is_finite()));
    assert!(geometry.normals.iter().all(|normal| normal.is_normalized()));
    assert!(geometry.faces.iter().flatten().all(|&vertex| (vertex as usize) < geometry.positions.len()));
    assert_eq!(geometry.faces.len(), geometry.face_objects.len());
    true
}
