//! Stiff and extreme cases, each swept over a parameter and held against the truth: `vtrace stability`.
//!
//! A [`Case`] makes a scene from a parameter; [`measure`] renders it, traces it pixel by pixel and, where a
//! double-precision answer exists, compares with that too. What holds, to which bound, and what the limits are
//! is told in `docs/stability.md`.

pub mod cases;
pub mod leak;
pub mod measure;
pub mod planar;
#[cfg(feature = "plots")]
pub mod plot;
mod table;

use glam::DVec3;
use serde::Serialize;

use crate::error::Result;
use crate::options::Options;
use crate::scene::Scene;

/// An experiment, swept over one parameter.
#[derive(Clone, Copy)]
pub struct Case {
    /// What is stiff or extreme, in words joined by hyphens.
    pub name: &'static str,
    /// The parameter and its unit.
    pub parameter: &'static str,
    /// The full sweep, from harmless to extreme.
    pub values: &'static [f64],
    /// Largest errors at which a value passes.
    pub bound: Bound,
    /// From which value on a failure is a known limit, and why.
    pub limit: Option<(f64, &'static str)>,
    /// What is done for a value.
    pub experiment: Experiment,
}

/// Largest errors that a case may show: RMSE of sRGB-encoded values, or a share of rays.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Bound {
    /// Against the per-pixel reference tracer, over the pixels of VT objects (over all if there are none).
    pub reference: f64,
    /// Against the [`Truth`], over all pixels.
    pub truth: f64,
}

impl Bound {
    /// The same bound for both.
    const fn both(rmse: f64) -> Self {
        Self { reference: rmse, truth: rmse }
    }
}

/// What a case does for a value of its parameter.
#[derive(Clone, Copy)]
pub enum Experiment {
    /// Renders a picture.
    Picture(fn(f64) -> Result<Trial>),
    /// Renders the same picture on that many threads and on one.
    Threads(fn() -> Result<Trial>),
    /// Shoots rays from inside a closed body that none may leave.
    Leak(fn(f64) -> Result<leak::Body>),
}

/// A picture to take.
pub struct Trial {
    /// What is in it; its first camera takes it.
    pub scene: Scene,
    /// How it is rendered; the image size is the plan's unless [`Trial::size`] is given.
    pub options: Options,
    /// Width and height in pixels, where the case is about them.
    pub size: Option<(u32, u32)>,
    /// What it must look like, besides what the reference tracer says.
    pub truth: Truth,
}

impl Trial {
    /// A picture of `scene` with default options and no truth but the reference tracer.
    ///
    /// Not refined to the end, where every pixel is traced and nothing reconstructed.
    pub fn new(scene: Scene) -> Self {
        Self { scene, options: Options::default(), size: None, truth: Truth::Unknown }
    }

    /// The picture with something to be held against.
    pub fn against(self, truth: Truth) -> Self {
        Self { truth, ..self }
    }
}

/// What a picture must look like.
pub enum Truth {
    /// Nobody knows but the reference tracer.
    Unknown,
    /// Linear radiance along the ray from a point in a unit direction, in double precision.
    Radiance(Box<dyn Fn(DVec3, DVec3) -> DVec3 + Sync>),
    /// The same as this picture, since nothing that can be seen differs.
    Twin(Box<Trial>),
}

/// Whether a value passed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Within the bounds.
    Holds,
    /// Beyond them, for a reason that is understood.
    KnownLimit,
    /// Beyond them.
    Fails,
}

impl Verdict {
    /// As the table says it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::KnownLimit => "known limit",
            Self::Fails => "FAILS",
        }
    }
}

/// What was found for one value of a case.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// [`Case::name`].
    pub case: &'static str,
    /// [`Case::parameter`].
    pub parameter: &'static str,
    /// The parameter's value.
    pub value: f64,
    /// RMSE against the reference tracer, or the share of rays that escaped.
    pub error: f64,
    /// The same in dB; `None` for identical pictures and for rays.
    pub psnr: Option<f64>,
    /// RMSE against the closed form or the twin; `None` without one.
    pub truth: Option<f64>,
    /// What they must not exceed.
    pub bound: Bound,
    /// Vertices traced, or rays shot.
    pub samples: u64,
    /// Time of the frame or of the rays.
    pub ms: f64,
    /// Whether the bounds hold.
    pub verdict: Verdict,
    /// Why a known limit is one.
    pub why: Option<&'static str>,
}

/// Everything that one run of `vtrace stability` found.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Device that rendered.
    pub device: String,
    /// Its driver.
    pub driver: String,
    /// One row for each value of each case.
    pub rows: Vec<Row>,
}

impl Report {
    /// Number of rows that fail.
    pub fn failures(&self) -> usize {
        self.rows.iter().filter(|row| row.verdict == Verdict::Fails).count()
    }
}
