//! Light that arrives at points.

use glam::Vec3;

use super::real::{Choice, Real, Triple};
use crate::scene::light::{Light, LightKind};

/// More than the rounding errors of a unit vector's component.
const ROUNDING: f32 = 8.0 * f32::EPSILON;

/// Light that arrives at a point, or one a lane, before any occluder.
#[derive(Debug, Clone, Copy)]
pub struct Incident<R> {
    /// Unit direction to the light.
    pub to_light: Triple<R>,
    /// Distance to it; infinite for a directional light.
    pub distance: R,
    /// Irradiance on a surface that faces the light.
    pub irradiance: Triple<R>,
}

impl Light {
    /// Light that arrives at `point`, unoccluded.
    #[inline(always)]
    pub fn incident<R: Real>(&self, point: Triple<R>) -> Incident<R> {
        let intensity = Triple::all(point.x, self.intensity);
        match self.kind {
            LightKind::Point { position, range } => {
                let Reach { to_light, distance, falloff } = Reach::new(position, range, point);
                Incident { to_light, distance, irradiance: intensity * falloff }
            }
            LightKind::Directional { direction } => Incident {
                to_light: Triple::all(point.x, -direction),
                distance: point.x.all(f32::INFINITY),
                irradiance: intensity,
            },
            LightKind::Spot { position, direction, range, inner_cos, outer_cos } => {
                let Reach { to_light, distance, falloff } = Reach::new(position, range, point);
                // KHR_lights_punctual, "Inner and Outer Cone Angles"
                let scale = 1.0 / (inner_cos - outer_cos).max(1e-3);
                let along = -to_light.dot(Triple::all(point.x, direction));
                let cone = unit_interval((along - point.x.all(outer_cos)) * point.x.all(scale));
                Incident { to_light, distance, irradiance: intensity * (falloff * cone * cone) }
            }
        }
    }

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

/// The way to a light that has a place.
struct Reach<R> {
    to_light: Triple<R>,
    distance: R,
    /// Irradiance for an intensity of 1; 0 at the light itself.
    falloff: R,
}

impl<R: Real> Reach<R> {
    #[inline(always)]
    fn new(position: Vec3, range: f32, point: Triple<R>) -> Self {
        let to = Triple::all(point.x, position) - point;
        let squared = to.dot(to);
        let (zero, one) = (squared.all(0.0), squared.all(1.0));
        let distance = squared.sqrt();
        let apart = zero.lt(squared);
        // glTF: attenuation = clamp(1 - (d/range)^4, 0, 1) / d^2
        let window = if range == f32::INFINITY {
            one
        } else {
            let share = squared / squared.all(range * range);
            unit_interval(one - share * share)
        };
        Self {
            to_light: (to * (one / distance)).where_else(apart, Triple::all(zero, Vec3::ZERO)),
            distance,
            falloff: apart.select(window / squared, zero),
        }
    }
}

#[inline(always)]
fn unit_interval<R: Real>(value: R) -> R {
    value.max(value.all(0.0)).min(value.all(1.0))
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
                let incident = light.incident((low + (high - low) * share.abs()).clamp(low, high).into());
                let to_light = Vec3::from(incident.to_light);
                prop_assert!(to_light.cmpge(least).all() && to_light.cmple(most).all());
                prop_assert!(incident.distance <= farthest);
            }
            prop_assert!(size > 1e-3 || position.distance(low) < 0.1 || (most - least).max_element() < 0.05);
        }
    }
}
