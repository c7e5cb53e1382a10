//! What a bench shows, in sentences made from its numbers.

use super::crossover::{At, Crossing, Pace, crossings, front};
use super::fit::power_law;
use super::ladder::Family;
use super::{Bench, Metric, Point, Region};

/// Every finding of a bench, in the order of importance.
pub fn findings(bench: &Bench) -> Vec<String> {
    let region = if bench.vt_pixels > 0 { Region::Vt } else { Region::Whole };
    let mut lines = Vec::new();
    if bench.vt_pixels == 0 {
        lines.push("No pixel shows a specular object: there is nothing for vertex tracing to gain.".into());
    }
    for against in [Family::Tracer, Family::Hybrid] {
        let best = unbeaten(bench, region, Metric::Rmse);
        lines.extend(pays("Vertex tracing at its best", &best, &against, region, Metric::Rmse));
    }
    for against in [Family::Tracer, Family::Hybrid] {
        for family in families(bench) {
            let points: Vec<&Point> = bench.points.iter().filter(|point| point.family == family).collect();
            lines.extend(pays(&capital(&family.to_string()), &points, &against, region, Metric::Rmse));
        }
    }
    lines.extend(floor(bench));
    lines.extend(predicted(bench));
    lines
}

/// The ways of ours, in the order that they were measured.
pub fn families(bench: &Bench) -> Vec<Family> {
    let mut families: Vec<Family> = Vec::new();
    for point in bench.points.iter().filter(|point| point.family.is_ours()) {
        if !families.contains(&point.family) {
            families.push(point.family.clone());
        }
    }
    families
}

/// The points of ours, of whatever way, that no faster one of ours betters.
fn unbeaten(bench: &Bench, region: Region, metric: Metric) -> Vec<&Point> {
    let place = |point: &Point| Some((point.time.median_ms, metric.of(point.error(region)?)));
    let ours = || bench.points.iter().filter(|point| point.family.is_ours());
    let front = front(ours().filter_map(place).collect());
    ours().filter(|point| place(point).is_some_and(|place| front.contains(&place))).collect()
}

/// Whether, and where, `points` of ours take less time than a tracer for the same error.
fn pays(name: &str, points: &[&Point], against: &Family, region: Region, metric: Metric) -> Option<String> {
    let wanted = |pace: &&Pace| (&pace.against, pace.region, pace.metric) == (against, region, metric);
    let rungs: Vec<(&Point, &Pace)> =
        points.iter().filter_map(|point| Some((*point, point.paces.iter().find(wanted)?))).collect();
    let (told_apart, unknown): (Vec<_>, Vec<_>) =
        rungs.into_iter().partition(|(_, pace)| pace.faster().is_some());
    let one_way = points.windows(2).all(|pair| pair[0].family == pair[1].family);
    let effort = |point: &Point| {
        if one_way { point.effort.clone() } else { format!("{}, {}", point.family, point.effort) }
    };
    let unknown: Vec<String> = unknown.iter().map(|(point, _)| effort(point)).collect();
    let beyond = match unknown.as_slice() {
        [] => String::new(),
        unknown => format!("; not told, beyond the ends of the ray tracer's ladder: {}", unknown.join("; ")),
    };
    let name = format!("{name} against the {against}, same {} over {}", metric.words(), of(region));
    let by_ratio = |a: &&(&Point, &Pace), b: &&(&Point, &Pace)| a.1.ratio.total_cmp(&b.1.ratio);
    let (Some(best), Some(worst)) = (told_apart.iter().max_by(by_ratio), told_apart.iter().min_by(by_ratio))
    else {
        return (!unknown.is_empty()).then(|| format!("{name}{beyond}."));
    };
    let range = match told_apart.as_slice() {
        [_] => told(best.1, &effort(best.0)),
        _ => format!("{} to {}", told(worst.1, &effort(worst.0)), told(best.1, &effort(best.0))),
    };
    let verdict = match (best.1.faster(), worst.1.faster()) {
        (_, Some(true)) => "pays at every effort".into(),
        (Some(false), _) => "does not pay at any effort".into(),
        _ => {
            let side = |(point, pace): &(&Point, &Pace)| {
                let error = point.error(region).map_or(0.0, |error| metric.of(error));
                (error, pace.ratio, point.time.median_ms)
            };
            passes(&crossings(told_apart.iter().map(side).collect()), metric)
        }
    };
    Some(format!("{name}: {verdict}: {range}{beyond}."))
}

/// On which sides of the crossings it pays.
fn passes(crossings: &[Crossing], metric: Metric) -> String {
    let at =
        |crossing: &Crossing| format!("{} {:.4} ({:.0} ms)", metric.words(), crossing.error, crossing.ms);
    match crossings {
        [only] if only.faster_before => format!("pays above {}", at(only)),
        [only] => format!("pays below {}", at(only)),
        [first, second] if first.faster_before => {
            format!("pays above {} and below {}", at(first), at(second))
        }
        [first, second] => format!("pays between {} and {}", at(first), at(second)),
        several => {
            let several: Vec<String> = several.iter().map(at).collect();
            format!("pays here and there, with crossovers at {}", several.join(", "))
        }
    }
}

/// `1.4 times as fast with 4000 samples`, or a bound on it.
fn told(pace: &Pace, effort: &str) -> String {
    let bound = match pace.at {
        At::Exactly(_) => "",
        At::AtMost(_) => "at most ",
        At::MoreThan(_) => "more than ",
    };
    format!("{bound}{} times as fast ({effort})", factor(pace.ratio))
}

/// Two digits that matter.
fn factor(ratio: f64) -> String {
    match ratio {
        10.0.. => format!("{ratio:.0}"),
        1.0.. => format!("{ratio:.1}"),
        _ => format!("{ratio:.2}"),
    }
}

fn of(region: Region) -> &'static str {
    match region {
        Region::Vt => "VT pixels",
        Region::Whole => "the whole image",
    }
}

/// How much of the cheapest frame is rasterisation that no ray tracing replaces.
fn floor(bench: &Bench) -> Vec<String> {
    let line = |floor: &super::Floor| {
        let smoothed = |family: &Family| matches!(family, Family::VertexTracing { antialiasing, .. } if *antialiasing == floor.antialiasing);
        let cheapest = bench
            .points
            .iter()
            .filter(|point| smoothed(&point.family))
            .min_by(|a, b| a.time.median_ms.total_cmp(&b.time.median_ms))?;
        let share = 100.0 * floor.time.median_ms / cheapest.time.median_ms.max(1e-9);
        Some(format!(
            "Raster floor with {}: {:.1} ms, {share:.0} % of the fastest frame ({}, {:.1} ms).",
            crate::options::Choice::name(floor.antialiasing),
            floor.time.median_ms,
            cheapest.effort,
            cheapest.time.median_ms
        ))
    };
    bench.floors.iter().filter_map(line).collect()
}

/// Whether the predicted error tells the measured one, for the way that comes nearest to the reference: in the
/// others aliasing, which nothing predicts, hides it.
fn predicted(bench: &Bench) -> Option<String> {
    let error = |point: &Point| point.vt.as_ref().map_or(f64::INFINITY, |error| error.rmse);
    let ours = bench.points.iter().filter(|point| point.family.is_ours());
    let family = &ours.min_by(|a, b| error(a).total_cmp(&error(b)))?.family;
    let points = prediction(bench, family);
    let fit = power_law(&points)?;
    Some(format!(
        "{}: measured RMSE over VT pixels grows with the predicted displacement to the power of {:.2} (r² {:.2}, {} \
         points).",
        capital(&family.to_string()),
        fit.exponent,
        fit.r2,
        points.len()
    ))
}

/// Predicted displacement in pixels, and measured RMSE over VT pixels, of every point of `family` that has both.
pub fn prediction(bench: &Bench, family: &Family) -> Vec<(f64, f64)> {
    let pair = |point: &Point| Some((point.predicted_error?, point.vt.as_ref()?.rmse));
    let points = bench.points.iter().filter(|point| point.family == *family);
    points.filter_map(pair).filter(|(predicted, rmse)| *predicted > 0.0 && *rmse > 0.0).collect()
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}
