//! Images, samplers and the environment panorama, as the tracer and the device read them.

use std::sync::Arc;

use glam::{Vec3, Vec4};

/// An image decoded to eight bits a channel.
#[derive(Debug, Clone)]
pub struct Image {
    /// Its name or URI, for messages.
    pub name: String,
    /// Texels in a row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// RGBA8, row by row from the top, `4 · width · height` bytes.
    pub rgba: Arc<[u8]>,
}

/// An image, how it is sampled, and how its bytes are meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Texture {
    /// Index into [`Scene::images`](super::Scene::images).
    pub image: u32,
    /// Wrap modes and filters.
    pub sampler: Sampler,
    /// Whether colour channels are sRGB-encoded (base colour, emission) or linear (all others).
    pub srgb: bool,
}

/// A glTF sampler.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Sampler {
    /// Wrap mode along u.
    pub wrap_u: Wrap,
    /// Wrap mode along v.
    pub wrap_v: Wrap,
    /// Filter where a texel covers more than a pixel.
    pub mag: Filter,
    /// Filter where a texel covers less than a pixel.
    pub min: Filter,
    /// Filter between mip levels; `None` reads level 0 alone.
    pub mip: Option<Filter>,
}

impl Default for Sampler {
    /// What glTF leaves to the renderer: repeat, trilinear.
    fn default() -> Self {
        Self {
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Repeat,
            mag: Filter::Linear,
            min: Filter::Linear,
            mip: Some(Filter::Linear),
        }
    }
}

/// What lies outside the unit square of texture coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// The texture again.
    Repeat,
    /// The texture again, mirrored every other time.
    Mirror,
    /// Its border texels.
    Clamp,
}

/// Texel filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Filter {
    /// The nearest one.
    Nearest,
    /// Linear interpolation.
    Linear,
}

/// A latitude–longitude panorama of linear radiance, at infinity.
///
/// The centre of the image is the direction −z, up is +y; u grows to the right as seen from inside.
#[derive(Debug, Clone)]
pub struct Environment {
    /// File name, for messages.
    pub name: String,
    /// Texels in a row.
    pub width: u32,
    /// Rows, from the zenith down.
    pub height: u32,
    /// Linear RGB radiance, `width · height` texels.
    pub radiance: Arc<[Vec3]>,
}

impl Image {
    /// The texel at (`x`, `y`), undecoded, in 0..=1.
    pub fn texel(&self, x: u32, y: u32) -> Vec4 {
        let i = (y as usize * self.width as usize + x as usize) * 4;
        Vec4::from_array(std::array::from_fn(|c| f32::from(self.rgba[i + c]) / 255.0))
    }
}
