//! Runs a ladder on a scene: warms up, times in turn, and holds every image against the reference.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::ladder::{Family, Job, Ladder, Outside};
use super::rounds::{Observer, Timed, median, rounds};
use super::studio::{Shot, Studio, without_vt};
use super::{Bench, Floor, Picture, Point, crossover, truth, words};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::report::metrics::{Comparison, Differences, Encoding, first_nan};
use crate::report::profile::Spread;
use crate::report::stats::{StoppedBy, Times};
use crate::report::{FloatImage, image};
use crate::scene::Scene;

/// How much brighter differences are shown than they are.
const DIFFERENCE_GAIN: f32 = 4.0;

/// A bench and its pictures.
pub struct Measured {
    /// The numbers.
    pub bench: Bench,
    /// The reference, and a few of the points with their differences from it.
    pub pictures: Vec<Picture>,
}

/// Measures `ladder` on `scene`, classified and lit. The reference is kept in the folder `cache`.
///
/// # Errors
/// No device memory left; no such camera; an outside image that cannot be read or is of another size;
/// [`Error::Interrupted`] once `interrupt` is set.
pub fn measure(
    gpu: &Arc<Gpu>,
    scene: &Scene,
    ladder: &Ladder,
    cache: Option<&Path>,
    interrupt: &Arc<AtomicBool>,
    observer: &dyn Observer,
) -> Result<Measured> {
    let view = ladder.options.view.resolve(scene)?;
    let outside = outside_images(&ladder.outside, (view.width, view.height))?;
    observer.stage("preparing");
    let plain = without_vt(scene);
    let mut studio = Studio::new(gpu, scene, &plain, ladder, interrupt)?;
    observer.stage("reference");
    let truth = truth::image(&studio, ladder.reference_spp, cache, observer)?;
    let judge = Judge { truth: &truth, vt_mask: &studio.vt_mask.clone() };

    observer.stage("warming up");
    let jobs = ladder.jobs();
    let mut entries: Vec<Entry> = Vec::new();
    for (index, job) in jobs.iter().enumerate() {
        observer.share(index as f32 / jobs.len() as f32);
        let ended = entries.iter().any(|entry| entry.ends_ladder && entry.job.family() == job.family());
        if ended && job.family().is_some() {
            continue;
        }
        entries.push(Entry::new(job, studio.run(job)?, &judge)?);
    }

    observer.stage("measuring");
    let costs: Vec<f64> = entries.iter().map(|entry| entry.warm_up_ms).collect();
    let runs = rounds(&costs, ladder.repeats.max(1), observer, |index| {
        let (ms, shot) = studio.run(&entries[index].job)?;
        Ok((ms, shot.stages()))
    })?;

    let mut points = Vec::new();
    let mut floors = Vec::new();
    for (entry, runs) in entries.iter().zip(&runs) {
        match entry.job {
            Job::Floor(antialiasing) => floors.push(Floor { antialiasing, time: spread(runs) }),
            _ => points.extend(entry.point(runs)),
        }
    }
    for (from, image) in &outside {
        points.push(judge.outside(from, image)?);
    }
    for index in 0..points.len() {
        if points[index].family.is_ours() {
            points[index].paces = crossover::paces(&points[index], &points);
        }
    }
    let pictures = pictures(&mut studio, &entries, &points, &outside, &truth)?;
    let info = gpu.info();
    let mut bench = Bench {
        scene: scene.name.clone(),
        triangles: scene.geometry.faces.len() as u64,
        vt_faces: scene.vt_faces() as u64,
        width: view.width,
        height: view.height,
        vt_pixels: studio.vt_mask.iter().filter(|vt| **vt).count() as u64,
        device: info.name.clone(),
        driver: info.driver.clone(),
        threads: rayon::current_num_threads(),
        repeats: ladder.repeats.max(1),
        reference_spp: ladder.reference_spp,
        points,
        floors,
        findings: Vec::new(),
        scaling: Vec::new(),
    };
    bench.findings = words::findings(&bench);
    Ok(Measured { bench, pictures })
}

/// Reads the images that other renderers made.
fn outside_images(outside: &[Outside], size: (u32, u32)) -> Result<Vec<(&Outside, FloatImage)>> {
    outside.iter().map(|from| Ok((from, outside_image(from, size)?))).collect()
}

fn outside_image(Outside { name, image: path, .. }: &Outside, size: (u32, u32)) -> Result<FloatImage> {
    let image = FloatImage::read(path)?;
    let (own, path) = ((image.width, image.height), path.display());
    if own == size {
        return match first_nan(&image, None) {
            Some((x, y)) => Err(Error::Compare(format!("--compare {name}: {path}: pixel ({x}, {y}) is NaN"))),
            None => Ok(image),
        };
    }
    Err(Error::Compare(format!(
        "--compare {name}: {path} has {}x{} pixels, the bench {}x{}; take --size {}x{}",
        own.0, own.1, size.0, size.1, own.0, own.1
    )))
}

/// Holds images against the reference.
struct Judge<'t> {
    truth: &'t FloatImage,
    vt_mask: &'t [bool],
}

impl Judge<'_> {
    /// Error over the whole image, and over VT pixels if there are any.
    fn errors(&self, image: &FloatImage) -> Result<(Comparison, Option<Comparison>)> {
        let differences = Differences::new(self.truth, image)?;
        let over = |mask| differences.over(mask, Encoding::Srgb);
        let any = self.vt_mask.iter().any(|vt| *vt);
        Ok((over(None)?, any.then(|| over(Some(self.vt_mask))).transpose()?))
    }

    fn outside(&self, from: &Outside, image: &FloatImage) -> Result<Point> {
        let (whole, vt) = self.errors(image)?;
        Ok(Point {
            family: Family::Outside(from.name.clone()),
            effort: String::new(),
            time: Spread::of(vec![from.seconds * 1e3]),
            runs: 1,
            samples: None,
            rays: None,
            predicted_error: None,
            stages: None,
            whole,
            vt,
            paces: Vec::new(),
        })
    }
}

/// A job after its first run.
struct Entry {
    job: Job,
    warm_up_ms: f64,
    /// Whether more budget would change nothing.
    ends_ladder: bool,
    samples: Option<u64>,
    rays: u64,
    predicted_error: Option<f64>,
    errors: (Comparison, Option<Comparison>),
}

impl Entry {
    fn new(job: &Job, (warm_up_ms, shot): Timed<Shot>, judge: &Judge) -> Result<Self> {
        let stats = shot.stats.as_deref();
        Ok(Self {
            job: job.clone(),
            warm_up_ms,
            ends_ladder: stats.is_some_and(|stats| {
                matches!(stats.stopped_by, Some(StoppedBy::NothingLeft | StoppedBy::Error) | None)
            }),
            samples: stats.map(|stats| stats.vertices),
            rays: shot.rays,
            predicted_error: stats.and_then(|stats| stats.predicted_error),
            errors: judge.errors(&shot.image)?,
        })
    }

    fn point(&self, runs: &[Timed<Option<Times>>]) -> Option<Point> {
        Some(Point {
            family: self.job.family()?,
            effort: self.job.effort(),
            time: spread(runs),
            runs: runs.len(),
            samples: self.samples,
            rays: Some(self.rays),
            predicted_error: self.predicted_error,
            stages: median(runs).and_then(|(_, stages)| *stages),
            whole: self.errors.0,
            vt: self.errors.1,
            paces: Vec::new(),
        })
    }
}

fn spread<T>(runs: &[Timed<T>]) -> Spread {
    Spread::of(runs.iter().map(|run| run.0).collect())
}

/// The reference; then the preview and the best of ours, the tracer at its coarsest and at one sample a pixel,
/// and every outside image, each with its difference.
fn pictures(
    studio: &mut Studio,
    entries: &[Entry],
    points: &[Point],
    outside: &[(&Outside, FloatImage)],
    truth: &FloatImage,
) -> Result<Vec<Picture>> {
    let ours = |entry: &&Entry| matches!(entry.job, Job::Frame { .. });
    let traced = |entry: &&Entry| matches!(entry.job, Job::Traced(_));
    let error = |entry: &Entry| entry.errors.1.unwrap_or(entry.errors.0).rmse;
    let best = entries.iter().filter(ours).min_by(|a, b| error(a).total_cmp(&error(b)));
    let one = |entry: &&Entry| matches!(entry.job, Job::Traced(rate) if (rate.spp, rate.side) == (1, 1));
    let mut chosen: Vec<&Job> =
        [entries.iter().find(ours), best, entries.iter().find(traced), entries.iter().find(one)]
            .into_iter()
            .flatten()
            .map(|entry| &entry.job)
            .collect();
    chosen.dedup();

    let mut pictures = vec![Picture { caption: "the reference".into(), image: truth.clone() }];
    let mut show = |name: String, image: FloatImage| {
        let difference = difference(truth, &image);
        pictures.push(Picture { caption: name.clone(), image });
        let caption = format!("{name}: difference from the reference, {DIFFERENCE_GAIN} times as bright");
        pictures.push(Picture { caption, image: difference });
    };
    for job in chosen {
        let family = job.family().map_or(String::new(), |family| family.to_string());
        let point = points
            .iter()
            .find(|point| job.family().as_ref() == Some(&point.family) && point.effort == job.effort());
        let time = point.map_or(String::new(), |point| format!(", {:.0} ms", point.time.median_ms));
        show(format!("{family}, {}{time}", job.effort()), studio.run(job)?.1.image);
    }
    for (from, image) in outside {
        show(format!("{}, {:.0} ms", from.name, from.seconds * 1e3), image.clone());
    }
    Ok(pictures)
}

/// What differs as a display shows it, brighter.
fn difference(truth: &FloatImage, image: &FloatImage) -> FloatImage {
    let shown = |value: f32| image::srgb_encode(value.clamp(0.0, 1.0));
    let pixel = |(a, b): (&[f32; 3], &[f32; 3])| {
        std::array::from_fn(|c| {
            let difference = (shown(a[c]) - shown(b[c])).abs() * DIFFERENCE_GAIN;
            image::srgb_decode(difference.min(1.0))
        })
    };
    let pixels = truth.pixels.iter().zip(&image.pixels).map(pixel).collect();
    FloatImage { width: truth.width, height: truth.height, pixels }
}
