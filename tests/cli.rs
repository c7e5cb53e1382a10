//! The program as a user meets it: exit codes, one clear line on stderr, and no file left behind.

#[path = "../examples/check_models/watch.rs"]
mod watch;

#[path = "common/program.rs"]
mod program;

use std::{
    fs,
    io::Read,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use program::{text, vtrace};
use vertex_tracing::{
    report::{FloatImage, output::write_image},
    scene::demo::Demo,
};
use watch::{MOST_TIME, watched};

fn run(arguments: &[&str]) -> Output {
    vtrace().args(arguments).output().unwrap()
}

/// A folder with a scene, an image, and files that are neither.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        let glb = Demo::Mirror.glb();
        fs::write(place.path("scene.glb"), &glb).unwrap();
        fs::write(place.path("cut.glb"), &glb[..glb.len() / 2]).unwrap();
        fs::write(place.path("header.glb"), &glb[..10]).unwrap();
        fs::write(place.path("text.glb"), "hello").unwrap();
        fs::write(place.path("text.gltf"), "hello").unwrap();
        fs::write(place.path("empty.glb"), "").unwrap();
        let image = FloatImage::from_fn(8, 4, |x, _| [x as f32 / 8.0; 3]);
        write_image(&place.path("image.png"), &image, 0.0).unwrap();
        write_image(&place.path("image.pfm"), &image, 0.0).unwrap();
        let nan = FloatImage::from_fn(8, 4, |x, y| [if (x, y) == (2, 1) { f32::NAN } else { 0.5 }; 3]);
        write_image(&place.path("nan.pfm"), &nan, 0.0).unwrap();
        write_image(&place.path("upright.png"), &FloatImage::from_fn(4, 8, |_, _| [1.0; 3]), 0.0).unwrap();
        write_image(&place.path("small.png"), &FloatImage::from_fn(4, 4, |_, _| [0.0; 3]), 0.0).unwrap();
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn names(&self) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(self.0.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    fn run(&self, arguments: &[&str]) -> Output {
        vtrace().current_dir(self.0.path()).args(arguments).output().unwrap()
    }
}

#[test]
fn wrong_usage_exits_2() {
    let table: &[(&[&str], &str)] = &[
        (&[], "Usage: vtrace"),
        (&["paint"], "unrecognized subcommand 'paint'"),
        (&["compare", "a.png"], "<B>"),
        (&["compare", "a.png", "b.png", "--colour"], "unexpected argument '--colour'"),
        (&["reference", "s.glb"], "--output <OUT>"),
        (&["reference", "s.glb", "-o", "x.gif"], "images are written as .png, .exr or .pfm"),
        (&["reference", "s.glb", "-o", "x.png", "--size", "0x4"], "not a size such as 1280x1024"),
        (&["reference", "s.glb", "-o", "x.png", "--fov", "180"], "between 0 and 180 degrees"),
        (&["reference", "s.glb", "-o", "x.png", "--shadows", "some"], "[possible values: all, vt, none]"),
        (&["reference", "s.glb", "-o", "x.png", "--spp", "0"], "0 is not in 1..=65536"),
        (&["reference", "s.glb", "-o", "x.png", "--ray-offset=-1"], "0 or more"),
        (&["reference", "s.glb", "-o", "x.png", "--target", "0,0,0"], "--eye <X,Y,Z>"),
        (&["reference", "s.glb", "-o", "x.png", "--eye", "0,0,0", "--camera", "a"], "cannot be used with"),
        (
            &["reference", "s.glb", "-o", "x.png", "--background", "0,0,0", "--environment", "sky.hdr"],
            "cannot be used with",
        ),
        (&["render"], "<SCENE>"),
        (
            &["render", "s.glb", "--msaa", "4", "--visibility", "single-pass"],
            "cannot be used with --visibility",
        ),
        (&["render", "s.glb", "--preview", "--max-samples", "5"], "cannot be used with"),
        (&["render", "s.glb", "--sparing"], "--max-samples <N>"),
        (&["render", "s.glb", "--sparing", "--max-samples", "5", "--budget", "5"], "cannot be used with"),
        (&["render", "s.glb", "--fov", "-5"], "not a number between 0 and 180 degrees"),
        (&["render", "s.glb", "--error", "-1"], "not a number 0 or more"),
        (&["render", "s.glb", "--background", "-1,0,0"], "not three numbers 0 or more"),
        (&["render", "s.glb", "--background", "1e39,0,0"], "not three numbers 0 or more"),
        (&["render", "s.glb", "--background", "white"], "not three numbers 0 or more"),
        (&["render", "s.glb", "--budget", "-5"], "-5 is not in 1.."),
        (&["render", "s.glb", "--max-samples", "-5"], "not a whole number 0 or more"),
        (&["render", "s.glb", "--max-triangles", "-5"], "not a whole number 0 or more"),
        (&["render", "s.glb", "--nodes", "-5"], "-5 is not in 1..=32"),
        (&["render", "s.glb", "--depth", "-5"], "-5 is not in 0..=255"),
        (&["render", "s.glb", "--threads", "-5"], "-5 is not in 1..=1024"),
        (&["render", "s.glb", "--size", "-5x5"], "not a size such as 1280x1024"),
        (&["render", "s.glb", "--min-throughput", "-5"], "not a number from 0 to 1"),
        (&["render", "s.glb", "--roughness-threshold", "-0.5"], "not a number from 0 to 1"),
        (&["reference", "s.glb", "-o", "x.png", "--ray-offset", "-1"], "not a number 0 or more"),
        (&["reference", "s.glb", "-o", "x.png", "--spp", "-1"], "-1 is not in 1..=65536"),
        #[cfg(feature = "bench")]
        (&["bench", "s.glb", "--out", "out", "--samples", "-1"], "not a whole number 0 or more"),
        #[cfg(feature = "bench")]
        (&["bench", "s.glb", "--out", "out", "--repeats", "-1"], "-1 is not in 1..=1000"),
        #[cfg(not(feature = "view"))]
        (&["view", "s.glb", "--fov", "40"], "cargo run --release --features view -- view"),
        #[cfg(not(feature = "view"))]
        (&["view", "--help"], "built without the feature `view`"),
        (&["render", "s.glb", "--shaft-guard", "maybe"], "[possible values: on, off]"),
        (&["render", "s.glb", "--mode", "raytrace"], "[possible values: multi-texture, multi-pass]"),
        (&["reference", "s.glb", "-o", "x.png", "--vt", "cup", "--no-vt", "cup"], "contradict each other"),
        (&["reference", "s.glb", "-o", "x.png", "--eye", "1,2,3", "--target", "1,2,3"], "the same point"),
        (&["render", "s.glb", "--eye", "1,2,3", "--target", "1,2.0,3"], "the same point"),
        (&["plan", "s.glb", "--eye", "0,0,0", "--target", "-0,0,0"], "the same point"),
        #[cfg(feature = "bench")]
        (&["bench", "s.glb", "--out", "out", "--eye", "1,2,3", "--target", "1,2,3"], "the same point"),
        #[cfg(feature = "bench")]
        (&["stability", "--only", "nosuch"], "--only nosuch: no such case; there are "),
    ];
    for (arguments, expected) in table {
        let output = run(arguments);
        let stderr = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert!(stderr.contains(expected), "{arguments:?}: {stderr:?} should contain {expected:?}");
        assert!(output.stdout.is_empty(), "{arguments:?}: results on stdout");
    }
}

#[test]
fn results_of_one_name_are_wrong_usage() {
    let place = Place::new();
    fs::create_dir(place.path("in")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink("in/x.png", place.path("link.png")).unwrap();
    let before = place.names();
    let absolute = place.path("x.png");
    let mut table = vec![
        ("x.png", "--stats", "x.png"),
        ("x.png", "--stats", "./x.png"),
        ("in/../x.png", "--stats", absolute.to_str().unwrap()),
        ("absent/x.png", "--stats", "./absent/x.png"),
        ("x.png", "--progressive", "x.png/"),
    ];
    #[cfg(unix)]
    table.push(("link.png", "--stats", "in/x.png"));
    for command in ["render", "reference"] {
        for &(output, option, path) in table.iter().filter(|row| command == "render" || row.1 == "--stats") {
            let output = place.run(&[command, "scene.glb", "-o", output, option, path]);
            let stderr = text(&output.stderr);
            assert_eq!(output.status.code(), Some(2), "{command} {option} {path}: {stderr}");
            let expected = format!("--output and {option} name the same file");
            assert!(stderr.contains(&expected) && output.stdout.is_empty(), "{stderr}");
            assert_eq!(place.names(), before, "{command} {option} {path}: a file was left behind");
        }
    }
    let apart = ["-o", "x.png", "--stats", "in/x.png"];
    let output = place.run(&[&["reference", "scene.glb", "--size", "8x8"][..], &apart].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
}

#[test]
fn help_and_version_are_results() {
    for arguments in [&["--help"][..], &["--version"], &["reference", "--help"], &["compare", "-h"]] {
        let output = run(arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}");
        assert!(!output.stdout.is_empty() && output.stderr.is_empty(), "{arguments:?}");
    }
    let help = run(&["render", "-h"]).stdout;
    let line = text(&help).split("--shaft-guard").nth(1).unwrap().split("--").next().unwrap();
    assert!(line.contains("on, off") && !line.contains("true"), "{line}");
    for (option, range) in [
        ("--size <", "1 to 16384"),
        ("--nodes <", "1 to 32"),
        ("--depth <", "0 to 255"),
        ("--threads <", "1 to 1024"),
        ("--max-samples <", "vertices of visible faces"),
        ("--max-samples <", "--budget ended make the same picture"),
        ("--sparing", "it takes longer"),
        ("--budget <", "one drawing"),
    ] {
        let line = text(&help).split(option).nth(1).unwrap().split("\n      --").next().unwrap();
        let words: Vec<&str> = line.split_whitespace().collect();
        assert!(words.join(" ").contains(range), "{option}: {line:?} should contain {range:?}");
    }
    let help = run(&["--help"]).stdout;
    assert_eq!(text(&help).contains("\n  view "), cfg!(feature = "view"), "{}", text(&help));
}

#[test]
fn a_plan_needs_no_device() {
    let place = Place::new();
    // A driver that does not exist: any attempt to open a device fails.
    let plan = |arguments: &[&str]| {
        let mut command = vtrace();
        command.current_dir(place.0.path()).env("VK_DRIVER_FILES", "/absent.json");
        let output = command.args(["plan", "scene.glb"]).args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        output.stdout
    };
    let words = plan(&["--mode", "multi-pass"]);
    for expected in
        ["scene uses", "no specular object transmits", "--everything", "and 2 of 5 passes: transmitted"]
    {
        assert!(text(&words).contains(expected), "{expected}: {}", text(&words));
    }
    let json: serde_json::Value = serde_json::from_slice(&plan(&["--json"])).unwrap();
    let bytes = |plan: &str| json[plan]["bytes"].as_u64().unwrap();
    assert_eq!(json["saved"]["bytes"], bytes("everything") - bytes("planned"));
    assert!(
        json["left_out"]
            .as_array()
            .unwrap()
            .iter()
            .all(|part| part["what"].is_string() && part["why"].is_string())
    );
}

#[test]
fn bad_input_exits_1_with_one_line_and_leaves_no_file() {
    let place = Place::new();
    let before = place.names();
    let table: &[(&[&str], &str)] = &[
        (&["compare", "absent.png", "image.png"], "absent.png: "),
        (&["compare", "image.png", "text.glb"], "text.glb: not a PNG, JPEG, HDR, EXR or PFM image"),
        (&["compare", "image.png", "small.png"], "image.png has 8x4 pixels, small.png 4x4"),
        (&["compare", "image.png", "nan.pfm"], "nan.pfm: pixel (2, 1) is NaN"),
        (&["compare", "nan.pfm", "image.png"], "nan.pfm: pixel (2, 1) is NaN"),
        (&["reference", "empty.glb", "-o", "out.png"], "empty.glb: file: is empty"),
        (
            &["compare", "image.png", "image.pfm", "--mask", "small.png"],
            "mask has 4x4 pixels, the images 8x4",
        ),
        (
            &["compare", "image.png", "image.pfm", "--mask", "upright.png"],
            "mask has 4x8 pixels, the images 8x4",
        ),
        (&["reference", "absent.glb", "-o", "out.png"], "absent.glb: "),
        (&["reference", "text.glb", "-o", "out.png"], "text.glb: "),
        (&["reference", "text.gltf", "-o", "out.png"], "text.gltf: "),
        (&["reference", "cut.glb", "-o", "out.png"], "cut.glb: "),
        (&["reference", "header.glb", "-o", "out.png"], "header.glb: "),
        (&["reference", "image.png", "-o", "out.png"], "image.png: "),
        (&["reference", "scene.glb", "-o", "absent/out.png"], "absent/out.png: folder absent does not exist"),
        (&["reference", "scene.glb", "-o", "/proc/out.png"], "/proc/out.png: cannot write to folder /proc"),
        (&["reference", "scene.glb", "-o", "out.png", "--stats", "absent/s.json"], "absent/s.json: "),
        (&["reference", "scene.glb", "-o", "out.png", "--camera", "nobody"], "--camera nobody: "),
        (&["reference", "scene.glb", "-o", "out.png", "--vt", "nobody"], "--vt nobody: "),
        (&["reference", "scene.glb", "-o", "out.png", "--environment", "absent.hdr"], "absent.hdr: "),
        (&["reference", "scene.glb", "-o", "out.png", "--max-triangles", "1"], "scene.glb: "),
        (&["reference", "scene.glb", "-o", "out.png", "--max-nodes", "1"], "(--max-nodes)"),
        (&["render", "absent.glb", "-o", "out.png"], "absent.glb: "),
        (&["render", "cut.glb", "-o", "out.png"], "cut.glb: "),
        (&["render", "scene.glb", "-o", "absent/out.png"], "absent/out.png: folder absent does not exist"),
        (&["render", "scene.glb", "-o", "out.png", "--device", "nobody"], "\"nobody\""),
    ];
    for (arguments, expected) in table {
        let output = place.run(arguments);
        let stderr = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {stderr}");
        let errors: Vec<&str> = stderr.lines().filter(|line| !line.starts_with("note: ")).collect();
        assert!(
            errors.len() == 1 && errors[0].starts_with("error: ") && errors[0].contains(expected),
            "{arguments:?}: {stderr:?} should be one line with {expected:?}"
        );
        assert!(output.stdout.is_empty(), "{arguments:?}: results on stdout");
        assert_eq!(place.names(), before, "{arguments:?}: a file was left behind");
    }
}

/// A triangle in a file that uses an extension of this name, as JSON has it.
fn triangle_with_extension(name: &str) -> String {
    let positions = "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
    format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["{name}"],"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"type":"VEC3","count":3}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],"buffers":[{{"byteLength":36,"uri":"{positions}"}}]}}"#
    )
}

#[test]
fn names_in_files_forge_no_messages() {
    let place = Place::new();
    fs::write(place.path("forged.gltf"), triangle_with_extension(r"A\nerror: forged\u001b[2J")).unwrap();
    let output = place.run(&["plan", "forged.gltf"]);
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    assert!(stderr.contains("note: extension A error: forged\\u{1b}[2J is ignored\n"), "{stderr:?}");
    assert!(stderr.lines().all(|line| line.starts_with("note: ")), "{stderr:?}");

    // The same in an error: the name is that of no object.
    let output = place.run(&["plan", "forged.gltf", "--vt", "\u{1b}[2J\nnote: forged"]);
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    let error = stderr.lines().last().unwrap();
    assert!(error.starts_with("error: --vt \\u{1b}[2J note: forged: "), "{stderr:?}");
}

#[test]
fn compare_prints_words_or_json() {
    let place = Place::new();
    let words = place.run(&["compare", "image.pfm", "image.pfm"]);
    assert_eq!(words.status.code(), Some(0));
    assert!(text(&words.stdout).contains("psnr      identical\n"), "{}", text(&words.stdout));

    let json = place.run(&["compare", "image.pfm", "image.png", "--json", "--linear"]);
    let json: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    for field in ["rmse", "psnr", "flip", "p99", "max", "over_0_1"] {
        assert!(json[field].is_number(), "{field}: {json}");
    }
    assert!(json["max"].as_f64().unwrap() < 0.01, "eight bits are near: {json}");
}

#[test]
fn reference_writes_image_and_stats() {
    let place = Place::new();
    let small = ["reference", "scene.glb", "--size", "64x48"];
    let output = place.run(&[&small[..], &["-o", "out.pfm", "--stats", "-"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let stats: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON and nothing else");
    assert_eq!(stats["image"]["width"], 64);
    assert_eq!(stats["rays"]["primary"], 64 * 48);
    assert_eq!(stats["options"]["spp"], 1);
    assert!(text(&output.stdout).contains("\"roughness_threshold\": 0.1,"), "shortest digits");
    let image = FloatImage::read(&place.path("out.pfm")).unwrap();
    assert_eq!((image.width, image.height), (64, 48));
    assert!(image.pixels.iter().any(|pixel| pixel[0] > 0.0), "a black picture");

    let output = place.run(&[&small[..], &["-o", "out.png", "--stats", "s.json", "--threads", "3"]].concat());
    assert!(text(&output.stdout).contains("image    64x48"), "{}", text(&output.stdout));
    let file: serde_json::Value = serde_json::from_slice(&fs::read(place.path("s.json")).unwrap()).unwrap();
    assert_eq!(file["rays"], stats["rays"], "the same rays whatever the number of threads");

    // Half a unit off the mirror, its image is shifted.
    let output = place.run(&[&small[..], &["-o", "off.pfm", "--ray-offset", "0.5", "--stats", "-"]].concat());
    let stats: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(stats["options"]["ray_offset"], 0.5);
    assert_ne!(FloatImage::read(&place.path("off.pfm")).unwrap().pixels, image.pixels);
}

#[test]
fn what_branches_must_carry_is_as_asked_for_whatever_the_samples() {
    let place = Place::new();
    let reference = |arguments: &[&str]| {
        let common = ["reference", "scene.glb", "-o", "out.pfm", "--size", "40x30", "--stats", "-"];
        let output = place.run(&[&common[..], arguments].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let stats: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        (stats["options"]["min_throughput"].as_f64().unwrap(), stats["rays"]["reflected"].as_u64().unwrap())
    };
    let usual = reference(&[]);
    assert!((usual.0 - 1.0 / 255.0).abs() < 1e-6 && usual.1 > 0, "{usual:?}");
    let many = reference(&["--spp", "64"]);
    assert!(many.0 == 0.0 && many.1 > 0, "{many:?}");
    // Nothing reflects all.
    assert_eq!(reference(&["--min-throughput", "1"]), (1.0, 0));
    assert_eq!(reference(&["--spp", "64", "--min-throughput", "1"]), (1.0, 0));
    assert_eq!(reference(&["--spp", "64", "--packets", "--min-throughput", "1"]), (1.0, 0));
}

#[test]
fn render_writes_image_and_stats() {
    let place = Place::new();
    let output = place.run(&["render", "scene.glb", "--size", "320x240", "-o", "out.pfm", "--stats", "-"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let stats: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON and nothing else");
    assert!(stats["samples"].as_u64() > Some(0) && stats["faces"]["visible"].as_u64() > Some(0), "{stats}");
    assert!(stats["device"]["name"].is_string() && stats["options"]["mode"] == "multi-texture", "{stats}");

    // The same picture as by the other way; the floor's mip levels, which that one lacks, are most of the rest.
    place.run(&["reference", "scene.glb", "--size", "320x240", "-o", "truth.pfm"]);
    let comparison = place.run(&["compare", "truth.pfm", "out.pfm", "--json"]);
    let comparison: serde_json::Value = serde_json::from_slice(&comparison.stdout).unwrap();
    assert!(comparison["psnr"].as_f64() > Some(25.0), "{comparison}");
}

#[test]
fn devices_are_listed_or_missed() {
    let output = run(&["devices"]);
    assert_eq!(output.status.code(), Some(0), "{}; to install one: make setup", text(&output.stderr));
    assert!(text(&output.stdout).contains("): can serve\n"), "{}", text(&output.stdout));

    let output = vtrace().arg("devices").env("VK_DRIVER_FILES", "/nonexistent.json").output().unwrap();
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.starts_with("error: ") && stderr.contains("mesa-vulkan-drivers"), "{stderr}");
    assert_eq!(stderr.lines().count(), 1, "{stderr}");
}

#[test]
fn a_closed_pipe_is_no_error_and_a_full_disk_is() {
    let place = Place::new();
    let compare = |stdout: Stdio| {
        let mut command = vtrace();
        command.current_dir(place.0.path()).args(["compare", "image.png", "image.png"]);
        command.stdout(stdout).stderr(Stdio::piped()).spawn().unwrap()
    };
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output = compare(writer.into()).wait_with_output().unwrap();
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), ""));

    if Path::new("/dev/full").exists() {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = compare(full.try_clone().unwrap().into()).wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(1));
        assert!(text(&output.stderr).starts_with("error: standard output: "), "{}", text(&output.stderr));
        for help in [&["--help"][..], &["--version"], &["render", "--help"]] {
            let output = vtrace().args(help).stdout(full.try_clone().unwrap()).output().unwrap();
            assert_eq!(output.status.code(), Some(1), "{help:?}");
            assert!(text(&output.stderr).starts_with("error: standard output: "), "{}", text(&output.stderr));
        }
    }
}

/// Interrupts `vtrace` with `arguments` once it has run for `after`; it must end soon, in one line, and leave no file.
#[cfg(unix)]
fn interrupted(place: &Place, arguments: &[&str], after: Duration) {
    let before = place.names();
    let mut child =
        vtrace().current_dir(place.0.path()).args(arguments).stderr(Stdio::piped()).spawn().unwrap();
    thread::sleep(after);
    assert!(child.try_wait().unwrap().is_none(), "{arguments:?} take minutes");
    // The shell's own `kill`: a bare system has no program of that name.
    let kill = Command::new("sh").args(["-c", &format!("kill -INT {}", child.id())]).status();
    if !kill.is_ok_and(|status| status.success()) {
        child.kill().unwrap();
        panic!("no way to interrupt a process");
    }
    let asked = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if asked.elapsed() > Duration::from_secs(10) {
            child.kill().unwrap();
            panic!("{arguments:?} run on after an interrupt");
        }
        thread::sleep(Duration::from_millis(10));
    }
    let status = child.wait().unwrap();
    let mut stderr = String::new();
    child.stderr.take().unwrap().read_to_string(&mut stderr).unwrap();
    assert_eq!(status.code(), Some(130), "{arguments:?}: {stderr}");
    let told: Vec<&str> = stderr.lines().filter(|line| !line.starts_with("note: ")).collect();
    assert_eq!(told, ["error: interrupted"], "{arguments:?}");
    assert_eq!(place.names(), before, "{arguments:?}");
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_long_work_cleanly() {
    let place = Place::new();
    let second = Duration::from_secs(1);
    interrupted(
        &place,
        &["reference", "scene.glb", "-o", "out.png", "--spp", "256", "--size", "4096x4096"],
        2 * second,
    );
    // Sixteen pixels square, which one thread does not leave for minutes.
    let one_tile = ["reference", "scene.glb", "-o", "out.png", "--spp", "65536", "--size", "16x16"];
    interrupted(&place, &one_tile, second);
    let large = ["render", "scene.glb", "-o", "out.png", "--size", "2048x2048", "--ss", "16", "--error", "0"];
    interrupted(&place, &large, 2 * second);
    // A pipe that nobody reads.
    assert!(Command::new("mkfifo").arg(place.path("pipe.png")).status().unwrap().success());
    interrupted(&place, &["reference", "scene.glb", "-o", "pipe.png", "--size", "16x16"], second);
    // What comes before there is anything to stop: a JSON of millions of values.
    let mut json = br#"{"asset":{"version":"2.0"},"extras":[0"#.to_vec();
    json.extend(b",0".repeat(30_000_000));
    json.extend(b"]}");
    fs::write(place.path("large.gltf"), json).unwrap();
    interrupted(&place, &["render", "large.gltf", "-o", "out.png"], second / 10);
}

/// Whoever starts it with `nohup` wants its results after the terminal is gone; others do not.
#[cfg(unix)]
#[test]
fn a_hangup_ends_work_unless_it_is_ignored() {
    let place = Place::new();
    for (before, code) in [("trap '' HUP", None), (":", Some(130))] {
        let vtrace = env!("CARGO_BIN_EXE_vtrace");
        // Sixteen pixels square, for minutes.
        let work = "reference scene.glb -o out.png --spp 65536 --size 16x16";
        let line = format!("{before}; exec '{vtrace}' {work}");
        let mut child = Command::new("sh")
            .current_dir(place.0.path())
            .args(["-c", &line])
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        thread::sleep(Duration::from_secs(1));
        Command::new("sh").args(["-c", &format!("kill -HUP {}", child.id())]).status().unwrap();
        let asked = Instant::now();
        let most = Duration::from_secs(if code.is_some() { 10 } else { 2 });
        while child.try_wait().unwrap().is_none() && asked.elapsed() < most {
            thread::sleep(Duration::from_millis(10));
        }
        let ended = child.try_wait().unwrap().map(|status| status.code());
        child.kill().unwrap();
        child.wait().unwrap();
        assert_eq!(ended, code.map(Some), "{before}");
    }
}

#[test]
fn hostile_files_take_little_time_and_memory() {
    let place = Place::new();
    let before = place.names();
    let glb = |json: &[u8]| [&b"glTF"[..], &[2, 0, 0, 0], &u32::MAX.to_le_bytes(), json].concat();
    let nodes = |count: usize| {
        let mesh = r#"{"mesh":0},"#.repeat(count);
        let listed: Vec<String> = (0..count).map(|node| node.to_string()).collect();
        format!(
            r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[{}]}}],"nodes":[{}],"meshes":[{{"primitives":[
            {{"attributes":{{"POSITION":0}}}}]}}],"accessors":[{{"componentType":5126,"type":"VEC3","count":3000000}}]}}"#,
            listed.join(","),
            mesh.trim_end_matches(',')
        )
    };
    let shared: String =
        (1..200_000).map(|node| format!(r#"{{"children":[{node},{node}]}},"#)).collect::<String>() + "{}";
    let files: [(&str, Vec<u8>); 6] = [
        ("deep", b"[".repeat(50_000_000)),
        ("swelling", [&b"["[..], &b"{},".repeat(20_000_000), b"{}]"].concat()),
        ("long", [&br#"{"extras":[0"#[..], &b",0".repeat(10_000_000), b"]}"].concat()),
        ("length", glb(b"{}")),
        ("instances", nodes(100_000).into_bytes()),
        ("shared", format!(r#"{{"asset":{{"version":"2.0"}},"nodes":[{shared}]}}"#).into_bytes()),
    ];
    for (name, bytes) in files {
        let file = place.path(&format!("{name}.gltf"));
        fs::write(&file, bytes).unwrap();
        let mut command = vtrace();
        command.current_dir(place.0.path()).args(["render", "-o", "out.png"]).arg(&file);
        let watched = watched(&mut command, MOST_TIME).unwrap_or_else(|problem| panic!("{name}: {problem}"));
        println!("{name}: {:.1} s, {} MiB", watched.seconds, watched.bytes >> 20);
        // Ten million values are some hundred MiB: the watch sees them.
        let seen = watched.bytes > 100 << 20 || !cfg!(target_os = "linux");
        assert!(name != "long" || seen, "{name}: {} bytes", watched.bytes);
        assert_eq!(watched.code, Some(1), "{name}: {}", watched.stderr);
        let errors = watched.stderr.lines().filter(|line| line.starts_with("error: "));
        assert_eq!(errors.count(), 1, "{name}: {}", watched.stderr);
        fs::remove_file(&file).unwrap();
        assert_eq!(place.names(), before, "{name}: a file was left behind");
    }
}
