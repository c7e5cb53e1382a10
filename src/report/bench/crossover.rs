//! The tracer's time at the same error, and where two ladders cross.

use serde::Serialize;

use super::ladder::Family;
use super::{Metric, Point, Region};

/// A time on a ladder, or the end of the ladder that it lies beyond.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "bound", content = "ms")]
pub enum At {
    /// Between two rungs: interpolated, logarithm against logarithm.
    Exactly(f64),
    /// The error is larger than that of the first rung: its time at most.
    AtMost(f64),
    /// The error is smaller than any rung's: more than the time of the last.
    MoreThan(f64),
}

impl At {
    /// Milliseconds, of a bound the bound itself.
    pub fn ms(self) -> f64 {
        let (Self::Exactly(ms) | Self::AtMost(ms) | Self::MoreThan(ms)) = self;
        ms
    }

    /// `exactly`, `at-most` or `more-than`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Exactly(_) => "exactly",
            Self::AtMost(_) => "at-most",
            Self::MoreThan(_) => "more-than",
        }
    }

    /// Nothing, `≤ ` or `> `, to stand before the number.
    pub fn sign(self) -> &'static str {
        match self {
            Self::Exactly(_) => "",
            Self::AtMost(_) => "≤ ",
            Self::MoreThan(_) => "> ",
        }
    }
}

/// What a tracer takes for the error of a point of ours.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Pace {
    /// The tracer.
    pub against: Family,
    /// Where the error is over.
    pub region: Region,
    /// Which error is the same.
    pub metric: Metric,
    /// The tracer's time for it.
    #[serde(flatten)]
    pub at: At,
    /// That over our time: above 1 vertex tracing is faster. A bound where the time is one.
    pub ratio: f64,
}

impl Pace {
    /// Whether vertex tracing is the faster; `None` where a bound does not tell.
    pub fn faster(&self) -> Option<bool> {
        let faster = self.ratio > 1.0;
        match self.at {
            At::Exactly(_) => Some(faster),
            At::AtMost(_) => (!faster).then_some(false),
            At::MoreThan(_) => faster.then_some(true),
        }
    }
}

/// The rungs of (milliseconds, error) that no faster one betters, from fast to slow.
pub fn front(mut ladder: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    ladder.retain(|(ms, error)| *ms > 0.0 && error.is_finite());
    ladder.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut front: Vec<(f64, f64)> = Vec::new();
    for rung in ladder {
        if front.last().is_none_or(|last| rung.1 < last.1) {
            front.push(rung);
        }
    }
    front
}

/// The time at which `ladder`, of (milliseconds, error), reaches `error`; `None` for an empty one.
pub fn time_at(ladder: &[(f64, f64)], error: f64) -> Option<At> {
    let front = front(ladder.to_vec());
    let (first, last) = (front.first()?, front.last()?);
    if error > first.1 {
        return Some(At::AtMost(first.0));
    }
    if error < last.1 {
        return Some(At::MoreThan(last.0));
    }
    let after = front.iter().position(|rung| rung.1 <= error).unwrap_or(0);
    if front[after].1 == error {
        return Some(At::Exactly(front[after].0));
    }
    let (a, b) = (front[after - 1], front[after]);
    // An error of 0 has no logarithm; a hundredth of the last bit of eight stands for it.
    let log = |error: f64| error.max(1e-2 / 255.0).ln();
    let share = (log(error) - log(a.1)) / (log(b.1) - log(a.1));
    let share = if share.is_finite() { share.clamp(0.0, 1.0) } else { 1.0 };
    Some(At::Exactly((a.0.ln() + (b.0.ln() - a.0.ln()) * share).exp()))
}

/// Every pace of a point of ours against the tracers among `points`.
pub fn paces(point: &Point, points: &[Point]) -> Vec<Pace> {
    let mut paces = Vec::new();
    for against in [Family::Tracer, Family::Hybrid] {
        for region in Region::ALL {
            for metric in Metric::ALL {
                let ladder: Vec<(f64, f64)> = points
                    .iter()
                    .filter(|point| point.family == against)
                    .filter_map(|point| Some((point.time.median_ms, metric.of(point.error(region)?))))
                    .collect();
                let Some(error) = point.error(region) else { continue };
                let Some(at) = time_at(&ladder, metric.of(error)) else { continue };
                let ratio = at.ms() / point.time.median_ms.max(1e-9);
                paces.push(Pace { against: against.clone(), region, metric, at, ratio });
            }
        }
    }
    paces
}

/// Where the ratio of one ladder of (error, ratio, milliseconds) passes 1 between two rungs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// The error there.
    pub error: f64,
    /// Our time there.
    pub ms: f64,
    /// Whether vertex tracing is the faster on the side of larger errors.
    pub faster_before: bool,
}

/// Every crossing, from large errors to small.
pub fn crossings(mut rungs: Vec<(f64, f64, f64)>) -> Vec<Crossing> {
    rungs.retain(|(error, ratio, ms)| *error > 0.0 && *ratio > 0.0 && *ms > 0.0);
    rungs.sort_by(|a, b| b.0.total_cmp(&a.0));
    rungs
        .windows(2)
        .filter(|pair| (pair[0].1 > 1.0) != (pair[1].1 > 1.0))
        .map(|pair| {
            let ((error, ratio, ms), (next_error, next_ratio, next_ms)) = (pair[0], pair[1]);
            let share = ratio.ln() / (ratio.ln() - next_ratio.ln());
            let between = |a: f64, b: f64| (a.ln() + (b.ln() - a.ln()) * share).exp();
            Crossing {
                error: between(error, next_error),
                ms: between(ms, next_ms),
                faster_before: ratio > 1.0,
            }
        })
        .collect()
}
