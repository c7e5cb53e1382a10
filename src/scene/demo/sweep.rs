//! Meshes that a plane curve sweeps: surfaces of revolution and tubes.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use super::Mesh;

/// A plane curve made of straight lines and cubic Bézier pieces, as the points that it is sampled at.
///
/// [`revolve`] reads a point as (radius, height), [`tube`] paths are lifted from it.
#[derive(Debug, Clone)]
pub struct Curve(Vec<Vec2>);

impl Curve {
    /// A curve that starts at `start`.
    pub fn from(start: impl Into<Vec2>) -> Self {
        Self(vec![start.into()])
    }

    /// Goes on straight to `end`.
    pub fn line(mut self, end: impl Into<Vec2>) -> Self {
        self.0.push(end.into());
        self
    }

    /// Goes on to `end` along the Bézier curve with the control points `first` and `second`, in `steps`
    /// steps (at least one).
    pub fn bend(
        mut self,
        first: impl Into<Vec2>,
        second: impl Into<Vec2>,
        end: impl Into<Vec2>,
        steps: u32,
    ) -> Self {
        let [a, b, c, d] = [self.last(), first.into(), second.into(), end.into()];
        self.0.extend((1..=steps.max(1)).map(|step| {
            let t = step as f32 / steps.max(1) as f32;
            let s = 1.0 - t;
            a * (s * s * s) + b * (3.0 * s * s * t) + c * (3.0 * s * t * t) + d * (t * t * t)
        }));
        self
    }

    /// The points, start and end included.
    pub fn points(&self) -> &[Vec2] {
        &self.0
    }

    fn last(&self) -> Vec2 {
        self.0[self.0.len() - 1]
    }
}

/// The circle of `radius` about `centre` as a closed profile for [`revolve`]: a torus.
pub fn circle(centre: Vec2, radius: f32, segments: u32) -> Curve {
    let segments = segments.max(3);
    let point = |i: u32| centre + Vec2::from_angle((i % segments) as f32 / segments as f32 * TAU) * radius;
    Curve((0..=segments).map(point).collect())
}

/// Half a circle from the lower to the upper pole as a profile for [`revolve`]: a sphere with
/// texture coordinates, if they are asked for.
pub fn meridian(radius: f32, segments: u32) -> Curve {
    let segments = segments.max(2);
    let point = |i: u32| match i {
        0 => Vec2::new(0.0, -radius),
        i if i == segments => Vec2::new(0.0, radius),
        i => Vec2::from_angle(PI * (i as f32 / segments as f32 - 0.5)) * radius,
    };
    Curve((0..=segments).map(point).collect())
}

/// Whether a surface of revolution carries texture coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Uv {
    /// None: the surface closes without a seam.
    None,
    /// u once round, v = 0 at the profile's end; costs a seam column and split poles.
    Wrapped,
}

/// The surface that `profile` sweeps about the y axis in `segments` steps (at least three).
///
/// The outside is to the right of the profile as it is walked. A point of radius 0 becomes a pole; a
/// profile that ends where it began closes to a ring.
pub fn revolve(profile: &Curve, segments: u32, uv: Uv) -> Mesh {
    let segments = segments.max(3);
    let mut points = profile.points().to_vec();
    points.dedup();
    if points.len() < 2 {
        return Mesh::default();
    }
    let closed = points.len() > 3 && points[0] == points[points.len() - 1];
    let mut normals = right_normals(&points, closed);
    for (point, normal) in points.iter().zip(&mut normals) {
        if point.x == 0.0 {
            *normal = Vec2::new(0.0, normal.y).normalize_or(Vec2::Y);
        }
    }
    let total: f32 = points.windows(2).map(|w| w[0].distance(w[1])).sum();

    let mut mesh = Mesh::default();
    let mut rings: Vec<(u32, bool)> = Vec::with_capacity(points.len());
    let mut walked = 0.0;
    for (k, (&point, &normal)) in points.iter().zip(&normals).enumerate() {
        walked += if k > 0 { point.distance(points[k - 1]) } else { 0.0 };
        if closed && uv == Uv::None && k == points.len() - 1 {
            rings.push(rings[0]);
            break;
        }
        let pole = point.x == 0.0;
        rings.push((mesh.positions.len() as u32, pole));
        let columns = match (uv, pole) {
            (Uv::None, true) => 1,
            (Uv::None, false) | (Uv::Wrapped, true) => segments,
            (Uv::Wrapped, false) => segments + 1,
        };
        for i in 0..columns {
            let (sin, cos) = ((i % segments) as f32 / segments as f32 * TAU).sin_cos();
            let swept = |p: Vec2| Vec3::new(p.x * cos, p.y, p.x * sin);
            mesh.push(swept(point), swept(normal));
            if uv == Uv::Wrapped {
                let middle = if pole { 0.5 } else { 0.0 };
                mesh.uvs.push(Vec2::new(1.0 - (i as f32 + middle) / segments as f32, 1.0 - walked / total));
            }
        }
    }

    let vertex = |(start, pole): (u32, bool), segment: u32, next: u32| match (uv, pole) {
        (Uv::None, true) => start,
        (Uv::Wrapped, true) => start + segment,
        (Uv::None, false) => start + (segment + next) % segments,
        (Uv::Wrapped, false) => start + segment + next,
    };
    for pair in rings.windows(2) {
        for i in 0..segments {
            let [a, b] = [vertex(pair[0], i, 0), vertex(pair[0], i, 1)];
            let [c, d] = [vertex(pair[1], i, 0), vertex(pair[1], i, 1)];
            if !pair[1].1 {
                mesh.faces.push([a, c, d]);
            }
            if !pair[0].1 {
                mesh.faces.push([a, d, b]);
            }
        }
    }
    mesh
}

/// Unit normals to the right of a curve at its points, second order in the spacing.
fn right_normals(points: &[Vec2], closed: bool) -> Vec<Vec2> {
    let last = points.len() - 1;
    let tangent = |k: usize| {
        let before = if k > 0 { k - 1 } else { last - 1 };
        let after = if k < last { k + 1 } else { 1 };
        let (back, ahead) = (points[k] - points[before], points[after] - points[k]);
        match k {
            0 if !closed => ahead,
            k if k == last && !closed => back,
            _ => back.normalize() * ahead.length() + ahead.normalize() * back.length(),
        }
    };
    (0..points.len())
        .map(|k| {
            let t = tangent(k);
            Vec2::new(t.y, -t.x).normalize_or(Vec2::Y)
        })
        .collect()
}

/// A closed tube about a plane path (z = 0), with an elliptic cross-section and flat ends.
///
/// `radii` gives, for the fraction 0 to 1 of the path's points, the half axis in the path's plane and the
/// half axis across it. A path of one point has no tube: the mesh is empty.
pub fn tube(path: &Curve, sides: u32, radii: impl Fn(f32) -> Vec2) -> Mesh {
    let sides = sides.max(3);
    let mut points = path.points().to_vec();
    points.dedup();
    if points.len() < 2 {
        return Mesh::default();
    }
    let last = points.len() - 1;
    let normals = right_normals(&points, false);
    let mut mesh = Mesh::default();
    for (k, (&point, &normal)) in points.iter().zip(&normals).enumerate() {
        let radius = radii(k as f32 / last as f32);
        for i in 0..sides {
            let (sin, cos) = (i as f32 / sides as f32 * TAU).sin_cos();
            let offset = (normal * radius.x * cos).extend(radius.y * sin);
            // The normal of an ellipse has the half axes swapped.
            let slope = (normal * radius.y * cos).extend(radius.x * sin);
            mesh.push(point.extend(0.0) + offset, slope.normalize());
        }
    }
    for k in 0..last as u32 {
        for i in 0..sides {
            let j = (i + 1) % sides;
            let [a, b] = [k * sides + i, k * sides + j];
            let [c, d] = [a + sides, b + sides];
            mesh.faces.extend([[a, d, b], [a, c, d]]);
        }
    }
    for (ring, forward) in [(0, false), (last, true)] {
        let along = Vec2::new(-normals[ring].y, normals[ring].x).extend(0.0);
        let outward = if forward { along } else { -along };
        let centre = mesh.push(points[ring].extend(0.0), outward);
        let rim: Vec<u32> = (0..sides)
            .map(|i| mesh.push(mesh.positions[ring * sides as usize + i as usize], outward))
            .collect();
        for i in 0..sides as usize {
            let (a, b) = (rim[i], rim[(i + 1) % sides as usize]);
            mesh.faces.push(if forward { [centre, b, a] } else { [centre, a, b] });
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circle_sweeps_a_torus() {
        // Pappus: the volume is 2π²Rr².
        for uv in [Uv::None, Uv::Wrapped] {
            let torus = revolve(&circle(Vec2::new(2.0, 0.0), 0.5, 64), 96, uv);
            assert!(torus.is_closed(), "{uv:?}");
            assert!((torus.volume() / (2.0 * PI * PI * 2.0 * 0.25) - 1.0).abs() < 0.01, "{}", torus.volume());
        }
    }

    #[test]
    fn a_meridian_sweeps_a_sphere() {
        for uv in [Uv::None, Uv::Wrapped] {
            let ball = revolve(&meridian(1.0, 24), 48, uv);
            assert!(ball.is_closed(), "{uv:?}");
            assert_eq!(ball.faces.len(), 48 * (2 * 22 + 2));
            assert!((ball.volume() / (4.0 / 3.0 * PI) - 1.0).abs() < 0.02, "{}", ball.volume());
            for (position, normal) in ball.positions.iter().zip(&ball.normals) {
                assert!(position.dot(*normal) > 0.999, "{position} {normal}");
            }
        }
    }

    #[test]
    fn coordinates_run_once_round() {
        let ball = revolve(&meridian(1.0, 8), 12, Uv::Wrapped);
        for face in &ball.faces {
            let [a, b, c] = face.map(|v| ball.uvs[v as usize]);
            let turn = (b - a).perp_dot(c - a);
            assert!(turn < 0.0, "v runs down: every face turns the same way, this one {turn}");
            assert!((a.x - b.x).abs().max((b.x - c.x).abs()) < 0.1, "a face spans the seam");
        }
    }

    #[test]
    fn a_straight_tube_is_a_cylinder() {
        let rod =
            tube(&Curve::from((0.0, 0.0)).line((0.0, 1.0)).line((0.0, 3.0)), 64, |_| Vec2::new(0.2, 0.1));
        assert!(rod.is_closed());
        assert!((rod.volume() / (PI * 0.2 * 0.1 * 3.0) - 1.0).abs() < 0.01, "{}", rod.volume());
    }

    #[test]
    fn a_single_point_sweeps_nothing() {
        let point = Curve::from((1.0, 0.0));
        assert!(
            revolve(&point, 8, Uv::None).faces.is_empty() && tube(&point, 8, |_| Vec2::ONE).faces.is_empty()
        );
    }
}
