//! The nodes that a leaf owns: paths shared by its corners, heaviest first (design §5).

use glam::{Vec3, Vec4};

use super::beside::Beside;
use super::parts::Part;
use super::table::{SceneTable, Texel, floats};
use crate::constants::*;
use crate::refine::samples::Sample;
use crate::refine::shape::Shape;
use crate::scene::patch::{Patch, TargetId, Targets};
use crate::scene::{Background, Scene};
use crate::trace::Shadows;
use crate::trace::sample::Node;

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
    /// e/d, e/d o and e r of a node (design §5 rule 2).
    fn weighted(self, node: &Node) -> (f32, Vec3, Vec3) {
        let (scale, e) = self.distance.map_or((1.0, 1.0), |e| (e / node.to_branch, e));
        (scale, node.origin * scale, node.direction * e)
    }

    /// On a plane, by the ray (design §5 rule 2). With O = Σ b e/d o, D = Σ b e r, S = Σ b e/d:
    /// s = (k S − N·O) / N·D, u = (G·O + c S + s G·D) / S.
    pub(super) fn on_plane(self, patch: &Patch, node: &Node) -> Place {
        let (scale, origin, direction) = self.weighted(node);
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
    /// Which surfaces lights may be hidden from.
    pub shadows: Shadows,
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
                && Shape::of(&[a, b, c], self.targets).is_some()
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
        Shape::of(&[a, b, c], self.targets).is_some() && [(a, b), (b, c), (c, a)].into_iter().all(lit_alike)
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
                let branch = node.first.index();
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
        let Some(shape) = Shape::of(&nodes, self.targets) else {
            return self.combine(leaf, corners, nodes.map(Some), Node::radiance);
        };
        let target = &self.targets.targets[nodes[0].target as usize];
        let branch = nodes[0].first.index();
        let lights = nodes.map(|node| node.lit);
        let head = |kind: u32, lights: [u32; 3], words: [u32; 3]| {
            [kind | (branch as u32) << 3 | 3 << 4 | packed(lights) << 8, words[0], words[1], words[2]]
        };
        let throughputs: [Vec3; 3] = std::array::from_fn(|i| {
            before(nodes[i].throughput, corners[i].sample.primary.attenuation[branch])
        });
        let no_place = [Vec4::new(0.0, 1.0, 0.0, 0.0); 3];
        let no_parts = [[Vec4::ONE; 3], no_place, no_place];
        let texture = |leaf: &mut LeafNodes, places: [Place; 3]| {
            self.combine(leaf, corners, nodes.map(Some), |node| node.throughput * node.local.added);
            let reference = self.base_textures[target.material as usize];
            leaf.note_texture(reference);
            let shades = std::array::from_fn(|i| throughputs[i] * nodes[i].local.textured);
            (head(NODE_TEXTURE, lights, [reference, 0, 0]), texture_parts(shades, places))
        };

        let (head, parts) = match (shape, &target.patch) {
            (Shape::Sky { own }, _) => match (&self.scene.background, own) {
                (Background::Color(_), _) => {
                    return self.combine(leaf, corners, nodes.map(Some), Node::radiance);
                }
                (_, true) => (head(NODE_FIRST_ENVIRONMENT, lights, [NO_TEXTURE; 3]), no_parts),
                (_, false) => {
                    let directions = nodes.map(|node| node.direction.extend(0.0));
                    let parts = [throughputs.map(|throughput| throughput.extend(1.0)), directions, no_place];
                    (head(NODE_ENVIRONMENT, lights, [NO_TEXTURE; 3]), parts)
                }
            },
            (Shape::Plane { own: true } | Shape::Planes { own: true }, _) => {
                let candidates = self.candidates(nodes, beside);
                let emits = self.scene.materials[target.material as usize].emissive_texture.is_some();
                let is_one = shape == Shape::Plane { own: true } && candidates.is_none();
                if is_one && leaf.first.is_none() && !emits {
                    leaf.first =
                        Some((self.table.target(nodes[0].target), packed(lights) | (branch as u32) << 31));
                    leaf.first_texture = self.base_textures[target.material as usize];
                    return;
                }
                let seen = candidates.unwrap_or(nodes.map(|node| (node.target, node.lit)));
                let places = seen.map(|(target, _)| self.table.target(target));
                (head(NODE_FIRST_PLANES, seen.map(|(_, lit)| lit), places), no_parts)
            }
            (Shape::Planes { own: false }, _) => {
                let places = nodes.map(|node| self.table.target(node.target));
                let rays: [_; 3] = std::array::from_fn(|i| corners[i].weighted(nodes[i]));
                let parts = [
                    std::array::from_fn(|i| throughputs[i].extend(rays[i].0)),
                    rays.map(|(_, origin, _)| origin.extend(0.0)),
                    rays.map(|(.., direction)| direction.extend(0.0)),
                ];
                (head(NODE_PLANES, lights, places), parts)
            }
            (Shape::Plane { own: false }, Some(patch)) => {
                texture(leaf, std::array::from_fn(|i| corners[i].on_plane(patch, nodes[i])))
            }
            (Shape::Plane { own: false } | Shape::Chart, _) => {
                texture(leaf, std::array::from_fn(|i| corners[i].on_chart(nodes[i])))
            }
        };
        leaf.all_kinds |= head[0] & 7 != NODE_TEXTURE;
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
