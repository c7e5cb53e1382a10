//! Faces so dense that tracing their pixels costs less than tracing their vertices.

use super::mesh::{Face, Mesh};
use crate::scene::Scene;

/// Visible pixels below which a specular face of the scene is traced pixel by pixel. A closed mesh has half as many
/// vertices as faces, so that above this its vertices cost at most a fifth of its pixels: even where all
/// of them turn out to be undefined, no more than 1.2 times the rays of conventional tracing are spent.
const DENSE_PIXELS: u32 = 3;

/// Which faces of an unrefined mesh are traced pixel by pixel, and which vertices are sampled nevertheless.
pub struct Dense {
    /// By vertex: whether a face that is not dense needs its sample.
    pub wanted: Vec<bool>,
    /// By face: its visible pixels if it is dense.
    pixels: Vec<Option<u32>>,
}

impl Dense {
    /// No face is dense.
    pub fn none(mesh: &Mesh) -> Self {
        Self { wanted: vec![true; mesh.vertices.len()], pixels: vec![None; mesh.faces.len()] }
    }

    /// Finds the dense faces of the unrefined `mesh` of `scene`, whose faces own `counts` pixels.
    pub fn find(scene: &Scene, mesh: &Mesh, counts: &[u32]) -> Self {
        let few = |face: &Face| {
            let pixels = counts[face.base as usize];
            (pixels < DENSE_PIXELS && scene.is_vt(face.base)).then_some(pixels)
        };
        let pixels: Vec<Option<u32>> = mesh.faces.iter().map(few).collect();
        let mut dense = Self { wanted: vec![false; mesh.vertices.len()], pixels };
        dense.want_others(mesh);
        // A face without a pixel has none to take its colour from where sub-samples show it: it is drawn from
        // its vertices wherever one of them is sampled anyway.
        let fringe = dense.wanted.clone();
        for (face, pixels) in mesh.faces.iter().zip(&mut dense.pixels) {
            if *pixels == Some(0) && face.corners.iter().any(|&v| fringe[v as usize]) {
                *pixels = None;
            }
        }
        dense.want_others(mesh);
        dense
    }

    /// Marks the corners of all faces that are not dense.
    fn want_others(&mut self, mesh: &Mesh) {
        for (face, pixels) in mesh.faces.iter().zip(&self.pixels) {
            if pixels.is_none() {
                for corner in face.corners {
                    self.wanted[corner as usize] = true;
                }
            }
        }
    }

    /// Whether `face` is dense.
    pub fn is(&self, face: u32) -> bool {
        self.pixels[face as usize].is_some()
    }

    /// Visible pixels of a dense face; 0 for any other.
    pub fn pixels(&self, face: u32) -> f32 {
        self.pixels[face as usize].unwrap_or(0) as f32
    }
}
