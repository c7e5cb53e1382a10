//! What a time budget keeps back for the work after the last sample.

use std::time::Duration;

/// Time from the last sample to the image, by the number of samples: a line through two frames that were timed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Reserve {
    /// Samples and time of a frame of few samples.
    few: (u64, Duration),
    /// The same of many.
    many: (u64, Duration),
}

impl Reserve {
    /// The line through what frames of few and of many samples took; it never falls.
    pub fn through(few: (u64, Duration), many: (u64, Duration)) -> Self {
        Self { few, many }
    }

    /// Lets a frame that was timed take the place of the one that had about as many samples.
    pub fn learn(&mut self, frame: (u64, Duration)) {
        if *self == Self::default() {
            *self = Self::through(frame, frame);
        } else if frame.0.abs_diff(self.few.0) <= frame.0.abs_diff(self.many.0) {
            // Both were one, and this one has more.
            let more = self.few.0 == self.many.0 && frame.0 > self.many.0;
            *(if more { &mut self.many } else { &mut self.few }) = frame;
        } else {
            self.many = frame;
        }
    }

    /// What to keep back once `samples` are traced.
    pub fn at(self, samples: u64) -> Duration {
        let [(few, low), (many, high)] =
            [self.few, self.many].map(|(samples, time)| (samples as f64, time.as_secs_f64()));
        let per_sample = if many > few { ((high - low) / (many - few)).max(0.0) } else { 0.0 };
        let fixed = (low - per_sample * few).max(0.0);
        Duration::from_secs_f64(fixed + per_sample * samples as f64)
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

    #[test]
    fn frames_teach_it() {
        let ms = Duration::from_millis;
        let mut reserve = Reserve::default();
        reserve.learn((100, ms(20)));
        assert_eq!(reserve.at(5000), ms(20), "nothing is known of more samples");
        reserve.learn((1100, ms(120)));
        assert_eq!((reserve.at(100), reserve.at(600)), (ms(20), ms(70)));
        reserve.learn((120, ms(30)));
        assert_eq!(reserve.at(120), ms(30), "the newer of few samples counts");
        assert_eq!(reserve.at(1100), ms(120));
    }
}
