//! Scans the ID buffer: pixels of each face, and the faces that have any.

use std::{
    ops::Range,
    sync::atomic::{AtomicU32, Ordering},
};

use rayon::prelude::*;

use crate::constants::{CODE_SHADOW, CODE_VT};

/// Pixels that one task scans: a few dozen microseconds of work.
const PIXELS_PER_TASK: usize = 1 << 14;
/// Pixels compared at once; the compiler turns a block into a few vector instructions.
const BLOCK: usize = 16;

/// Faces that own pixels, and how many.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct VisibleFaces {
    /// Number of pixels of each face of the scene.
    pub pixels_per_face: Vec<u32>,
    /// Faces with at least one pixel, ascending: VT objects and shadow receivers.
    pub visible: Vec<u32>,
    /// Pixels on specular VT objects.
    pub vt_pixels: u64,
    /// Pixels on shadow receivers.
    pub shadow_pixels: u64,
}

impl VisibleFaces {
    /// Sets everything from `counts`, the pixels of each face; `vt` and `shadow` are the faces of the two classes.
    pub fn set_counts(&mut self, counts: &[u32], vt: &[Range<u32>], shadow: &[Range<u32>]) {
        let pixels = |faces: &[Range<u32>]| {
            let counts = faces.iter().flat_map(|faces| &counts[faces.start as usize..faces.end as usize]);
            counts.map(|&count| u64::from(count)).sum()
        };
        (self.vt_pixels, self.shadow_pixels) = (pixels(vt), pixels(shadow));
        self.pixels_per_face.clear();
        self.pixels_per_face.extend_from_slice(counts);
        self.list_visible();
    }

    fn list_visible(&mut self) {
        self.visible.clear();
        let counted = (0..).zip(&self.pixels_per_face).filter(|(_, count)| **count > 0);
        self.visible.extend(counted.map(|(face, _)| face));
    }
}

/// How many of the `visible` faces, ascending, lie in these ranges.
pub fn visible_in(visible: &[u32], ranges: &[Range<u32>]) -> usize {
    let before = |end: u32| visible.partition_point(|&face| face < end);
    ranges.iter().map(|range| before(range.end) - before(range.start)).sum()
}

/// The ID buffer, row by row from the top; borrowed from where it was read back to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct IdImage<'a> {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Face + 1 in the low 24 bits (0: none), code in the high 8.
    pub pixels: &'a [u32],
}

impl IdImage<'_> {
    /// The face at pixel (`x`, `y`); `None` on the background and on occluders.
    pub fn face(&self, x: u32, y: u32) -> Option<u32> {
        (self.pixel(x, y) & 0xff_ffff).checked_sub(1)
    }

    /// The primary-face code at pixel (`x`, `y`).
    pub fn code(&self, x: u32, y: u32) -> u8 {
        (self.pixel(x, y) >> 24) as u8
    }

    fn pixel(&self, x: u32, y: u32) -> u32 {
        self.pixels[y as usize * self.width as usize + x as usize]
    }
}

/// Counters that are kept from scan to scan.
#[derive(Debug, Default)]
pub struct Scanner {
    counts: Vec<AtomicU32>,
}

impl Scanner {
    /// Counts the pixels of each of `faces` faces in the ID buffer `pixels` into `result`.
    ///
    /// The result does not depend on the number of threads: sums of integers commute.
    pub fn scan(&mut self, pixels: &[u32], faces: usize, result: &mut VisibleFaces) {
        self.counts.resize_with(faces, AtomicU32::default);
        let counts = &self.counts;
        let (vt_pixels, shadow_pixels) = pixels
            .par_chunks(PIXELS_PER_TASK)
            .map(|chunk| {
                let mut sums = (0, 0);
                for_each_run(chunk, |pixel, length| {
                    match pixel >> 24 {
                        CODE_VT => sums.0 += u64::from(length),
                        CODE_SHADOW => sums.1 += u64::from(length),
                        _ => {}
                    }
                    let face = (pixel & 0xff_ffff).wrapping_sub(1);
                    if let Some(count) = counts.get(face as usize) {
                        count.fetch_add(length, Ordering::Relaxed);
                    }
                });
                sums
            })
            .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        (result.vt_pixels, result.shadow_pixels) = (vt_pixels, shadow_pixels);

        // Taking the counts leaves zeros for the next scan.
        self.counts
            .par_iter_mut()
            .with_min_len(PIXELS_PER_TASK)
            .map(|count| std::mem::take(count.get_mut()))
            .collect_into_vec(&mut result.pixels_per_face);
        result.list_visible();
    }
}

/// Calls `visit` with every run of equal, non-zero pixels and its length.
fn for_each_run(pixels: &[u32], mut visit: impl FnMut(u32, u32)) {
    let (mut value, mut length) = (0, 0);
    let mut step = |pixel: u32, count: u32| {
        if pixel == value {
            length += count;
        } else {
            if value != 0 {
                visit(value, length);
            }
            (value, length) = (pixel, count);
        }
    };
    let blocks = pixels.chunks_exact(BLOCK);
    let rest = blocks.remainder();
    for block in blocks {
        let first = block[0];
        if block.iter().fold(0, |differing, &pixel| differing | (pixel ^ first)) == 0 {
            step(first, BLOCK as u32);
        } else {
            block.iter().for_each(|&pixel| step(pixel, 1));
        }
    }
    rest.iter().for_each(|&pixel| step(pixel, 1));
    step(0, 0);
    // The step above reported the last run, unless that was of zeros.
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pixel(code: u32, face: u32) -> u32 {
        code << 24 | (face + 1)
    }

    /// The plainest way to count.
    fn plain(pixels: &[u32], faces: usize) -> VisibleFaces {
        let mut result = VisibleFaces { pixels_per_face: vec![0; faces], ..VisibleFaces::default() };
        for pixel in pixels.iter().filter(|&&pixel| pixel != 0) {
            result.pixels_per_face[(pixel & 0xff_ffff) as usize - 1] += 1;
            match pixel >> 24 {
                CODE_VT => result.vt_pixels += 1,
                _ => result.shadow_pixels += 1,
            }
        }
        result.visible =
            (0..faces as u32).filter(|&face| result.pixels_per_face[face as usize] > 0).collect();
        result
    }

    #[test]
    fn counts_like_the_plain_way() {
        let mut scanner = Scanner::default();
        let mut result = VisibleFaces::default();
        let mut state = 1_u32;
        // Lengths around the block and task sizes; the same scanner again and again.
        for length in [0, 1, 15, 16, 17, 1000, PIXELS_PER_TASK, 3 * PIXELS_PER_TASK + 5] {
            let faces = 50;
            let mut pixels = Vec::with_capacity(length);
            while pixels.len() < length {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let (run, face, kind) = (state >> 8 & 63, state >> 16 & 31, state >> 28 & 3);
                let value = match kind {
                    0 | 1 => 0,
                    2 => pixel(CODE_VT, face),
                    _ => pixel(CODE_SHADOW, face + 10),
                };
                pixels.extend((0..run.min((length - pixels.len()) as u32)).map(|_| value));
            }
            scanner.scan(&pixels, faces, &mut result);
            assert_eq!(result, plain(&pixels, faces), "{length} pixels");
        }
    }

    #[test]
    fn a_full_image_of_one_face() {
        let pixels = vec![pixel(CODE_VT, 6); 2 * PIXELS_PER_TASK];
        let mut result = VisibleFaces::default();
        Scanner::default().scan(&pixels, 7, &mut result);
        assert_eq!(result.visible, [6]);
        assert_eq!(result.pixels_per_face[6] as usize, pixels.len());
        assert_eq!(result.vt_pixels, pixels.len() as u64);
    }

    #[test]
    fn pixels_know_their_face() {
        let pixels = [0, pixel(CODE_SHADOW, 0), pixel(CODE_VT, 0xff_fffd)];
        let image = IdImage { width: 3, height: 1, pixels: &pixels };
        assert_eq!([0, 1, 2].map(|x| image.face(x, 0)), [None, Some(0), Some(0xff_fffd)]);
        assert_eq!([0, 1, 2].map(|x| u32::from(image.code(x, 0))), [0, CODE_SHADOW, CODE_VT]);
    }
}
