//! The difference between two images in numbers.

use std::cell::OnceCell;

use rayon::prelude::*;
use serde::Serialize;

use super::{FloatImage, flip, image::srgb_encode};
use crate::error::{Error, Result};
use crate::memory;

/// Which values are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Encoding {
    /// sRGB-encoded, as a display shows them.
    #[default]
    Srgb,
    /// Linear.
    Linear,
}

/// How far two images differ, over all compared pixels, their values clamped to 0..=1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Comparison {
    /// Root mean square difference over pixels and channels.
    pub rmse: f64,
    /// Peak signal-to-noise ratio in dB, −20 log₁₀ `rmse`; `None` for identical images.
    pub psnr: Option<f64>,
    /// Mean LDR-ꟻLIP, 0 (same) to 1; see [`flip`].
    pub flip: f64,
    /// 99th percentile over pixels of the largest channel difference, interpolated between ranks.
    pub p99: f64,
    /// Largest channel difference.
    pub max: f64,
    /// Fraction of pixels whose largest channel difference exceeds 0.1.
    pub over_0_1: f64,
}

/// Compares `b` with the reference `a`, where `mask` is set or everywhere.
///
/// ꟻLIP looks at the whole images, since it models how the eye blurs them, and is averaged over the
/// mask; it does not depend on `encoding`.
///
/// # Errors
/// [`Error::Compare`] if the sizes differ, if no pixel is left to compare, or if a compared pixel is NaN.
pub fn compare(
    a: &FloatImage,
    b: &FloatImage,
    mask: Option<&[bool]>,
    encoding: Encoding,
) -> Result<Comparison> {
    Differences::new(a, b)?.over(mask, encoding)
}

/// Bytes that a pixel takes while it is compared, beside those of the images: most of them ꟻLIP's.
const COMPARED_BYTES: u64 = 80;

/// Two images of one size, to be compared over several regions.
pub struct Differences<'i> {
    a: &'i FloatImage,
    b: &'i FloatImage,
    /// ꟻLIP of the whole images, made when first asked for.
    flip: OnceCell<Vec<f32>>,
}

impl<'i> Differences<'i> {
    /// Between `b` and the reference `a`.
    ///
    /// # Errors
    /// [`Error::Compare`] if the sizes differ; [`Error::HostMemory`].
    pub fn new(a: &'i FloatImage, b: &'i FloatImage) -> Result<Self> {
        if (a.width, a.height) != (b.width, b.height) {
            return Err(Error::Compare(format!(
                "images differ in size: {}x{} and {}x{}",
                a.width, a.height, b.width, b.height
            )));
        }
        let object = format!("comparing pictures of {}x{}", a.width, a.height);
        memory::check(a.pixels.len() as u64 * COMPARED_BYTES, &object, "smaller pictures need less")?;
        Ok(Self { a, b, flip: OnceCell::new() })
    }

    /// How far they differ where `mask` is set, or everywhere; see [`compare`].
    ///
    /// # Errors
    /// As for [`compare`].
    pub fn over(&self, mask: Option<&[bool]>, encoding: Encoding) -> Result<Comparison> {
        let flip = || self.flip.get_or_init(|| flip::error_map(self.a, self.b)).as_slice();
        measure(self.a, self.b, flip, mask, encoding)
    }
}

fn measure<'f>(
    a: &FloatImage,
    b: &FloatImage,
    flip: impl FnOnce() -> &'f [f32],
    mask: Option<&[bool]>,
    encoding: Encoding,
) -> Result<Comparison> {
    if let Some(mask) = mask.filter(|mask| mask.len() != a.pixels.len()) {
        return Err(Error::Compare(format!(
            "mask has {} pixels, the images {} ({}x{})",
            mask.len(),
            a.pixels.len(),
            a.width,
            a.height
        )));
    }
    let chosen: Vec<usize> = (0..a.pixels.len()).filter(|&i| mask.is_none_or(|mask| mask[i])).collect();
    if chosen.is_empty() {
        return Err(Error::Compare("no pixel to compare: the mask is empty".into()));
    }
    for (which, image) in [("first", a), ("second", b)] {
        if let Some((x, y)) = first_nan(image, mask) {
            return Err(Error::Compare(format!("pixel ({x}, {y}) of the {which} image is NaN")));
        }
    }

    let encode = |v: f32| match encoding {
        Encoding::Srgb => f64::from(srgb_encode(v.clamp(0.0, 1.0))),
        Encoding::Linear => f64::from(v.clamp(0.0, 1.0)),
    };
    let differences: Vec<[f64; 3]> = chosen
        .par_iter()
        .map(|&i| std::array::from_fn(|c| (encode(a.pixels[i][c]) - encode(b.pixels[i][c])).abs()))
        .collect();
    // Summed in pixel order, so that the last digit does not depend on the number of threads.
    let squares: f64 = differences.iter().flatten().map(|d| d * d).sum();
    let rmse = (squares / (3 * chosen.len()) as f64).sqrt();
    let mut largest: Vec<f64> = differences.iter().map(|d| d[0].max(d[1]).max(d[2])).collect();
    largest.par_sort_unstable_by(f64::total_cmp);
    let over = largest.len() - largest.partition_point(|&d| d <= 0.1);

    let map = flip();
    let flip = chosen.iter().map(|&i| f64::from(map[i])).sum::<f64>() / chosen.len() as f64;
    Ok(Comparison {
        rmse,
        psnr: (rmse > 0.0).then(|| -20.0 * rmse.log10()),
        flip,
        p99: quantile(&largest, 0.99),
        max: largest[largest.len() - 1],
        over_0_1: over as f64 / largest.len() as f64,
    })
}

/// Column and row of the first pixel that is NaN, where `mask` is set or everywhere: no image with one can be compared.
pub fn first_nan(image: &FloatImage, mask: Option<&[bool]>) -> Option<(usize, usize)> {
    let is_nan = |i: &usize| image.pixels[*i].iter().any(|v| v.is_nan());
    let i = (0..image.pixels.len()).filter(|&i| mask.is_none_or(|mask| mask[i])).find(is_nan)?;
    Some((i % image.width as usize, i / image.width as usize))
}

/// Linear interpolation between the two nearest ranks of `sorted`, which is not empty.
fn quantile(sorted: &[f64], q: f64) -> f64 {
    let rank = q * (sorted.len() - 1) as f64;
    let low = sorted[rank.floor() as usize];
    let high = sorted[rank.ceil() as usize];
    low + (high - low) * rank.fract()
}
