//! Adaptive refinement in object space (paper §3; design §6).
//!
//! A queue of faces, largest predicted squared error × visible pixels first. Faces are popped in batches,
//! bisected, and the new vertices traced in parallel; the result does not depend on the number of threads.
//! Faces that are still undefined when they are small leave the queue: their pixels are traced one by one.

mod borders;
pub mod dense;
pub mod footprint;
pub mod guard;
mod judge;
pub mod mesh;
pub mod predict;
mod preview;
pub mod reserve;
pub mod samples;
pub mod shape;
pub mod shown;
pub mod store;
pub mod structure;
mod umbra;

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::time::{Duration, Instant};

use glam::Vec3;
use rayon::prelude::*;

use self::borders::Crossing;
use self::dense::Dense;
use self::judge::{Inherited, State};
use self::mesh::{Mesh, Split};
use self::predict::{Corner, Deviation, Predictor};
use self::reserve::Reserve;
use self::samples::Samples;
use self::shown::Shown;
use self::store::SampleStore;
use crate::options::{EffortOptions, Reconstruction};
use crate::trace::sample::Context;
use crate::trace::{Rays, shade};

/// Longest edge, in pixels, at which a face is no longer bisected but its pixels are traced: where time counts, for many
/// small faces take longer to sample, to judge and to draw than their pixels to trace (docs/speed.md).
pub const STOP_SIZE: f32 = 24.0;

/// The same as a share of the largest size at which samples are trusted for what is between them: for small images.
const TRACED_SHARE: f32 = 0.35;

/// The same for faces that are not specular, where shadows' borders run: a share of the largest size at which samples are
/// trusted, since a shadow that slips through between them is more of a small picture, and what it is at least and at most.
const RECEIVER_SHARE: f32 = 0.09;
const RECEIVER_STOP_SIZES: [f32; 2] = [8.0, 16.0];

/// The same where samples are [spared](EffortOptions::sparing) and few: more of a small face's pixels are defined by its
/// halves.
pub const SPARING_STOP_SIZE: f32 = 4.0;

/// Samples for each pixel of the refined faces below which they are few.
const FEW: f64 = 0.5;

/// The same for the paper's reconstruction, which traces no pixels and has nothing but samples: about a pixel.
pub const PAPER_STOP_SIZE: f32 = 1.5;

/// Longest edge, in pixels, of what traced halves are united to: of more than a few, tasks that trace them would differ much.
const UNITED_SIZE: f32 = 32.0;

/// Share of the leaves that one step bisects or has traced.
const BATCH_SHARE: usize = 8;
const BATCH_MIN: usize = 64;
const BATCH_MAX: usize = 4096;

/// Root mean square of linear radiance that may be off for each pixel of displacement that `--error` allows: not all that
/// goes wrong is displaced, shadows' borders least of all.
const COLOR_PER_PIXEL: f32 = 0.0003;

/// Share of a bisected face's error that each half inherits.
const INHERITED: f32 = 0.5;

/// What ended refinement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StoppedBy {
    /// The predicted error fell below the target.
    Error,
    /// The sample budget was spent.
    MaxSamples,
    /// The time budget was spent.
    Budget,
    /// Nothing was left to refine.
    Exhausted,
    /// No step was asked for.
    Preview,
}

/// Refinement of one frame in progress.
pub struct Refiner<'a> {
    context: &'a Context<'a>,
    predictor: &'a Predictor<'a>,
    shown: Shown<'a>,
    /// The mesh so far.
    pub mesh: Mesh,
    /// The samples of all its vertices.
    pub samples: Samples,
    /// Faces whose pixels are traced; until they are united, also those of them that were bisected for their neighbours' sake.
    pub pixel_faces: Vec<u32>,
    /// Steps taken.
    pub steps: u32,
    /// What a time budget keeps back; nothing unless set.
    pub reserve: Reserve,
    /// Samples of earlier frames, and of this one for later frames.
    store: Option<&'a mut SampleStore>,
    state: Vec<State>,
    /// By face: predicted squares of displacement and colour times its pixels, while it is refined nothing unless it is a
    /// leaf. Apart, for all are added up after every step.
    predicted: Vec<[f32; 2]>,
    queue: BinaryHeap<Entry>,
    /// Where borders go on, and nothing else says it.
    crossings: Vec<Crossing>,
    /// Rays that looked for these, and between corners that see different planes.
    pub border_rays: Rays,
    /// Largest radiance, by channel, of what the unrefined mesh shows at a vertex.
    brightest: Vec3,
    /// By material: whether it has a normal map that pixels can be traced for.
    mapped: Vec<bool>,
    /// In double precision: there may be more pixels than single precision counts.
    pixel_budget_used: f64,
    total_pixels: f64,
    /// Root mean squares at which refinement ends, displacement in pixels and linear radiance; `None` against a budget alone.
    target: Option<[f32; 2]>,
    /// Longest edge of a face whose pixels are traced, unless a normal map bends what it shows.
    stop_size: f32,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Entry {
    priority: f32,
    face: u32,
}

impl Eq for Entry {}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        self.priority.total_cmp(&other.priority).then(other.face.cmp(&self.face))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<'a> Refiner<'a> {
    /// Samples the vertices of the unrefined `mesh` and queues its faces. Samples that `store` knows are not traced,
    /// and it learns the others; the refinement is the same with and without one.
    pub fn new(
        context: &'a Context<'a>,
        predictor: &'a Predictor<'a>,
        mesh: Mesh,
        shown: Shown<'a>,
        mut store: Option<&'a mut SampleStore>,
    ) -> Self {
        if let Some(store) = &mut store {
            store.look_from(context.view);
        }
        let scene = context.tracer.scene();
        let bends = predictor.reconstruction == Reconstruction::Exact && !scene.geometry.tangents.is_empty();
        let mapped =
            scene.materials.iter().map(|material| bends && material.normal_texture.is_some()).collect();
        let mut refiner = Self {
            context,
            predictor,
            shown,
            mesh,
            samples: Samples::default(),
            pixel_faces: Vec::new(),
            steps: 0,
            reserve: Reserve::default(),
            store,
            state: Vec::new(),
            predicted: Vec::new(),
            queue: BinaryHeap::new(),
            crossings: Vec::new(),
            border_rays: Rays::default(),
            brightest: Vec3::ZERO,
            mapped,
            pixel_budget_used: 0.0,
            total_pixels: 0.0,
            target: None,
            stop_size: STOP_SIZE,
        };
        let faces = 0..refiner.mesh.faces.len() as u32;
        // The paper knows no traced pixels.
        let dense = match predictor.reconstruction {
            Reconstruction::Exact => Dense::find(scene, &refiner.mesh, shown.counts),
            Reconstruction::Paper => Dense::none(&refiner.mesh),
        };
        let store = refiner.store.as_deref_mut();
        refiner.samples.extend(context, &refiner.mesh, store, |vertex| dense.wanted[vertex as usize]);
        refiner.brightest = refiner.samples.brightest();
        refiner.make_room();
        let (traced, others): (Vec<u32>, Vec<u32>) = faces.partition(|&face| dense.is(face));
        for face in traced {
            refiner.state[face as usize].pixels = dense.pixels(face);
            refiner.trace_pixels_of(face);
        }
        let large = umbra::LARGE_SHARE * refiner.reach();
        let of_base = |face: u32| {
            let is_large = refiner.mesh.size(face) >= large;
            Inherited { even: if is_large { 0 } else { shade::ALL_LIT }, ..Inherited::default() }
        };
        let others: Vec<(u32, Inherited)> = others.into_iter().map(|face| (face, of_base(face))).collect();
        refiner.judge(&others);
        refiner.total_pixels = refiner.state.iter().map(|state| f64::from(state.pixels)).sum();
        refiner
    }

    /// Longest edge, in pixels, at which the face is no longer bisected.
    fn stop_size(&self, face: u32) -> f32 {
        match self.predictor.reconstruction {
            Reconstruction::Paper => PAPER_STOP_SIZE,
            Reconstruction::Exact if self.is_mapped(face) => STOP_SIZE,
            Reconstruction::Exact if self.is_receiver(face) => {
                let [least, most] = RECEIVER_STOP_SIZES;
                self.stop_size.min((RECEIVER_SHARE * self.reach()).clamp(least, most))
            }
            Reconstruction::Exact => self.stop_size.min(TRACED_SHARE * self.reach()),
        }
    }

    /// Whether nothing is reflected or transmitted by the face.
    fn is_receiver(&self, face: u32) -> bool {
        !self.context.tracer.scene().is_vt(self.mesh.faces[face as usize].base)
    }

    /// Lets `pixels` that are traced [beside the mesh](crate::pixels::direct) count as refined, and against a budget.
    pub fn add_direct(&mut self, pixels: u64) {
        self.pixel_budget_used += pixels as f64;
        self.total_pixels += pixels as f64;
    }

    /// Lets `pixels` that are traced count against a budget.
    pub fn spend(&mut self, pixels: u64) {
        self.pixel_budget_used += pixels as f64;
    }

    /// Samples that count against a budget: vertices, and pixels traced one by one.
    pub fn cost(&self) -> u64 {
        self.samples.sampled() + self.pixel_budget_used as u64
    }

    /// Predicted root mean square over the visible pixels: displacement in pixels, and linear radiance.
    pub fn predicted(&self) -> (f32, f32) {
        let [shift, color] = self.mean(self.predicted_sums());
        (shift, color)
    }

    /// Sums of the predicted squares.
    fn predicted_sums(&self) -> [f64; 2] {
        self.predicted.iter().fold([0.0; 2], |sums, of_face| [0, 1].map(|i| sums[i] + f64::from(of_face[i])))
    }

    /// Root mean squares over the visible pixels.
    fn mean(&self, sums: [f64; 2]) -> [f32; 2] {
        let pixels = self.total_pixels;
        sums.map(|sum| if pixels > 0.0 { (sum.max(0.0) / pixels).sqrt() as f32 } else { 0.0 })
    }

    /// Predicted displacement of what is reflected by leaf `face`, in pixels; 0 where its pixels are traced.
    pub fn displacement(&self, face: u32) -> f32 {
        self.state[face as usize].deviation.shift.sqrt()
    }

    /// Refines until the target or a budget of `effort` is met; `after_step` sees every step. The time budget
    /// runs from `started`; no step begins that would overrun it if it took as long and cost
    /// as much as the last one.
    ///
    /// Unless samples are spared, steps follow from what was traced before alone, whatever the limits: a frame
    /// that time ended is made again by its [`cost`](Self::cost) as the limit.
    ///
    /// # Errors
    /// Whatever `after_step` returns.
    pub fn run<E>(
        &mut self,
        effort: &EffortOptions,
        started: Instant,
        mut after_step: impl FnMut(&Self) -> Result<(), E>,
    ) -> Result<StoppedBy, E> {
        if effort.preview {
            return Ok(StoppedBy::Preview);
        }
        if effort.spared_samples().is_some_and(|limit| (limit as f64) < FEW * self.total_pixels) {
            self.stop_size = SPARING_STOP_SIZE;
        }
        if let Some(error) = effort.target() {
            self.target = Some([error, error * COLOR_PER_PIXEL]);
            self.queue_again();
        }
        let mut last_step = (Duration::ZERO, 0);
        loop {
            if effort.max_samples.is_some_and(|limit| self.cost() >= limit) {
                return Ok(StoppedBy::MaxSamples);
            }
            if effort.budget.is_some_and(|limit| {
                let reserve = self.reserve.at(self.cost() + last_step.1);
                started.elapsed() + last_step.0 + reserve >= limit
            }) {
                return Ok(StoppedBy::Budget);
            }
            // Nobody asks for them against a budget.
            let sums = if self.target.is_some() { self.predicted_sums() } else { [0.0; 2] };
            if self.is_enough(sums) && self.crossings.is_empty() {
                return Ok(StoppedBy::Error);
            }
            let room = effort.max_samples.map_or(u64::MAX, |limit| limit - self.cost());
            let (step_started, cost) = (Instant::now(), self.cost());
            if !self.step(room, sums) {
                return Ok(StoppedBy::Exhausted);
            }
            last_step = (step_started.elapsed(), self.cost() - cost);
            after_step(self)?;
        }
    }

    /// Whether predicted squares of these sums meet the target.
    fn is_enough(&self, sums: [f64; 2]) -> bool {
        let Some(most) = self.target else { return false };
        let [shift, color] = self.mean(sums);
        // Gouraud shading is off in colour wherever a texture is seen: of the paper's, displacement alone is asked, and that
        // no face is left that may hide anything.
        let colors_do = match self.predictor.reconstruction {
            Reconstruction::Exact => color <= most[1],
            Reconstruction::Paper => !self.hides_much(),
        };
        shift <= most[0] && colors_do
    }

    /// Bisects the most promising faces and traces their new vertices, at most about `room` of them, and no more once
    /// pixels that are traced meet the target; predicted squares are `sums` before. False if nothing is left to refine.
    fn step(&mut self, room: u64, mut sums: [f64; 2]) -> bool {
        let leaves = self.mesh.faces.len() / 2 + 1;
        let batch = (leaves / BATCH_SHARE).clamp(BATCH_MIN, BATCH_MAX);
        let cost_before = self.cost();
        let (vertices_before, pixels_before) = (self.mesh.vertices.len(), self.pixel_budget_used);
        let mut splits: Vec<Split> = Vec::new();
        let mut popped = 0;
        let traced_before = self.pixel_faces.len();
        self.follow_borders(&mut splits);
        // Where only borders are followed any more.
        let batch = if self.is_enough(sums) { 0 } else { batch };
        while popped < batch {
            let Some(&Entry { face, .. }) = self.queue.peek() else { break };
            let State { size, pixels, hopeless, traced, .. } = self.state[face as usize];
            let is_small = size <= self.stop_size(face) || hopeless && self.target.is_some();
            // The paper knows no traced pixels: its faces stop here as they are.
            let stops = is_small && self.predictor.reconstruction == Reconstruction::Paper;
            if !self.mesh.faces[face as usize].is_leaf() || traced || stops {
                self.queue.pop();
                continue;
            }
            let made = (self.mesh.vertices.len() - vertices_before) as u64;
            let of_pixels = self.pixel_budget_used - pixels_before;
            // Parts of a sample go with the last whole one: a limit that is met exactly must not leave out what a frame
            // without it has at this count.
            let is_free = is_small && (of_pixels + f64::from(pixels)) as u64 == of_pixels as u64;
            if made + of_pixels as u64 >= room && !is_free {
                break;
            }
            self.queue.pop();
            popped += 1;
            if !is_small {
                self.mesh.bisect(face, &mut splits);
                continue;
            }
            let predicted = self.predicted[face as usize];
            sums = [0, 1].map(|i| sums[i] - f64::from(predicted[i]));
            self.trace_pixels_of(face);
            if self.is_enough(sums) {
                break;
            }
        }
        if splits.is_empty() && self.pixel_faces.len() == traced_before {
            return false;
        }
        self.take(splits);
        self.find_crossings(traced_before);
        // One count for each picture, or it would not tell which of them was meant.
        if self.cost() == cost_before {
            self.pixel_budget_used += 1.0;
        }
        self.steps += 1;
        true
    }

    /// Traces the new vertices, and judges the halves of what was bisected.
    fn take(&mut self, mut splits: Vec<Split>) {
        self.samples.extend(self.context, &self.mesh, self.store.as_deref_mut(), |_| true);
        self.make_room();
        for split in &splits {
            self.predicted[split.face as usize] = [0.0; 2];
            self.hand_down(split.face);
        }
        splits.retain(|split| !self.state[split.face as usize].traced);
        let edges: Vec<Deviation> =
            splits.par_iter().with_min_len(32).map(|split| self.surprise(split)).collect();
        let mut halves: Vec<(u32, Inherited)> = Vec::with_capacity(2 * splits.len());
        for (split, edge) in splits.iter().zip(edges) {
            let State { clear, even, whole, .. } = self.state[split.face as usize];
            let inherited = Inherited { deviation: edge.scaled(INHERITED), clear, even, whole };
            let both = self.mesh.faces[split.face as usize].halves().into_iter().flatten();
            halves.extend(both.map(|half| (half, inherited)));
        }
        self.judge(&halves);
    }

    /// What tracing the middle of a bisected edge showed.
    fn surprise(&self, split: &Split) -> Deviation {
        let vertex = self.mesh.vertices[split.vertex as usize];
        let [a, b] = vertex.parents;
        let pixels = (self.mesh.image(a) - self.mesh.image(b)).length() * self.mesh.pixels_per_unit;
        self.predictor.edge([self.corner(a), self.corner(b)], self.corner(split.vertex), pixels)
    }

    fn corner(&self, vertex: u32) -> Corner<'_> {
        let distance = self.context.view.distance_to(self.mesh.position(vertex));
        let normal = self.mesh.vertices[vertex as usize].normal;
        Corner { sample: self.samples.get(vertex), distance, normal }
    }

    /// Makes room for what is known of new faces.
    fn make_room(&mut self) {
        self.state.resize(self.mesh.faces.len(), State::default());
        self.predicted.resize(self.mesh.faces.len(), [0.0; 2]);
    }

    fn trace_pixels_of(&mut self, face: u32) {
        let state = &mut self.state[face as usize];
        self.pixel_budget_used += f64::from(state.pixels);
        *state = state.traced();
        self.predicted[face as usize] = [0.0; 2];
        self.pixel_faces.push(face);
    }

    /// Unites what was bisected for nothing, for there is less to draw then: halves that are traced after all, or that
    /// show, as far as is known, what their whole does. Refinement is over.
    pub fn unite(&mut self) {
        let Self { mesh, state, .. } = self;
        let exact = self.predictor.reconstruction == Reconstruction::Exact;
        mesh.unite(state, |mesh, face, whole, halves| {
            if halves.iter().all(|half| half.traced) {
                return (mesh.size(face) <= UNITED_SIZE).then(|| whole.traced());
            }
            (exact && whole.is_known() && halves.iter().all(State::is_known)).then_some(whole)
        });
        self.pixel_faces = mesh.leaves().filter(|&face| state[face as usize].traced).collect();
    }

    /// Where a traced face was bisected for its neighbour's sake, its halves are traced in its place.
    fn hand_down(&mut self, face: u32) {
        let parent = self.state[face as usize];
        if parent.traced {
            for child in self.mesh.faces[face as usize].halves().into_iter().flatten() {
                self.state[child as usize] = State { pixels: parent.pixels * 0.5, ..parent };
                self.pixel_faces.push(child);
            }
        }
    }
}
