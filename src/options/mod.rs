//! What a picture is asked to be, as valid values, whoever asks: command line, library user or test.

mod choice;
mod load;
mod view;

pub use choice::{
    Choice, Equation, FilterMode, Mode, Msaa, PixelSamples, Reconstruction, Shadows, Show, Ss, UnknownChoice,
    VisibilityWay,
};
pub use view::{CameraChoice, DEFAULT_FOV, ViewOptions};

use std::{fmt::Display, ops::RangeInclusive, path::PathBuf, time::Duration};

use glam::Vec3;
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

use crate::scene::classify::VtRules;

/// Everything that `vtrace render` can be told about the image.
///
/// [`Options::load`] reads a file as these options mean it; [`Renderer`](crate::frame::Renderer) makes the picture. Each
/// field says which of them it is for.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Options {
    /// Image size and camera; for loading, and [`ViewOptions::resolve`]: a renderer is given the view that they make.
    #[serde(flatten)]
    pub view: ViewOptions,
    /// How the image is put together; for the renderer.
    #[serde(flatten)]
    pub method: MethodOptions,
    /// How much is sampled; for the renderer.
    #[serde(flatten)]
    pub effort: EffortOptions,
    /// How far paths are followed; for the renderer.
    #[serde(flatten)]
    pub paths: PathOptions,
    /// How the scene is meant; for loading, but for shadows and Fresnel, which are the renderer's.
    #[serde(flatten)]
    pub scene: SceneOptions,
    /// Which device draws, by name or index; `None` takes the best. For neither: told to
    /// [`gpu::Options`](crate::gpu::Options), it is part of the stats here.
    pub device: Option<String>,
    /// Data to show in place of the image; for the renderer.
    pub show: Option<Show>,
    /// Leave no stage, pass or buffer out, even where the scene does not need it; for the renderer.
    pub everything: bool,
}

/// Everything that `vtrace reference` can be told about the image.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReferenceOptions {
    /// Image size and camera.
    #[serde(flatten)]
    pub view: ViewOptions,
    /// How far paths are followed.
    #[serde(flatten)]
    pub paths: PathOptions,
    /// How the scene is meant.
    #[serde(flatten)]
    pub scene: SceneOptions,
    /// Samples per pixel, at least 1.
    pub spp: u32,
    /// Whether rays of neighbouring pixels are followed together.
    pub packets: bool,
    /// How far rays start off every face, in world units; `None`: as far as its position and size ask for.
    pub ray_offset: Option<f32>,
}

/// How the image is put together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MethodOptions {
    /// One pass or several.
    pub mode: Mode,
    /// How contributions combine.
    pub equation: Equation,
    /// What is interpolated.
    pub reconstruction: Reconstruction,
    /// Nodes of the sample tree that a leaf may own, 1..=[`MAX_NODES`]; for [`Reconstruction::Exact`].
    pub nodes: u32,
    /// How visible faces are found.
    pub visibility: VisibilityWay,
    /// Coverage samples a pixel.
    pub msaa: Msaa,
    /// Shaded samples a pixel.
    pub ss: Ss,
    /// Most samples of pixels that differ from one beside them; no budget of samples pays for them.
    pub pixel_samples: PixelSamples,
    /// Texture filter.
    pub filter: FilterMode,
}

/// Most nodes that a leaf may own.
pub const MAX_NODES: u32 = 32;

impl MethodOptions {
    /// Whether a pixel has several samples that are drawn.
    pub fn has_sub_samples(&self) -> bool {
        self.msaa != Msaa::One || self.ss != Ss::One
    }
}

impl Default for MethodOptions {
    fn default() -> Self {
        Self {
            mode: Mode::default(),
            equation: Equation::default(),
            reconstruction: Reconstruction::default(),
            nodes: 8,
            visibility: VisibilityWay::default(),
            msaa: Msaa::default(),
            ss: Ss::default(),
            pixel_samples: PixelSamples::default(),
            filter: FilterMode::default(),
        }
    }
}

/// When refinement stops: at the first limit that is met.
#[derive(Debug, Clone, PartialEq)]
pub struct EffortOptions {
    /// Primary vertices only, no refinement step.
    pub preview: bool,
    /// Predicted RMS displacement of what is reflected, in pixels over VT pixels (design §6); 0.0003 of it also bounds
    /// the predicted RMS error of linear radiance, since not all errors are displacements. `None` is
    /// [`DEFAULT_ERROR`], or no such limit beside another one.
    pub error: Option<f32>,
    /// Most vertices to trace, and pixels that are traced by themselves. The vertices of visible faces are in any case:
    /// there is no picture without. [`Stats::samples`](crate::report::stats::Stats::samples) of a frame that `budget` ended,
    /// all else the same, make its image again.
    pub max_samples: Option<u64>,
    /// Whether `max_samples` are spent for what each of them shows, not for the time that it takes: the frame is planned
    /// for their number, so that it is not what a `budget` makes of as many. Where they are less than half a sample for each
    /// pixel of the refined faces, these are bisected down to 4 pixels, not 24, before their pixels are traced.
    pub sparing: bool,
    /// Longest time for the frame, but not below that of a preview, with its one drawing: with it the image may differ from run to run, as it may where
    /// [`VisibilityWay::Auto`] finds two ways about equally fast.
    pub budget: Option<Duration>,
    /// Whether to look for what stands between samples that agree; for [`Reconstruction::Exact`].
    pub shaft_guard: bool,
}

impl Default for EffortOptions {
    fn default() -> Self {
        Self {
            preview: false,
            error: None,
            max_samples: None,
            sparing: false,
            budget: None,
            shaft_guard: true,
        }
    }
}

/// [`EffortOptions::error`] where nothing else limits a frame, in pixels.
pub const DEFAULT_ERROR: f32 = 0.5;

impl EffortOptions {
    /// The predicted displacement, in pixels, at which refinement stops; `None` if only samples or time stop it.
    pub fn target(&self) -> Option<f32> {
        self.error.or((!self.is_limited()).then_some(DEFAULT_ERROR))
    }

    /// Whether samples or time limit the frame.
    pub fn is_limited(&self) -> bool {
        self.max_samples.is_some() || self.budget.is_some()
    }

    /// The limit of samples that the frame is planned for; `None` where they are not spared, or time may end it before.
    pub fn spared_samples(&self) -> Option<u64> {
        self.max_samples.filter(|_| self.sparing && self.budget.is_none())
    }
}

impl Serialize for EffortOptions {
    /// The limits that hold, a time in milliseconds.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut fields = serializer.serialize_struct("EffortOptions", 6)?;
        fields.serialize_field("preview", &self.preview)?;
        fields.serialize_field("error", &self.target())?;
        fields.serialize_field("max_samples", &self.max_samples)?;
        fields.serialize_field("sparing", &self.sparing)?;
        fields.serialize_field("budget_ms", &self.budget.map(|budget| budget.as_secs_f64() * 1e3))?;
        fields.serialize_field("shaft_guard", &self.shaft_guard)?;
        fields.end()
    }
}

/// Most specular bounces that can be asked for.
pub const MAX_DEPTH: u32 = 255;

/// How far paths are followed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PathOptions {
    /// Most specular bounces, up to [`MAX_DEPTH`].
    pub depth: u32,
    /// Branches with a largest throughput below this are dropped, 0 to 1.
    pub min_throughput: f32,
}

impl Default for PathOptions {
    fn default() -> Self {
        Self { depth: 5, min_throughput: 1.0 / 255.0 }
    }
}

/// How the scene is meant, beyond what its file says.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct SceneOptions {
    /// Which surfaces receive shadows; for the renderer, as is the next.
    pub shadows: Shadows,
    /// Whether metals reflect by Schlick's approximation instead of a constant k_r.
    pub fresnel: bool,
    /// Which objects are specular VT objects; for loading, as is all below.
    #[serde(flatten)]
    pub vt: VtRules,
    /// Linear radiance of a ray that leaves the scene; black if `None` and no environment is given.
    pub background: Option<Vec3>,
    /// Panorama (.hdr or .exr) that a ray meets that leaves the scene.
    #[serde(serialize_with = "as_text")]
    pub environment: Option<PathBuf>,
    /// Most triangles that a file may have; `None` is the loader's own limit.
    pub max_triangles: Option<u64>,
    /// Most bytes that decoded textures may take; `None` is the loader's own limit.
    pub max_texture_bytes: Option<u64>,
    /// Most nodes that a file may have; `None` is the loader's own limit.
    pub max_nodes: Option<u64>,
}

/// A path as text, with marks in place of what is not Unicode: no reason to fail once the work is done.
fn as_text<S: Serializer>(path: &Option<PathBuf>, serializer: S) -> Result<S::Ok, S::Error> {
    path.as_ref().map(|path| path.to_string_lossy()).serialize(serializer)
}

impl Options {
    /// Checks that every value is in its range and that the options go together, as a renderer does.
    ///
    /// # Errors
    /// Which value is not, or why they do not, in terms of the command line.
    pub fn check(&self) -> Result<(), String> {
        if self.method.msaa == Msaa::Four && self.method.visibility == VisibilityWay::SinglePass {
            return Err(
                "--msaa 4 cannot be used with --visibility single-pass, whose primary-face codes the \
                        resolve would average; take --visibility id-buffer"
                    .into(),
            );
        }
        let effort = &self.effort;
        if effort.preview && (effort.max_samples.is_some() || effort.budget.is_some()) {
            return Err(
                "--preview takes no refinement step, so --max-samples and --budget do not apply".into()
            );
        }
        if effort.sparing && (effort.max_samples.is_none() || effort.budget.is_some()) {
            return Err(
                "--sparing plans for the samples of --max-samples: it needs them, and --budget does not \
                        apply"
                    .into(),
            );
        }
        in_range("--nodes", self.method.nodes, 1..=MAX_NODES)?;
        in_range("--error", effort.error.unwrap_or(0.0), 0.0..=f32::INFINITY)?;
        in_range("--depth", self.paths.depth, 0..=MAX_DEPTH)?;
        in_range("--min-throughput", self.paths.min_throughput, 0.0..=1.0)?;
        self.view.check()?;
        self.scene.check()
    }
}

/// Whether `value` is one of `range`, as NaN never is.
fn in_range<T: PartialOrd + Display>(option: &str, value: T, range: RangeInclusive<T>) -> Result<(), String> {
    let outside = || format!("{option} {value}: not from {} to {}", range.start(), range.end());
    range.contains(&value).then_some(()).ok_or_else(outside)
}

impl SceneOptions {
    /// Checks that every value is in its range and that the options go together.
    ///
    /// # Errors
    /// Which value is not, or why they do not, in terms of the command line.
    pub fn check(&self) -> Result<(), String> {
        if self.background.is_some() && self.environment.is_some() {
            return Err("--background cannot be used with --environment, which covers every direction".into());
        }
        in_range("--roughness-threshold", self.vt.roughness_threshold, 0.0..=1.0)?;
        if let Some(color) = self.background.filter(|color| !color.is_finite() || color.min_element() < 0.0) {
            return Err(format!("--background {color}: a colour is finite and not negative"));
        }
        match self.vt.force.iter().find(|name| self.vt.forbid.contains(name)) {
            Some(name) => Err(format!("--vt {name} and --no-vt {name} contradict each other")),
            None => Ok(()),
        }
    }
}
