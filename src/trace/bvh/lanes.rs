//! Rays of a packet tested side by side, sixteen at a time, against one box or triangle after the other.
//!
//! They find what rays find that are traced one by one, to the bit: the same boxes and triangles are tested by the same
//! operations, in another order.

use glam::Vec3;

use super::Hit;
use super::packet::{Packet, PacketProbe};
use super::quad::{AXES, LANES, Quad, axes};
use super::wide::{Bounds, Bvh4, Child, Node, SMALLEST_COMPONENT};
use crate::trace::real::{Choice, Real, Triple};
use crate::trace::vector::{Isa, Mask, Numbers, Processor, WIDTH, Work, get, put};

/// Rays that go through the tree together.
pub(super) const RAYS: usize = WIDTH;

/// Boxes that wait before the heap is asked for more room.
const INLINE_STACK: usize = 96;

/// The nearest hits below `entries` of up to [`RAYS`] rays that are longest along the same axis, origins and unit directions;
/// every face counts.
pub(super) fn closest(
    processor: Processor,
    tree: &Bvh4,
    entries: &[Node],
    rays: &[(Vec3, Vec3)],
    found: impl FnMut(usize, Option<Hit>),
) {
    processor.run(Search { tree, entries, rays, found });
}

struct Search<'a, F> {
    tree: &'a Bvh4,
    entries: &'a [Node],
    rays: &'a [(Vec3, Vec3)],
    found: F,
}

impl<F: FnMut(usize, Option<Hit>)> Work for Search<'_, F> {
    #[inline(always)]
    fn run<S: Isa>(mut self, simd: S) {
        let (mut origins, mut directions) = ([[0.0; WIDTH]; 3], [[0.0; WIDTH]; 3]);
        let mut ends = [f32::INFINITY; WIDTH];
        // Lanes without a ray have the first one's, so that they do not make the packet wider.
        for (lane, end) in ends.iter_mut().enumerate() {
            let (origin, direction) = *self.rays.get(lane).unwrap_or(&self.rays[0]);
            put(&mut origins, lane, origin);
            put(&mut directions, lane, direction);
            if lane >= self.rays.len() {
                *end = NOWHERE;
            }
        }
        let origin = Triple::load(simd, &origins);
        let direction = Triple::load(simd, &directions);
        let mut lanes = Lanes::new(origin, direction, Numbers::load(simd, &ends), axes(self.rays[0].1));
        lanes.traverse::<false>(self.tree, self.entries, f32::INFINITY);
        lanes.hits(self.rays.len(), &mut self.found);
    }
}

/// Which of the rays in `lanes`, a bit each, meet a face below `entries` before they end; every face counts.
#[inline(always)]
pub(super) fn occluded<S: Isa>(
    tree: &Bvh4,
    entries: &[Node],
    origin: Triple<Numbers<S>>,
    direction: Triple<Numbers<S>>,
    end: Numbers<S>,
    lanes: u16,
) -> u16 {
    let (origins, directions) = (origin.store(), direction.store());
    let size = [direction.x.abs(), direction.y.abs(), direction.z.abs()];
    // As `axes` has it.
    let z = size[0].le(size[2]).bits() & size[1].le(size[2]).bits();
    let y = size[0].le(size[1]).bits() & !z;
    let mut occluded = 0;
    for (group, axes) in [(z, AXES[0]), (y, AXES[1]), (!z & !y, AXES[2])] {
        let group = group & lanes;
        if group == 0 {
            continue;
        }
        let first = group.trailing_zeros() as usize % WIDTH;
        let mine = Mask::from_bits(end.simd(), group);
        let [from, towards] = [get(&origins, first), get(&directions, first)];
        let origin = origin.where_else(mine, Triple::all(end, from));
        let direction = direction.where_else(mine, Triple::all(end, towards));
        let end = mine.select(end, end.all(NOWHERE));
        let mut rays = Lanes::new(origin, direction, end, axes);
        rays.traverse::<true>(tree, entries, end.greatest());
        occluded |= group & rays.end.lt(end.all(0.0)).bits();
    }
    occluded
}

/// The end of a lane without a ray, which meets nothing.
const NOWHERE: f32 = -1.0;

/// Rays, and the nearest that they have met.
struct Lanes<S: Isa> {
    simd: S,
    origin: [Numbers<S>; 3],
    direction: [Numbers<S>; 3],
    inverse: [Numbers<S>; 3],
    /// As [`Probe`](super::quad::Probe) has it.
    axes: [usize; 3],
    shear: [Numbers<S>; 2],
    scale: Numbers<S>,
    /// Below 0 for a lane without a ray, or whose ray needs to meet nothing more.
    end: Numbers<S>,
    /// The farthest of the ends.
    farthest: f32,
    face: S::u32s,
    u: Numbers<S>,
    v: Numbers<S>,
}

impl<S: Isa> Lanes<S> {
    #[inline(always)]
    fn new(
        origin: Triple<Numbers<S>>,
        direction: Triple<Numbers<S>>,
        end: Numbers<S>,
        axes: [usize; 3],
    ) -> Self {
        let simd = end.simd();
        let [kx, ky, kz] = axes;
        let direction = [direction.x, direction.y, direction.z];
        let one = end.all(1.0);
        let scale = one / direction[kz];
        Self {
            simd,
            origin: [origin.x, origin.y, origin.z],
            direction,
            inverse: [inverse(direction[0]), inverse(direction[1]), inverse(direction[2])],
            axes,
            shear: [direction[kx] * scale, direction[ky] * scale],
            scale,
            end,
            farthest: f32::INFINITY,
            face: simd.splat_u32s(0),
            u: end.all(0.0),
            v: end.all(0.0),
        }
    }

    /// Bounds of the rays, the longest of which ends at `end`.
    #[inline(always)]
    fn packet(&self, end: f32) -> Packet {
        Packet { origins: bounds(self.origin), directions: bounds(self.direction), end, rays: WIDTH as u32 }
    }

    /// Looks below `entries`, from near to far as far as the packet as a whole tells; for `ANY` face or for the nearest. The
    /// longest ray ends at `end`.
    #[inline(always)]
    fn traverse<const ANY: bool>(&mut self, tree: &Bvh4, entries: &[Node], end: f32) {
        let probe = PacketProbe::new(&self.packet(end));
        self.farthest = end;
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
                        self.meet::<ANY>(&tree.quads[child.index()]);
                    } else {
                        node = tree.node(child);
                        break;
                    }
                }
            }
        }
    }

    /// Whether any ray enters one of the four boxes before its end.
    #[inline(always)]
    fn enters(&self, bounds: &Bounds, lane: usize) -> bool {
        let mut near = Numbers::splat(self.simd, 0.0);
        let mut far = self.end;
        for (axis, [low, high]) in bounds.iter().enumerate() {
            let a = self.offset(axis, low[lane]) * self.inverse[axis];
            let b = self.offset(axis, high[lane]) * self.inverse[axis];
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        near.le(far).any()
    }

    /// How far `plane` lies beyond the origins along `axis`.
    #[inline(always)]
    fn offset(&self, axis: usize, plane: f32) -> Numbers<S> {
        Numbers::splat(self.simd, plane) - self.origin[axis]
    }

    /// A corner's coordinate along `axis`, sheared as the `index`th; `z` is its third.
    #[inline(always)]
    fn sheared(&self, (axis, index): (usize, usize), at: f32, z: Numbers<S>) -> Numbers<S> {
        self.offset(axis, at) - self.shear[index] * z
    }

    /// Tests the triangles of a quad: see [`Quad::intersect`].
    #[inline(always)]
    fn meet<const ANY: bool>(&mut self, quad: &Quad) {
        let mut met = false;
        for lane in 0..LANES {
            let Some((face, corners)) = quad.triangle(lane) else { break };
            met |= self.meet_one::<ANY>(face, &corners);
        }
        if met {
            self.farthest = self.end.greatest();
        }
    }

    #[inline(always)]
    fn meet_one<const ANY: bool>(&mut self, face: u32, corners: &[[f32; 3]; 3]) -> bool {
        let simd = self.simd;
        let [kx, ky, kz] = self.axes;
        let (cx, cy, cz) = (&corners[kx], &corners[ky], &corners[kz]);
        let z0 = self.offset(kz, cz[0]);
        let z1 = self.offset(kz, cz[1]);
        let z2 = self.offset(kz, cz[2]);
        let a = [self.sheared((kx, 0), cx[0], z0), self.sheared((ky, 1), cy[0], z0)];
        let b = [self.sheared((kx, 0), cx[1], z1), self.sheared((ky, 1), cy[1], z1)];
        let c = [self.sheared((kx, 0), cx[2], z2), self.sheared((ky, 1), cy[2], z2)];
        let (e0, e1, e2) = (edge(a, b), edge(b, c), edge(c, a));
        let zero = Numbers::splat(simd, 0.0);
        let below = e0.min(e1).min(e2).lt(zero);
        let above = zero.lt(e0.max(e1).max(e2));
        let inside = !(below & above);
        if !inside.any() {
            return false;
        }
        let sum = e0 + e1 + e2;
        let (w, u, v) = (e1 / sum, e2 / sum, e0 / sum);
        let t = (w * z0 + u * z1 + v * z2) * self.scale;
        if ANY {
            let hit = inside & zero.lt(t) & t.lt(self.end);
            self.end = hit.select(zero.all(NOWHERE), self.end);
            return hit.any();
        }
        let own = simd.splat_u32s(face);
        // Of equally near faces the first, in whatever order they come.
        let first = t.equals(self.end) & Mask::new(simd, simd.less_than_u32s(own, self.face));
        let hit = inside & zero.lt(t) & (t.lt(self.end) | first);
        if !hit.any() {
            return false;
        }
        self.end = hit.select(t, self.end);
        self.u = hit.select(u, self.u);
        self.v = hit.select(v, self.v);
        self.face = hit.select_whole(own, self.face);
        true
    }

    #[inline(always)]
    fn hits(&self, rays: usize, found: &mut impl FnMut(usize, Option<Hit>)) {
        let (end, u, v) = (self.end.store(), self.u.store(), self.v.store());
        let mut face = [0; RAYS];
        S::as_mut_simd_u32s(&mut face).0[0] = self.face;
        for ray in 0..rays {
            let hit = Hit { face: face[ray], t: end[ray], u: u[ray], v: v[ray] };
            found(ray, (end[ray] < f32::INFINITY).then_some(hit));
        }
    }
}

/// As [`BoxProbe`](super::wide::BoxProbe) has it.
#[inline(always)]
fn inverse<S: Isa>(direction: Numbers<S>) -> Numbers<S> {
    direction.all(1.0) / direction.abs().max(direction.all(SMALLEST_COMPONENT)).copysign(direction)
}

/// Least and greatest coordinates.
#[inline(always)]
fn bounds<S: Isa>([x, y, z]: [Numbers<S>; 3]) -> [Vec3; 2] {
    [Vec3::new(x.least(), y.least(), z.least()), Vec3::new(x.greatest(), y.greatest(), z.greatest())]
}

/// x·y' − y·x'.
#[inline(always)]
fn edge<S: Isa>([x, y]: [Numbers<S>; 2], [u, v]: [Numbers<S>; 2]) -> Numbers<S> {
    x * v - y * u
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
