//! `vtrace profile`: what it costs to know the visible faces.

use std::path::PathBuf;

use clap::Args;

use super::{
    Failure,
    args::ThreadArgs,
    files::{self, Folder, Inputs},
    terminal, values,
};
use crate::{
    error::{Error, Result},
    gpu::{Gpu, Options as DeviceOptions},
    options::SceneOptions,
    report::{
        output::write_file,
        profile::{Profile, measure},
    },
};

/// Measure what it costs to know the visible faces of a scene, way by way and stage by stage
#[derive(Debug, Args)]
#[command(after_help = "Example: vtrace profile assets/cup.glb --out out/profile")]
pub struct ProfileArgs {
    /// Scene, a .glb or .gltf file
    scene: PathBuf,
    /// Print JSON in place of the table
    #[arg(long)]
    json: bool,
    /// Write profile.json, profile.txt and profile.svg into this folder too
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Measure one small image and one small mirror, in seconds
    #[arg(long)]
    quick: bool,
    /// Fail where what is promised of 1280x1024 pixels is not kept: reading back and scanning in at most 1.5 plain copies
    /// and, unless --quick or on a software device, counting a million triangles on the device in less time than that way
    /// takes. With room, so many times as much: for machines that have other work to do
    #[arg(
        long,
        value_name = "ROOM",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "1",
        value_parser = values::at_least_one
    )]
    check: Option<f32>,
    /// Device to measure, by name or by index of `vtrace devices`
    #[arg(long, value_name = "NAME|INDEX", help_heading = "Machine")]
    device: Option<String>,
    #[command(flatten)]
    threads: ThreadArgs,
}

/// Files that are written into the folder `--out`.
const RESULTS: [&str; 3] = ["profile.json", "profile.txt", "profile.svg"];

pub(super) fn run(args: &ProfileArgs) -> Result<(), Failure> {
    let options = SceneOptions::default();
    if let Some(folder) = &args.out {
        let results = files::entries(folder, |name| RESULTS.iter().any(|result| name == *result));
        let results: Vec<_> = results.map(|path| ("--out", path)).collect();
        let kept = Inputs::for_scene(&args.scene, &options).check_kept(&results);
        kept.map_err(|problem| Failure::conflict("profile", problem))?;
    }
    args.threads.apply()?;
    let scene = options.load(&args.scene)?;
    terminal::notes_on(&scene);
    let _made = args.out.as_deref().map(Folder::make).transpose()?;
    let gpu = Gpu::new(&DeviceOptions { device: args.device.clone(), ..DeviceOptions::default() })?;
    let plan = if args.quick { measure::Plan::quick() } else { measure::Plan::full() };
    let bar = terminal::Progress::new("measuring");
    let profile = measure::measure(&gpu, &scene, &plan, &|share| bar.set(share))?;
    drop(bar);
    let json = format!("{:#}\n", serde_json::json!(profile));
    if let Some(folder) = &args.out {
        let [data, table, plot] = RESULTS.map(|name| folder.join(name));
        write_file(&data, json.as_bytes())?;
        write_file(&table, profile.to_string().as_bytes())?;
        write_plot(&plot, &profile)?;
    }
    terminal::print(&if args.json { json } else { profile.to_string() })?;
    let Some(room) = args.check else { return Ok(()) };
    match profile.bounds.iter().find(|bound| bound.promised && bound.ratio > f64::from(room) * bound.most) {
        Some(bound) => Err(Error::Bound(format!(
            "{bound}, with room for {room} times as much; on a machine with other work to do, try again"
        ))
        .into()),
        None => Ok(()),
    }
}

#[cfg(feature = "plots")]
fn write_plot(path: &std::path::Path, profile: &Profile) -> Result<()> {
    let svg = crate::report::profile::plot::svg(profile).map_err(|error| Error::Image {
        path: path.into(),
        problem: format!("cannot be plotted: {error}"),
    })?;
    write_file(path, svg.as_bytes())
}

#[cfg(not(feature = "plots"))]
fn write_plot(path: &std::path::Path, _: &Profile) -> Result<()> {
    terminal::note(&format!("{} is left out: built without the feature `plots`", path.display()));
    Ok(())
}
