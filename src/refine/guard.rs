//! The shaft guard (design §6): whether anything stands between the rays of a face's corners, though all three meet
//! one target, or between what they meet and a light that reaches it. No ray is traced.

use glam::Vec3;

use super::predict::mean_square;
use crate::scene::{Light, LightKind};
use crate::trace::sample::{Context, Node};
use crate::trace::shade::{self, MASK_LIGHTS};
use crate::trace::{Appearance, Surface};

/// Share of a segment's length that is left out where it touches what it joins.
const END: f32 = 1e-3;

/// Squared contribution of what enters a shaft beyond which nothing brighter is looked for.
const ENOUGH: f32 = 0.01;

/// The convex hull of three segments, to be held against boxes and triangles.
///
/// It is told apart along the axes of the coordinates, the normals of its sides and ends, and, from a triangle, along
/// that one's normal and the normals of the planes through one of its edges and a segment. What touches it may be
/// taken for apart from it only by rounding; what is apart may be taken for touching.
pub struct Shaft {
    /// Starts of the segments, then their ends.
    points: [Vec3; 6],
    low: Vec3,
    high: Vec3,
    /// Axes besides those of the coordinates, with the shaft's extent along each.
    axes: [(Vec3, [f32; 2]); 5],
}

/// Extent of points along `axis`.
fn extent(axis: Vec3, points: &[Vec3]) -> [f32; 2] {
    points
        .iter()
        .map(|&point| axis.dot(point))
        .fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], at| [low.min(at), high.max(at)])
}

fn apart([a, b]: [f32; 2], [c, d]: [f32; 2]) -> bool {
    b < c || d < a
}

impl Shaft {
    /// The hull of the segments from `starts` to `ends`.
    pub fn new(starts: [Vec3; 3], ends: [Vec3; 3]) -> Self {
        let points = [starts[0], starts[1], starts[2], ends[0], ends[1], ends[2]];
        let along = std::array::from_fn::<_, 3, _>(|i| ends[i] - starts[i]);
        let side =
            |i: usize, j: usize| ((starts[j] - starts[i]) + (ends[j] - ends[i])).cross(along[i] + along[j]);
        let end = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a);
        let axes = [end(starts), end(ends), side(0, 1), side(1, 2), side(2, 0)];
        Self {
            points,
            low: points.into_iter().fold(Vec3::INFINITY, Vec3::min),
            high: points.into_iter().fold(Vec3::NEG_INFINITY, Vec3::max),
            axes: axes.map(|axis| (axis, extent(axis, &points))),
        }
    }

    /// Whether the box from `low` to `high` may reach into the shaft.
    pub fn meets_box(&self, low: Vec3, high: Vec3) -> bool {
        if low.cmpgt(self.high).any() || high.cmplt(self.low).any() {
            return false;
        }
        let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5);
        self.axes.iter().all(|&(axis, own)| {
            let (at, reach) = (axis.dot(middle), axis.abs().dot(half));
            !apart(own, [at - reach, at + reach])
        })
    }

    /// Whether a triangle may reach into the shaft.
    pub fn meets_triangle(&self, corners: [Vec3; 3]) -> bool {
        let [a, b, c] = corners;
        if !self.meets_box(a.min(b).min(c), a.max(b).max(c)) {
            return false;
        }
        if self.axes.iter().any(|&(axis, own)| apart(own, extent(axis, &corners))) {
            return false;
        }
        let separates = |axis: Vec3| apart(extent(axis, &self.points), extent(axis, &corners));
        if separates((b - a).cross(c - a)) {
            return false;
        }
        let edges = [b - a, c - b, a - c];
        let segments = std::array::from_fn::<_, 3, _>(|i| self.points[i + 3] - self.points[i]);
        !edges.iter().any(|edge| segments.iter().any(|segment| separates(edge.cross(*segment))))
    }
}

/// Squared contribution of what may be seen in place of what `nodes` meet, of the squared contribution `seen`, for a face of
/// another object than `own`, and of another target where they are `followed`, reaches in between their last segments; `None` if
/// none does, or none of those that do and of what they hide amounts to `least`. Specular faces may show what is as bright as
/// `brightest`.
pub fn entered(
    context: &Context,
    own: u32,
    nodes: [&Node; 3],
    followed: bool,
    [seen, least]: [f32; 2],
    brightest: Vec3,
) -> Option<f32> {
    let scene = context.tracer.scene();
    let far = context.tracer.diagonal();
    let starts = nodes.map(|node| node.origin);
    let ends = nodes.map(|node| node.origin + node.direction * (node.length.min(far) * (1.0 - END)));
    let shaft = Shaft::new(starts, ends);
    let throughput = nodes[0].throughput;
    let mut most = 0.0_f32;
    context.tracer.any_face(
        |low, high| shaft.meets_box(low, high),
        |face| {
            let enters = scene.geometry.face_objects[face as usize] != own
                && !(followed && nodes.iter().any(|node| node.target == context.targets.of(face)))
                && shaft.meets_triangle(scene.geometry.corners(face));
            if enters {
                let shows = radiance(context, face, nodes[0].direction, brightest);
                most = most.max(seen).max(mean_square(throughput * shows));
            }
            most >= ENOUGH.max(least)
        },
    );
    (most >= least).then_some(most)
}

/// Whether a face of another target may throw a shadow in between what `nodes`, of one target, meet, though a light reaches all
/// three.
pub fn shadowed(context: &Context, nodes: [&Node; 3]) -> bool {
    let scene = context.tracer.scene();
    if !context.settings.shadows.apply(false, 1) || nodes.iter().any(|node| !node.length.is_finite()) {
        return false;
    }
    let lit = nodes.iter().fold(u32::MAX, |lit, node| lit & node.lit);
    let hits = nodes.map(|node| node.origin + node.direction * node.length);
    let lights = scene.lights.iter().take(MASK_LIGHTS).enumerate();
    lights.filter(|(index, _)| lit >> index & 1 == 1).any(|(_, light)| {
        let [starts, ends] = to_light(context, light, hits);
        let shaft = Shaft::new(starts, ends);
        context.tracer.any_face(
            |low, high| shaft.meets_box(low, high),
            |face| {
                nodes[0].target != context.targets.of(face)
                    && shaft.meets_triangle(scene.geometry.corners(face))
            },
        )
    })
}

/// The ways from `points` to `light`, all starts and all ends: off what the points lie on, where others touch it, and off the
/// light, which may stand in a lamp.
pub(super) fn to_light(context: &Context, light: &Light, points: [Vec3; 3]) -> [[Vec3; 3]; 2] {
    let ends = match light.kind {
        LightKind::Point { position, .. } | LightKind::Spot { position, .. } => [position; 3],
        LightKind::Directional { direction } => {
            points.map(|point| point - direction * context.tracer.diagonal())
        }
    };
    [END, 1.0 - END].map(|share| [0, 1, 2].map(|i| points[i].lerp(ends[i], share)))
}

/// Radiance that `face` may send back along `direction`: unshadowed, and without its base colour's texture.
fn radiance(context: &Context, face: u32, direction: Vec3, brightest: Vec3) -> Vec3 {
    let scene = context.tracer.scene();
    let surface = Surface::new(context.tracer, face, 1.0 / 3.0, 1.0 / 3.0, direction);
    let appearance = Appearance::new(scene, &surface);
    let emissive = scene.materials[surface.material as usize].emissive;
    let appearance = Appearance { emission: emissive, ..appearance };
    let local = shade::local(scene, &surface, &appearance, direction, shade::ALL_LIT);
    let specular = if surface.vt { appearance.metallic.max(appearance.transmission) } else { 0.0 };
    local.textured + local.added + brightest * specular
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::vec3;

    fn shaft() -> Shaft {
        let starts = [Vec3::ZERO, Vec3::X, Vec3::Y];
        Shaft::new(starts, starts.map(|start| start + vec3(0.3, 0.3, 4.0)))
    }

    #[test]
    fn a_triangle_across_the_shaft_enters_it() {
        let inside = vec3(0.5, 0.5, 2.0);
        assert!(shaft().meets_triangle([inside, inside + vec3(5.0, 0.0, 0.1), inside + vec3(0.0, 5.0, 0.1)]));
        let wide = [vec3(-9.0, -9.0, 1.0), vec3(9.0, -9.0, 1.0), vec3(0.0, 20.0, 1.2)];
        assert!(shaft().meets_triangle(wide), "none of its corners or edges is inside");
        assert!(shaft().meets_triangle([vec3(0.4, 0.4, 1.0); 3].map(|p| p + vec3(0.01, 0.0, 0.0))));
    }

    #[test]
    fn a_triangle_beside_the_shaft_does_not() {
        let beside = |offset: Vec3| [Vec3::ZERO, Vec3::X, Vec3::Z].map(|p| p + offset);
        assert!(!shaft().meets_triangle(beside(vec3(0.0, -0.2, 0.5))));
        assert!(!shaft().meets_triangle(beside(vec3(0.0, 0.0, 4.5))));
        // Inside the box around it, beyond its slanted side.
        assert!(!shaft().meets_triangle([vec3(1.1, 1.1, 2.0), vec3(1.2, 1.0, 2.0), vec3(1.2, 1.2, 2.5)]));
        assert!(!shaft().meets_box(vec3(1.0, 1.0, 1.0), vec3(1.2, 1.2, 1.2)));
    }
}
