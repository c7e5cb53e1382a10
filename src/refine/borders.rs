//! Borders, of shadows and of what is reflected or transmitted, followed from the leaves whose pixels are traced: where one
//! leaves between two corners that are alike, no sample says that it goes on. Thin shadows and thin objects would break into
//! pieces.

use glam::Vec3;
use rayon::prelude::*;

use super::Refiner;
use super::judge::{FLAT, State};
use super::mesh::{Mesh, Split};
use super::predict;
use super::samples::{Sample, start};
use crate::trace::sample::{self, Context, Node, Start};
use crate::trace::{Rays, Settings};

/// Distance, in pixels, of the points of an edge that are looked at.
const PITCH: f32 = 2.0;

/// Shares of an edge between corners that see different planes at which their light is asked for.
const BETWEEN: [f32; 3] = [0.25, 0.5, 0.75];

/// Bounces up to which borders are followed: in a mirror, and through what transmits, on both of its sides.
const IN_MIRRORS: u32 = 1;
const THROUGH_GLASS: u32 = 2;

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

    /// Squared contribution of what is seen between corners of `face` that see different planes by `nodes`, one path,
    /// if one of these is lit otherwise there than where a corner sees it, or another one is seen: what the corners say of a
    /// plane's light is drawn up to its border with the next.
    pub(super) fn lit_otherwise(&self, face: u32, nodes: [&Node; 3], rays: &mut Rays) -> Option<f32> {
        let depth = self.context.settings.depth.min(u32::from(nodes[0].bounces));
        let settings = Settings { depth, ..*self.context.settings };
        let context = Context { settings: &settings, ..*self.context };
        let corners = self.mesh.faces[face as usize].corners;
        let mut found = Vec::new();
        let borders = (0..3).filter(|&i| nodes[i].target != nodes[(i + 1) % 3].target);
        let points = borders.flat_map(|i| BETWEEN.map(|share| ([corners[i], corners[(i + 1) % 3]], share)));
        points.into_iter().find_map(|(ends, share)| {
            found.clear();
            sample::trace(&context, &between(&self.mesh, ends, share), &mut found, rays);
            let known = |node: &Node| {
                nodes.iter().any(|corner| corner.target == node.target && corner.lit == node.lit)
            };
            let other = found.iter().find(|node| node.path == nodes[0].path && !known(node))?;
            Some(self.predictor.square(other))
        })
    }

    /// Notes where borders leave the traced faces from `first` on for leaves that are not traced.
    pub(super) fn find_crossings(&mut self, first: usize) {
        let context = self.context;
        let shadows = context.settings.shadows.apply(false, 0) && !context.tracer.scene().lights.is_empty();
        // Samples of curved surfaces lie close, or their pixels are traced, whatever they say.
        let followed = |face: u32| match self.is_receiver(face) {
            true => shadows,
            false => {
                let corners = self.mesh.faces[face as usize].corners;
                predict::curvature(corners.map(|corner| self.corner(corner))) <= FLAT
            }
        };
        let traced: Vec<u32> = self.pixel_faces[first..]
            .iter()
            .copied()
            .filter(|&face| self.mesh.faces[face as usize].is_leaf() && followed(face))
            .collect();
        let found: Vec<(Vec<Crossing>, Rays)> = traced
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
        let mesh = &self.mesh;
        let material = self.context.tracer.scene().face_material(mesh.faces[face as usize].base);
        let bounces = if material.transmission > 0.0 { THROUGH_GLASS } else { IN_MIRRORS };
        let settings = self.context.settings;
        let settings = Settings { depth: settings.depth.min(bounces), ..*settings };
        let context = &Context { settings: &settings, ..*self.context };
        let open = |&other: &u32| {
            let State { traced, pixels, .. } = self.state[other as usize];
            !traced && pixels > 0.0
        };
        let mut beyond = mesh.beyond(face, edge).filter(open).peekable();
        let corners = mesh.faces[face as usize].corners;
        let ends = [corners[edge], corners[(edge + 1) % 3]];
        let [a, b] = ends.map(|end| self.samples.get(end));
        if beyond.peek().is_none() || !is_alike(a, b, bounces) {
            return;
        }
        let mut nodes = Vec::new();
        let mut differs = |share: f32| {
            let start = between(mesh, ends, share);
            if self.is_receiver(face) {
                return sample::lights_at(context, &start, rays) != a.primary.lit;
            }
            nodes.clear();
            let primary = sample::trace(context, &start, &mut nodes, rays);
            !is_alike(Sample { primary: &primary, nodes: &nodes }, a, bounces)
        };
        let steps = (mesh.length_of(face, edge) / PITCH).ceil();
        let crossed = (1..steps as u32).map(|step| step as f32 / steps).find(|&share| differs(share));
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

/// Whether two samples are lit alike, and have the same paths of at most `bounces`, with the same ends, lit alike.
fn is_alike(one: Sample, other: Sample, bounces: u32) -> bool {
    let few = |node: &&Node| u32::from(node.bounces) <= bounces;
    let key = |node: &Node| (node.path, node.target, node.lit);
    let [mine, others] = [one, other].map(|sample| sample.nodes.iter().filter(few).map(key));
    one.primary.lit == other.primary.lit && mine.eq(others)
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
