//! The nodes that a leaf owns: paths shared by its corners, heaviest first (design §5).

use glam::Vec3;

use super::table::{SceneTable, Texel, floats};
use crate::constants::*;
use crate::refine::samples::Sample;
use crate::scene::patch::{ENVIRONMENT, Targets};
use crate::scene::{Background, Scene};
use crate::trace::sample::{Node, slot};

/// What the corners of a leaf share, and what they do not.
#[derive(Debug, Clone, Default)]
pub struct LeafNodes {
    /// Encoded nodes, heaviest first.
    pub texels: Vec<Texel>,
    /// Number of encoded nodes.
    pub count: u32,
    /// By corner and branch: radiance that is Gouraud-shaded, before the attenuation at the vertex.
    pub comb: [[Vec3; 2]; 3],
    /// Whether every path is shared, with equal light visibility: a defined face (paper, Fig. 5).
    pub defined: bool,
    /// Shared paths for which there was no room.
    pub overflow: u32,
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
    /// Texture references by material, for charts.
    pub base_textures: &'a [u32],
    /// Most nodes of a leaf.
    pub room: usize,
}

struct Shared<'n> {
    nodes: [&'n Node; 3],
    weight: f32,
}

impl Matcher<'_> {
    /// Matches the paths of a leaf's corners; the `room` heaviest become nodes.
    pub fn leaf(&self, corners: [Corner; 3], room: usize) -> LeafNodes {
        let mut leaf = LeafNodes { defined: true, ..LeafNodes::default() };
        let mut shared: Vec<Shared> = Vec::new();
        for (index, corner) in corners.iter().enumerate() {
            for node in corner.sample.nodes {
                if corners[..index].iter().any(|earlier| earlier.sample.node(node.path).is_some()) {
                    continue; // judged at the first corner that has the path
                }
                let found = corners.map(|other| other.sample.node(node.path));
                match found {
                    [Some(a), Some(b), Some(c)] if self.interpolates([a, b, c]) => {
                        leaf.defined &= a.lit == b.lit && b.lit == c.lit;
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
                leaf.count += 1;
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
        let throughputs: [Vec3; 3] = std::array::from_fn(|i| {
            before(nodes[i].throughput, corners[i].sample.primary.attenuation[branch])
        });
        let lit = (0..3).fold(0, |lit, i| lit | (nodes[i].lit & 0xff) << (8 * i));
        let mut targets: Vec<u32> = nodes.iter().map(|node| node.target).collect();
        targets.dedup();
        if targets.len() == 3 && targets[0] == targets[2] {
            targets.pop();
        }
        let head = |kind: u32, words: [u32; 3]| {
            let count = targets.len() as u32;
            [kind | (branch as u32) << 3 | count << 4 | lit << 8, words[0], words[1], words[2]]
        };
        let places: [u32; 3] =
            std::array::from_fn(|i| targets.get(i).map_or(0, |&target| self.table.target(target)));

        if first.target == ENVIRONMENT {
            if !matches!(self.scene.background, Background::Environment(_)) {
                self.combine(leaf, corners, nodes.map(Some), Node::radiance);
                leaf.texels.push(head(NODE_NONE, [0; 3]));
            } else if first.bounces == 1 {
                leaf.texels.push(head(NODE_FIRST_ENVIRONMENT, [0; 3]));
            } else {
                leaf.texels.push(head(NODE_ENVIRONMENT, [0; 3]));
                for (node, throughput) in nodes.iter().zip(throughputs) {
                    leaf.texels.push(floats(throughput.extend(0.0)));
                    leaf.texels.push(floats(node.direction.extend(0.0)));
                }
            }
        } else if target.patch.is_none() {
            self.combine(leaf, corners, nodes.map(Some), |node| node.throughput * node.local.added);
            leaf.texels.push(head(NODE_CHART, [self.base_textures[target.material as usize], 0, 0]));
            for ((node, corner), throughput) in nodes.iter().zip(corners).zip(throughputs) {
                let w = corner.distance.map_or(1.0, |e| e / (e + node.after));
                leaf.texels.push(floats((throughput * node.local.textured).extend(w)));
                leaf.texels.push(floats((node.uv * w).extend(w).extend(0.0)));
            }
        } else if first.bounces == 1 {
            leaf.texels.push(head(NODE_FIRST_PLANE, places));
        } else {
            leaf.texels.push(head(NODE_PLANE, places));
            for ((node, corner), throughput) in nodes.iter().zip(corners).zip(throughputs) {
                let (scale, e) = corner.distance.map_or((1.0, 1.0), |e| (e / node.to_branch, e));
                leaf.texels.push(floats(throughput.extend(scale)));
                leaf.texels.push(floats((node.origin * scale).extend(0.0)));
                leaf.texels.push(floats((node.direction * e).extend(0.0)));
            }
        }
    }
}

/// `value` before the attenuation at the primary hit, which the shader multiplies in per fragment.
fn before(value: Vec3, attenuation: Vec3) -> Vec3 {
    let one = |value: f32, attenuation: f32| if attenuation > 1e-6 { value / attenuation } else { 0.0 };
    Vec3::new(
        one(value.x, attenuation.x),
        one(value.y, attenuation.y),
        one(value.z, attenuation.z),
    )
}
