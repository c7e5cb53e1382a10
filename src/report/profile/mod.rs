//! What knowing the visible faces costs on a device: the rows of `vtrace profile` (design §9).

mod bounds;
pub mod measure;
#[cfg(feature = "plots")]
pub mod plot;
mod table;

use serde::Serialize;

pub use bounds::{Bound, MANY_TRIANGLES, MOST_COPIES};

use super::stats::LeftOut;

/// Everything that one run of `vtrace profile` measured.
#[derive(Debug, Clone, Serialize)]
pub struct Profile {
    /// The scene's name.
    pub scene: String,
    /// Device that was measured.
    pub device: String,
    /// Its driver.
    pub driver: String,
    /// One row for each stage of each way, memory, size and number of triangles.
    pub rows: Vec<Row>,
    /// Plain copies of as many bytes as were read back, from memory to memory by one thread: the limit of any readback.
    pub memcpy: Vec<Copy>,
    /// What is promised, and whether it is kept here.
    pub bounds: Vec<Bound>,
    /// Blocking (one staging buffer) against several in flight.
    pub rings: Vec<Ring>,
    /// Kinds of memory for the host to read that the device lacks.
    pub unavailable: Vec<&'static str>,
    /// Ways that the device cannot serve at some size or number of triangles.
    pub left_out: Vec<LeftOut>,
    /// What the paper measured in 2003.
    pub paper: Paper,
}

/// One stage of one way.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// `id-buffer`, `single-pass` or `device`.
    pub way: String,
    /// Kind of memory that was read: `cached-coherent`, `cached` or `uncached`.
    pub memory: &'static str,
    /// Whether the memory was read where the device drew, without a copy.
    pub in_place: bool,
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Triangles of the scene.
    pub triangles: u64,
    /// One of [`STAGES`].
    pub stage: &'static str,
    /// How long it took.
    #[serde(flatten)]
    pub spread: Spread,
    /// Bytes that the stage moved; 0 for stages that move none.
    pub bytes: u64,
}

/// The stages of every way, in order; the last is the sum of the others.
///
/// `draw` and `copy` are by the device's clock, the others by the host's; `wait` is what the host waited
/// beyond the two: recording, submission, synchronisation. `map` invalidates cached memory, `read` copies
/// uncached memory once in bulk; other memory is read in place by `scan`.
pub const STAGES: [&str; 7] = ["draw", "copy", "wait", "map", "read", "scan", "total"];

/// Median and tenths of repeated measurements, in milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Half of the runs were faster.
    pub median_ms: f64,
    /// A tenth of the runs was faster.
    pub p10_ms: f64,
    /// Nine tenths of the runs were faster.
    pub p90_ms: f64,
}

impl Spread {
    /// Of at least one measurement; of none all is 0.
    pub fn of(mut runs: Vec<f64>) -> Self {
        runs.sort_by(f64::total_cmp);
        let at = |share: f64| runs.get((share * (runs.len().max(1) - 1) as f64).round() as usize);
        let at = |share| at(share).copied().unwrap_or_default();
        Self { median_ms: at(0.5), p10_ms: at(0.1), p90_ms: at(0.9) }
    }
}

/// A plain copy on the host.
#[derive(Debug, Clone, Serialize)]
pub struct Copy {
    /// Bytes copied.
    pub bytes: u64,
    /// How long it took.
    #[serde(flatten)]
    pub spread: Spread,
}

impl Copy {
    /// Gigabytes a second.
    pub fn rate(&self) -> f64 {
        rate(self.bytes, self.spread.median_ms)
    }
}

/// The ID buffer frame after frame with some staging buffers in flight.
#[derive(Debug, Clone, Serialize)]
pub struct Ring {
    /// Staging buffers; 1 is blocking.
    pub buffers: usize,
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// From submitting a frame until its faces are known.
    pub latency: Spread,
    /// Frames whose faces became known a second.
    pub frames_per_second: f64,
    /// By how many frames the faces come late.
    pub frames_late: usize,
}

/// Figures of the paper (§5).
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Paper {
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Least and most time to read the image back.
    pub read_ms: [f64; 2],
    /// Most time to scan it.
    pub scan_ms: f64,
}

/// What the paper says.
pub const PAPER: Paper = Paper { width: 1024, height: 768, read_ms: [20.0, 40.0], scan_ms: 10.0 };

/// Gigabytes a second; 0 for what took no time.
pub(crate) fn rate(bytes: u64, ms: f64) -> f64 {
    if ms > 0.0 { bytes as f64 / ms * 1e-6 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreads() {
        let spread = Spread::of((1..=11).rev().map(f64::from).collect());
        assert_eq!(spread, Spread { median_ms: 6.0, p10_ms: 2.0, p90_ms: 10.0 });
        assert_eq!(Spread::of(vec![3.0]).p90_ms, 3.0);
        assert_eq!(Spread::of(Vec::new()).median_ms, 0.0);
    }
}
