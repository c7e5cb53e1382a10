//! From a scene file and what was said about it to a scene that can be rendered.

use std::path::Path;

use super::{Options, ReferenceOptions, SceneOptions, ViewOptions};
use crate::{
    error::{Error, Result},
    scene::{Background, Scene, View, classify, environment, gltf},
};

impl Options {
    /// Loads the glTF file `file` as these options mean it, and finds their view of it: all that
    /// [`Renderer`](crate::frame::Renderer) asks for. Scenes that bring no light are lit from the eye, by
    /// [`Scene::add_default_lights`].
    ///
    /// # Errors
    /// Those of [`SceneOptions::load`] and [`ViewOptions::resolve`].
    pub fn load(&self, file: &Path) -> Result<(Scene, View)> {
        load_seen(file, &self.scene, &self.view)
    }
}

impl ReferenceOptions {
    /// As [`Options::load`].
    ///
    /// # Errors
    /// As there.
    pub fn load(&self, file: &Path) -> Result<(Scene, View)> {
        load_seen(file, &self.scene, &self.view)
    }
}

impl SceneOptions {
    /// Loads the glTF file `file` as these options mean it, whatever the view: within their limits, with their background
    /// and their specular objects. Light is only what the file brings.
    ///
    /// # Errors
    /// [`Error::Option`] if the options do not go together; those of [`gltf::load`], [`classify::classify`] and
    /// [`environment::load`].
    pub fn load(&self, file: &Path) -> Result<Scene> {
        self.check().map_err(Error::Option)?;
        let default = gltf::Limits::default();
        let limits = gltf::Limits {
            max_triangles: self.max_triangles.unwrap_or(default.max_triangles),
            max_texture_bytes: self.max_texture_bytes.unwrap_or(default.max_texture_bytes),
            max_nodes: self.max_nodes.unwrap_or(default.max_nodes),
            ..default
        };
        let mut scene = gltf::load(file, &limits)?;
        if let Some(color) = self.background {
            scene.background = Background::Color(color);
        }
        if let Some(panorama) = &self.environment {
            scene.background = Background::Environment(environment::load(panorama)?);
        }
        classify::classify(&mut scene, &self.vt)?;
        Ok(scene)
    }
}

fn load_seen(file: &Path, scene: &SceneOptions, view: &ViewOptions) -> Result<(Scene, View)> {
    let mut scene = scene.load(file)?;
    let view = view.resolve(&scene)?;
    scene.add_default_lights(&view);
    Ok((scene, view))
}
