//! The samples of all vertices of the refined mesh, traced in parallel and kept in vertex order.

use std::ops::Range;
use std::time::{Duration, Instant};

use glam::Vec3;
use rayon::prelude::*;

use super::mesh::{Mesh, Vertex};
use super::store::{Key, SampleStore};
use crate::trace::{
    Rays,
    sample::{self, Context, Node, Primary, Start},
};

/// Vertices traced by one task: small enough to balance, large enough not to matter.
const CHUNK: usize = 64;

/// Samples by vertex index.
#[derive(Debug, Clone, Default)]
pub struct Samples {
    nodes: Vec<Node>,
    ranges: Vec<Range<u32>>,
    primary: Vec<Primary>,
    /// Vertices that were passed over: all their faces are traced pixel by pixel.
    skipped: u64,
    /// Vertices whose samples were known from earlier frames.
    pub reused: u64,
    /// Rays traced for the others.
    pub rays: Rays,
    /// Time spent tracing.
    pub time: Duration,
}

/// One vertex's sample.
#[derive(Debug, Clone, Copy)]
pub struct Sample<'a> {
    /// What its specular paths meet.
    pub nodes: &'a [Node],
    /// Its own local component.
    pub primary: &'a Primary,
}

impl<'a> Sample<'a> {
    /// The node at the end of path `path`.
    pub fn node(&self, path: u32) -> Option<&'a Node> {
        self.nodes.iter().find(|node| node.path == path)
    }

    /// The same where a neighbour has that path at the end of its node number `index`: mostly it is there too.
    pub fn node_near(&self, path: u32, index: usize) -> Option<&'a Node> {
        self.nodes.get(index).filter(|node| node.path == path).or_else(|| self.node(path))
    }
}

impl Samples {
    /// Largest radiance, by channel, of a vertex or of what one of its paths brings.
    pub fn brightest(&self) -> Vec3 {
        let own = self.primary.iter().map(|primary| primary.local.radiance(primary.texel));
        own.chain(self.nodes.iter().map(Node::radiance)).fold(Vec3::ZERO, Vec3::max)
    }

    /// Number of vertices that have a sample, traced or reused: what a budget counts.
    pub fn sampled(&self) -> u64 {
        self.len() as u64 - self.skipped
    }

    /// Number of vertices that have an entry, sampled or passed over.
    pub fn len(&self) -> usize {
        self.primary.len()
    }

    /// Whether there is no entry.
    pub fn is_empty(&self) -> bool {
        self.primary.is_empty()
    }

    /// The sample of vertex `vertex`.
    pub fn get(&self, vertex: u32) -> Sample<'_> {
        let Range { start, end } = self.ranges[vertex as usize];
        Sample { nodes: &self.nodes[start as usize..end as usize], primary: &self.primary[vertex as usize] }
    }

    /// Enters the vertices of `mesh` that have no entry yet: those that `wanted` says are wanted with their samples,
    /// from `store` where it knows them and traced where not, the others without nodes. The result does not depend
    /// on the number of threads, nor on the store.
    pub fn extend(
        &mut self,
        context: &Context,
        mesh: &Mesh,
        store: Option<&mut SampleStore>,
        wanted: impl Fn(u32) -> bool + Sync,
    ) {
        let started = Instant::now();
        let from = self.len();
        let known = store.as_deref();
        let sampled: Vec<Chunk> = mesh.vertices[from..]
            .par_chunks(CHUNK)
            .enumerate()
            .map(|(chunk, vertices)| {
                let mut sampled = Chunk::default();
                let first = (from + chunk * CHUNK) as u32;
                for (vertex, index) in vertices.iter().zip(first..) {
                    if wanted(index) {
                        sampled.sample(context, &start(mesh, vertex), known);
                    } else {
                        sampled.pass_over();
                    }
                }
                sampled
            })
            .collect();
        for Chunk { nodes, primary, ends, rays, skipped, reused, .. } in &sampled {
            self.skipped += skipped;
            self.reused += reused;
            let offset = self.nodes.len() as u32;
            let mut start = offset;
            for &end in ends {
                self.ranges.push(start..offset + end);
                start = offset + end;
            }
            self.primary.extend(primary);
            self.nodes.extend(nodes);
            self.rays += *rays;
        }
        if let Some(store) = store {
            for (chunk, first) in sampled.iter().zip((from as u32..).step_by(CHUNK)) {
                for &(key, index) in &chunk.keys {
                    store.insert(key, self.get(first + index));
                }
            }
        }
        self.time += started.elapsed();
    }
}

/// The samples of some consecutive vertices.
#[derive(Default)]
struct Chunk {
    nodes: Vec<Node>,
    primary: Vec<Primary>,
    /// Where the nodes of each vertex end.
    ends: Vec<u32>,
    /// If there is a store: by what it would know each that was traced, and which of them it is.
    keys: Vec<(Key, u32)>,
    rays: Rays,
    skipped: u64,
    reused: u64,
}

impl Chunk {
    fn sample(&mut self, context: &Context, start: &Start, known: Option<&SampleStore>) {
        let surface = start.surface(context.tracer);
        let key = known.map(|store| (store, Key::new(&surface, context.view)));
        let kept = key.as_ref().and_then(|(store, key)| store.get(key));
        let primary = match kept {
            Some(sample) => {
                self.nodes.extend_from_slice(sample.nodes);
                self.reused += 1;
                *sample.primary
            }
            None => {
                let direction = context.view.direction_to(start.position);
                let from_eye = context.view.distance_to(start.position);
                let (nodes, rays) = (&mut self.nodes, &mut self.rays);
                sample::trace_surface(context, &surface, direction, from_eye, nodes, rays)
            }
        };
        if let (Some((_, key)), None) = (key, kept) {
            self.keys.push((key, self.primary.len() as u32));
        }
        self.push(primary);
    }

    fn pass_over(&mut self) {
        self.skipped += 1;
        self.push(Primary::default());
    }

    fn push(&mut self, primary: Primary) {
        self.primary.push(primary);
        self.ends.push(self.nodes.len() as u32);
    }
}

/// The vertex as the tracer sees it.
pub(super) fn start(mesh: &Mesh, vertex: &Vertex) -> Start {
    Start {
        position: mesh.points[vertex.point as usize],
        normal: vertex.normal,
        geometric: vertex.geometric,
        back: vertex.back,
        uv: vertex.uv,
        color: vertex.color,
        face: vertex.base,
    }
}
