//! Smooth edges: pixels of the finished picture that differ from one beside it are traced again, at several points (Whitted
//! 1980), in rounds: only where samples of a pixel still differ, more of them are taken.

use std::sync::atomic::{AtomicBool, Ordering};

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::memory;
use crate::report::image::FloatImage;
use crate::scene::View;
use crate::trace::eye::ViewRays;
use crate::trace::{Rays, Settings, Tracer};

/// Side of the squares of pixels whose samples are traced together.
const TILE: usize = 16;

/// Where in a pixel its samples lie, in 64ths of its sides less a half. A (0, 2)-sequence in base 2, Owen-scrambled: the first
/// 4, 16 and 64 fall into different boxes of every shape with as many to the pixel, so that an edge along an axis moves
/// through as many shades. The first is where the pixel was drawn; of 60,000 scramblings that have it there, one whose first
/// 4 and 16 are centred and lie far apart.
#[rustfmt::skip]
const PATTERN: [[u8; 2]; 64] = [
    [32, 32], [8, 31], [55, 9], [27, 56], [41, 23], [2, 42], [61, 54], [16, 1],
    [36, 4], [13, 50], [50, 46], [29, 17], [45, 60], [7, 14], [58, 26], [20, 37],
    [35, 28], [10, 35], [52, 58], [24, 10], [43, 40], [1, 20], [62, 2], [18, 52],
    [39, 48], [15, 7], [49, 18], [31, 45], [47, 12], [5, 63], [57, 38], [22, 24],
    [33, 11], [9, 59], [54, 34], [26, 29], [40, 53], [3, 3], [60, 21], [17, 41],
    [37, 44], [12, 19], [51, 6], [28, 49], [44, 25], [6, 39], [59, 62], [21, 13],
    [34, 57], [11, 8], [53, 30], [25, 33], [42, 0], [0, 55], [63, 43], [19, 22],
    [38, 16], [14, 47], [48, 51], [30, 5], [46, 36], [4, 27], [56, 15], [23, 61],
];

/// What sends a pixel into a round; differences are of any channel, as [`code`] has it.
enum Sign {
    /// It was drawn as different from a pixel beside it as this.
    Differs(u8),
    /// Its samples are so far apart, or those of a pixel beside it: what is smaller than a pixel may lie between its own.
    Apart { own: u8, beside: u8 },
}

/// Rounds: how many samples a pixel has after each, and why it goes there (docs/speed.md).
const ROUNDS: [(usize, Sign); 3] = [
    (4, Sign::Differs(12)),
    (16, Sign::Apart { own: 40, beside: 64 }),
    (64, Sign::Apart { own: 60, beside: 90 }),
];

/// Which pixels are traced again, and how.
#[derive(Clone, Copy)]
pub struct Smoothing<'a> {
    /// What traces them.
    pub tracer: &'a Tracer<'a>,
    /// How it does.
    pub settings: &'a Settings,
    /// The view.
    pub view: &'a View,
    /// Most samples of a pixel: 4, 16 or 64.
    pub most: usize,
    /// Whether specular objects that are BLEND, too, were drawn whole.
    pub whole: bool,
    /// Ends the work once it is set.
    pub interrupt: &'a AtomicBool,
}

impl Smoothing<'_> {
    /// Smooths `image`, of the view's size; the rays that it took. The same for any number of threads.
    ///
    /// # Errors
    /// [`Error::Interrupted`]; [`Error::HostMemory`].
    pub fn apply(&self, image: &mut FloatImage) -> Result<Rays> {
        memory::check_picture(image.width, image.height, 5)?;
        let width = image.width as usize;
        let pixels = image.pixels.par_iter().with_min_len(width);
        let drawn: Vec<u8> = pixels.flat_map_iter(|pixel| pixel.map(code)).collect();
        // Of each pixel: how far its samples are apart.
        let mut spread = vec![0_u8; image.pixels.len()];
        let mut bands: Vec<Band> =
            image.pixels.chunks(TILE * width).map(|band| Band::new(band.len())).collect();
        let mut total = Rays::default();
        for (most, sign) in ROUNDS.iter().take_while(|(most, _)| *most <= self.most) {
            let before = spread.clone();
            let parts = image.pixels.par_chunks_mut(TILE * width).zip(spread.par_chunks_mut(TILE * width));
            let rays = parts.zip(&mut bands).enumerate().map(|(index, (pixels, band))| {
                let top = index * TILE;
                let mut chosen = vec![false; pixels.0.len()];
                for (row, chosen) in chosen.chunks_mut(width).enumerate() {
                    match *sign {
                        Sign::Differs(by) => mark_different(&drawn, 3 * width, top + row, by, chosen),
                        Sign::Apart { own, beside } => {
                            mark_apart(&before, width, top + row, [own, beside], chosen);
                        }
                    }
                }
                self.sample_band(top, *most, &chosen, band, pixels)
            });
            total += rays.try_reduce(Rays::default, |one, other| Ok(one + other))?;
        }
        Ok(total)
    }

    /// Gives the `chosen` pixels, rows from `top` on, `most` samples.
    fn sample_band(
        &self,
        top: usize,
        most: usize,
        chosen: &[bool],
        band: &mut Band,
        (pixels, spread): (&mut [[f32; 3]], &mut [u8]),
    ) -> Result<Rays> {
        let view = self.view;
        let width = view.width as usize;
        let mut rays = ViewRays::new(self.tracer, self.settings, true).of_whole(self.whole);
        let mut places = Vec::new();
        for left in (0..width).step_by(TILE) {
            if self.interrupt.load(Ordering::Relaxed) {
                return Err(Error::Interrupted);
            }
            let columns = left..(left + TILE).min(width);
            let tile = (0..pixels.len()).step_by(width).flat_map(|row| columns.clone().map(move |x| row + x));
            places.extend(tile.filter(|&place| chosen[place]));
            for &place in &places {
                let corner = Vec2::new((place % width) as f32, (top + place / width) as f32);
                for &[x, y] in PATTERN.iter().take(most).skip(band.of(place, pixels[place]).count) {
                    let inside = (Vec2::new(x.into(), y.into()) + 0.5) / PATTERN.len() as f32;
                    rays.add(view.ray(corner + inside));
                }
            }
            let mut radiances = rays.radiances().iter();
            for place in places.drain(..) {
                let samples = band.of(place, pixels[place]);
                for &radiance in radiances.by_ref().take(most - samples.count) {
                    samples.add(radiance);
                }
                pixels[place] = (samples.sum / most as f32).to_array();
                spread[place] = samples.spread();
            }
        }
        Ok(rays.rays())
    }
}

/// The sampled pixels of some rows.
struct Band {
    samples: Vec<PixelSamples>,
    /// By pixel: one more than where it is among them, or 0.
    entries: Vec<u32>,
}

impl Band {
    fn new(pixels: usize) -> Self {
        Self { samples: Vec::new(), entries: vec![0; pixels] }
    }

    /// The samples of a pixel.
    fn of(&mut self, place: usize, drawn: [f32; 3]) -> &mut PixelSamples {
        let entry = &mut self.entries[place];
        if *entry == 0 {
            let mut samples = PixelSamples::default();
            samples.add(drawn.into());
            self.samples.push(samples);
            *entry = self.samples.len() as u32;
        }
        &mut self.samples[*entry as usize - 1]
    }
}

/// The samples of a pixel so far.
struct PixelSamples {
    count: usize,
    /// Of radiances.
    sum: Vec3,
    /// Least and greatest radiance, by channel.
    range: [Vec3; 2],
}

impl Default for PixelSamples {
    fn default() -> Self {
        Self { count: 0, sum: Vec3::ZERO, range: [Vec3::INFINITY, Vec3::NEG_INFINITY] }
    }
}

impl PixelSamples {
    fn add(&mut self, radiance: Vec3) {
        let [low, high] = &mut self.range;
        self.count += 1;
        self.sum += radiance;
        (*low, *high) = (low.min(radiance), high.max(radiance));
    }

    /// How far they are apart: the most of any channel, as [`code`] has it.
    fn spread(&self) -> u8 {
        let [low, high] = self.range.map(|end| end.to_array().map(code));
        low.into_iter().zip(high).map(|(low, high)| high - low).max().unwrap_or(0)
    }
}

/// A channel about as displays encode it: the square root of what is not above 1.
fn code(channel: f32) -> u8 {
    (channel.clamp(0.0, 1.0).sqrt() * 255.0) as u8
}

/// The row `y` of `rows`, and those above and below.
fn around(rows: &[u8], stride: usize, y: usize) -> [&[u8]; 3] {
    let last = rows.len() / stride - 1;
    [y.saturating_sub(1), y, (y + 1).min(last)].map(|y| &rows[y * stride..(y + 1) * stride])
}

/// Marks the pixels of row `y` that differ from one of the eight around them by more than `by`; `codes` are rows of `stride`
/// bytes, three a pixel.
fn mark_different(codes: &[u8], stride: usize, y: usize, by: u8, chosen: &mut [bool]) {
    let [above, own, below] = around(codes, stride, y);
    let ends = |i: usize| {
        let (a, b, c) = (above[i], own[i], below[i]);
        (a.min(b).min(c), a.max(b).max(c))
    };
    for (x, chosen) in chosen.iter_mut().enumerate() {
        *chosen = (3 * x..3 * x + 3).any(|i| {
            let left = ends(if i >= 3 { i - 3 } else { i });
            let right = ends(if i + 3 < stride { i + 3 } else { i });
            let (low, high) = ends(i);
            let (low, high) = (low.min(left.0).min(right.0), high.max(left.1).max(right.1));
            (own[i] - low).max(high - own[i]) > by
        });
    }
}

/// Marks the pixels of row `y` whose samples are farther apart than the first limit, or those of one of the eight around
/// them than the second; `spread` are rows of `width` pixels.
fn mark_apart(spread: &[u8], width: usize, y: usize, [limit, beside]: [u8; 2], chosen: &mut [bool]) {
    let [above, own, below] = around(spread, width, y);
    let highest = |x: usize| above[x].max(own[x]).max(below[x]);
    for (x, chosen) in chosen.iter_mut().enumerate() {
        let most = highest(x.saturating_sub(1)).max(highest(x)).max(highest((x + 1).min(width - 1)));
        *chosen = own[x] > limit || most > beside;
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn samples_are_spread_at_every_number() {
        assert_eq!(PATTERN[0], [32, 32], "where the pixel was drawn");
        for (count, _) in ROUNDS {
            for columns in (0..=count.ilog2()).map(|power| 1 << power) {
                let boxes = [columns, count / columns];
                let taken = PATTERN[..count].iter();
                let taken = taken.map(|at| [0, 1].map(|axis| usize::from(at[axis]) * boxes[axis] / 64));
                assert_eq!(taken.collect::<HashSet<_>>().len(), count, "{count} in {boxes:?}");
            }
        }
    }

    #[test]
    fn differences_are_seen_from_both_sides() {
        #[rustfmt::skip]
        let grey: [u8; 18] = [
            60, 60, 65, 90, 90, 60,
            60, 60, 65, 90, 90, 60,
            60, 60, 60, 60, 60, 60,
        ];
        let codes: Vec<u8> = grey.into_iter().flat_map(|grey| [7, grey, 7]).collect();
        let chosen = |y: usize| {
            let mut chosen = [false; 6];
            mark_different(&codes, 18, y, 20, &mut chosen);
            chosen
        };
        assert_eq!(chosen(0), [false, false, true, true, true, true]);
        assert_eq!(chosen(1), [false, false, true, true, true, true]);
        assert_eq!(chosen(2), [false, false, true, true, true, true]);
    }

    #[test]
    fn what_samples_find_is_looked_for_around_them() {
        let spread = [0, 0, 30, 0, 0, 0, 0, 0, 0, 0, 0, 80];
        let mut chosen = [false; 6];
        mark_apart(&spread, 6, 0, [20, 70], &mut chosen);
        assert_eq!(chosen, [false, false, true, false, true, true]);
    }
}
