//! What the colour passes are asked for: components, faces without samples, options.

use glam::Vec3;

use crate::constants::*;
use crate::options::{Equation, Mode, Reconstruction};
use crate::reconstruct::leaves::GpuLeaf;
use crate::visibility::Clusters;

/// One colour draw: its name and the components of Eq. 3 that it adds up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ColorPass {
    /// Name in the stats.
    pub name: &'static str,
    /// Bits of `COMPONENT_…`.
    pub components: u32,
}

/// The colour passes of a mode and equation, everything included.
pub fn color_passes(mode: Mode, equation: Equation) -> &'static [ColorPass] {
    const ALL: [ColorPass; 1] = [ColorPass {
        name: "multi-texture",
        components: COMPONENT_PRIMARY
            | COMPONENT_REFLECTED
            | COMPONENT_TRANSMITTED
            | COMPONENT_REFLECTED_COMB
            | COMPONENT_TRANSMITTED_COMB,
    }];
    const FIVE: [ColorPass; 5] = [
        ColorPass { name: "primary", components: COMPONENT_PRIMARY },
        ColorPass { name: "reflected", components: COMPONENT_REFLECTED },
        ColorPass { name: "reflected combined", components: COMPONENT_REFLECTED_COMB },
        ColorPass { name: "transmitted", components: COMPONENT_TRANSMITTED },
        ColorPass { name: "transmitted combined", components: COMPONENT_TRANSMITTED_COMB },
    ];
    const THREE: [ColorPass; 3] = [
        ColorPass { name: "primary", components: COMPONENT_PRIMARY },
        ColorPass { name: "reflected", components: COMPONENT_REFLECTED | COMPONENT_REFLECTED_COMB },
        ColorPass { name: "transmitted", components: COMPONENT_TRANSMITTED | COMPONENT_TRANSMITTED_COMB },
    ];
    match (mode, equation) {
        (Mode::MultiTexture, _) => &ALL,
        (Mode::MultiPass, Equation::Three) => &FIVE,
        (Mode::MultiPass, Equation::Four) => &THREE,
    }
}

/// A colour pass as it was recorded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drawing {
    /// Its name.
    pub name: &'static str,
    /// Its time on the device in milliseconds; 0 on a device without a clock.
    pub ms: f64,
    /// Draws recorded in it.
    pub draws: u32,
}

/// How the image is drawn, apart from the scene and its samples.
#[derive(Debug, Clone, PartialEq)]
pub struct PassOptions {
    /// How leaves are reconstructed.
    pub reconstruction: Reconstruction,
    /// Colour passes that a frame may have, in order; the first draws faces without samples too.
    pub passes: Vec<ColorPass>,
    /// Eq. 3 or Eq. 4.
    pub equation: Equation,
    /// Coverage samples a pixel: 1 or 4.
    pub samples: u32,
    /// What shaders are compiled with: bits of `FEATURE_…`.
    pub features: u32,
    /// Whether the faces without samples are drawn before the samples are known, with those that need
    /// samples among them: see [`Painter::draw_base`](super::Painter::draw_base).
    pub single_pass: bool,
    /// Whether leaves are drawn besides faces without samples.
    pub leaves: bool,
    /// Number of lights.
    pub lights: u32,
    /// Linear radiance where no face is seen; `None` if a panorama is.
    pub background: Option<[f32; 3]>,
}

/// Faces that are drawn without samples, by how they are drawn.
#[derive(Debug, Default)]
pub struct BaseFaces {
    /// Leaf records, opaque ones first.
    pub leaves: Vec<GpuLeaf>,
    /// Draws over `leaves`.
    pub draws: Vec<BaseDraw>,
    /// Words of the vertices of their objects.
    pub vertices: Vec<u32>,
}

/// Consecutive faces without samples that are drawn alike.
#[derive(Debug, Clone)]
pub struct BaseDraw {
    /// The leaf records, run by run.
    pub clusters: Clusters,
    /// Where they are, for the order of blended ones.
    pub centre: Vec3,
    /// Array of the bank that their texture lies in.
    pub array: u32,
    /// Whether back faces are left out.
    pub cull: bool,
    /// Whether they cover by alpha.
    pub blended: bool,
    /// Whether they need samples, so that leaves will take their place (single-pass visibility).
    pub marked: bool,
}
