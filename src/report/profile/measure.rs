//! Measures every way to find the visible faces, stage by stage.

use std::{
    collections::BTreeSet,
    sync::Arc,
    time::{Duration, Instant},
};

use super::{
    Bound, Copy, PAPER, Profile, Ring, Row, STAGES, Spread,
    bounds::{self, MANY_TRIANGLES, PlainCopy},
};
use crate::{
    error::{Error, Result},
    frame::Renderer,
    gpu::{Commands, Gpu, ReadbackChoice, ReadbackMemory, ReadbackRing},
    options::{Options, ViewOptions, VisibilityWay},
    report::stats::LeftOut,
    scene::{Scene, View, demo::stress},
    visibility::{
        self, Class, Found, Pass, Times, VisibleFaces, device,
        face_draw::{FaceDraw, IdImages},
        scan::Scanner,
    },
};

/// How much is measured.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Image sizes that the scene is measured at.
    pub sizes: Vec<(u32, u32)>,
    /// Triangles of the wavy mirrors that are measured besides, at least.
    pub triangles: Vec<u32>,
    /// Size that mirrors and rings are measured at.
    pub size: (u32, u32),
    /// Most runs of each measurement.
    pub runs: usize,
    /// Time after which there are no more runs, but three.
    pub time: Duration,
    /// Turns in which what is promised is measured, whatever [`size`](Self::size) is; a tenth of them with many
    /// triangles.
    pub turns: usize,
}

impl Plan {
    /// Everything: minutes on a software device.
    pub fn full() -> Self {
        Self {
            sizes: vec![(640, 480), (1024, 768), (1280, 1024), (1920, 1080), (3840, 2160)],
            triangles: vec![10_000, 100_000, MANY_TRIANGLES],
            size: (1280, 1024),
            runs: 40,
            time: Duration::from_millis(1500),
            turns: 100,
        }
    }

    /// A small part of it, in seconds.
    pub fn quick() -> Self {
        Self {
            sizes: vec![(320, 256)],
            triangles: vec![2_000],
            size: (320, 256),
            runs: 3,
            time: Duration::ZERO,
            turns: 40,
        }
    }
}

/// Measures `scene` on `gpu` as `plan` says; `step` hears how much is done, from 0 to 1.
///
/// # Errors
/// More faces than IDs; an image size that the device does not support; no memory left; a lost device.
pub fn measure(gpu: &Arc<Gpu>, scene: &Scene, plan: &Plan, step: &dyn Fn(f32)) -> Result<Profile> {
    let mut found = Measured::default();
    let mirrors = plan.triangles.iter().map(|&triangles| stress::wavy_mirror(triangles));
    let mirrors = mirrors.collect::<Result<Vec<_>>>()?;
    let mut jobs: Vec<(&Scene, (u32, u32))> = plan.sizes.iter().map(|&size| (scene, size)).collect();
    jobs.extend(mirrors.iter().map(|mirror| (mirror, plan.size)));
    for (index, (scene, size)) in jobs.iter().enumerate() {
        step(index as f32 / (jobs.len() + 1) as f32);
        let view = view(scene, *size)?;
        measure_ways(gpu, scene, &view, plan, &mut found)?;
    }
    step(jobs.len() as f32 / (jobs.len() + 1) as f32);
    let bytes: BTreeSet<u64> = found.rows.iter().map(|row| row.bytes).filter(|&bytes| bytes > 0).collect();
    let memcpy = bytes.into_iter().map(|bytes| measure_copy(bytes, plan)).collect();
    let bounds = measure_bounds(gpu, scene, &mirrors, plan)?;
    let view = view(scene, plan.size)?;
    let rings = (1..=3).map(|buffers| measure_ring(gpu, scene, &view, plan, buffers));
    Ok(Profile {
        scene: scene.name.clone(),
        device: gpu.info().name.clone(),
        driver: gpu.info().driver.clone(),
        rows: found.rows,
        memcpy,
        bounds,
        rings: rings.collect::<Result<_>>()?,
        unavailable: found.unavailable.into_iter().collect(),
        left_out: found.left_out,
        paper: PAPER,
    })
}

fn view(scene: &Scene, (width, height): (u32, u32)) -> Result<View> {
    ViewOptions { width, height, ..ViewOptions::default() }.resolve(scene)
}

fn classes(scene: &Scene) -> Vec<Class> {
    visibility::classes(scene, !scene.lights.is_empty())
}

/// What was measured so far.
#[derive(Default)]
struct Measured {
    rows: Vec<Row>,
    unavailable: BTreeSet<&'static str>,
    left_out: Vec<LeftOut>,
}

/// Every way and every kind of memory for one view.
fn measure_ways(gpu: &Arc<Gpu>, scene: &Scene, view: &View, plan: &Plan, found: &mut Measured) -> Result<()> {
    let classes = classes(scene);
    let mut id_buffer = Pass::new(gpu, scene, &classes)?;
    id_buffer.run(view)?;
    if id_buffer.reads_in_place() {
        let runs = repeat(plan, || {
            let run = Run::from(id_buffer.run(view)?);
            Ok(Run { in_place: true, ..run })
        })?;
        push_rows(&mut found.rows, VisibilityWay::IdBuffer, scene, view, &runs);
    }
    for memory in ReadbackMemory::ALL {
        let choice = ReadbackChoice::Only(memory);
        if !choice.available(gpu) {
            found.unavailable.insert(memory.name());
            continue;
        }
        id_buffer.set_readback(choice);
        id_buffer.warm_up(view)?;
        let runs = repeat(plan, || Ok(Run::from(id_buffer.run(view)?)))?;
        push_rows(&mut found.rows, VisibilityWay::IdBuffer, scene, view, &runs);

        let mut counting = device::Pass::new(gpu, scene, &classes, choice)?;
        counting.warm_up(view)?;
        let runs = repeat(plan, || Ok(Run::from(counting.run(view)?)))?;
        push_rows(&mut found.rows, VisibilityWay::Device, scene, view, &runs);
    }
    drop(id_buffer);
    match measure_single_pass(gpu, scene, view, plan) {
        Ok(runs) => push_rows(&mut found.rows, VisibilityWay::SinglePass, scene, view, &runs),
        // Its base image needs a record for each face: more than some devices bind at once.
        Err(error @ Error::DeviceMemory { .. }) => found.left_out.push(LeftOut {
            what: format!("single-pass with {} triangles", scene.geometry.faces.len()),
            why: error.to_string(),
        }),
        Err(error) => return Err(error),
    }
    Ok(())
}

fn measure_single_pass(gpu: &Arc<Gpu>, scene: &Scene, view: &View, plan: &Plan) -> Result<Vec<Run>> {
    let mut options = Options::default();
    options.method.visibility = VisibilityWay::SinglePass;
    let mut renderer = Renderer::new(gpu, scene, &options)?;
    renderer.warm_up(view)?;
    let runs = repeat(plan, || Ok(renderer.find_visible(view)?.map(Run::from)))?;
    Ok(runs.into_iter().flatten().collect())
}

/// What one run says of its time.
struct Run {
    in_place: bool,
    times: Times,
    bytes: u64,
    memory: ReadbackMemory,
}

impl From<Found<'_>> for Run {
    fn from(found: Found<'_>) -> Self {
        Self {
            in_place: false,
            times: found.times,
            bytes: found.readback_bytes,
            memory: found.readback_memory,
        }
    }
}

impl Run {
    /// Milliseconds of each of [`STAGES`].
    fn stages(&self) -> [f64; STAGES.len()] {
        let Times { visibility, readback, scan, copy, map } = self.times;
        let in_bulk = self.memory == ReadbackMemory::Uncached;
        let (map, read) = if in_bulk { (0.0, map) } else { (map, 0.0) };
        [visibility, copy, readback - copy - map - read, map, read, scan, self.times.total()]
    }
}

fn push_rows(rows: &mut Vec<Row>, way: VisibilityWay, scene: &Scene, view: &View, runs: &[Run]) {
    let Some(first) = runs.first() else { return };
    rows.extend(STAGES.into_iter().enumerate().map(|(index, stage)| Row {
        way: way.to_string(),
        memory: first.memory.name(),
        in_place: first.in_place,
        width: view.width,
        height: view.height,
        triangles: scene.geometry.faces.len() as u64,
        stage,
        spread: Spread::of(runs.iter().map(|run| run.stages()[index]).collect()),
        bytes: if matches!(stage, "draw" | "wait") { 0 } else { first.bytes },
    }));
}

/// Runs `work` once to warm up, then as often as `plan` says.
fn repeat<T>(plan: &Plan, mut work: impl FnMut() -> Result<T>) -> Result<Vec<T>> {
    work()?;
    let started = Instant::now();
    let mut results = Vec::new();
    while results.len() < plan.runs && (results.len() < 3 || started.elapsed() < plan.time) {
        results.push(work()?);
    }
    Ok(results)
}

fn measure_copy(bytes: u64, plan: &Plan) -> Copy {
    let mut copy = PlainCopy::new(bytes as usize);
    copy.run();
    Copy { bytes, spread: Spread::of((0..plan.runs.max(3)).map(|_| copy.run()).collect()) }
}

/// What is promised of the scene, and of the first mirror with as many triangles as a promise is about.
fn measure_bounds(gpu: &Arc<Gpu>, scene: &Scene, mirrors: &[Scene], plan: &Plan) -> Result<Vec<Bound>> {
    let reading = Bound::of_reading(gpu, (scene, &classes(scene)), &view(scene, bounds::SIZE)?, plan.turns)?;
    let many = mirrors.iter().find(|mirror| mirror.geometry.faces.len() >= MANY_TRIANGLES as usize);
    let counting = many.map(|mirror| {
        let turns = plan.turns.div_ceil(10);
        Bound::of_counting(gpu, (mirror, &classes(mirror)), &view(mirror, bounds::SIZE)?, turns)
    });
    Ok([reading].into_iter().chain(counting.transpose()?).collect())
}

/// Draws frame after frame and reads each when `buffers` are in flight.
fn measure_ring(gpu: &Arc<Gpu>, scene: &Scene, view: &View, plan: &Plan, buffers: usize) -> Result<Ring> {
    let draw = FaceDraw::new(gpu, scene, &classes(scene))?;
    let mut slots = (0..buffers)
        .map(|_| Ok((Commands::new(gpu, "ID buffer in flight", 0)?, IdImages::new(gpu, view)?)))
        .collect::<Result<Vec<_>>>()?;
    let bytes = slots[0].1.ids.bytes();
    let mut staging = ReadbackRing::new(gpu, "ID buffer staging", buffers, bytes, ReadbackChoice::Best)?;
    let (mut scanner, mut faces) = (Scanner::default(), VisibleFaces::default());
    let mut submitted = Vec::new();
    let mut latencies = Vec::new();
    let frames = 2 * buffers + plan.runs;
    let started = Instant::now();
    for frame in 0..frames {
        let (commands, images) = &mut slots[frame % buffers];
        submitted.push(Instant::now());
        let mut recording = commands.begin()?;
        draw.record(&mut recording, images, view, false);
        recording.read_image(&images.ids, staging.advance());
        drop(recording.submit()?);
        if let Some(read) = (frame + 1).checked_sub(buffers) {
            scanner.scan(staging.latest(buffers - 1).read(view.pixels())?, draw.face_count, &mut faces);
            latencies.push(submitted[read].elapsed().as_secs_f64() * 1e3);
        }
    }
    let seconds = started.elapsed().as_secs_f64();
    Ok(Ring {
        buffers,
        width: view.width,
        height: view.height,
        frames_per_second: latencies.len() as f64 / seconds,
        latency: Spread::of(latencies),
        frames_late: buffers - 1,
    })
}
