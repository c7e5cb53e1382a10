//! A case as a plot: errors and their bounds against the parameter.

use plotters::prelude::*;

use super::Row;

/// Width and height of a plot in pixels.
const SIZE: (u32, u32) = (640, 400);
/// Against the reference, and against the truth; told apart without red against green.
const COLORS: [RGBColor; 2] = [RGBColor(0, 114, 178), RGBColor(213, 94, 0)];
/// Smallest error that is told apart from none.
const FLOOR: f64 = 1e-8;

/// The plot of one case's rows as an SVG document: logarithmic errors over the values in their order, which are
/// evenly spaced, since many sweeps span decades or pass zero.
///
/// # Errors
/// What the plotting library says.
pub fn svg(rows: &[Row]) -> Result<String, Box<dyn std::error::Error + Send + Sync>> {
    let Some(first) = rows.first() else { return Ok(String::new()) };
    let bound = first.bound;
    let error = |row: &Row| Some(row.error);
    let truth = |row: &Row| row.truth;
    type Series<'r> = (&'static str, &'r dyn Fn(&Row) -> Option<f64>, f64);
    let series: [Series; 2] = [("reference tracer", &error, bound.reference), ("truth", &truth, bound.truth)];
    let largest =
        rows.iter().flat_map(|row| [row.error, row.truth.unwrap_or(0.0)]).fold(bound.reference, f64::max);

    let mut document = String::new();
    {
        let area = SVGBackend::with_string(&mut document, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .caption(first.case, ("sans-serif", 20))
            .margin(12)
            .x_label_area_size(40)
            .y_label_area_size(70)
            .build_cartesian_2d(
                -0.5..rows.len() as f64 - 0.5,
                (FLOOR..(largest * 3.0).max(FLOOR * 10.0)).log_scale(),
            )?;
        let label = |x: &f64| {
            let row = (x.round() == *x && *x >= 0.0).then(|| rows.get(*x as usize)).flatten();
            row.map_or_else(String::new, |row| format!("{:e}", row.value))
        };
        chart
            .configure_mesh()
            .x_desc(first.parameter)
            .y_desc("RMSE")
            .x_labels(rows.len() * 2 + 1)
            .x_label_formatter(&label)
            .y_label_formatter(&|y| format!("{y:e}"))
            .draw()?;
        for ((name, value, bound), color) in series.into_iter().zip(COLORS) {
            let points: Vec<(f64, f64)> = rows
                .iter()
                .enumerate()
                .filter_map(|(x, row)| Some((x as f64, value(row)?.max(FLOOR))))
                .collect();
            if points.is_empty() {
                continue;
            }
            let ends = [(-0.5, bound.max(FLOOR)), (rows.len() as f64 - 0.5, bound.max(FLOOR))];
            chart.draw_series(LineSeries::new(ends, color.mix(0.4)))?;
            chart
                .draw_series(LineSeries::new(points, color.stroke_width(2)).point_size(3))?
                .label(name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::LowerLeft)
            .background_style(WHITE.mix(0.8))
            .border_style(BLACK)
            .draw()?;
        area.present()?;
    }
    Ok(document)
}
