//! What interpolation between samples would get wrong (design §6).
//!
//! Two questions are asked. Of a bisected edge: how far is the sample traced at its middle from what its
//! ends predicted? Of a face: which paths do its corners not share, so that there is nothing to interpolate?
//! Texels never answer; only the texture's structure function says what a displacement would cost.

use glam::{Vec2, Vec3};

use super::samples::Sample;
use super::shape::Shape;
use super::structure::Structure;
use crate::options::Reconstruction;
use crate::scene::patch::{Patch, TargetId, Targets};
use crate::scene::{Material, Scene, View};
use crate::trace::sample::Node;

/// Share of a contribution's square that Gouraud shading across an unresolved border loses: a step drawn
/// as a ramp is off by 1/12 in the mean square, a little more where the ramp overshoots the step.
const UNMATCHED: f32 = 0.12;

/// Share of a contribution's square that a border between patches is expected to cost for each radian that the surface
/// turns within a face: small, so that these faces wait for all whose error is known, but are not forgotten.
const BULGED: f32 = 0.02;

/// Squared contribution below which a path that turns within a face does not matter.
const FAINT: f32 = 0.005 * 0.005;

/// Predicted error per pixel of a face.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Deviation {
    /// Squared error of linear radiance, averaged over the colour channels.
    pub color: f32,
    /// Squared displacement of what is reflected or transmitted, in pixels², weighted by contribution.
    pub shift: f32,
}

impl Deviation {
    fn add(&mut self, other: Self) {
        self.color += other.color;
        self.shift += other.shift;
    }

    /// Both parts scaled.
    pub fn scaled(self, factor: f32) -> Self {
        Self { color: self.color * factor, shift: self.shift * factor }
    }

    /// Sum of both parts.
    pub fn plus(mut self, other: Self) -> Self {
        self.add(other);
        self
    }
}

/// A vertex: its sample and where it lies.
#[derive(Clone, Copy)]
pub struct Corner<'a> {
    /// Its sample.
    pub sample: Sample<'a>,
    /// Its distance from the eye along the view ray: e of design §5.
    pub distance: f32,
    /// Its shading normal, any length.
    pub normal: Vec3,
}

/// Predicts errors for one scene, view and reconstruction.
pub struct Predictor<'a> {
    /// Patches and charts.
    pub targets: &'a Targets,
    /// Structure functions by texture.
    pub structures: &'a [Structure],
    /// The scene.
    pub scene: &'a Scene,
    /// The frame's view.
    pub view: &'a View,
    /// How leaves are drawn.
    pub reconstruction: Reconstruction,
    /// Whether shafts are looked into: see [`guard`](super::guard).
    pub shaft_guard: bool,
}

impl Predictor<'_> {
    /// Error of predicting the sample at the middle of an edge of `pixels` pixels from its ends.
    pub fn edge(&self, ends: [Corner; 2], middle: Corner, pixels: f32) -> Deviation {
        let mut deviation = Deviation::default();
        let total = total_contribution(middle.sample);
        for (at, node) in middle.sample.nodes.iter().enumerate() {
            let pair = ends.map(|end| end.sample.node_near(node.path, at));
            let [Some(a), Some(b)] = pair else { continue };
            let share = contribution(node, self.structure(node.target)) / total;
            let (color, shift) = match self.reconstruction {
                Reconstruction::Exact => self.exact(node, [a, b], self.eye_distances(ends, [a, b])),
                Reconstruction::Paper => self.paper(node, [a, b]),
            };
            deviation.add(Deviation { color, shift: shift * pixels * pixels * share });
        }
        let [a, b] = ends.map(|end| end.sample.primary);
        let primary = middle.sample.primary;
        let shadow_border = a.lit != b.lit || a.lit != primary.lit;
        if shadow_border || self.reconstruction == Reconstruction::Paper {
            let textured = primary.local.textured - (a.local.textured + b.local.textured) * 0.5;
            let added = primary.local.added - (a.local.added + b.local.added) * 0.5;
            deviation.color += mean_square(textured + added);
        }
        deviation
    }

    /// e of design §5 at all corners; for a parallel view such that e/d = 1.
    fn eye_distances<const N: usize>(&self, corners: [Corner; N], nodes: [&Node; N]) -> [f32; N] {
        std::array::from_fn(|i| if self.view.orthographic { nodes[i].to_branch } else { corners[i].distance })
    }

    /// Squared colour error and squared displacement (in edge lengths) of `node` against the exact
    /// reconstruction from `ends` with equal weights.
    fn exact(&self, node: &Node, ends: [&Node; 2], distances: [f32; 2]) -> (f32, f32) {
        let structure = self.structure(node.target);
        let lost = (mean_square(weight(node, structure)), 0.25);
        let [a, b] = ends;
        let Some(shape) = Shape::of(&[a, b, node], self.targets) else { return lost };
        let lit_differs = a.lit != b.lit || a.lit != node.lit;
        let (uv, shift) = match shape {
            Shape::Planes { own } => {
                let Some(end) = self.drawn_candidate(node, ends, distances) else { return lost };
                if end.lit != node.lit {
                    return (across_shadow([node, end]) * structure.mean_square, 0.25);
                }
                if own {
                    return (0.0, 0.0);
                }
                let tint = node.throughput - (a.throughput + b.throughput) * 0.5;
                return (mean_square(tint * node.local.textured) * structure.mean_square, 0.0);
            }
            // Lit per fragment, unless a shadow's border runs between the ends.
            Shape::Plane { own: true } if !lit_differs => return (0.0, 0.0),
            Shape::Plane { own: true } | Shape::Sky { .. } => (node.uv, 0.0),
            Shape::Plane { own: false } => {
                let Some(patch) = &self.targets.targets[node.target as usize].patch else { return lost };
                let hit = bundle(patch, ends, distances).unwrap_or(Vec3::INFINITY);
                (patch.uv(hit), relative_shift(hit, node, ends))
            }
            Shape::Chart => {
                let w = [0, 1].map(|i| distances[i] / (distances[i] + ends[i].after));
                let uv = (a.uv * w[0] + b.uv * w[1]) / (w[0] + w[1]);
                (uv, uv_shift(uv, node.uv, [a.uv, b.uv]))
            }
        };
        let shade = (a.throughput * a.local.textured + b.throughput * b.local.textured) * 0.5;
        let added = mean_square(node.throughput * node.local.added - throughput_added(ends));
        let tint = mean_square(node.throughput * node.local.textured - shade) * structure.mean_square;
        let slide = mean_square(node.throughput * node.local.textured) * structure.displaced(uv - node.uv);
        (tint + slide + added, shift)
    }

    /// The same against the paper's: linear coordinates at the first bounce, Gouraud for all else.
    fn paper(&self, node: &Node, ends: [&Node; 2]) -> (f32, f32) {
        let [a, b] = ends;
        if node.bounces > 1 || a.target != b.target || a.target != node.target {
            let difference = node.radiance() - (a.radiance() + b.radiance()) * 0.5;
            return (mean_square(difference), 0.0);
        }
        let structure = self.structure(node.target);
        let uv = (a.uv + b.uv) * 0.5;
        let textured = (a.throughput * a.local.textured + b.throughput * b.local.textured) * 0.5;
        let own = node.throughput * node.local.textured;
        let added = mean_square(node.throughput * node.local.added - throughput_added(ends));
        let color = mean_square(own - textured) * structure.mean_square
            + mean_square(own) * structure.displaced(uv - node.uv)
            + added;
        (color, uv_shift(uv, node.uv, [a.uv, b.uv]))
    }

    /// The end whose planar target the mean ray of two differing ends meets first, if that is the target of
    /// `node`. After one bounce every fragment follows its own ray, and another answer is no error there; but it
    /// says that the border is curved, and that part of it may hide in faces beside it whose corners all see one
    /// target.
    fn drawn_candidate<'n>(&self, node: &Node, ends: [&'n Node; 2], distances: [f32; 2]) -> Option<&'n Node> {
        let drawn = self.nearest_candidate(&ends, mean_ray(ends, distances));
        drawn.filter(|end| end.target == node.target)
    }

    /// The node among `candidates` whose patch `ray` meets nearest, inside of its outline.
    fn nearest_candidate<'n>(&self, candidates: &[&'n Node], ray: (Vec3, Vec3)) -> Option<&'n Node> {
        let (origin, direction) = ray;
        let distance = |node: &Node| {
            let patch = self.targets.targets[node.target as usize].patch.as_ref()?;
            let s = patch.intersect(origin, direction);
            (s > 0.0 && patch.contains(origin + direction * s)).then_some(s)
        };
        let hits = candidates.iter().filter_map(|&node| Some((distance(node)?, node)));
        hits.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, node)| node)
    }

    /// Share of a face, 0 to 1, at which its rays meet none of the patches that its corners see.
    fn uncovered(&self, nodes: [&Node; 3], distances: [f32; 3]) -> f32 {
        const SIDE: u32 = 5;
        let (mut missed, mut all) = (0, 0);
        for (i, j) in (0..=SIDE).flat_map(|i| (0..=SIDE - i).map(move |j| (i, j))) {
            let b = [i, j, SIDE - i - j].map(|share| share as f32 / SIDE as f32);
            if b.contains(&1.0) {
                continue;
            }
            all += 1;
            missed += u32::from(self.nearest_candidate(&nodes, blended_ray(nodes, distances, b)).is_none());
        }
        missed as f32 / all as f32
    }

    /// The paths that all three corners have, each with whether it is followed between them.
    pub fn shared<'n>(&self, corners: [Corner<'n>; 3]) -> impl Iterator<Item = ([&'n Node; 3], bool)> {
        corners[0].sample.nodes.iter().enumerate().filter_map(move |(at, a)| {
            let near = |corner: usize| corners[corner].sample.node_near(a.path, at);
            let nodes = [a, near(1)?, near(2)?];
            Some((nodes, Shape::of(&nodes, self.targets).is_some()))
        })
    }

    /// Those that are followed.
    fn followed<'n>(&self, corners: [Corner<'n>; 3]) -> impl Iterator<Item = [&'n Node; 3]> {
        self.shared(corners).filter_map(|(nodes, followed)| followed.then_some(nodes))
    }

    /// Whether a path of several bounces that can be seen turns by more than `angle`, in radians, between two corners: what
    /// it meets in between may be anything.
    pub fn turns(&self, corners: [Corner; 3], angle: f32) -> bool {
        let turns = |one: &Node, other: &Node| {
            (one.direction - other.direction).length_squared() > angle * angle && self.square(one) > FAINT
        };
        [(0, 1), (1, 2), (2, 0)].into_iter().any(|(i, j)| {
            let [one, other] = [i, j].map(|corner: usize| corners[corner].sample);
            let mut deep = one.nodes.iter().enumerate().filter(|(_, node)| node.bounces > 1);
            deep.any(|(at, node)| other.node_near(node.path, at).is_some_and(|same| turns(node, same)))
        })
    }

    /// Largest squared contribution of a node at a corner whose target shows what corners do not tell: holes, or a texture that
    /// glows, which no fragment looks up but on a plane that it sees after one bounce.
    pub fn untold(&self, corners: [Corner; 3]) -> f32 {
        let on_own_plane = |path: u32| {
            self.followed(corners).any(|nodes| nodes[0].path == path && self.is_own_plane(&nodes))
        };
        let untold = |node: &Node| {
            let target = &self.targets.targets[node.target as usize];
            match self.scene.materials.get(target.material as usize) {
                _ if target.pierced => self.square(node),
                Some(Material { emissive_texture: Some(_), emissive, .. }) if !on_own_plane(node.path) => {
                    mean_square(node.throughput * *emissive)
                }
                _ => 0.0,
            }
        };
        let nodes = corners.iter().flat_map(|corner| corner.sample.nodes);
        nodes.map(untold).fold(0.0, f32::max)
    }

    /// Whether every fragment between these nodes follows its own ray to a plane.
    fn is_own_plane(&self, nodes: &[&Node; 3]) -> bool {
        let shape = Shape::of(nodes, self.targets);
        matches!(shape, Some(Shape::Plane { own: true } | Shape::Planes { own: true }))
    }

    /// Squared contribution of a node with the mean texel.
    pub fn square(&self, node: &Node) -> f32 {
        mean_square(weight(node, self.structure(node.target)))
    }

    /// What the corners of a face do not share; `size` is the face's longest edge in pixels, `hidden` are lights that it hides
    /// itself, a bit each, `shadowed` the largest square of the light that a shadow takes from one of them.
    pub fn face(
        &self,
        corners: [Corner; 3],
        size: f32,
        hidden: u32,
        shadowed: impl FnOnce() -> f32,
    ) -> Deviation {
        let mut deviation = Deviation::default();
        let samples = corners.map(|corner| corner.sample);
        let total =
            samples.iter().map(|&sample| total_contribution(sample)).fold(f32::MIN_POSITIVE, f32::max);
        for (index, sample) in samples.iter().enumerate() {
            for (at, node) in sample.nodes.iter().enumerate() {
                if samples[..index].iter().any(|earlier| earlier.node_near(node.path, at).is_some()) {
                    continue; // judged at the first corner that has the path
                }
                let found = samples.map(|other| other.node_near(node.path, at));
                let loss = match found {
                    [Some(a), Some(b), Some(c)] => self.mismatch(corners, [a, b, c]),
                    _ => Some(contribution_of(&found, self)),
                };
                if let Some(square) = loss {
                    deviation.color += UNMATCHED * square;
                    deviation.shift += 0.25 * size * size * square.sqrt() / total;
                }
            }
        }
        let [a, b, c] = samples.map(|sample| sample.primary);
        if ((a.lit ^ b.lit) | (a.lit ^ c.lit)) & !hidden != 0 {
            let [a, b, c] = [a, b, c].map(|primary| primary.local.textured + primary.local.added);
            // Where one is lit by a light that does not reach it, and another is not, all are dark.
            let jump = mean_square(a - b).max(mean_square(b - c)).max(mean_square(c - a)).max(shadowed());
            deviation.color += UNMATCHED * jump;
            deviation.shift += 0.25 * size * size * jump.sqrt() / total;
        }
        deviation
    }

    /// Squared contribution that is not interpolated although all three corners have the path.
    fn mismatch(&self, corners: [Corner; 3], nodes: [&Node; 3]) -> Option<f32> {
        let [a, b, c] = nodes;
        let whole = || contribution_of(&nodes.map(Some), self);
        let mut loss = 0.0_f32;
        let Some(shape) = Shape::of(&nodes, self.targets) else { return Some(whole()) };
        // Where light ends on a curved surface, no corner says.
        if shape == Shape::Chart && nodes.iter().any(|node| node.is_dark()) {
            return Some(whole()).filter(|&square| square > 0.0);
        }
        if matches!(shape, Shape::Planes { .. }) {
            if self.reconstruction == Reconstruction::Paper || touches(nodes) {
                return Some(whole());
            }
            // Where the surface is curved, the border bulges into faces beside it whose corners see one target.
            let missed = self.uncovered(nodes, self.eye_distances(corners, nodes)) / UNMATCHED;
            loss = (missed + BULGED * curvature(corners)) * whole();
        }
        for (one, other) in [(a, b), (b, c), (c, a)] {
            if one.target == other.target && one.lit != other.lit {
                loss = loss.max(across_shadow([one, other]));
            }
            // Elsewhere highlights are Gouraud-shaded, and may be sharper than that.
            if matches!(shape, Shape::Chart | Shape::Plane { own: false }) {
                let jump = one.throughput * one.local.added - other.throughput * other.local.added;
                loss = loss.max(mean_square(jump));
            }
        }
        (loss > 0.0).then_some(loss)
    }

    fn structure(&self, target: TargetId) -> &Structure {
        let material = self.targets.targets[target as usize].material;
        self.scene
            .materials
            .get(material as usize)
            .and_then(|material| material.base_color_texture)
            .map_or(&Structure::PLAIN, |slot| &self.structures[slot.texture as usize])
    }
}

/// The ray of design §5 rule 2 between two ends with equal weights: β_i ∝ e_i / d_i.
fn mean_ray(ends: [&Node; 2], distances: [f32; 2]) -> (Vec3, Vec3) {
    blended_ray(ends, distances, [0.5; 2])
}

/// The same with weights `b`.
fn blended_ray<const N: usize>(nodes: [&Node; N], distances: [f32; N], b: [f32; N]) -> (Vec3, Vec3) {
    let (mut origin, mut direction, mut sum) = (Vec3::ZERO, Vec3::ZERO, 0.0);
    for i in 0..N {
        let w = b[i] * distances[i] / nodes[i].to_branch;
        origin += nodes[i].origin * w;
        direction += nodes[i].direction * (b[i] * distances[i]);
        sum += w;
    }
    (origin / sum, direction / sum)
}

fn bundle(patch: &Patch, ends: [&Node; 2], distances: [f32; 2]) -> Option<Vec3> {
    let (origin, direction) = mean_ray(ends, distances);
    let s = patch.intersect(origin, direction);
    (s.is_finite() && s > 0.0).then(|| origin + direction * s)
}

/// Squared distance of a predicted hit from the traced one, in units of the distance that the hits move
/// along the edge.
fn relative_shift(hit: Vec3, node: &Node, ends: [&Node; 2]) -> f32 {
    let at = |node: &Node| node.origin + node.direction * node.length;
    let [a, b] = ends.map(at);
    let span = (a - b).length_squared().max((a - at(node)).length_squared()).max(f32::MIN_POSITIVE);
    ((hit - at(node)).length_squared() / span).min(1.0)
}

fn uv_shift(predicted: Vec2, traced: Vec2, ends: [Vec2; 2]) -> f32 {
    let span = (ends[0] - ends[1]).length_squared().max((ends[0] - traced).length_squared());
    if span > 0.0 { ((predicted - traced).length_squared() / span).min(1.0) } else { 0.0 }
}

fn throughput_added(ends: [&Node; 2]) -> Vec3 {
    (ends[0].throughput * ends[0].local.added + ends[1].throughput * ends[1].local.added) * 0.5
}

/// Largest angle between the normals of two corners in radians, about, at most 1.
pub fn curvature(corners: [Corner; 3]) -> f32 {
    let [a, b, c] = corners.map(|corner| corner.normal.normalize_or_zero());
    (a - b).length().max((b - c).length()).max((c - a).length()).min(1.0)
}

/// Whether one of the nodes lies nearer than its neighbours are apart: where surfaces touch, light and shadow change
/// within less than a corner can tell.
fn touches(nodes: [&Node; 3]) -> bool {
    let [a, b, c] = nodes.map(|node| node.origin);
    let apart = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
    nodes.iter().any(|node| node.length * node.length < apart)
}

/// Radiance that a node would show with the mean texel.
fn weight(node: &Node, structure: &Structure) -> Vec3 {
    node.throughput * (node.local.textured * structure.mean_square.sqrt() + node.local.added)
}

/// The same that a shadow takes from it.
fn shadow_weight(node: &Node, structure: &Structure) -> Vec3 {
    node.throughput * (node.shadowed.textured * structure.mean_square.sqrt() + node.shadowed.added)
}

/// Largest square of the light that changes between two nodes of one target that are not lit by the same lights, before
/// texture. Where one is lit by a light that does not reach it, and the other is not, both are dark.
fn across_shadow(nodes: [&Node; 2]) -> f32 {
    let [one, other] = nodes.map(|node| node.throughput * node.local.textured);
    let shadowed = nodes.map(|node| node.throughput * node.shadowed.textured);
    [one - other, shadowed[0], shadowed[1]].map(mean_square).into_iter().fold(0.0, f32::max)
}

fn contribution(node: &Node, structure: &Structure) -> f32 {
    mean_square(weight(node, structure)).sqrt()
}

/// Largest squared contribution of a path to the corners that have it. Where it ends between corners the shadow that one of
/// them sees may end, too: what the shadow takes counts.
fn contribution_of(nodes: &[Option<&Node>; 3], predictor: &Predictor) -> f32 {
    let square = |node: &Node| {
        let structure = predictor.structure(node.target);
        mean_square(weight(node, structure)).max(mean_square(shadow_weight(node, structure)))
    };
    nodes.iter().flatten().map(|node| square(node)).fold(0.0, f32::max)
}

fn total_contribution(sample: Sample) -> f32 {
    let primary = mean_square(sample.primary.local.radiance(sample.primary.texel)).sqrt();
    let nodes: f32 = sample.nodes.iter().map(|node| contribution(node, &Structure::PLAIN)).sum();
    (primary + nodes).max(f32::MIN_POSITIVE)
}

/// Mean over the channels of the square, no channel above 1: what lies beyond white is not seen, and a highlight's
/// peak would draw all samples to itself.
pub(super) fn mean_square(color: Vec3) -> f32 {
    let square = color.min(Vec3::ONE).max(Vec3::NEG_ONE).length_squared() / 3.0;
    if square.is_finite() { square } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::demo::Demo;
    use crate::scene::patch::ENVIRONMENT;
    use crate::scene::topology::Topology;
    use crate::trace::optics::BranchKind;
    use crate::trace::shade::Local;

    #[test]
    fn a_shadow_counts_where_its_path_ends() {
        let scene = Demo::Mirror.scene();
        let targets = Targets::new(&scene, &Topology::new(&scene.geometry));
        let predictor = Predictor {
            targets: &targets,
            structures: &[],
            scene: &scene,
            view: &View::new(&scene.cameras[0], 64, 48, scene.bounds()),
            reconstruction: Reconstruction::Exact,
            shaft_guard: true,
        };
        let square = |shadowed: Local| {
            let node = Node {
                path: 1,
                target: ENVIRONMENT,
                first: BranchKind::Reflect,
                bounces: 2,
                absorbed: false,
                lit: 0,
                uv: Vec2::ZERO,
                throughput: Vec3::splat(0.5),
                local: Local::default(),
                shadowed,
                texel: Vec3::ONE,
                origin: Vec3::ZERO,
                direction: Vec3::Z,
                length: 1.0,
                to_branch: 1.0,
                after: 1.0,
            };
            contribution_of(&[Some(&node), None, None], &predictor)
        };
        assert_eq!(square(Local::default()), 0.0);
        assert_eq!(square(Local { added: Vec3::ONE, ..Local::default() }), 0.25);
    }
}
