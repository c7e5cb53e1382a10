//! Which vertices are one point and which faces meet at an edge, by bit-equal position.
//!
//! Texture and normal seams duplicate vertices; they must not open cracks (design §6), so edges are
//! matched by position, never by vertex index.

use std::ops::Range;

use rayon::prelude::*;

use super::Geometry;

/// Point ids of vertices; equal for vertices with bit-equal positions.
#[derive(Debug, Clone, Default)]
pub struct Topology {
    /// The point of each vertex. Points are numbered in order of their first vertex.
    pub point: Vec<u32>,
    /// Number of points.
    pub points: u32,
}

/// One side of an edge: a face, and which of its edges it is (edge `i` runs from corner `i` to `i + 1`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Side {
    /// The face.
    pub face: u32,
    /// 0, 1 or 2.
    pub edge: u8,
}

impl Topology {
    /// Finds the points of `geometry`.
    pub fn new(geometry: &Geometry) -> Self {
        // -0.0 and 0.0 are one place.
        let bits = |v: u32| geometry.positions[v as usize].to_array().map(|x| (x + 0.0).to_bits());
        let mut order: Vec<u32> = (0..geometry.positions.len() as u32).collect();
        order.sort_unstable_by_key(|&v| (bits(v), v));
        let mut first = vec![0_u32; order.len()];
        for group in order.chunk_by(|&a, &b| bits(a) == bits(b)) {
            for &v in group {
                first[v as usize] = group[0];
            }
        }
        let mut point = vec![0; order.len()];
        let mut points = 0;
        for v in 0..first.len() {
            point[v] = if first[v] as usize == v {
                points += 1;
                points - 1
            } else {
                point[first[v] as usize]
            };
        }
        Self { point, points }
    }

    /// The two points of an edge of a face, smaller id first.
    pub fn edge(&self, geometry: &Geometry, side: Side) -> (u32, u32) {
        let face = geometry.faces[side.face as usize];
        let a = self.point[face[usize::from(side.edge)] as usize];
        let b = self.point[face[(usize::from(side.edge) + 1) % 3] as usize];
        (a.min(b), a.max(b))
    }

    /// The sides of `faces`, each with the two points of its edge: those of one edge follow one another, faces ascending.
    pub fn sides(&self, geometry: &Geometry, faces: Range<u32>) -> Vec<((u32, u32), Side)> {
        let mut sides = Vec::with_capacity(3 * faces.len());
        sides.extend(faces.flat_map(|face| {
            (0..3).map(move |edge| {
                let side = Side { face, edge };
                (self.edge(geometry, side), side)
            })
        }));
        sides.par_sort_unstable_by_key(|&(edge, side)| (edge, side.face, side.edge));
        sides
    }
}
