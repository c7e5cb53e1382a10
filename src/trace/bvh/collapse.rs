//! Collapses obvhs's binary tree: four children a node, up to four faces a leaf.

use glam::Vec3;
use obvhs::bvh2::{Bvh2, node::Bvh2Node};

use super::{
    quad::{LANES, Quad},
    wide::{Bvh4, Child, Node},
};

impl Bvh4 {
    /// Collapses `binary`, whose leaves hold a face each; `corners` tells the positions of a face.
    pub fn new(binary: &Bvh2, corners: impl Fn(u32) -> [Vec3; 3]) -> Self {
        let mut wide = Self { nodes: vec![Node::empty()], quads: Vec::new() };
        if binary.nodes.is_empty() {
            return wide;
        }
        let faces = Faces::count(binary);
        let mut waiting = vec![(0, 0)];
        while let Some((source, target)) = waiting.pop() {
            for (lane, source) in faces.open(source).enumerate() {
                let child = if faces.of(source) <= LANES {
                    wide.quads.push(Quad::new(&faces.list(source), &corners));
                    Child::quad(wide.quads.len() - 1)
                } else {
                    waiting.push((source, wide.nodes.len()));
                    wide.nodes.push(Node::empty());
                    Child::node(wide.nodes.len() - 1)
                };
                wide.nodes[target].set(lane, binary.nodes[source].aabb(), child);
            }
        }
        wide.nodes.shrink_to_fit();
        wide.quads.shrink_to_fit();
        wide
    }
}

/// The binary tree with the number of faces below each of its nodes.
struct Faces<'b> {
    tree: &'b Bvh2,
    counts: Vec<u32>,
}

impl<'b> Faces<'b> {
    fn count(tree: &'b Bvh2) -> Self {
        let mut order = vec![0];
        let mut next = 0;
        while let Some(&node) = order.get(next) {
            order.extend(children(&tree.nodes[node]).into_iter().flatten());
            next += 1;
        }
        let mut counts = vec![0; tree.nodes.len()];
        for node in order.into_iter().rev() {
            let below = children(&tree.nodes[node]).map_or(0, |[a, b]| counts[a] + counts[b]);
            counts[node] = below + tree.nodes[node].prim_count;
        }
        Self { tree, counts }
    }

    fn of(&self, node: usize) -> usize {
        self.counts[node] as usize
    }

    /// The nodes that take the lanes of a wide node in place of `node`: the largest is opened until none is left
    /// or all lanes are taken, and a node that fits a quad only if its halves are smaller than it.
    fn open(&self, node: usize) -> impl Iterator<Item = usize> + use<> {
        let area = |node: usize| self.tree.nodes[node].aabb().half_area();
        let mut lanes = [node; LANES];
        let mut taken = 1;
        while taken < LANES {
            let worth = |node: usize| match children(&self.tree.nodes[node]) {
                Some(_) if self.of(node) > LANES => (true, area(node)),
                Some([a, b]) => (false, area(node) - area(a) - area(b)),
                None => (false, 0.0),
            };
            let best = (0..taken).max_by(|&a, &b| {
                let (a, b) = (worth(lanes[a]), worth(lanes[b]));
                a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
            });
            let Some(best) = best.filter(|&lane| worth(lanes[lane]) > (false, 0.0)) else { break };
            let Some([a, b]) = children(&self.tree.nodes[lanes[best]]) else { break };
            (lanes[best], lanes[taken]) = (a, b);
            taken += 1;
        }
        lanes.into_iter().take(taken)
    }

    /// The faces below a node.
    fn list(&self, node: usize) -> Vec<u32> {
        let mut faces = Vec::with_capacity(self.of(node));
        let mut waiting = vec![node];
        while let Some(node) = waiting.pop() {
            let node = &self.tree.nodes[node];
            let first = node.first_index as usize;
            match children(node) {
                Some(children) => waiting.extend(children),
                None => faces.extend(&self.tree.primitive_indices[first..first + node.prim_count as usize]),
            }
        }
        faces
    }
}

/// The two children of an inner node.
fn children(node: &Bvh2Node) -> Option<[usize; 2]> {
    let first = node.first_index as usize;
    (!node.is_leaf()).then_some([first, first + 1])
}
