//! Groups of options that subcommands share, and their way into the library's
//! [`options`](crate::options).

use std::{path::PathBuf, time::Duration};

use clap::{ArgAction, Args, value_parser};
use glam::{DVec3, Vec3};

use super::values::{self, Size};
use crate::{
    error::{Error, Result},
    options::{
        CameraChoice, EffortOptions, Equation, FilterMode, MAX_DEPTH, MAX_NODES, MethodOptions, Mode, Msaa,
        PathOptions, PixelSamples, Reconstruction, SceneOptions, Shadows, Ss, ViewOptions, VisibilityWay,
    },
    scene::classify::VtRules,
};

#[derive(Debug, Args)]
#[command(next_help_heading = "View")]
#[allow(missing_docs)] // the comments are the help texts
pub struct ViewArgs {
    /// Image size in pixels, each side 1 to 16384
    #[arg(long, value_name = "WxH", default_value = "1280x1024", value_parser = values::size, allow_hyphen_values = true)]
    pub size: Size,
    /// Camera of the file, by name or by index from 0; the first one, or one that frames the scene
    #[arg(long, value_name = "NAME|INDEX")]
    pub camera: Option<String>,
    /// Eye point, in place of a camera of the file
    #[arg(long, value_name = "X,Y,Z", value_parser = values::point, allow_hyphen_values = true, conflicts_with = "camera")]
    pub eye: Option<DVec3>,
    /// Point at the centre of the image [default: centre of the scene]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::point, allow_hyphen_values = true, requires = "eye")]
    pub target: Option<DVec3>,
    /// Vertical field of view in degrees [default: the camera's, 40 with --eye]
    #[arg(long, value_name = "DEG", value_parser = values::fov, allow_negative_numbers = true)]
    pub fov: Option<f32>,
}

impl ViewArgs {
    /// The same as library options.
    pub fn options(&self) -> ViewOptions {
        let camera = match (self.eye, &self.camera) {
            (Some(eye), _) => CameraChoice::Eye { eye, target: self.target },
            (None, Some(name)) => CameraChoice::Named(name.clone()),
            (None, None) => CameraChoice::First,
        };
        ViewOptions { width: self.size.width, height: self.size.height, camera, fov: self.fov }
    }
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Method")]
#[allow(missing_docs)]
pub struct MethodArgs {
    /// How the contributions of a face reach the image
    #[arg(long, default_value_t, value_parser = values::choice::<Mode>())]
    pub mode: Mode,
    /// Which of the paper's equations combines them
    #[arg(long, default_value_t, value_parser = values::choice::<Equation>())]
    pub equation: Equation,
    /// What is interpolated between traced vertices
    #[arg(long, default_value_t, value_parser = values::choice::<Reconstruction>())]
    pub reconstruction: Reconstruction,
    /// Path nodes that a face keeps apart, 1 to 32, with --reconstruction exact
    #[arg(
        long,
        value_name = "N",
        default_value_t = 8,
        value_parser = value_parser!(u32).range(1..=i64::from(MAX_NODES)),
        allow_negative_numbers = true
    )]
    pub nodes: u32,
    /// How visible faces are found
    #[arg(long, default_value_t, value_parser = values::choice::<VisibilityWay>())]
    pub visibility: VisibilityWay,
    /// Coverage samples of a pixel that share one shading
    #[arg(long, default_value_t, value_parser = values::choice::<Msaa>())]
    pub msaa: Msaa,
    /// Samples of a pixel that are each shaded; a pixel that was traced has one colour: --pixel-samples smooths those, too
    #[arg(long, default_value_t, value_parser = values::choice::<Ss>())]
    pub ss: Ss,
    /// Trace pixels of the finished picture that differ from one beside them again, with up to so many samples
    #[arg(long, default_value_t, value_parser = values::choice::<PixelSamples>())]
    pub pixel_samples: PixelSamples,
    /// How textures are filtered
    #[arg(long, default_value_t, value_parser = values::choice::<FilterMode>())]
    pub filter: FilterMode,
}

impl MethodArgs {
    /// The same as library options.
    pub fn options(&self) -> MethodOptions {
        MethodOptions {
            mode: self.mode,
            equation: self.equation,
            reconstruction: self.reconstruction,
            nodes: self.nodes,
            visibility: self.visibility,
            msaa: self.msaa,
            ss: self.ss,
            pixel_samples: self.pixel_samples,
            filter: self.filter,
        }
    }
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Effort")]
#[allow(missing_docs)]
pub struct EffortArgs {
    /// Trace the vertices of visible faces, and of the parts of large ones; no refinement
    #[arg(long, conflicts_with_all = ["error", "max_samples", "budget"])]
    pub preview: bool,
    /// Refine until reflections are predicted to be displaced by no more than this, and colours to be off by no more
    /// than 0.0003 of it; 0 leaves no pixel untraced
    /// [default: 0.5; beside --max-samples or --budget none]
    #[arg(long, value_name = "PIXELS", value_parser = values::non_negative, allow_negative_numbers = true)]
    pub error: Option<f32>,
    /// Trace no more vertices, and pixels by themselves, than this; but the vertices of visible faces, which the first
    /// picture needs, in any case. The samples in the --stats of a frame that --budget ended make the same picture
    #[arg(long, value_name = "N", value_parser = values::count, allow_negative_numbers = true)]
    pub max_samples: Option<u64>,
    /// Plan for the number of --max-samples, and make the most of each, not of time: while they are few, smaller faces are
    /// bisected before their pixels are traced. For counting samples; for the same error it takes longer
    #[arg(long, requires = "max_samples", conflicts_with = "budget")]
    pub sparing: bool,
    /// Take no longer than this for the frame; but what a --preview takes, with its one drawing, in any case
    #[arg(long, value_name = "MS", value_parser = value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub budget: Option<u32>,
    /// Refine where something stands between samples that agree
    #[arg(long, default_value = "on", action = ArgAction::Set, value_parser = values::on_off())]
    pub shaft_guard: bool,
}

impl EffortArgs {
    /// The same as library options.
    pub fn options(&self) -> EffortOptions {
        EffortOptions {
            preview: self.preview,
            error: self.error,
            max_samples: self.max_samples,
            sparing: self.sparing,
            budget: self.budget.map(|ms| Duration::from_millis(ms.into())),
            shaft_guard: self.shaft_guard,
        }
    }
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Effort")]
#[allow(missing_docs)]
pub struct PathArgs {
    /// Most specular bounces of a path, 0 to 255
    #[arg(
        long,
        value_name = "N",
        default_value_t = PathOptions::default().depth,
        value_parser = value_parser!(u32).range(0..=i64::from(MAX_DEPTH)),
        allow_negative_numbers = true
    )]
    pub depth: u32,
    /// Drop branches that carry less than this, 0 to 1 [default: 1/255; with 64 or more samples a pixel 0]
    #[arg(long, value_name = "T", value_parser = values::fraction, allow_negative_numbers = true)]
    pub min_throughput: Option<f32>,
}

impl PathArgs {
    /// The same as library options.
    pub fn options(&self) -> PathOptions {
        let default = PathOptions::default();
        PathOptions {
            depth: self.depth,
            min_throughput: self.min_throughput.unwrap_or(default.min_throughput),
        }
    }
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Scene")]
#[allow(missing_docs)]
pub struct SceneArgs {
    /// Which surfaces receive shadows
    #[arg(long, default_value_t, value_parser = values::choice::<Shadows>())]
    pub shadows: Shadows,
    /// Let metals reflect more at grazing angles (Schlick) in place of the paper's constant
    #[arg(long)]
    pub fresnel: bool,
    /// Treat this node, mesh or material as a specular VT object; may be repeated
    #[arg(long = "vt", value_name = "NAME")]
    pub vt: Vec<String>,
    /// Treat this node, mesh or material as an ordinary object; may be repeated
    #[arg(long = "no-vt", value_name = "NAME")]
    pub no_vt: Vec<String>,
    /// Largest roughness of a specular VT object, 0 to 1
    #[arg(
        long,
        value_name = "R",
        default_value_t = VtRules::default().roughness_threshold,
        value_parser = values::fraction,
        allow_negative_numbers = true
    )]
    pub roughness_threshold: f32,
    /// Linear radiance of rays that leave the scene [default: 0,0,0]
    #[arg(
        long,
        value_name = "R,G,B",
        value_parser = values::color,
        allow_hyphen_values = true,
        conflicts_with = "environment"
    )]
    pub background: Option<Vec3>,
    /// Panorama (.hdr or .exr) around the scene
    #[arg(long, value_name = "FILE")]
    pub environment: Option<PathBuf>,
    /// Refuse files with more triangles
    #[arg(long, value_name = "N", value_parser = values::count, allow_negative_numbers = true)]
    pub max_triangles: Option<u64>,
    /// Refuse files whose textures take more memory
    #[arg(long, value_name = "N", value_parser = values::count, allow_negative_numbers = true)]
    pub max_texture_bytes: Option<u64>,
    /// Refuse files with more nodes
    #[arg(long, value_name = "N", value_parser = values::count, allow_negative_numbers = true)]
    pub max_nodes: Option<u64>,
}

impl SceneArgs {
    /// The same as library options.
    pub fn options(&self) -> SceneOptions {
        SceneOptions {
            shadows: self.shadows,
            fresnel: self.fresnel,
            vt: VtRules {
                roughness_threshold: self.roughness_threshold,
                force: self.vt.clone(),
                forbid: self.no_vt.clone(),
            },
            background: self.background,
            environment: self.environment.clone(),
            max_triangles: self.max_triangles,
            max_texture_bytes: self.max_texture_bytes,
            max_nodes: self.max_nodes,
        }
    }
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Machine")]
#[allow(missing_docs)]
pub struct ThreadArgs {
    /// Threads to work with, 1 to 1024 [default: one for each core]
    #[arg(long, value_name = "N", value_parser = value_parser!(u16).range(1..=1024), allow_negative_numbers = true)]
    pub threads: Option<u16>,
}

impl ThreadArgs {
    /// Starts the threads that the whole process shares.
    ///
    /// # Errors
    /// [`Error::Option`] if the system grants no such number.
    pub fn apply(&self) -> Result<()> {
        let threads = self.threads.map_or(0, usize::from); // 0: one a core
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build_global()
            .map_err(|error| Error::Option(format!("worker threads: {error}; --threads N asks for fewer")))
    }
}
