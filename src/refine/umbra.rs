//! Shadows that fall between the corners of a face, though these are lit alike (design §6).

use glam::Vec3;

use super::guard::{Shaft, to_light};
use super::{Refiner, predict, samples};
use crate::trace::sample::Context;
use crate::trace::{Appearance, Rays, shade};

/// Longest edge, as a share of the largest size at which samples are trusted for what is between them, of a face that is looked
/// at though nothing points to a shadow; of smaller ones those alone that are halves of one in which a shadow was found. And
/// the longest edge, in pixels, at which these are.
pub(super) const LARGE_SHARE: f32 = 0.25;
const SMALL: f32 = 8.0;

/// As a multiple of that share, the longest edge of a face in shadow that is bisected without a look.
const OPENED: f32 = 1.5;

/// Parts of its edges between the points at which a smaller one is asked for light.
const LATTICE: u32 = 4;

/// Distance from a face's plane, as a share of its edges, of what lies in it.
const IN_PLANE: f32 = 1e-3;

impl Refiner<'_> {
    /// Squared contribution of the lights whose shadows may have a border between the corners of the flat `face`, of `size`
    /// pixels, which is lit alike at all of them; and the lights that are not to be asked of its halves, as those that are `even`
    /// in it, or that it hides itself, are not of it: bit i stands for light i.
    pub(super) fn shadows_between(
        &self,
        face: u32,
        size: f32,
        [even, hidden]: [u32; 2],
        rays: &mut Rays,
    ) -> (f32, u32) {
        let Context { tracer, settings, view, .. } = *self.context;
        let scene = tracer.scene();
        let base = self.mesh.faces[face as usize].base;
        if even == shade::ALL_LIT || size < SMALL || scene.is_vt(base) || !settings.shadows.apply(false, 0) {
            return (0.0, shade::ALL_LIT);
        }
        let large = LARGE_SHARE * self.reach();
        let is_large = size >= large;
        let corners = self.mesh.faces[face as usize].corners;
        let [a, b, c] = corners.map(|corner| self.samples.get(corner).primary.lit);
        let differ = (a ^ b) | (b ^ c);
        let points = corners.map(|corner| self.mesh.position(corner));
        let mut square = 0.0;
        let mut even_in_halves = if is_large { even | !differ } else { shade::ALL_LIT };
        for (index, light) in scene.lights.iter().take(shade::MASK_LIGHTS).enumerate() {
            let bit = 1 << index;
            if (even | differ | hidden) & bit != 0 {
                continue;
            }
            let [starts, ends] = to_light(self.context, light, points);
            let has_border = match a & bit {
                0 => size >= OPENED * large || self.is_lit_between(starts, ends, rays),
                _ => self.is_entered(&Shaft::new(starts, ends), points),
            };
            if !has_border {
                continue;
            }
            even_in_halves &= !bit;
            let lit_by = |corner: u32, lights: u32| {
                let surface =
                    samples::start(&self.mesh, &self.mesh.vertices[corner as usize]).surface(tracer);
                let appearance = Appearance::new(scene, &surface);
                let local =
                    shade::local(scene, &surface, &appearance, view.direction_to(surface.position), lights);
                local.textured + local.added
            };
            let takes = |corner: u32| predict::mean_square(lit_by(corner, bit) - lit_by(corner, 0));
            square += corners.map(takes).into_iter().fold(0.0, f32::max);
        }
        (square, even_in_halves)
    }

    /// Whether a face reaches into the shaft from one with corners `points`.
    fn is_entered(&self, shaft: &Shaft, points: [Vec3; 3]) -> bool {
        let geometry = &self.context.tracer.scene().geometry;
        self.context.tracer.any_face(
            |low, high| shaft.meets_box(low, high),
            |face| {
                let corners = geometry.corners(face);
                stands_before(points, corners) && shaft.meets_triangle(corners)
            },
        )
    }

    /// Whether a light that no corner sees shines on one of some points between `points`, from where `ends` are towards it.
    fn is_lit_between(&self, points: [Vec3; 3], ends: [Vec3; 3], rays: &mut Rays) -> bool {
        let lattice = (0..=LATTICE).flat_map(|i| (0..=LATTICE - i).map(move |j| [i, j, LATTICE - i - j]));
        let mut between = lattice.filter(|shares| !shares.contains(&LATTICE));
        between.any(|shares| {
            let [from, to] = [points, ends].map(|corners| {
                corners.iter().zip(shares).map(|(&corner, share)| corner * share as f32).sum::<Vec3>()
                    / LATTICE as f32
            });
            rays.shadow += 1;
            let way = to - from;
            !self.context.tracer.occluded(from, way.normalize_or_zero(), way.length())
        })
    }
}

/// Whether a face with corners `other` is not in the plane of the one with corners `points`.
fn stands_before(points: [Vec3; 3], other: [Vec3; 3]) -> bool {
    let [a, b, c] = points;
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let flat = IN_PLANE * (b - a).length().max((c - a).length());
    other.iter().any(|point| (*point - a).dot(normal).abs() > flat)
}
