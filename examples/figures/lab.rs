//! Where figures and claims are measured: frames by vertex tracing, and the same by the reference tracer.

use std::sync::{Arc, atomic::AtomicBool};

use vertex_tracing::error::Result;
use vertex_tracing::frame::{Frame, Renderer};
use vertex_tracing::gpu::{self, Gpu};
use vertex_tracing::options::{CameraChoice, Options, Reconstruction, Show, ViewOptions};
use vertex_tracing::report::FloatImage;
use vertex_tracing::report::metrics::{Encoding, compare};
use vertex_tracing::scene::Scene;
use vertex_tracing::trace::{Settings, Tracer, reference};

/// Frames of which the median is taken where time is measured.
const RUNS: usize = 3;

/// Samples of the paper's full-quality picture (§5).
pub const FULL_QUALITY: u64 = 47_000;

/// The device at hand.
pub struct Lab {
    pub gpu: Arc<Gpu>,
}

/// A picture by the reference tracer.
pub struct Conventional {
    pub image: FloatImage,
    pub rays: u64,
    pub ms: f64,
    pub vt_mask: Vec<bool>,
}

/// How much is sampled.
#[derive(Clone, Copy)]
pub enum Effort {
    Preview,
    Samples(u64),
    Error(f32),
}

impl Lab {
    pub fn new() -> Result<Self> {
        Ok(Self { gpu: Gpu::new(&gpu::Options::default())? })
    }

    /// The device and its driver.
    pub fn device(&self) -> String {
        format!("{} ({})", self.gpu.info().name, self.gpu.info().driver)
    }

    /// The frame of median time among a few.
    pub fn measure(&self, scene: &Scene, options: &Options) -> Result<Frame> {
        self.frames(scene, options, RUNS)
    }

    /// One frame, not for its time.
    pub fn frame(&self, scene: &Scene, options: &Options) -> Result<Frame> {
        self.frames(scene, options, 1)
    }

    fn frames(&self, scene: &Scene, options: &Options, runs: usize) -> Result<Frame> {
        let view = options.view.resolve(scene)?;
        let mut renderer = Renderer::new(&self.gpu, scene, options)?;
        renderer.warm_up(&view)?;
        let mut frames = (0..runs).map(|_| renderer.render(&view)).collect::<Result<Vec<_>>>()?;
        frames.sort_by(|a, b| a.stats.time_ms.frame.total_cmp(&b.stats.time_ms.frame));
        Ok(frames.swap_remove(runs / 2))
    }

    /// The same view by the reference tracer, one sample a pixel.
    pub fn conventional(&self, scene: &Scene, options: &Options) -> Result<Conventional> {
        let view = options.view.resolve(scene)?;
        let settings = Settings::new(&options.paths, &options.scene);
        let interrupt = AtomicBool::new(false);
        let traced = reference::render(&Tracer::new(scene), &view, &settings, 1, None, &interrupt, &|_| {})?;
        Ok(Conventional {
            image: FloatImage { width: view.width, height: view.height, pixels: traced.image },
            rays: traced.rays.total(),
            ms: traced.time_ms,
            vt_mask: traced.vt_mask,
        })
    }
}

impl Conventional {
    /// PSNR of `image` over the specular pixels in dB; infinite if it is the same.
    pub fn psnr(&self, image: &FloatImage) -> Result<f64> {
        let comparison = compare(&self.image, image, Some(&self.vt_mask), Encoding::Srgb)?;
        Ok(comparison.psnr.unwrap_or(f64::INFINITY))
    }
}

/// Options of a picture of `width` × `height` pixels.
pub fn options((width, height): (u32, u32), reconstruction: Reconstruction, effort: Effort) -> Options {
    let mut options =
        Options { view: ViewOptions { width, height, ..ViewOptions::default() }, ..Options::default() };
    options.method.reconstruction = reconstruction;
    match effort {
        Effort::Preview => options.effort.preview = true,
        Effort::Samples(samples) => {
            (options.effort.max_samples, options.effort.sparing) = (Some(samples), true);
        }
        Effort::Error(error) => options.effort.error = Some(error),
    }
    options
}

/// The same options for a picture of the method's data.
pub fn showing(options: &Options, show: Show) -> Options {
    Options { show: Some(show), ..options.clone() }
}

/// The same options with another camera.
pub fn seen_from(options: &Options, eye: [f64; 3], target: [f64; 3], fov: f32) -> Options {
    let mut options = options.clone();
    options.view.camera = CameraChoice::Eye { eye: eye.into(), target: Some(target.into()) };
    options.view.fov = Some(fov);
    options
}
