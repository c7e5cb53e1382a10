//! Everything set up to make pictures of one view again and again, each by its own way.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use super::ladder::{self, Antialiasing, Job, Ladder, Rate};
use super::rounds::Timed;
use crate::error::{Error, Result};
use crate::frame::{Frame, Renderer};
use crate::gpu::Gpu;
use crate::options::{Msaa, Options, Reconstruction, Shadows, Ss};
use crate::report::FloatImage;
use crate::report::stats::{Stats, Times};
use crate::scene::{Scene, View};
use crate::trace::reference::{self, Following, Samples};
use crate::trace::{Settings, Tracer};

/// A picture and what it took.
pub struct Shot {
    /// The picture, linear.
    pub image: FloatImage,
    /// Rays traced.
    pub rays: u64,
    /// What vertex tracing says of its frame.
    pub stats: Option<Box<Stats>>,
}

impl Shot {
    /// Where the time went, by vertex tracing.
    pub fn stages(&self) -> Option<Times> {
        self.stats.as_ref().map(|stats| stats.time_ms)
    }
}

/// Renderers and a tracer of one view, built once: no time of theirs holds loading or preparation.
pub struct Studio<'s> {
    /// The scene.
    pub scene: &'s Scene,
    /// The view.
    pub view: View,
    /// What decides over rays.
    pub settings: Settings,
    /// Per pixel whether its centre shows a specular VT object first.
    pub vt_mask: Vec<bool>,
    min_throughput: Option<f32>,
    tracer: Tracer<'s>,
    frames: Vec<(Reconstruction, Antialiasing, Renderer<'s>)>,
    /// Frames that trace nothing, by their samples a pixel.
    plain: Vec<((Ss, Msaa), Renderer<'s>)>,
    interrupt: Arc<AtomicBool>,
}

/// `scene` with no object that is specular.
pub fn without_vt(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    scene.objects.iter_mut().for_each(|object| object.vt = false);
    scene
}

impl<'s> Studio<'s> {
    /// Sets up what `ladder` needs of `scene`; `plain` is the same [without VT objects](without_vt).
    ///
    /// # Errors
    /// As for [`Renderer::new`]; no such camera.
    pub fn new(
        gpu: &Arc<Gpu>,
        scene: &'s Scene,
        plain: &'s Scene,
        ladder: &Ladder,
        interrupt: &Arc<AtomicBool>,
    ) -> Result<Self> {
        let view = ladder.options.view.resolve(scene)?;
        let renderer = |scene: &'s Scene, options: &Options| {
            let mut renderer = Renderer::new(gpu, scene, options)?;
            renderer.set_interrupt(interrupt.clone());
            renderer.warm_up(&view)?;
            Ok(renderer)
        };
        let mut frames = Vec::new();
        for &reconstruction in &ladder.reconstructions {
            for &antialiasing in &ladder.antialiasings {
                let mut options = antialiasing.apply(&ladder.options);
                options.method.reconstruction = reconstruction;
                frames.push((reconstruction, antialiasing, renderer(scene, &options)?));
            }
        }
        let floors = ladder.antialiasings.iter().map(|antialiasing| antialiasing.samples());
        let rests = ladder.rates.iter().map(|rate| (rate.supersampling(), Msaa::One));
        let mut rasterised: Vec<((Ss, Msaa), Renderer)> = Vec::new();
        for samples in floors.chain(rests) {
            if rasterised.iter().all(|(known, _)| *known != samples) {
                let mut options = ladder.options.clone();
                (options.method.ss, options.method.msaa) = samples;
                // Shadows on diffuse objects are traced, unless none are asked for.
                options.scene.shadows = Shadows::None;
                rasterised.push((samples, renderer(plain, &options)?));
            }
        }
        let tracer = Tracer::new(scene);
        Ok(Self {
            vt_mask: reference::vt_mask(&tracer, &view),
            settings: Settings::new(&ladder.options.paths, &ladder.options.scene),
            min_throughput: ladder.min_throughput,
            scene,
            view,
            tracer,
            frames,
            plain: rasterised,
            interrupt: interrupt.clone(),
        })
    }

    /// Makes one picture. The time of a frame is its own; that of a tracer the tracing alone, with the stretch
    /// of a coarse image and, on specular pixels, with the rasterised frame around them.
    ///
    /// # Errors
    /// As for [`Renderer::render`] and [`reference::render`]; [`Error::Option`] for a job that the ladder lacks.
    pub fn run(&mut self, job: &Job) -> Result<Timed<Shot>> {
        match *job {
            Job::Frame { reconstruction, antialiasing, samples } => {
                let wanted = (reconstruction, antialiasing);
                let found = self.frames.iter_mut().find(|frame| (frame.0, frame.1) == wanted);
                let (.., renderer) = set_up(found)?;
                renderer.set_effort(ladder::effort(samples));
                Ok(shot(renderer.render(&self.view)?))
            }
            Job::Floor(antialiasing) => Ok(shot(self.rasterise(antialiasing.samples())?)),
            Job::Traced(rate) => {
                let Traced { ms, rays, image } = self.trace(rate, Following::Together, None, &|_| {})?;
                Ok((ms, Shot { image, rays, stats: None }))
            }
            Job::Hybrid(rate) => self.hybrid(rate),
        }
    }

    /// Traces specular pixels and lays them over a rasterised frame, which lacks shadows on diffuse objects.
    fn hybrid(&mut self, rate: Rate) -> Result<Timed<Shot>> {
        let mask = grown(&self.vt_mask, &self.view, rate);
        let coarse = (rate.side > 1).then(|| shrunk(&mask, &self.view, rate));
        let traced =
            self.trace(rate, Following::Together, Some(coarse.as_deref().unwrap_or(&mask)), &|_| {})?;
        let frame = self.rasterise((rate.supersampling(), Msaa::One))?;
        let started = Instant::now();
        let mut image = frame.image;
        for (pixel, value) in traced.image.pixels.iter().enumerate().filter(|(pixel, _)| mask[*pixel]) {
            image.pixels[pixel] = *value;
        }
        let time = traced.ms + frame.stats.time_ms.frame + ms(started);
        Ok((time, Shot { image, rays: traced.rays + frame.stats.rays.total, stats: None }))
    }

    /// A frame that traces nothing.
    fn rasterise(&mut self, samples: (Ss, Msaa)) -> Result<Frame> {
        let (_, renderer) = set_up(self.plain.iter_mut().find(|(known, _)| *known == samples))?;
        renderer.render(&self.view)
    }

    /// So many samples a pixel of the tracer's, under what the ladder says of branches.
    pub fn samples(&self, count: u32, following: Following) -> Samples {
        Samples { count, following, min_throughput: self.min_throughput }
    }

    /// The tracer's image, rays followed alone or together, of all pixels or of those that `only` marks on the coarse image of `rate`.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn trace(
        &self,
        rate: Rate,
        following: Following,
        only: Option<&[bool]>,
        progress: &(dyn Fn(f32) + Sync),
    ) -> Result<Traced> {
        let view = coarse(&self.view, rate);
        let traced = reference::render(
            &self.tracer,
            &view,
            &self.settings,
            self.samples(rate.spp, following),
            only,
            &self.interrupt,
            progress,
        )?;
        let mut image = FloatImage { width: view.width, height: view.height, pixels: traced.image };
        let started = Instant::now();
        if rate.side > 1 {
            image = image.stretched(self.view.width, self.view.height);
        }
        Ok(Traced { ms: traced.time_ms + ms(started), rays: traced.rays.total(), image })
    }
}

/// An image by the tracer.
pub struct Traced {
    /// Its time.
    pub ms: f64,
    /// Rays traced.
    pub rays: u64,
    /// The image, at the size of the view.
    pub image: FloatImage,
}

fn set_up<T>(found: Option<T>) -> Result<T> {
    found.ok_or_else(|| Error::Option("the picture is on no rung of the ladder that was set up".into()))
}

fn shot(frame: Frame) -> Timed<Shot> {
    let Frame { image, stats } = frame;
    (stats.time_ms.frame, Shot { image, rays: stats.rays.total, stats: Some(Box::new(stats)) })
}

/// The same picture on fewer pixels.
fn coarse(view: &View, rate: Rate) -> View {
    View { width: view.width.div_ceil(rate.side), height: view.height.div_ceil(rate.side), ..*view }
}

/// `mask` and, where a pixel has more samples than its centre or is stretched, the pixels next to it.
fn grown(mask: &[bool], view: &View, rate: Rate) -> Vec<bool> {
    if rate == (Rate { spp: 1, side: 1 }) {
        return mask.to_vec();
    }
    any_about(mask, view, (view.width, view.height), 1, 1)
}

/// The pixels of the coarse image that pixels of `mask` are stretched from.
fn shrunk(mask: &[bool], view: &View, rate: Rate) -> Vec<bool> {
    let coarse = coarse(view, rate);
    any_about(mask, view, (coarse.width, coarse.height), rate.side, rate.side)
}

/// For each pixel of an image of `size`, which stands for `side` × `side` pixels of `mask`, whether one of
/// them or of those around them, as far as `reach`, is set.
fn any_about(mask: &[bool], view: &View, size: (u32, u32), side: u32, reach: u32) -> Vec<bool> {
    let about = |at: u32, most: u32| (at * side).saturating_sub(reach)..((at + 1) * side + reach).min(most);
    let set = |x: u32, y: u32| {
        about(y, view.height)
            .any(|row| about(x, view.width).any(|column| mask[(row * view.width + column) as usize]))
    };
    (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y))).map(|(x, y)| set(x, y)).collect()
}

fn ms(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}
