//! `vtrace plan`: what a picture would need, what it leaves out, and what that saves.

use std::path::PathBuf;

use clap::Args;

use super::{
    Failure,
    args::{EffortArgs, MethodArgs, PathArgs, SceneArgs, ViewArgs},
    terminal,
};
use crate::{options::Options, plan::Summary, report::output::to_json};

/// Tell what a picture of a scene needs, what it leaves out and why, and what that saves
///
/// No device is asked for. Bytes are those of buffers and images before the first frame; samples and refined
/// leaves come on top.
#[derive(Debug, Args)]
#[command(after_help = "Example: vtrace plan assets/cup.glb --mode multi-pass")]
pub struct PlanArgs {
    /// Scene, a .glb or .gltf file
    scene: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    method: MethodArgs,
    #[command(flatten)]
    effort: EffortArgs,
    #[command(flatten)]
    paths: PathArgs,
    #[command(flatten)]
    what: SceneArgs,
}

pub(super) fn run(args: &PlanArgs) -> Result<(), Failure> {
    let options = Options {
        view: args.view.options(),
        method: args.method.options(),
        effort: args.effort.options(),
        paths: args.paths.options(),
        scene: args.what.options(),
        ..Options::default()
    };
    options.check().map_err(|problem| Failure::conflict("plan", problem))?;
    let (scene, _) = options.load(&args.scene)?;
    terminal::notes_on(&scene);
    let summary = Summary::new(&scene, &options);
    terminal::print(&if args.json { to_json(&summary)? } else { summary.to_string() })?;
    Ok(())
}
