//! Rays from inside a closed body through its edges and vertices, after Embree's verification: none may leave.

use glam::Vec3;
use rayon::prelude::*;

use crate::scene::{Geometry, Scene};
use crate::trace::{Surface, Tracer};

/// Rays that are shot, of which each goes on once more from where it meets the body.
pub const RAYS: u64 = 100_000;

/// A closed body and a point inside it.
pub struct Body {
    /// The body alone.
    pub scene: Scene,
    /// The point, relative to the scene's origin.
    pub inside: Vec3,
}

/// What became of the rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Count {
    /// Rays shot, the second ones included.
    pub rays: u64,
    /// Rays that met nothing.
    pub escaped: u64,
}

/// Shoots [`RAYS`] rays from inside `body` at points on its edges, every fourth at a vertex, and from each hit
/// another one back towards the inside.
pub fn count(body: &Body) -> Count {
    let tracer = Tracer::new(&body.scene);
    let geometry = &body.scene.geometry;
    let escaped = (0..RAYS).into_par_iter().map(|ray| {
        let direction = (aim(geometry, ray) - body.inside).normalize_or(Vec3::X);
        let Some(hit) = tracer.closest(body.inside, direction) else { return 2 };
        let surface = Surface::new(&tracer, hit.face, hit.u, hit.v, direction);
        // Somewhere into the body, as a reflected ray would go.
        let back = (aim(geometry, ray.wrapping_mul(0x9e37_79b9)) - surface.position).normalize_or(surface.ng);
        let back = if back.dot(surface.ng) > 0.05 { back } else { surface.ng };
        u64::from(tracer.closest(surface.front(), back).is_none())
    });
    Count { rays: 2 * RAYS, escaped: escaped.sum() }
}

/// The point that ray number `ray` aims at.
fn aim(geometry: &Geometry, ray: u64) -> Vec3 {
    let bits = ray.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(23);
    let corners = geometry.corners((bits % geometry.faces.len() as u64) as u32);
    let (from, to) = (corners[(bits >> 32) as usize % 3], corners[((bits >> 32) as usize + 1) % 3]);
    let along = if ray.is_multiple_of(4) { 0.0 } else { (bits >> 40) as f32 / (1_u64 << 24) as f32 };
    from.lerp(to, along)
}
