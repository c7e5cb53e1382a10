//! Scans the ID buffer: pixels of each face, and the faces that have any.

use std::ops::Range;

use rayon::prelude::*;

use crate::constants::{CODE_SHADOW, CODE_VT};

/// Fewest pixels that are worth a task of their own: a few dozen microseconds of work.
const PIXELS_PER_TASK: usize = 1 << 14;
/// Counters that all tasks together may have, 4 bytes each; scenes with more faces get fewer tasks.
const MOST_COUNTERS: usize = 1 << 25;
/// Pixels compared at once; the compiler turns a block into a few vector instructions.
const BLOCK: usize = 16;
/// A bit for each of them.
const BITS: [u32; BLOCK] = {
    let mut bits = [0; BLOCK];
    let mut i = 0;
    while i < BLOCK {
        bits[i] = 1 << i;
        i += 1;
    }
    bits
};
/// With fewer than one visible face in so many, only those are looked at, and sorted, instead of all faces.
const SPARSE: usize = 16;

/// Faces that own pixels, and how many.
///
/// Kept from frame to frame: only what the last frame touched is reset, so that a frame costs nothing for
/// faces that it does not see.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct VisibleFaces {
    /// Number of pixels of each face of the scene: above 0 for those in `visible` and no other.
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

    /// Sets everything from what the tasks counted, and leaves their counts 0.
    fn set_sums(&mut self, partials: &mut [Partial], faces: usize) {
        self.vt_pixels = partials.iter_mut().map(|partial| std::mem::take(&mut partial.vt_pixels)).sum();
        self.shadow_pixels =
            partials.iter_mut().map(|partial| std::mem::take(&mut partial.shadow_pixels)).sum();
        let touched: usize = partials.iter().map(|partial| partial.touched.len()).sum();
        if touched * SPARSE < faces && self.pixels_per_face.len() == faces {
            self.add_touched(partials);
        } else {
            self.add_all(partials, faces);
        }
    }

    fn add_touched(&mut self, partials: &mut [Partial]) {
        for face in self.visible.drain(..) {
            self.pixels_per_face[face as usize] = 0;
        }
        for Partial { counts, touched, .. } in partials {
            for face in touched.drain(..) {
                let count = &mut self.pixels_per_face[face as usize];
                if *count == 0 {
                    self.visible.push(face);
                }
                *count += std::mem::take(&mut counts[face as usize]);
            }
        }
        self.visible.sort_unstable();
    }

    fn add_all(&mut self, partials: &mut [Partial], faces: usize) {
        self.pixels_per_face.clear();
        self.pixels_per_face.resize(faces, 0);
        for Partial { counts, touched, .. } in partials {
            touched.clear();
            let counts = counts.par_iter_mut().with_min_len(PIXELS_PER_TASK);
            self.pixels_per_face
                .par_iter_mut()
                .zip(counts)
                .for_each(|(sum, count)| *sum += std::mem::take(count));
        }
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
    partials: Vec<Partial>,
}

/// What one task counted.
#[derive(Debug, Default)]
struct Partial {
    /// Pixels of each face; 0 for all but the `touched` ones.
    counts: Vec<u32>,
    touched: Vec<u32>,
    vt_pixels: u64,
    shadow_pixels: u64,
}

impl Scanner {
    /// Counts the pixels of each of `faces` faces in the ID buffer `pixels` into `result`.
    ///
    /// The result does not depend on the number of threads: sums of integers commute.
    pub fn scan(&mut self, pixels: &[u32], faces: usize, result: &mut VisibleFaces) {
        let most = (MOST_COUNTERS / faces.max(1)).clamp(1, rayon::current_num_threads());
        let tasks = (pixels.len() / PIXELS_PER_TASK).clamp(1, most);
        self.partials.resize_with(tasks, Partial::default);
        let chunks = pixels.par_chunks(pixels.len().div_ceil(tasks).max(1));
        self.partials.par_iter_mut().zip(chunks).for_each(|(partial, chunk)| partial.count(chunk, faces));
        result.set_sums(&mut self.partials, faces);
    }
}

impl Partial {
    fn count(&mut self, pixels: &[u32], faces: usize) {
        self.counts.resize(faces, 0);
        for_each_run(pixels, |pixel, length| {
            match pixel >> 24 {
                CODE_VT => self.vt_pixels += u64::from(length),
                CODE_SHADOW => self.shadow_pixels += u64::from(length),
                _ => {}
            }
            let face = (pixel & 0xff_ffff).wrapping_sub(1);
            if let Some(count) = self.counts.get_mut(face as usize) {
                if *count == 0 {
                    self.touched.push(face);
                }
                *count += length;
            }
        });
    }
}

/// Calls `visit` with every run of equal, non-zero pixels and its length.
fn for_each_run(pixels: &[u32], mut visit: impl FnMut(u32, u32)) {
    let mut start = 0;
    let mut end_run = |end: usize| {
        if pixels[start] != 0 {
            visit(pixels[start], (end - start) as u32);
        }
        start = end;
    };
    let Some((_, after)) = pixels.split_first() else { return };
    let (blocks, blocks_before) = (after.chunks_exact(BLOCK), pixels.chunks_exact(BLOCK));
    let whole = after.len() - blocks.remainder().len();
    for (index, (block, before)) in blocks.zip(blocks_before).enumerate() {
        // Long runs first: one comparison of a whole block.
        if block.iter().zip(before).fold(0, |differing, (a, b)| differing | (a ^ b)) == 0 {
            continue;
        }
        let changes = BITS.iter().zip(block.iter().zip(before));
        let mut changes = changes.fold(0, |bits, (bit, (a, b))| bits | if a == b { 0 } else { *bit });
        while changes != 0 {
            end_run(1 + index * BLOCK + changes.trailing_zeros() as usize);
            changes &= changes - 1;
        }
    }
    for index in whole..after.len() {
        if after[index] != pixels[index] {
            end_run(1 + index);
        }
    }
    end_run(pixels.len());
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

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

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Runs of any length on any number of threads count as one by one.
        #[test]
        fn threads_and_runs_do_not_matter(
            runs in prop::collection::vec((0..20_000_usize, 0..90_u32, 0..3_u32), 0..24),
            threads in 1..9_usize,
        ) {
            let value = |face, kind| match kind {
                0 => 0,
                1 => pixel(CODE_VT, face),
                _ => pixel(CODE_SHADOW, face),
            };
            let runs = runs.into_iter();
            let pixels: Vec<u32> =
                runs.flat_map(|(length, face, kind)| std::iter::repeat_n(value(face, kind), length)).collect();
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut result = VisibleFaces::default();
            pool.install(|| Scanner::default().scan(&pixels, 90, &mut result));
            prop_assert_eq!(result, plain(&pixels, 90));
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
