//! How coarse the picture of a moving camera is: as fine as the budget allows.

use std::time::Duration;

/// Coarsest picture: a pixel of it covers so many of the window along each side.
pub const COARSEST: u32 = 4;

/// Share of the budget beyond which what pixels take is too much: the rest is for samples.
const MOST: f64 = 0.8;

/// Share of the budget that what pixels of a finer picture are expected to take must leave.
const LEAST: f64 = 0.6;

/// Slow frames in a row that make the picture coarser, and fast ones that make it finer.
const SLOW: u32 = 2;
const FAST: u32 = 6;

/// Chooses how many pixels of the window one of the picture covers, from what frames took.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    coarse: u32,
    slow: u32,
    fast: u32,
}

impl Default for Pace {
    fn default() -> Self {
        Self { coarse: 1, slow: 0, fast: 0 }
    }
}

impl Pace {
    /// Pixels of the window along each side of a pixel of the picture, 1 to [`COARSEST`].
    pub fn coarse(&self) -> u32 {
        self.coarse
    }

    /// Takes in that a frame spent `pixels` on all but samples, of which there may be more or less.
    pub fn took(&mut self, pixels: Duration, budget: Duration) {
        let share = pixels.as_secs_f64() / budget.as_secs_f64();
        // At worst all of it grows with the number of pixels.
        let finer = f64::from(self.coarse) / f64::from(self.coarse.max(2) - 1);
        self.slow = if share > MOST { self.slow + 1 } else { 0 };
        self.fast = if share * finer * finer < LEAST { self.fast + 1 } else { 0 };
        if self.slow >= SLOW && self.coarse < COARSEST {
            *self = Self { coarse: self.coarse + 1, ..Self::default() };
        } else if self.fast >= FAST && self.coarse > 1 {
            *self = Self { coarse: self.coarse - 1, ..Self::default() };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sizes that a device settles on which takes `fixed` and, at full size, `full` more.
    fn settled(fixed: f64, full: f64) -> Vec<u32> {
        let mut pace = Pace::default();
        let mut sizes = vec![pace.coarse()];
        for _ in 0..100 {
            let time = fixed + full / f64::from(pace.coarse() * pace.coarse());
            pace.took(Duration::from_secs_f64(time * 1e-3), Duration::from_millis(33));
            sizes.push(pace.coarse());
        }
        sizes.split_off(40)
    }

    #[test]
    fn a_slow_device_draws_a_coarse_picture_and_stays_with_it() {
        assert_eq!(settled(2.0, 5.0), [1; 61]);
        assert_eq!(settled(2.0, 60.0), [2; 61]);
        assert_eq!(settled(2.0, 150.0), [3; 61]);
        assert_eq!(settled(50.0, 9e3), [COARSEST; 61], "there is an end to it");
    }

    #[test]
    fn it_becomes_fine_again() {
        let (slow, budget) = (Duration::from_millis(60), Duration::from_millis(33));
        let mut pace = Pace::default();
        pace.took(slow, budget);
        assert_eq!(pace.coarse(), 1, "one slow frame is an accident");
        for _ in 0..9 {
            pace.took(slow, budget);
        }
        assert_eq!(pace.coarse(), COARSEST);
        for _ in 0..3 * FAST {
            pace.took(Duration::from_millis(4), budget);
        }
        assert_eq!(pace.coarse(), 1);
    }
}
