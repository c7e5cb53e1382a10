//! Samples kept from frame to frame: of vertices that are seen again from where they were seen before.

use std::ops::Range;

use glam::Vec3;
use rustc_hash::FxHashMap;

use super::samples::Sample;
use crate::scene::View;
use crate::trace::Surface;
use crate::trace::sample::{Node, Primary};

/// Words that tell samples apart.
const WORDS: usize = 24;

/// Bytes around an entry of the table: the hash map keeps about half of its places free.
const ENTRY_BYTES: usize = 2 * size_of::<(Key, Kept)>();

/// Everything that a sample follows from, besides the scene with its lights and the settings: the bits of the
/// surface at the vertex, and of the view ray that arrives there.
///
/// Two vertices of one key have one sample, bit for bit. The way that the camera looks, its field of view and the
/// image are not part of it, and of the faces around the vertex only what they make of its normal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Key([u32; WORDS]);

#[derive(Debug, Clone)]
struct Kept {
    primary: Primary,
    nodes: Range<u32>,
}

/// Samples of one scene under one light and one set of settings, seen from one eye point.
#[derive(Debug, Clone)]
pub struct SampleStore {
    samples: FxHashMap<Key, Kept>,
    nodes: Vec<Node>,
    eye: Vec3,
    most_bytes: usize,
}

impl Key {
    /// The key of the sample that the vertex at `surface` has in `view`.
    pub fn new(surface: &Surface, view: &View) -> Self {
        // The material goes with the object; of the face nothing else is asked than its offset.
        let &Surface { object, outside, position, ng, n, uvs: [a, b], color, offset, .. } = surface;
        let direction = view.direction_to(position);
        let from_eye = view.distance_to(position);
        let floats = [
            position.to_array(),
            ng.to_array(),
            n.to_array(),
            direction.to_array(),
            [a.x, a.y, b.x],
            [b.y, offset, from_eye],
        ];
        let floats = floats.as_flattened().iter().chain(color.as_ref()).map(|value| value.to_bits());
        let mut words = [0; WORDS];
        let all = [object, u32::from(outside)].into_iter().chain(floats);
        words.iter_mut().zip(all).for_each(|(word, value)| *word = value);
        Self(words)
    }
}

impl SampleStore {
    /// An empty store that grows to about `most_bytes` bytes.
    pub fn new(most_bytes: usize) -> Self {
        Self { samples: FxHashMap::default(), nodes: Vec::new(), eye: Vec3::NAN, most_bytes }
    }

    /// Forgets samples that were seen from elsewhere than the eye of `view`.
    pub fn look_from(&mut self, view: &View) {
        if self.eye != view.eye {
            self.clear();
            self.eye = view.eye;
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.samples.clear();
        self.nodes.clear();
    }

    /// The sample of `key`, if it is known.
    pub fn get(&self, key: &Key) -> Option<Sample<'_>> {
        let Kept { primary, nodes } = self.samples.get(key)?;
        Some(Sample { nodes: &self.nodes[nodes.start as usize..nodes.end as usize], primary })
    }

    /// Keeps a sample while there is room; a store that is full keeps what it has.
    pub fn insert(&mut self, key: Key, sample: Sample) {
        let bytes = (self.samples.len() + 1) * ENTRY_BYTES
            + (self.nodes.len() + sample.nodes.len()) * size_of::<Node>();
        if bytes > self.most_bytes {
            return;
        }
        // Vertices of one key are traced side by side, before either is known.
        self.samples.entry(key).or_insert_with(|| {
            let start = self.nodes.len() as u32;
            self.nodes.extend_from_slice(sample.nodes);
            Kept { primary: *sample.primary, nodes: start..self.nodes.len() as u32 }
        });
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }
}
