//! A BVH with four boxes a node and four triangles a leaf, each tested side by side: obvhs's binary one, collapsed.

use glam::{Vec3, Vec4};
use obvhs::{
    aabb::Aabb,
    bvh2::{Bvh2, node::Bvh2Node},
};

use super::quad::{LANES, Quad};

/// Smallest magnitude of a direction's component that is inverted as it is.
const SMALLEST_COMPONENT: f32 = 1e-15;

/// Subtrees that wait for their turn before the heap is asked for more room: a balanced tree of 50,000
/// faces needs 24.
const INLINE_STACK: usize = 24;

/// The hierarchy. Node 0 is the root, also of an empty scene.
pub(super) struct Bvh4 {
    nodes: Vec<Node>,
    quads: Vec<Quad>,
}

/// Four boxes and what is in them, in two lines of the cache.
#[derive(Clone)]
#[repr(align(64))]
struct Node {
    /// Lower and upper bounds along each axis. The box of a lane without a child is inside out: nothing enters it.
    bounds: [[Vec4; 2]; 3],
    children: [Child; LANES],
}

/// An index into the nodes or, with the highest bit, into the quads.
#[derive(Clone, Copy, Default)]
struct Child(u32);

/// A ray as the box tests want it.
pub(super) struct BoxProbe {
    origin: [Vec4; 3],
    inverse: [Vec4; 3],
    /// Which of a box's two bounds along each axis the ray meets first.
    near: [usize; 3],
}

impl BoxProbe {
    /// The ray from `origin` along the unit vector `direction`.
    #[inline(always)]
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        // A finite inverse keeps 0 · ∞ out of the box test.
        let invertible = direction.abs().max(Vec3::splat(SMALLEST_COMPONENT)).copysign(direction);
        Self {
            origin: origin.to_array().map(Vec4::splat),
            inverse: invertible.recip().to_array().map(Vec4::splat),
            near: direction.to_array().map(|d| usize::from(d.is_sign_negative())),
        }
    }
}

impl Node {
    fn empty() -> Self {
        let inside_out = [Vec4::INFINITY, Vec4::NEG_INFINITY];
        Self { bounds: [inside_out; 3], children: [Child::default(); LANES] }
    }

    fn set(&mut self, lane: usize, bounds: &Aabb, child: Child) {
        for (axis, [low, high]) in self.bounds.iter_mut().enumerate() {
            low[lane] = bounds.min[axis];
            high[lane] = bounds.max[axis];
        }
        self.children[lane] = child;
    }

    /// The boxes that have something in them.
    fn boxes(&self) -> impl Iterator<Item = (Vec3, Vec3, Child)> {
        let corner = |lane: usize, side: usize| Vec3::from(self.bounds.map(|axis| axis[side][lane]));
        let boxes = (0..LANES).map(move |lane| (corner(lane, 0), corner(lane, 1), self.children[lane]));
        boxes.filter(|(low, high, _)| low.cmple(*high).all())
    }

    /// Distances at which the ray enters the four boxes, and a bit for each that it enters before `end`.
    #[inline(always)]
    fn enter(&self, ray: &BoxProbe, end: f32) -> ([f32; LANES], u32) {
        let plane =
            |axis: usize, side: usize| (self.bounds[axis][side & 1] - ray.origin[axis]) * ray.inverse[axis];
        let [x, y, z] = ray.near;
        // In pairs, since it is latency that a descent waits for.
        let near = plane(0, x).max(plane(1, y)).max(plane(2, z).max(Vec4::ZERO));
        let far = plane(0, x ^ 1).min(plane(1, y ^ 1)).min(plane(2, z ^ 1).min(Vec4::splat(end)));
        (near.to_array(), near.cmple(far).bitmask())
    }
}

impl Child {
    const QUAD: u32 = 1 << 31;

    fn node(index: usize) -> Self {
        Self(index as u32)
    }

    fn quad(index: usize) -> Self {
        Self(index as u32 | Self::QUAD)
    }

    #[inline(always)]
    fn is_quad(self) -> bool {
        self.0 & Self::QUAD != 0
    }

    #[inline(always)]
    fn index(self) -> usize {
        (self.0 & !Self::QUAD) as usize
    }
}

/// Subtrees to come, each with the distance at which the ray enters it: above the child's 32 bits, so that
/// they compare by distance.
struct Stack {
    inline: [u64; INLINE_STACK],
    length: usize,
    /// Where a degenerate tree is deeper than `inline`.
    spilled: Vec<u64>,
}

impl Stack {
    #[inline(always)]
    fn new() -> Self {
        Self { inline: [0; INLINE_STACK], length: 0, spilled: Vec::new() }
    }

    #[inline(always)]
    fn push(&mut self, entry: u64) {
        match self.inline.get_mut(self.length) {
            Some(free) => {
                *free = entry;
                self.length += 1;
            }
            None => self.spilled.push(entry),
        }
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<u64> {
        if self.length == INLINE_STACK
            && let Some(entry) = self.spilled.pop()
        {
            return Some(entry);
        }
        self.length = self.length.checked_sub(1)?;
        self.inline.get(self.length).copied()
    }
}

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
        wide
    }

    /// Whether `accepts` any of the faces in boxes that `meets`, given lower and upper corner, says are worth opening.
    pub fn any_face(&self, meets: impl Fn(Vec3, Vec3) -> bool, mut accepts: impl FnMut(u32) -> bool) -> bool {
        let mut open = vec![0];
        while let Some(node) = open.pop() {
            for (low, high, child) in self.nodes[node].boxes() {
                if !meets(low, high) {
                    continue;
                }
                if !child.is_quad() {
                    open.push(child.index());
                } else if self.quads[child.index()].faces().any(&mut accepts) {
                    return true;
                }
            }
        }
        false
    }

    /// Calls `visit` with the quads whose boxes the ray enters before `end`, roughly in that order, and goes on
    /// with the nearer end that it returns, or stops without one. Whether it stopped.
    #[inline(always)]
    pub fn traverse(
        &self,
        ray: &BoxProbe,
        mut end: f32,
        mut visit: impl FnMut(&Quad, f32) -> Option<f32>,
    ) -> bool {
        let mut stack = Stack::new();
        let mut child = Child::node(0);
        loop {
            if child.is_quad() {
                match visit(&self.quads[child.index()], end) {
                    Some(nearer) => end = nearer,
                    None => return true,
                }
            } else {
                let node = &self.nodes[child.index()];
                let (near, mut entered) = node.enter(ray, end);
                if entered != 0 {
                    let mut next = || {
                        let lane = entered.trailing_zeros() as usize % LANES;
                        entered &= entered - 1;
                        (lane, entered == 0)
                    };
                    let (first, alone) = next();
                    child = node.children[first];
                    if alone {
                        continue;
                    }
                    let entry = |lane: usize| {
                        u64::from(near[lane].to_bits()) << 32 | u64::from(node.children[lane].0)
                    };
                    let mut nearest = entry(first);
                    loop {
                        let (lane, last) = next();
                        let other = entry(lane);
                        stack.push(nearest.max(other));
                        nearest = nearest.min(other);
                        if last {
                            break;
                        }
                    }
                    child = Child(nearest as u32);
                    continue;
                }
            }
            child = loop {
                let Some(entry) = stack.pop() else { return false };
                if f32::from_bits((entry >> 32) as u32) <= end {
                    break Child(entry as u32);
                }
            };
        }
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

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use glam::Vec3A;
    use obvhs::{BvhBuildParams, bvh2::builder::build_bvh2};
    use proptest::prelude::*;

    use super::super::{Hit, quad::Probe};
    use super::*;

    fn tree(faces: &[[Vec3; 3]]) -> Bvh4 {
        let boxes: Vec<Aabb> = faces
            .iter()
            .map(|&[a, b, c]| Aabb {
                min: Vec3A::from(a.min(b).min(c) - 1e-3),
                max: Vec3A::from(a.max(b).max(c) + 1e-3),
            })
            .collect();
        let params = BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::medium_build() };
        let binary = match boxes.len() {
            0 => Bvh2::default(),
            _ => build_bvh2(&boxes, params, &mut Duration::default()),
        };
        Bvh4::new(&binary, |face| faces[face as usize])
    }

    fn nearest(quads: &[Quad], probe: &Probe) -> Option<Hit> {
        let hits = quads.iter().filter_map(|quad| {
            let crossing = quad.intersect(probe, f32::INFINITY)?;
            crossing.each().map(|lane| crossing.hit(lane, quad)).min_by(|a, b| a.t.total_cmp(&b.t))
        });
        hits.min_by(|a, b| a.t.total_cmp(&b.t))
    }

    fn traced(tree: &Bvh4, ray: &BoxProbe, probe: &Probe) -> Option<f32> {
        let mut nearest = None;
        tree.traverse(ray, f32::INFINITY, |quad, mut end| {
            for hit in quad.intersect(probe, end).iter().flat_map(|c| c.each().map(|lane| c.hit(lane, quad)))
            {
                if hit.t < end {
                    end = hit.t;
                    nearest = Some(end);
                }
            }
            Some(end)
        });
        nearest
    }

    fn point() -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(-1.0..1.0_f32).prop_map(Vec3::from)
    }

    proptest! {
        /// The tree finds what testing every triangle by itself finds, also along the axes.
        #[test]
        fn nothing_is_lost(
            faces in prop::collection::vec(prop::array::uniform3(point()), 0..60),
            origin in point(),
            direction in prop_oneof![point(), Just(Vec3::X), Just(Vec3::NEG_Y), Just(Vec3::Z)],
        ) {
            let Some(direction) = direction.try_normalize() else { return Ok(()) };
            let quads: Vec<Quad> =
                (0..faces.len() as u32).map(|face| Quad::new(&[face], |face| faces[face as usize])).collect();
            let (ray, probe) = (BoxProbe::new(origin, direction), Probe::new(origin, direction));
            let found = traced(&tree(&faces), &ray, &probe);
            prop_assert_eq!(found, nearest(&quads, &probe).map(|hit| hit.t));
        }
    }

    #[test]
    fn deep_trees_spill() {
        let mut stack = Stack::new();
        let entries: Vec<u64> = (0..3 * INLINE_STACK as u64).collect();
        entries.iter().for_each(|&entry| stack.push(entry));
        let popped: Vec<u64> = std::iter::from_fn(|| stack.pop()).collect();
        assert!(popped.iter().eq(entries.iter().rev()));
        assert_eq!(stack.pop(), None);
    }

    #[test]
    fn every_face_is_in_one_quad() {
        for count in [1, 2, 4, 5, 17, 300] {
            let corner = |i: usize| Vec3::new(i as f32, (i * i % 7) as f32, (i % 5) as f32);
            let faces: Vec<[Vec3; 3]> = (0..count)
                .map(|i| [corner(i), corner(i) + Vec3::X * 0.3, corner(i) + Vec3::Y * 0.3])
                .collect();
            let tree = tree(&faces);
            let lanes: usize = tree.quads.iter().map(|quad| quad.faces().count()).sum();
            assert_eq!(lanes, count);
            assert!(count < 17 || tree.quads.len() * 3 < count * 2, "{} quads", tree.quads.len());
        }
    }
}
