//! Power laws through measured points.

use serde::Serialize;

/// y ∝ x^`exponent`, by least squares between logarithms.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Fit {
    /// The exponent.
    pub exponent: f64,
    /// Share of the variance of log y that the law explains, 0 to 1.
    pub r2: f64,
}

/// The power law nearest to `points`; `None` unless two of them, positive, differ in x.
pub fn power_law(points: &[(f64, f64)]) -> Option<Fit> {
    let logs: Vec<(f64, f64)> = points
        .iter()
        .filter(|(x, y)| *x > 0.0 && *y > 0.0 && x.is_finite() && y.is_finite())
        .map(|(x, y)| (x.ln(), y.ln()))
        .collect();
    let n = logs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| logs.iter().map(of).sum::<f64>() / n;
    let (mx, my) = (mean(|p| p.0), mean(|p| p.1));
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for (x, y) in &logs {
        xx += (x - mx) * (x - mx);
        xy += (x - mx) * (y - my);
        yy += (y - my) * (y - my);
    }
    if logs.len() < 2 || xx <= 1e-18 {
        return None;
    }
    // A constant is explained in full.
    let r2 = if yy <= 1e-18 { 1.0 } else { xy * xy / (xx * yy) };
    Some(Fit { exponent: xy / xx, r2 })
}
