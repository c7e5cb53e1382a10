//! From a scene file and what was said about it to a classified scene.

use std::path::Path;

use super::terminal;
use crate::{
    error::Result,
    options::SceneOptions,
    scene::{Background, Scene, classify, environment, gltf},
};

/// Loads `file`, classifies its objects, and tells the notes.
///
/// # Errors
/// See [`gltf::load`], [`classify::classify`] and [`environment::load`].
pub fn load(file: &Path, options: &SceneOptions) -> Result<Scene> {
    let default = gltf::Limits::default();
    let limits = gltf::Limits {
        max_triangles: options.max_triangles.unwrap_or(default.max_triangles),
        max_texture_bytes: options.max_texture_bytes.unwrap_or(default.max_texture_bytes),
        max_nodes: options.max_nodes.unwrap_or(default.max_nodes),
        ..default
    };
    let mut scene = gltf::load(file, &limits)?;
    if let Some(color) = options.background {
        scene.background = Background::Color(color);
    }
    if let Some(panorama) = &options.environment {
        scene.background = Background::Environment(environment::load(panorama)?);
    }
    classify::classify(&mut scene, &options.vt)?;
    for note in &scene.notes {
        terminal::note(note);
    }
    Ok(scene)
}
