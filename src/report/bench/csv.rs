//! Points and scaling as comma-separated values.

use super::ladder::Family;
use super::{Bench, Metric, Region};
use crate::report::metrics::Comparison;

/// Columns of `bench.csv`, in order. Times are milliseconds; errors over `whole` image and `vt` pixels; a field
/// that does not apply is empty. `tracer_ms` and `ratio` are at the same RMSE over VT pixels, `bound` says
/// whether they are `exactly`, `at-most` or `more-than` that.
pub const COLUMNS: [&str; 23] = [
    "scene",
    "width",
    "height",
    "family",
    "effort",
    "median_ms",
    "p10_ms",
    "p90_ms",
    "runs",
    "samples",
    "rays",
    "predicted_error",
    "rmse_whole",
    "psnr_whole",
    "flip_whole",
    "p99_whole",
    "rmse_vt",
    "psnr_vt",
    "flip_vt",
    "p99_vt",
    "tracer_ms",
    "ratio",
    "bound",
];

/// Columns of `scaling.csv`.
pub const SCALING_COLUMNS: [&str; 8] =
    ["axis", "value", "way", "median_ms", "p10_ms", "p90_ms", "exponent", "r2"];

/// `bench.csv`: one line for each point, after that of [`COLUMNS`].
pub fn points(bench: &Bench) -> String {
    let mut text = line(&COLUMNS.map(String::from));
    for point in &bench.points {
        let pace = point.paces.iter().find(|pace| {
            pace.against == Family::Tracer && pace.region == Region::Vt && pace.metric == Metric::Rmse
        });
        let mut fields = vec![
            bench.scene.clone(),
            bench.width.to_string(),
            bench.height.to_string(),
            point.family.to_string(),
            point.effort.clone(),
            number(point.time.median_ms),
            number(point.time.p10_ms),
            number(point.time.p90_ms),
            point.runs.to_string(),
            point.samples.map_or(String::new(), |samples| samples.to_string()),
            point.rays.map_or(String::new(), |rays| rays.to_string()),
            point.predicted_error.map_or(String::new(), number),
        ];
        fields.extend(errors(Some(&point.whole)));
        fields.extend(errors(point.vt.as_ref()));
        fields.extend([
            pace.map_or(String::new(), |pace| number(pace.at.ms())),
            pace.map_or(String::new(), |pace| number(pace.ratio)),
            pace.map_or(String::new(), |pace| pace.at.name().into()),
        ]);
        text += &line(&fields);
    }
    text
}

/// `scaling.csv`: one line for each measurement, after that of [`SCALING_COLUMNS`].
pub fn scaling(bench: &Bench) -> String {
    let mut text = line(&SCALING_COLUMNS.map(String::from));
    for series in &bench.scaling {
        for way in &series.ways {
            for point in &way.points {
                text += &line(&[
                    series.axis.to_string(),
                    number(point.value),
                    way.name.to_string(),
                    number(point.time.median_ms),
                    number(point.time.p10_ms),
                    number(point.time.p90_ms),
                    way.fit.map_or(String::new(), |fit| number(fit.exponent)),
                    way.fit.map_or(String::new(), |fit| number(fit.r2)),
                ]);
            }
        }
    }
    text
}

fn errors(error: Option<&Comparison>) -> [String; 4] {
    let Some(error) = error else { return Default::default() };
    [number(error.rmse), error.psnr.map_or("inf".into(), number), number(error.flip), number(error.p99)]
}

/// Six digits that matter, without an exponent.
fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let digits = (5 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    format!("{value:.digits$}")
}

/// Fields with commas, quotes or line breaks are quoted (RFC 4180).
fn line(fields: &[String]) -> String {
    let quoted = fields.iter().map(|field| {
        if field.contains([',', '"', '\n', '\r']) {
            format!("\"{}\"", field.replace('"', "\"\""))
        } else {
            field.clone()
        }
    });
    quoted.collect::<Vec<_>>().join(",") + "\n"
}
