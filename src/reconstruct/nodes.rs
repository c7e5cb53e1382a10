//! The nodes that a leaf owns: paths shared by its corners, heaviest first (design §5).

use glam::{Vec3, Vec4};

use super::table::{SceneTable, Texel, floats};
use crate::constants::*;
use crate::refine::samples::Sample;
use crate::scene::patch::{ENVIRONMENT, Targets};
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
    fn note_texture(&mut self, reference: u32) {
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

struct Shared<'n> {
    nodes: [&'n Node; 3],
    weight: f32,
}

impl Matcher<'_> {
    /// Matches the paths of a leaf's corners; the `room` heaviest become nodes.
    pub fn leaf(&self, corners: [Corner; 3], room: usize) -> LeafNodes {
        let mut leaf = LeafNodes::default();
        let mut shared: Vec<Shared> = Vec::new();
        for (index, corner) in corners.iter().enumerate() {
            for node in corner.sample.nodes {
                if corners[..index].iter().any(|earlier| earlier.sample.node(node.path).is_some()) {
                    continue; // judged at the first corner that has the path
                }
                let found = corners.map(|other| other.sample.node(node.path));
                match found {
                    [Some(a), Some(b), Some(c)] if self.interpolates([a, b, c]) => {
                        leaf.defined &= [(a, b), (b, c), (c, a)]
                            .iter()
                            .all(|(one, other)| one.target != other.target || one.lit == other.lit);
                        let weight =
                            [a, b, c].map(|n| n.radiance().max_element()).into_iter().fold(0.0, f32::max);
                        shared.push(Shared { nodes: [a, b, c], weight });
                    }
                    _ => {
                        leaf.defined = false;
                        self.combine(&mut leaf, &corners, found, Node::radiance);
                    }
                }
            }
        }
        shared.sort_by(|a, b| b.weight.total_cmp(&a.weight).then(a.nodes[0].path.cmp(&b.nodes[0].path)));
        for (rank, path) in shared.iter().enumerate() {
            if rank < room {
                self.encode(&mut leaf, &corners, path.nodes);
            } else {
                leaf.overflow += 1;
                self.combine(&mut leaf, &corners, path.nodes.map(Some), Node::radiance);
            }
        }
        leaf
    }

    /// Whether a path can be followed per fragment: one target, or planar ones with outlines.
    fn interpolates(&self, nodes: [&Node; 3]) -> bool {
        let [a, b, c] = nodes.map(|node| node.target);
        let outlined = |target: u32| {
            self.targets.targets[target as usize].patch.as_ref().is_some_and(|patch| patch.outline.is_some())
        };
        a == b && b == c || [a, b, c].into_iter().all(outlined)
    }

    /// Adds `value` of each node to its corner's Gouraud-shaded colour.
    fn combine(
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

    fn encode(&self, leaf: &mut LeafNodes, corners: &[Corner; 3], nodes: [&Node; 3]) {
        let [first, ..] = nodes;
        let target = &self.targets.targets[first.target as usize];
        let branch = slot(first.first);
        let lit = (0..3).fold(0, |lit, i| lit | (nodes[i].lit & 0xff) << (8 * i));
        let single = nodes.iter().all(|node| node.target == first.target);
        let flat = target.patch.is_some() && first.bounces == 1 && single;
        let emissive =
            self.scene.materials.get(target.material as usize).is_some_and(|m| m.emissive_texture.is_some());
        if flat && leaf.first.is_none() && !emissive {
            leaf.first = Some((self.table.target(first.target), lit | (branch as u32) << 31));
            leaf.first_texture = self.base_textures[target.material as usize];
            return;
        }
        let head = |kind: u32, words: [u32; 3]| {
            [kind | (branch as u32) << 3 | 3 << 4 | lit << 8, words[0], words[1], words[2]]
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
            match (&self.scene.background, first.bounces) {
                (Background::Color(_), _) => {
                    return self.combine(leaf, corners, nodes.map(Some), Node::radiance);
                }
                (_, 1) => (head(NODE_FIRST_ENVIRONMENT, [NO_TEXTURE; 3]), [ones, unused, unused]),
                _ => {
                    let directions = nodes.map(|node| node.direction.extend(0.0));
                    let parts = [throughputs.map(|throughput| throughput.extend(1.0)), directions, unused];
                    (head(NODE_ENVIRONMENT, [NO_TEXTURE; 3]), parts)
                }
            }
        } else if first.bounces == 1 && (flat || !single) {
            let places = nodes.map(|node| self.table.target(node.target));
            (head(NODE_FIRST_PLANES, places), [ones, unused, unused])
        } else if !single {
            let places = nodes.map(|node| self.table.target(node.target));
            let scaled = std::array::from_fn(|i| throughputs[i].extend(scales[i].0));
            let parts = [scaled, rays.map(|ray| ray.0.extend(0.0)), rays.map(|ray| ray.1.extend(0.0))];
            (head(NODE_PLANES, places), parts)
        } else if let Some(patch) = &target.patch {
            // With O = Σ b e/d o, D = Σ b e r, S = Σ b e/d: s = (k S − N·O) / N·D, u = (G·O + c S + s G·D) / S.
            let [u, v] = patch.base_uv;
            let scaled = std::array::from_fn(|i| shades[i].extend(scales[i].0));
            let bundle = std::array::from_fn(|i| {
                let ((origin, direction), scale) = (rays[i], scales[i].0);
                Vec4::new(
                    patch.distance * scale - patch.normal.dot(origin),
                    patch.normal.dot(direction),
                    u.truncate().dot(origin) + u.w * scale,
                    v.truncate().dot(origin) + v.w * scale,
                )
            });
            let rest = rays.map(|(_, d)| Vec4::new(u.truncate().dot(d), v.truncate().dot(d), 0.0, 0.0));
            (head(NODE_TEXTURE, texture()), [scaled, bundle, rest])
        } else {
            let weights: [f32; 3] =
                std::array::from_fn(|i| corners[i].distance.map_or(1.0, |e| e / (e + nodes[i].after)));
            let scaled = std::array::from_fn(|i| shades[i].extend(weights[i]));
            let projective = std::array::from_fn(|i| {
                Vec4::new(0.0, 1.0, nodes[i].uv.x * weights[i], nodes[i].uv.y * weights[i])
            });
            (head(NODE_TEXTURE, texture()), [scaled, projective, [Vec4::ZERO; 3]])
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

/// `value` before the attenuation at the primary hit, which the shader multiplies in per fragment.
pub(super) fn before(value: Vec3, attenuation: Vec3) -> Vec3 {
    let one = |value: f32, attenuation: f32| if attenuation > 1e-6 { value / attenuation } else { 0.0 };
    Vec3::new(one(value.x, attenuation.x), one(value.y, attenuation.y), one(value.z, attenuation.z))
}
