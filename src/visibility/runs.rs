//! Finds runs of equal pixels, 64 at a time and without a branch on what the pixels are.
//!
//! Where a mesh is dense, runs end at every third pixel and no processor foresees where: a branch a run costs more than
//! all the rest of a scan.

use wide::{CmpEq, i32x8};

/// Most pixels in which [`Runs`] are found at once: they and the ends of their runs stay in the first-level cache.
pub const PIECE: usize = 4096;
/// Pixels compared before anything is written: a bit each in a word.
const WORD: usize = u64::BITS as usize;

/// Room for the runs of a piece, to be used again and again.
#[derive(Debug)]
pub struct Runs {
    /// A word may write all of its places before their number is known.
    ends: Box<[u32; PIECE + WORD]>,
}

impl Default for Runs {
    fn default() -> Self {
        Self { ends: Box::new([0; PIECE + WORD]) }
    }
}

impl Runs {
    /// Where each run of equal values in `pixels` ends, ascending: the last is their number.
    ///
    /// # Panics
    /// For more than [`PIECE`] pixels.
    pub fn ends(&mut self, pixels: &[u32]) -> &[u32] {
        assert!(pixels.len() <= PIECE);
        let ends = &mut *self.ends;
        #[cfg(target_arch = "x86_64")]
        let found = match pulp::x86::V3::try_new().filter(|_| IS_OPTIMISED) {
            Some(simd) => simd.vectorize(Avx2 { simd, ends, pixels }),
            None => find(Portable, ends, pixels),
        };
        #[cfg(not(target_arch = "x86_64"))]
        let found = find(Portable, ends, pixels);
        &self.ends[..found]
    }
}

/// Whether instructions of the processor are more than calls: as calls, those of AVX2 take longer than what every processor can.
#[cfg(target_arch = "x86_64")]
const IS_OPTIMISED: bool = !cfg!(debug_assertions);

/// Finds a bit for each place at which two words of pixels differ.
trait Compare: Copy {
    fn changes(self, a: &[u32; WORD], b: &[u32; WORD]) -> u64;
}

/// Writes where runs end; their number.
#[inline(always)]
fn find(compare: impl Compare, ends: &mut [u32; PIECE + WORD], pixels: &[u32]) -> usize {
    let Some((_, after)) = pixels.split_first() else { return 0 };
    let (words, rest) = after.as_chunks::<WORD>();
    let mut found = 0;
    for (index, (word, before)) in words.iter().zip(pixels.as_chunks::<WORD>().0).enumerate() {
        let changes = compare.changes(word, before);
        let Some(free) = ends[found..].first_chunk_mut::<WORD>() else { break };
        write_bits(changes, 1 + (index * WORD) as u32, free);
        found += changes.count_ones() as usize;
    }
    for index in after.len() - rest.len()..after.len() {
        ends[found] = 1 + index as u32;
        found += usize::from(after[index] != pixels[index]);
    }
    ends[found] = pixels.len() as u32;
    found + 1
}

/// What every processor can.
#[derive(Clone, Copy)]
struct Portable;

impl Compare for Portable {
    #[inline(always)]
    fn changes(self, a: &[u32; WORD], b: &[u32; WORD]) -> u64 {
        let eights = a.as_chunks::<8>().0.iter().zip(b.as_chunks::<8>().0);
        let equal = eights.enumerate().fold(0, |equal, (index, (&a, &b))| {
            let same = bytemuck::cast::<_, i32x8>(a).cmp_eq(bytemuck::cast::<_, i32x8>(b));
            equal | (same.move_mask() as u64) << (8 * index)
        });
        !equal
    }
}

/// All of it compiled for processors with AVX2: eight pixels an instruction, and bits that are counted and cleared by one.
#[cfg(target_arch = "x86_64")]
struct Avx2<'a> {
    simd: pulp::x86::V3,
    ends: &'a mut [u32; PIECE + WORD],
    pixels: &'a [u32],
}

#[cfg(target_arch = "x86_64")]
impl pulp::NullaryFnOnce for Avx2<'_> {
    type Output = usize;

    #[inline(always)]
    fn call(self) -> usize {
        find(self.simd, self.ends, self.pixels)
    }
}

#[cfg(target_arch = "x86_64")]
impl Compare for pulp::x86::V3 {
    #[inline(always)]
    fn changes(self, a: &[u32; WORD], b: &[u32; WORD]) -> u64 {
        let mut equal = 0;
        for (index, (&a, &b)) in a.as_chunks::<8>().0.iter().zip(b.as_chunks::<8>().0).enumerate() {
            let same = self.avx2._mm256_cmpeq_epi32(pulp::cast(a), pulp::cast(b));
            equal |= u64::from(self.avx._mm256_movemask_ps(pulp::cast(same)) as u32) << (8 * index);
        }
        !equal
    }
}

/// Writes `base` plus the place of each set bit, in order, and something behind them: their number decides how many
/// eights are written, no single bit does.
#[inline(always)]
fn write_bits(mut bits: u64, base: u32, places: &mut [u32; WORD]) {
    let eights = bits.count_ones().div_ceil(8) as usize;
    for eight in places.as_chunks_mut::<8>().0.iter_mut().take(eights) {
        for place in eight {
            *place = base + bits.trailing_zeros();
            bits &= bits.wrapping_sub(1);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn every_pixel_may_end_a_run() {
        let mut runs = Runs::default();
        for length in [0, 1, 2, 63, 64, 65, 66, 128, 129, PIECE - 1, PIECE] {
            let all: Vec<u32> = (0..length as u32).collect();
            assert_eq!(runs.ends(&all), all.iter().map(|i| i + 1).collect::<Vec<_>>(), "{length} runs");
            let one = vec![7; length];
            assert_eq!(runs.ends(&one), &[length as u32][..length.min(1)], "one run of {length}");
        }
    }

    #[test]
    #[should_panic]
    fn more_than_a_piece_is_refused() {
        Runs::default().ends(&[0; PIECE + 1]);
    }

    proptest! {
        /// As the standard library has it; the highest bit counts too.
        #[test]
        fn runs_end_where_values_change(
            lengths in prop::collection::vec((0..90_usize, prop::sample::select(&[0, 1, 1 << 31, u32::MAX])), 0..40),
        ) {
            let pixels: Vec<u32> =
                lengths.into_iter().flat_map(|(length, value)| std::iter::repeat_n(value, length)).collect();
            let ends = pixels.chunk_by(|a, b| a == b).scan(0, |end, run| {
                *end += run.len() as u32;
                Some(*end)
            });
            let ends: Vec<u32> = ends.collect();
            let mut runs = Runs::default();
            prop_assert_eq!(runs.ends(&pixels), &ends);
            #[cfg(target_arch = "x86_64")]
            if let Some(simd) = pulp::x86::V3::try_new() {
                let found = simd.vectorize(Avx2 { simd, ends: &mut runs.ends, pixels: &pixels });
                prop_assert_eq!(&runs.ends[..found], &ends);
            }
        }
    }
}
