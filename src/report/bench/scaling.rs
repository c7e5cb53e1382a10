//! How times grow with pixels, triangles, bounces and threads.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use serde::Serialize;

use super::fit::{Fit, power_law};
use super::rounds::{Observer, Timed, rounds};
use crate::error::{Error, Result};
use crate::frame::Renderer;
use crate::gpu::Gpu;
use crate::options::{EffortOptions, Options};
use crate::report::profile::Spread;
use crate::scene::demo::stress;
use crate::scene::{Scene, View};
use crate::trace::reference::{self, Following, Samples};
use crate::trace::{Settings, Tracer};

/// Predicted displacement that refined frames of a series are taken to, in pixels.
pub const REFINED: f32 = 1.0;

/// Which values each axis takes.
#[derive(Debug, Clone, PartialEq)]
pub struct Extent {
    /// Image sizes, of the scene itself.
    pub sizes: Vec<(u32, u32)>,
    /// Triangles of a wavy mirror, at least.
    pub triangles: Vec<u32>,
    /// Bounces, in a room of mirror balls.
    pub depths: Vec<u32>,
    /// Threads that trace, for the scene itself.
    pub threads: Vec<usize>,
    /// Image size of every axis but the first.
    pub size: (u32, u32),
    /// Timed runs of every point.
    pub repeats: usize,
}

impl Extent {
    /// 320×256 to 2560×2048, a thousand triangles to a million, 1 to 8 bounces, and all cores.
    pub fn full(repeats: usize) -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let mut threads: Vec<usize> =
            (0..).map(|power| 1 << power).take_while(|threads| *threads < cores).collect();
        threads.push(cores);
        Self {
            sizes: vec![(320, 256), (640, 512), (1280, 1024), (2560, 2048)],
            triangles: vec![1_000, 10_000, 100_000, 1_000_000],
            depths: vec![1, 2, 4, 8],
            threads,
            size: (640, 512),
            repeats,
        }
    }

    /// A small part of it, in seconds.
    pub fn quick(repeats: usize) -> Self {
        Self {
            sizes: vec![(80, 64), (160, 128)],
            triangles: vec![500, 2_000],
            depths: vec![1, 2],
            threads: vec![1, 2],
            size: (80, 64),
            repeats,
        }
    }
}

/// Times along one axis.
#[derive(Debug, Clone, Serialize)]
pub struct Series {
    /// `pixels`, `triangles`, `bounces` or `threads`.
    pub axis: &'static str,
    /// The scene that it was measured on.
    pub scene: String,
    /// One line for each way.
    pub ways: Vec<Way>,
}

/// One way along an axis.
#[derive(Debug, Clone, Serialize)]
pub struct Way {
    /// Its name.
    pub name: &'static str,
    /// Times, by rising value.
    pub points: Vec<Sample>,
    /// The power law through the medians; `None` for fewer than two values.
    pub fit: Option<Fit>,
}

/// One time along an axis.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Sample {
    /// Pixels, triangles, bounces or threads.
    pub value: f64,
    /// Its time.
    #[serde(flatten)]
    pub time: Spread,
}

/// The ways that every case is measured in.
const WAYS: [&str; 3] =
    ["vertex tracing, preview", "vertex tracing, to 1 pixel predicted", "ray tracer, 1 spp"];

/// One value of an axis, set up.
struct Case<'s> {
    value: f64,
    view: View,
    renderer: Renderer<'s>,
    tracer: Tracer<'s>,
    settings: Settings,
    /// Threads that trace, if not those of the process.
    pool: Option<rayon::ThreadPool>,
    interrupt: Arc<AtomicBool>,
}

/// Where series are measured.
struct Site<'a> {
    gpu: &'a Arc<Gpu>,
    repeats: usize,
    interrupt: &'a Arc<AtomicBool>,
    observer: &'a dyn Observer,
}

/// Measures every axis: pixels and threads on `scene`, classified and lit, the others on scenes of their own.
///
/// Devices draw with threads of their own, whatever number of threads traces.
///
/// # Errors
/// As for [`Renderer::render`]; [`Error::Interrupted`]; [`Error::Option`] if there are no threads to be had.
pub fn measure(
    gpu: &Arc<Gpu>,
    scene: &Scene,
    options: &Options,
    extent: &Extent,
    interrupt: &Arc<AtomicBool>,
    observer: &dyn Observer,
) -> Result<Vec<Series>> {
    let site = Site { gpu, repeats: extent.repeats, interrupt, observer };
    let at = |size: (u32, u32)| {
        let mut options = options.clone();
        (options.view.width, options.view.height) = size;
        options
    };
    // Scenes of their own have cameras of their own.
    let elsewhere = |depth: Option<u32>| {
        let mut options = at(extent.size);
        options.view =
            crate::options::ViewOptions { width: extent.size.0, height: extent.size.1, ..Default::default() };
        options.paths.depth = depth.unwrap_or(options.paths.depth);
        options
    };

    observer.stage("scaling: pixels");
    let cases = extent.sizes.iter().map(|&size| {
        let pixels = f64::from(size.0) * f64::from(size.1);
        site.case(pixels, scene, &at(size), None)
    });
    let pixels = site.series("pixels", &scene.name, cases.collect::<Result<_>>()?)?;

    observer.stage("scaling: triangles");
    let mirrors = extent.triangles.iter().map(|&triangles| stress::wavy_mirror(triangles));
    let mirrors = mirrors.collect::<Result<Vec<Scene>>>()?;
    let cases = mirrors
        .iter()
        .map(|mirror| site.case(mirror.geometry.faces.len() as f64, mirror, &elsewhere(None), None));
    let triangles = site.series("triangles", "wavy mirror", cases.collect::<Result<_>>()?)?;
    drop(mirrors);

    observer.stage("scaling: bounces");
    let balls = stress::mirror_ball_room(16)?;
    let cases =
        extent.depths.iter().map(|&depth| site.case(f64::from(depth), &balls, &elsewhere(Some(depth)), None));
    let bounces = site.series("bounces", "mirror ball room", cases.collect::<Result<_>>()?)?;

    observer.stage("scaling: threads");
    let cases = extent
        .threads
        .iter()
        .map(|&threads| site.case(threads as f64, scene, &at(extent.size), Some(threads)));
    let threads = site.series("threads", &scene.name, cases.collect::<Result<_>>()?)?;
    Ok(vec![pixels, triangles, bounces, threads])
}

impl Site<'_> {
    fn case<'s>(
        &self,
        value: f64,
        scene: &'s Scene,
        options: &Options,
        threads: Option<usize>,
    ) -> Result<Case<'s>> {
        let view = options.view.resolve(scene)?;
        let mut renderer = Renderer::new(self.gpu, scene, options)?;
        renderer.set_interrupt(self.interrupt.clone());
        let pool = threads.map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build());
        let mut case = Case {
            value,
            view,
            renderer,
            tracer: Tracer::new(scene),
            settings: Settings::new(&options.paths, &options.scene),
            pool: pool
                .transpose()
                .map_err(|error| Error::Option(format!("no threads to be had: {error}")))?,
            interrupt: self.interrupt.clone(),
        };
        case.renderer.warm_up(&case.view)?;
        Ok(case)
    }

    fn series(&self, axis: &'static str, scene: &str, mut cases: Vec<Case>) -> Result<Series> {
        let mut costs = Vec::new();
        for case in &mut cases {
            for way in 0..WAYS.len() {
                costs.push(case.run(way)?.0);
            }
        }
        let mut runs = rounds(&costs, self.repeats, self.observer, |index| {
            cases[index / WAYS.len()].run(index % WAYS.len())
        })?
        .into_iter();
        let mut ways = WAYS.map(|name| Way { name, points: Vec::new(), fit: None });
        for case in &cases {
            for way in &mut ways {
                let runs = runs.next().unwrap_or_default();
                let time = Spread::of(runs.into_iter().map(|(ms, ())| ms).collect());
                way.points.push(Sample { value: case.value, time });
            }
        }
        for way in &mut ways {
            let points: Vec<(f64, f64)> = way.points.iter().map(|p| (p.value, p.time.median_ms)).collect();
            way.fit = power_law(&points);
        }
        Ok(Series { axis, scene: scene.into(), ways: ways.into() })
    }
}

impl Case<'_> {
    /// One picture by the way of this index in [`WAYS`].
    fn run(&mut self, way: usize) -> Result<Timed<()>> {
        let Self { view, renderer, tracer, settings, interrupt, .. } = self;
        let effort = match way {
            0 => Some(EffortOptions { preview: true, ..EffortOptions::default() }),
            1 => Some(EffortOptions { error: Some(REFINED), ..EffortOptions::default() }),
            _ => None,
        };
        let work = || -> Result<Timed<()>> {
            let Some(effort) = effort else {
                let samples = Samples { following: Following::Together, ..Samples::from(1) };
                let traced = reference::render(tracer, view, settings, samples, None, interrupt, &|_| {})?;
                return Ok((traced.time_ms, ()));
            };
            renderer.set_effort(effort);
            Ok((renderer.render(view)?.stats.time_ms.frame, ()))
        };
        match &self.pool {
            Some(pool) => pool.install(work),
            None => work(),
        }
    }
}
