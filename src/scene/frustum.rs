//! What a view's frustum holds, misses or cuts.

use glam::{Mat4, Vec3, Vec4};

/// How a body lies to a frustum.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Overlap {
    /// Wholly inside: nothing of it is clipped.
    Inside,
    /// Neither surely inside nor surely outside.
    Cut,
    /// Wholly beyond one of its planes: nothing of it shows.
    Outside,
}

/// The clip volume of a view.
#[derive(Debug, Clone, Copy)]
pub struct Frustum {
    eye: Vec3,
    /// Points p inside have `plane · (p − eye, 1) ≥ 0` for each.
    planes: [Vec4; 6],
}

/// Share of a plane's terms that rounding, here or on a device, may decide about.
const SLACK: f32 = 1e-4;

impl Frustum {
    /// The frustum of a clip matrix for positions relative to `eye` (Vulkan's: 0 ≤ z ≤ w).
    pub fn new(clip_from_eye_relative: &Mat4, eye: Vec3) -> Self {
        let [x, y, z, w] = [0, 1, 2, 3].map(|row| clip_from_eye_relative.row(row));
        Self { eye, planes: [w + x, w - x, w + y, w - y, z, w - z] }
    }

    /// How the convex hull of `points` lies.
    pub fn of_points<const N: usize>(&self, points: [Vec3; N]) -> Overlap {
        let points = points.map(|point| point - self.eye);
        if points.iter().any(|point| !point.is_finite()) {
            return Overlap::Cut;
        }
        self.overlap(|plane| {
            let normal = plane.truncate();
            points.iter().fold((f32::INFINITY, f32::NEG_INFINITY, 0.0), |(low, high, scale), &point| {
                let at = normal.dot(point) + plane.w;
                (at.min(low), at.max(high), normal.abs().dot(point.abs()).max(scale))
            })
        })
    }

    /// How the box between two corners lies.
    pub fn of_box(&self, low: Vec3, high: Vec3) -> Overlap {
        let (centre, half) = ((low + high) * 0.5 - self.eye, (high - low) * 0.5);
        self.overlap(|plane| {
            let normal = plane.truncate();
            let (at, reach) = (normal.dot(centre) + plane.w, normal.abs().dot(half));
            (at - reach, at + reach, normal.abs().dot(centre.abs()) + reach)
        })
    }

    /// `extent` gives least and largest distance to a plane, and the size of the terms that they are sums of.
    fn overlap(&self, extent: impl Fn(Vec4) -> (f32, f32, f32)) -> Overlap {
        let mut inside = true;
        for plane in self.planes {
            let (least, most, scale) = extent(plane);
            let slack = SLACK * (scale + plane.w.abs());
            if most < -slack {
                return Overlap::Outside;
            }
            inside &= least >= slack;
        }
        if inside { Overlap::Inside } else { Overlap::Cut }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Camera, View};

    fn frustum() -> Frustum {
        let camera = Camera::look_at(Vec3::ZERO, Vec3::NEG_Z, 1.0);
        let view = View::new(&camera, 64, 64, (Vec3::splat(-10.0), Vec3::splat(10.0)));
        Frustum::new(&view.clip_from_eye_relative(), view.eye)
    }

    #[test]
    fn bodies_are_inside_outside_or_cut() {
        let frustum = frustum();
        let cube = |centre: Vec3| frustum.of_box(centre - 0.5, centre + 0.5);
        assert_eq!(cube(Vec3::new(0.0, 0.0, -5.0)), Overlap::Inside);
        assert_eq!(cube(Vec3::new(0.0, 0.0, 5.0)), Overlap::Outside, "behind the eye");
        assert_eq!(cube(Vec3::new(9.0, 0.0, -5.0)), Overlap::Outside, "to the right");
        assert_eq!(cube(Vec3::new(2.7, 0.0, -5.0)), Overlap::Cut);
        assert_eq!(cube(Vec3::ZERO), Overlap::Cut, "around the eye");
    }

    #[test]
    fn triangles_are_judged_by_their_corners() {
        let frustum = frustum();
        let triangle = |x: f32| {
            frustum.of_points([[x, 0.0], [x + 1.0, 0.0], [x, 1.0]].map(|[x, y]| Vec3::new(x, y, -5.0)))
        };
        assert_eq!(triangle(0.0), Overlap::Inside);
        assert_eq!(triangle(2.5), Overlap::Cut);
        assert_eq!(triangle(3.0), Overlap::Outside);
        assert_eq!(frustum.of_points([Vec3::NAN; 3]), Overlap::Cut);
    }
}
