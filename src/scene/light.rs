//! Punctual lights (KHR_lights_punctual) and the camera headlight.

use glam::Vec3;

use super::{Scene, View};
use crate::constants::DEFAULT_AMBIENT;

/// Radiance that the headlight gives a white diffuse surface that faces it at the scene's centre.
const HEADLIGHT_RADIANCE: f32 = 0.7;

/// More than the rounding errors of a unit vector's component.
const ROUNDING: f32 = 8.0 * f32::EPSILON;

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

/// Light that arrives at a point, before any occluder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Incident {
    /// Unit direction to the light.
    pub to_light: Vec3,
    /// Distance to it; infinite for a directional light.
    pub distance: f32,
    /// Irradiance on a surface that faces the light.
    pub irradiance: Vec3,
}

impl Light {
    /// Light that arrives at `point`, unoccluded.
    #[inline]
    pub fn incident(&self, point: Vec3) -> Incident {
        let from = |position: Vec3, range: f32| {
            let to = position - point;
            let squared = to.length_squared();
            let distance = squared.sqrt();
            if squared == 0.0 {
                return (Vec3::ZERO, 0.0, 0.0);
            }
            // glTF: attenuation = clamp(1 - (d/range)^4, 0, 1) / d^2
            let window = if range == f32::INFINITY {
                1.0
            } else {
                (1.0 - (squared / (range * range)).powi(2)).clamp(0.0, 1.0)
            };
            (to * distance.recip(), distance, window / squared)
        };
        match self.kind {
            LightKind::Point { position, range } => {
                let (to_light, distance, falloff) = from(position, range);
                Incident { to_light, distance, irradiance: self.intensity * falloff }
            }
            LightKind::Directional { direction } => {
                Incident { to_light: -direction, distance: f32::INFINITY, irradiance: self.intensity }
            }
            LightKind::Spot { position, direction, range, inner_cos, outer_cos } => {
                let (to_light, distance, falloff) = from(position, range);
                // KHR_lights_punctual, "Inner and Outer Cone Angles"
                let scale = 1.0 / (inner_cos - outer_cos).max(1e-3);
                let cone = ((-to_light.dot(direction) - outer_cos) * scale).clamp(0.0, 1.0);
                Incident { to_light, distance, irradiance: self.intensity * (falloff * cone * cone) }
            }
        }
    }
}

impl Light {
    /// Bounds of the unit directions to the light from points inside a box, and of its distance from them.
    ///
    /// What [`incident`](Self::incident) says of any of these points lies within them, rounding included.
    pub fn directions(&self, [low, high]: [Vec3; 2]) -> ([Vec3; 2], f32) {
        match self.kind {
            LightKind::Directional { direction } => ([-direction; 2], f32::INFINITY),
            LightKind::Point { position, .. } | LightKind::Spot { position, .. } => {
                let [least, most] = [position - high, position - low];
                let nearest = position.clamp(low, high).distance(position);
                let farthest = least.abs().max(most.abs()).length();
                if nearest == 0.0 {
                    return ([Vec3::NEG_ONE, Vec3::ONE], farthest);
                }
                // The smallest component has the largest denominator, unless it is negative.
                let divisor = |positive: bool| if positive { farthest } else { nearest };
                let least = Vec3::from_array(least.to_array().map(|to| to / divisor(to > 0.0)));
                let most = Vec3::from_array(most.to_array().map(|to| to / divisor(to < 0.0)));
                let bounds = [(least - ROUNDING).max(Vec3::NEG_ONE), (most + ROUNDING).min(Vec3::ONE)];
                (bounds, farthest * (1.0 + ROUNDING))
            }
        }
    }
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn point() -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(-1.0..1.0_f32).prop_map(Vec3::from)
    }

    proptest! {
        #[test]
        fn directions_bound_what_points_see(
            corner in point(),
            size in prop_oneof![Just(0.0), Just(1e-3), Just(0.5), Just(2.0)],
            position in point(),
            shares in prop::collection::vec(point(), 1..20),
        ) {
            let (low, high) = (corner, corner + size);
            let kind = LightKind::Point { position, range: f32::INFINITY };
            let light = Light { name: "lamp".into(), kind, intensity: Vec3::ONE };
            let ([least, most], farthest) = light.directions([low, high]);
            for share in shares {
                let incident = light.incident((low + (high - low) * share.abs()).clamp(low, high));
                prop_assert!(incident.to_light.cmpge(least).all() && incident.to_light.cmple(most).all());
                prop_assert!(incident.distance <= farthest);
            }
            prop_assert!(size > 1e-3 || position.distance(low) < 0.1 || (most - least).max_element() < 0.05);
        }
    }
}
