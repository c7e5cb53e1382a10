//! One frame, from camera to finished image: a script of the stages (design §1).

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rustc_hash::FxHashSet;

use crate::constants::{COMPONENT_PRIMARY, MAX_LIGHTS};
use crate::error::{Error, Result};
use crate::gpu::{Gpu, Uploads};
use crate::options::{EffortOptions, Msaa, Options, Reconstruction, VisibilityWay};
use crate::plan::Plan;
use crate::reconstruct::bank::{self, Bank};
use crate::reconstruct::base;
use crate::reconstruct::drawn::Drawn;
use crate::reconstruct::frame_block::FrameBlock;
use crate::reconstruct::leaves;
use crate::reconstruct::nodes::{Corner, Matcher};
use crate::reconstruct::paper;
use crate::reconstruct::passes::{Painter, PassOptions};
use crate::reconstruct::show::{self, FrameData, LeafKind, Overlay};
use crate::reconstruct::supersample;
use crate::reconstruct::table::SceneTable;
use crate::refine::mesh::Mesh;
use crate::refine::pixels::{Shown, TracedPixel};
use crate::refine::predict::Predictor;
use crate::refine::reserve::Reserve;
use crate::refine::{Refiner, StoppedBy, pixels};
use crate::report::image::FloatImage;
use crate::report::stats::{self, Stats};
use crate::scene::structure::Structure;
use crate::scene::topology::Topology;
use crate::scene::{Scene, View};
use crate::trace::sample::Context;
use crate::trace::{Rays, Settings, Tracer};
use crate::visibility::{self, Adjacency, Class, Finder, Found};

/// What tracing needs of a scene, whatever the view: absent if nothing is traced.
struct Traced<'s> {
    tracer: Tracer<'s>,
    structures: Vec<Structure>,
    adjacency: Adjacency,
    classes: Vec<Class>,
}

/// Renders frames of one scene on one device.
pub struct Renderer<'s> {
    gpu: Arc<Gpu>,
    scene: &'s Scene,
    options: Options,
    plan: Plan,
    traced: Option<Traced<'s>>,
    /// Finds what is visible, if anything is traced.
    finder: Option<Finder<'s>>,
    table: SceneTable,
    base_textures: Vec<u32>,
    painter: Painter,
    settings: Settings,
    bvh_ms: f64,
    /// Samples of the last frame, and its time from the end of refinement to the finished image.
    finished: (u64, Duration),
    interrupt: Arc<AtomicBool>,
    /// What a time budget keeps back for that.
    reserve: Reserve,
    /// Least time between two steps that an observer sees.
    step_interval: Duration,
}

/// The image after a refinement step; the first is the preview, before any.
pub struct Step {
    /// Steps taken.
    pub number: u32,
    /// Vertices traced.
    pub samples: u64,
    /// Secondary rays: reflected and transmitted ones of vertices, and all of pixels that are traced one by one.
    pub secondary_rays: u64,
    /// Predicted RMS displacement of what is reflected, in pixels over VT pixels.
    pub predicted_error: f32,
    /// The image, linear.
    pub image: FloatImage,
}

/// What is shown the image after every step; an error of it ends the frame.
pub type Observer<'o> = &'o mut dyn FnMut(&Step) -> Result<()>;

/// A finished frame.
pub struct Frame {
    /// The image, linear; with [`Options::show`], the picture that it names.
    pub image: FloatImage,
    /// What it took.
    pub stats: Stats,
}

impl<'s> Renderer<'s> {
    /// Prepares what does not depend on the view: hierarchy, patches, textures, pipelines.
    ///
    /// # Errors
    /// More faces or texels than the device can hold; no device memory left.
    pub fn new(gpu: &Arc<Gpu>, scene: &'s Scene, options: &Options) -> Result<Self> {
        let started = Instant::now();
        let plan = Plan::new(scene, options);
        let mut bvh_ms = 0.0;
        let traced = if plan.traces() {
            let tracer = Tracer::new(scene);
            bvh_ms = ms(started);
            let classes = visibility::classes(scene, plan.receivers);
            Some(Traced {
                tracer,
                adjacency: Adjacency::new(scene, &plan.topology),
                structures: if plan.specular { Structure::all(scene) } else { Vec::new() },
                classes,
            })
        } else {
            None
        };
        let finder = traced
            .as_ref()
            .map(|traced| Finder::new(gpu, scene, &traced.classes, options.method.visibility))
            .transpose()?;
        let texels = plan.textures.bytes(scene, options.method.filter) + bank::panorama_bytes(scene);
        let mut uploads = Uploads::new(gpu, "texture uploads", bank::staging_bytes(texels))?;
        let bank = Bank::new(&mut uploads, scene, &plan.textures, options.method.filter)?;
        let table = SceneTable::new(scene, &plan.targets, &bank, options.scene.fresnel);
        let base_textures: Vec<u32> =
            scene.materials.iter().map(|m| bank.reference(m.base_color_texture)).collect();
        let single_pass = traced.is_some() && options.method.visibility == VisibilityWay::SinglePass;
        let classes = traced.as_ref().map(|traced| traced.classes.as_slice());
        let base = base::faces(scene, &table, &base_textures, classes, single_pass);
        let pass_options = PassOptions {
            reconstruction: options.method.reconstruction,
            passes: plan.passes.clone(),
            single_pass,
            equation: options.method.equation,
            samples: if options.method.msaa == Msaa::Four { 4 } else { 1 },
            features: plan.features,
            leaves: plan.traces(),
            lights: (scene.lights.len() as u32).min(MAX_LIGHTS),
        };
        let painter = Painter::new(gpu, pass_options, bank, &table, &base)?;
        let settings = Settings { depth: plan.depth, ..Settings::new(&options.paths, &options.scene) };
        Ok(Self {
            gpu: gpu.clone(),
            scene,
            options: options.clone(),
            plan,
            traced,
            finder,
            table,
            base_textures,
            painter,
            settings,
            bvh_ms,
            finished: (0, Duration::ZERO),
            interrupt: Arc::default(),
            reserve: Reserve::default(),
            step_interval: Duration::ZERO,
        })
    }

    /// Draws every pipeline once, so that drivers compile before anything is timed. Returns milliseconds.
    ///
    /// A frame with a time budget is rehearsed as a preview and in full: what both take from the last sample to
    /// the image tells what to keep back from the budget.
    ///
    /// # Errors
    /// What the driver says; no device memory left.
    pub fn warm_up(&mut self, view: &View) -> Result<f64> {
        let started = Instant::now();
        if let Some(finder) = &mut self.finder {
            finder.warm_up(view)?;
        }
        self.painter.warm_up(&FrameBlock::new(self.scene, view), self.traced.is_some())?;
        if self.options.effort.budget.is_some() {
            self.rehearse(view)?;
        }
        Ok(ms(started))
    }

    fn rehearse(&mut self, view: &View) -> Result<()> {
        let preview = EffortOptions { preview: true, ..EffortOptions::default() };
        let effort = std::mem::replace(&mut self.options.effort, preview);
        let few = self.render(view).map(|_| self.finished);
        self.options.effort = effort;
        self.render(view)?;
        self.reserve = Reserve::through(few?, self.finished);
        Ok(())
    }

    /// Finds the visible faces of `view` in the way that the options say, and nothing more; `None` if nothing
    /// is traced.
    ///
    /// # Errors
    /// No device memory left; a lost device.
    pub fn find_visible(&mut self, view: &View) -> Result<Option<Found<'_>>> {
        let block = FrameBlock::new(self.scene, view);
        let Self { finder, painter, .. } = self;
        finder.as_mut().map(|finder| finder.find(view, || painter.draw_base(&block))).transpose()
    }

    /// Lets `flag` end a frame between two refinement steps, with [`Error::Interrupted`].
    pub fn set_interrupt(&mut self, flag: Arc<AtomicBool>) {
        self.interrupt = flag;
    }

    /// Refines the frames from now on until `effort` is met, in place of what the options say.
    ///
    /// A renderer that was warmed up with a time budget keeps to another one as well.
    pub fn set_effort(&mut self, effort: EffortOptions) {
        self.options.effort = effort;
    }

    /// Shows an observer a step only where `interval` has passed since it saw one: drawing a step takes time that
    /// refinement then lacks. Zero, at first, shows all.
    pub fn set_step_interval(&mut self, interval: Duration) {
        self.step_interval = interval;
    }

    /// Renders one frame.
    ///
    /// # Errors
    /// No device memory left; a lost device.
    pub fn render(&mut self, view: &View) -> Result<Frame> {
        self.render_steps(view, None)
    }

    /// Renders one frame, and shows the preview and the image after every refinement step to `after_step`, at
    /// most one each [`set_step_interval`](Self::set_step_interval).
    /// Drawing them counts as the frame's time.
    ///
    /// # Errors
    /// No device memory left; a lost device; whatever `after_step` returns.
    pub fn render_steps(&mut self, view: &View, mut after_step: Option<Observer>) -> Result<Frame> {
        let started = Instant::now();
        let mut stats = self.blank_stats(view);
        let block = FrameBlock::new(self.scene, view);
        let mut overlay = None;
        let (mut refined, mut cost) = (Instant::now(), 0);
        let leaves = match (&self.traced, &mut self.finder) {
            (Some(traced), Some(finder)) => {
                let matcher = Matcher {
                    scene: self.scene,
                    targets: &self.plan.targets,
                    table: &self.table,
                    base_textures: &self.base_textures,
                    room: self.options.method.nodes as usize,
                };
                let (painter, plan) = (&mut self.painter, &self.plan);
                let found = finder.find(view, || painter.draw_base(&block))?;
                let mut draw_step =
                    |leaves: &Drawn, refiner: &Refiner, pixel_rays: Rays, after: &mut Option<Observer>| {
                        let Some(after) = after else { return Ok(()) };
                        painter.upload(leaves)?;
                        painter.draw(&block, Some(leaves), &plan.passes_for(leaves.components()).0)?;
                        after(&Step {
                            number: refiner.steps,
                            samples: refiner.samples.traced(),
                            secondary_rays: refiner.samples.rays.secondary() + pixel_rays.total(),
                            predicted_error: refiner.predicted().0,
                            image: painter.read_image()?,
                        })
                    };
                let job = Job {
                    topology: &plan.topology,
                    matcher: &matcher,
                    settings: &self.settings,
                    options: &self.options,
                    view,
                    started,
                    reserve: self.reserve,
                    interrupt: &self.interrupt,
                    step_interval: self.step_interval,
                };
                let observed = after_step.is_some();
                let mut observe = |leaves: &Drawn, refiner: &Refiner, rays: Rays| {
                    draw_step(leaves, refiner, rays, &mut after_step)
                };
                let sampled = job.sample(traced, &found, &mut stats, observed.then_some(&mut observe))?;
                (overlay, refined) = (sampled.overlay, sampled.refined);
                stats.notes.extend(finder.note.clone());
                cost = sampled.cost;
                Some(sampled.leaves)
            }
            _ => None,
        };
        let time = Instant::now();
        if let Some(leaves) = &leaves {
            self.painter.upload(leaves)?;
        }
        stats.time_ms.upload = ms(time);
        let time = Instant::now();
        let (passes, nothing) =
            self.plan.passes_for(leaves.as_ref().map_or(COMPONENT_PRIMARY, Drawn::components));
        stats.left_out.extend(nothing);
        let (drawings, mean) = supersample::draw(
            &mut self.painter,
            &block,
            leaves.as_ref(),
            &passes,
            self.options.method.ss.samples(),
        )?;
        stats.time_ms.draw = ms(time);
        stats.time_ms.frame = ms(started);
        stats.passes = drawings
            .into_iter()
            .map(|drawing| stats::Pass {
                name: drawing.name.into(),
                ms: drawing.ms,
                draws: drawing.draws.into(),
            })
            .collect();
        self.finished = (cost, refined.elapsed());
        let image = mean.map_or_else(|| self.painter.read_image(), Ok)?;
        Ok(Frame { image: overlay.map_or(image.clone(), |overlay| overlay.over(&image)), stats })
    }

    fn blank_stats(&self, view: &View) -> Stats {
        let scene = self.scene;
        let info = self.gpu.info();
        Stats {
            scene: stats::SceneStats::of(scene),
            image: stats::ImageStats { width: view.width, height: view.height, vt_pixels: 0 },
            time_ms: stats::Times { bvh: self.bvh_ms, ..stats::Times::default() },
            left_out: self.plan.left_out.clone(),
            notes: scene.notes.iter().chain(&self.painter.bank().notes).cloned().collect(),
            options: Some(stats::UsedOptions::Render(Box::new(self.options.clone()))),
            device: stats::Device { name: Some(info.name.clone()), driver: Some(info.driver.clone()) },
            ..Stats::default()
        }
    }
}

/// What sampling a frame needs besides what is traced.
struct Job<'a> {
    topology: &'a Topology,
    matcher: &'a Matcher<'a>,
    settings: &'a Settings,
    options: &'a Options,
    view: &'a View,
    /// When the time budget began to run.
    started: Instant,
    reserve: Reserve,
    interrupt: &'a AtomicBool,
    step_interval: Duration,
}

/// What sampling a frame gives.
struct Sampled {
    leaves: Drawn,
    /// The picture of [`Options::show`].
    overlay: Option<Overlay>,
    /// When refinement ended.
    refined: Instant,
    /// Samples that count against a budget.
    cost: u64,
}

/// What is shown the leaves after every step.
type LeafObserver<'o> = &'o mut dyn FnMut(&Drawn, &Refiner, Rays) -> Result<()>;

impl Job<'_> {
    /// Visibility, tracing and refinement: from the view to the leaves that are drawn.
    fn sample(
        &self,
        traced: &Traced,
        visible: &Found,
        stats: &mut Stats,
        mut after_step: Option<LeafObserver>,
    ) -> Result<Sampled> {
        let Self { matcher, topology, settings, options, view, .. } = *self;
        let scene = matcher.scene;
        let Traced { tracer, structures, adjacency, classes } = traced;
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
        let seeds = adjacency.one_ring(scene, topology, classes, view, visible.visible);
        let mesh = Mesh::new(scene, topology, view, &seeds);
        let mut refiner = Refiner::new(&context, &predictor, mesh, shown);
        refiner.reserve = self.reserve;
        let mut seen: Option<Instant> = None;
        let mut observe = |refiner: &Refiner| {
            if self.interrupt.load(Ordering::Relaxed) {
                return Err(Error::Interrupted);
            }
            let Some(after_step) = &mut after_step else { return Ok(()) };
            if seen.is_some_and(|seen| seen.elapsed() < self.step_interval) {
                return Ok(());
            }
            let (pixels, rays) = pixels::trace(&context, &refiner.mesh, shown, &refiner.pixel_faces);
            after_step(&self.assemble(refiner, &pixels), refiner, rays)?;
            seen = Some(Instant::now());
            Ok(())
        };
        observe(&refiner)?;
        let stopped_by = refiner.run(&options.effort, self.started, observe)?;
        let ended = Instant::now();
        let (predicted, predicted_rmse) = refiner.predicted();
        let refined = ms(time);

        let time = Instant::now();
        let (traced_pixels, pixel_rays) = pixels::trace(&context, &refiner.mesh, shown, &refiner.pixel_faces);
        let pixels_ms = ms(time);
        stats.time_ms.trace = refiner.samples.time.as_secs_f64() * 1e3 + pixels_ms;

        let time = Instant::now();
        let leaves = self.assemble(&refiner, &traced_pixels);
        stats.time_ms.refine = refined - refiner.samples.time.as_secs_f64() * 1e3 + ms(time);

        stats.samples = refiner.samples.traced();
        stats.rays = ray_stats(refiner.samples.rays, pixel_rays);
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
                    face_at: &|x, y| pixels::face_at(&context, shown, classes, x, y),
                    kind: &|leaf| self.kind(&refiner, leaf, traced.contains(&leaf)),
                },
            )
        });
        Ok(Sampled { leaves, overlay, refined: ended, cost: refiner.cost() })
    }

    fn assemble(&self, refiner: &Refiner, traced: &[TracedPixel]) -> Drawn {
        let Refiner { mesh, samples, pixel_faces, .. } = refiner;
        let Matcher { scene, targets, base_textures, .. } = self.matcher;
        match self.options.method.reconstruction {
            Reconstruction::Exact => {
                Drawn::Exact(leaves::assemble(self.matcher, self.view, mesh, samples, traced, pixel_faces))
            }
            Reconstruction::Paper => {
                Drawn::Paper(paper::assemble(scene, targets, base_textures, mesh, samples))
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
                self.matcher.leaf(corners, self.matcher.room).defined
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

fn ms(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}
