//! Pixels that are traced one by one, where samples of vertices do not serve.
//!
//! In refined [`leaves`] that are small and still undefined; in a [`picture`] of their own [`direct`]ly, of faces that the
//! refined mesh need not know, and behind [`veils`], which no order of drawing blends right; and along edges of the finished
//! picture, to [`smooth`] them.

pub mod direct;
pub mod leaves;
pub mod picture;
pub mod smooth;
pub mod store;
pub mod veils;

use glam::Vec3;
use half::f16;

use crate::constants::MAX_RADIANCE;
use crate::trace::Hit;
use crate::trace::sample::Context;

/// Linear radiance as the device reads it: three halves of at most [`MAX_RADIANCE`], and a fourth that is 1, two in a word.
/// Millions are held at a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct HalfRadiance(pub [u32; 2]);

impl From<Vec3> for HalfRadiance {
    fn from(radiance: Vec3) -> Self {
        let [r, g, b] = radiance.clamp(Vec3::splat(-MAX_RADIANCE), Vec3::splat(MAX_RADIANCE)).to_array();
        let pair = |low: f32, high: f32| {
            u32::from(f16::from_f32(low).to_bits()) | u32::from(f16::from_f32(high).to_bits()) << 16
        };
        Self([pair(r, g), pair(b, 1.0)])
    }
}

/// The point of base face `base` under a view ray, origin and direction; `None` if that has no area.
fn point_on(context: &Context, base: u32, (origin, direction): (Vec3, Vec3)) -> Option<Hit> {
    let [a, b, c] = context.tracer.scene().geometry.corners(base);
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(e2);
    let determinant = e1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let from_corner = origin - a;
    let q = from_corner.cross(e1);
    let u = (from_corner.dot(p) / determinant).clamp(0.0, 1.0);
    let v = (direction.dot(q) / determinant).clamp(0.0, 1.0 - u);
    Some(Hit { face: base, t: e2.dot(q) / determinant, u, v })
}
