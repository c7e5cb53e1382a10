//! What `vtrace` writes, where: never over what it reads, and nothing once it is refused.

#[path = "common/program.rs"]
mod program;

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use program::{text, vtrace};
use vertex_tracing::{
    report::{FloatImage, output::write_image},
    scene::demo::Demo,
};

/// A folder with scenes, with what they refer to, and an environment.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        for folder in ["out", "steps"] {
            fs::create_dir(place.path(folder)).unwrap();
        }
        let grey = FloatImage::from_fn(4, 2, |x, _| [x as f32 / 4.0; 3]);
        for image in ["environment.exr", "picture.png", "steps/step_0003.png"] {
            write_image(&place.path(image), &grey, 0.0).unwrap();
        }
        for scene in ["scene.glb", "out/bench.json", "out/profile.txt", "out/scene.json"] {
            fs::write(place.path(scene), Demo::Mirror.glb()).unwrap();
        }
        let corners: Vec<u8> =
            [0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        fs::write(place.path("corners.bin"), corners).unwrap();
        let triangle = r#"{"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
            "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
            "accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":3}],
            "bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36,"uri":"corners.bin"}],
            "images":[{"uri":"data:image/png;base64,"},{"uri":"./picture%2Epng"},{"uri":"steps/step_0003.png"}]}"#;
        fs::write(place.path("triangle.gltf"), triangle).unwrap();
        // Some writers pad the JSON with zeros.
        fs::write(place.path("padded.gltf"), [triangle.as_bytes(), &[0; 3]].concat()).unwrap();
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn run(&self, arguments: &[&str]) -> Output {
        vtrace().current_dir(self.0.path()).args(arguments).output().unwrap()
    }

    /// Every file below with what it holds, and every folder.
    fn contents(&self) -> Vec<(PathBuf, Option<Vec<u8>>)> {
        let (mut contents, mut folders) = (Vec::new(), vec![self.0.path().to_path_buf()]);
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                contents.push((path.clone(), fs::read(&path).ok()));
                if path.is_dir() {
                    folders.push(path);
                }
            }
        }
        contents.sort();
        contents
    }

    /// Runs what must be wrong usage, told with `expected`, and must change nothing.
    fn refused(&self, arguments: &[&str], expected: &str) {
        let before = self.contents();
        let output = self.run(arguments);
        let stderr = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert!(stderr.contains(expected), "{arguments:?}: {stderr:?} should contain {expected:?}");
        assert!(output.stdout.is_empty(), "{arguments:?}: results on stdout");
        assert!(self.contents() == before, "{arguments:?}: a file has changed");
    }
}

#[test]
fn what_is_read_is_not_written_over() {
    let place = Place::new();
    for command in ["render", "reference"] {
        let refused = |scene: &str, rest: &[&str], expected: &str| {
            place.refused(&[&[command, scene, "--size", "8x8"], rest].concat(), expected);
        };
        refused(
            "triangle.gltf",
            &["-o", "a.png", "--stats", "triangle.gltf"],
            "--stats would overwrite the scene, triangle.gltf",
        );
        refused("scene.glb", &["-o", "a.png", "--stats", "out/../scene.glb"], "the scene, scene.glb");
        refused(
            "scene.glb",
            &["--environment", "environment.exr", "-o", "environment.exr"],
            "--output would overwrite the panorama of --environment, environment.exr",
        );
        refused(
            "triangle.gltf",
            &["-o", "picture.png"],
            "--output would overwrite ./picture.png, which triangle.gltf refers to",
        );
        refused(
            "triangle.gltf",
            &["-o", "a.png", "--stats", "corners.bin"],
            "corners.bin, which triangle.gltf refers to",
        );
        refused("padded.gltf", &["-o", "picture.png"], "which padded.gltf refers to");
    }
    place.refused(
        &["render", "triangle.gltf", "--progressive", "steps"],
        "--progressive would overwrite steps/step_0003.png, which triangle.gltf refers to",
    );
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("../scene.glb", place.path("out/link.glb")).unwrap();
        std::os::unix::fs::symlink("out", place.path("elsewhere")).unwrap();
        place.refused(&["render", "scene.glb", "--stats", "out/link.glb"], "the scene, scene.glb");
        place.refused(&["render", "out/link.glb", "--stats", "scene.glb"], "the scene, out/link.glb");
        place.refused(&["render", "elsewhere/scene.json", "--stats", "out/scene.json"], "the scene, ");
    }
}

#[cfg(feature = "bench")]
#[test]
fn measurements_are_not_written_over_what_is_measured() {
    let place = Place::new();
    fs::copy(place.path("environment.exr"), place.path("out/psnr.svg")).unwrap();
    for (rest, expected) in [
        (&["out/bench.json"][..], "the scene, out/bench.json"),
        (&["scene.glb", "--environment", "out/psnr.svg"], "the panorama of --environment, out/psnr.svg"),
        (&["scene.glb", "--compare", "peer=out/psnr.svg,1"], "the image of --compare peer, out/psnr.svg"),
    ] {
        let bench = [&["bench", "--size", "8x8", "--out", "out"][..], rest].concat();
        place.refused(&bench, &format!("--out would overwrite {expected}"));
    }
    place.refused(
        &["profile", "out/profile.txt", "--quick", "--out", "out"],
        "--out would overwrite the scene, out/profile.txt",
    );
}

#[test]
fn results_keep_out_of_the_steps() {
    let place = Place::new();
    for folder in ["steps", "new/steps"] {
        let render = ["render", "scene.glb", "--size", "8x8", "--progressive", folder];
        for (option, file) in [("-o", "step_0000.png"), ("--stats", "step_12345.png")] {
            let file = format!("{folder}/./{file}");
            let named = if option == "-o" { "--output" } else { option };
            let expected = format!("{named} names one of the images of --progressive, {file}");
            place.refused(&[&render[..], &[option, &file]].concat(), &expected);
        }
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("../a.png", place.path("steps/step_0001.png")).unwrap();
        std::os::unix::fs::symlink("steps/step_0007.png", place.path("b.png")).unwrap();
        for file in ["a.png", "b.png"] {
            let arguments = ["render", "scene.glb", "--progressive", "steps", "-o", file];
            place.refused(&arguments, "--output names one of the images of --progressive");
        }
    }
}

#[test]
fn the_folder_of_steps_is_made_for_all_results() {
    let place = Place::new();
    let render = |rest: &[&str]| {
        let common = ["render", "scene.glb", "--size", "32x24", "--preview", "--progressive", "new/steps"];
        place.run(&[&common[..], rest].concat())
    };
    let before = place.contents();
    for refused in [&["-o", "absent/a.png"][..], &["-o", "new/steps/a.png", "--camera", "nobody"]] {
        let output = render(refused);
        assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
        assert!(place.contents() == before, "{refused:?}: something was left behind");
    }
    let output = render(&["-o", "new/steps/a.png", "--stats", "new/s.json"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    for file in ["new/steps/a.png", "new/steps/step_0000.png", "new/s.json"] {
        assert!(place.path(file).is_file(), "{file}");
    }
    let output = place.run(&["render", "scene.glb", "--progressive", "picture.png"]);
    assert_eq!(text(&output.stderr), "error: picture.png: is not a folder\n");
    assert_eq!(output.status.code(), Some(1));
    place.refused(
        &["render", "scene.glb", "--progressive", "more", "--show", "depth"],
        "'--progressive <DIR>' cannot be used with '--show <SHOW>'",
    );
}

/// A file that outgrows what the system lets the process write, as it outgrows a full disk.
#[cfg(unix)]
#[test]
fn a_file_that_cannot_be_finished_is_told_by_its_name() {
    let place = Place::new();
    let vtrace = env!("CARGO_BIN_EXE_vtrace");
    let line =
        format!("trap '' XFSZ; ulimit -f 1; exec '{vtrace}' reference scene.glb --size 64x64 -o a.pfm");
    let output = Command::new("sh").current_dir(place.0.path()).args(["-c", &line]).output().unwrap();
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    let error = stderr.lines().last().unwrap();
    assert!(error.starts_with("error: a.pfm: ") && !error.contains(".vtrace-"), "{stderr}");
    let files = fs::read_dir(place.0.path()).unwrap().map(|entry| entry.unwrap().file_name());
    assert!(!files.into_iter().any(|name| name.to_string_lossy().ends_with(".part")));
}

#[cfg(target_os = "linux")] // other systems and their disks refuse such names
#[test]
fn a_name_need_not_be_unicode() {
    use std::os::unix::ffi::OsStrExt;
    let place = Place::new();
    let named = |bytes: &'static [u8]| Path::new(std::ffi::OsStr::from_bytes(bytes));
    let (image, panorama) = (named(b"\xff.png"), named(b"\xff.exr"));
    fs::copy(place.path("environment.exr"), place.0.path().join(panorama)).unwrap();
    let mut command = vtrace();
    command.current_dir(place.0.path()).args(["reference", "scene.glb", "--size", "8x8", "--stats", "-"]);
    let output = command.arg("-o").arg(image).arg("--environment").arg(panorama).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(place.0.path().join(image).is_file());
    let stats: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(stats["options"]["environment"], "\u{fffd}.exr");
}

/// A log that the shell opens for appending keeps what stands in it, and stats on standard output come alone under any of
/// its names.
#[cfg(target_os = "linux")]
#[test]
fn what_is_open_already_is_added_to() {
    let place = Place::new();
    let reference = |stats: &str, redirection: &str| {
        fs::write(place.path("log"), "earlier\n").unwrap();
        let vtrace = env!("CARGO_BIN_EXE_vtrace");
        let line = format!(
            "exec '{vtrace}' reference scene.glb --size 8x8 -o a.png --stats {stats} {redirection} >>log"
        );
        let output = Command::new("sh").current_dir(place.0.path()).args(["-c", &line]).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{stats}: {}", text(&output.stderr));
        fs::read_to_string(place.path("log")).unwrap()
    };
    for stats in ["-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"] {
        let log = reference(stats, "");
        let json = log.strip_prefix("earlier\n").unwrap_or_else(|| panic!("{stats}: {log}"));
        serde_json::from_str::<serde_json::Value>(json).unwrap_or_else(|error| panic!("{stats}: {error}"));
    }
    let log = reference("/dev/fd/3", "3>>log");
    assert!(log.starts_with("earlier\n{") && log.ends_with("wrote    a.png\n"), "{log}");
}
