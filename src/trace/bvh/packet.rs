//! Packets: the part of the hierarchy that a group of rays can meet, searched for once for all of them.
//!
//! Origins and directions are bounded by boxes, and the box tests done in interval arithmetic (Wald, Boulos and
//! Shirley 2007, "Ray Tracing Deformable Scenes Using Dynamic Bounding Volume Hierarchies"). What is left of the tree
//! is where each ray then starts, instead of at its root (Reshetov, Soupikov and Hurley 2005, "Multi-Level Ray
//! Tracing Algorithm", entry points).

use glam::{Vec3, Vec4};

use super::{
    quad::LANES,
    wide::{Bounds, Bvh4, Child, Node, SMALLEST_COMPONENT, invertible},
};

/// Boxes that a packet leaves to its rays, which test four at a time.
const MOST_ENTRIES: usize = 16;

/// Below this many rays, the search takes longer than it saves.
const FEWEST_RAYS: u32 = 32;

/// Bounds of some rays.
#[derive(Debug, Clone, Copy)]
pub(in crate::trace) struct Packet {
    /// Least and greatest coordinates.
    pub origins: [Vec3; 2],
    /// Least and greatest components of the unit vectors.
    pub directions: [Vec3; 2],
    /// Where the longest ray ends.
    pub end: f32,
    /// How many there are.
    pub rays: u32,
}

impl Packet {
    /// Of no ray yet, and without end.
    pub const EMPTY: Self = Self {
        origins: [Vec3::INFINITY, Vec3::NEG_INFINITY],
        directions: [Vec3::INFINITY, Vec3::NEG_INFINITY],
        end: f32::INFINITY,
        rays: 0,
    };

    /// Takes in the ray from `origin` along the unit vector `direction` that has no end.
    #[inline]
    pub fn add(&mut self, origin: Vec3, direction: Vec3) {
        let extend = |[low, high]: &mut [Vec3; 2], by: Vec3| (*low, *high) = (low.min(by), high.max(by));
        extend(&mut self.origins, origin);
        extend(&mut self.directions, direction);
        self.rays += 1;
    }
}

/// The rays of a packet along one axis, as the box tests want them.
struct Slab {
    origins: [Vec4; 2],
    /// Inverses of the least and the greatest component of the directions.
    inverses: [Vec4; 2],
    course: Course,
}

/// Which way the rays of a packet run along an axis.
enum Course {
    Up,
    Down,
    /// Both or neither.
    Mixed,
}

impl Slab {
    #[inline(always)]
    fn new(packet: &Packet, axis: usize) -> Self {
        let [low, high] = packet.directions.map(|direction| direction[axis]);
        let course = match (low > 0.0, high < 0.0) {
            (true, _) => Course::Up,
            (_, true) => Course::Down,
            _ => Course::Mixed,
        };
        let invertible = match course {
            Course::Mixed => [low.min(-SMALLEST_COMPONENT), high.max(SMALLEST_COMPONENT)],
            _ => packet.directions.map(|direction| invertible(direction)[axis]),
        };
        Self {
            origins: packet.origins.map(|origin| Vec4::splat(origin[axis])),
            inverses: invertible.map(|component| Vec4::splat(component.recip())),
            course,
        }
    }

    /// Distances before which no ray is between the planes `low` and `high`, and after which none is.
    ///
    /// Rounding is monotonic, so that this holds to the bit for what the tests of single rays find.
    #[inline(always)]
    fn cross(&self, [low, high]: [Vec4; 2]) -> [Vec4; 2] {
        let (low, high) = (low - self.origins[1], high - self.origins[0]);
        let [a, b] = self.inverses;
        match self.course {
            Course::Up => [(low * a).min(low * b), (high * a).max(high * b)],
            Course::Down => [(high * a).min(high * b), (low * a).max(low * b)],
            // Less than infinity, so that the inside-out box of an unused lane stays closed.
            Course::Mixed => [(low * b).max(high * a), Vec4::MAX],
        }
    }
}

/// A packet as the box tests want it.
pub(super) struct PacketProbe {
    slabs: [Slab; 3],
    end: Vec4,
}

impl PacketProbe {
    #[inline(always)]
    pub fn new(packet: &Packet) -> Self {
        Self {
            slabs: std::array::from_fn(|axis| Slab::new(packet, axis)),
            end: Vec4::splat(packet.end.min(f32::MAX)),
        }
    }

    /// Distances before which no ray enters the four boxes, and a bit for each that some may enter.
    #[inline(always)]
    pub fn enter(&self, bounds: &Bounds) -> ([f32; LANES], u32) {
        let (mut near, mut far) = (Vec4::ZERO, self.end);
        for (slab, &bounds) in self.slabs.iter().zip(bounds) {
            let [enter, leave] = slab.cross(bounds);
            (near, far) = (near.max(enter), far.min(leave));
        }
        (near.to_array(), near.cmple(far).bitmask())
    }
}

/// Where the rays of a packet have to look.
#[derive(Default)]
pub(in crate::trace) struct EntryPoints {
    /// Boxes to look into, four a node and roughly from near to far; none where nothing can be met.
    nodes: Vec<Node>,
    /// Boxes that were found.
    found: Vec<Entry>,
    /// Boxes that were met on the way to them; a box is opened in its turn.
    queue: Vec<Entry>,
}

/// One box of a node.
#[derive(Clone, Copy)]
struct Entry {
    near: f32,
    node: u32,
    lane: u32,
    child: Child,
}

impl EntryPoints {
    /// The nodes to start from.
    #[inline]
    pub(super) fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Whether no ray of the packet meets anything.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Makes them those of `packet` in `tree`: opens boxes level by level while there is room for what is in them.
    pub(super) fn find(&mut self, tree: &Bvh4, packet: &Packet) {
        self.nodes.clear();
        if packet.rays < FEWEST_RAYS {
            self.nodes.push(tree.node(Child::ROOT).clone());
            return;
        }
        let probe = PacketProbe::new(packet);
        self.found.clear();
        self.queue.clear();
        self.open(tree, &probe, Child::ROOT);
        let mut waiting = 0;
        while let Some(&entry) = self.queue.get(waiting) {
            waiting += 1;
            let before = self.queue.len();
            if !entry.child.is_quad() {
                self.open(tree, &probe, entry.child);
                if self.found.len() + self.queue.len() - waiting <= MOST_ENTRIES {
                    continue;
                }
                self.queue.truncate(before);
            }
            self.found.push(entry);
        }
        self.found.sort_unstable_by(|a, b| a.near.total_cmp(&b.near));
        for four in self.found.chunks(LANES) {
            let mut node = Node::empty();
            for (lane, entry) in four.iter().enumerate() {
                node.take(lane, tree.node(Child::node(entry.node as usize)), entry.lane as usize);
            }
            self.nodes.push(node);
        }
    }

    /// Queues the boxes of a node that the packet can enter.
    fn open(&mut self, tree: &Bvh4, probe: &PacketProbe, child: Child) {
        let node = tree.node(child);
        let (near, entered) = probe.enter(node.bounds());
        for lane in (0..LANES).filter(|lane| entered >> lane & 1 == 1) {
            self.queue.push(Entry {
                near: near[lane],
                node: child.index() as u32,
                lane: lane as u32,
                child: node.child(lane),
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3A;
    use obvhs::aabb::Aabb;
    use proptest::prelude::*;

    use super::super::wide::BoxProbe;
    use super::*;

    fn point() -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(-1.0..1.0_f32).prop_map(Vec3::from)
    }

    fn direction() -> impl Strategy<Value = Vec3> {
        prop_oneof![point(), Just(Vec3::X), Just(Vec3::NEG_Y), Just(Vec3::new(0.0, -0.0, -1.0))]
    }

    proptest! {
        /// What a ray enters, its packet enters, and no later; nothing enters an unused lane.
        #[test]
        fn packets_bound_their_rays(
            boxes in prop::array::uniform3((point(), point())),
            origin in point(),
            towards in direction(),
            (moved, turned) in prop_oneof![Just((0.0, 0.0)), Just((0.02, 0.0)), Just((0.0, 0.02)), Just((0.3, 0.9))],
            rays in prop::collection::vec((point(), point()), 1..20),
            end in prop_oneof![0.1..3.0_f32, Just(f32::INFINITY)],
        ) {
            let mut node = Node::empty();
            for (lane, (a, b)) in boxes.into_iter().enumerate() {
                let bounds = Aabb { min: Vec3A::from(a.min(b)), max: Vec3A::from(a.max(b)) };
                node.set(lane, &bounds, Child::node(lane));
            }
            let ray = |(o, d): (Vec3, Vec3)| Some((origin + o * moved, (towards + d * turned).try_normalize()?));
            let rays: Vec<(Vec3, Vec3)> = rays.into_iter().filter_map(ray).collect();
            let mut packet = Packet { end, ..Packet::EMPTY };
            rays.iter().for_each(|&(origin, direction)| packet.add(origin, direction));
            let (first, some) = PacketProbe::new(&packet).enter(node.bounds());
            prop_assert_eq!(some >> 3, 0);
            for (origin, direction) in rays {
                let (near, entered) = node.enter(&BoxProbe::new(origin, direction), end);
                prop_assert_eq!(entered & !some, 0);
                for lane in (0..LANES).filter(|lane| entered >> lane & 1 == 1) {
                    prop_assert!(first[lane] <= near[lane], "{} after {}", first[lane], near[lane]);
                }
            }
        }
    }
}
