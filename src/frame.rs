//! One frame, from camera to finished image: a script of the stages (design §1).

mod ahead;
mod kept;
mod sampling;
mod steps;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use crate::constants::COMPONENT_PRIMARY;
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::memory;
use crate::options::{EffortOptions, FilterMode, Options};
use crate::pixels::picture::most_veils;
use crate::pixels::smooth::Smoothing;
use crate::plan::Plan;
use crate::reconstruct::between::Between;
use crate::reconstruct::drawn::Drawn;
use crate::reconstruct::frame_block::FrameBlock;
use crate::reconstruct::nodes::Matcher;
use crate::reconstruct::passes::Drawing;
use crate::reconstruct::supersample;
use crate::refine::Refiner;
use crate::refine::reserve::Reserve;
use crate::refine::structure::Structure;
use crate::report::image::FloatImage;
use crate::report::stats::{self, Stats};
use crate::scene::{Scene, View};
use crate::trace::pyramid::Pyramids;
use crate::trace::{Rays, Settings, Tracer};
use crate::visibility::{Adjacency, Class, Finder, Found};

pub use ahead::Ahead;
use ahead::{Undelivered, overlaid};
pub use kept::Kept;
use kept::{Painted, Samples};
use sampling::{Job, Sampled};
use steps::LeafObserver;

/// What tracing needs of a scene, whatever the view: absent if no ray is traced.
struct Traced<'s> {
    tracer: Tracer<'s>,
    structures: Vec<Structure>,
    adjacency: Adjacency,
    classes: Vec<Class>,
    /// Mip levels for pixels that are traced, if textures have any.
    pyramids: Option<Pyramids>,
    bvh_ms: f64,
}

impl Traced<'_> {
    /// How the textures of pixels that are traced are filtered; `None` where they are read at level 0 alone.
    fn filter(&self) -> Option<FilterMode> {
        self.pyramids.as_ref().map(Pyramids::filter)
    }
}

/// Renders frames of one scene on one device.
pub struct Renderer<'s> {
    gpu: Arc<Gpu>,
    scene: &'s Scene,
    options: Options,
    plan: Plan,
    traced: Option<Traced<'s>>,
    /// Finds what is visible, if faces are sampled.
    finder: Option<Finder<'s>>,
    painted: Painted,
    settings: Settings,
    /// Samples of earlier frames, if they are kept.
    samples: Option<Samples>,
    /// Samples of the last frame, and its time from the end of refinement to the finished image.
    finished: (u64, Duration),
    interrupt: Arc<AtomicBool>,
    /// What a time budget keeps back for that.
    reserve: Reserve,
    /// Least time between two steps that an observer sees.
    step_interval: Duration,
    /// What these options do not ask for.
    kept: Kept,
    warming_up: bool,
    /// Pixels of what is blended up to which they are traced; warming up changes nothing.
    most_veils: u64,
}

/// Samples of the frame that compiles a scene's draws, the visible faces that it is about, of its samples the pixels
/// of faces beside the refined mesh, and samples of a pixel that it shades.
const WARM_UP_SAMPLES: u64 = 4096;
const WARM_UP_FACES: usize = 4096;
const WARM_UP_DIRECT: u64 = 1024;
const WARM_UP_SHADED: u32 = 4;

/// Bytes of a pixel of the picture, three floats.
pub(crate) const PICTURE_BYTES: u64 = 12;

/// The image after a refinement step; the first is the preview, before any, as far as the samples that are allowed take
/// it, half of them where they are spared.
pub struct Step {
    /// Steps taken.
    pub number: u32,
    /// All that counts against a budget, as in [`Stats::samples`].
    pub samples: u64,
    /// Vertices sampled.
    pub vertices: u64,
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
    /// `scene` is one that was classified and has its light, as [`Options::load`] gives it.
    ///
    /// # Errors
    /// [`Error::Option`] for what [`Options::check`] finds; more faces or texels than the device can hold; no device memory
    /// left.
    pub fn new(gpu: &Arc<Gpu>, scene: &'s Scene, options: &Options) -> Result<Self> {
        Self::reusing(Kept::default(), gpu, scene, options)
    }

    /// The same, but only what `kept` lacks: what [`into_kept`](Self::into_kept) left of a renderer on the same device,
    /// of the same faces, materials and textures; options and lights may be others.
    ///
    /// # Errors
    /// As for [`new`](Self::new).
    pub fn reusing(mut kept: Kept, gpu: &Arc<Gpu>, scene: &'s Scene, options: &Options) -> Result<Self> {
        options.check().map_err(Error::Option)?;
        Tracer::check_memory(scene)?;
        let plan = Plan::after(kept.plan.take(), scene, options);
        let traced = plan.has_rays().then(|| kept.traced(scene, &plan, options.method.filter));
        let sampled = traced.as_ref().filter(|_| plan.traces());
        let classes = sampled.map(|traced| traced.classes.as_slice());
        let way = options.method.visibility;
        let finder = classes.map(|classes| kept.finder(gpu, scene, classes, way)).transpose()?;
        let painted = kept.painted(gpu, scene, (options, &plan), classes)?;
        let settings = Settings { depth: plan.depth, ..Settings::new(&options.paths, &options.scene) };
        if let Some(samples) = &mut kept.samples {
            samples.trace_with(&settings, scene, traced.as_ref().and_then(Traced::filter));
        }
        Ok(Self {
            gpu: gpu.clone(),
            scene,
            options: options.clone(),
            plan,
            traced,
            finder,
            painted,
            settings,
            samples: kept.samples.take(),
            finished: (0, Duration::ZERO),
            interrupt: Arc::default(),
            reserve: kept.reserve,
            step_interval: Duration::ZERO,
            kept,
            warming_up: false,
            most_veils: most_veils(&options.effort),
        })
    }

    /// Ends this renderer; what of it outlives a change of options or lights is left.
    pub fn into_kept(self) -> Kept {
        let Self { plan, traced, finder, painted, samples, reserve, options, kept, .. } = self;
        let classes = traced.as_ref().map(|traced| traced.classes.clone()).unwrap_or_default();
        let made_for = (options.method.visibility, classes);
        Kept {
            finder: finder.and_then(Finder::outlive).map(|finder| (made_for, finder)),
            traced: traced.map(Traced::into_parts).or(kept.traced),
            plan: Some(plan),
            painted: Some(painted),
            samples,
            reserve,
        }
    }

    /// Keeps samples from frame to frame, up to about `most_bytes` bytes, and those pixels of the last view that were traced
    /// one by one: vertices that are seen again from the same eye point are not traced again, wherever the camera looks. The
    /// pictures are the same, to the last bit.
    pub fn keep_samples(&mut self, most_bytes: usize) {
        let mut samples = Samples::new(most_bytes);
        samples.trace_with(&self.settings, self.scene, self.traced.as_ref().and_then(Traced::filter));
        self.samples = Some(samples);
    }

    /// What traces rays, if any are traced.
    pub fn tracer(&self) -> Option<&Tracer<'s>> {
        self.traced.as_ref().map(|traced| &traced.tracer)
    }

    /// Draws once, on one pixel, what a frame of `view` with few samples draws, so that drivers compile before anything
    /// is timed: they do so for each pipeline and kind of texture that leaves of the scene have. Returns milliseconds.
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
        self.touch(view)?;
        if self.options.effort.budget.is_some() {
            self.rehearse(view)?;
        }
        Ok(ms(started))
    }

    fn touch(&mut self, view: &View) -> Result<()> {
        let effort = self.options.effort.clone();
        let samples = effort.max_samples.map_or(WARM_UP_SAMPLES, |most| most.min(WARM_UP_SAMPLES));
        // Sparing keeps small faces in the mesh: leaves are what pipelines are compiled for.
        self.options.effort =
            EffortOptions { max_samples: Some(samples), sparing: true, budget: None, ..effort.clone() };
        let kept = self.samples.take();
        self.warming_up = true;
        self.painted.painter.touch_only(true);
        let touched = self.draw(view, None);
        self.painted.painter.touch_only(false);
        self.warming_up = false;
        self.samples = kept;
        self.options.effort = effort;
        touched.map(drop)
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
        let Self { finder, painted, .. } = self;
        finder.as_mut().map(|finder| finder.find(view, || painted.painter.draw_base(&block))).transpose()
    }

    /// Lets what the last frame took from its last sample to its image say what a time budget keeps back from now on:
    /// for renderers that are not [`warm_up`](Self::warm_up)ed with a budget.
    pub fn learn_reserve(&mut self) {
        self.reserve.learn(self.finished);
    }

    /// Lets `flag` end a frame between two refinement steps, or while pixels are traced one by one, with
    /// [`Error::Interrupted`].
    pub fn set_interrupt(&mut self, flag: Arc<AtomicBool>) {
        self.interrupt = flag;
    }

    /// Refines the frames from now on until `effort` is met, in place of what the options say.
    ///
    /// A renderer that was warmed up with a time budget keeps to another one as well.
    pub fn set_effort(&mut self, effort: EffortOptions) {
        self.most_veils = most_veils(&effort);
        self.options.effort = effort;
    }

    /// Shows an observer a step only where `interval` has passed since it saw one, and three times as long as that took
    /// to draw: it is time that refinement lacks. Zero, at first, shows all.
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
    pub fn render_steps(&mut self, view: &View, after_step: Option<Observer>) -> Result<Frame> {
        let Undelivered { image, overlay, stats } = self.draw(view, after_step)?;
        let image = image.map_or_else(|| self.painted.painter.read_image(), Ok)?;
        Ok(Frame { image: overlaid(image, overlay), stats })
    }

    /// Makes one frame; its image stays with the painter, unless the host had a part in it.
    fn draw(&mut self, view: &View, observer: Option<Observer>) -> Result<Undelivered> {
        // Before the work that it would be for.
        memory::check_picture(view.width, view.height, PICTURE_BYTES)?;
        let started = Instant::now();
        let mut stats = self.blank_stats(view);
        let block = FrameBlock::new(self.scene, view);
        let sampled = self.sample(view, &block, started, observer, &mut stats)?;
        let (leaves, between, overlay, refined, cost) = match sampled {
            Some(Sampled { leaves, between, overlay, refined, cost }) => {
                (Some(leaves), between, overlay, refined, cost)
            }
            None => (None, None, None, Instant::now(), 0),
        };
        let whole = !leaves.as_ref().is_some_and(Drawn::veiled);
        let mut image = self.reconstruct(&block, leaves, between, &mut stats)?;
        if self.plan.smooths && !self.warming_up && self.options.show.is_none() {
            image = Some(self.smooth(view, whole, image, &mut stats)?);
        }
        stats.time_ms.frame = ms(started);
        self.finished = (cost, refined.elapsed());
        Ok(Undelivered { image, overlay, stats })
    }

    /// Visibility, tracing and refinement; `None` if nothing is sampled. The image after every step goes to `observer`.
    fn sample(
        &mut self,
        view: &View,
        block: &FrameBlock,
        started: Instant,
        mut observer: Option<Observer>,
        stats: &mut Stats,
    ) -> Result<Option<Sampled>> {
        let (Some(traced), Some(finder)) = (&self.traced, &mut self.finder) else { return Ok(None) };
        let Painted { painter, table, base_textures, .. } = &mut self.painted;
        let plan = &self.plan;
        let matcher = Matcher {
            scene: self.scene,
            targets: &plan.targets,
            table,
            base_textures,
            room: self.options.method.nodes as usize,
            shadows: self.settings.shadows,
        };
        let job = Job {
            topology: &plan.topology,
            matcher: &matcher,
            layout: plan.vertex_layout(),
            settings: &self.settings,
            options: &self.options,
            view,
            started,
            reserve: self.reserve,
            interrupt: &self.interrupt,
            step_interval: self.step_interval,
            most_faces: if self.warming_up { WARM_UP_FACES } else { usize::MAX },
            most_veils: self.most_veils,
            most_direct: if self.warming_up { WARM_UP_DIRECT } else { u64::MAX },
        };
        let found = finder.find(view, || painter.draw_base(block))?;
        let mut show = observer.as_mut().map(|observer| {
            |leaves: &mut Drawn, refiner: &Refiner, pixel_rays: Rays| {
                painter.upload(leaves)?;
                painter.draw(block, Some(leaves), &plan.passes_for(leaves.components()).0)?;
                observer(&Step {
                    number: refiner.steps,
                    samples: refiner.cost(),
                    vertices: refiner.samples.sampled(),
                    secondary_rays: refiner.samples.rays.secondary() + pixel_rays.total(),
                    predicted_error: refiner.predicted().0,
                    image: painter.read_image()?,
                })
            }
        });
        let show = show.as_mut().map(|show| show as &mut LeafObserver);
        let sampled = job.sample(traced, &found, self.samples.as_mut(), stats, show)?;
        stats.notes.extend(finder.note.clone());
        Ok(Some(sampled))
    }

    /// Draws what was sampled, or the scene's own faces alone. The mean of several draws is returned; the image of a single one
    /// stays with the painter.
    fn reconstruct(
        &mut self,
        block: &FrameBlock,
        mut leaves: Option<Drawn>,
        between: Option<Between>,
        stats: &mut Stats,
    ) -> Result<Option<FloatImage>> {
        let painter = &mut self.painted.painter;
        let time = Instant::now();
        let mut components = COMPONENT_PRIMARY;
        if let Some(leaves) = &mut leaves {
            painter.upload(leaves)?;
            components = leaves.components();
        }
        stats.time_ms.upload = ms(time);
        let time = Instant::now();
        let (passes, nothing) = self.plan.passes_for(components);
        stats.left_out.extend(nothing);
        let shaded = self.options.method.ss.samples();
        let shaded = if self.warming_up { shaded.min(WARM_UP_SHADED) } else { shaded };
        if let Some(between) = between.filter(|between| !between.is_empty()) {
            let replaces_picture = between.replaces_picture;
            let plain = painter.draw_plain(block, leaves.as_ref(), &passes, between.plain_pixels())?;
            let leaves = between.leaves(self.plan.vertex_layout(), &plain);
            painter.upload_between(&leaves, replaces_picture)?;
        }
        let drawn = supersample::draw(painter, block, leaves.as_ref(), &passes, shaded);
        painter.forget_between();
        let (drawings, image) = drawn?;
        stats.time_ms.draw = ms(time);
        let pass = |drawing: Drawing| stats::Pass {
            name: drawing.name.into(),
            ms: drawing.ms,
            draws: drawing.draws.into(),
        };
        stats.passes = drawings.into_iter().map(pass).collect();
        Ok(image)
    }

    /// Traces pixels of the finished picture again: of `image`, or of the painter's, in which specular objects are drawn `whole`.
    fn smooth(
        &mut self,
        view: &View,
        whole: bool,
        image: Option<FloatImage>,
        stats: &mut Stats,
    ) -> Result<FloatImage> {
        let Self { traced, settings, options, interrupt, painted, .. } = self;
        let time = Instant::now();
        let mut image = image.map_or_else(|| painted.painter.read_image(), Ok)?;
        if let Some(Traced { tracer, .. }) = traced {
            let most = options.method.pixel_samples.samples();
            let rays =
                Smoothing { tracer, settings, view, most, whole, interrupt }.apply(&mut image)?.total();
            stats.rays.pixel += rays;
            stats.rays.total += rays;
        }
        stats.time_ms.smooth = ms(time);
        Ok(image)
    }

    fn blank_stats(&self, view: &View) -> Stats {
        let scene = self.scene;
        let info = self.gpu.info();
        Stats {
            scene: stats::SceneStats::of(scene),
            image: stats::ImageStats { width: view.width, height: view.height, vt_pixels: 0 },
            time_ms: stats::Times {
                bvh: self.traced.as_ref().map_or(0.0, |traced| traced.bvh_ms),
                ..stats::Times::default()
            },
            left_out: self.plan.left_out.clone(),
            notes: scene.notes.iter().chain(&self.painted.painter.bank().notes).cloned().collect(),
            options: Some(stats::UsedOptions::Render(Box::new(self.options.clone()))),
            device: stats::Device { name: Some(info.name.clone()), driver: Some(info.driver.clone()) },
            ..Stats::default()
        }
    }
}

fn ms(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}
