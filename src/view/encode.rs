//! Linear images as sRGB bytes, byte for byte what `vtrace render` writes, fast enough for every frame.

use std::sync::LazyLock;

use rayon::prelude::*;

use crate::report::image::{FloatImage, srgb_encode};

/// The smallest value whose byte is `i`, and infinity at the end.
static THRESHOLDS: LazyLock<Vec<f32>> = LazyLock::new(|| {
    let smallest = |byte: u32| {
        // Values from 0 to 1 are ordered as their bits are.
        let (mut low, mut high) = (0, 1.0_f32.to_bits());
        while low < high {
            let middle = low + (high - low) / 2;
            if exact(f32::from_bits(middle)) >= byte as u8 {
                high = middle;
            } else {
                low = middle + 1;
            }
        }
        f32::from_bits(low)
    };
    (0..256).map(smallest).chain([f32::INFINITY]).collect()
});

/// For each value of the upper half of a float from 0 to 1, the byte of the smallest float that has it.
static COARSE: LazyLock<Vec<u8>> =
    LazyLock::new(|| (0..=1.0_f32.to_bits() >> 16).map(|upper| exact(f32::from_bits(upper << 16))).collect());

fn exact(linear: f32) -> u8 {
    (srgb_encode(linear) * 255.0).round() as u8
}

/// `image`, scaled by 2^`exposure`, as opaque RGBA bytes, row by row from the top; NaN is black.
pub fn rgba(image: &FloatImage, exposure: f32) -> Vec<u8> {
    let (thresholds, coarse, scale) = (&*THRESHOLDS, &*COARSE, exposure.exp2());
    let byte = |value: f32| {
        // The sign of a zero goes too.
        let value = if value.is_nan() { 0.0 } else { (value * scale).clamp(0.0, 1.0).abs() };
        let mut byte = coarse[(value.to_bits() >> 16) as usize];
        while value >= thresholds[usize::from(byte) + 1] {
            byte += 1;
        }
        byte
    };
    let mut bytes = vec![255; image.pixels.len() * 4];
    bytes
        .par_chunks_exact_mut(4)
        .with_min_len(4096)
        .zip(&image.pixels)
        .for_each(|(out, pixel)| out[..3].copy_from_slice(&pixel.map(byte)));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_is_that_of_the_exact_function() {
        let step = 1.0_f32.to_bits() / 200_000;
        let mut values: Vec<f32> = (0..=200_000).map(|i| f32::from_bits(i * step)).collect();
        values.extend([0.0, -0.0, -1.0, 1.0, 7.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN]);
        let image = FloatImage {
            width: values.len() as u32,
            height: 1,
            pixels: values.iter().map(|&v| [v; 3]).collect(),
        };
        for (bytes, value) in rgba(&image, 0.0).chunks_exact(4).zip(values) {
            let expected = exact(value.clamp(0.0, 1.0));
            assert_eq!(bytes, [expected, expected, expected, 255], "{value}");
        }
    }

    #[test]
    fn exposure_scales() {
        let image = FloatImage { width: 1, height: 1, pixels: vec![[0.1, 0.2, 0.25]] };
        let brighter = FloatImage { width: 1, height: 1, pixels: vec![[0.4, 0.8, 1.0]] };
        assert_eq!(rgba(&image, 2.0), rgba(&brighter, 0.0));
    }
}
