//! What is known of a face from its corners' samples, how far that is trusted, and how soon the face is looked at again.

use glam::Vec3;
use rayon::prelude::*;

use super::predict::{self, Corner, Deviation};
use super::{COLOR_PER_PIXEL, Entry, Refiner, guard, mesh, samples, shown};
use crate::options::{DEFAULT_ERROR, Reconstruction};
use crate::scene::patch::TargetId;
use crate::scene::{TextureSlot, View};
use crate::trace::sample::{Context, Node};
use crate::trace::{Appearance, Rays, shade, texel};

/// Exploration: squared error assumed of a face that nothing is known of. It fades by level, and for large faces
/// with the square of the pixels, below [`EXPLORE_PIXELS`]: what hides between samples is likely to be no
/// larger than their distance.
const EXPLORE: f32 = 0.01;
const EXPLORE_FADE: f32 = 0.1;
const EXPLORE_PIXELS: f32 = 3000.0;

/// Longest edge, as a share of the image's longer side, of a face whose samples are trusted although nothing between them
/// was looked at: whatever corners predict, a larger one may hide anything.
const BLIND: f32 = 0.1;

/// Squared error expected of each pixel of a face of that size for what its samples do not say; less of a smaller one. As
/// predictions of demo scenes at few samples have it (tests/effort.rs).
const UNSEEN: f32 = 0.0005;

/// The same of a face whose samples are trusted: so little that hardly more is traced at the default `--error`, and something,
/// so that a smaller one looks further, and one of 0 everywhere (docs/samples.md).
const UNEXPLORED: f32 = 1.5e-7;

/// Part of that where the guard has looked, and found nothing: what hides from it is rare.
const SURE: f32 = 0.2;

/// Bounces up to which that holds, and the least throughput of paths of more.
const FEW_BOUNCES: u8 = 2;
const SEEN: f32 = 0.1;

/// Largest angle, in radians, between the normals of a face's corners, and between their paths after several bounces, at
/// which the face is trusted for what its corners say: what a more curved one reflects may pass over anything between them.
const CURVED: f32 = 0.12;

/// Share of that angle at which the smallest halves of a face are expected to turn for it to be hopeless: its pixels are
/// traced at once, for they would be in the end, and its halves take longer to sample than a few pixels more to trace.
const HOPELESS: f32 = 0.7;

/// Longest edge of such a face, as a share of the largest at which samples are trusted for what is between them: the bisection
/// of larger ones lets their neighbours be looked into.
const HOPELESS_SHARE: f32 = 0.25;

/// Share of a path's squared contribution that is expected to be wrong where something enters its shaft: unlike
/// exploration it does not fade, since what stands there does not go away.
const GUARDED: f32 = 0.05;

/// A part of that share where a shadow may fall between corners that are lit alike: far more than the end of refinement lets
/// stand, and little beside exploration, which goes first, for nothing else finds what it finds.
const SHADOWED: f32 = 0.04;

/// Squared contribution expected of a face that is specular between its corners alone, and parts of its edges between the
/// points at which it is looked at.
const SPECULAR_BETWEEN: f32 = 0.1;
const LATTICE: u32 = 7;

/// Largest angle between the normals of a face's corners, in radians, at which its shafts are looked into. What hides is
/// hidden by the size of flat faces; on curved ones samples lie close, and looking into their shafts costs a few hundredths of
/// the frame for what is thinner than their distance alone (docs/samples.md).
pub(super) const FLAT: f32 = 0.01;

/// Bounces of paths whose last segments are looked into between flat faces' corners.
const LOOKED_INTO: u8 = 2;

/// Predicted squared error per pixel below which nothing is worth a sample: half an 8-bit step.
const NEGLIGIBLE: f32 = (0.5 / 255.0) * (0.5 / 255.0);

/// Predicted squared error of colour, and squared displacement in pixels, up to which what a face shows is known: a
/// ten-thousandth, and a tenth of a pixel.
const KNOWN_COLOR: f32 = 1e-8;
const KNOWN_SHIFT: f32 = 1e-2;

/// Paths, with the one target that they meet from all corners, into whose shafts nothing reaches, nor in between
/// the target and its lights: nor does anything for the halves, whose shafts lie within. As many as there is room for.
pub(super) type Clear = [Option<(u32, TargetId)>; 2];

/// What stands between the corners of a face, as far as its shafts are looked into.
#[derive(Debug, Clone, Copy, Default)]
struct Guarded {
    /// Squared contribution of the paths that meet what no corner tells, and of those of few bounces that seem to be known
    /// although something stands between them or before their light.
    square: f32,
    /// The shafts that are clear.
    clear: Clear,
    /// Whether all are.
    sure: bool,
}

/// What a half takes over.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Inherited {
    pub deviation: Deviation,
    pub clear: Clear,
    /// Lights whose shadows are not to be looked for in it if it is lit alike at its corners, a bit each.
    pub even: u32,
    /// Whether the whole face shows.
    pub whole: bool,
}

/// What is known of a face.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct State {
    /// Predicted error per pixel.
    pub deviation: Deviation,
    /// Pixels that show it, estimated.
    pub pixels: f32,
    /// Whether all of it seems to show.
    pub whole: bool,
    /// Squared contribution of the paths whose shafts are entered, or that meet what no corner tells.
    pub guarded: f32,
    /// Its clear shafts.
    pub clear: Clear,
    /// The same for its halves.
    pub even: u32,
    /// Longest edge in pixels.
    pub size: f32,
    /// Whether all shafts from it, and from it and what it sees to lights, are clear.
    pub sure: bool,
    /// Whether its samples say too little of it, unless its pixels are traced.
    pub blind: bool,
    /// Whether, if so, it is looked into before others: it is a large part of the picture, or bent all over.
    pub urgent: bool,
    /// Whether it is not large, and so much too curved that its smallest halves would be, too.
    pub hopeless: bool,
    /// Whether its pixels are traced one by one.
    pub traced: bool,
}

impl State {
    /// The same once its pixels are traced.
    pub fn traced(self) -> Self {
        Self { deviation: Deviation::default(), guarded: 0.0, traced: true, ..self }
    }

    /// Whether what it shows is known, as far as its corners' samples tell.
    pub fn is_known(&self) -> bool {
        let Self { deviation: Deviation { color, shift }, guarded, blind, traced, .. } = *self;
        !blind && !traced && color + guarded <= KNOWN_COLOR && shift <= KNOWN_SHIFT
    }
}

impl Refiner<'_> {
    /// Estimates new faces, each with what it takes over, and queues those that are leaves.
    pub(super) fn judge(&mut self, faces: &[(u32, Inherited)]) {
        let states: Vec<(State, Rays)> = faces
            .par_iter()
            .with_min_len(32)
            .map(|&(face, Inherited { deviation, clear, even, whole })| {
                let (pixels, whole) = match whole {
                    true => (self.mesh.area(face), true),
                    false => shown::visible(&self.mesh, self.context.view, self.shown, face),
                };
                let size = self.mesh.size(face);
                if pixels == 0.0 {
                    return (State { deviation, size, ..State::default() }, Rays::default());
                }
                let corners = self.mesh.faces[face as usize].corners.map(|v| self.corner(v));
                let shown = size * self.stretch(face);
                let mut rays = Rays::default();
                let Guarded { square: entered, clear, sure } = self.guarded(face, corners, clear, &mut rays);
                let hidden = self.lights_behind(face);
                let (shadowed, even) = match self.predictor.shaft_guard && predict::curvature(corners) <= FLAT
                {
                    true => self.shadows_between(face, size, [even, hidden], &mut rays),
                    false => (0.0, even),
                };
                let own = self.predictor.face(corners, size, hidden, || self.shadowed(face));
                let state = State {
                    deviation: own.plus(deviation),
                    guarded: entered + SHADOWED * shadowed,
                    clear,
                    even,
                    pixels,
                    whole,
                    size,
                    sure: sure && Self::is_lit_throughout(corners, even, hidden),
                    urgent: shown > self.reach() || self.is_mapped(face),
                    blind: self.is_mapped(face)
                        || self.is_curved(face, corners, CURVED)
                        || self.is_large(shown, corners),
                    hopeless: size <= HOPELESS_SHARE * self.reach()
                        && self.is_curved(
                            face,
                            corners,
                            CURVED * (HOPELESS * size / self.stop_size(face)).max(1.0),
                        ),
                    traced: false,
                };
                (state, rays)
            })
            .collect();
        for (&(face, _), (state, rays)) in faces.iter().zip(states) {
            self.state[face as usize] = state;
            self.border_rays += rays;
            if !self.mesh.faces[face as usize].is_leaf() {
                continue;
            }
            let errors = [state.deviation.shift, self.known(face) + self.unseen(face)];
            self.predicted[face as usize] = errors.map(|square| square * state.pixels);
            self.enqueue(face);
        }
    }

    /// Queues the leaf `face`, if it is worth a look.
    fn enqueue(&mut self, face: u32) {
        let State { pixels, .. } = self.state[face as usize];
        let level = i32::from(self.mesh.faces[face as usize].level);
        let large = (pixels / EXPLORE_PIXELS).min(1.0).powi(2);
        let fade = if self.is_urgent(face) { 1.0 } else { large.max(EXPLORE_FADE.powi(level)) };
        // Against a budget, others that are blind wait for all whose error is known: their pixels are many samples.
        let waits = self.target.is_none() && self.is_blind(face);
        let unseen = if waits { 2.0 * NEGLIGIBLE } else { self.unseen(face) };
        let worth = self.known(face) + (EXPLORE * fade).max(unseen);
        // The paper's refinement does not end before them, whatever else it would bisect down to a pixel first.
        let paper = self.predictor.reconstruction == Reconstruction::Paper;
        let first = paper && self.target.is_some() && self.is_urgent(face);
        let worth = if first { worth.max(1.0) } else { worth };
        // Against a budget, as far down as without one.
        let color = self.target.map_or(DEFAULT_ERROR * COLOR_PER_PIXEL, |[_, color]| color);
        let negligible = NEGLIGIBLE.min(color * color);
        if pixels > 0.0 && worth > negligible {
            self.queue.push(Entry { priority: worth * pixels, face });
        }
    }

    /// Queues all leaves anew.
    pub(super) fn queue_again(&mut self) {
        self.queue.clear();
        for face in self.mesh.leaves().collect::<Vec<u32>>() {
            self.enqueue(face);
        }
    }

    /// Pixels that a pixel's width at the middle of the image, as seen from the eye, takes where a face is: more towards the
    /// borders of wide views, along the line from the middle as the squared secant of the angle to it.
    fn stretch(&self, face: u32) -> f32 {
        let View { orthographic, forward, half, .. } = *self.context.view;
        if orthographic {
            return 1.0;
        }
        let towards: Vec3 =
            self.mesh.faces[face as usize].corners.map(|corner| self.mesh.image(corner)).iter().sum();
        let cos = towards.normalize_or_zero().dot(forward);
        // No farther than the frame's corner.
        cos.max(0.0).powi(2).recip().min(1.0 + half.length_squared())
    }

    /// Squared error of colour that is expected of each pixel of a face for what its samples say.
    fn known(&self, face: u32) -> f32 {
        let State { deviation, guarded, .. } = self.state[face as usize];
        deviation.color + GUARDED * guarded
    }

    /// The same for what they do not say: in proportion to its size, for what hides between samples is as large at most.
    fn unseen(&self, face: u32) -> f32 {
        let State { size, pixels, sure, blind, traced, .. } = self.state[face as usize];
        let share = (size / self.reach()).min(1.0);
        match blind {
            _ if pixels == 0.0 || traced => 0.0,
            true if self.is_mapped(face) => EXPLORE,
            true => UNSEEN * share,
            false if sure => SURE * UNEXPLORED * share,
            false => UNEXPLORED * share,
        }
    }

    /// What stands between the corners of a face, or before the lights of what they see; `known` are the clear shafts of the face
    /// that this one is half of.
    fn guarded(&self, face: u32, corners: [Corner; 3], known: Clear, rays: &mut Rays) -> Guarded {
        if !self.predictor.shaft_guard {
            return Guarded::default();
        }
        let (mut square, mut clear) = (self.predictor.untold(corners), Clear::default());
        if corners.iter().all(|corner| corner.sample.nodes.is_empty()) && self.is_specular_between(face) {
            square += SPECULAR_BETWEEN;
        }
        if predict::curvature(corners) > FLAT {
            return Guarded { square, ..Guarded::default() };
        }
        let base = self.mesh.faces[face as usize].base;
        let own = self.context.tracer.scene().geometry.face_objects[base as usize];
        let entered = |nodes: [&Node; 3], followed: bool, seen: f32| {
            guard::entered(self.context, own, nodes, followed, [seen, NEGLIGIBLE], self.brightest)
        };
        let mut found_clear = 0;
        for (nodes, followed) in
            self.predictor.shared(corners).filter(|(nodes, _)| nodes[0].bounces <= LOOKED_INTO)
        {
            if !followed {
                // Where corners disagree on what is dark, nothing else says that it may be lit between them.
                let seen = nodes.map(|node| self.predictor.square(node)).into_iter().fold(0.0, f32::max);
                let dark = seen < NEGLIGIBLE;
                square += if dark { entered(nodes, followed, seen).unwrap_or(0.0) } else { 0.0 };
                continue;
            }
            let [a, b, c] = nodes.map(|node| node.target);
            let shaft = (a == b && b == c).then_some((nodes[0].path, a));
            let within = shaft.is_some() && known.contains(&shaft);
            let seen = self.predictor.square(nodes[0]);
            if let Some(most) = (!within).then(|| entered(nodes, followed, seen)).flatten() {
                square += most;
            } else if let Some(other) =
                shaft.is_none().then(|| self.lit_otherwise(face, nodes, rays)).flatten()
            {
                square += seen.max(other);
            } else if shaft.is_some() && !within && seen >= NEGLIGIBLE && guard::shadowed(self.context, nodes)
            {
                square += seen;
            } else if shaft.is_some() {
                found_clear += usize::from(nodes.iter().all(|node| node.lit == shade::ALL_LIT));
                if let Some(room) = clear.iter_mut().find(|room| room.is_none()) {
                    *room = shaft;
                }
            }
        }
        let sure = square == 0.0 && corners.iter().all(|corner| corner.sample.nodes.len() == found_clear);
        Guarded { square, clear, sure }
    }

    /// Whether no shadow falls on a flat face that hides the lights `hidden` itself, and on which those of the lights `even` have
    /// no border between its corners.
    fn is_lit_throughout(corners: [Corner; 3], even: u32, hidden: u32) -> bool {
        let lit = corners.iter().fold(shade::ALL_LIT, |lit, corner| lit & corner.sample.primary.lit);
        lit & even | hidden == shade::ALL_LIT
    }

    /// Lights that the face hides itself.
    fn lights_behind(&self, face: u32) -> u32 {
        let Context { tracer, settings, view, .. } = *self.context;
        shade::lights_behind(tracer.scene(), settings.shadows, view, self.mesh.faces[face as usize].base)
    }

    /// Largest square of the light that a shadow takes from a corner of the face.
    fn shadowed(&self, face: u32) -> f32 {
        let Context { tracer, view, .. } = *self.context;
        let of_corner = |corner: u32| {
            let primary = self.samples.get(corner).primary;
            let surface = samples::start(&self.mesh, &self.mesh.vertices[corner as usize]).surface(tracer);
            let direction = view.direction_to(surface.position);
            let appearance = Appearance::new(tracer.scene(), &surface);
            let lit = shade::local(tracer.scene(), &surface, &appearance, direction, shade::ALL_LIT);
            predict::mean_square(lit.textured + lit.added - primary.local.textured - primary.local.added)
        };
        self.mesh.faces[face as usize].corners.map(of_corner).into_iter().fold(0.0, f32::max)
    }

    /// Whether a texture makes the face specular between its corners, for instance where metal shows between stripes of paint.
    fn is_specular_between(&self, face: u32) -> bool {
        let scene = self.context.tracer.scene();
        let mesh::Face { base, corners, .. } = self.mesh.faces[face as usize];
        let material = scene.face_material(base);
        let textures = [material.metallic_roughness_texture, material.transmission_texture];
        if !scene.is_vt(base) || textures == [None; 2] {
            return false;
        }
        let at = |slot: &TextureSlot, shares: [f32; 3]| {
            let uv = corners.map(|corner| self.mesh.vertices[corner as usize].uv[usize::from(slot.uv_set)]);
            texel::lookup(scene, slot, uv[0] * shares[0] + uv[1] * shares[1] + uv[2] * shares[2])
        };
        let specular = |shares: [f32; 3]| {
            let [metallic, transmission] = textures.map(|slot| slot.map(|slot| at(&slot, shares)));
            let metallic = material.metallic * metallic.map_or(1.0, |texel| texel.z);
            let transmission = material.transmission * transmission.map_or(1.0, |texel| texel.x);
            metallic.max(transmission) > self.context.settings.min_throughput
        };
        let lattice = (0..=LATTICE).flat_map(|i| (0..=LATTICE - i).map(move |j| [i, j, LATTICE - i - j]));
        lattice.map(|shares| shares.map(|share| share as f32 / LATTICE as f32)).any(specular)
    }

    /// Whether the face is visible and its samples say too little of it: it is too large, too curved, or a normal map bends
    /// what it reflects, and its pixels are not traced.
    pub(super) fn is_blind(&self, face: u32) -> bool {
        let State { pixels, blind, traced, .. } = self.state[face as usize];
        pixels > 0.0 && blind && !traced
    }

    /// Whether a blind face is looked into before others: it is a large part of the picture, or bent all over.
    fn is_urgent(&self, face: u32) -> bool {
        self.is_blind(face) && self.state[face as usize].urgent
    }

    /// Whether such a face is queued.
    pub(super) fn hides_much(&self) -> bool {
        let waits =
            |&Entry { face, .. }: &Entry| self.mesh.faces[face as usize].is_leaf() && self.is_urgent(face);
        self.queue.iter().any(waits)
    }

    /// Longest edge, in pixels, of a face whose samples are trusted although nothing between them was looked at.
    pub(super) fn reach(&self) -> f32 {
        BLIND * self.context.view.height.max(self.context.view.width) as f32
    }

    /// Whether a face with a longest edge of `size` pixels may hide anything between its corners. What is seen over
    /// several bounces is as much smaller.
    fn is_large(&self, size: f32, corners: [Corner; 3]) -> bool {
        let seen = corners.iter().flat_map(|corner| corner.sample.nodes);
        let seen = seen.filter(|node| node.throughput.max_element() > SEEN);
        let bounces = match self.predictor.reconstruction {
            Reconstruction::Exact => seen.map(|node| node.bounces).max().unwrap_or(0),
            Reconstruction::Paper => 0,
        };
        size * f32::from(bounces.max(FEW_BOUNCES)) > self.reach() * f32::from(FEW_BOUNCES)
    }

    /// Whether the face is specular, and it or what it reflects turns by more than `angle`, so far that its pixels had better
    /// be traced.
    fn is_curved(&self, face: u32, corners: [Corner; 3], angle: f32) -> bool {
        self.predictor.reconstruction == Reconstruction::Exact
            && !self.is_receiver(face)
            && (predict::curvature(corners) > angle || self.predictor.turns(corners, angle))
    }

    /// Whether a normal map bends what the face reflects.
    pub(super) fn is_mapped(&self, face: u32) -> bool {
        let scene = self.context.tracer.scene();
        let object = scene.geometry.face_objects[self.mesh.faces[face as usize].base as usize];
        let object = &scene.objects[object as usize];
        object.vt && self.mapped[object.material as usize]
    }
}
