//! `vtrace reference`: the picture by conventional per-pixel ray tracing.

use std::{path::PathBuf, time::Instant};

use clap::{Args, value_parser};

use super::{
    Failure,
    args::{PathArgs, SceneArgs, ThreadArgs, ViewArgs},
    files::Inputs,
    output::OutputArgs,
    terminal, values,
};
use crate::{
    memory,
    options::ReferenceOptions,
    report::{
        FloatImage, Stats,
        output::FILE_BYTES,
        stats::{ImageStats, Rays, SceneStats, Times, UsedOptions},
    },
    trace::{
        Settings, Tracer,
        reference::{self, Following, Samples},
    },
};

/// Trace a picture pixel by pixel: what vertex tracing is held against
///
/// The same BVH, shading and camera as render, on the CPU alone.
#[derive(Debug, Args)]
#[command(after_help = "Example: vtrace reference assets/cup.glb -o out/cup_reference.png --spp 4")]
pub struct ReferenceArgs {
    /// Scene, a .glb or .gltf file
    scene: PathBuf,
    /// Image to write: .png, .exr or .pfm
    #[arg(short, long, value_name = "OUT", value_parser = values::image_file())]
    output: PathBuf,
    /// Samples per pixel, 1 to 65536
    #[arg(
        long,
        value_name = "N",
        default_value_t = 1,
        value_parser = value_parser!(u32).range(1..=65536),
        allow_negative_numbers = true
    )]
    spp: u32,
    /// Follow rays of neighbouring pixels together, as render does with pixels that it traces: the fastest conventional
    /// tracing here, and so what times are measured against. Errors are measured against pictures made without
    #[arg(long)]
    packets: bool,
    /// Start rays this far off every face, as renderers with one constant offset do: to compare with them
    /// [default: each face's own, from the rounding of its coordinates]
    #[arg(long, value_name = "UNITS", value_parser = values::non_negative, allow_negative_numbers = true)]
    ray_offset: Option<f32>,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    paths: PathArgs,
    #[command(flatten)]
    what: SceneArgs,
    #[command(flatten)]
    out: OutputArgs,
    #[command(flatten)]
    threads: ThreadArgs,
}

impl ReferenceArgs {
    fn options(&self) -> Result<ReferenceOptions, Failure> {
        let options = ReferenceOptions {
            view: self.view.options(),
            paths: self.paths.options(),
            scene: self.what.options(),
            spp: self.spp,
            packets: self.packets,
            ray_offset: self.ray_offset,
        };
        let inputs = Inputs::for_scene(&self.scene, &options.scene);
        let distinct = self.out.check_distinct(&[("--output", Some(&self.output))]);
        distinct
            .and_then(|()| inputs.check_kept(&self.out.results(Some(&self.output))))
            .and_then(|()| options.view.check())
            .and_then(|()| options.scene.check())
            .map_err(|problem| Failure::conflict("reference", problem))?;
        Ok(options)
    }
}

pub(super) fn run(args: &ReferenceArgs) -> Result<(), Failure> {
    let mut options = args.options()?;
    args.threads.apply()?;
    args.out.check(Some(&args.output))?;
    // Before the work, which may take hours.
    memory::check_picture(args.view.size.width, args.view.size.height, reference::PIXEL_BYTES + FILE_BYTES)?;

    let start = Instant::now();
    let (scene, view) = options.load(&args.scene)?;
    terminal::notes_on(&scene);
    let load = milliseconds(start);

    Tracer::check_memory(&scene)?;
    let start = Instant::now();
    let mut tracer = Tracer::new(&scene);
    if let Some(offset) = options.ray_offset {
        tracer.set_offset(offset);
    }
    let bvh = milliseconds(start);

    let following = if options.packets { Following::Together } else { Following::Alone };
    let samples = Samples { count: options.spp, following, min_throughput: args.paths.min_throughput };
    let settings = samples.settings(&Settings::new(&options.paths, &options.scene));
    options.paths.min_throughput = settings.min_throughput;
    let interrupt = terminal::interrupt();
    let bar = terminal::Progress::new("tracing");
    let traced =
        reference::render(&tracer, &view, &settings, samples, None, &interrupt, &|share| bar.set(share))?;
    drop(bar);

    let stats = Stats {
        scene: SceneStats::of(&scene),
        image: ImageStats {
            width: view.width,
            height: view.height,
            vt_pixels: traced.vt_mask.iter().filter(|vt| **vt).count() as u64,
        },
        rays: Rays {
            total: traced.rays.total(),
            primary: traced.rays.primary,
            reflected: traced.rays.reflected,
            transmitted: traced.rays.transmitted,
            shadow: traced.rays.shadow,
            pixel: 0,
        },
        time_ms: Times { load, bvh, trace: traced.time_ms, frame: traced.time_ms, ..Times::default() },
        notes: scene.notes.clone(),
        options: Some(UsedOptions::Reference(Box::new(options))),
        ..Stats::default()
    };
    let image = FloatImage { width: view.width, height: view.height, pixels: traced.image };
    args.out.write(Some(&args.output), &image, &stats)?;
    Ok(())
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
