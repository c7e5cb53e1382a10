//! Ray tracing on the CPU: the same closest hits, optics and shading serve the vertex sampler and the
//! per-pixel reference.

// Elsewhere rays are looked at one by one.
#![cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]

mod arrive;
pub mod bvh;
pub mod cone;
pub mod eye;
mod finish;
pub mod light;
pub mod optics;
pub mod pyramid;
pub mod real;
pub mod reference;
pub mod sample;
pub mod shade;
mod shaft;
pub mod surface;
pub mod texel;
mod vector;
pub mod wave;

use std::ops::{Add, AddAssign, Sub};

pub use crate::options::Shadows;
use crate::options::{PathOptions, SceneOptions};

pub use bvh::{Hierarchy, Hit, Tracer};
use surface::Record;
pub use surface::{Appearance, Surface};

/// What decides over rays, for the vertex sampler and the reference alike (design §2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Largest number of specular bounces; a specular hit at the limit shows its local component alone.
    pub depth: u32,
    /// Branches with a largest throughput below this are dropped, 0 to 1.
    pub min_throughput: f32,
    /// Which surfaces ask whether a light is hidden.
    pub shadows: Shadows,
    /// Whether metals follow Schlick's approximation instead of the paper's constant k_r (Eq. 1).
    pub fresnel: bool,
}

impl Settings {
    /// What these options say of rays.
    pub fn new(paths: &PathOptions, scene: &SceneOptions) -> Self {
        Self {
            depth: paths.depth,
            min_throughput: paths.min_throughput,
            shadows: scene.shadows,
            fresnel: scene.fresnel,
        }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self::new(&PathOptions::default(), &SceneOptions::default())
    }
}

impl Shadows {
    /// Whether a surface asks; `vt` says that it belongs to a VT object, `bounces` how many specular
    /// bounces lead to it from the eye.
    pub fn apply(self, vt: bool, bounces: u32) -> bool {
        match self {
            Self::All => true,
            Self::Vt => vt || bounces > 0,
            Self::None => false,
        }
    }
}

/// Numbers of rays traced, by kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Rays {
    /// From the eye.
    pub primary: u64,
    /// Reflected by a surface, total internal reflection included.
    pub reflected: u64,
    /// Transmitted by a surface.
    pub transmitted: u64,
    /// Towards lights.
    pub shadow: u64,
}

impl Rays {
    /// Rays that were reflected or transmitted.
    pub fn secondary(&self) -> u64 {
        self.reflected + self.transmitted
    }

    /// Rays of all kinds.
    pub fn total(&self) -> u64 {
        self.primary + self.reflected + self.transmitted + self.shadow
    }
}

impl AddAssign for Rays {
    fn add_assign(&mut self, other: Self) {
        self.primary += other.primary;
        self.reflected += other.reflected;
        self.transmitted += other.transmitted;
        self.shadow += other.shadow;
    }
}

impl Add for Rays {
    type Output = Self;

    fn add(mut self, other: Self) -> Self {
        self += other;
        self
    }
}

impl Sub for Rays {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self {
            primary: self.primary - other.primary,
            reflected: self.reflected - other.reflected,
            transmitted: self.transmitted - other.transmitted,
            shadow: self.shadow - other.shadow,
        }
    }
}
