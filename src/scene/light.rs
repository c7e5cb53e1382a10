//! Punctual lights (KHR_lights_punctual) and the camera headlight.

use glam::Vec3;

use super::{Scene, View};
use crate::constants::DEFAULT_AMBIENT;

/// Radiance that the headlight gives a white diffuse surface that faces it at the scene's centre.
const HEADLIGHT_RADIANCE: f32 = 0.7;

/// A light without extent.
#[derive(Debug, Clone, PartialEq)]
pub struct Light {
    /// Its name, or `light 3`.
    pub name: String,
    /// Shape of its emission.
    pub kind: LightKind,
    /// Colour × intensity, linear: W/sr-like (cd) for point and spot, irradiance (lx) for directional.
    pub intensity: Vec3,
}

/// Shape of a light's emission, in world space relative to [`Scene::origin`](super::Scene::origin).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightKind {
    /// Equal in all directions.
    Point {
        /// Where it is.
        position: Vec3,
        /// Distance at which glTF's falloff window ends; infinite if the file gives none.
        range: f32,
    },
    /// Parallel light from infinity.
    Directional {
        /// Unit direction that the light travels in.
        direction: Vec3,
    },
    /// A cone.
    Spot {
        /// Where it is.
        position: Vec3,
        /// Unit direction of its axis, the way that the light travels.
        direction: Vec3,
        /// As for `Point`.
        range: f32,
        /// Cosine of the angle at which the falloff to the rim begins.
        inner_cos: f32,
        /// Cosine of the angle of the rim.
        outer_cos: f32,
    },
}

impl Scene {
    /// Lights a scene that has no lights of its own: a point light at the eye of `view`, and ambient light
    /// of [`DEFAULT_AMBIENT`] · base colour. Together a white diffuse surface at the centre that faces the
    /// eye shows as white. Noted; a scene with lights is left as it is.
    pub fn add_default_lights(&mut self, view: &View) {
        if !self.lights.is_empty() {
            return;
        }
        let (low, high) = self.bounds();
        // Never so close that the inverse square turns the scene's far side black.
        let closest = ((high - low).length() * 0.05).max(f32::MIN_POSITIVE.sqrt());
        let distance = ((low + high) * 0.5 - view.eye).length().max(closest);
        let intensity = HEADLIGHT_RADIANCE * std::f32::consts::PI * distance * distance;
        self.lights.push(Light {
            name: "headlight".into(),
            kind: LightKind::Point { position: view.eye, range: f32::INFINITY },
            intensity: Vec3::splat(intensity),
        });
        self.ambient = DEFAULT_AMBIENT;
        self.notes.push("the scene has no lights: lit from the camera, with ambient light".into());
    }
}
