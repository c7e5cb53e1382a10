//! A report as text.

use std::fmt;

use super::{Report, Row, Verdict};

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "stability on {} ({})\n", self.device, self.driver)?;
        writeln!(
            f,
            "{:<18}{:>14}{:>12}{:>11}{:>8}{:>11}{:>9}{:>9}{:>9}{:>10}  verdict",
            "case", "parameter", "value", "error", "dB", "truth", "bound", "bound", "samples", "ms"
        )?;
        self.rows.iter().try_for_each(|row| line(f, row))?;
        let count = |verdict| self.rows.iter().filter(|row| row.verdict == verdict).count();
        let [holds, limits, fails] = [Verdict::Holds, Verdict::KnownLimit, Verdict::Fails].map(count);
        writeln!(f, "\n{holds} hold, {limits} known limits, {fails} fail")?;
        writeln!(
            f,
            "error: RMSE to the reference tracer where mirrors and glass are seen, or share of rays that leak"
        )?;
        writeln!(f, "truth: RMSE to the closed form, or to the scene that must look the same")
    }
}

fn line(f: &mut fmt::Formatter<'_>, row: &Row) -> fmt::Result {
    let psnr = row.psnr.map_or_else(|| "-".into(), |psnr| format!("{psnr:.1}"));
    let truth = row.truth.map_or_else(|| "-".into(), |rmse| format!("{rmse:.2e}"));
    let second = row.truth.map_or_else(|| "-".into(), |_| row.bound.truth.to_string());
    write!(
        f,
        "{:<18}{:>14}{:>12}{:>11}{psnr:>8}{truth:>11}{:>9}{second:>9}{:>9}{:>10.1}  {}",
        row.case,
        row.parameter,
        value(row.value),
        format!("{:.2e}", row.error),
        row.bound.reference,
        row.samples,
        row.ms,
        row.verdict.name()
    )?;
    writeln!(f, "{}", row.why.map_or_else(String::new, |why| format!(": {why}")))
}

/// Short, whatever the magnitude.
fn value(value: f64) -> String {
    if value == 0.0 || (1e-2..1e6).contains(&value.abs()) { value.to_string() } else { format!("{value:e}") }
}
