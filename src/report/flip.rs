//! LDR-ꟻLIP, the difference that a viewer sees when two images alternate.
//!
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild: "ꟻLIP: A Difference Evaluator for
//! Alternating Images", HPG 2020. Section and table numbers below are that paper's. Deviations: none
//! intended; unlike the usual tools it takes float images, without rounding to eight bits.

use std::f32::consts::PI;

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::FloatImage;

/// Pixels per degree of visual angle: a 0.7 m wide monitor of 3840 pixels, seen from 0.7 m (§6).
pub const PIXELS_PER_DEGREE: f32 = 3840.0 * (PI / 180.0);

/// Exponent of colour differences, q_c (§4.1.3).
const COLOR_EXPONENT: f32 = 0.7;
/// Fraction of the largest colour difference that is mapped to `COLOR_KNEE_VALUE`, p_c (§4.1.3).
const COLOR_KNEE: f32 = 0.4;
/// Where `COLOR_KNEE` is mapped to, p_t (§4.1.3).
const COLOR_KNEE_VALUE: f32 = 0.95;
/// Width of the feature detectors in degrees, w (§4.2.1).
const FEATURE_WIDTH: f32 = 0.082;
/// Exponent of feature differences, q_f (§4.2.2).
const FEATURE_EXPONENT: f32 = 0.5;

/// Contrast sensitivity of the achromatic, red–green and blue–yellow channels as sums of Gaussians in
/// the frequency domain: (a, b) of each term (Table 1).
const SENSITIVITY: [&[(f32, f32)]; 3] = [&[(1.0, 0.0047)], &[(1.0, 0.0053)], &[(34.1, 0.04), (13.5, 0.025)]];

/// The visible difference at each pixel, in 0..=1, of two images of one size; values are clamped to 0..=1.
///
/// # Panics
/// If the sizes differ.
pub fn error_map(reference: &FloatImage, test: &FloatImage) -> Vec<f32> {
    assert_eq!((reference.width, reference.height), (test.width, test.height), "images of one size");
    let [a, b] = [reference, test].map(Perceived::new);
    let [green, blue] = [Vec3::Y, Vec3::Z].map(|rgb| hunt_lab(relative_from_rgb() * rgb));
    let largest = hyab(green, blue).powf(COLOR_EXPONENT);
    (0..a.color.len())
        .into_par_iter()
        .map(|i| {
            let color = redistribute(hyab(a.color[i], b.color[i]).powf(COLOR_EXPONENT), largest);
            let edge = (a.edges[i] - b.edges[i]).abs();
            let point = (a.points[i] - b.points[i]).abs();
            let feature = (edge.max(point) / 2.0_f32.sqrt()).powf(FEATURE_EXPONENT);
            color.powf(1.0 - feature) // §4.3
        })
        .collect()
}

/// Compresses colour differences above the knee into the last part of 0..=1 (§4.1.3).
fn redistribute(difference: f32, largest: f32) -> f32 {
    let knee = COLOR_KNEE * largest;
    if difference < knee {
        COLOR_KNEE_VALUE / knee * difference
    } else {
        COLOR_KNEE_VALUE + (difference - knee) / (largest - knee) * (1.0 - COLOR_KNEE_VALUE)
    }
}

/// What the eye makes of one image.
struct Perceived {
    /// Hunt-adjusted L*a*b* after the contrast sensitivity filter.
    color: Vec<Vec3>,
    /// Gradient magnitude of luminance.
    edges: Vec<f32>,
    /// Magnitude of the second derivatives of luminance.
    points: Vec<f32>,
}

impl Perceived {
    fn new(image: &FloatImage) -> Self {
        let width = image.width as usize;
        let relative_from_rgb = relative_from_rgb();
        let relative: Vec<Vec3> =
            image.pixels.iter().map(|&rgb| relative_from_rgb * saturate(Vec3::from(rgb))).collect();
        let luminance: Vec<f32> = relative.iter().map(|xyz| xyz.y).collect();
        let (edges, points) = features(&luminance, width);
        Self { color: filtered_color(&relative, width), edges, points }
    }
}

fn saturate(rgb: Vec3) -> Vec3 {
    rgb.clamp(Vec3::ZERO, Vec3::ONE)
}

/// Spatial filtering in YCxCz, then Hunt-adjusted L*a*b* (§4.1.1, §4.1.2).
fn filtered_color(relative: &[Vec3], width: usize) -> Vec<Vec3> {
    let [luma, red_green, blue_yellow] = std::array::from_fn(|c| {
        let channel: Vec<f32> = relative.iter().map(|&xyz| opponent_from_relative(xyz)[c]).collect();
        let mut sum = vec![0.0; channel.len()];
        for (weight, kernel) in sensitivity_kernels(SENSITIVITY[c]) {
            let term = convolve(&channel, width, &kernel, &kernel);
            sum.par_iter_mut().zip(term).for_each(|(sum, term)| *sum += weight * term);
        }
        sum
    });
    let relative_from_rgb = relative_from_rgb();
    let rgb_from_relative = relative_from_rgb.inverse();
    (0..relative.len())
        .into_par_iter()
        .map(|i| {
            let opponent = Vec3::new(luma[i], red_green[i], blue_yellow[i]);
            let rgb = saturate(rgb_from_relative * relative_from_opponent(opponent));
            hunt_lab(relative_from_rgb * rgb)
        })
        .collect()
}

/// The spatial kernels of a sum of Gaussians a·exp(−b f²), each normalised, with its weight (Equation 4).
///
/// All channels use the radius of the widest term, three standard deviations.
fn sensitivity_kernels(terms: &[(f32, f32)]) -> Vec<(f32, Vec<f32>)> {
    let widest = SENSITIVITY.iter().copied().flatten().map(|term| term.1).fold(0.0, f32::max);
    let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
    let unnormalised: Vec<(f32, Vec<f32>)> = terms
        .iter()
        .map(|&(a, b)| {
            let gaussian = |x: i32| (-PI * PI / b * (x as f32 / PIXELS_PER_DEGREE).powi(2)).exp();
            (a * (PI / b).sqrt(), (-radius..=radius).map(gaussian).collect())
        })
        .collect();
    let volume = |(a, kernel): &(f32, Vec<f32>)| a * kernel.iter().sum::<f32>().powi(2);
    let total: f32 = unnormalised.iter().map(volume).sum();
    unnormalised
        .into_iter()
        .map(|term| {
            let sum: f32 = term.1.iter().sum();
            (volume(&term) / total, term.1.iter().map(|w| w / sum).collect())
        })
        .collect()
}

/// Magnitudes of the first and second Gaussian derivatives of luminance (§4.2.1).
fn features(luminance: &[f32], width: usize) -> (Vec<f32>, Vec<f32>) {
    let sigma = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE;
    let radius = (3.0 * sigma).ceil() as i32;
    let gaussian = |x: i32| (-(x as f32).powi(2) / (2.0 * sigma * sigma)).exp();
    let smooth = balanced((-radius..=radius).map(gaussian).collect());
    let first = balanced((-radius..=radius).map(|x| -(x as f32) * gaussian(x)).collect());
    let second =
        balanced((-radius..=radius).map(|x| ((x as f32 / sigma).powi(2) - 1.0) * gaussian(x)).collect());
    let magnitude = |derivative: &[f32]| -> Vec<f32> {
        let across = convolve(luminance, width, derivative, &smooth);
        let down = convolve(luminance, width, &smooth, derivative);
        across.par_iter().zip(down).map(|(&x, y)| x.hypot(y)).collect()
    };
    (magnitude(&first), magnitude(&second))
}

/// Scales positive weights to a sum of 1 and negative ones to −1.
fn balanced(mut kernel: Vec<f32>) -> Vec<f32> {
    let positive: f32 = kernel.iter().filter(|w| **w > 0.0).sum();
    let negative: f32 = -kernel.iter().filter(|w| **w < 0.0).sum::<f32>();
    for weight in &mut kernel {
        *weight /= if *weight > 0.0 { positive } else { negative.max(f32::MIN_POSITIVE) };
    }
    kernel
}

/// Separable convolution of one channel, its border repeated outwards.
fn convolve(channel: &[f32], width: usize, across: &[f32], down: &[f32]) -> Vec<f32> {
    let radius = across.len() / 2;
    let mut rows = vec![0.0; channel.len()];
    rows.par_chunks_mut(width).zip(channel.par_chunks(width)).for_each(|(out, row)| {
        let mut padded = vec![row[0]; radius];
        padded.extend_from_slice(row);
        padded.resize(width + 2 * radius, row[width - 1]);
        for (k, &weight) in across.iter().rev().enumerate() {
            accumulate(out, weight, &padded[k..]);
        }
    });
    let height = channel.len() / width;
    let mut result = vec![0.0; channel.len()];
    result.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for (k, &weight) in down.iter().rev().enumerate() {
            let source = (y + k).saturating_sub(radius).min(height - 1);
            accumulate(out, weight, &rows[source * width..]);
        }
    });
    result
}

fn accumulate(out: &mut [f32], weight: f32, values: &[f32]) {
    for (out, value) in out.iter_mut().zip(values) {
        *out += weight * value;
    }
}

/// Linear sRGB to XYZ, each row divided by the XYZ of white.
fn relative_from_rgb() -> Mat3 {
    let rows = [
        [10135552.0 / 24577794.0, 8788810.0 / 24577794.0, 4435075.0 / 24577794.0],
        [2613072.0 / 12288897.0, 8788810.0 / 12288897.0, 887015.0 / 12288897.0],
        [1425312.0 / 73733382.0, 8788810.0 / 73733382.0, 70074185.0 / 73733382.0_f64],
    ];
    Mat3::from_cols_array_2d(&rows.map(|row| row.map(|v| (v / row.iter().sum::<f64>()) as f32))).transpose()
}

/// The linearised L*a*b* space YCxCz (§4.1.1).
fn opponent_from_relative(xyz: Vec3) -> Vec3 {
    Vec3::new(116.0 * xyz.y - 16.0, 500.0 * (xyz.x - xyz.y), 200.0 * (xyz.y - xyz.z))
}

fn relative_from_opponent(opponent: Vec3) -> Vec3 {
    let y = (opponent.x + 16.0) / 116.0;
    Vec3::new(y + opponent.y / 500.0, y, y - opponent.z / 200.0)
}

/// L*a*b* with chroma scaled by lightness, the Hunt effect (§4.1.2).
fn hunt_lab(xyz: Vec3) -> Vec3 {
    const DELTA: f32 = 6.0 / 29.0;
    let f = |t: f32| if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 };
    let [x, y, z] = xyz.to_array().map(f);
    let lightness = 116.0 * y - 16.0;
    Vec3::new(lightness, lightness * 5.0 * (x - y), lightness * 2.0 * (y - z))
}

/// The HyAB distance: city block in lightness, Euclidean in chroma (§4.1.2).
fn hyab(p: Vec3, q: Vec3) -> f32 {
    let d = p - q;
    d.x.abs() + d.y.hypot(d.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::image::srgb_decode;

    /// A 48×40 picture of sRGB-encoded values.
    fn picture(encoded: impl Fn(u32, u32) -> [f32; 3]) -> FloatImage {
        FloatImage::from_fn(48, 40, |x, y| encoded(x, y).map(srgb_decode))
    }

    fn mean(a: &FloatImage, b: &FloatImage) -> f64 {
        let map = error_map(a, b);
        map.iter().map(|&v| f64::from(v)).sum::<f64>() / map.len() as f64
    }

    #[test]
    fn uniform_pictures_follow_the_color_pipeline_alone() {
        let pair = |a: [f32; 3], b: [f32; 3]| mean(&picture(|_, _| a), &picture(|_, _| b));
        assert!(pair([0.3, 0.6, 0.9], [0.3, 0.6, 0.9]) == 0.0);
        // The largest difference there is, by definition of its normalisation.
        assert!((pair([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]) - 1.0).abs() < 1e-5);
        // Black to white is HyAB 100: 0.95 + 0.05 (100^0.7 − 0.4 c)/(0.6 c), c = 41.2760 for green to blue.
        assert!((pair([0.0; 3], [1.0; 3]) - 0.967_388).abs() < 1e-5);
    }

    /// Means of the authors' own tool (flip-evaluator 1.7, float input) for the same pictures.
    #[test]
    fn patterns_agree_with_the_authors_tool() {
        let noise = |x: u32, y: u32| {
            let of = |value: u32, modulus: u32| (value % modulus) as f32 / (modulus - 1) as f32;
            [of(x * 7 + y * 13, 32), of(x * x + 3 * y, 29), of(5 * x + y * y, 23)]
        };
        let checker =
            |x: u32, y: u32| if (x / 6 + y / 6) % 2 == 1 { [1.0, 0.9, 0.8] } else { [0.1, 0.15, 0.2] };
        let line = |x: u32, _: u32| if x == 20 { [1.0; 3] } else { [0.3; 3] };
        let ramp = |x: u32, y: u32, shift: f32| [(x as f32 / 47.0 + shift).min(1.0), y as f32 / 39.0, 0.5];
        for (name, a, b, expected) in [
            ("noise", picture(noise), picture(|x, y| noise(x + 1, y + 2)), 0.440_688),
            ("checker", picture(checker), picture(|x, y| checker(x + 1, y)), 0.346_255),
            ("line", picture(line), picture(|_, _| [0.3; 3]), 0.076_815),
            ("ramp", picture(|x, y| ramp(x, y, 0.0)), picture(|x, y| ramp(x, y, 0.02)), 0.074_444),
        ] {
            let flip = mean(&a, &b);
            assert!((flip - expected).abs() < 2e-5, "{name}: {flip}, the authors' tool says {expected}");
        }
    }
}
