//! A profile as a plot: what each way costs against the number of pixels.

use std::collections::BTreeMap;

use plotters::prelude::*;

use super::{Profile, Row};

/// Width and height of the plot in pixels.
const SIZE: (u32, u32) = (900, 560);
/// One for each line, told apart without red against green.
const COLORS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
];

/// The plot as an SVG document: milliseconds of every way and memory at the scene's sizes, a plain copy of
/// the ID buffer's bytes, and the paper's figures.
///
/// # Errors
/// What the plotting library says.
pub fn svg(profile: &Profile) -> Result<String, Box<dyn std::error::Error + Send + Sync>> {
    let scene = profile.rows.first().map_or(0, |row| row.triangles);
    let mut lines: BTreeMap<String, Vec<(f64, f64)>> = BTreeMap::new();
    for row in profile.rows.iter().filter(|row| row.stage == "total" && row.triangles == scene) {
        let name = format!("{}, {}", row.way, if row.in_place { "in place" } else { row.memory });
        lines.entry(name).or_default().push((megapixels(row), row.spread.median_ms));
        if row.way == "id-buffer"
            && let Some(copy) = profile.memcpy.iter().find(|copy| copy.bytes == row.bytes)
        {
            let points = lines.entry("plain copy".into()).or_default();
            let point = (megapixels(row), copy.spread.median_ms);
            if !points.contains(&point) {
                points.push(point);
            }
        }
    }
    let paper = f64::from(profile.paper.width * profile.paper.height) * 1e-6;
    let paper =
        [(paper, profile.paper.read_ms[0]), (paper, profile.paper.read_ms[1] + profile.paper.scan_ms)];
    let points = || lines.values().flatten().chain(&paper);
    let most = |values: &mut dyn Iterator<Item = f64>| values.fold(1e-3, f64::max) * 1.2;
    let least = points().map(|point| point.1).filter(|ms| *ms > 0.0).fold(1.0, f64::min) / 1.5;

    let mut document = String::new();
    {
        let area = SVGBackend::with_string(&mut document, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .caption(format!("Finding visible faces: {}", profile.device), ("sans-serif", 20))
            .margin(12)
            .x_label_area_size(40)
            .y_label_area_size(60)
            .build_cartesian_2d(
                0.0..most(&mut points().map(|point| point.0)),
                (least..most(&mut points().map(|point| point.1))).log_scale(),
            )?;
        chart.configure_mesh().x_desc("million pixels").y_desc("ms").draw()?;
        for ((name, points), color) in lines.iter().zip(COLORS.into_iter().cycle()) {
            chart
                .draw_series(LineSeries::new(points.iter().copied(), color.stroke_width(2)).point_size(3))?
                .label(name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
        }
        chart
            .draw_series(LineSeries::new(paper, BLACK.stroke_width(4)))?
            .label("paper, 2003: read and scan")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], BLACK.stroke_width(4)));
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::LowerRight)
            .background_style(WHITE.mix(0.8))
            .border_style(BLACK)
            .draw()?;
        area.present()?;
    }
    Ok(document)
}

fn megapixels(row: &Row) -> f64 {
    f64::from(row.width) * f64::from(row.height) * 1e-6
}
