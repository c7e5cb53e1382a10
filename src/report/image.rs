//! Linear float images, and reading them from files.

use std::{io::Cursor, path::Path};

use image::{DynamicImage, ImageFormat, ImageReader};
use rayon::prelude::*;

use super::pfm;
use crate::error::{Error, Result};
use crate::memory;

/// Bytes that a pixel takes while it is decoded, at most: four floats, three numbers of those, and what is kept.
const DECODED_BYTES: u64 = 40;

/// An image of linear radiance, three channels, no alpha.
#[derive(Debug, Clone, PartialEq)]
pub struct FloatImage {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Linear RGB, row by row from the top: `width · height` pixels.
    pub pixels: Vec<[f32; 3]>,
}

impl FloatImage {
    /// An image whose pixel in column `x` of row `y` is `pixel(x, y)`.
    pub fn from_fn(width: u32, height: u32, pixel: impl Fn(u32, u32) -> [f32; 3]) -> Self {
        let pixels =
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect();
        Self { width, height, pixels }
    }

    /// Reads a PNG, JPEG, HDR, EXR or PFM file, recognised by its content; alpha is dropped.
    ///
    /// Eight and sixteen bit files are decoded from sRGB, the others are linear already.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read, [`Error::HostMemory`] if it cannot be held, [`Error::Image`] if it is
    /// broken or none of the above.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(Error::io(path))?;
        let check = |bytes| memory::check(bytes, &path.display().to_string(), "a smaller picture needs less");
        if bytes.starts_with(b"PF") || bytes.starts_with(b"Pf") {
            let channels = if bytes[1] == b'F' { 3 } else { 1 };
            check(3 * bytes.len() as u64 / channels)?;
            return pfm::decode(&bytes).map_err(|problem| Error::Image { path: path.into(), problem });
        }
        let broken = |problem: String| Error::Image { path: path.into(), problem };
        let open = || ImageReader::new(Cursor::new(&bytes)).with_guessed_format().map_err(Error::io(path));
        let Some(format @ (ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::Hdr | ImageFormat::OpenExr)) =
            open()?.format()
        else {
            return Err(broken("not a PNG, JPEG, HDR, EXR or PFM image".into()));
        };
        let (width, height) = open()?.into_dimensions().map_err(|error| broken(error.to_string()))?;
        check(u64::from(width) * u64::from(height) * DECODED_BYTES)?;
        let decoded = open()?.decode().map_err(|error| broken(error.to_string()))?;
        let linear = matches!(format, ImageFormat::Hdr | ImageFormat::OpenExr);
        Ok(if linear { Self::from_linear(decoded) } else { Self::from_srgb(decoded) })
    }

    fn from_linear(decoded: DynamicImage) -> Self {
        let rgb = decoded.into_rgb32f();
        Self { width: rgb.width(), height: rgb.height(), pixels: rgb.pixels().map(|pixel| pixel.0).collect() }
    }

    fn from_srgb(decoded: DynamicImage) -> Self {
        // Eight bits widen to sixteen without loss: v · 257.
        let rgb = decoded.into_rgb16();
        let pixels = rgb.pixels().map(|pixel| pixel.0.map(|v| srgb_decode(f32::from(v) / 65535.0))).collect();
        Self { width: rgb.width(), height: rgb.height(), pixels }
    }

    /// The image stretched to another size, bilinearly between the centres of its pixels.
    pub fn stretched(&self, width: u32, height: u32) -> Self {
        // The two pixels that lie about a position, and the share of the second.
        let about = |at: u32, size: u32, own: u32| {
            let position = ((at as f32 + 0.5) * own as f32 / size as f32 - 0.5).clamp(0.0, own as f32 - 1.0);
            let first = position as u32;
            (first as usize, (first + 1).min(own - 1) as usize, position.fract())
        };
        let columns: Vec<_> = (0..width).map(|x| about(x, width, self.width)).collect();
        let row = |y| {
            let (above, below, down) = about(y, height, self.height);
            let rows = [above, below].map(|row| &self.pixels[row * self.width as usize..]);
            let mix = |a: [f32; 3], b: [f32; 3], share: f32| -> [f32; 3] {
                std::array::from_fn(|channel| a[channel] + (b[channel] - a[channel]) * share)
            };
            columns.iter().map(move |&(left, right, along)| {
                let [upper, lower] = rows.map(|row| mix(row[left], row[right], along));
                mix(upper, lower, down)
            })
        };
        Self { width, height, pixels: (0..height).into_par_iter().flat_map_iter(row).collect() }
    }

    /// One flag a pixel: whether its brightest channel, sRGB-encoded, is at least one half.
    pub fn to_mask(&self) -> Vec<bool> {
        let half = srgb_decode(0.5);
        self.pixels.iter().map(|pixel| pixel.iter().any(|&v| v >= half)).collect()
    }
}

/// The sRGB transfer function (IEC 61966-2-1): linear to encoded, for values in 0..=1.
pub fn srgb_encode(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The inverse of [`srgb_encode`].
pub fn srgb_decode(encoded: f32) -> f32 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}
