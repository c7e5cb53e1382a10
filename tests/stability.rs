//! Stiff and extreme cases, three values each, within their bounds; the plots and the table of a run.

mod common;

use std::sync::{Arc, atomic::AtomicBool};

use vertex_tracing::{
    error::Error,
    report::stability::{
        Bound, Case, Experiment, Report, Row, Trial, Truth, Verdict, cases,
        measure::{Plan, measure},
    },
    scene::demo::Demo,
};

use common::TestGpu;

fn run(table: &[Case]) -> Report {
    let gpu = TestGpu::open();
    let report = measure(&gpu, table, &Plan::quick(), &Arc::new(AtomicBool::new(false)), &|_| ()).unwrap();
    gpu.finish();
    report
}

#[test]
fn every_case_holds() {
    let report = run(&cases::all());
    assert_eq!(report.failures(), 0, "{report}");
    for case in cases::all() {
        let rows: Vec<&Row> = report.rows.iter().filter(|row| row.case == case.name).collect();
        assert_eq!(rows.len(), case.values.len().min(3), "{}", case.name);
        assert!(rows[0].verdict == Verdict::Holds, "{} fails where it is harmless", case.name);
        assert_eq!(rows.last().map(|row| row.value), case.values.last().copied(), "the extreme is tried");
    }
    let known = |row: &&Row| row.verdict == Verdict::KnownLimit;
    assert!(report.rows.iter().filter(known).all(|row| row.why.is_some_and(|why| !why.is_empty())));
}

#[test]
fn bounds_can_be_missed() {
    // A picture that has nothing to do with its truth, and one whose bound is out of reach.
    let wrong = |_| {
        let truth = Truth::Twin(Box::new(Trial::new(Demo::Sphere.scene())));
        Ok(Trial::new(Demo::Cup.scene()).against(truth))
    };
    let case = Case {
        name: "wrong",
        parameter: "none",
        values: &[1.0, 2.0],
        bound: Bound { reference: 1.0, truth: 0.01 },
        limit: None,
        experiment: Experiment::Picture(wrong),
    };
    let limited = Case { name: "limited", limit: Some((2.0, "it is another scene")), ..case };
    let strict = Case { name: "strict", bound: Bound { reference: 0.0, truth: 1.0 }, ..case };
    let report = run(&[case, limited, strict]);
    let verdicts: Vec<Verdict> = report.rows.iter().map(|row| row.verdict).collect();
    use Verdict::{Fails, KnownLimit};
    assert_eq!(verdicts, [Fails, Fails, Fails, KnownLimit, Fails, Fails], "{report}");

    let text = report.to_string();
    assert!(text.contains("known limit: it is another scene") && text.contains("5 fail"), "{text}");
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(json["rows"][3]["verdict"], "known-limit");
    #[cfg(feature = "plots")]
    {
        let svg = vertex_tracing::report::stability::plot::svg(&report.rows[..2]).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("wrong") && svg.contains("reference tracer"));
    }
}

#[test]
fn an_interrupt_ends_a_run() {
    let gpu = TestGpu::open();
    let stop = Arc::new(AtomicBool::new(true));
    let ended = measure(&gpu, &cases::all(), &Plan::quick(), &stop, &|_| ());
    assert!(matches!(ended, Err(Error::Interrupted)));
    gpu.finish();
}
