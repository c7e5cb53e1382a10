//! Times between frames, for the overlay and for measurements.

use std::time::{Duration, Instant};

/// When frames were shown since a turn began.
#[derive(Debug, Default)]
pub struct Timing {
    last: Option<Instant>,
    frames: Vec<Duration>,
    /// When the camera was last moved.
    moved: Option<Instant>,
    full: Option<Duration>,
}

impl Timing {
    /// The camera moves now.
    pub fn moved(&mut self, now: Instant) {
        (self.moved, self.full) = (Some(now), None);
    }

    /// A frame of the moving camera is seen since `now`.
    pub fn shown(&mut self, now: Instant) {
        if let Some(last) = self.last.replace(now) {
            self.frames.push(now - last);
        }
    }

    /// The image is complete since `now`.
    pub fn completed(&mut self, now: Instant) {
        self.last = None; // the time until the camera moves again is nobody's frame
        if let (None, Some(moved)) = (self.full, self.moved) {
            self.full = Some(now - moved);
        }
    }

    /// Time between the last two frames.
    pub fn latest(&self) -> Option<Duration> {
        self.frames.last().copied()
    }

    /// A summary in one line; starts over.
    pub fn report(&mut self) -> String {
        let mut frames = std::mem::take(&mut self.frames);
        frames.sort();
        let ms = |time: Option<Duration>| {
            time.map_or("-".into(), |time| format!("{:.1} ms", time.as_secs_f64() * 1e3))
        };
        format!(
            "{} frames: median {}, p99 {}; full quality {} after the last move",
            frames.len(),
            ms(percentile(&frames, 50)),
            ms(percentile(&frames, 99)),
            ms(self.full)
        )
    }
}

/// The smallest of `sorted` that `percent` of them do not exceed (nearest rank).
fn percentile(sorted: &[Duration], percent: usize) -> Option<Duration> {
    sorted.get((sorted.len() * percent).div_ceil(100).saturating_sub(1)).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_of_the_nearest_rank() {
        let times: Vec<Duration> = (1..=200).map(Duration::from_millis).collect();
        assert_eq!(percentile(&times, 50), Some(Duration::from_millis(100)));
        assert_eq!(percentile(&times, 99), Some(Duration::from_millis(198)));
        assert_eq!(percentile(&times[..1], 99), Some(Duration::from_millis(1)));
        assert_eq!(percentile(&[], 50), None);
    }

    #[test]
    fn rest_is_no_frame_time() {
        let start = Instant::now();
        let at = |ms: u64| start + Duration::from_millis(ms);
        let mut timing = Timing::default();
        for now in [0, 30, 70] {
            timing.moved(at(now));
            timing.shown(at(now));
        }
        timing.completed(at(570));
        timing.completed(at(900));
        timing.shown(at(5000));
        timing.shown(at(5020));
        assert_eq!(
            timing.report(),
            "3 frames: median 30.0 ms, p99 40.0 ms; full quality 500.0 ms after the last move"
        );
        assert_eq!(timing.latest(), None);
    }
}
