//! Error against run time: what `vtrace bench` measures, and how it is told.
//!
//! [`measure`](measure::measure) runs the points of a [`Ladder`](ladder::Ladder) in turn and gives a [`Bench`];
//! [`csv`], [`plot`] and [`page`] tell it.

pub mod crossover;
pub mod csv;
pub mod fingerprint;
pub mod fit;
pub mod ladder;
pub mod measure;
pub mod page;
#[cfg(feature = "plots")]
pub mod plot;
pub mod rounds;
pub mod scaling;
pub mod studio;
pub mod truth;
pub mod words;

use serde::Serialize;

use super::FloatImage;
use super::metrics::Comparison;
use super::profile::Spread;
use super::stats::Times;
use crossover::Pace;
use ladder::{Antialiasing, Family};
use scaling::Series;

/// Everything that one run of `vtrace bench` measured, but for pictures.
#[derive(Debug, Clone, Serialize)]
pub struct Bench {
    /// The scene's name.
    pub scene: String,
    /// Its triangles.
    pub triangles: u64,
    /// Those of specular VT objects.
    pub vt_faces: u64,
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Pixels whose first hit is a specular VT object.
    pub vt_pixels: u64,
    /// Device that drew.
    pub device: String,
    /// Its driver.
    pub driver: String,
    /// Threads that traced.
    pub threads: usize,
    /// Timed runs of every point.
    pub repeats: usize,
    /// Samples a pixel of the image that errors are against.
    pub reference_spp: u32,
    /// Every way at every rung of its ladder.
    pub points: Vec<Point>,
    /// Frames of the same run that trace nothing: clear, base pass and resolve.
    pub floors: Vec<Floor>,
    /// What follows from the points, in sentences.
    pub findings: Vec<String>,
    /// How times grow; empty unless asked for.
    pub scaling: Vec<Series>,
}

/// One way to make the picture, at one effort.
#[derive(Debug, Clone, Serialize)]
pub struct Point {
    /// The way.
    pub family: Family,
    /// Its effort: `preview`, `4000 samples`, `4 spp`; empty for outside renderers.
    pub effort: String,
    /// Its time: of ours from the camera to the linear image, of the tracer that of the image alone.
    #[serde(flatten)]
    pub time: Spread,
    /// Timed runs.
    pub runs: usize,
    /// Vertices traced, by vertex tracing.
    pub samples: Option<u64>,
    /// Rays traced; unknown of outside renderers.
    pub rays: Option<u64>,
    /// Predicted RMS displacement of what is reflected, in pixels over VT pixels.
    pub predicted_error: Option<f64>,
    /// Where the time of the median run went, by vertex tracing.
    pub stages: Option<Times>,
    /// Error over the whole image.
    pub whole: Comparison,
    /// Error over VT pixels; `None` if there are none.
    pub vt: Option<Comparison>,
    /// What the tracer takes for the same error; for vertex tracing alone.
    pub paces: Vec<Pace>,
}

impl Point {
    /// Its error over a region; `None` over VT pixels if there are none.
    pub fn error(&self, region: Region) -> Option<&Comparison> {
        match region {
            Region::Vt => self.vt.as_ref(),
            Region::Whole => Some(&self.whole),
        }
    }
}

/// What rasterising alone takes.
#[derive(Debug, Clone, Serialize)]
pub struct Floor {
    /// With which anti-aliasing.
    pub antialiasing: Antialiasing,
    /// Its time.
    #[serde(flatten)]
    pub time: Spread,
}

/// Part of the image that an error is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Region {
    /// Pixels of specular VT objects.
    Vt,
    /// All pixels.
    Whole,
}

impl Region {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Vt, Self::Whole];

    /// For titles.
    pub fn words(self) -> &'static str {
        match self {
            Self::Vt => "VT pixels",
            Self::Whole => "whole image",
        }
    }
}

/// A number that says how far an image is from the reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Metric {
    /// Root mean square difference.
    Rmse,
    /// Mean ꟻLIP.
    Flip,
    /// 99th percentile of the largest channel difference.
    P99,
}

impl Metric {
    /// All. PSNR is RMSE on a scale of its own.
    pub const ALL: [Self; 3] = [Self::Rmse, Self::Flip, Self::P99];

    /// Its value.
    pub fn of(self, error: &Comparison) -> f64 {
        match self {
            Self::Rmse => error.rmse,
            Self::Flip => error.flip,
            Self::P99 => error.p99,
        }
    }

    /// For titles.
    pub fn words(self) -> &'static str {
        match self {
            Self::Rmse => "RMSE",
            Self::Flip => "mean FLIP",
            Self::P99 => "99th percentile",
        }
    }
}

/// A picture for the page.
pub struct Picture {
    /// What it shows.
    pub caption: String,
    /// The picture, linear.
    pub image: FloatImage,
}
