//! The render thread: always at work on what was wanted last, so that the window never waits for a picture.

use std::{
    cell::OnceCell,
    path::{Path, PathBuf},
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use glam::{DVec3, Vec3};

use super::{
    encode,
    inspect::{self, Path as SpecularPath},
    pace::Pace,
};
use crate::{
    error::{Error, Result},
    frame::{Frame, Kept, Renderer, Step},
    gpu::Gpu,
    options::{EffortOptions, Options, ViewOptions},
    report::{FloatImage, Stats},
    scene::{Camera, Light, Scene, View, gltf},
    trace::{Settings, Tracer, reference},
};

/// Budgets between two steps that are shown while the camera rests: each is drawn at the cost of refinement.
const STEP_INTERVAL: u32 = 4;

/// Bytes of samples that are kept from frame to frame: about half a million of them.
const SAMPLE_BYTES: usize = 512 << 20;

/// Reads and classifies a scene file.
pub type Loader = Box<dyn Fn(&Path) -> Result<Scene> + Send>;

/// What the window should show.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// Counts what was wanted: updates say which they answer.
    pub serial: u64,
    /// The scene file, and how often it was asked to be read again.
    pub source: (PathBuf, u32),
    /// Image, camera, method and effort.
    pub options: Options,
    /// Lights in place of those of the file.
    pub lights: Option<Arc<[Light]>>,
    /// Whether the camera moves: then one frame within `budget`, else all that `options` ask for.
    pub moving: bool,
    /// Time that a frame may take while the camera moves.
    pub budget: Duration,
    /// Pixels of the window along each side of a pixel that is drawn while the camera moves; as the budget allows if
    /// `None`.
    pub coarse: Option<u32>,
    /// Scale of the shown image, in stops.
    pub exposure: f32,
    /// Whether to trace the reference too.
    pub reference: bool,
    /// The pixel whose specular path to follow.
    pub pixel: Option<(u32, u32)>,
}

impl Wanted {
    /// Whether a renderer made for `other` can draw it.
    fn shares_renderer(&self, other: &Self) -> bool {
        let timeless = |options: &Options| Options {
            view: Default::default(),
            effort: EffortOptions::default(),
            ..options.clone()
        };
        let same_lights = match (&self.lights, &other.lights) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (a, b) => a.is_none() && b.is_none(),
        };
        self.source == other.source && same_lights && timeless(&self.options) == timeless(&other.options)
    }

    /// The last picture of a frame.
    fn finished(&self, image: &FloatImage, view: View, stats: Stats) -> Update {
        let progress = (stats.steps as u32, stats.samples, stats.predicted_error.unwrap_or(0.0) as f32);
        self.picture(image, view, progress, Some(Box::new(stats)))
    }

    fn picture(
        &self,
        image: &FloatImage,
        view: View,
        progress: (u32, u64, f32),
        stats: Option<Box<Stats>>,
    ) -> Update {
        let complete = !self.moving && stats.is_some();
        let pixels = Pixels::encoded(image, self.exposure);
        Update::Picture(Box::new(Picture { serial: self.serial, pixels, view, progress, stats, complete }))
    }
}

/// What the window hears of.
pub enum Update {
    /// A scene was read.
    Scene(Box<Facts>),
    /// An image, better than the one before or of another view.
    Picture(Box<Picture>),
    /// The reference of the view that is shown.
    Reference(Pixels),
    /// The path behind the pixel that was clicked.
    Path(SpecularPath),
    /// What was wanted cannot be had; what is shown stays.
    Problem(Error),
}

/// What the window knows of a scene.
pub struct Facts {
    /// Smallest and largest corner.
    pub bounds: (Vec3, Vec3),
    /// What to look at: the centre of the specular objects, of all where there are none.
    pub focus: Vec3,
    /// World position of the scene's coordinate origin.
    pub origin: DVec3,
    /// Cameras of the file.
    pub cameras: Vec<Camera>,
    /// Lights, those added for want of any left out.
    pub lights: Vec<Light>,
    /// Files that the scene was read from besides its own.
    pub beside: Vec<PathBuf>,
}

/// Opaque RGBA bytes, row by row from the top.
#[derive(Clone, Default)]
pub struct Pixels {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `4 · width · height` bytes.
    pub rgba: Vec<u8>,
}

impl Pixels {
    fn encoded(image: &FloatImage, exposure: f32) -> Self {
        Self { width: image.width, height: image.height, rgba: encode::rgba(image, exposure) }
    }
}

/// An image with what is known of it.
pub struct Picture {
    /// Which wish it answers.
    pub serial: u64,
    /// What is shown.
    pub pixels: Pixels,
    /// From where.
    pub view: View,
    /// Refinement steps, samples and predicted error so far.
    pub progress: (u32, u64, f32),
    /// What it took; `None` before refinement ended.
    pub stats: Option<Box<Stats>>,
    /// Whether refinement went as far as it was asked to, the camera at rest.
    pub complete: bool,
}

/// Where the window leaves what it wants, and the render thread finds it.
#[derive(Default)]
pub struct Mailbox {
    slot: Mutex<Slot>,
    filled: Condvar,
    interrupt: Arc<AtomicBool>,
}

#[derive(Default)]
struct Slot {
    wanted: Option<Wanted>,
    closed: bool,
    /// Whether what is worked on may be given up for something newer.
    patient: bool,
}

impl Mailbox {
    /// Replaces what was wanted before. A frame of a moving camera is still finished, anything else is given up.
    pub fn post(&self, wanted: Wanted) {
        let mut slot = self.lock();
        // A click is answered even if the camera moved on meanwhile.
        let pixel = wanted.pixel.or(slot.wanted.as_ref().and_then(|before| before.pixel));
        slot.wanted = Some(Wanted { pixel, ..wanted });
        if slot.patient {
            self.interrupt.store(true, Ordering::Relaxed);
        }
        self.filled.notify_one();
    }

    /// Ends the render thread.
    pub fn close(&self) {
        self.lock().closed = true;
        self.interrupt.store(true, Ordering::Relaxed);
        self.filled.notify_one();
    }

    /// Waits for something new; `None` once closed.
    fn next(&self) -> Option<Wanted> {
        let mut slot = self.lock();
        loop {
            if slot.closed {
                return None;
            }
            if let Some(wanted) = slot.wanted.take() {
                slot.patient = !wanted.moving;
                self.interrupt.store(false, Ordering::Relaxed);
                return Some(wanted);
            }
            slot.patient = false;
            slot = self.filled.wait(slot).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Slot> {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What the render thread works with.
pub struct Worker {
    /// The device.
    pub gpu: Arc<Gpu>,
    /// Where it finds what is wanted.
    pub mailbox: Arc<Mailbox>,
    /// How it reads scenes.
    pub load: Loader,
    /// Where its updates go.
    pub send: Box<dyn Fn(Update) + Send>,
}

/// A scene in use.
struct Loaded {
    source: (PathBuf, u32),
    scene: Scene,
    /// The file's own lights.
    lights: Vec<Light>,
    /// Where the headlight is, in a scene without lights of its own.
    headlight: Option<Vec3>,
    /// What the last renderer has left.
    kept: Option<Kept>,
    pace: Pace,
}

impl Worker {
    /// Works until the mailbox is closed.
    ///
    /// # Errors
    /// The first scene cannot be read; the device fails.
    pub fn run(self) -> Result<()> {
        let mut loaded: Option<Loaded> = None;
        let mut next = self.mailbox.next();
        while let Some(wanted) = next {
            match self.serve_source(&mut loaded, wanted) {
                Ok(other) => next = other,
                Err(error) if loaded.is_none() || matches!(error, Error::Vulkan { .. }) => return Err(error),
                Err(error) => {
                    (self.send)(Update::Problem(error));
                    next = self.mailbox.next();
                }
            }
        }
        Ok(())
    }

    /// Draws what is wanted until another scene is; returns what asks for it.
    fn serve_source(&self, loaded: &mut Option<Loaded>, mut wanted: Wanted) -> Result<Option<Wanted>> {
        let current = match loaded.take() {
            Some(current) if current.source == wanted.source => loaded.insert(current),
            before => match (self.load)(&wanted.source.0) {
                Ok(scene) => {
                    let read = Loaded::new(scene, wanted.source.clone());
                    (self.send)(Update::Scene(Box::new(read.facts())));
                    loaded.insert(read)
                }
                Err(error) => {
                    // What was shown before goes on being shown.
                    *loaded = before.map(|before| Loaded { source: wanted.source.clone(), ..before });
                    return Err(error);
                }
            },
        };
        loop {
            current.light(&wanted)?;
            let kept = current.kept.take();
            let lit = &*current;
            let mut artist = self.artist(lit, kept, &wanted)?;
            let other = loop {
                match artist.draw(&wanted) {
                    Ok(()) | Err(Error::Interrupted) => {}
                    Err(error) => return Err(error),
                }
                let Some(newer) = self.mailbox.next() else { return Ok(None) };
                if !newer.shares_renderer(&wanted) || lit.needs_light(&newer)? {
                    break newer;
                }
                wanted = newer;
            };
            let Artist { renderer, pace, .. } = artist;
            (current.kept, current.pace) = (Some(renderer.into_kept()), pace);
            if other.source != current.source {
                return Ok(Some(other));
            }
            wanted = other;
        }
    }

    /// A renderer of the current scene, made of what the one before has left.
    fn artist<'l>(&'l self, current: &'l Loaded, kept: Option<Kept>, wanted: &Wanted) -> Result<Artist<'l>> {
        let Loaded { scene, pace, .. } = current;
        let first = kept.is_none();
        let mut renderer = Renderer::reusing(kept.unwrap_or_default(), &self.gpu, scene, &wanted.options)?;
        renderer.set_interrupt(self.mailbox.interrupt.clone());
        if first {
            renderer.keep_samples(SAMPLE_BYTES);
            renderer.warm_up(&wanted.options.view.resolve(scene)?)?;
        }
        Ok(Artist { worker: self, renderer, scene, tracer: OnceCell::new(), pace: *pace })
    }
}

/// Draws one scene with one set of options.
struct Artist<'l> {
    worker: &'l Worker,
    renderer: Renderer<'l>,
    scene: &'l Scene,
    /// For paths and the reference, where the renderer traces nothing itself.
    tracer: OnceCell<Tracer<'l>>,
    pace: Pace,
}

impl Artist<'_> {
    fn draw(&mut self, wanted: &Wanted) -> Result<()> {
        let view = wanted.options.view.resolve(self.scene)?;
        let settings = Settings::new(&wanted.options.paths, &wanted.options.scene);
        let send = &self.worker.send;
        if let Some(pixel) = wanted.pixel {
            send(Update::Path(inspect::follow(self.tracer(), &settings, &view, pixel)));
        }
        if wanted.moving {
            return self.draw_moving(wanted);
        }
        self.renderer.set_effort(wanted.options.effort.clone());
        self.renderer.set_step_interval(wanted.budget * STEP_INTERVAL);
        let mut show = |step: &Step| {
            // Pictures of data exist once refinement ended.
            if wanted.options.show.is_none() {
                let progress = (step.number, step.samples, step.predicted_error);
                send(wanted.picture(&step.image, view, progress, None));
            }
            Ok(())
        };
        let Frame { image, stats } = self.renderer.render_steps(&view, Some(&mut show))?;
        send(wanted.finished(&image, view, stats));
        if wanted.reference {
            let interrupt = &self.worker.mailbox.interrupt;
            let traced = reference::render(self.tracer(), &view, &settings, 1, None, interrupt, &|_| {})?;
            let image = FloatImage { width: view.width, height: view.height, pixels: traced.image };
            send(Update::Reference(Pixels::encoded(&image, wanted.exposure)));
        }
        Ok(())
    }

    /// Draws one frame within the budget, coarser if that is what it takes.
    fn draw_moving(&mut self, wanted: &Wanted) -> Result<()> {
        let started = Instant::now();
        let coarse = wanted.coarse.unwrap_or(self.pace.coarse());
        let ViewOptions { width, height, .. } = wanted.options.view;
        let (width, height) = (width.div_ceil(coarse), height.div_ceil(coarse));
        let view = ViewOptions { width, height, ..wanted.options.view.clone() }.resolve(self.scene)?;
        self.renderer.set_effort(moving_effort(wanted));
        let Frame { image, stats } = self.renderer.render(&view)?;
        self.renderer.learn_reserve();
        let sampling = Duration::from_secs_f64((stats.time_ms.trace + stats.time_ms.refine) * 1e-3);
        let picture = wanted.finished(&image, view, stats);
        self.pace.took(started.elapsed().saturating_sub(sampling), wanted.budget);
        (self.worker.send)(picture);
        Ok(())
    }

    fn tracer(&self) -> &Tracer<'_> {
        self.renderer.tracer().unwrap_or_else(|| self.tracer.get_or_init(|| Tracer::new(self.scene)))
    }
}

/// Centre of the box around all specular VT objects.
fn specular_centre(scene: &Scene) -> Option<Vec3> {
    let ranges = scene.objects.iter().filter(|object| object.vt).map(|object| object.vertices.clone());
    let mut points = ranges.flatten().map(|vertex| scene.geometry.positions[vertex as usize]);
    let first = points.next()?;
    let (low, high) = points.fold((first, first), |(low, high), p| (low.min(p), high.max(p)));
    Some((low + high) * 0.5)
}

/// What a frame of a moving camera is allowed.
fn moving_effort(wanted: &Wanted) -> EffortOptions {
    let effort = wanted.options.effort.clone();
    if effort.preview { effort } else { EffortOptions { budget: Some(wanted.budget), ..effort } }
}

impl Loaded {
    fn new(scene: Scene, source: (PathBuf, u32)) -> Self {
        Self {
            source,
            lights: scene.lights.clone(),
            scene,
            headlight: None,
            kept: None,
            pace: Pace::default(),
        }
    }

    fn facts(&self) -> Facts {
        let Scene { origin, cameras, .. } = &self.scene;
        let bounds = self.scene.bounds();
        Facts {
            bounds,
            focus: specular_centre(&self.scene).unwrap_or((bounds.0 + bounds.1) * 0.5),
            origin: *origin,
            cameras: cameras.clone(),
            lights: self.lights.clone(),
            beside: gltf::files_beside(&self.source.0, &gltf::Limits::default()),
        }
    }

    /// Whether a camera that came to rest left the headlight behind.
    fn needs_light(&self, wanted: &Wanted) -> Result<bool> {
        let Some(headlight) = self.headlight else { return Ok(false) };
        Ok(!wanted.moving && wanted.options.view.resolve(&self.scene)?.eye != headlight)
    }

    /// Lights the scene as wanted: by the lights given, else the file's, else from the eye as `vtrace render` does.
    fn light(&mut self, wanted: &Wanted) -> Result<()> {
        let view = wanted.options.view.resolve(&self.scene)?;
        let lights = wanted.lights.as_deref().unwrap_or(&self.lights);
        self.headlight = lights.is_empty().then_some(view.eye);
        self.scene.lights = lights.to_vec();
        if self.headlight.is_some() {
            let notes = std::mem::take(&mut self.scene.notes);
            self.scene.add_default_lights(&view);
            self.scene.notes = notes;
        }
        Ok(())
    }
}
