//! Shadows' borders, followed from the leaves whose pixels are traced: where one leaves between two corners that are lit
//! alike, no sample says that it goes on. Thin shadows would break into pieces.

use glam::Vec3;
use rayon::prelude::*;

use super::Refiner;
use super::judge::State;
use super::mesh::{Mesh, Split};
use super::samples::start;
use crate::trace::Rays;
use crate::trace::sample::{self, Start};

/// Distance, in pixels, of the points of an edge at which its light is asked for.
const PITCH: f32 = 2.0;

/// Part of the way from where a border meets an edge to the opposite corner of the face beyond, where it is looked for.
const BEYOND: f32 = 0.01;

/// A place that a border runs through.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crossing {
    /// The scene's face.
    base: u32,
    /// Its image vector, as [`Mesh::images`] has them.
    image: Vec3,
}

impl Refiner<'_> {
    /// Bisects the leaves that borders were seen to run into, or has them traced if they are small.
    pub(super) fn follow_borders(&mut self, splits: &mut Vec<Split>) {
        for crossing in std::mem::take(&mut self.crossings) {
            let Some(face) = self.mesh.leaf_at(crossing.base, crossing.image) else { continue };
            // What another one had bisected is not judged yet.
            let Some(&State { traced, pixels, size, .. }) = self.state.get(face as usize) else {
                self.crossings.push(crossing);
                continue;
            };
            if traced || pixels == 0.0 {
                continue;
            }
            if size <= self.stop_size(face) {
                self.trace_pixels_of(face);
            } else {
                self.mesh.bisect(face, splits);
                self.crossings.push(crossing);
            }
        }
    }

    /// Notes where borders leave the receivers among the traced faces from `first` on for leaves that are not traced.
    pub(super) fn find_crossings(&mut self, first: usize) {
        let context = self.context;
        if !context.settings.shadows.apply(false, 0) || context.tracer.scene().lights.is_empty() {
            return;
        }
        let receivers: Vec<u32> = self.pixel_faces[first..]
            .iter()
            .copied()
            .filter(|&face| self.mesh.faces[face as usize].is_leaf() && self.is_receiver(face))
            .collect();
        let found: Vec<(Vec<Crossing>, Rays)> = receivers
            .par_iter()
            .with_min_len(16)
            .map(|&face| {
                let (mut crossings, mut rays) = (Vec::new(), Rays::default());
                (0..3).for_each(|edge| self.cross(face, edge, &mut crossings, &mut rays));
                (crossings, rays)
            })
            .collect();
        for (crossings, rays) in found {
            self.crossings.extend(crossings);
            self.border_rays += rays;
        }
    }

    /// The same for one edge of one face.
    fn cross(&self, face: u32, edge: usize, crossings: &mut Vec<Crossing>, rays: &mut Rays) {
        let Self { mesh, context, .. } = self;
        let open = |&other: &u32| {
            let State { traced, pixels, .. } = self.state[other as usize];
            !traced && pixels > 0.0
        };
        let mut beyond = mesh.beyond(face, edge).filter(open).peekable();
        let corners = mesh.faces[face as usize].corners;
        let ends = [corners[edge], corners[(edge + 1) % 3]];
        let lit = ends.map(|end| self.samples.get(end).primary.lit);
        if beyond.peek().is_none() || lit[0] != lit[1] {
            return;
        }
        let steps = (mesh.length_of(face, edge) / PITCH).ceil();
        let crossed = (1..steps as u32)
            .map(|step| step as f32 / steps)
            .find(|&share| sample::lights_at(context, &between(mesh, ends, share), rays) != lit[0]);
        let Some(share) = crossed else { return };
        for other in beyond {
            let [a, b] = ends.map(|end| mesh.image(end));
            let at = a.lerp(b, share);
            let middle =
                mesh.faces[other as usize].corners.map(|corner| mesh.image(corner)).into_iter().sum::<Vec3>()
                    / 3.0;
            crossings
                .push(Crossing { base: mesh.faces[other as usize].base, image: at.lerp(middle, BEYOND) });
        }
    }
}

/// What lies between the ends of an edge.
fn between(mesh: &Mesh, ends: [u32; 2], share: f32) -> Start {
    let [a, b] = ends.map(|end| start(mesh, &mesh.vertices[end as usize]));
    Start {
        position: a.position.lerp(b.position, share),
        normal: a.normal.lerp(b.normal, share),
        geometric: a.geometric.normalize_or_zero().lerp(b.geometric.normalize_or_zero(), share),
        ..a
    }
}
