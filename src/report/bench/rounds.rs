//! Times that can be compared: every job in turn, round after round.

use crate::error::Result;

/// What a long measurement tells about itself.
pub trait Observer: Sync {
    /// A stage begins.
    fn stage(&self, name: &'static str);
    /// `share` of the stage is done, 0 to 1.
    fn share(&self, share: f32);
}

/// Tells nobody.
impl Observer for () {
    fn stage(&self, _: &'static str) {}
    fn share(&self, _: f32) {}
}

/// What one run of a job gives: its milliseconds, by whatever clock, and its result.
pub type Timed<T> = (f64, T);

/// Runs each of `costs.len()` jobs `repeats` times, one after the other and then all over again, so that
/// whatever else slows the machine for a while slows them alike. Every other round runs backwards, so that
/// no job always follows the same other one.
///
/// `costs` are the milliseconds that each is expected to take, which only the shares told to `observer` depend
/// on. The runs of each job come in the order that they were made in.
///
/// # Errors
/// Whatever a job returns.
pub fn rounds<T>(
    costs: &[f64],
    repeats: usize,
    observer: &dyn Observer,
    mut run: impl FnMut(usize) -> Result<Timed<T>>,
) -> Result<Vec<Vec<Timed<T>>>> {
    let mut runs: Vec<Vec<Timed<T>>> = costs.iter().map(|_| Vec::with_capacity(repeats)).collect();
    let whole = (costs.iter().sum::<f64>() * repeats as f64).max(1e-9);
    let mut done = 0.0;
    for round in 0..repeats {
        for turn in 0..costs.len() {
            let job = if round % 2 == 0 { turn } else { costs.len() - 1 - turn };
            runs[job].push(run(job)?);
            done += costs[job];
            observer.share((done / whole) as f32);
        }
    }
    Ok(runs)
}

/// The run whose time is the median, of at least one.
pub fn median<T>(runs: &[Timed<T>]) -> Option<&Timed<T>> {
    let mut order: Vec<&Timed<T>> = runs.iter().collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    order.get(order.len() / 2).copied()
}
