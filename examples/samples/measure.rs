//! One scene's curve of error against samples, by each reconstruction, and its anti-aliasing.

use std::sync::{Arc, atomic::AtomicBool};

use vertex_tracing::{
    error::{Error, Result},
    frame::Renderer,
    gpu::{self, Gpu},
    options::{Options, Reconstruction, Shadows, Ss},
    report::{
        FloatImage,
        image::srgb_encode,
        metrics::{Comparison, Encoding, compare},
    },
    scene::{Scene, View, classify},
    trace::{Settings, Tracer, reference},
};

/// Sample budgets of the table: §5's preview is about 4k samples, its full quality 47k.
pub const BUDGETS: [u64; 4] = [4_000, 12_000, 16_000, 47_000];
/// PSNR, in dB, for which samples are sought.
pub const TARGETS: [f64; 3] = [30.0, 35.0, 40.0];
/// Most samples that a target is sought with.
const MOST: u64 = 300_000;
/// Vertices at which the gain is told.
pub const VERTICES: u64 = 12_000;
/// Samples a pixel of the tracer that anti-aliasing is held against; the last is the truth.
pub const SPP: [u32; 5] = [1, 2, 3, 4, 64];
/// Samples of the anti-aliased picture.
pub const AA_SAMPLES: u64 = 16_000;

/// What one budget gave.
pub struct Row {
    pub samples: u64,
    pub rays: u64,
    pub error: Comparison,
}

/// Samples and secondary rays with which a PSNR was first reached.
pub type Reached = Option<(f64, f64)>;

/// One reconstruction of one scene.
pub struct Curve {
    pub rows: Vec<Row>,
    pub targets: [Reached; TARGETS.len()],
    /// PSNR with [`VERTICES`] vertices, whatever pixels are traced besides, and the secondary rays of both; of the last
    /// step if refinement ends before.
    pub at_vertices: (f64, f64),
}

/// Everything that was measured of one scene.
pub struct Measured {
    pub name: String,
    pub shadows: Shadows,
    /// Secondary rays of conventional tracing, one sample a specular pixel.
    pub conventional: u64,
    pub paper: Curve,
    pub exact: Curve,
    /// RMSE against the last of [`SPP`]: of four shaded samples a pixel, then of the tracer with the others.
    /// Empty where it was not asked for.
    pub aliasing: Vec<f64>,
}

/// The device at hand.
pub struct Lab {
    gpu: Arc<Gpu>,
}

struct Truth {
    image: FloatImage,
    mask: Vec<bool>,
}

impl Lab {
    pub fn new() -> Result<Self> {
        Ok(Self { gpu: Gpu::new(&gpu::Options::default())? })
    }

    /// The device and its driver.
    pub fn device(&self) -> String {
        format!("{} ({})", self.gpu.info().name, self.gpu.info().driver)
    }

    /// Measures `scene` at the default size, its anti-aliasing only if `anti_aliased`: the truth is dear.
    pub fn measure(
        &self,
        name: &str,
        mut scene: Scene,
        shadows: Shadows,
        anti_aliased: bool,
    ) -> Result<Measured> {
        let mut options = Options::default();
        options.scene.shadows = shadows;
        classify::classify(&mut scene, &options.scene.vt)?;
        let view = options.view.resolve(&scene)?;
        let tracer = Tracer::new(&scene);
        let trace = |spp, only: Option<&[bool]>| {
            let settings = Settings::new(&options.paths, &options.scene);
            reference::render(&tracer, &view, &settings, spp, only, &AtomicBool::new(false), &|_| {})
        };
        let image = |pixels| FloatImage { width: view.width, height: view.height, pixels };
        let traced = trace(1, None)?;
        let truth = Truth { image: image(traced.image), mask: traced.vt_mask };
        let conventional = trace(1, Some(&truth.mask))?.rays.secondary();
        let paper = self.curve(&scene, &options, &view, Reconstruction::Paper, &truth)?;
        let exact = self.curve(&scene, &options, &view, Reconstruction::Exact, &truth)?;

        let aliasing =
            if anti_aliased { self.aliasing(&scene, &options, &view, &truth)? } else { Vec::new() };
        println!("{name}, shadows {shadows}: measured");
        Ok(Measured { name: name.into(), shadows, conventional, paper, exact, aliasing })
    }

    fn aliasing(&self, scene: &Scene, options: &Options, view: &View, truth: &Truth) -> Result<Vec<f64>> {
        let tracer = Tracer::new(scene);
        let trace = |spp| {
            let settings = Settings::new(&options.paths, &options.scene);
            let only = Some(truth.mask.as_slice());
            let traced =
                reference::render(&tracer, view, &settings, spp, only, &AtomicBool::new(false), &|_| {});
            Ok(FloatImage { width: view.width, height: view.height, pixels: traced?.image })
        };
        let mut smooth = options.clone();
        smooth.method.ss = Ss::Four;
        (smooth.effort.max_samples, smooth.effort.sparing) = (Some(AA_SAMPLES), true);
        let smooth = Renderer::new(&self.gpu, scene, &smooth)?.render(view)?.image;
        let by_spp = SPP.into_iter().map(trace).collect::<Result<Vec<_>>>()?;
        let (last, others) = by_spp.split_last().expect("there is a truth");
        std::iter::once(&smooth)
            .chain(others)
            .map(|image| Ok(compare(last, image, Some(&truth.mask), Encoding::Srgb)?.rmse))
            .collect()
    }

    fn curve(
        &self,
        scene: &Scene,
        options: &Options,
        view: &View,
        reconstruction: Reconstruction,
        truth: &Truth,
    ) -> Result<Curve> {
        let mut options = options.clone();
        options.method.reconstruction = reconstruction;
        options.effort.sparing = true;
        let rows = BUDGETS
            .into_iter()
            .map(|budget| {
                options.effort.max_samples = Some(budget);
                let frame = Renderer::new(&self.gpu, scene, &options)?.render(view)?;
                let rays = &frame.stats.rays;
                let rays = rays.reflected + rays.transmitted + rays.pixel;
                let error = compare(&truth.image, &frame.image, Some(&truth.mask), Encoding::Srgb)?;
                Ok(Row { samples: frame.stats.vertices, rays, error })
            })
            .collect::<Result<_>>()?;

        // Few samples are spent otherwise than many: the least rays that either way takes.
        let few = truth.mask.iter().filter(|&&vt| vt).count() as u64 * 2 / 5;
        let (mut targets, at_vertices) = self.climb(scene, &options, view, truth, MOST)?;
        if reconstruction == Reconstruction::Exact && few < MOST {
            let (sparing, _) = self.climb(scene, &options, view, truth, few)?;
            for (least, sparing) in targets.iter_mut().zip(sparing) {
                let rays = |reached: Option<(f64, f64)>| reached.map_or(f64::INFINITY, |(_, rays)| rays);
                if rays(sparing) < rays(*least) {
                    *least = sparing;
                }
            }
        }
        Ok(Curve { rows, targets, at_vertices })
    }

    /// Samples and rays for each target, and PSNR and rays at [`VERTICES`], on the way to `most` samples.
    fn climb(
        &self,
        scene: &Scene,
        options: &Options,
        view: &View,
        truth: &Truth,
        most: u64,
    ) -> Result<([Reached; TARGETS.len()], (f64, f64))> {
        let mut options = options.clone();
        options.effort.max_samples = Some(most);
        let mut targets = [None; TARGETS.len()];
        let mut at_vertices = (f64::NAN, f64::NAN);
        let mut last: Option<(f64, f64, f64)> = None;
        let ended = Renderer::new(&self.gpu, scene, &options)?.render_steps(
            view,
            Some(&mut |step| {
                let (samples, rays) = (step.vertices as f64, step.secondary_rays as f64);
                let psnr = truth.psnr(&step.image);
                for (target, reached) in TARGETS.into_iter().zip(&mut targets) {
                    if reached.is_none() && psnr >= target {
                        // Between two steps, straight in dB against the logarithm of the samples.
                        let (s, r, p) = last.unwrap_or((samples, rays, psnr));
                        let t = if psnr > p { ((target - p) / (psnr - p)).clamp(0.0, 1.0) } else { 1.0 };
                        let between = |a: f64, b: f64| a * (b / a.max(1.0)).powf(t);
                        *reached = Some((between(s, samples), between(r, rays)));
                    }
                }
                let (s, r, p) = last.unwrap_or((samples, rays, psnr));
                if s < VERTICES as f64 {
                    let t =
                        ((VERTICES as f64).min(samples) / s).ln() / (samples / s).ln().max(f64::MIN_POSITIVE);
                    at_vertices = (p + (psnr - p) * t, r * (rays / r.max(1.0)).powf(t));
                }
                last = Some((samples, rays, psnr));
                if targets.iter().all(Option::is_some) && step.vertices >= VERTICES {
                    return Err(Error::Interrupted);
                }
                Ok(())
            }),
        );
        match ended {
            Err(Error::Interrupted) => {} // all targets are met
            ended => drop(ended?),
        }
        Ok((targets, at_vertices))
    }
}

impl Truth {
    /// As the PSNR of [`compare`], without its other figures.
    fn psnr(&self, image: &FloatImage) -> f64 {
        let encode = |v: f32| f64::from(srgb_encode(v.clamp(0.0, 1.0)));
        let (mut sum, mut count) = (0.0, 0.0);
        for ((a, b), _) in self.image.pixels.iter().zip(&image.pixels).zip(&self.mask).filter(|(_, vt)| **vt)
        {
            sum += a.iter().zip(b).map(|(a, b)| (encode(*a) - encode(*b)).powi(2)).sum::<f64>();
            count += 3.0;
        }
        -10.0 * (sum / f64::max(count, 1.0)).log10()
    }
}
