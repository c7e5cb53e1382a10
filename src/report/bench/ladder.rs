//! What a bench compares: ways to make the picture, and the rungs of effort of each.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use serde::{Serialize, Serializer};

use crate::options::{Choice, EffortOptions, Msaa, Options, PixelSamples, Reconstruction, Ss};

/// How much is measured, and of what.
#[derive(Debug, Clone)]
pub struct Ladder {
    /// View, paths, scene and device of every picture; method and effort but for what the rungs change.
    pub options: Options,
    /// Budgets of vertex tracing, in samples; the preview comes before them.
    pub samples: Vec<u64>,
    /// Ways to reconstruct.
    pub reconstructions: Vec<Reconstruction>,
    /// Ways to anti-alias.
    pub antialiasings: Vec<Antialiasing>,
    /// Sampling rates of the tracer.
    pub rates: Vec<Rate>,
    /// Images of outside renderers.
    pub outside: Vec<Outside>,
    /// Timed runs of every point, after one that warms up.
    pub repeats: usize,
    /// Samples a pixel of the image that errors are against.
    pub reference_spp: u32,
    /// What is asked for of the tracer's branches, however many samples; see
    /// [`Samples::min_throughput`](crate::trace::reference::Samples::min_throughput).
    pub min_throughput: Option<f32>,
}

impl Default for Ladder {
    fn default() -> Self {
        Self {
            options: Options::default(),
            samples: vec![1_000, 4_000, 16_000, 64_000],
            reconstructions: vec![Reconstruction::Exact, Reconstruction::Paper],
            antialiasings: Antialiasing::USUAL.into(),
            rates: Rate::LADDER.into(),
            outside: Vec::new(),
            repeats: 5,
            reference_spp: 64,
            min_throughput: None,
        }
    }
}

/// An image that another renderer made of the same view.
#[derive(Debug, Clone, PartialEq)]
pub struct Outside {
    /// Its name.
    pub name: String,
    /// The image file.
    pub image: PathBuf,
    /// How long it took there.
    pub seconds: f64,
}

/// How edges and textures are smoothed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Antialiasing {
    /// One sample a pixel.
    None,
    /// Four shaded samples a pixel.
    Ss4,
    /// Four coverage samples a pixel, shaded once.
    Msaa4,
    /// Pixels that differ from one beside them are traced, with at most so many samples.
    Pixels(PixelSamples),
}

impl Choice for Antialiasing {
    const ALL: &'static [(Self, &'static str, &'static str)] = &[
        (Self::None, "ss1", "one sample a pixel"),
        (Self::Ss4, "ss4", "four shaded samples a pixel"),
        (Self::Msaa4, "msaa4", "four coverage samples a pixel, shaded once"),
        (Self::Pixels(PixelSamples::Four), "pixels4", "up to four traced samples where pixels differ"),
        (Self::Pixels(PixelSamples::Sixteen), "pixels16", "up to sixteen traced samples where pixels differ"),
        (
            Self::Pixels(PixelSamples::SixtyFour),
            "pixels64",
            "up to sixty-four traced samples where pixels differ",
        ),
    ];
}

impl Serialize for Antialiasing {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl Antialiasing {
    /// Those that are compared unless others are asked for.
    pub const USUAL: [Self; 4] = [Self::None, Self::Ss4, Self::Msaa4, Self::Pixels(PixelSamples::Sixteen)];

    /// `options` with this anti-aliasing.
    pub fn apply(self, options: &Options) -> Options {
        let mut options = options.clone();
        (options.method.ss, options.method.msaa) = self.samples();
        if let Self::Pixels(most) = self {
            options.method.pixel_samples = most;
        }
        options
    }

    /// Shaded and coverage samples of a pixel.
    pub fn samples(self) -> (Ss, Msaa) {
        match self {
            Self::None | Self::Pixels(_) => (Ss::One, Msaa::One),
            Self::Ss4 => (Ss::Four, Msaa::One),
            Self::Msaa4 => (Ss::One, Msaa::Four),
        }
    }
}

/// Samples a pixel of the tracer, and how many pixels share one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rate {
    /// Samples of a traced pixel, at least 1.
    pub spp: u32,
    /// Pixels of the image for one that is traced, along either side; more than 1 is stretched.
    pub side: u32,
}

impl Rate {
    /// A quarter to 16 samples a pixel.
    pub const LADDER: [Self; 6] =
        [Self::coarse(2), Self::fine(1), Self::fine(2), Self::fine(4), Self::fine(8), Self::fine(16)];

    const fn coarse(side: u32) -> Self {
        Self { spp: 1, side }
    }

    const fn fine(spp: u32) -> Self {
        Self { spp, side: 1 }
    }

    /// Supersampling of a rasterised picture that comes nearest without taking more.
    pub fn supersampling(self) -> Ss {
        match self.spp {
            16.. => Ss::Sixteen,
            4.. => Ss::Four,
            _ => Ss::One,
        }
    }
}

impl fmt::Display for Rate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.side {
            1 => write!(f, "{}", self.spp),
            side => write!(f, "1/{}", side * side),
        }
    }
}

impl FromStr for Rate {
    type Err = String;

    /// Reads `4` or `1/4`.
    fn from_str(text: &str) -> Result<Self, String> {
        let whole = |text: &str| text.parse().ok().filter(|number| (1..=4096).contains(number));
        let rate = match text.strip_prefix("1/") {
            None => whole(text).map(Self::fine),
            Some(pixels) => {
                let side = whole(pixels).map(u32::isqrt);
                side.filter(|side| side * side == whole(pixels).unwrap_or_default()).map(Self::coarse)
            }
        };
        rate.ok_or_else(|| "not samples a pixel such as 1, 4, 1/4 or 1/16".into())
    }
}

/// A way to make the picture.
#[derive(Debug, Clone, PartialEq)]
pub enum Family {
    /// By vertex tracing.
    VertexTracing {
        /// What is interpolated.
        reconstruction: Reconstruction,
        /// How edges are smoothed.
        antialiasing: Antialiasing,
    },
    /// By the conventional tracer, every pixel.
    Tracer,
    /// By the conventional tracer on specular pixels; the rest is rasterised, without shadows.
    Hybrid,
    /// By another program.
    Outside(String),
}

impl Family {
    /// Whether it is vertex tracing.
    pub fn is_ours(&self) -> bool {
        matches!(self, Self::VertexTracing { .. })
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::VertexTracing { reconstruction, antialiasing } => {
                write!(f, "vertex tracing, {reconstruction}, {}", antialiasing.name())
            }
            Self::Tracer => f.write_str("ray tracer"),
            Self::Hybrid => f.write_str("ray tracer on specular pixels"),
            Self::Outside(name) => f.write_str(name),
        }
    }
}

impl Serialize for Family {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// One picture to make.
#[derive(Debug, Clone, PartialEq)]
pub enum Job {
    /// A frame by vertex tracing; of no more samples than this, or a preview.
    Frame {
        /// What is interpolated.
        reconstruction: Reconstruction,
        /// How edges are smoothed.
        antialiasing: Antialiasing,
        /// Budget; `None` is the preview.
        samples: Option<u64>,
    },
    /// Every pixel traced.
    Traced(Rate),
    /// Specular pixels traced.
    Hybrid(Rate),
    /// Nothing traced.
    Floor(Antialiasing),
}

impl Job {
    /// The way that it stands for; `None` for the floor.
    pub fn family(&self) -> Option<Family> {
        match *self {
            Self::Frame { reconstruction, antialiasing, .. } => {
                Some(Family::VertexTracing { reconstruction, antialiasing })
            }
            Self::Traced(_) => Some(Family::Tracer),
            Self::Hybrid(_) => Some(Family::Hybrid),
            Self::Floor(_) => None,
        }
    }

    /// Its effort in words.
    pub fn effort(&self) -> String {
        match self {
            Self::Frame { samples: None, .. } => "preview".into(),
            Self::Frame { samples: Some(samples), .. } => format!("{samples} samples"),
            Self::Traced(rate) | Self::Hybrid(rate) => format!("{rate} spp"),
            Self::Floor(_) => "floor".into(),
        }
    }
}

impl Ladder {
    /// Every picture to make, each way from little to much effort.
    pub fn jobs(&self) -> Vec<Job> {
        let mut jobs = Vec::new();
        let mut samples = self.samples.clone();
        samples.sort_unstable();
        samples.dedup();
        for &reconstruction in &self.reconstructions {
            for &antialiasing in &self.antialiasings {
                let budgets = std::iter::once(None).chain(samples.iter().copied().map(Some));
                jobs.extend(budgets.map(|samples| Job::Frame { reconstruction, antialiasing, samples }));
            }
        }
        jobs.extend(self.rates.iter().copied().map(Job::Traced));
        jobs.extend(self.rates.iter().copied().map(Job::Hybrid));
        jobs.extend(self.antialiasings.iter().copied().map(Job::Floor));
        jobs
    }
}

/// The effort of a frame of no more than `samples`, whatever its error; `None` is the preview. Not sparing, for time counts.
pub fn effort(samples: Option<u64>) -> EffortOptions {
    EffortOptions { preview: samples.is_none(), max_samples: samples, ..EffortOptions::default() }
}
