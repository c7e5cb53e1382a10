//! A hash of what decides a traced image, to know it again on disk.

use std::fmt::Debug;
use std::hash::{DefaultHasher, Hasher};

use crate::report::FloatImage;
use crate::scene::{Background, Scene, View};
use crate::trace::Settings;

/// The hash of `scene` seen in `view`, traced under `settings` with `spp` samples a pixel.
///
/// `probe` is any picture of it by the same tracer: it tells tracers apart that trace the same differently.
pub fn of(scene: &Scene, view: &View, settings: &Settings, spp: u32, probe: &FloatImage) -> u64 {
    let mut hasher = DefaultHasher::new();
    let geometry = &scene.geometry;
    hasher.write(bytemuck::cast_slice(&geometry.positions));
    hasher.write(bytemuck::cast_slice(&geometry.normals));
    hasher.write(bytemuck::cast_slice(&geometry.tangents));
    geometry.uvs.iter().for_each(|uvs| hasher.write(bytemuck::cast_slice(uvs)));
    hasher.write(bytemuck::cast_slice(&geometry.colors));
    hasher.write(bytemuck::cast_slice(&geometry.faces));
    hasher.write(bytemuck::cast_slice(&geometry.face_objects));
    for image in &scene.images {
        words(&mut hasher, &(image.width, image.height));
        hasher.write(&image.rgba);
    }
    match &scene.background {
        Background::Color(color) => words(&mut hasher, color),
        Background::Environment(environment) => {
            words(&mut hasher, &(environment.width, environment.height));
            hasher.write(bytemuck::cast_slice(&environment.radiance));
        }
    }
    words(&mut hasher, &(&scene.objects, &scene.materials, &scene.textures, &scene.lights));
    words(&mut hasher, &(scene.ambient, view, settings, spp));
    hasher.write(bytemuck::cast_slice(probe.pixels.as_flattened()));
    hasher.finish()
}

/// Small things, by all that their debug text shows: every field.
fn words(hasher: &mut DefaultHasher, value: &dyn Debug) {
    hasher.write(format!("{value:?}").as_bytes());
}
