//! Supersampling: the same leaves drawn again for every sub-sample of a pixel, no ray added (design §5).

use rayon::prelude::*;

use super::drawn::Drawn;
use super::frame_block::FrameBlock;
use super::passes::{ColorPass, Drawing, Painter};
use crate::error::Result;
use crate::report::FloatImage;

/// Draws a frame with `shaded` samples a pixel, on the regular grid that the reference tracer uses too.
///
/// Returns what was recorded and, for more than one sample, the mean image; a single one stays with the
/// painter.
///
/// # Errors
/// No device memory left; a lost device.
pub fn draw(
    painter: &mut Painter,
    block: &FrameBlock,
    leaves: Option<&Drawn>,
    passes: &[ColorPass],
    shaded: u32,
) -> Result<(Vec<Drawing>, Option<FloatImage>)> {
    if shaded <= 1 {
        return Ok((painter.draw(block, leaves, passes)?, None));
    }
    let mut drawings: Vec<Drawing> = Vec::new();
    let mut sum: Option<FloatImage> = None;
    for (x, y) in grid(shaded) {
        let drawn = painter.draw(&block.jittered(-x, -y), leaves, passes)?;
        for (index, drawing) in drawn.into_iter().enumerate() {
            match drawings.get_mut(index) {
                Some(total) => total.ms += drawing.ms,
                None => drawings.push(drawing),
            }
        }
        let image = painter.read_image()?;
        match &mut sum {
            None => sum = Some(image),
            Some(sum) => sum.pixels.par_iter_mut().zip(&image.pixels).for_each(|(sum, pixel)| {
                for (sum, value) in sum.iter_mut().zip(pixel) {
                    *sum += value;
                }
            }),
        }
    }
    if let Some(sum) = &mut sum {
        let scale = 1.0 / shaded as f32;
        sum.pixels.par_iter_mut().flatten().for_each(|value| *value *= scale);
    }
    Ok((drawings, sum))
}

/// Offsets of a square number of samples from the pixel's centre, in pixels.
fn grid(samples: u32) -> impl Iterator<Item = (f32, f32)> {
    let side = samples.isqrt();
    let offset = move |i: u32| (i as f32 + 0.5) / side as f32 - 0.5;
    (0..side * side).map(move |i| (offset(i % side), offset(i / side)))
}
