//! The profile of visibility: its rows, its table and its plot.

mod common;

use std::collections::BTreeSet;

use serde_json::Value;
use vertex_tracing::{
    gpu::ReadbackMemory,
    report::profile::{
        MOST_COPIES, Profile, STAGES,
        measure::{Plan, measure},
    },
    scene::demo::Demo,
};

use common::TestGpu;

fn profile() -> Profile {
    let gpu = TestGpu::open();
    let profile = measure(&gpu, &Demo::Sphere.scene(), &Plan::quick(), &|_| {}).unwrap();
    gpu.finish();
    profile
}

#[test]
fn rows_follow_the_contract() {
    let profile = profile();
    let json = serde_json::to_value(&profile).unwrap();
    let rows = json["rows"].as_array().unwrap();
    let fields = "way memory in_place width height triangles stage median_ms p10_ms p90_ms bytes";
    for row in rows {
        let names: BTreeSet<&str> = row.as_object().unwrap().keys().map(String::as_str).collect();
        assert_eq!(names, fields.split(' ').collect());
        let ms = ["p10_ms", "median_ms", "p90_ms"].map(|name| row[name].as_f64().unwrap());
        assert!(ms.is_sorted() && ms[0] >= 0.0, "{row}");
        assert!(STAGES.contains(&row["stage"].as_str().unwrap()));
    }
    let ways: BTreeSet<&str> = rows.iter().filter_map(|row| row["way"].as_str()).collect();
    assert_eq!(ways, BTreeSet::from(["id-buffer", "single-pass", "device"]));
    let triangles: BTreeSet<u64> = rows.iter().filter_map(|row| row["triangles"].as_u64()).collect();
    assert_eq!(triangles.len(), 2, "the scene and a mirror");

    // Every kind of memory is measured or said to be absent.
    let measured = |kind: &str| rows.iter().any(|row| row["memory"] == kind);
    let absent = |kind: &str| json["unavailable"].as_array().unwrap().iter().any(|name| name == kind);
    for kind in ReadbackMemory::ALL.map(ReadbackMemory::name) {
        assert!(measured(kind) != absent(kind), "{kind}");
    }

    for stages in rows.chunks(STAGES.len()) {
        let names: Vec<&str> = stages.iter().filter_map(|row| row["stage"].as_str()).collect();
        assert_eq!(names, STAGES);
        let median = |row: &Value| row["median_ms"].as_f64().unwrap();
        assert!(median(&stages[0]) > 0.0, "devices tell how long they draw");
        let (way, bytes) = (&stages[1]["way"], stages[1]["bytes"].as_u64().unwrap());
        let pixels = 320 * 256;
        match way.as_str().unwrap() {
            "id-buffer" => assert_eq!(bytes, 4 * pixels),
            "single-pass" => assert_eq!(bytes, 8 * pixels),
            _ => assert_eq!(bytes, 4 * stages[1]["triangles"].as_u64().unwrap()),
        }
        assert!(profile.memcpy.iter().any(|copy| copy.bytes == bytes), "a plain copy of {bytes} bytes");
    }
    let rings: Vec<_> = profile.rings.iter().map(|ring| (ring.buffers, ring.frames_late)).collect();
    assert_eq!(rings, [(1, 0), (2, 1), (3, 2)]);
    assert!(profile.rings.iter().all(|ring| ring.frames_per_second > 0.0 && ring.latency.median_ms > 0.0));

    let [bound] = &profile.bounds[..] else { panic!("{:?}", profile.bounds) };
    assert!(bound.best_ms > 0.0 && bound.ratio == bound.best_ms / bound.against_best_ms);
    assert_eq!(bound.holds, bound.ratio <= MOST_COPIES);

    let table = profile.to_string();
    assert!(table.contains(if bound.holds { "at most 1.5: kept" } else { "NOT KEPT" }), "{table}");
    assert!(table.contains("id-buffer") && table.contains("paper (2003): 1024x768"), "{table}");
    #[cfg(feature = "plots")]
    {
        let svg = vertex_tracing::report::profile::plot::svg(&profile).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("single-pass") && svg.contains("paper, 2003"));
    }
}

/// Whether it is kept, `make promises` asks of the release profile.
#[cfg(feature = "cli")]
#[test]
fn checks_fail_where_a_promise_is_not_kept() {
    let folder = tempfile::tempdir().unwrap();
    let cup = folder.path().join("cup.glb");
    std::fs::write(&cup, Demo::Cup.glb()).unwrap();
    let check = |check| {
        let mut vtrace = std::process::Command::new(env!("CARGO_BIN_EXE_vtrace"));
        vtrace.args(["profile", "--quick", check]).arg(&cup).output().unwrap()
    };
    let output = check("--check");
    let [said, complaint] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    let bound = said.lines().find(|line| line.contains("reading back and scanning 1280x1024"));
    let bound = bound.unwrap_or_else(|| panic!("{complaint}"));
    let kept = bound.ends_with("at most 1.5: kept");
    assert!(kept || bound.ends_with("NOT KEPT"), "{bound}");
    assert_eq!((output.status.success(), complaint.contains("NOT KEPT")), (kept, !kept), "{complaint}");
    assert!(check("--check=1000").status.success(), "with room for a thousand times as much");
    assert_eq!(check("--check=0.5").status.code(), Some(2), "room is at least 1");
}
