//! Closed forms: what a ray sees in a painted box of axis-aligned mirrors and glass, in double precision.
//!
//! Paths between axis-aligned planes are known exactly: mirrors negate a component of the direction, glass
//! scales two of them. Nothing here is shared with the tracer but the meaning of depth and attenuation.

use glam::{BVec3, DVec2, DVec3};

/// A box painted inside by [`paint`], and what stands in it.
#[derive(Debug, Clone)]
pub struct World {
    /// Half the edge of the box around the origin.
    pub half: f64,
    /// What stands in it.
    pub panes: Vec<Pane>,
    /// Most bounces.
    pub depth: u32,
}

/// An axis-aligned rectangle.
#[derive(Debug, Clone, Copy)]
pub struct Pane {
    /// Lower corner; equal to `high` on the axis of the normal.
    pub low: DVec3,
    /// Upper corner.
    pub high: DVec3,
    /// What it does with light.
    pub kind: PaneKind,
}

/// What a pane does with light.
#[derive(Debug, Clone, Copy)]
pub enum PaneKind {
    /// Reflects this share.
    Mirror(f64),
    /// Bounds clear glass of this index, which lies on the side where the axis grows if `true`.
    Glass(f64, bool),
}

/// The six sides of a glass block.
pub fn block(low: DVec3, high: DVec3, ior: f64) -> Vec<Pane> {
    let side = |axis: usize, upper: bool| {
        let mut pane = Pane { low, high, kind: PaneKind::Glass(ior, !upper) };
        let at = if upper { high[axis] } else { low[axis] };
        (pane.low[axis], pane.high[axis]) = (at, at);
        pane
    };
    (0..3).flat_map(|axis| [side(axis, false), side(axis, true)]).collect()
}

/// sRGB-encoded colour of a wall at texture coordinates `uv`: one smooth period in each direction.
pub fn paint(uv: DVec2) -> DVec3 {
    let turn = uv * std::f64::consts::TAU;
    DVec3::new(turn.x.sin(), turn.y.sin(), (turn.x + turn.y).cos()) * 0.4 + 0.5
}

impl Pane {
    fn axis(&self) -> usize {
        (0..3).find(|&axis| self.low[axis] == self.high[axis]).unwrap_or(0)
    }

    fn hit(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let axis = self.axis();
        let t = (self.low[axis] - origin[axis]) / direction[axis];
        let at = origin + direction * t;
        let across: [bool; 3] =
            std::array::from_fn(|i| i == axis || (self.low[i]..=self.high[i]).contains(&at[i]));
        (t > 1e-12 && t.is_finite() && BVec3::from_array(across).all()).then_some(t)
    }
}

impl World {
    /// Linear radiance from `origin` along the unit vector `direction`.
    pub fn radiance(&self, origin: DVec3, direction: DVec3) -> DVec3 {
        self.look(origin, direction, 0, usize::MAX)
    }

    /// `left` is the pane that the ray leaves from.
    fn look(&self, origin: DVec3, direction: DVec3, bounces: u32, left: usize) -> DVec3 {
        let hits = self.panes.iter().enumerate().filter(|(index, _)| *index != left);
        let hits = hits.filter_map(|(index, pane)| Some((pane.hit(origin, direction)?, index)));
        let Some((t, index)) = hits.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            return self.wall(origin, direction);
        };
        // Neither a mirror nor clear glass shows anything of its own.
        if bounces == self.depth {
            return DVec3::ZERO;
        }
        let (pane, at) = (&self.panes[index], origin + direction * t);
        let axis = pane.axis();
        let mut mirrored = direction;
        mirrored[axis] = -mirrored[axis];
        match pane.kind {
            PaneKind::Mirror(share) => self.look(at, mirrored, bounces + 1, index) * share,
            PaneKind::Glass(ior, upper) => {
                let entering = (direction[axis] > 0.0) == upper;
                let (reflectance, through) = refract(direction, axis, if entering { 1.0 / ior } else { ior });
                let mut sum = DVec3::ZERO;
                if reflectance > 0.0 {
                    sum += self.look(at, mirrored, bounces + 1, index) * reflectance;
                }
                if reflectance < 1.0 {
                    sum += self.look(at, through, bounces + 1, index) * (1.0 - reflectance);
                }
                sum
            }
        }
    }

    fn wall(&self, origin: DVec3, direction: DVec3) -> DVec3 {
        let distance = |axis: usize| (self.half.copysign(direction[axis]) - origin[axis]) / direction[axis];
        let axis = (0..3).min_by(|&a, &b| distance(a).total_cmp(&distance(b))).unwrap_or(0);
        let t = distance(axis);
        let at = ((origin + direction * t) / self.half + 1.0) * 0.5;
        // The sides of `shape::cuboid`, with their lower left corners.
        let (right, up) = match (axis, direction[axis] > 0.0) {
            (0, true) => (1.0 - at.z, at.y),
            (0, false) => (at.z, at.y),
            (1, true) => (at.x, 1.0 - at.z),
            (1, false) => (at.x, at.z),
            (_, true) => (at.x, at.y),
            (_, false) => (1.0 - at.x, at.y),
        };
        paint(DVec2::new(right, 1.0 - up)).map(decode)
    }
}

/// Fresnel's reflectance of unpolarised light and the transmitted direction at a plane across `axis`; `eta` is the
/// index on the ray's side over that beyond.
fn refract(direction: DVec3, axis: usize, eta: f64) -> (f64, DVec3) {
    let cos_in = direction[axis].abs();
    let mut through = direction * eta;
    through[axis] = 0.0;
    let sin_squared = through.length_squared();
    if sin_squared >= 1.0 {
        return (1.0, direction);
    }
    let cos_out = (1.0 - sin_squared).sqrt();
    through[axis] = cos_out.copysign(direction[axis]);
    let across = (eta * cos_in - cos_out) / (eta * cos_in + cos_out);
    let along = (cos_in - eta * cos_out) / (cos_in + eta * cos_out);
    (0.5 * (across * across + along * along), through)
}

/// The sRGB transfer function, encoded to linear.
fn decode(encoded: f64) -> f64 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn index_one_is_not_there() {
        let empty = World { half: 4.0, panes: vec![], depth: 5 };
        let glass = World { panes: block(DVec3::splat(-1.0), DVec3::splat(1.0), 1.0), ..empty.clone() };
        let direction = DVec3::new(0.1, -0.2, -1.0).normalize();
        let (a, b) = [&empty, &glass].map(|world| world.radiance(DVec3::Z * 3.0, direction)).into();
        assert!((a - b).length() < 1e-12, "{a} {b}");
    }

    #[test]
    fn a_mirror_shows_what_the_mirrored_eye_would_see() {
        let empty = World { half: 4.0, panes: vec![], depth: 5 };
        let low = DVec3::new(-4.0, -1.0, -4.0);
        let pane = Pane { low, high: DVec3::new(4.0, -1.0, 4.0), kind: PaneKind::Mirror(0.5) };
        let world = World { panes: vec![pane], ..empty.clone() };
        let direction = DVec3::new(0.3, -0.5, -0.7).normalize();
        let mirrored = empty.radiance(DVec3::new(0.5, -2.0, 1.0), direction * DVec3::new(1.0, -1.0, 1.0));
        let seen = world.radiance(DVec3::new(0.5, 0.0, 1.0), direction);
        assert!((seen - mirrored * 0.5).length() < 1e-12);
    }

    #[test]
    fn total_reflection_begins_at_the_critical_angle() {
        let at = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            refract(DVec3::new(sin, 0.0, cos), 2, 1.5).0
        };
        assert!(at(41.7) < 1.0 && at(41.9) == 1.0);
        assert!((at(0.0) - 0.04).abs() < 1e-12);
    }
}
