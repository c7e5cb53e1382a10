//! Scans the ID buffer: pixels of each face, and the faces that have any.

use std::{
    ops::Range,
    sync::atomic::{AtomicUsize, Ordering},
};

use super::runs::{PIECE, Runs};
use crate::constants::{CODE_SHADOW, CODE_VT};

/// Fewest pixels that are worth a task of their own: a few dozen microseconds of work.
const PIXELS_PER_TASK: usize = 1 << 14;
/// Pixels that a task takes at once: few enough that all tasks end together, though some begin late.
const BAND: usize = 16 * PIECE;
/// Fewest faces whose counts are worth a task of their own.
const FACES_PER_TASK: usize = 1 << 15;
/// Counters that all tasks together may have, 4 bytes each; scenes with more faces get fewer tasks.
const MOST_COUNTERS: usize = 1 << 25;
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

/// Counts pixels; what it needs for that is kept from scan to scan.
#[derive(Debug, Default)]
pub struct Scanner {
    tallies: Vec<Tally>,
    /// Visible faces of each [`FACES_PER_TASK`] faces.
    lists: Vec<Vec<u32>>,
}

impl Scanner {
    /// Counts the pixels of each of `faces` faces in the ID buffer `pixels` into `result`.
    ///
    /// The result does not depend on the number of threads: sums of integers commute.
    pub fn scan(&mut self, pixels: &[u32], faces: usize, result: &mut VisibleFaces) {
        let most = (MOST_COUNTERS / faces.max(1)).clamp(1, rayon::current_num_threads());
        let tasks = (pixels.len() / PIXELS_PER_TASK).clamp(1, most);
        self.tallies.resize_with(tasks, Tally::default);
        let (bands, next) = (pixels.chunks(BAND), AtomicUsize::new(0));
        on_all(self.tallies.iter_mut(), |tally| {
            tally.reset(faces);
            while let Some(band) = bands.clone().nth(next.fetch_add(1, Ordering::Relaxed)) {
                band.chunks(PIECE).for_each(|piece| tally.count(piece));
            }
        });
        result.vt_pixels = self.tallies.iter().map(|tally| tally.vt_pixels).sum();
        result.shadow_pixels = self.tallies.iter().map(|tally| tally.shadow_pixels).sum();
        let few = self.tallies.iter().map(|tally| tally.touched).sum::<usize>() <= faces / SPARSE;
        if few && result.pixels_per_face.len() == faces {
            result.set_touched(&self.tallies);
        } else {
            let tallies = &self.tallies;
            result.set_all(faces, &mut self.lists, |first, sums| {
                sums.fill(0);
                for tally in tallies {
                    // Counter 0 is of pixels without a face.
                    let counts = &tally.counts[1 + first..];
                    sums.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
                }
            });
        }
    }

    /// Sets all of `result` from `counts`, the pixels of each face; `vt` and `shadow` are the faces of the two classes.
    pub fn take_counts(
        &mut self,
        counts: &[u32],
        vt: &[Range<u32>],
        shadow: &[Range<u32>],
        result: &mut VisibleFaces,
    ) {
        result.set_all(counts.len(), &mut self.lists, |first, sums| {
            sums.copy_from_slice(&counts[first..first + sums.len()]);
        });
        let pixels = |faces: &[Range<u32>]| {
            let counts = faces.iter().flat_map(|faces| &counts[faces.start as usize..faces.end as usize]);
            counts.map(|&count| u64::from(count)).sum()
        };
        (result.vt_pixels, result.shadow_pixels) = (pixels(vt), pixels(shadow));
    }
}

impl VisibleFaces {
    /// Sets the counts of the faces that tallies touched, and resets those of the last frame.
    fn set_touched(&mut self, tallies: &[Tally]) {
        for face in self.visible.drain(..) {
            self.pixels_per_face[face as usize] = 0;
        }
        for tally in tallies {
            for &id in &tally.ids[..tally.touched] {
                let Some(face) = id.checked_sub(1) else { continue };
                let count = &mut self.pixels_per_face[face as usize];
                if *count == 0 {
                    self.visible.push(face);
                }
                *count += tally.counts[id as usize];
            }
        }
        self.visible.sort_unstable();
    }

    /// Sets the counts of all faces: `set` gets the first of some faces and where their counts belong.
    fn set_all(&mut self, faces: usize, lists: &mut Vec<Vec<u32>>, set: impl Fn(usize, &mut [u32]) + Sync) {
        self.pixels_per_face.resize(faces, 0);
        let parts = self.pixels_per_face.chunks_mut(FACES_PER_TASK);
        lists.resize_with(parts.len(), Vec::new);
        on_all(parts.zip(lists.iter_mut()).enumerate(), |(index, (counts, list))| {
            let first = index * FACES_PER_TASK;
            set(first, counts);
            // Which faces have pixels no processor foresees: all are written, those without are overwritten.
            list.resize(counts.len(), 0);
            let mut visible = 0;
            for (face, &count) in (first as u32..).zip(&*counts) {
                list[visible] = face;
                visible += usize::from(count > 0);
            }
            list.truncate(visible);
        });
        self.visible.clear();
        lists.iter().for_each(|list| self.visible.extend_from_slice(list));
    }
}

/// What one task counted, by ID: face + 1, or 0 for none.
#[derive(Debug, Default)]
struct Tally {
    /// Pixels of each ID; 0 for all but the touched ones.
    counts: Vec<u32>,
    /// The IDs touched, as long as they are few, and room for one more.
    ids: Vec<u32>,
    /// How many IDs were touched: at least as many as `ids` holds if it is full.
    touched: usize,
    vt_pixels: u64,
    shadow_pixels: u64,
    runs: Runs,
}

impl Tally {
    /// All counts 0, for a scene of `faces` faces.
    fn reset(&mut self, faces: usize) {
        if self.touched < self.ids.len() && self.counts.len() == faces + 1 {
            self.ids[..self.touched].iter().for_each(|&id| self.counts[id as usize] = 0);
        } else {
            self.counts.clear();
            self.counts.resize(faces + 1, 0);
            self.ids.resize(faces / SPARSE + 2, 0);
        }
        (self.touched, self.vt_pixels, self.shadow_pixels) = (0, 0, 0);
    }

    /// Counts at most [`PIECE`] pixels; IDs beyond the scene's are passed over.
    fn count(&mut self, pixels: &[u32]) {
        let last = self.ids.len() - 1;
        let mut start = 0;
        for &end in self.runs.ends(pixels) {
            let (pixel, length) = (pixels[start as usize], end - start);
            start = end;
            let of = |code| if pixel >> 24 == code { length.into() } else { 0_u64 };
            self.vt_pixels += of(CODE_VT);
            self.shadow_pixels += of(CODE_SHADOW);
            let id = pixel & 0xff_ffff;
            if let Some(count) = self.counts.get_mut(id as usize) {
                // Whether a face is new no processor foresees either.
                self.ids[self.touched.min(last)] = id;
                self.touched += usize::from(*count == 0);
                *count += length;
            }
        }
    }
}

/// Calls `work` for all of `jobs`: one on this thread, the others on any.
///
/// Threads that sleep take as long to wake as half a scan takes: this one does not wait for them to begin.
fn on_all<T: Send>(mut jobs: impl Iterator<Item = T>, work: impl Fn(T) + Sync) {
    let Some(own) = jobs.next() else { return };
    let work = &work;
    rayon::in_place_scope(|scope| {
        jobs.for_each(|job| scope.spawn(move |_| work(job)));
        work(own);
    });
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
