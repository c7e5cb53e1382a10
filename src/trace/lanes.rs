//! Rays of a packet tested side by side, eight a vector, against one box or triangle at a time: where a processor has AVX2.
//!
//! They find what rays find that are traced one by one, to the bit: the same boxes and triangles are tested by the same
//! operations, in another order.

use glam::Vec3;
use pulp::x86::V3;
use pulp::{NullaryFnOnce, Simd, f32x8, m32x8, u32x8};

use super::Hit;
use super::packet::{Packet, PacketProbe};
use super::quad::{LANES, Quad};
use super::wide::{Bounds, Bvh4, Child, Node, invertible};

/// Rays in a vector, and vectors that go through the tree together.
const WIDTH: usize = 8;
const VECTORS: usize = 2;

/// Rays that go through the tree together.
pub(super) const RAYS: usize = WIDTH * VECTORS;

/// Boxes that wait before the heap is asked for more room.
const INLINE_STACK: usize = 96;

/// Whether this processor can.
pub(super) fn token() -> Option<V3> {
    V3::try_new()
}

/// The nearest hits below `entries` of up to [`RAYS`] rays that are longest along the same axis, origins and unit directions;
/// every face counts.
pub(super) fn closest(
    simd: V3,
    tree: &Bvh4,
    entries: &[Node],
    rays: &[(Vec3, Vec3)],
    found: impl FnMut(usize, Option<Hit>),
) {
    simd.vectorize(Search { simd, tree, entries, rays, found });
}

struct Search<'a, F> {
    simd: V3,
    tree: &'a Bvh4,
    entries: &'a [Node],
    rays: &'a [(Vec3, Vec3)],
    found: F,
}

impl<F: FnMut(usize, Option<Hit>)> NullaryFnOnce for Search<'_, F> {
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
        let mut lanes = Lanes::new(self.simd, self.rays);
        let mut packet = Packet::EMPTY;
        for &(origin, direction) in self.rays {
            packet.add(origin, direction);
        }
        lanes.traverse(self.tree, self.entries, &PacketProbe::new(&packet));
        lanes.hits(self.rays.len(), &mut self.found);
    }
}

/// One number a ray.
type Numbers = [f32x8; VECTORS];

/// Rays, and the nearest that they have met.
struct Lanes {
    simd: V3,
    /// Vectors that have rays.
    vectors: usize,
    origin: [Numbers; 3],
    inverse: [Numbers; 3],
    /// As [`Probe`](super::quad::Probe) has it.
    axes: [usize; 3],
    shear: [Numbers; 2],
    scale: Numbers,
    /// Below 0 for a lane without a ray, which meets nothing.
    end: Numbers,
    /// The farthest of the ends.
    farthest: f32,
    face: [u32x8; VECTORS],
    u: Numbers,
    v: Numbers,
}

/// Which coordinate axes become the first, second and third of a ray's sheared space: the direction is longest in the third.
#[inline(always)]
pub(super) fn axes(direction: Vec3) -> [usize; 3] {
    let size = direction.abs();
    if size.z >= size.x && size.z >= size.y {
        [0, 1, 2]
    } else if size.y >= size.x {
        [2, 0, 1]
    } else {
        [1, 2, 0]
    }
}

impl Lanes {
    /// Functions that take closures are avoided: they would be compiled without AVX2, and all they call be calls.
    #[inline(always)]
    fn new(simd: V3, rays: &[(Vec3, Vec3)]) -> Self {
        let axes = axes(rays[0].1);
        let [kx, ky, kz] = axes;
        let (mut origins, mut inverses) = ([[0.0_f32; RAYS]; 3], [[0.0_f32; RAYS]; 3]);
        let (mut shears, mut scales) = ([[0.0_f32; RAYS]; 2], [0.0_f32; RAYS]);
        let mut ends = [-1.0_f32; RAYS];
        for (lane, &(origin, direction)) in rays.iter().enumerate().take(RAYS) {
            let inverse = invertible(direction).recip();
            for axis in 0..3 {
                origins[axis][lane] = origin[axis];
                inverses[axis][lane] = inverse[axis];
            }
            scales[lane] = direction[kz].recip();
            shears[0][lane] = direction[kx] * scales[lane];
            shears[1][lane] = direction[ky] * scales[lane];
            ends[lane] = f32::INFINITY;
        }
        Self {
            simd,
            vectors: rays.len().div_ceil(WIDTH).min(VECTORS),
            origin: pulp::cast(origins),
            inverse: pulp::cast(inverses),
            axes,
            shear: pulp::cast(shears),
            scale: pulp::cast(scales),
            end: pulp::cast(ends),
            farthest: f32::INFINITY,
            face: [simd.splat_u32x8(0); VECTORS],
            u: [simd.splat_f32x8(0.0); VECTORS],
            v: [simd.splat_f32x8(0.0); VECTORS],
        }
    }

    /// Looks below `entries`, from near to far as far as the packet as a whole tells.
    #[inline(always)]
    fn traverse(&mut self, tree: &Bvh4, entries: &[Node], probe: &PacketProbe) {
        let mut stack = Stack::new();
        for entry in entries {
            let mut node = entry;
            'subtree: loop {
                let (near, mut entered) = probe.enter(node.bounds());
                let mut found: [(f32, Child); LANES] = [(0.0, Child::ROOT); LANES];
                let mut count = 0;
                while entered != 0 {
                    let lane = entered.trailing_zeros() as usize % LANES;
                    entered &= entered - 1;
                    if near[lane] <= self.farthest && self.enters(node.bounds(), lane) {
                        // The nearest last.
                        let mut place = count;
                        while place > 0 && found[place - 1].0 < near[lane] {
                            found[place] = found[place - 1];
                            place -= 1;
                        }
                        found[place] = (near[lane], node.child(lane));
                        count += 1;
                    }
                }
                for &waiting in &found[..count] {
                    stack.push(waiting);
                }
                loop {
                    let Some((near, child)) = stack.pop() else { break 'subtree };
                    if near > self.farthest {
                        continue;
                    }
                    if child.is_quad() {
                        self.meet(&tree.quads[child.index()]);
                    } else {
                        node = tree.node(child);
                        break;
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn any(&self, lanes: m32x8) -> bool {
        self.simd.avx._mm256_movemask_ps(pulp::cast(lanes)) != 0
    }

    /// Whether any ray enters one of the four boxes before its end.
    #[inline(always)]
    fn enters(&self, bounds: &Bounds, lane: usize) -> bool {
        let simd = self.simd;
        for vector in 0..self.vectors {
            let mut near = simd.splat_f32x8(0.0);
            let mut far = self.end[vector];
            for (axis, [low, high]) in bounds.iter().enumerate() {
                let inverse = self.inverse[axis][vector];
                let a = simd.mul_f32s(self.offset(axis, vector, low[lane]), inverse);
                let b = simd.mul_f32s(self.offset(axis, vector, high[lane]), inverse);
                near = simd.max_f32s(near, simd.min_f32s(a, b));
                far = simd.min_f32s(far, simd.max_f32s(a, b));
            }
            if self.any(simd.less_than_or_equal_f32s(near, far)) {
                return true;
            }
        }
        false
    }

    /// How far `plane` lies beyond the origins along `axis`.
    #[inline(always)]
    fn offset(&self, axis: usize, vector: usize, plane: f32) -> f32x8 {
        self.simd.sub_f32s(self.simd.splat_f32x8(plane), self.origin[axis][vector])
    }

    /// A corner's coordinate along `axis`, sheared as the `index`th; `z` is its third.
    #[inline(always)]
    fn sheared(&self, (axis, index): (usize, usize), vector: usize, at: f32, z: f32x8) -> f32x8 {
        self.simd.sub_f32s(self.offset(axis, vector, at), self.simd.mul_f32s(self.shear[index][vector], z))
    }

    /// x·y' − y·x'.
    #[inline(always)]
    fn edge(&self, [x, y]: [f32x8; 2], [u, v]: [f32x8; 2]) -> f32x8 {
        self.simd.sub_f32s(self.simd.mul_f32s(x, v), self.simd.mul_f32s(y, u))
    }

    /// Tests the triangles of a quad: see [`Quad::intersect`].
    #[inline(always)]
    fn meet(&mut self, quad: &Quad) {
        let simd = self.simd;
        let mut met = false;
        for lane in 0..LANES {
            let Some((face, corners)) = quad.triangle(lane) else { break };
            for vector in 0..self.vectors {
                met |= self.meet_one(simd, face, &corners, vector);
            }
        }
        if met {
            let mut farthest = -1.0_f32;
            for end in pulp::cast::<Numbers, [f32; RAYS]>(self.end) {
                farthest = farthest.max(end);
            }
            self.farthest = farthest;
        }
    }

    #[inline(always)]
    fn meet_one(&mut self, simd: V3, face: u32, corners: &[[f32; 3]; 3], vector: usize) -> bool {
        let [kx, ky, kz] = self.axes;
        let (cx, cy, cz) = (&corners[kx], &corners[ky], &corners[kz]);
        let z0 = self.offset(kz, vector, cz[0]);
        let z1 = self.offset(kz, vector, cz[1]);
        let z2 = self.offset(kz, vector, cz[2]);
        let a = [self.sheared((kx, 0), vector, cx[0], z0), self.sheared((ky, 1), vector, cy[0], z0)];
        let b = [self.sheared((kx, 0), vector, cx[1], z1), self.sheared((ky, 1), vector, cy[1], z1)];
        let c = [self.sheared((kx, 0), vector, cx[2], z2), self.sheared((ky, 1), vector, cy[2], z2)];
        let (e0, e1, e2) = (self.edge(a, b), self.edge(b, c), self.edge(c, a));
        let zero = simd.splat_f32x8(0.0);
        let below = simd.less_than_f32s(simd.min_f32s(simd.min_f32s(e0, e1), e2), zero);
        let above = simd.greater_than_f32s(simd.max_f32s(simd.max_f32s(e0, e1), e2), zero);
        let inside = simd.not_m32s(simd.and_m32s(below, above));
        if !self.any(inside) {
            return false;
        }
        let sum = simd.add_f32s(simd.add_f32s(e0, e1), e2);
        let (w, u, v) = (simd.div_f32s(e1, sum), simd.div_f32s(e2, sum), simd.div_f32s(e0, sum));
        let t = simd.add_f32s(simd.mul_f32s(w, z0), simd.mul_f32s(u, z1));
        let t = simd.mul_f32s(simd.add_f32s(t, simd.mul_f32s(v, z2)), self.scale[vector]);
        let (end, own) = (self.end[vector], simd.splat_u32x8(face));
        // Of equally near faces the first, in whatever order they come.
        let first = simd.and_m32s(simd.equal_f32s(t, end), simd.less_than_u32s(own, self.face[vector]));
        let nearer = simd.or_m32s(simd.less_than_f32s(t, end), first);
        let hit = simd.and_m32s(simd.and_m32s(inside, simd.greater_than_f32s(t, zero)), nearer);
        if !self.any(hit) {
            return false;
        }
        self.end[vector] = simd.select_f32x8(hit, t, end);
        self.u[vector] = simd.select_f32x8(hit, u, self.u[vector]);
        self.v[vector] = simd.select_f32x8(hit, v, self.v[vector]);
        self.face[vector] = simd.select_u32x8(hit, own, self.face[vector]);
        true
    }

    #[inline(always)]
    fn hits(&self, rays: usize, found: &mut impl FnMut(usize, Option<Hit>)) {
        let end: [f32; RAYS] = pulp::cast(self.end);
        let (u, v): ([f32; RAYS], [f32; RAYS]) = (pulp::cast(self.u), pulp::cast(self.v));
        let face: [u32; RAYS] = pulp::cast(self.face);
        for ray in 0..rays {
            let hit = Hit { face: face[ray], t: end[ray], u: u[ray], v: v[ray] };
            found(ray, (end[ray] < f32::INFINITY).then_some(hit));
        }
    }
}

/// Boxes to come, each with the distance before which no ray enters it.
struct Stack {
    inline: [(f32, Child); INLINE_STACK],
    length: usize,
    /// Where a degenerate tree is deeper than `inline`.
    spilled: Vec<(f32, Child)>,
}

impl Stack {
    #[inline(always)]
    fn new() -> Self {
        Self { inline: [(0.0, Child::ROOT); INLINE_STACK], length: 0, spilled: Vec::new() }
    }

    #[inline(always)]
    fn push(&mut self, entry: (f32, Child)) {
        match self.inline.get_mut(self.length) {
            Some(free) => {
                *free = entry;
                self.length += 1;
            }
            None => self.spilled.push(entry),
        }
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<(f32, Child)> {
        if self.length == INLINE_STACK
            && let Some(entry) = self.spilled.pop()
        {
            return Some(entry);
        }
        self.length = self.length.checked_sub(1)?;
        self.inline.get(self.length).copied()
    }
}
