//! Supersampling: the same leaves shaded for every sub-sample of a pixel, no ray added (design §5).
//!
//! Four are shaded in one draw of twice the width and height, whose means the device takes: vertices are looked at
//! once, and triangles are large. More are several such draws, each moved by a part of a pixel; so are four where images of
//! that size are more than the device has, or than is reasonable.

use rayon::prelude::*;

use super::drawn::Drawn;
use super::frame_block::FrameBlock;
use super::passes::{ColorPass, Drawing, Painter};
use crate::error::Result;
use crate::report::FloatImage;

/// Draws a frame with `shaded` samples a pixel, on the regular grid that the reference tracer uses too.
///
/// Returns what was recorded and, of several draws, the mean image; that of a single one stays with the
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
    let halved = if shaded.is_multiple_of(4) { painter.halved(block) } else { None };
    let block = halved.unwrap_or(*block);
    let moves = moves(shaded, block.halvings);
    if moves.len() == 1 {
        return Ok((painter.draw(&block, leaves, passes)?, None));
    }
    let mut drawings: Vec<Drawing> = Vec::new();
    let mut sum: Option<FloatImage> = None;
    for &(x, y) in &moves {
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
        let scale = 1.0 / moves.len() as f32;
        sum.pixels.par_iter_mut().flatten().for_each(|value| *value *= scale);
    }
    Ok((drawings, sum))
}

/// By how much draws of `1 << halvings` fragments along a pixel's side are moved, in pixels, so that together their
/// fragments are the regular grid of `samples`, a square number.
fn moves(samples: u32, halvings: u32) -> Vec<(f32, f32)> {
    let side = samples.isqrt() >> halvings;
    let fragment = 1.0 / (1 << halvings) as f32;
    let offset = move |i: u32| ((i as f32 + 0.5) / side as f32 - 0.5) * fragment;
    (0..side * side).map(move |i| (offset(i % side), offset(i / side))).collect()
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::trace::reference::sample_pattern;

    #[test]
    fn draws_of_any_fineness_shade_the_grid_of_the_reference() {
        for (samples, halvings) in [(1, 0), (4, 0), (4, 1), (16, 0), (16, 1)] {
            let across = 1 << halvings;
            let fragment = |i: u32| (i as f32 + 0.5) / across as f32;
            let mut shaded: Vec<Vec2> = moves(samples, halvings)
                .into_iter()
                .flat_map(|(x, y)| {
                    (0..across * across)
                        .map(move |i| Vec2::new(fragment(i % across) + x, fragment(i / across) + y))
                })
                .collect();
            shaded.sort_by(|a, b| a.y.total_cmp(&b.y).then(a.x.total_cmp(&b.x)));
            assert_eq!(shaded, sample_pattern(samples), "{samples} samples, {halvings} halvings");
        }
    }
}
