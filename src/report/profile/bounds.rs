//! What finding visible faces may cost at most, measured in turns with what it is held against.
//!
//! Counting on the device is promised to be faster than reading the ID buffer back where they are different machines. A
//! software device is the host: the same cores would count with more instructions.

use std::{hint::black_box, sync::Arc, time::Instant};

use serde::Serialize;

use super::Spread;
use crate::{
    error::Result,
    gpu::{DeviceKind, Gpu, ReadbackChoice},
    scene::{Scene, View},
    visibility::{Class, Pass, device},
};

/// Most time of reading back and scanning the ID buffer, in plain copies of as many bytes by one thread.
pub const MOST_COPIES: f64 = 1.5;
/// Size of the image whose times are promised.
pub const SIZE: (u32, u32) = (1280, 1024);
/// Triangles from which on counting on the device is to be faster than reading the ID buffer back.
pub const MANY_TRIANGLES: u32 = 1_000_000;

/// A time that is held against another one.
///
/// Both are measured in turns, and their minima compared: other work on the machine only ever adds to a time, and
/// of many turns some are spared.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bound {
    /// What is measured.
    pub what: &'static str,
    /// What it is held against.
    pub against: &'static str,
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Triangles of the scene.
    pub triangles: u64,
    /// Least time of it in milliseconds.
    pub best_ms: f64,
    /// Least time of what it is held against in milliseconds.
    pub against_best_ms: f64,
    /// The one divided by the other.
    pub ratio: f64,
    /// The same of their medians.
    pub median_ratio: f64,
    /// What `ratio` may be at most.
    pub most: f64,
    /// Whether it is.
    pub holds: bool,
    /// Whether it is promised of this device, or only measured.
    pub promised: bool,
}

impl Bound {
    /// Takes `turns` turns, at least one, of `work`, which returns both times in milliseconds.
    fn measure(
        (what, against, most): (&'static str, &'static str, f64),
        (scene, view): (&Scene, &View),
        turns: usize,
        mut work: impl FnMut() -> Result<(f64, f64)>,
    ) -> Result<Self> {
        work()?;
        let times = (0..turns.max(1)).map(|_| work()).collect::<Result<Vec<_>>>()?;
        let (mine, others): (Vec<_>, Vec<_>) = times.into_iter().unzip();
        let best = |times: &[f64]| times.iter().copied().fold(f64::INFINITY, f64::min);
        let (best_ms, against_best_ms) = (best(&mine), best(&others));
        let ratio = best_ms / against_best_ms;
        Ok(Self {
            what,
            against,
            width: view.width,
            height: view.height,
            triangles: scene.geometry.faces.len() as u64,
            best_ms,
            against_best_ms,
            ratio,
            median_ratio: Spread::of(mine).median_ms / Spread::of(others).median_ms,
            most,
            holds: ratio <= most,
            promised: true,
        })
    }

    /// Reading back and scanning the ID buffer of `view` in the way that a frame does, everything but drawing included,
    /// against a plain copy of as many bytes by one thread.
    ///
    /// # Errors
    /// More faces than IDs; an image size that the device does not support; no memory left; a lost device.
    pub fn of_reading(
        gpu: &Arc<Gpu>,
        (scene, classes): (&Scene, &[Class]),
        view: &View,
        turns: usize,
    ) -> Result<Self> {
        let mut pass = Pass::new(gpu, scene, classes)?;
        pass.warm_up(view)?;
        let mut copy = PlainCopy::new(4 * view.pixels());
        let names = ("reading back and scanning", "a plain copy by one thread", MOST_COPIES);
        Self::measure(names, (scene, view), turns, || {
            let times = pass.run(view)?.times;
            Ok((times.readback + times.scan, copy.run()))
        })
    }

    /// Counting on the device, drawing included, against the ID buffer read back and scanned.
    ///
    /// # Errors
    /// As for [`of_reading`](Self::of_reading).
    pub fn of_counting(
        gpu: &Arc<Gpu>,
        (scene, classes): (&Scene, &[Class]),
        view: &View,
        turns: usize,
    ) -> Result<Self> {
        let mut id_buffer = Pass::new(gpu, scene, classes)?;
        let mut counting = device::Pass::new(gpu, scene, classes, ReadbackChoice::Best)?;
        id_buffer.warm_up(view)?;
        counting.warm_up(view)?;
        let names = ("counting on the device", "the ID buffer", 1.0);
        let bound = Self::measure(names, (scene, view), turns, || {
            Ok((counting.run(view)?.times.total(), id_buffer.run(view)?.times.total()))
        })?;
        Ok(Self { promised: gpu.info().kind != DeviceKind::Cpu, ..bound })
    }
}

/// The limit of any readback: a copy from memory to memory by one thread, with nothing else in between.
pub(super) struct PlainCopy {
    source: Vec<u8>,
    target: Vec<u8>,
}

impl PlainCopy {
    /// Of so many bytes, all of them touched before.
    pub fn new(bytes: usize) -> Self {
        Self { source: vec![1; bytes], target: vec![2; bytes] }
    }

    /// Copies once; returns milliseconds.
    pub fn run(&mut self) -> f64 {
        let started = Instant::now();
        self.target.copy_from_slice(black_box(&self.source));
        black_box(&self.target);
        started.elapsed().as_secs_f64() * 1e3
    }
}
