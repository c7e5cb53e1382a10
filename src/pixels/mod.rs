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
use crate::scene::mesh::meet_plane;
use crate::trace::Hit;
use crate::trace::sample::Context;

/// Linear radiance as the device reads it: three halves of at most [`MAX_RADIANCE`], and a fourth that is 1, two in a word.
/// Millions are held at a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct HalfRadiance(pub [u32; 2]);

impl HalfRadiance {
    /// Where nothing was traced.
    pub const NONE: Self = Self([0; 2]);
}

impl From<Vec3> for HalfRadiance {
    fn from(radiance: Vec3) -> Self {
        let [r, g, b] = radiance.clamp(Vec3::splat(-MAX_RADIANCE), Vec3::splat(MAX_RADIANCE)).to_array();
        let pair = |low: f32, high: f32| {
            u32::from(f16::from_f32(low).to_bits()) | u32::from(f16::from_f32(high).to_bits()) << 16
        };
        Self([pair(r, g), pair(b, 1.0)])
    }
}

/// The point of base face `base` nearest to where a view ray, origin and direction, meets its plane; `None` if it meets none.
fn point_on(context: &Context, base: u32, ray: (Vec3, Vec3)) -> Option<Hit> {
    let (t, weights) = meet_plane(context.tracer.scene().geometry.corners(base), ray)?;
    let u = weights.x.clamp(0.0, 1.0);
    let v = weights.y.clamp(0.0, 1.0 - u);
    Some(Hit { face: base, t, u, v })
}
