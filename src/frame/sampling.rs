//! Sampling one frame: from what is visible to the leaves that are drawn.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rustc_hash::FxHashSet;

use super::kept::Samples;
use super::{Traced, ms};
use crate::error::{Error, Result};
use crate::options::{Options, Reconstruction};
use crate::pixels;
use crate::pixels::direct::Direct;
use crate::pixels::leaves::TracedPixel;
use crate::pixels::veils::Veils;
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
use crate::visibility::Found;

/// Nodes that a leaf of a preview owns at most: of so few samples more of them change next to nothing, and take half as long
/// again to draw.
const PREVIEW_NODES: usize = 2;

/// Times that a step took to be shown, which must have passed before the next is.
const PAUSE: u32 = 3;

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
    /// Whether what is blended is traced, not drawn.
    pub traces_veils: bool,
    /// Pixels beside the refined mesh that are traced at most, of faces left out of it and of what is blended each.
    pub most_direct: u64,
}

/// What sampling a frame gives.
pub(super) struct Sampled {
    pub leaves: Drawn,
    /// The picture of [`Options::show`].
    pub overlay: Option<Overlay>,
    /// When refinement ended.
    pub refined: Instant,
    /// Samples that count against a budget.
    pub cost: u64,
}

/// What is shown the leaves after every step.
pub(super) type LeafObserver<'o> = &'o mut dyn FnMut(&mut Drawn, &Refiner, Rays) -> Result<()>;

impl Job<'_> {
    /// Visibility, tracing and refinement: from the view to the leaves that are drawn.
    pub(super) fn sample(
        &self,
        traced: &Traced,
        visible: &Found,
        store: Option<&mut Samples>,
        stats: &mut Stats,
        mut after_step: Option<LeafObserver>,
    ) -> Result<Sampled> {
        let Self { matcher, topology, settings, options, view, .. } = *self;
        let scene = matcher.scene;
        let Traced { tracer, structures, adjacency, classes, .. } = traced;
        let targets = matcher.targets;
        stats.time_ms.visibility = visible.times.visibility;
        stats.time_ms.readback = visible.times.readback;
        stats.time_ms.scan = visible.times.scan;
        stats.readback.bytes = visible.readback_bytes;
        stats.readback.memory = Some(visible.readback_memory.name().into());
        stats.image.vt_pixels = visible.faces.vt_pixels;
        stats.faces.visible = visible.visible_vt as u64;

        let shown = Shown::from(visible);
        let time = Instant::now();
        let context = Context { tracer, targets, settings, view };
        let reconstruction = options.method.reconstruction;
        // The paper's queue knows no guard.
        let shaft_guard = options.effort.shaft_guard && reconstruction == Reconstruction::Exact;
        let predictor = Predictor { targets, structures, scene, view, reconstruction, shaft_guard };
        let exact = reconstruction == Reconstruction::Exact;
        // Drawn in a picture of their own, before all else; where samples are counted, blended as they are.
        let veils = if exact && self.traces_veils { Veils::find(scene, view) } else { Veils::default() };
        let blends = veils.is_empty() && scene.objects.iter().any(|object| scene.is_veil(object));
        let direct = if exact && !blends { Direct::find(scene, view, visible) } else { Direct::none() };
        let in_mesh: Vec<u32> = visible.visible.iter().copied().filter(|&face| !direct.is(face)).collect();
        let seeds = adjacency.one_ring(scene, topology, &direct.without(classes), view, &in_mesh);
        let some = seeds.len().div_ceil(self.most_faces).max(1);
        let seeds: Vec<_> = seeds.into_iter().step_by(some).collect();
        let mesh = Mesh::new(scene, topology, view, &seeds);
        let (vertices, mut traced_before) =
            store.map(|Samples { vertices, pixels, .. }| (vertices, pixels)).unzip();
        let mut refiner = Refiner::new(&context, &predictor, mesh, shown, vertices);
        refiner.reserve = self.reserve;
        let direct_started = Instant::now();
        let (mut direct_pixels, mut direct_rays) = direct.trace(
            &context,
            visible.ids,
            self.most_direct,
            traced_before.as_deref_mut(),
            self.interrupt,
        )?;
        refiner.add_direct(direct_pixels.len() as u64);
        let (veiled, veiled_rays) = veils.trace(&context, self.most_direct, self.interrupt)?;
        direct_pixels.retain(|pixel| !veils.covers(pixel.index));
        direct_pixels.extend(veiled);
        direct_rays += veiled_rays;
        let depth = if veils.is_empty() { direct.depth } else { Veils::depth(view) };
        let direct_time = direct_started.elapsed();
        let with = |pixels: Vec<TracedPixel>, refiner: &Refiner, preview: bool| {
            let (faces, veiled) = (refiner.pixel_faces.as_slice(), !veils.is_empty());
            let traced = leaves::Traced { pixels, faces, direct: &direct_pixels, depth, veiled };
            self.assemble(refiner, traced, preview)
        };
        // When a step was seen, and how long it took to show.
        let mut seen: Option<(Instant, Duration)> = None;
        // Of pixels that were traced to be shown, and are known when the finished frame needs them.
        let mut kept_rays = Rays::default();
        let mut observe = |refiner: &Refiner| {
            if self.interrupt.load(Ordering::Relaxed) {
                return Err(Error::Interrupted);
            }
            let Some(after_step) = &mut after_step else { return Ok(()) };
            let too_soon =
                |(at, took): (Instant, Duration)| at.elapsed() < self.step_interval.max(took * PAUSE);
            if !self.step_interval.is_zero() && seen.is_some_and(too_soon) {
                return Ok(());
            }
            let started = Instant::now();
            let Refiner { mesh, pixel_faces, .. } = refiner;
            let (pixels, rays) = pixels::leaves::trace(
                &context,
                mesh,
                shown,
                pixel_faces,
                traced_before.as_deref_mut(),
                self.interrupt,
            )?;
            if traced_before.is_some() {
                kept_rays += rays;
            }
            after_step(
                &mut with(pixels, refiner, refiner.steps == 0),
                refiner,
                rays + direct_rays + refiner.border_rays,
            )?;
            seen = Some((Instant::now(), started.elapsed()));
            Ok(())
        };
        refiner.open_large(&options.effort);
        observe(&refiner)?;
        let stopped_by = refiner.run(&options.effort, self.started, observe)?;
        // A preview is what an observer saw before the first step.
        if refiner.steps > 0 {
            refiner.unite();
        }
        let ended = Instant::now();
        let (predicted, predicted_rmse) = refiner.predicted();
        let refined = ms(time);

        let time = Instant::now();
        let Refiner { mesh, pixel_faces, .. } = &refiner;
        let (traced_pixels, pixel_rays) =
            pixels::leaves::trace(&context, mesh, shown, pixel_faces, traced_before, self.interrupt)?;
        let pixel_rays = pixel_rays + kept_rays + refiner.border_rays;
        let pixels_ms = ms(time);
        let tracing = refiner.samples.time + direct_time;
        stats.time_ms.trace = tracing.as_secs_f64() * 1e3 + pixels_ms;

        let time = Instant::now();
        let leaves = with(traced_pixels, &refiner, options.effort.preview);
        stats.time_ms.refine = refined - tracing.as_secs_f64() * 1e3 + ms(time);

        stats.samples = refiner.samples.sampled();
        stats.reused = refiner.samples.reused;
        stats.rays = ray_stats(refiner.samples.rays, pixel_rays + direct_rays);
        stats.steps = u64::from(refiner.steps);
        stats.stopped_by = Some(match stopped_by {
            StoppedBy::Error => stats::StoppedBy::Error,
            StoppedBy::MaxSamples => stats::StoppedBy::MaxSamples,
            StoppedBy::Budget => stats::StoppedBy::Budget,
            StoppedBy::Exhausted => stats::StoppedBy::NothingLeft,
            StoppedBy::Preview => stats::StoppedBy::Preview,
        });
        stats.predicted_error = Some(f64::from(predicted));
        stats.predicted_rmse = Some(f64::from(predicted_rmse));
        stats.faces.leaves = leaves.len();
        let (defined, undefined) = leaves.defined();
        (stats.faces.defined, stats.faces.undefined) = (defined.into(), undefined.into());

        let overlay = options.show.map(|show| {
            let traced: FxHashSet<u32> = refiner.pixel_faces.iter().copied().collect();
            show::overlay(
                show,
                &FrameData {
                    scene,
                    view,
                    mesh: &refiner.mesh,
                    samples: &refiner.samples,
                    face_at: &|x, y| shown::face_at(&context, shown, classes, x, y),
                    displacement: &|leaf| refiner.displacement(leaf),
                    kind: &|leaf| self.kind(&refiner, leaf, traced.contains(&leaf)),
                },
            )
        });
        Ok(Sampled { leaves, overlay, refined: ended, cost: refiner.cost() })
    }

    fn assemble(&self, refiner: &Refiner, traced: leaves::Traced, preview: bool) -> Drawn {
        let Refiner { mesh, samples, .. } = refiner;
        let Matcher { scene, targets, base_textures, .. } = self.matcher;
        match self.options.method.reconstruction {
            Reconstruction::Exact => {
                let Self { matcher, layout, view, .. } = *self;
                let room = matcher.room.min(if preview { PREVIEW_NODES } else { usize::MAX });
                let matcher = Matcher { room, ..*matcher };
                Drawn::Exact(leaves::assemble(&matcher, layout, view, mesh, samples, traced))
            }
            Reconstruction::Paper => {
                Drawn::Paper(paper::assemble(scene, targets, base_textures, self.view, mesh, samples))
            }
        }
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
