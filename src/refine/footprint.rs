//! The pixels that a refined face may cover.

use std::ops::Range;

use glam::{Vec2, Vec3};

use super::mesh::Mesh;
use crate::scene::View;

/// Pixels by which a device's projection of a point may differ from ours.
pub const ROUNDING: f32 = 0.05;

/// Largest distance of a pixel's centre from a triangle that reaches into the pixel, and a rounding.
pub const TOUCHED: f32 = std::f32::consts::FRAC_1_SQRT_2 + ROUNDING;

/// A projected face: the rectangle of pixels around it, and its sides.
#[derive(Debug, Clone)]
pub struct Footprint {
    /// Columns that it may reach into.
    pub columns: Range<u32>,
    /// Rows that it may reach into.
    pub rows: Range<u32>,
    /// The lines along its sides: distances to them, in pixels and positive inside, are products with (x, y, 1).
    /// All zero for a triangle without area, or with no corner before the eye.
    sides: [Vec3; 3],
}

impl Footprint {
    /// That of `face` in `view`.
    pub fn new(mesh: &Mesh, view: &View, face: u32) -> Self {
        Self::of(view, mesh.faces[face as usize].corners.map(|corner| mesh.position(corner)))
    }

    /// That of a triangle.
    pub fn of(view: &View, corners: [Vec3; 3]) -> Self {
        let (mut low, mut high) = (Vec2::splat(f32::INFINITY), Vec2::splat(f32::NEG_INFINITY));
        let mut reach = |pixel: Vec2| (low, high) = (low.min(pixel), high.max(pixel));
        let projected = corners.map(|corner| view.project(corner).map(|(pixel, _)| pixel));
        projected.into_iter().flatten().for_each(&mut reach);
        let sides = match projected {
            [Some(a), Some(b), Some(c)] => sides([a, b, c]),
            [None, None, None] => [Vec3::ZERO; 3],
            _ => {
                // Partly not before the eye: it ends where the near plane cuts it.
                let cut = (0..3).filter_map(|i| view.cut(corners[i], corners[(i + 1) % 3]));
                cut.for_each(&mut reach);
                homogeneous_sides(corners.map(|corner| view.homogeneous(corner)))
            }
        };
        let range = |low: f32, high: f32, size: u32| {
            let first = (low - ROUNDING).max(0.0) as u32;
            let end =
                if high >= -ROUNDING { ((high + ROUNDING).min(size as f32) as u32 + 1).min(size) } else { 0 };
            first..end
        };
        Self { columns: range(low.x, high.x, view.width), rows: range(low.y, high.y, view.height), sides }
    }

    /// Whether it reaches into no pixel.
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty() || self.rows.is_empty()
    }

    /// Number of pixels in the rectangle.
    pub fn len(&self) -> usize {
        self.columns.len() * self.rows.len()
    }

    /// Distance of the centre of a pixel from the nearest side, in pixels and negative outside; zero where the sides are
    /// not known.
    pub fn inside(&self, x: u32, y: u32) -> f32 {
        self.inside_at(Vec2::new(x as f32, y as f32) + 0.5)
    }

    /// The same of any point of the image, in pixels.
    pub fn inside_at(&self, point: Vec2) -> f32 {
        let point = point.extend(1.0);
        self.sides.iter().map(|side| side.dot(point)).fold(f32::INFINITY, f32::min)
    }

    /// Columns of row `y` whose centres are at most `margin` pixels outside of every side.
    pub fn span(&self, y: u32, margin: f32) -> Range<u32> {
        let (mut low, mut high) = (self.columns.start as f32, self.columns.end as f32 - 1.0);
        for side in self.sides {
            let rest = side.y * (y as f32 + 0.5) + side.z + margin;
            if side.x == 0.0 {
                if rest < 0.0 {
                    return 0..0;
                }
                continue;
            }
            let end = -rest / side.x - 0.5;
            if side.x > 0.0 {
                low = low.max(end.ceil());
            } else {
                high = high.min(end.floor());
            }
        }
        if low <= high { low as u32..high as u32 + 1 } else { 0..0 }
    }
}

fn sides(corners: [Vec2; 3]) -> [Vec3; 3] {
    let [a, b, c] = corners;
    let turn = (b - a).perp_dot(c - a).signum();
    [(a, b), (b, c), (c, a)].map(|(from, to)| {
        let normal = (to - from).perp().normalize_or_zero() * turn;
        normal.extend(-normal.dot(from))
    })
}

/// The same of homogeneous corners, some of which may be behind the eye: inside is what rays in front of it hit.
fn homogeneous_sides(corners: [Vec3; 3]) -> [Vec3; 3] {
    let [a, b, c] = corners;
    let turn = a.dot(b.cross(c)).signum();
    [(a, b), (b, c), (c, a)].map(|(from, to)| {
        let side = from.cross(to);
        let length = side.truncate().length();
        // Parallel to the image's plane it is infinitely far, and all of the image on one side of it.
        if length > 0.0 { side * (turn / length) } else { Vec3::ZERO }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn footprint(corners: [Vec2; 3]) -> Footprint {
        Footprint { columns: 0..16, rows: 0..16, sides: sides(corners) }
    }

    #[test]
    fn spans_hold_the_centres_inside() {
        let corners = [Vec2::new(1.3, 2.1), Vec2::new(13.7, 4.9), Vec2::new(5.2, 12.4)];
        for corners in [corners, [corners[1], corners[0], corners[2]]] {
            let footprint = footprint(corners);
            for margin in [0.0, ROUNDING, TOUCHED] {
                for y in 0..16 {
                    let span = footprint.span(y, margin);
                    for x in 0..16 {
                        let distance = footprint.inside(x, y) + margin;
                        // On the line either answer is right.
                        if distance.abs() > 1e-4 {
                            assert_eq!(span.contains(&x), distance > 0.0, "({x}, {y}), margin {margin}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn without_sides_the_whole_rectangle_may_be_covered() {
        let footprint = Footprint { columns: 3..7, rows: 0..4, sides: [Vec3::ZERO; 3] };
        assert_eq!(footprint.span(2, ROUNDING), 3..7);
        assert_eq!(footprint.inside(0, 0), 0.0);
    }
}
