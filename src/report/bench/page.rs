//! A bench as one self-contained page.

use super::crossover::Pace;
use super::ladder::Family;
use super::{Bench, Metric, Picture, Point, Region};
use crate::error::Result;
use crate::options::Choice;
use crate::report::metrics::Comparison;
use crate::report::page::{Cell, Figure, Page};

/// The page of `bench`; `plots` are captions and SVG documents, of error first.
///
/// # Errors
/// What the image encoder says.
pub fn html(bench: &Bench, pictures: &[Picture], plots: &[(&str, &str)]) -> Result<String> {
    let mut page = Page::new(&format!("Error against run time: {}", bench.scene));
    page.paragraph(&format!(
        "{} triangles ({} specular), {}×{} pixels, {} of them specular. Measured on {} ({}), {} threads; medians of \
         {} runs, taken in turn after one that warmed up, with bars from the 10th to the 90th percentile. Errors \
         are against {} samples a pixel, over sRGB-encoded values. Times of vertex tracing run from the camera \
         to the finished linear image, those of the ray tracer over the image alone; neither holds loading or \
         the building of hierarchies.",
        bench.triangles,
        bench.vt_faces,
        bench.width,
        bench.height,
        bench.vt_pixels,
        bench.device,
        bench.driver,
        bench.threads,
        bench.repeats,
        bench.reference_spp
    ));
    page.heading("Where it pays");
    page.list(bench.findings.iter().map(String::as_str));
    page.heading("The picture");
    let figures = pictures.iter().map(|picture| Figure::image(&picture.caption, &picture.image));
    page.figures(&figures.collect::<Result<Vec<_>>>()?);
    if !plots.is_empty() {
        page.heading("Plots");
        let plots: Vec<Figure> = plots.iter().map(|(caption, svg)| Figure::plot(caption, svg)).collect();
        page.figures(&plots);
    }
    page.heading("At the same error");
    page.paragraph(
        "The ray tracer's time for the error of each point, interpolated between the rungs of its own ladder, \
         logarithm against logarithm; above 1 vertex tracing is faster. ≤ and > are bounds: the error is larger, \
         or smaller, than any of the tracer's.",
    );
    paces(&mut page, bench);
    page.heading("Every point");
    points(&mut page, bench);
    page.heading("Time by stage");
    stages(&mut page, bench);
    scaling(&mut page, bench);
    Ok(page.finish())
}

fn paces(page: &mut Page, bench: &Bench) {
    let region = if bench.vt_pixels > 0 { Region::Vt } else { Region::Whole };
    let cells = |point: &Point| {
        let find = |against: &Family, metric: Metric| {
            point
                .paces
                .iter()
                .find(|pace| (&pace.against, pace.region, pace.metric) == (against, region, metric))
        };
        let mut cells = vec![
            Cell::text(format!("{}, {}", point.family, point.effort)),
            Cell::number(format!("{:.1}", point.time.median_ms)),
        ];
        for against in [Family::Tracer, Family::Hybrid] {
            for metric in [Metric::Rmse, Metric::Flip] {
                let ratio = |pace: &Pace| {
                    let text = format!("{}{:.2}×", pace.at.sign(), pace.ratio);
                    pace.faster().map_or_else(|| Cell::text(&text), |faster| Cell::verdict(faster, &text))
                };
                cells.push(find(&against, metric).map_or(Cell::text("–"), ratio));
            }
        }
        cells
    };
    let rows: Vec<_> = bench.points.iter().filter(|point| point.family.is_ours()).map(cells).collect();
    let head = [
        "Vertex tracing",
        "ms",
        "ray tracer, same RMSE",
        "ray tracer, same FLIP",
        "on specular pixels, same RMSE",
        "on specular pixels, same FLIP",
    ];
    page.table(&head, &rows);
}

fn points(page: &mut Page, bench: &Bench) {
    let errors = |error: Option<&Comparison>| {
        let psnr = |error: &Comparison| error.psnr.map_or("∞".into(), |psnr| format!("{psnr:.1}"));
        match error {
            Some(e) => [format!("{:.5}", e.rmse), psnr(e), format!("{:.4}", e.flip), format!("{:.3}", e.p99)],
            None => std::array::from_fn(|_| "–".into()),
        }
    };
    let row = |point: &Point| {
        let time = point.time;
        let count = |value: Option<u64>| value.map_or("–".into(), |value: u64| value.to_string());
        let mut cells = vec![
            Cell::text(point.family.to_string()),
            Cell::text(&point.effort),
            Cell::number(format!("{:.1}", time.median_ms)),
            Cell::number(format!("{:.1}–{:.1}", time.p10_ms, time.p90_ms)),
            Cell::number(count(point.samples)),
            Cell::number(count(point.rays)),
            Cell::number(point.predicted_error.map_or("–".into(), |error| format!("{error:.2}"))),
        ];
        cells.extend(errors(point.vt.as_ref()).map(Cell::number));
        cells.extend(errors(Some(&point.whole)).map(Cell::number));
        cells
    };
    let head = [
        "Way",
        "Effort",
        "ms",
        "p10–p90",
        "Samples",
        "Rays",
        "Predicted, px",
        "RMSE, VT",
        "PSNR, VT",
        "FLIP, VT",
        "p99, VT",
        "RMSE",
        "PSNR",
        "FLIP",
        "p99",
    ];
    page.table(&head, &bench.points.iter().map(row).collect::<Vec<_>>());
}

fn stages(page: &mut Page, bench: &Bench) {
    let row = |point: &Point| {
        let (t, Family::VertexTracing { antialiasing, .. }) = (point.stages?, &point.family) else {
            return None;
        };
        let floor = bench.floors.iter().find(|floor| floor.antialiasing == *antialiasing);
        let mut cells = vec![Cell::text(format!("{}, {}", point.family, point.effort))];
        let stages =
            [t.visibility, t.readback, t.scan, t.trace, t.refine, t.upload, t.draw, t.smooth, t.frame];
        cells.extend(stages.map(|ms| Cell::number(format!("{ms:.1}"))));
        cells.push(Cell::number(floor.map_or("–".into(), |floor| format!("{:.1}", floor.time.median_ms))));
        Some(cells)
    };
    let head = [
        "Vertex tracing, ms",
        "visibility",
        "readback",
        "scan",
        "trace",
        "refine",
        "upload",
        "draw",
        "smooth",
        "frame",
        "raster floor",
    ];
    page.table(&head, &bench.points.iter().filter_map(row).collect::<Vec<_>>());
    let floors = bench
        .floors
        .iter()
        .map(|floor| format!("{} {:.1} ms", floor.antialiasing.name(), floor.time.median_ms));
    page.paragraph(&format!(
        "The raster floor is a frame of the same run that traces nothing, neither specular objects nor shadows: \
         clear, base pass and resolve; {}.",
        floors.collect::<Vec<_>>().join(", ")
    ));
}

fn scaling(page: &mut Page, bench: &Bench) {
    if bench.scaling.is_empty() {
        return;
    }
    page.heading("Scaling");
    let mut rows = Vec::new();
    for series in &bench.scaling {
        for way in &series.ways {
            let times = way.points.iter().map(|p| format!("{}: {:.1}", p.value, p.time.median_ms));
            let fit = |digits: &dyn Fn(super::fit::Fit) -> f64| {
                Cell::number(way.fit.map_or("–".into(), |fit| format!("{:.2}", digits(fit))))
            };
            rows.push(vec![
                Cell::text(format!("{} ({})", series.axis, series.scene)),
                Cell::text(way.name),
                Cell::text(times.collect::<Vec<_>>().join(", ")),
                fit(&|fit| fit.exponent),
                fit(&|fit| fit.r2),
            ]);
        }
    }
    page.table(&["Axis", "Way", "ms", "Exponent", "r²"], &rows);
    page.paragraph("Exponents are least squares between logarithms; 1 is linear. Devices draw with threads of their own.");
}
