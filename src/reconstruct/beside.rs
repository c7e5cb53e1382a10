//! Patches that the leaves around a leaf see: where a surface is curved, the border between two of them bulges into
//! leaves whose own corners see one alone.

use rustc_hash::FxHashMap;

use crate::refine::{mesh::Mesh, samples::Samples};
use crate::scene::patch::{TargetId, Targets};

/// A patch with an outline that a path of one bounce meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Beside {
    /// Identity of the path: see [`Node::path`](crate::trace::sample::Node::path).
    pub path: u32,
    /// The patch.
    pub target: TargetId,
    /// Lights that are not hidden from it, a bit each.
    pub lit: u32,
}

/// By point of a mesh: the patches that leaves around it see, where they see several.
pub struct Borders(FxHashMap<u32, Vec<Beside>>);

impl Borders {
    /// Of the leaves `faces` of `mesh`.
    pub fn find(targets: &Targets, mesh: &Mesh, samples: &Samples, faces: &[u32]) -> Self {
        let mut borders = FxHashMap::<u32, Vec<Beside>>::default();
        for &face in faces {
            let corners = mesh.faces[face as usize].corners;
            let seen = corners.map(|corner| {
                let nodes = samples.get(corner).nodes.iter();
                nodes.filter(|node| node.bounces == 1 && targets.is_outlined(node.target))
            });
            let mut several: Vec<Beside> = Vec::new();
            for node in seen.into_iter().flatten() {
                let beside = Beside { path: node.path, target: node.target, lit: node.lit };
                if several.iter().all(|known| (known.path, known.target) != (beside.path, beside.target)) {
                    several.push(beside);
                }
            }
            let shared = |one: &Beside| several.iter().any(|o| o.path == one.path && o.target != one.target);
            for beside in several.iter().filter(|one| shared(one)) {
                for corner in corners {
                    let around = borders.entry(mesh.vertices[corner as usize].point).or_default();
                    if !around.contains(beside) {
                        around.push(*beside);
                    }
                }
            }
        }
        Self(borders)
    }

    /// What the leaves around the corners of `face` see, but for planes that it lies in itself: no ray from it meets these, and
    /// where one does by rounding, it would be met before all others.
    pub fn around(&self, targets: &Targets, mesh: &Mesh, face: u32) -> Vec<Beside> {
        let corners = mesh.faces[face as usize].corners;
        let lies_in = |beside: &&Beside| {
            let patch = targets.targets[beside.target as usize].patch.as_ref();
            patch.is_some_and(|patch| corners.iter().all(|&v| patch.has(mesh.position(v))))
        };
        let points = corners.map(|v| mesh.vertices[v as usize].point);
        let seen = points.iter().filter_map(|point| self.0.get(point)).flatten();
        seen.filter(|beside| !lies_in(beside)).copied().collect()
    }
}
