//! The nodes that a leaf owns: paths shared by its corners, heaviest first (design §5).

use glam::{Vec3, Vec4};

use super::beside::Beside;
use super::parts::Part;
use super::table::{SceneTable, Texel, floats};
use crate::constants::*;
use crate::refine::samples::Sample;
use crate::scene::patch::{ENVIRONMENT, Patch, TargetId, Targets};
use crate::scene::{Background, Scene};
use crate::trace::sample::{Node, slot};

/// What the corners of a leaf share, and what they do not.
#[derive(Debug, Clone)]
pub struct LeafNodes {
    /// The patch that the view ray meets after one bounce: its place in the scene table; its lights, a byte a
    /// corner, with the branch in the top bit.
    pub first: Option<(u32, u32)>,
    /// Other nodes, encoded, heaviest first.
    pub texels: Vec<Texel>,
    /// Number of encoded nodes.
    pub count: u32,
    /// Base colour reference of the first patch.
    pub first_texture: u32,
    /// Array of the bank that holds the textures of all nodes: [`MIXED_ARRAYS`] if there is no such.
    pub node_array: Option<u32>,
    /// Whether any node is not of kind [`NODE_TEXTURE`].
    pub all_kinds: bool,
    /// By corner and branch: radiance that is Gouraud-shaded, before the attenuation at the vertex.
    pub comb: [[Vec3; 2]; 3],
    /// Whether every path is shared, with equal light visibility: a defined face (paper, Fig. 5).
    pub defined: bool,
    /// Shared paths for which there was no room.
    pub overflow: u32,
}

impl Default for LeafNodes {
    /// A leaf without specular part.
    fn default() -> Self {
        Self {
            first: None,
            texels: Vec::new(),
            count: 0,
            first_texture: NO_TEXTURE,
            node_array: None,
            all_kinds: false,
            comb: [[Vec3::ZERO; 2]; 3],
            defined: true,
            overflow: 0,
        }
    }
}

impl LeafNodes {
    pub(super) fn note_texture(&mut self, reference: u32) {
        if reference != NO_TEXTURE {
            let array = reference & 0xff;
            let same = self.node_array.is_none_or(|known| known == array);
            self.node_array = Some(if same { array } else { MIXED_ARRAYS });
        }
    }
}

/// A corner's sample and its distance from the eye (1 for a parallel view, where e/d means 1).
#[derive(Clone, Copy)]
pub struct Corner<'a> {
    /// Its sample.
    pub sample: Sample<'a>,
    /// e of design §5; `None` for a parallel view.
    pub distance: Option<f32>,
}

/// Where a path ends, as varyings whose weighted sums a fragment divides: the fourth component of its colour, and what
/// [`NODE_TEXTURE`] reads besides.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub scale: f32,
    pub bundle: Vec4,
    pub rest: Vec4,
}

impl Corner<'_> {
    /// On a plane, by the ray (design §5 rule 2). With O = Σ b e/d o, D = Σ b e r, S = Σ b e/d:
    /// s = (k S − N·O) / N·D, u = (G·O + c S + s G·D) / S.
    pub(super) fn on_plane(self, patch: &Patch, node: &Node) -> Place {
        let (scale, e) = self.distance.map_or((1.0, 1.0), |e| (e / node.to_branch, e));
        let (origin, direction) = (node.origin * scale, node.direction * e);
        let [u, v] = patch.base_uv;
        Place {
            scale,
            bundle: Vec4::new(
                patch.distance * scale - patch.normal.dot(origin),
                patch.normal.dot(direction),
                u.truncate().dot(origin) + u.w * scale,
                v.truncate().dot(origin) + v.w * scale,
            ),
            rest: Vec4::new(u.truncate().dot(direction), v.truncate().dot(direction), 0.0, 0.0),
        }
    }

    /// On a chart, by projective coordinates (design §5 rule 3).
    pub(super) fn on_chart(self, node: &Node) -> Place {
        let scale = self.distance.map_or(1.0, |e| e / (e + node.after));
        Place { scale, bundle: Vec4::new(0.0, 1.0, node.uv.x * scale, node.uv.y * scale), rest: Vec4::ZERO }
    }
}

/// The parts of a [`NODE_TEXTURE`] node: by corner, colour and place.
pub(super) fn texture_parts(shades: [Vec3; 3], places: [Place; 3]) -> [[Vec4; 3]; 3] {
    let scaled = std::array::from_fn(|i| shades[i].extend(places[i].scale));
    [scaled, places.map(|place| place.bundle), places.map(|place| place.rest)]
}

/// Builds the nodes of leaves for one frame.
pub struct Matcher<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Patches and charts.
    pub targets: &'a Targets,
    /// Where shaders find them.
    pub table: &'a SceneTable,
    /// Base colour references by material.
    pub base_textures: &'a [u32],
    /// Most paths that a leaf keeps apart.
    pub room: usize,
}

impl Matcher<'_> {
    /// Matches the paths of a leaf's corners; the `room` heaviest become nodes.
    pub fn leaf(&self, corners: [Corner; 3], room: usize) -> LeafNodes {
        self.leaf_beside(corners, room, &[])
    }

    /// The same for a leaf beside others that see the patches `beside`, which may show in it too.
    pub fn leaf_beside(&self, corners: [Corner; 3], room: usize, beside: &[Beside]) -> LeafNodes {
        let mut leaf = LeafNodes::default();
        let mut parts: Vec<Part> = Vec::new();
        for found in paths(&corners) {
            leaf.defined &= self.is_shared(found);
            if let [Some(a), Some(b), Some(c)] = found
                && self.interpolates([a, b, c])
            {
                parts.push(Part::new(found, [true; 3]));
            } else {
                parts.extend(Part::by_target(found));
            }
        }
        parts.sort_by(|a, b| b.weight.total_cmp(&a.weight).then(a.order().cmp(&b.order())));
        for (rank, part) in parts.iter().enumerate() {
            match part.whole() {
                Some(nodes) if rank < room => self.encode(&mut leaf, &corners, nodes, beside),
                None if rank < room => self.encode_part(&mut leaf, &corners, part),
                whole => {
                    leaf.overflow += u32::from(whole.is_some());
                    self.combine(&mut leaf, &corners, part.nodes(), Node::radiance);
                }
            }
        }
        leaf
    }

    /// Whether a leaf's corners share every path, with equal light visibility: a defined face (paper, Fig. 5).
    pub fn is_defined(&self, corners: &[Corner; 3]) -> bool {
        paths(corners).all(|found| self.is_shared(found))
    }

    fn is_shared(&self, found: [Option<&Node>; 3]) -> bool {
        let [Some(a), Some(b), Some(c)] = found else { return false };
        let lit_alike = |(one, other): (&Node, &Node)| one.target != other.target || one.lit == other.lit;
        self.interpolates([a, b, c]) && [(a, b), (b, c), (c, a)].into_iter().all(lit_alike)
    }

    /// Whether a path can be followed per fragment: one target, or planar ones with outlines.
    fn interpolates(&self, nodes: [&Node; 3]) -> bool {
        let [a, b, c] = nodes.map(|node| node.target);
        a == b && b == c || [a, b, c].into_iter().all(|target| self.targets.is_outlined(target))
    }

    /// Adds `value` of each node to its corner's Gouraud-shaded colour.
    pub(super) fn combine(
        &self,
        leaf: &mut LeafNodes,
        corners: &[Corner; 3],
        nodes: [Option<&Node>; 3],
        value: impl Fn(&Node) -> Vec3,
    ) {
        for ((comb, corner), node) in leaf.comb.iter_mut().zip(corners).zip(nodes) {
            if let Some(node) = node {
                let branch = slot(node.first);
                comb[branch] += before(value(node), corner.sample.primary.attenuation[branch]);
            }
        }
    }

    /// The patches that a leaf may show after one bounce, with their lights: those that its corners `nodes` see, and
    /// of those `beside` it as many as there is room for. `None` if there is none of these, or if a shadow's border on
    /// one patch takes the room.
    fn candidates(&self, nodes: [&Node; 3], beside: &[Beside]) -> Option<[(TargetId, u32); 3]> {
        let mut seen: Vec<(TargetId, u32)> = Vec::with_capacity(3);
        let own = nodes.map(|node| (node.target, node.lit));
        let others = beside.iter().filter(|other| other.path == nodes[0].path).map(|b| (b.target, b.lit));
        for (target, lit) in own {
            match seen.iter().find(|known| known.0 == target) {
                Some(known) if known.1 != lit => return None,
                Some(_) => {}
                None => seen.push((target, lit)),
            }
        }
        let known = seen.len();
        for (target, lit) in others {
            if seen.len() < 3 && seen.iter().all(|known| known.0 != target) {
                seen.push((target, lit));
            }
        }
        let last = seen.len() - 1;
        (seen.len() > known).then(|| std::array::from_fn(|i| seen[i.min(last)]))
    }

    fn encode(&self, leaf: &mut LeafNodes, corners: &[Corner; 3], nodes: [&Node; 3], beside: &[Beside]) {
        let [first, ..] = nodes;
        let target = &self.targets.targets[first.target as usize];
        let branch = slot(first.first);
        let lights = nodes.map(|node| node.lit);
        let single = nodes.iter().all(|node| node.target == first.target);
        let followed = nodes.iter().all(|node| node.is_followed());
        let flat = target.patch.is_some() && followed && single;
        let emissive =
            self.scene.materials.get(target.material as usize).is_some_and(|m| m.emissive_texture.is_some());
        let candidates = if followed { self.candidates(nodes, beside) } else { None };
        if flat && leaf.first.is_none() && !emissive && candidates.is_none() {
            leaf.first = Some((self.table.target(first.target), packed(lights) | (branch as u32) << 31));
            leaf.first_texture = self.base_textures[target.material as usize];
            return;
        }
        let head = |kind: u32, lights: [u32; 3], words: [u32; 3]| {
            [kind | (branch as u32) << 3 | 3 << 4 | packed(lights) << 8, words[0], words[1], words[2]]
        };
        let throughputs: [Vec3; 3] = std::array::from_fn(|i| {
            before(nodes[i].throughput, corners[i].sample.primary.attenuation[branch])
        });
        let shades: [Vec3; 3] = std::array::from_fn(|i| throughputs[i] * nodes[i].local.textured);
        let scales: [(f32, f32); 3] =
            std::array::from_fn(|i| corners[i].distance.map_or((1.0, 1.0), |e| (e / nodes[i].to_branch, e)));
        let rays: [(Vec3, Vec3); 3] =
            std::array::from_fn(|i| (nodes[i].origin * scales[i].0, nodes[i].direction * scales[i].1));
        let unused = [Vec4::new(0.0, 1.0, 0.0, 0.0); 3];
        let texture = || [self.base_textures[target.material as usize], 0, 0];
        let ones = [Vec4::ONE; 3];

        let (head, parts) = if first.target == ENVIRONMENT {
            match (&self.scene.background, followed) {
                (Background::Color(_), _) => {
                    return self.combine(leaf, corners, nodes.map(Some), Node::radiance);
                }
                (_, true) => (head(NODE_FIRST_ENVIRONMENT, lights, [NO_TEXTURE; 3]), [ones, unused, unused]),
                _ => {
                    let directions = nodes.map(|node| node.direction.extend(0.0));
                    let parts = [throughputs.map(|throughput| throughput.extend(1.0)), directions, unused];
                    (head(NODE_ENVIRONMENT, lights, [NO_TEXTURE; 3]), parts)
                }
            }
        } else if followed && (flat || !single) {
            let seen = candidates.unwrap_or(nodes.map(|node| (node.target, node.lit)));
            let places = seen.map(|(target, _)| self.table.target(target));
            (head(NODE_FIRST_PLANES, seen.map(|(_, lit)| lit), places), [ones, unused, unused])
        } else if !single {
            let places = nodes.map(|node| self.table.target(node.target));
            let scaled = std::array::from_fn(|i| throughputs[i].extend(scales[i].0));
            let parts = [scaled, rays.map(|ray| ray.0.extend(0.0)), rays.map(|ray| ray.1.extend(0.0))];
            (head(NODE_PLANES, lights, places), parts)
        } else {
            let at = std::array::from_fn(|i| match &target.patch {
                Some(patch) => corners[i].on_plane(patch, nodes[i]),
                None => corners[i].on_chart(nodes[i]),
            });
            (head(NODE_TEXTURE, lights, texture()), texture_parts(shades, at))
        };
        if head[0] & 7 == NODE_TEXTURE {
            self.combine(leaf, corners, nodes.map(Some), |node| node.throughput * node.local.added);
            leaf.note_texture(head[1]);
        } else {
            leaf.all_kinds = true;
        }
        leaf.texels.push(head);
        leaf.texels.extend(parts.into_iter().flatten().map(floats));
        leaf.count += 1;
    }
}

/// The paths of a leaf's corners, each once: its node at each of them.
fn paths<'n>(corners: &[Corner<'n>; 3]) -> impl Iterator<Item = [Option<&'n Node>; 3]> + use<'n> {
    let samples = corners.map(|corner| corner.sample);
    (0..3).flat_map(move |index| {
        let new = samples[index].nodes.iter().enumerate().filter(move |&(at, node)| {
            samples[..index].iter().all(|earlier| earlier.node_near(node.path, at).is_none())
        });
        new.map(move |(at, node)| samples.map(|sample| sample.node_near(node.path, at)))
    })
}

/// Lights that are not hidden, a byte a corner.
fn packed(lights: [u32; 3]) -> u32 {
    (0..3).fold(0, |packed, i| packed | (lights[i] & 0xff) << (8 * i))
}

/// `value` before the attenuation at the primary hit, which the shader multiplies in per fragment.
pub(super) fn before(value: Vec3, attenuation: Vec3) -> Vec3 {
    let one = |value: f32, attenuation: f32| if attenuation > 1e-6 { value / attenuation } else { 0.0 };
    Vec3::new(one(value.x, attenuation.x), one(value.y, attenuation.y), one(value.z, attenuation.z))
}
