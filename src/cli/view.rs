//! `vtrace view`: the picture live in a window.

use std::{path::PathBuf, time::Duration};

use clap::{Args, value_parser};

use super::{
    Failure,
    args::{MethodArgs, PathArgs, SceneArgs, ThreadArgs, ViewArgs},
    terminal, values,
};
use crate::{
    options::{EffortOptions, Options, Show},
    view::{self, Request, keys},
};

/// Look at a scene in a window: a preview while the camera moves, refined while it rests
#[derive(Debug, Args)]
#[command(after_help = format!("Mouse and keys:\n  {}", keys::help().join("\n  ")))]
#[allow(missing_docs)] // the comments are the help texts
pub struct ViewerArgs {
    /// Scene, a .glb or .gltf file
    pub scene: PathBuf,
    #[command(flatten)]
    pub view: ViewArgs,
    #[command(flatten)]
    pub method: MethodArgs,
    /// Refine until reflections are predicted to be displaced by no more than this [default: 0.5]
    #[arg(long, value_name = "PIXELS", help_heading = "Effort", value_parser = values::non_negative, allow_negative_numbers = true)]
    pub error: Option<f32>,
    /// Time for a frame while the camera moves
    #[arg(long, value_name = "MS", help_heading = "Effort", default_value_t = 33, value_parser = value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub budget: u32,
    /// While the camera moves, draw pixels of N x N of the window's; unless given, as fine as the budget allows
    #[arg(long, value_name = "N", help_heading = "Effort", value_parser = value_parser!(u32).range(1..=4), allow_negative_numbers = true)]
    pub coarse: Option<u32>,
    #[command(flatten)]
    pub paths: PathArgs,
    #[command(flatten)]
    pub what: SceneArgs,
    /// Brighten the window by this many stops
    #[arg(long, value_name = "EV", help_heading = "Output", default_value_t = 0.0, allow_hyphen_values = true, value_parser = values::exposure)]
    pub exposure: f32,
    /// Show the method's data in place of the image
    #[arg(long, help_heading = "Output", value_parser = values::choice::<Show>())]
    pub show: Option<Show>,
    /// Device to draw with, by name or by index of `vtrace devices`
    #[arg(long, value_name = "NAME|INDEX", help_heading = "Machine")]
    pub device: Option<String>,
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Scripted input, for tests and measurements
    #[arg(long, value_name = "FILE", hide = true)]
    pub script: Option<PathBuf>,
}

impl ViewerArgs {
    fn options(&self) -> Result<Options, String> {
        let options = Options {
            view: self.view.options(),
            method: self.method.options(),
            effort: EffortOptions { error: self.error, ..EffortOptions::default() },
            paths: self.paths.options(),
            scene: self.what.options(),
            device: self.device.clone(),
            show: self.show,
            everything: false,
        };
        options.check()?;
        Ok(options)
    }
}

pub(super) fn run(args: &ViewerArgs) -> Result<(), Failure> {
    let options = args.options().map_err(|problem| Failure::conflict("view", problem))?;
    args.threads.apply()?;
    let asked = options.scene.clone();
    let load = Box::new(move |file: &std::path::Path| {
        let scene = asked.load(file)?;
        terminal::notes_on(&scene);
        Ok(scene)
    });
    let request = Request {
        scene: args.scene.clone(),
        options,
        budget: Duration::from_millis(args.budget.into()),
        coarse: args.coarse,
        exposure: args.exposure,
        script: args.script.clone(),
    };
    Ok(view::run(&request, load)?)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use clap::Parser;
    use glam::{DVec3, Vec3};

    use super::*;
    use crate::{
        cli::render::RenderArgs,
        options::{CameraChoice, Equation, Msaa, PixelSamples, Reconstruction, Shadows, Ss, VisibilityWay},
        view::command::render_line,
    };

    #[derive(Debug, Parser)]
    struct Program {
        #[command(subcommand)]
        command: Command,
    }

    #[derive(Debug, clap::Subcommand)]
    enum Command {
        Render(RenderArgs),
    }

    #[test]
    fn the_printed_line_asks_render_for_the_same() {
        let mut options = Options::default();
        let eye = DVec3::new(-1.0 / 3.0, 1e-7, 123_456.789_012_345);
        options.view.camera = CameraChoice::Eye { eye, target: Some(DVec3::new(-0.1, 2.0, -3.0)) };
        (options.view.width, options.view.height, options.view.fov) = (640, 480, Some(39.999_996));
        options.method.equation = Equation::Four;
        options.method.reconstruction = Reconstruction::Paper;
        options.method.visibility = VisibilityWay::Device;
        (options.method.msaa, options.method.ss, options.method.nodes) = (Msaa::Four, Ss::Four, 3);
        (options.effort.error, options.paths.depth, options.paths.min_throughput) = (Some(0.3), 2, 0.1);
        (options.scene.shadows, options.scene.fresnel) = (Shadows::None, true);
        options.scene.background = Some(Vec3::new(0.1, 0.2, 0.3));
        options.scene.vt.force = vec!["cup".into()];
        options.method.pixel_samples = PixelSamples::Sixteen;
        let budgets = &mut options.scene;
        (budgets.max_triangles, budgets.max_texture_bytes, budgets.max_nodes) = (Some(5), Some(6), Some(7));
        options.show = Some(Show::Ids);
        for exposure in [-0.3, 0.0, 1.5] {
            let line = render_line(Path::new("s.glb"), &options, exposure);
            let Command::Render(parsed) = Program::try_parse_from(line.split(' ')).unwrap().command;
            assert_eq!(
                (parsed.options().unwrap(), parsed.out.exposure),
                (options.clone(), exposure),
                "{line}"
            );
        }
    }
}
