//! A BVH with four boxes a node and four triangles a leaf, each tested side by side: obvhs's binary one, collapsed.

use glam::{Vec3, Vec4};
use obvhs::aabb::Aabb;

use super::quad::{LANES, Quad};

/// Smallest magnitude of a direction's component that is inverted as it is.
pub(super) const SMALLEST_COMPONENT: f32 = 1e-15;

/// Subtrees that wait for their turn before the heap is asked for more room: a balanced tree of 50,000
/// faces needs 24.
const INLINE_STACK: usize = 24;

/// The hierarchy. Node 0 is the root, also of an empty scene.
pub(super) struct Bvh4 {
    pub(super) nodes: Vec<Node>,
    pub(super) quads: Vec<Quad>,
}

/// Lower and upper bounds of four boxes along each axis.
pub(super) type Bounds = [[Vec4; 2]; 3];

/// Four boxes and what is in them, in two lines of the cache.
#[derive(Clone)]
#[repr(align(64))]
pub(super) struct Node {
    /// The box of a lane without a child is inside out: nothing enters it.
    bounds: Bounds,
    children: [Child; LANES],
}

/// An index into the nodes or, with the highest bit, into the quads.
#[derive(Clone, Copy, Default)]
pub(super) struct Child(u32);

/// The direction with components that can be inverted: a finite inverse keeps 0 · ∞ out of the box tests.
#[inline(always)]
pub(super) fn invertible(direction: Vec3) -> Vec3 {
    direction.abs().max(Vec3::splat(SMALLEST_COMPONENT)).copysign(direction)
}

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
        Self {
            origin: origin.to_array().map(Vec4::splat),
            inverse: invertible(direction).recip().to_array().map(Vec4::splat),
            near: direction.to_array().map(|d| usize::from(d.is_sign_negative())),
        }
    }
}

impl Node {
    pub fn empty() -> Self {
        let inside_out = [Vec4::INFINITY, Vec4::NEG_INFINITY];
        Self { bounds: [inside_out; 3], children: [Child::default(); LANES] }
    }

    pub fn set(&mut self, lane: usize, bounds: &Aabb, child: Child) {
        for (axis, [low, high]) in self.bounds.iter_mut().enumerate() {
            low[lane] = bounds.min[axis];
            high[lane] = bounds.max[axis];
        }
        self.children[lane] = child;
    }

    /// Takes over one of the other node's boxes with what is in it.
    pub fn take(&mut self, lane: usize, other: &Self, from: usize) {
        for (bounds, others) in self.bounds.iter_mut().zip(&other.bounds) {
            for (bound, other) in bounds.iter_mut().zip(others) {
                bound[lane] = other[from];
            }
        }
        self.children[lane] = other.children[from];
    }

    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    pub fn child(&self, lane: usize) -> Child {
        self.children[lane]
    }

    /// The boxes that have something in them.
    fn boxes(&self) -> impl Iterator<Item = (Vec3, Vec3, Child)> {
        let corner = |lane: usize, side: usize| Vec3::from(self.bounds.map(|axis| axis[side][lane]));
        let boxes = (0..LANES).map(move |lane| (corner(lane, 0), corner(lane, 1), self.children[lane]));
        boxes.filter(|(low, high, _)| low.cmple(*high).all())
    }

    /// Distances at which the ray enters the four boxes, and a bit for each that it enters before `end`.
    #[inline(always)]
    pub fn enter(&self, ray: &BoxProbe, end: f32) -> ([f32; LANES], u32) {
        let plane =
            |axis: usize, side: usize| (self.bounds[axis][side & 1] - ray.origin[axis]) * ray.inverse[axis];
        let [x, y, z] = ray.near;
        // In pairs, since it is latency that a descent waits for.
        let near = plane(0, x).max(plane(1, y)).max(plane(2, z).max(Vec4::ZERO));
        let far = plane(0, x ^ 1).min(plane(1, y ^ 1)).min(plane(2, z ^ 1).min(Vec4::splat(end)));
        (near.to_array(), near.cmple(far).bitmask())
    }
}

impl Node {
    /// The nearest child among those that are `entered`, at least one; the others wait on the stack.
    #[inline(always)]
    fn nearest(&self, near: &[f32; LANES], mut entered: u32, stack: &mut Stack) -> Child {
        let mut next = || {
            let lane = entered.trailing_zeros() as usize % LANES;
            entered &= entered - 1;
            (lane, entered == 0)
        };
        let (first, alone) = next();
        if alone {
            return self.children[first];
        }
        let entry = |lane: usize| u64::from(near[lane].to_bits()) << 32 | u64::from(self.children[lane].0);
        let mut nearest = entry(first);
        loop {
            let (lane, last) = next();
            let other = entry(lane);
            stack.push(nearest.max(other));
            nearest = nearest.min(other);
            if last {
                return Child(nearest as u32);
            }
        }
    }
}

impl Child {
    pub const ROOT: Self = Self(0);
    const QUAD: u32 = 1 << 31;

    pub fn node(index: usize) -> Self {
        Self(index as u32)
    }

    pub fn quad(index: usize) -> Self {
        Self(index as u32 | Self::QUAD)
    }

    #[inline(always)]
    pub fn is_quad(self) -> bool {
        self.0 & Self::QUAD != 0
    }

    #[inline(always)]
    pub fn index(self) -> usize {
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

    /// The topmost subtree that is entered before `end`; those above it are forgotten.
    #[inline(always)]
    fn pop_before(&mut self, end: f32) -> Option<Child> {
        loop {
            let entry = self.pop()?;
            if f32::from_bits((entry >> 32) as u32) <= end {
                return Some(Child(entry as u32));
            }
        }
    }
}

impl Bvh4 {
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

    /// Where rays start that belong to no packet.
    #[inline(always)]
    pub fn root(&self) -> &[Node] {
        &self.nodes[..1]
    }

    #[inline(always)]
    pub fn node(&self, child: Child) -> &Node {
        &self.nodes[child.index()]
    }

    /// Calls `visit` with the quads below `entries` whose boxes the ray enters before `end`, roughly in that order, and
    /// goes on with the nearer end that it returns, or stops without one. Whether it stopped.
    #[inline(always)]
    pub fn traverse(
        &self,
        entries: &[Node],
        ray: &BoxProbe,
        mut end: f32,
        mut visit: impl FnMut(&Quad, f32) -> Option<f32>,
    ) -> bool {
        let mut stack = Stack::new();
        for entry in entries {
            let mut node = entry;
            'subtree: loop {
                let (near, entered) = node.enter(ray, end);
                let mut child = if entered != 0 {
                    node.nearest(&near, entered, &mut stack)
                } else if let Some(waiting) = stack.pop_before(end) {
                    waiting
                } else {
                    break;
                };
                while child.is_quad() {
                    match visit(&self.quads[child.index()], end) {
                        Some(nearer) => end = nearer,
                        None => return true,
                    }
                    match stack.pop_before(end) {
                        Some(waiting) => child = waiting,
                        None => break 'subtree,
                    }
                }
                node = self.node(child);
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use glam::Vec3A;
    use obvhs::{
        BvhBuildParams,
        bvh2::{Bvh2, builder::build_bvh2},
    };
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
        tree.traverse(tree.root(), ray, f32::INFINITY, |quad, mut end| {
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
