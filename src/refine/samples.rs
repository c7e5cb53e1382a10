//! The samples of all vertices of the refined mesh, traced in parallel and kept in vertex order.

use std::ops::Range;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::mesh::Mesh;
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
    /// Rays traced for them.
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
}

impl Samples {
    /// Number of vertices traced.
    pub fn traced(&self) -> u64 {
        self.len() as u64 - self.skipped
    }

    /// Number of vertices that have an entry, traced or passed over.
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

    /// Traces all vertices of `mesh` that have no entry yet and that `wanted` says are wanted; the others are
    /// entered without nodes. The result does not depend on the number of threads.
    pub fn extend(&mut self, context: &Context, mesh: &Mesh, wanted: impl Fn(u32) -> bool + Sync) {
        let started = Instant::now();
        let from = self.len();
        let traced: Vec<_> = mesh.vertices[from..]
            .par_chunks(CHUNK)
            .enumerate()
            .map(|(chunk, vertices)| {
                let (mut nodes, mut rays, mut skipped) = (Vec::new(), Rays::default(), 0);
                let first = (from + chunk * CHUNK) as u32;
                let samples: Vec<(Primary, u32)> = vertices
                    .iter()
                    .zip(first..)
                    .map(|(vertex, index)| {
                        if !wanted(index) {
                            skipped += 1;
                            return (Primary::default(), nodes.len() as u32);
                        }
                        let start = Start {
                            position: mesh.points[vertex.point as usize],
                            normal: vertex.normal,
                            geometric: vertex.geometric,
                            back: vertex.back,
                            uv: vertex.uv,
                            color: vertex.color,
                            face: vertex.base,
                        };
                        let primary = sample::trace(context, &start, &mut nodes, &mut rays);
                        (primary, nodes.len() as u32)
                    })
                    .collect();
                (nodes, samples, rays, skipped)
            })
            .collect();
        for (nodes, samples, rays, skipped) in traced {
            self.skipped += skipped;
            let offset = self.nodes.len() as u32;
            let mut start = offset;
            for (primary, end) in samples {
                self.primary.push(primary);
                self.ranges.push(start..offset + end);
                start = offset + end;
            }
            self.nodes.extend(nodes);
            self.rays += rays;
        }
        self.time += started.elapsed();
    }
}
