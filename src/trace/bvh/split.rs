//! A binary tree from the top: ranges of faces are split where the surface area heuristic says, or in halves where it
//! says nothing. What it takes is bounded whatever boxes look like, which greedy builds and their repair are not.

use std::ops::Range;

use obvhs::{
    aabb::Aabb,
    bvh2::{Bvh2, node::Bvh2Node},
};

/// Places at which a split by each key is considered, and one.
const BINS: usize = 16;

/// A split must save this part of what testing all faces would cost; else one in halves is as good, and keeps the tree low.
const LEAST_GAIN: f32 = 0.1;

/// The tree over `boxes`, at least one; a face a leaf.
pub fn build(boxes: &[Aabb]) -> Bvh2 {
    let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
    // Below this depth ranges are halved, so that no boxes make a tree deeper than a few times the logarithm of their number.
    let deepest = 16 + 2 * boxes.len().max(1).ilog2();
    let mut nodes = vec![Bvh2Node::default()];
    let mut waiting: Vec<(usize, Range<usize>, u32)> = vec![(0, 0..boxes.len(), 0)];
    while let Some((node, range, depth)) = waiting.pop() {
        let faces = &mut order[range.clone()];
        let around = faces.iter().fold(Aabb::empty(), |around, &face| around.union(&boxes[face as usize]));
        if faces.len() == 1 {
            nodes[node] = Bvh2Node::new(around, 1, range.start as u32);
            continue;
        }
        let split = if depth < deepest { Split::best(boxes, faces, &around) } else { None };
        let before = match split {
            Some(split) => split.apply(boxes, faces),
            None => halve(boxes, faces),
        };
        let first = nodes.len();
        nodes[node] = Bvh2Node::new(around, 0, first as u32);
        nodes.extend([Bvh2Node::default(); 2]);
        waiting.push((first, range.start..range.start + before, depth + 1));
        waiting.push((first + 1, range.start + before..range.end, depth + 1));
    }
    Bvh2 { nodes, primitive_indices: order, ..Bvh2::default() }
}

/// What faces are told apart by: where the centres of their boxes lie along each axis, and, since those of a heap may all be
/// one, how far the boxes reach.
type Key = usize;
const KEYS: usize = 6;

fn value(face: &Aabb, key: Key) -> f32 {
    if key < 3 { face.center()[key] } else { face.diagonal()[key - 3] }
}

/// The least and the greatest value of each key among `faces`.
fn reach(boxes: &[Aabb], faces: &[u32]) -> [[f32; 2]; KEYS] {
    let mut around = [Aabb::empty(); 2];
    for &face in faces {
        around[0].extend(boxes[face as usize].center());
        around[1].extend(boxes[face as usize].diagonal());
    }
    std::array::from_fn(|key| [around[key / 3].min[key % 3], around[key / 3].max[key % 3]])
}

/// Halves `faces` by the key in which they differ most; the place of the second half.
fn halve(boxes: &[Aabb], faces: &mut [u32]) -> usize {
    let middle = faces.len() / 2;
    let spread = reach(boxes, faces).map(|[least, greatest]| greatest - least);
    let key = (0..KEYS).max_by(|&a, &b| spread[a].total_cmp(&spread[b])).unwrap_or(0);
    let value = |face: u32| value(&boxes[face as usize], key);
    faces.select_nth_unstable_by(middle, |&a, &b| value(a).total_cmp(&value(b)).then(a.cmp(&b)));
    middle
}

/// Where to split by a key: before bin `at`.
#[derive(Clone, Copy)]
struct Split {
    key: Key,
    start: f32,
    bins_per_unit: f32,
    at: usize,
}

/// What lies in a bin, or in several: how many faces, and the box around them.
type Bin = (u32, Aabb);

impl Split {
    /// The cheapest of `faces`, which the box is `around`; `None` if none saves anything to speak of.
    fn best(boxes: &[Aabb], faces: &[u32], around: &Aabb) -> Option<Self> {
        let mut least = (1.0 - LEAST_GAIN) * around.half_area() * faces.len() as f32;
        let mut best = None;
        for (key, [start, end]) in reach(boxes, faces).into_iter().enumerate() {
            let bins_per_unit = BINS as f32 / (end - start);
            if !bins_per_unit.is_finite() {
                continue;
            }
            let split = Self { key, start, bins_per_unit, at: 0 };
            let mut bins: [Bin; BINS] = [(0, Aabb::empty()); BINS];
            for &face in faces {
                let face = &boxes[face as usize];
                let bin = &mut bins[split.bin(face)];
                *bin = together(*bin, (1, *face));
            }
            // Of all bins from each one on.
            let mut rest = bins;
            (0..BINS - 1).rev().for_each(|bin| rest[bin] = together(rest[bin], rest[bin + 1]));
            let mut before = (0, Aabb::empty());
            for at in 1..BINS {
                before = together(before, bins[at - 1]);
                let cost = cost(before) + cost(rest[at]);
                if cost < least && before.0 > 0 && rest[at].0 > 0 {
                    (least, best) = (cost, Some(Self { at, ..split }));
                }
            }
        }
        best
    }

    fn bin(&self, face: &Aabb) -> usize {
        (((value(face, self.key) - self.start) * self.bins_per_unit) as usize).min(BINS - 1)
    }

    /// Brings `faces` before it to the front; the place of the first that is not.
    fn apply(&self, boxes: &[Aabb], faces: &mut [u32]) -> usize {
        let mut middle = 0;
        for place in 0..faces.len() {
            if self.bin(&boxes[faces[place] as usize]) < self.at {
                faces.swap(middle, place);
                middle += 1;
            }
        }
        middle
    }
}

fn together(a: Bin, b: Bin) -> Bin {
    (a.0 + b.0, a.1.union(&b.1))
}

/// What testing all faces of a bin costs a ray.
fn cost((count, around): Bin) -> f32 {
    if count == 0 { 0.0 } else { count as f32 * around.half_area() }
}
