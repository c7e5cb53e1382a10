//! Runs the experiments.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use glam::{DVec2, DVec3, Vec2};
use rayon::ThreadPoolBuilder;

use super::{Case, Experiment, Report, Row, Trial, Truth, Verdict, leak};
use crate::error::{Error, Result};
use crate::frame::Renderer;
use crate::gpu::Gpu;
use crate::report::{Encoding, FloatImage, compare};
use crate::scene::View;
use crate::trace::{Settings, Tracer, reference};

/// How much is measured.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Width and height of the pictures.
    pub size: (u32, u32),
    /// Values of each sweep: the first, the last and some between.
    pub values: usize,
    /// Part of the names of the cases to run; all if empty.
    pub only: String,
}

impl Plan {
    /// Every value of every case.
    pub fn full() -> Self {
        Self { size: (320, 240), values: usize::MAX, only: String::new() }
    }

    /// Three values of each, small.
    pub fn quick() -> Self {
        Self { size: (96, 72), values: 3, only: String::new() }
    }

    /// The values of `case` that are measured.
    fn values<'c>(&self, case: &'c Case) -> impl Iterator<Item = f64> + use<'c> {
        let (all, some) = (case.values.len(), self.values.clamp(2, case.values.len().max(2)));
        (0..some.min(all)).map(move |i| case.values[i * (all - 1) / (some - 1)])
    }
}

/// Runs the cases in `table` as `plan` says; `step` hears how much is done, from 0 to 1.
///
/// # Errors
/// A device that cannot serve; [`Error::Interrupted`] once `interrupt` is set.
pub fn measure(
    gpu: &Arc<Gpu>,
    table: &[Case],
    plan: &Plan,
    interrupt: &Arc<AtomicBool>,
    step: &dyn Fn(f32),
) -> Result<Report> {
    let mut rows = Vec::new();
    for (index, case) in table.iter().enumerate() {
        if !case.name.contains(&plan.only) {
            continue;
        }
        for value in plan.values(case) {
            step(index as f32 / table.len() as f32);
            rows.push(row(&Bench { gpu, plan, interrupt }, case, value)?);
        }
    }
    let info = gpu.info();
    Ok(Report { device: info.name.clone(), driver: info.driver.clone(), rows })
}

/// What a value gave.
struct Outcome {
    error: f64,
    psnr: Option<f64>,
    truth: Option<f64>,
    samples: u64,
    ms: f64,
}

fn row(bench: &Bench, case: &Case, value: f64) -> Result<Row> {
    let outcome = match case.experiment {
        Experiment::Picture(make) => bench.picture(&make(value)?)?,
        Experiment::Threads(make) => bench.threads(&make()?, value as usize)?,
        Experiment::Leak(make) => {
            let started = Instant::now();
            let count = leak::count(&make(value)?);
            let error = count.escaped as f64 / count.rays as f64;
            Outcome { error, psnr: None, truth: None, samples: count.rays, ms: ms(started) }
        }
    };
    let Outcome { error, psnr, truth, samples, ms } = outcome;
    let within = error <= case.bound.reference && truth.is_none_or(|error| error <= case.bound.truth);
    let limit = case.limit.filter(|(from, _)| value >= *from);
    let verdict = match (within, limit) {
        (true, _) => Verdict::Holds,
        (false, Some(_)) => Verdict::KnownLimit,
        (false, None) => Verdict::Fails,
    };
    Ok(Row {
        case: case.name,
        parameter: case.parameter,
        value,
        error,
        psnr,
        truth,
        bound: case.bound,
        samples,
        ms,
        verdict,
        why: limit.filter(|_| verdict == Verdict::KnownLimit).map(|(_, why)| why),
    })
}

/// What every experiment needs.
struct Bench<'a> {
    gpu: &'a Arc<Gpu>,
    plan: &'a Plan,
    interrupt: &'a Arc<AtomicBool>,
}

/// A picture and what it took.
struct Taken {
    image: FloatImage,
    view: View,
    samples: u64,
    ms: f64,
}

impl Bench<'_> {
    fn take(&self, trial: &Trial) -> Result<Taken> {
        if self.interrupt.load(Ordering::Relaxed) {
            return Err(Error::Interrupted);
        }
        let mut options = trial.options.clone();
        (options.view.width, options.view.height) = trial.size.unwrap_or(self.plan.size);
        let view = options.view.resolve(&trial.scene)?;
        let mut renderer = Renderer::new(self.gpu, &trial.scene, &options)?;
        renderer.set_interrupt(self.interrupt.clone());
        let frame = renderer.render(&view)?;
        Ok(Taken { image: frame.image, view, samples: frame.stats.vertices, ms: frame.stats.time_ms.frame })
    }

    fn picture(&self, trial: &Trial) -> Result<Outcome> {
        let taken = self.take(trial)?;
        let tracer = Tracer::new(&trial.scene);
        let settings = Settings::new(&trial.options.paths, &trial.options.scene);
        let traced = reference::render(&tracer, &taken.view, &settings, 1, None, self.interrupt, &|_| ())?;
        let mask = traced.vt_mask.contains(&true).then_some(traced.vt_mask);
        let (width, height) = (taken.view.width, taken.view.height);
        let expected = FloatImage { width, height, pixels: traced.image };
        let found = compare(&expected, &taken.image, mask.as_deref(), Encoding::Srgb)?;
        let truth = match &trial.truth {
            Truth::Unknown => None,
            Truth::Radiance(radiance) => Some(ideal(&taken.view, radiance)),
            Truth::Twin(twin) => Some(self.take(twin)?.image),
        };
        let truth = truth.map(|truth| compare(&truth, &taken.image, None, Encoding::Srgb)).transpose()?;
        Ok(Outcome {
            error: found.rmse,
            psnr: found.psnr,
            truth: truth.map(|truth| truth.rmse),
            samples: taken.samples,
            ms: taken.ms,
        })
    }

    fn threads(&self, trial: &Trial, threads: usize) -> Result<Outcome> {
        let take = |threads| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build();
            let pool = pool.map_err(|error| Error::Option(format!("{threads} threads: {error}")))?;
            pool.install(|| self.take(trial))
        };
        let (one, many) = (take(1)?, take(threads)?);
        let difference = compare(&one.image, &many.image, None, Encoding::Linear)?;
        Ok(Outcome {
            error: difference.max,
            psnr: difference.psnr,
            truth: None,
            samples: many.samples,
            ms: many.ms,
        })
    }
}

/// The picture of `view` that `radiance` gives at pixel centres.
fn ideal(view: &View, radiance: &(dyn Fn(DVec3, DVec3) -> DVec3 + Sync)) -> FloatImage {
    let [right, up, forward] = [view.right, view.up, view.forward].map(|axis| axis.as_dvec3());
    let size = DVec2::new(view.width.into(), view.height.into());
    FloatImage::from_fn(view.width, view.height, |x, y| {
        let at = (Vec2::new(x as f32, y as f32).as_dvec2() + 0.5) / size;
        let ndc = DVec2::new(2.0 * at.x - 1.0, 1.0 - 2.0 * at.y) * view.half.as_dvec2();
        let direction = (forward + right * ndc.x + up * ndc.y).normalize();
        radiance(view.eye.as_dvec3(), direction).as_vec3().to_array()
    })
}

fn ms(started: Instant) -> f64 {
    started.elapsed().as_secs_f64() * 1e3
}
