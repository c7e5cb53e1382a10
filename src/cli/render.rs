//! `vtrace render`: the picture by vertex tracing.

use std::{
    ffi::OsStr,
    path::{Path, PathBuf},
    time::Instant,
};

use clap::Args;

use super::{
    Failure,
    args::{EffortArgs, MethodArgs, PathArgs, SceneArgs, ThreadArgs, ViewArgs},
    files::{self, Folder, Inputs},
    output::OutputArgs,
    terminal, values,
};
use crate::{
    error::Result,
    frame::{Observer, PICTURE_BYTES, Renderer, Step},
    gpu::{self, Gpu},
    memory,
    options::{Options, Show},
    report::output::write_image,
};

/// Render a picture by vertex tracing
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  vtrace render scene.glb -o picture.png
  vtrace render scene.glb -o picture.exr --size 1920x1080 --eye 0,1.5,4 --target 0,0.5,0
  vtrace render scene.glb -o quick.png --preview --stats -
  vtrace render scene.glb -o paper.png --reconstruction paper --max-samples 47000
  vtrace render scene.glb -o mask.png --show vt-mask")]
#[allow(missing_docs)] // the comments are the help texts
pub struct RenderArgs {
    /// Scene, a .glb or .gltf file
    pub scene: PathBuf,
    /// Image to write: .png, .exr or .pfm
    #[arg(short, long, value_name = "OUT", value_parser = values::image_file())]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    pub view: ViewArgs,
    #[command(flatten)]
    pub method: MethodArgs,
    #[command(flatten)]
    pub effort: EffortArgs,
    #[command(flatten)]
    pub paths: PathArgs,
    #[command(flatten)]
    pub what: SceneArgs,
    #[command(flatten)]
    pub out: OutputArgs,
    /// Write an image after every refinement step into this folder; made if absent
    #[arg(long, value_name = "DIR", help_heading = "Output", conflicts_with = "show")]
    pub progressive: Option<PathBuf>,
    /// Show the method's data in place of the image
    #[arg(long, help_heading = "Output", value_parser = values::choice::<Show>())]
    pub show: Option<Show>,
    /// Leave no stage, pass or buffer out, even where the scene does not need it
    #[arg(long, help_heading = "Output")]
    pub everything: bool,
    /// Device to draw with, by name or by index of `vtrace devices`
    #[arg(long, value_name = "NAME|INDEX", help_heading = "Machine")]
    pub device: Option<String>,
    #[command(flatten)]
    pub threads: ThreadArgs,
}

impl RenderArgs {
    /// The same as library options.
    ///
    /// # Errors
    /// Why the options do not go together.
    pub fn options(&self) -> Result<Options, String> {
        let options = Options {
            view: self.view.options(),
            method: self.method.options(),
            effort: self.effort.options(),
            paths: self.paths.options(),
            scene: self.what.options(),
            device: self.device.clone(),
            show: self.show,
            everything: self.everything,
        };
        options.check()?;
        Ok(options)
    }

    /// Checks that no result takes the place of another, or of what is read.
    fn check_files(&self, options: &Options) -> Result<(), String> {
        let (image, steps) = (self.output.as_deref(), self.progressive.as_deref());
        self.out.check_distinct(&[("--output", image), ("--progressive", steps)])?;
        let mut results = self.out.results(image);
        if let Some(folder) = steps {
            if let Some((option, path)) =
                results.iter().find(|(_, path)| files::is_entry(path, folder, is_step))
            {
                let path = path.display();
                return Err(format!("{option} names one of the images of --progressive, {path}"));
            }
            results.extend(files::entries(folder, is_step).map(|path| ("--progressive", path)));
        }
        Inputs::for_scene(&self.scene, &options.scene).check_kept(&results)
    }
}

/// The file in `folder` for the image after a refinement step.
fn step_file(folder: &Path, number: u32) -> PathBuf {
    folder.join(format!("step_{number:04}.png"))
}

/// Whether a file of this name is the image of a step.
fn is_step(name: &OsStr) -> bool {
    let number =
        name.to_str().and_then(|name| name.strip_prefix("step_")?.strip_suffix(".png")?.parse().ok());
    number.is_some_and(|number| step_file(Path::new(""), number) == Path::new(name))
}

pub(super) fn run(args: &RenderArgs) -> Result<(), Failure> {
    let options = args.options().and_then(|options| {
        args.check_files(&options)?;
        Ok(options)
    });
    let options = options.map_err(|problem| Failure::conflict("render", problem))?;
    args.threads.apply()?;
    // Before the other results are checked, which may go into it.
    let _steps = args.progressive.as_deref().map(Folder::make).transpose()?;
    args.out.check(args.output.as_deref())?;
    memory::check_picture(options.view.width, options.view.height, PICTURE_BYTES)?;

    let start = Instant::now();
    let (scene, view) = options.load(&args.scene)?;
    terminal::notes_on(&scene);
    let load = start.elapsed().as_secs_f64() * 1e3;

    let gpu = Gpu::new(&gpu::Options { device: options.device.clone(), validation: false })?;
    let mut renderer = Renderer::new(&gpu, &scene, &options)?;
    renderer.set_interrupt(terminal::interrupt());
    let warmup = renderer.warm_up(&view)?;
    let mut save = |step: &Step| match &args.progressive {
        Some(folder) => write_image(&step_file(folder, step.number), &step.image, args.out.exposure),
        None => Ok(()),
    };
    let observer: Option<Observer> = args.progressive.is_some().then_some(&mut save);
    let mut frame = renderer.render_steps(&view, observer)?;
    frame.stats.time_ms.load = load;
    frame.stats.time_ms.warmup = warmup;
    // Files are encoded in the memory that it took.
    drop(renderer);
    args.out.write(args.output.as_deref(), &frame.image, &frame.stats)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use clap::Parser;
    use glam::{DVec3, Vec3};

    use super::*;
    use crate::options::{
        CameraChoice, Equation, FilterMode, Mode, Msaa, Reconstruction, Shadows, Ss, VisibilityWay,
    };

    #[derive(Debug, Parser)]
    struct Program {
        #[command(flatten)]
        render: RenderArgs,
    }

    fn parse(line: &str) -> Result<Options, String> {
        let words = format!("vtrace s.glb {line}");
        let program = Program::try_parse_from(words.split_whitespace()).map_err(|error| error.to_string())?;
        program.render.options()
    }

    #[test]
    fn nothing_said_means_the_library_defaults() {
        assert_eq!(parse("").unwrap(), Options::default());
    }

    #[test]
    fn every_option_arrives() {
        let options = parse(
            "--size 64x48 --eye -1,2,3 --target 0,-1,0 --fov 30 --mode multi-pass --equation 4 --reconstruction \
             paper --nodes 2 --visibility device --error 0.25 --max-samples 9 --budget 40 --depth 7 \
             --min-throughput 0.5 --msaa 4 --ss 16 --filter aniso8 --shadows vt --fresnel --vt a --vt b \
             --no-vt c --roughness-threshold 0.2 --background 0.1,0.2,0.3 --max-triangles 5 \
             --shaft-guard off --max-texture-bytes 6 --max-nodes 7 --show ids --everything --device 1",
        )
        .unwrap();
        assert_eq!((options.view.width, options.view.height, options.view.fov), (64, 48, Some(30.0)));
        let target = Some(DVec3::new(0.0, -1.0, 0.0));
        assert_eq!(options.view.camera, CameraChoice::Eye { eye: DVec3::new(-1.0, 2.0, 3.0), target });
        let method = &options.method;
        assert_eq!((method.mode, method.equation), (Mode::MultiPass, Equation::Four));
        assert_eq!((method.reconstruction, method.nodes), (Reconstruction::Paper, 2));
        assert_eq!((method.visibility, method.filter), (VisibilityWay::Device, FilterMode::Aniso8));
        assert_eq!((method.msaa, method.ss), (Msaa::Four, Ss::Sixteen));
        let effort = &options.effort;
        assert_eq!((effort.preview, effort.error, effort.max_samples), (false, Some(0.25), Some(9)));
        assert!(!effort.shaft_guard);
        assert_eq!(effort.budget, Some(Duration::from_millis(40)));
        assert_eq!((options.paths.depth, options.paths.min_throughput), (7, 0.5));
        let scene = &options.scene;
        assert_eq!((scene.shadows, scene.fresnel), (Shadows::Vt, true));
        assert_eq!((scene.vt.force.join(" "), scene.vt.forbid.join(" ")), ("a b".into(), "c".into()));
        assert_eq!((scene.vt.roughness_threshold, scene.background), (0.2, Some(Vec3::new(0.1, 0.2, 0.3))));
        let budgets = (scene.max_triangles, scene.max_texture_bytes, scene.max_nodes);
        assert_eq!(budgets, (Some(5), Some(6), Some(7)));
        assert_eq!((options.show, options.everything), (Some(Show::Ids), true));
        assert_eq!(options.device.as_deref(), Some("1"));
    }

    #[test]
    fn options_that_do_not_go_together_are_refused() {
        for (line, expected) in [
            ("--msaa 4 --visibility single-pass", "--msaa 4 cannot be used with --visibility single-pass"),
            ("--preview --max-samples 5", "cannot be used with"),
            ("--preview --error 1", "cannot be used with"),
            ("--preview --budget 5", "cannot be used with"),
            ("--sparing", "--max-samples <N>"),
            ("--sparing --max-samples 5 --budget 5", "cannot be used with"),
            ("--camera a --eye 0,0,0", "cannot be used with"),
            ("--background 0,0,0 --environment sky.hdr", "cannot be used with"),
            ("--vt a --no-vt a", "contradict each other"),
            ("--nodes 0", "0 is not in 1..=32"),
            ("--ss 2", "[possible values: 1, 4, 16]"),
            ("--error=-1", "not a number 0 or more"),
            ("--error nan", "not a number 0 or more"),
            ("-o picture", "images are written as .png, .exr or .pfm"),
        ] {
            let problem = parse(line).unwrap_err();
            assert!(problem.contains(expected), "{line}: {problem:?} should contain {expected:?}");
        }
    }
}
