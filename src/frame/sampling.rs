//! Sampling one frame: from what is visible to the leaves that are drawn.

use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use rustc_hash::FxHashSet;

use super::kept::Samples;
use super::steps::{LeafObserver, Steps};
use super::{Traced, ms};
use crate::error::Result;
use crate::memory;
use crate::options::{Options, Reconstruction, Show};
use crate::pixels::leaves::TracedPixel;
use crate::pixels::picture::{Picture, Subject};
use crate::reconstruct::between::{Between, Search};
use crate::reconstruct::drawn::Drawn;
use crate::reconstruct::leaves;
use crate::reconstruct::nodes::{Corner, Matcher};
use crate::reconstruct::paper;
use crate::reconstruct::show::{self, FrameData, LeafKind, Overlay};
use crate::reconstruct::vertex::VertexLayout;
use crate::refine::mesh::Mesh;
use crate::refine::predict::Predictor;
use crate::refine::reserve::Reserve;
use crate::refine::shown::{self, Shown};
use crate::refine::{Refiner, StoppedBy};
use crate::report::stats::{self, Stats};
use crate::scene::View;
use crate::scene::topology::Topology;
use crate::trace::sample::Context;
use crate::trace::{Rays, Settings};
use crate::visibility::{Found, IdImage};

/// Nodes that a leaf of a preview owns at most: of so few samples more of them change next to nothing, and take half as long
/// again to draw.
const PREVIEW_NODES: usize = 2;

/// Bytes that a pixel takes to be traced beside the mesh.
const PICKED_PIXEL: u64 = 24;

/// What sampling a frame needs besides what is traced.
pub(super) struct Job<'a> {
    pub topology: &'a Topology,
    pub matcher: &'a Matcher<'a>,
    pub layout: VertexLayout,
    pub settings: &'a Settings,
    pub options: &'a Options,
    pub view: &'a View,
    /// When the time budget began to run.
    pub started: Instant,
    pub reserve: Reserve,
    pub interrupt: &'a AtomicBool,
    pub step_interval: Duration,
    /// Visible faces that are sampled at most, of all parts of the scene.
    pub most_faces: usize,
    /// Pixels of what is blended up to which they are traced, not drawn.
    pub most_veils: u64,
    /// Pixels beside the refined mesh that are traced at most, of faces left out of it and of what is blended each.
    pub most_direct: u64,
}

/// What sampling a frame gives.
pub(super) struct Sampled {
    pub leaves: Drawn,
    /// What only several samples a pixel show.
    pub between: Option<Between>,
    /// The picture of [`Options::show`].
    pub overlay: Option<Overlay>,
    /// When refinement ended.
    pub refined: Instant,
    /// Samples that count against a budget.
    pub cost: u64,
}

impl Job<'_> {
    /// Tracing and refinement: from what is `visible` to the leaves that are drawn.
    ///
    /// # Errors
    /// [`Error::Interrupted`](crate::error::Error::Interrupted); whatever `observer` returns.
    pub(super) fn sample(
        &self,
        traced: &Traced,
        visible: &Found,
        store: Option<&mut Samples>,
        stats: &mut Stats,
        observer: Option<&mut LeafObserver>,
    ) -> Result<Sampled> {
        let Self { matcher: &Matcher { scene, targets, .. }, settings, options, view, .. } = *self;
        let Traced { tracer, structures, pyramids, .. } = traced;
        note_visible(stats, visible);

        let time = Instant::now();
        let context = Context { tracer, targets, settings, view, pyramids: pyramids.as_ref() };
        let reconstruction = options.method.reconstruction;
        let exact = reconstruction == Reconstruction::Exact;
        // The paper's queue knows no guard.
        let shaft_guard = options.effort.shaft_guard && exact;
        let predictor = Predictor { targets, structures, scene, view, reconstruction, shaft_guard };
        let shown = Shown::from(visible);
        let subject = match exact {
            true => Subject::find(scene, view, visible, options, self.most_veils),
            false => Subject::default(),
        };
        let mesh = self.mesh(traced, visible, &subject);
        let (vertices, mut pixels) = store.map(|Samples { vertices, pixels, .. }| (vertices, pixels)).unzip();
        let mut refiner = Refiner::new(&context, &predictor, mesh, shown, vertices);
        refiner.reserve = self.reserve;

        memory::check(
            visible.faces.vt_pixels * PICKED_PIXEL,
            "pixels that are traced",
            memory::SMALLER_PICTURE,
        )?;
        let picture_time = Instant::now();
        let picture =
            subject.trace(&context, visible.ids, self.most_direct, pixels.as_deref_mut(), self.interrupt)?;
        let picture_time = picture_time.elapsed();
        refiner.add_direct(picture.direct);
        refiner.spend(picture.veils);

        let mut steps = Steps::new(self, &context, shown, &picture, pixels, observer);
        refiner.open_large(&options.effort);
        steps.show(&refiner)?;
        let stopped_by = refiner.run(&options.effort, self.started, |refiner| steps.show(refiner))?;
        // A preview is what an observer saw before the first step.
        if refiner.steps > 0 {
            refiner.unite();
        }
        let (refined, refine_ms) = (Instant::now(), ms(time));

        let time = Instant::now();
        let (pixels, pixel_rays) = steps.finish(&refiner)?;
        let tracing = refiner.samples.time + picture_time;
        let trace_ms = tracing.as_secs_f64() * 1e3;
        stats.time_ms.trace = trace_ms + ms(time);

        let time = Instant::now();
        let is_smooth = exact && options.method.has_sub_samples();
        let mut between = is_smooth.then(|| {
            let Subject { direct, veils, .. } = &subject;
            Between::find(&Search {
                scene,
                view,
                classes: &traced.classes,
                found: visible,
                mesh: &refiner.mesh,
                direct,
                veils,
                picture: &picture,
                traced: &pixels,
            })
        });
        let seen = is_smooth.then_some(visible.ids);
        let mut leaves = self.assemble(&refiner, pixels, &picture, options.effort.preview, seen);
        if let Some(between) = &mut between {
            between.complete(view, leaves.take_rest());
        }
        stats.time_ms.refine = refine_ms - trace_ms + ms(time);

        note_refined(stats, &refiner, stopped_by);
        stats.rays = ray_stats(refiner.samples.rays, pixel_rays + picture.rays);
        stats.faces.leaves = leaves.len();
        let kinds = leaves.kinds().map(u64::from);
        [stats.faces.defined, stats.faces.undefined, stats.faces.traced] = kinds;
        let overlay = options.show.map(|show| self.overlay(show, traced, &context, shown, &refiner));
        Ok(Sampled { leaves, between, overlay, refined, cost: refiner.cost() })
    }

    /// The unrefined mesh: visible faces and those around them, but for what is traced beside it.
    fn mesh(&self, traced: &Traced, visible: &Found, subject: &Subject) -> Mesh {
        let (scene, topology, view) = (self.matcher.scene, self.topology, self.view);
        let classes = subject.without(&traced.classes);
        let in_mesh: Vec<u32> =
            visible.visible.iter().copied().filter(|&face| !subject.holds(scene, face)).collect();
        let seeds = traced.adjacency.one_ring(scene, topology, &classes, view, &in_mesh);
        let some = seeds.len().div_ceil(self.most_faces).max(1);
        let seeds: Vec<_> = seeds.into_iter().step_by(some).collect();
        Mesh::new(scene, topology, view, &seeds)
    }

    /// The leaves that are drawn, and what was traced for them.
    pub(super) fn assemble(
        &self,
        refiner: &Refiner,
        pixels: Vec<TracedPixel>,
        picture: &Picture,
        preview: bool,
        smooth: Option<Option<IdImage>>,
    ) -> Drawn {
        let Refiner { mesh, samples, pixel_faces, .. } = refiner;
        let Matcher { scene, targets, base_textures, .. } = self.matcher;
        match self.options.method.reconstruction {
            Reconstruction::Exact => {
                let Self { matcher, layout, view, .. } = *self;
                let room = matcher.room.min(if preview { PREVIEW_NODES } else { usize::MAX });
                let matcher = Matcher { room, ..*matcher };
                let traced = leaves::Traced {
                    pixels,
                    faces: pixel_faces,
                    picture,
                    ids: smooth.flatten(),
                    is_smooth: smooth.is_some(),
                };
                Drawn::Exact(leaves::assemble(&matcher, layout, view, mesh, samples, traced))
            }
            Reconstruction::Paper => {
                Drawn::Paper(paper::assemble(scene, targets, base_textures, self.view, mesh, samples))
            }
        }
    }

    /// The picture that `show` names.
    fn overlay(
        &self,
        show: Show,
        traced: &Traced,
        context: &Context,
        shown: Shown,
        refiner: &Refiner,
    ) -> Overlay {
        let pixel_faces: FxHashSet<u32> = refiner.pixel_faces.iter().copied().collect();
        show::overlay(
            show,
            &FrameData {
                scene: self.matcher.scene,
                view: self.view,
                mesh: &refiner.mesh,
                samples: &refiner.samples,
                face_at: &|x, y| shown::face_at(context, shown, &traced.classes, x, y),
                displacement: &|leaf| refiner.displacement(leaf),
                kind: &|leaf| self.kind(refiner, leaf, pixel_faces.contains(&leaf)),
            },
        )
    }

    fn kind(&self, refiner: &Refiner, leaf: u32, traced: bool) -> LeafKind {
        let Matcher { scene, targets, .. } = self.matcher;
        let face = &refiner.mesh.faces[leaf as usize];
        if !scene.is_vt(face.base) {
            return LeafKind::Receiver;
        }
        if traced {
            return LeafKind::Traced;
        }
        let samples = face.corners.map(|v| refiner.samples.get(v));
        let defined = match self.options.method.reconstruction {
            Reconstruction::Paper => paper::branches(scene, targets, samples).defined,
            Reconstruction::Exact => {
                let corners = samples.map(|sample| Corner { sample, distance: None });
                self.matcher.is_defined(&corners)
            }
        };
        if defined { LeafKind::Defined } else { LeafKind::Undefined }
    }
}

/// What finding the visible faces gave, and took.
fn note_visible(stats: &mut Stats, visible: &Found) {
    stats.time_ms.visibility = visible.times.visibility;
    stats.time_ms.readback = visible.times.readback;
    stats.time_ms.scan = visible.times.scan;
    stats.readback.bytes = visible.readback_bytes;
    stats.readback.memory = Some(visible.readback_memory.name().into());
    stats.image.vt_pixels = visible.faces.vt_pixels;
    stats.faces.visible = visible.visible_vt as u64;
}

/// What refinement came to.
fn note_refined(stats: &mut Stats, refiner: &Refiner, stopped_by: StoppedBy) {
    stats.samples = refiner.cost();
    stats.vertices = refiner.samples.sampled();
    stats.reused = refiner.samples.reused;
    stats.steps = u64::from(refiner.steps);
    stats.stopped_by = Some(match stopped_by {
        StoppedBy::Error => stats::StoppedBy::Error,
        StoppedBy::MaxSamples => stats::StoppedBy::MaxSamples,
        StoppedBy::Budget => stats::StoppedBy::Budget,
        StoppedBy::Exhausted => stats::StoppedBy::NothingLeft,
        StoppedBy::Preview => stats::StoppedBy::Preview,
    });
    let (error, rmse) = refiner.predicted();
    stats.predicted_error = Some(f64::from(error));
    stats.predicted_rmse = Some(f64::from(rmse));
}

/// Rays of the vertices by kind, and all rays of the pixels that were traced one by one.
fn ray_stats(vertices: Rays, pixels: Rays) -> stats::Rays {
    stats::Rays {
        total: vertices.total() + pixels.total(),
        primary: vertices.primary,
        reflected: vertices.reflected,
        transmitted: vertices.transmitted,
        shadow: vertices.shadow,
        pixel: pixels.total(),
    }
}
