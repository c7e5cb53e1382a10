//! What a time budget keeps back for the work after the last sample.

use std::time::Duration;

/// Time from the last sample to the image, by the number of samples: a line through two frames that were timed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Reserve {
    /// Seconds without any sample.
    fixed: f64,
    /// Seconds a sample.
    per_sample: f64,
}

impl Reserve {
    /// The line through what frames of few and of many samples took; it never falls.
    pub fn through(few: (u64, Duration), many: (u64, Duration)) -> Self {
        let [(few, low), (many, high)] =
            [few, many].map(|(samples, time)| (samples as f64, time.as_secs_f64()));
        let per_sample = if many > few { ((high - low) / (many - few)).max(0.0) } else { 0.0 };
        Self { fixed: (low - per_sample * few).max(0.0), per_sample }
    }

    /// What to keep back once `samples` are traced.
    pub fn at(self, samples: u64) -> Duration {
        Duration::from_secs_f64(self.fixed + self.per_sample * samples as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_never_falls() {
        let ms = Duration::from_millis;
        let reserve = Reserve::through((100, ms(20)), (1100, ms(120)));
        assert_eq!((reserve.at(100), reserve.at(600)), (ms(20), ms(70)));
        assert_eq!(Reserve::through((100, ms(50)), (1100, ms(20))).at(5000), ms(50), "noise");
        assert_eq!(Reserve::through((100, ms(50)), (100, ms(60))).at(5000), ms(50), "nothing to refine");
        assert_eq!(Reserve::default().at(5000), ms(0));
    }
}
