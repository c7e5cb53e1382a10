//! A bench as plots: error against time and rays, prediction, scaling; logarithmic axes.

use plotters::coord::Shift;
use plotters::coord::combinators::BindKeyPoints;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;

use super::ladder::Family;
use super::scaling::Series;
use super::{Bench, Metric, Point, Region, words};
use crate::report::metrics::Comparison;

/// Width and height of a plot in pixels: readable on a phone.
const SIZE: (u32, u32) = (560, 440);
/// Colours that are told apart without red against green, on black and on white.
const COLORS: [RGBColor; 9] = [
    RGBColor(0, 114, 178),
    RGBColor(86, 180, 233),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(150, 110, 200),
    RGBColor(190, 170, 40),
    RGBColor(213, 94, 0),
    RGBColor(230, 159, 0),
    RGBColor(128, 128, 128),
];

/// A plot as an SVG document of black on white.
pub struct Plot {
    /// The file's stem.
    pub name: String,
    /// What it shows.
    pub caption: String,
    /// The document.
    pub svg: String,
}

/// What the plotting library says.
type Failure = Box<dyn std::error::Error + Send + Sync>;

/// A point of a plot: x, y, and the ends of a bar along x.
type Mark = (f64, f64, Option<(f64, f64)>);

/// A line of a plot.
struct Line {
    name: String,
    points: Vec<Mark>,
    joined: bool,
}

/// Every plot of a bench; those of VT pixels only where there are any.
///
/// # Errors
/// What the plotting library says.
pub fn all(bench: &Bench) -> Result<Vec<Plot>, Failure> {
    let mut plots = Vec::new();
    for region in Region::ALL {
        for (metric, words) in
            [("rmse", "RMSE"), ("flip", "mean FLIP"), ("p99", "99th percentile"), ("psnr", "PSNR in dB")]
        {
            for (cost, cost_words) in [("time", "ms"), ("rays", "rays")] {
                let lines = error_lines(bench, region, metric, cost);
                if lines.is_empty() {
                    continue;
                }
                let caption = format!(
                    "{words}, {}, against {}",
                    region.words(),
                    if cost == "time" { "time" } else { "rays" }
                );
                let region = if region == Region::Vt { "vt" } else { "whole" };
                let svg = svg(&lines, cost_words, words, metric == "psnr")?;
                plots.push(Plot { name: format!("{metric}_{region}_{cost}"), caption, svg });
            }
        }
    }
    let predicted = |family: &Family| Line {
        name: family.to_string(),
        points: words::prediction(bench, family).into_iter().map(|(x, y)| (x, y, None)).collect(),
        joined: true,
    };
    let lines: Vec<Line> = words::families(bench).iter().map(predicted).collect();
    if lines.iter().any(|line| !line.points.is_empty()) {
        plots.push(Plot {
            name: "prediction".into(),
            caption: "Measured RMSE over VT pixels against predicted displacement".into(),
            svg: svg(&lines, "predicted displacement in pixels", "RMSE", false)?,
        });
    }
    for series in &bench.scaling {
        plots.push(scaling(series)?);
    }
    Ok(plots)
}

fn error_lines(bench: &Bench, region: Region, metric: &str, cost: &str) -> Vec<Line> {
    let value = |error: &Comparison| match metric {
        "psnr" => error.psnr,
        "rmse" => Some(Metric::Rmse.of(error)),
        "flip" => Some(Metric::Flip.of(error)),
        _ => Some(Metric::P99.of(error)),
    };
    let at = |point: &Point| {
        let error = value(point.error(region)?).filter(|error| *error > 0.0)?;
        if cost == "time" {
            let time = point.time;
            return Some((time.median_ms, error, Some((time.p10_ms, time.p90_ms))));
        }
        Some((point.rays? as f64, error, None))
    };
    let mut lines: Vec<Line> = Vec::new();
    for point in &bench.points {
        let Some(place) = at(point).filter(|place| place.0 > 0.0) else { continue };
        let name = point.family.to_string();
        match lines.iter_mut().find(|line| line.name == name) {
            Some(line) => line.points.push(place),
            None => lines.push(Line { name, points: vec![place], joined: true }),
        }
    }
    lines
}

fn scaling(series: &Series) -> Result<Plot, Failure> {
    let lines: Vec<Line> = series
        .ways
        .iter()
        .map(|way| Line {
            name: way
                .fit
                .map_or(way.name.into(), |fit| format!("{}: exponent {:.2}", way.name, fit.exponent)),
            points: way
                .points
                .iter()
                .map(|p| (p.value, p.time.median_ms, None))
                .filter(|point| point.0 > 0.0 && point.1 > 0.0)
                .collect(),
            joined: true,
        })
        .collect();
    Ok(Plot {
        name: format!("scaling_{}", series.axis),
        caption: format!("Time against {}, {}", series.axis, series.scene),
        svg: svg(&lines, series.axis, "ms", false)?,
    })
}

/// Draws `lines`; x is logarithmic, and y too unless `linear_y`.
fn svg(lines: &[Line], x_words: &str, y_words: &str, linear_y: bool) -> Result<String, Failure> {
    let points = || lines.iter().flat_map(|line| &line.points);
    let ends = |point: &Mark| point.2.map_or([point.0; 2], |(low, high)| [low, high]);
    let x = range(points().flat_map(ends), 1.15);
    let y = range(points().map(|point| point.1), 1.25);
    let mut document = String::new();
    {
        let area = SVGBackend::with_string(&mut document, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        if linear_y {
            let y = range(points().map(|point| point.1), 1.05);
            draw(&area, lines, logarithmic(x), y, x_words, y_words)?;
        } else {
            draw(&area, lines, logarithmic(x), logarithmic(y), x_words, y_words)?;
        }
        area.present()?;
    }
    Ok(document)
}

fn draw<'a, X, Y>(
    area: &DrawingArea<SVGBackend<'a>, Shift>,
    lines: &[Line],
    x: X,
    y: Y,
    x_words: &str,
    y_words: &str,
) -> Result<(), Failure>
where
    X: AsRangedCoord<Value = f64>,
    Y: AsRangedCoord<Value = f64>,
    X::CoordDescType: ValueFormatter<f64>,
    Y::CoordDescType: ValueFormatter<f64>,
{
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .x_label_area_size(44)
        .y_label_area_size(68)
        .margin_top(16 + 17 * lines.len() as u32)
        .build_cartesian_2d(x, y)?;
    chart
        .configure_mesh()
        .x_desc(x_words)
        .y_desc(y_words)
        .x_labels(6)
        .y_labels(6)
        .max_light_lines(1)
        .x_label_formatter(&|value| plain(*value))
        .y_label_formatter(&|value| plain(*value))
        .label_style(("sans-serif", 14))
        .axis_desc_style(("sans-serif", 15))
        .draw()?;
    for (index, (line, color)) in lines.iter().zip(COLORS.into_iter().cycle()).enumerate() {
        if line.joined {
            chart.draw_series(LineSeries::new(
                line.points.iter().map(|p| (p.0, p.1)),
                color.stroke_width(2),
            ))?;
        }
        chart.draw_series(line.points.iter().map(|p| Circle::new((p.0, p.1), 3, color.filled())))?;
        let bars = line.points.iter().filter_map(|p| Some((p.1, p.2?)));
        chart.draw_series(
            bars.map(|(y, (low, high))| PathElement::new([(low, y), (high, y)], color.stroke_width(1))),
        )?;
        let top = 14 + 17 * index as i32;
        area.draw(&PathElement::new([(72, top), (92, top)], color.stroke_width(3)))?;
        area.draw(&Text::new(line.name.clone(), (98, top - 7), ("sans-serif", 14)))?;
    }
    Ok(())
}

/// A logarithmic axis, labelled at 1, 2 and 5 of every decade, or at decades alone where they are many.
fn logarithmic(
    range: std::ops::Range<f64>,
) -> impl AsRangedCoord<Value = f64, CoordDescType: ValueFormatter<f64>> {
    let decades = range.start.log10().floor() as i32..=range.end.log10().floor() as i32;
    let steps: &[f64] = if decades.clone().count() > 3 { &[1.0] } else { &[1.0, 2.0, 5.0] };
    let labels = decades.flat_map(|decade| steps.iter().map(move |step| step * 10_f64.powi(decade)));
    let labels = labels.filter(|label| range.contains(label)).collect();
    (range.start..range.end).log_scale().with_key_points(labels)
}

/// The range of positive `values`, widened by the factor `margin`.
fn range(values: impl Iterator<Item = f64>, margin: f64) -> std::ops::Range<f64> {
    let (low, high) = values
        .filter(|value| *value > 0.0 && value.is_finite())
        .fold((f64::INFINITY, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
    if low > high { 0.5..2.0 } else { low / margin..high * margin }
}

/// A short number: `0.002`, `40`, `20k`, `3M`.
fn plain(value: f64) -> String {
    let trimmed = |value: f64, unit: &str| {
        let digits = (2 - value.abs().log10().floor() as i32).clamp(0, 6) as usize;
        let text = format!("{value:.digits$}");
        let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
        format!("{text}{unit}")
    };
    match value {
        0.0 => "0".into(),
        1e6.. => trimmed(value / 1e6, "M"),
        1e4.. => trimmed(value / 1e3, "k"),
        _ => trimmed(value, ""),
    }
}
