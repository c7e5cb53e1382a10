//! The numbers' path of a bench: from images and times of a clock that the test sets to rungs, ratios, words,
//! files and the page.

use std::cell::Cell;
use std::collections::BTreeSet;
use std::fs;
use std::process::{Command, Output};
use std::sync::{Arc, Mutex};

use proptest::prelude::*;
use vertex_tracing::gpu::Gpu;
use vertex_tracing::options::{Reconstruction, Ss};
use vertex_tracing::report::bench::crossover::{self, At, time_at};
use vertex_tracing::report::bench::fit::{Fit, power_law};
use vertex_tracing::report::bench::ladder::{Antialiasing, Family, Job, Ladder, Outside, Rate};
use vertex_tracing::report::bench::measure::measure;
use vertex_tracing::report::bench::rounds::{Observer, rounds};
use vertex_tracing::report::bench::scaling::{Sample, Series, Way};
use vertex_tracing::report::bench::{Bench, Floor, Picture, Point, csv, page, words};
use vertex_tracing::report::output::write_image;
use vertex_tracing::report::profile::Spread;
use vertex_tracing::report::stats::Times;
use vertex_tracing::report::{Comparison, Encoding, FloatImage, compare};
use vertex_tracing::scene::demo::Demo;

/// An image that is `by` from black in every channel, of 4×4 pixels.
fn off(by: f32) -> FloatImage {
    FloatImage::from_fn(4, 4, |_, _| [by; 3])
}

/// The error of a known pair: linear values, so that RMSE is `by` itself.
fn error(by: f32) -> Comparison {
    compare(&off(0.0), &off(by), None, Encoding::Linear).unwrap()
}

fn ours() -> Family {
    Family::VertexTracing { reconstruction: Reconstruction::Exact, antialiasing: Antialiasing::None }
}

fn point(family: Family, effort: &str, ms: f64, by: f32) -> Point {
    Point {
        family,
        effort: effort.into(),
        time: Spread { median_ms: ms, p10_ms: ms * 0.9, p90_ms: ms * 1.1 },
        runs: 5,
        samples: Some(100),
        rays: Some(1000),
        predicted_error: Some(f64::from(by) * 100.0),
        stages: Some(Times { draw: ms * 0.5, frame: ms, ..Times::default() }),
        whole: error(by),
        vt: Some(error(by)),
        paces: Vec::new(),
    }
}

/// A tracer of 100, 200 and 400 ms for errors of 0.4, 0.2 and 0.1, and points of ours.
fn bench(own: &[(f64, f32)]) -> Bench {
    let mut points: Vec<Point> = own
        .iter()
        .enumerate()
        .map(|(index, &(ms, by))| point(ours(), &format!("{} samples", 100 * (index + 1)), ms, by))
        .collect();
    for (spp, ms, by) in [(1, 100.0, 0.4), (4, 200.0, 0.2), (16, 400.0, 0.1)] {
        points.push(point(Family::Tracer, &format!("{spp} spp"), ms, by));
    }
    for index in 0..own.len() {
        points[index].paces = crossover::paces(&points[index], &points);
    }
    let floor = Spread { median_ms: 5.0, p10_ms: 4.0, p90_ms: 6.0 };
    let mut bench = Bench {
        scene: "a <scene>, \"quoted\"".into(),
        triangles: 12,
        vt_faces: 6,
        width: 4,
        height: 4,
        vt_pixels: 8,
        device: "device".into(),
        driver: "driver & version".into(),
        threads: 2,
        repeats: 5,
        reference_spp: 64,
        points,
        floors: vec![Floor { antialiasing: Antialiasing::None, time: floor }],
        findings: Vec::new(),
        scaling: Vec::new(),
    };
    bench.findings = words::findings(&bench);
    bench
}

fn series() -> Series {
    let time = |ms| Spread { median_ms: ms, p10_ms: ms, p90_ms: ms };
    let points = [(1.0, 3.0), (4.0, 6.0)].map(|(value, ms)| Sample { value, time: time(ms) });
    let fit = Some(Fit { exponent: 0.5, r2: 1.0 });
    Series {
        axis: "pixels",
        scene: "cup".into(),
        ways: vec![Way { name: "ray tracer, 1 spp", points: points.into(), fit }],
    }
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-6 * b.abs().max(1.0)
}

#[test]
fn time_at_the_same_error_is_interpolated_between_logarithms() {
    let ladder = [(100.0, 0.4), (200.0, 0.2), (400.0, 0.1)];
    // Error is inverse to time here, between rungs too.
    let Some(At::Exactly(ms)) = time_at(&ladder, 0.3) else { panic!() };
    assert!(near(ms, 40.0 / 0.3), "{ms}");
    assert_eq!(time_at(&ladder, 0.2), Some(At::Exactly(200.0)));
    assert_eq!(time_at(&ladder, 0.4), Some(At::Exactly(100.0)));
    assert_eq!(time_at(&ladder, 0.1), Some(At::Exactly(400.0)));
    assert_eq!(time_at(&ladder, 0.5), Some(At::AtMost(100.0)));
    assert_eq!(time_at(&ladder, 0.09), Some(At::MoreThan(400.0)));
    assert_eq!(time_at(&[], 0.1), None);
    // A rung that a faster one betters does not count, nor does the order.
    let worse = [(400.0, 0.1), (300.0, 0.5), (100.0, 0.4), (200.0, 0.2)];
    assert_eq!(time_at(&worse, 0.3), time_at(&ladder, 0.3));
    // An error of nothing has no logarithm.
    let Some(At::Exactly(ms)) = time_at(&[(100.0, 0.4), (200.0, 0.0)], 0.1) else { panic!() };
    assert!((100.0..200.0).contains(&ms), "{ms}");
}

proptest! {
    #[test]
    fn time_at_the_same_error_never_grows_with_the_error(
        ladder in prop::collection::vec((1.0_f64..1e4, 1e-4_f64..1.0), 1..8),
        mut errors in prop::collection::vec(1e-5_f64..1.5, 2),
    ) {
        errors.sort_by(f64::total_cmp);
        let [strict, lax] = [errors[0], errors[1]].map(|error| time_at(&ladder, error).unwrap().ms());
        prop_assert!(strict >= lax * (1.0 - 1e-9), "{strict} < {lax}");
    }
}

#[test]
fn ratios_come_from_the_same_error_by_each_measure() {
    let bench = bench(&[(50.0, 0.3), (10.0, 0.8), (1000.0, 0.05)]);
    let pace = |index: usize, region: &str, metric: &str| {
        let paces = serde_json::to_value(&bench.points[index].paces).unwrap();
        let found = paces.as_array().unwrap().iter().find(|pace| {
            pace["region"] == region && pace["metric"] == metric && pace["against"] == "ray tracer"
        });
        found.cloned().unwrap_or_else(|| panic!("{paces}"))
    };
    for region in ["vt", "whole"] {
        let between = pace(0, region, "rmse");
        assert!(near(between["ratio"].as_f64().unwrap(), 40.0 / 0.3 / 50.0), "{between}");
        assert_eq!(between["bound"], "exactly");
    }
    assert_eq!(
        (pace(1, "vt", "rmse")["bound"].clone(), pace(1, "vt", "rmse")["ratio"].as_f64()),
        ("at-most".into(), Some(10.0))
    );
    assert_eq!(
        (pace(2, "vt", "rmse")["bound"].clone(), pace(2, "vt", "rmse")["ratio"].as_f64()),
        ("more-than".into(), Some(0.4))
    );
    assert!(pace(0, "vt", "flip")["ratio"].as_f64() > Some(0.0));
    assert!(bench.points[3].paces.is_empty(), "a tracer has no pace against itself");
}

#[test]
fn words_say_where_it_pays() {
    let first = |own: &[(f64, f32)]| bench(own).findings[1].clone();
    let always = first(&[(20.0, 0.4), (50.0, 0.2)]);
    assert!(
        always.contains("pays at every effort: 4.0 times as fast (200 samples) to 5.0 times"),
        "{always}"
    );
    assert!(always.starts_with("Vertex tracing, exact, ss1 against the ray tracer, same RMSE"), "{always}");
    let never = first(&[(200.0, 0.4), (500.0, 0.2)]);
    assert!(
        never.contains("does not pay at any effort: 0.40 times as fast (200 samples) to 0.50"),
        "{never}"
    );
    // Faster by 2 at 0.4, slower by 2 at 0.1: alike at 0.2, where it takes 200 ms.
    let crossed = first(&[(50.0, 0.4), (800.0, 0.1)]);
    assert!(crossed.contains("pays above RMSE 0.2000 (200 ms): 0.50 times as fast (200"), "{crossed}");
    let other_way = first(&[(200.0, 0.4), (200.0, 0.1)]);
    assert!(other_way.contains("pays below RMSE 0.2000 (200 ms): 0.50 times as fast (100"), "{other_way}");
    let bound = first(&[(50.0, 0.5), (20.0, 0.05)]);
    let told = "pays at every effort: more than 20 times as fast (200 samples); not told, beyond the ends";
    assert!(bound.contains(told) && bound.ends_with("ladder: 100 samples."), "{bound}");
    let between = first(&[(200.0, 0.4), (100.0, 0.2), (800.0, 0.1)]);
    assert!(
        between.contains("pays between RMSE 0.2828 (141 ms) and RMSE 0.1414 (283 ms): 0.50"),
        "{between}"
    );
    // The best of ours leaves out what a faster point of ours betters, here the first.
    let best = bench(&[(90.0, 0.3), (50.0, 0.2), (500.0, 0.15)]).findings[0].clone();
    let told =
        "Vertex tracing at its best against the ray tracer, same RMSE over VT pixels: pays above RMSE 0.1";
    assert!(best.starts_with(told) && best.contains("0.53 times as fast (300 samples)"), "{best}");
    assert!(best.contains("to 4.0 times as fast (200 samples)"), "{best}");
    // Other sentences: the floor, and what prediction is worth.
    let all = bench(&[(20.0, 0.4), (50.0, 0.2)]).findings.join("\n");
    assert!(
        all.contains("Raster floor with ss1: 5.0 ms, 25 % of the fastest frame (100 samples, 20.0 ms)."),
        "{all}"
    );
    assert!(all.contains("to the power of 1.00 (r² 1.00, 2 points)"), "{all}");
}

#[test]
fn power_laws_are_fitted() {
    let law = |x: f64| (x, 3.0 * x.powf(0.75));
    let fit = power_law(&[law(1.0), law(10.0), law(50.0)]).unwrap();
    assert!(near(fit.exponent, 0.75) && near(fit.r2, 1.0), "{fit:?}");
    let constant = power_law(&[(1.0, 5.0), (2.0, 5.0)]).unwrap();
    assert!(near(constant.exponent, 0.0) && near(constant.r2, 1.0), "{constant:?}");
    // By hand: logarithms (0, 0), (1, 2), (2, 1) have the slope 1/2 and the correlation 1/2.
    let e = |power: f64| power.exp();
    let fit = power_law(&[(e(0.0), e(0.0)), (e(1.0), e(2.0)), (e(2.0), e(1.0))]).unwrap();
    assert!(near(fit.exponent, 0.5) && near(fit.r2, 0.25), "{fit:?}");
    assert_eq!(power_law(&[(1.0, 5.0)]), None);
    assert_eq!(power_law(&[(2.0, 5.0), (2.0, 6.0)]), None);
    assert_eq!(power_law(&[(0.0, 5.0), (2.0, 6.0)]), None);
}

/// Remembers what it is told.
#[derive(Default)]
struct Heard(Mutex<Vec<f32>>);

impl Observer for Heard {
    fn stage(&self, _: &'static str) {}
    fn share(&self, share: f32) {
        self.0.lock().unwrap().push(share);
    }
}

#[test]
fn jobs_take_turns_under_a_clock_that_the_test_sets() {
    let clock = Cell::new(0.0);
    let costs = [1.0, 10.0, 100.0];
    let heard = Heard::default();
    let mut order = Vec::new();
    // The machine is twice as slow in the last round, for all alike.
    let runs = rounds(&costs, 3, &heard, |job| {
        let started = clock.get();
        let slow = if order.len() >= 6 { 2.0 } else { 1.0 };
        clock.set(started + costs[job] * slow);
        order.push(job);
        Ok((clock.get() - started, job))
    })
    .unwrap();
    assert_eq!(order, [0, 1, 2, 2, 1, 0, 0, 1, 2]);
    for (job, runs) in runs.iter().enumerate() {
        let times: Vec<f64> = runs.iter().map(|run| run.0).collect();
        assert_eq!(times, [costs[job], costs[job], 2.0 * costs[job]]);
        assert_eq!(Spread::of(times).median_ms, costs[job]);
        assert!(runs.iter().all(|run| run.1 == job));
    }
    let heard = heard.0.into_inner().unwrap();
    assert!(heard.is_sorted() && near(heard[8].into(), 1.0) && near(heard[2].into(), 1.0 / 3.0), "{heard:?}");
}

#[test]
fn rates_are_read_and_written() {
    for (text, spp, side) in [("1/4", 1, 2), ("1/16", 1, 4), ("1", 1, 1), ("16", 16, 1)] {
        let rate: Rate = text.parse().unwrap();
        assert_eq!((rate.spp, rate.side, rate.to_string().as_str()), (spp, side, text));
    }
    for wrong in ["0", "1/3", "2/4", "-1", "", "1/", "99999", "1/99999"] {
        assert!(wrong.parse::<Rate>().is_err(), "{wrong}");
    }
    let supersampling = Rate::LADDER.map(Rate::supersampling);
    assert_eq!(supersampling, [Ss::One, Ss::One, Ss::One, Ss::Four, Ss::Four, Ss::Sixteen]);
}

#[test]
fn ladders_rise() {
    let ladder = Ladder { samples: vec![500, 100, 500], ..Ladder::default() };
    let jobs = ladder.jobs();
    let efforts: Vec<String> =
        jobs.iter().filter(|job| job.family() == Some(ours())).map(Job::effort).collect();
    assert_eq!(efforts, ["preview", "100 samples", "500 samples"]);
    let count = |wanted: &dyn Fn(&Job) -> bool| jobs.iter().filter(|job| wanted(job)).count();
    assert_eq!(count(&|job| matches!(job, Job::Frame { .. })), 2 * 4 * 3);
    assert_eq!(count(&|job| matches!(job, Job::Traced(_))), 6);
    assert_eq!(count(&|job| matches!(job, Job::Hybrid(_))), 6);
    assert_eq!(count(&|job| matches!(job, Job::Floor(_))), Antialiasing::USUAL.len());
}

#[test]
fn columns_are_stable() {
    let mut bench = bench(&[(50.0, 0.3)]);
    bench.scaling = vec![series()];
    let csv = csv::points(&bench);
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(
        lines[0],
        "scene,width,height,family,effort,median_ms,p10_ms,p90_ms,runs,samples,rays,predicted_error,\
         rmse_whole,psnr_whole,flip_whole,p99_whole,rmse_vt,psnr_vt,flip_vt,p99_vt,tracer_ms,ratio,bound"
    );
    assert_eq!(lines.len(), 1 + 4);
    let own = "\"a <scene>, \"\"quoted\"\"\",4,4,\"vertex tracing, exact, ss1\",100 samples,50.0000,45.0000,";
    assert!(lines[1].starts_with(own) && lines[1].ends_with(",133.333,2.66667,exactly"), "{}", lines[1]);
    assert!(lines[2].ends_with(",,,"), "a tracer has no ratio: {}", lines[2]);
    assert_eq!(
        csv::scaling(&bench),
        "axis,value,way,median_ms,p10_ms,p90_ms,exponent,r2\n\
         pixels,1.00000,\"ray tracer, 1 spp\",3.00000,3.00000,3.00000,0.500000,1.00000\n\
         pixels,4.00000,\"ray tracer, 1 spp\",6.00000,6.00000,6.00000,0.500000,1.00000\n"
    );
}

/// Checks that every element is closed in order, and that no text holds a bare `<`.
fn assert_well_formed(html: &str) {
    let body = html.strip_prefix("<!doctype html>").expect("a document type");
    let mut open: Vec<&str> = Vec::new();
    for tag in body.split('<').skip(1) {
        let (tag, text) = tag.split_once('>').unwrap_or_else(|| panic!("unclosed tag <{tag}"));
        assert!(!text.contains('>') || open.last() == Some(&"style"), "a bare > in {text:?}");
        assert_eq!(tag.matches('"').count() % 2, 0, "quotes in <{tag}>");
        let name = tag.split([' ', '/', '\n']).find(|word| !word.is_empty()).unwrap();
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "closed in order");
        } else if !tag.ends_with('/') && !["meta", "img"].contains(&name) {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "never closed: {open:?}");
}

/// Checks that nothing is fetched from anywhere.
fn assert_self_contained(html: &str) {
    for outside in ["http:", "https:", "//", "@import", "<link", "<script", "<iframe", "url("] {
        let found = html.match_indices(outside).find(|(at, _)| {
            // Base64 has slashes.
            !html[..*at]
                .rsplit_once('"')
                .is_some_and(|(_, before)| before.starts_with("data:image/png;base64,"))
        });
        assert_eq!(found, None, "{outside}");
    }
    for (at, _) in html.match_indices("src=\"") {
        assert!(html[at..].starts_with("src=\"data:image/png;base64,"));
    }
}

#[test]
fn pages_are_well_formed_and_need_nothing_else() {
    let mut bench = bench(&[(50.0, 0.4), (800.0, 0.1)]);
    bench.scaling = vec![series()];
    let pictures = [Picture { caption: "a <b> & \"c\"".into(), image: off(0.5) }];
    let svg = "<svg width=\"2\" height=\"2\" viewBox=\"0 0 2 2\" xmlns=\"http://www.w3.org/2000/svg\">\n\
               <rect fill=\"#FFFFFF\"/><text fill=\"#000000\">\nRMSE\n</text></svg>";
    let html = page::html(&bench, &pictures, &[("a plot", svg)]).unwrap();
    assert_well_formed(&html);
    assert_self_contained(&html);
    for part in [
        "name=\"viewport\"",
        "prefers-color-scheme: dark",
        "@media print",
        "pays above RMSE 0.2000",
        "a &lt;scene&gt;, &quot;quoted&quot;",
        "driver &amp; version",
        "<text fill=\"currentColor\">",
        "<rect fill=\"none\"/>",
        "raster floor",
        "2.00×",
        "0.50×",
    ] {
        assert!(html.contains(part), "{part}: {html}");
    }
}

#[cfg(feature = "plots")]
#[test]
fn plots_hold_every_line_and_fit_the_page() {
    let mut bench = bench(&[(50.0, 0.4), (800.0, 0.1)]);
    bench.scaling = vec![series()];
    let plots = vertex_tracing::report::bench::plot::all(&bench).unwrap();
    let names: BTreeSet<&str> = plots.iter().map(|plot| plot.name.as_str()).collect();
    for metric in ["rmse", "psnr", "flip", "p99"] {
        for region in ["vt", "whole"] {
            for cost in ["time", "rays"] {
                assert!(names.contains(format!("{metric}_{region}_{cost}").as_str()), "{names:?}");
            }
        }
    }
    assert!(names.contains("prediction") && names.contains("scaling_pixels"), "{names:?}");
    let rmse = plots.iter().find(|plot| plot.name == "rmse_vt_time").unwrap();
    for line in ["vertex tracing, exact, ss1", "ray tracer"] {
        assert!(rmse.svg.contains(line), "{line}");
    }
    let captioned: Vec<_> = plots.iter().map(|plot| (plot.caption.as_str(), plot.svg.as_str())).collect();
    let html = page::html(&bench, &[], &captioned).unwrap();
    assert_well_formed(&html);
    assert_self_contained(&html);
    // One point alone, and none, are plots too.
    bench.points.truncate(1);
    assert!(vertex_tracing::report::bench::plot::all(&bench).is_ok());
    bench.points.clear();
    assert!(vertex_tracing::report::bench::plot::all(&bench).is_ok());
}

#[test]
fn a_small_ladder_is_measured() {
    let gpu = Gpu::new(&vertex_tracing::gpu::Options { validation: true, ..Default::default() })
        .unwrap_or_else(|error| panic!("the tests need a Vulkan device and the validation layer: {error}"));
    let messages = gpu.messages();
    let mut scene = Demo::Sphere.scene();
    let folder = tempfile::tempdir().unwrap();
    let mut ladder = Ladder {
        samples: vec![300, 1_000_000, 2_000_000],
        antialiasings: vec![Antialiasing::None],
        reconstructions: vec![Reconstruction::Exact],
        rates: vec!["1/4".parse().unwrap(), "1".parse().unwrap(), "4".parse().unwrap()],
        repeats: 2,
        reference_spp: 16,
        ..Ladder::default()
    };
    (ladder.options.view.width, ladder.options.view.height) = (96, 72);
    let measured = measure(&gpu, &scene, &ladder, Some(folder.path()), &Arc::default(), &()).unwrap();
    let points = &measured.bench.points;
    let of = |family: &Family| -> Vec<&Point> { points.iter().filter(|p| p.family == *family).collect() };
    let (own, traced, hybrid) = (of(&ours()), of(&Family::Tracer), of(&Family::Hybrid));
    assert_eq!(
        (own.len(), traced.len(), hybrid.len()),
        (3, 3, 3),
        "nothing was left to refine after two million"
    );
    let vt = |point: &Point| point.vt.unwrap().rmse;
    assert!(vt(own[2]) < vt(own[0]), "more samples, less error");
    assert!(vt(traced[2]) < vt(traced[1]) && vt(traced[1]) < vt(traced[0]), "so for the tracer");
    // Specular pixels are traced alike; only pixels on their border may mix otherwise.
    for (traced, hybrid) in traced.iter().zip(&hybrid) {
        assert!((vt(traced) - vt(hybrid)).abs() < 0.05 * vt(traced), "{} {}", vt(traced), vt(hybrid));
    }
    assert!(own.iter().all(|p| p.time.median_ms > 0.0 && p.stages.is_some() && p.predicted_error.is_some()));
    assert!(own.iter().all(|p| p.paces.len() == 12), "two tracers, two regions, three measures");
    let floor = &measured.bench.floors[0];
    assert!(floor.time.median_ms > 0.0);
    assert_eq!(measured.bench.points.iter().filter(|p| p.runs != 2).count(), 0);

    // The reference is kept, found again, and told apart by what it shows.
    let kept = || fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(kept(), 1);
    let again = measure(&gpu, &scene, &ladder, Some(folder.path()), &Arc::default(), &()).unwrap();
    assert_eq!(kept(), 1);
    assert_eq!(again.pictures[0].image, measured.pictures[0].image);
    assert_eq!(vt_errors(&again.bench), vt_errors(&measured.bench), "errors do not change from run to run");
    scene.lights[0].intensity *= 0.5;
    measure(&gpu, &scene, &ladder, Some(folder.path()), &Arc::default(), &()).unwrap();
    assert_eq!(kept(), 2);

    // The reference as an outside image has no error.
    let path = folder.path().join("truth.pfm");
    write_image(&path, &measured.pictures[0].image, 0.0).unwrap();
    scene.lights[0].intensity *= 2.0;
    ladder.outside = vec![Outside { name: "other".into(), image: path, seconds: 0.25 }];
    let bench = measure(&gpu, &scene, &ladder, Some(folder.path()), &Arc::default(), &()).unwrap().bench;
    let other = bench.points.last().unwrap();
    assert_eq!((other.family.to_string().as_str(), other.time.median_ms), ("other", 250.0));
    assert_eq!((other.whole.rmse, other.whole.psnr, other.rays), (0.0, None, None));
    drop(gpu);
    assert_eq!(messages.errors(), Vec::<String>::new());
}

#[test]
fn the_reference_drops_the_branches_that_are_asked_for() {
    let gpu = Gpu::new(&vertex_tracing::gpu::Options { validation: true, ..Default::default() })
        .unwrap_or_else(|error| panic!("the tests need a Vulkan device and the validation layer: {error}"));
    let folder = tempfile::tempdir().unwrap();
    let mut ladder = Ladder {
        samples: Vec::new(),
        antialiasings: vec![Antialiasing::None],
        reconstructions: vec![Reconstruction::Exact],
        rates: vec!["1/4".parse().unwrap()],
        repeats: 1,
        reference_spp: 64,
        ..Ladder::default()
    };
    (ladder.options.view.width, ladder.options.view.height) = (32, 24);
    let [all, strong] = [None, Some(1.0)].map(|least| {
        ladder.min_throughput = least;
        let measured =
            measure(&gpu, &Demo::Sphere.scene(), &ladder, Some(folder.path()), &Arc::default(), &());
        measured.unwrap().pictures.swap_remove(0).image
    });
    assert_ne!(all, strong, "nothing reflects all");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2, "each is kept by itself");
}

fn vt_errors(bench: &Bench) -> Vec<f64> {
    bench.points.iter().map(|point| point.vt.unwrap().rmse).collect()
}

fn vtrace(folder: &std::path::Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vtrace"));
    command.current_dir(folder).env_remove("RUST_LOG").args(arguments.split_whitespace());
    command.output().unwrap()
}

#[test]
fn the_command_writes_every_file() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.glb"), Demo::Sphere.glb()).unwrap();
    write_image(&folder.path().join("other.png"), &FloatImage::from_fn(80, 64, |_, _| [0.2; 3]), 0.0)
        .unwrap();
    let output = vtrace(
        folder.path(),
        "bench scene.glb --out deep/out --size 80x64 --samples 200 --spp 1/4,1,4 --repeats 1 --reference-spp 4 \
         --reconstruction exact --antialiasing ss1 --compare other=other.png,0.5 --scaling=quick",
    );
    let (stdout, stderr) =
        (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    assert!(
        stdout.contains("against the ray tracer, same RMSE") && stdout.contains("index.html"),
        "{stdout}"
    );
    let read = |name: &str| fs::read_to_string(folder.path().join("deep/out").join(name)).unwrap();
    let html = read("index.html");
    assert_well_formed(&html);
    assert_self_contained(&html);
    assert!(html.contains("other, 500 ms") && html.contains("Scaling"), "{html}");
    let json: serde_json::Value = serde_json::from_str(&read("bench.json")).unwrap();
    assert_eq!(json["points"].as_array().unwrap().len(), 2 + 3 + 3 + 1, "{json}");
    let axes: Vec<_> = json["scaling"].as_array().unwrap().iter().map(|series| &series["axis"]).collect();
    assert_eq!(axes, ["pixels", "triangles", "bounces", "threads"]);
    assert!(json["scaling"][1]["ways"][0]["fit"]["exponent"].is_number(), "{json}");
    assert_eq!(read("bench.csv").lines().count(), 1 + 9);
    assert_eq!(read("scaling.csv").lines().count(), 1 + 4 * 3 * 2);
    assert_eq!(fs::read_dir(folder.path().join("deep/out/cache")).unwrap().count(), 1);
    #[cfg(feature = "plots")]
    assert!(read("rmse_vt_time.svg").starts_with("<svg"));
}

#[test]
fn what_cannot_be_measured_is_said_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.glb"), Demo::Sphere.glb()).unwrap();
    fs::write(folder.path().join("file"), "").unwrap();
    write_image(&folder.path().join("other.png"), &FloatImage::from_fn(8, 4, |_, _| [0.2; 3]), 0.0).unwrap();
    let nan = FloatImage::from_fn(80, 64, |x, y| [if (x, y) == (3, 2) { f32::NAN } else { 0.5 }; 3]);
    write_image(&folder.path().join("nan.pfm"), &nan, 0.0).unwrap();
    let small = "--size 80x64 --samples 100 --spp 1 --repeats 1 --reference-spp 1";
    let table = [
        ("bench scene.glb", 2, "--out <DIR>"),
        ("bench scene.glb --out o --spp 1/3", 2, "not samples a pixel such as 1, 4, 1/4"),
        ("bench scene.glb --out o --samples many", 2, "not a whole number 0 or more"),
        ("bench scene.glb --out o --repeats 0", 2, "0 is not in 1..=1000"),
        (
            "bench scene.glb --out o --antialiasing ss2",
            2,
            "[possible values: ss1, ss4, msaa4, pixels4, pixels16, pixels64]",
        ),
        ("bench scene.glb --out o --compare other.png,1", 2, "not a name, an image and seconds"),
        ("bench scene.glb --out o --compare other=other.png", 2, "not a name, an image and seconds"),
        ("bench scene.glb --out o --compare other=other.png,-1", 2, "not a number above 0"),
        ("bench scene.glb --out o --vt a --no-vt a", 2, "contradict each other"),
        ("bench absent.glb --out o", 1, "absent.glb: "),
        ("bench scene.glb --out file", 1, "file"),
        ("bench scene.glb --out /proc/o", 1, "/proc/o"),
        (
            "bench scene.glb --out o --compare other=other.png,1",
            1,
            "other.png has 8x4 pixels, the bench 80x64",
        ),
        ("bench scene.glb --out o --compare other=absent.png,1", 1, "absent.png"),
        (
            "bench scene.glb --out o --compare other=nan.pfm,1",
            1,
            "--compare other: nan.pfm: pixel (3, 2) is NaN",
        ),
    ];
    for (arguments, code, expected) in table {
        let output = vtrace(folder.path(), &format!("{arguments} {}", if code == 1 { small } else { "" }));
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments}: {stderr}");
        assert!(stderr.contains(expected), "{arguments}: {stderr:?} should contain {expected:?}");
        assert!(code == 2 || stderr.lines().count() == 1, "{arguments}: {stderr}");
        assert!(output.stdout.is_empty(), "{arguments}");
        assert!(!folder.path().join("o").exists(), "{arguments}: before anything is measured");
    }
}
