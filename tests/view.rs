//! The viewer in real windows: on Xvfb displays of its own, on the software device, under validation.

use std::{
    fs,
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use vertex_tracing::{report::FloatImage, scene::demo::Demo};

/// Longest that a viewer may take, on a machine that is busy with other things.
const DEADLINE: Duration = Duration::from_secs(120);

/// A display of its own, with a folder for the files of a test.
struct Display {
    server: Child,
    name: String,
    folder: tempfile::TempDir,
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

impl Display {
    fn open() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "800x600x24", "-nolisten", "tcp", "-noreset", "-fbdir"])
            .arg(folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap_or_else(|error| panic!("the viewer's tests need Xvfb ({error}): apt-get install xvfb"));
        let mut number = String::new();
        BufReader::new(server.stdout.as_mut().unwrap()).read_line(&mut number).unwrap();
        fs::write(folder.path().join("mirror.glb"), Demo::Mirror.glb()).unwrap();
        fs::write(folder.path().join("cup.glb"), Demo::Cup.glb()).unwrap();
        Self { server, name: format!(":{}", number.trim()), folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn vtrace(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_vtrace"));
        command
            .current_dir(self.folder.path())
            .env("DISPLAY", &self.name)
            .env("VTRACE_VALIDATION", "1")
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("RUST_LOG")
            .env_remove("RUST_BACKTRACE")
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    /// Starts a viewer that does what `script` says.
    fn start(&self, arguments: &[&str], script: &str) -> Running {
        fs::write(self.path("script"), script).unwrap();
        let child = self.vtrace().arg("view").args(arguments).args(["--script", "script"]).spawn().unwrap();
        Running(Some(child))
    }

    /// A viewer's output once its script has ended it, without any complaint.
    fn view(&self, arguments: &[&str], script: &str) -> String {
        let output = self.start(arguments, &format!("{script}\nquit")).finish();
        let stderr = text(&output.stderr);
        assert!(output.status.success() && stderr.is_empty(), "{:?}: {stderr}", output.status);
        text(&output.stdout).into()
    }

    /// Runs a printed command line; its picture is then picture.png.
    fn run(&self, line: &str) {
        let words: Vec<&str> = line.split(' ').skip(1).collect();
        let output = self.vtrace().args(words).output().unwrap();
        assert!(output.status.success(), "{line}: {}", text(&output.stderr));
    }

    fn image(&self, name: &str) -> FloatImage {
        FloatImage::read(&self.path(name)).unwrap()
    }

    /// What is on the screen: an XWD file (X11/XWDFile.h) that the server keeps up to date.
    fn screen(&self) -> FloatImage {
        let bytes = fs::read(self.path("Xvfb_screen0")).unwrap();
        let field = |index: usize| u32::from_be_bytes(bytes[index * 4..][..4].try_into().unwrap());
        let (width, height, row, colors) = (field(4), field(5), field(12) as usize, field(19) as usize);
        assert_eq!(field(11), 32, "bits a pixel");
        let start = field(0) as usize + colors * 12;
        let file = self.path("screen.png");
        let rgb: Vec<u8> = (0..height as usize)
            .flat_map(|y| bytes[start + y * row..][..width as usize * 4].chunks_exact(4))
            .flat_map(|bgrx| [bgrx[2], bgrx[1], bgrx[0]])
            .collect();
        image::save_buffer(&file, &rgb, width, height, image::ExtendedColorType::Rgb8).unwrap();
        FloatImage::read(&file).unwrap()
    }

    fn xdotool(&self, arguments: &[&str]) {
        let status = Command::new("xdotool").args(arguments).env("DISPLAY", &self.name).status();
        let status = status.unwrap_or_else(|error| {
            panic!("the viewer's tests need xdotool ({error}): apt-get install xdotool")
        });
        assert!(status.success(), "xdotool {arguments:?}");
    }
}

/// A viewer that is killed rather than left behind.
struct Running(Option<Child>);

impl Drop for Running {
    fn drop(&mut self) {
        if let Some(child) = &mut self.0 {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

impl Running {
    fn finish(mut self) -> Output {
        let start = Instant::now();
        while self.0.as_mut().unwrap().try_wait().unwrap().is_none() {
            if start.elapsed() > DEADLINE {
                let child = self.0.as_mut().unwrap();
                child.kill().unwrap();
                let mut stderr = String::new();
                child.stderr.take().unwrap().read_to_string(&mut stderr).unwrap();
                panic!("the viewer did not end: {stderr}");
            }
            thread::sleep(Duration::from_millis(20));
        }
        self.0.take().unwrap().wait_with_output().unwrap()
    }
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

fn wait_for(what: &str, done: impl Fn() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(start.elapsed() < DEADLINE, "{what} never came");
        thread::sleep(Duration::from_millis(20));
    }
}

fn wait_for_file(file: &Path) {
    wait_for(&file.display().to_string(), || file.exists());
}

#[test]
fn without_a_display_or_a_device_one_line_says_so() {
    let display = Display::open();
    let fails = |command: &mut Command, expected: &str| {
        let output = command.args(["view", "cup.glb"]).output().unwrap();
        let stderr = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{stderr}");
        assert!(stderr.starts_with("error: ") && stderr.contains(expected), "{stderr}");
        assert!(stderr.lines().count() == 1 && !stderr.contains(".rs"), "{stderr}");
    };
    fails(display.vtrace().env_remove("DISPLAY"), "take `vtrace render`");
    fails(display.vtrace().env("DISPLAY", ":98765"), "no display to open a window on");
    fails(display.vtrace().env("VK_LOADER_DRIVERS_SELECT", "none"), "apt-get install mesa-vulkan-drivers");
    // A file that is no library hides the one behind it.
    fs::create_dir(display.path("hidden")).unwrap();
    fs::write(display.path("hidden/libxkbcommon-x11.so.0"), "").unwrap();
    fails(display.vtrace().env("LD_LIBRARY_PATH", display.path("hidden")), "libxkbcommon-x11-0");
    let output = display.vtrace().args(["view", "none.glb"]).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("none.glb"), "{}", text(&output.stderr));
}

#[test]
fn the_printed_line_renders_what_the_window_shows() {
    let display = Display::open();
    let mut seen: Vec<FloatImage> = Vec::new();
    // A scene without lights is lit from where the camera rests: the extension gets a name that nobody knows.
    let mut glb = Demo::Cup.glb();
    let name = |glb: &[u8]| glb.windows(19).position(|name| name == b"KHR_lights_punctual");
    assert!(name(&glb).is_some(), "there are lights to take away");
    while let Some(at) = name(&glb) {
        glb[at..at + 3].copy_from_slice(b"XXX");
    }
    fs::write(display.path("dark.glb"), glb).unwrap();
    let script = "key o\nwait-frame\norbit 60 -25\nwait-full\nscreenshot seen.png\nkey c";
    let output = display.start(&["dark.glb", "--size", "120x90"], &format!("{script}\nquit")).finish();
    display.run(text(&output.stdout).trim());
    assert_eq!(display.image("seen.png"), display.image("picture.png"));

    for keys in
        ["", "key m\nkey e", "key r\nkey h", "key v\nkey -\nkey -\nkey -\nkey -", "key x", "key d\nkey d"]
    {
        let script = format!(
            "key o\nwait-frame\norbit 60 -25\npan 20 10\nzoom 2\n{keys}\nwait-full\nscreenshot seen.png\nkey c"
        );
        let line = display.view(&["cup.glb", "--size", "200x150", "--exposure=-0.5"], &script);
        display.run(line.trim());
        let image = display.image("seen.png");
        assert_eq!(image, display.image("picture.png"), "{line}");
        assert!(!seen.contains(&image), "{keys:?} changed nothing");
        seen.push(image);
    }
}

#[test]
fn the_window_shows_the_picture_and_hears_the_user() {
    let display = Display::open();
    let script = "key o\nwait-full\nscreenshot before.png\nsleep 1000000";
    let running = display.start(&["mirror.glb", "--size", "320x200"], script);
    wait_for_file(&display.path("before.png"));
    let before = display.image("before.png");
    let on_screen = || {
        let screen = display.screen();
        FloatImage::from_fn(320, 200, |x, y| screen.pixels[(y * screen.width + x) as usize])
    };
    wait_for("the picture on the screen", || on_screen() == before);

    // A real drag turns the camera; a real key takes a screenshot of it; another quits.
    display.xdotool(&[
        "mousemove",
        "100",
        "100",
        "mousedown",
        "1",
        "mousemove",
        "160",
        "110",
        "mouseup",
        "1",
    ]);
    wait_for("a turned picture", || on_screen() != before);
    // No window manager gives the keyboard to the window.
    display.xdotool(&["search", "--name", "vtrace view", "windowfocus", "--sync"]);
    display.xdotool(&["key", "p"]);
    wait_for_file(&display.path("vtrace-1.png"));
    assert_ne!(display.image("vtrace-1.png"), before);
    display.xdotool(&["key", "q"]);
    let output = running.finish();
    assert!(output.status.success() && output.stderr.is_empty(), "{}", text(&output.stderr));
    assert_eq!(text(&output.stdout), "wrote    vtrace-1.png\n");
}

#[test]
fn sizes_and_losses_are_survived() {
    let display = Display::open();
    let mut script = String::from("key o\nwait-frame\n");
    for (index, size) in ["1 1", "300 7", "7 300", "2 2", "640 400", "1 1", "111 97"].into_iter().enumerate()
    {
        script += &format!("resize {size}\n");
        if index % 2 == 0 {
            script += "orbit 8 3\nwait-frame\n";
        }
    }
    script += "lose swapchain\norbit 8 3\nwait-frame\nlose surface\norbit -8 3\nwait-full\n";
    script += "minimise\norbit 9 1\nsleep 300\nrestore\nwait-full\nscreenshot end.png\nkey c";
    let line = display.view(&["mirror.glb", "--size", "160x120"], &script);
    display.run(line.trim());
    let end = display.image("end.png");
    assert_eq!((end.width, end.height), (111, 97));
    assert_eq!(end, display.image("picture.png"));
}

#[test]
fn a_lost_device_ends_it_with_one_line() {
    let display = Display::open();
    let script = "wait-full\nlose device\norbit 9 9\nwait-full";
    let output = display.start(&["mirror.glb", "--size", "64x48"], script).finish();
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.lines().count() == 1 && stderr.contains("vkAcquireNextImageKHR"), "{stderr}");
}

#[test]
fn a_click_tells_what_is_behind_the_pixel() {
    let display = Display::open();
    let script = "key o\nwait-full\nscreenshot plain.png\nclick 50 60\nwait-full\nscreenshot path.png\nkey n\n\
                  wait-full\nscreenshot again.png";
    let stdout = display.view(&["cup.glb", "--size", "160x120"], script);
    let lines: Vec<&str> = stdout.lines().collect();
    assert_eq!(lines[0], "pixel 50,60");
    assert!(lines[1].starts_with("  sees cup, distance "), "{stdout}");
    assert!(lines[2].starts_with("    reflects "), "{stdout}");
    assert_ne!(display.image("plain.png"), display.image("path.png"));
    assert_eq!(display.image("plain.png"), display.image("again.png"));
}

#[test]
fn lights_move_and_come_back() {
    let display = Display::open();
    let script = "key o\nwait-full\nscreenshot a.png\nlight 40 10\nwait-full\nscreenshot b.png\nkey c\nkey L\n\
                  wait-full\nscreenshot c.png";
    let stdout = display.view(&["cup.glb", "--size", "120x90"], script);
    assert!(stdout.trim().ends_with("# but for the lights that were moved"), "{stdout}");
    assert_ne!(display.image("a.png"), display.image("b.png"));
    assert_eq!(display.image("a.png"), display.image("c.png"));
}

#[test]
fn the_reference_stands_beside_the_picture() {
    let display = Display::open();
    let script = "key o\nkey t\nwait-full\ndrag 60 40 30 40\nwait-full\nscreenshot split.png";
    display.view(&["mirror.glb", "--size", "120x90"], script);
    display.run("vtrace reference mirror.glb -o reference.png --size 120x90");
    display.run("vtrace render mirror.glb -o render.png --size 120x90");
    let [split, reference, render] =
        ["split.png", "reference.png", "render.png"].map(|name| display.image(name));
    for (index, pixel) in split.pixels.iter().enumerate() {
        let expected = match index % 120 {
            0..30 => render.pixels[index],
            30 => [1.0; 3], // the divider
            _ => reference.pixels[index],
        };
        assert_eq!(*pixel, expected, "column {}, row {}", index % 120, index / 120);
    }
}

/// The parts of a .glb file, its binary chunk in a file called `bin`.
fn apart(glb: &[u8], bin: &str) -> (serde_json::Value, Vec<u8>) {
    let length = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
    let json_end = 20 + length(12);
    let mut json: serde_json::Value = serde_json::from_slice(&glb[20..json_end]).unwrap();
    json["buffers"][0]["uri"] = bin.into();
    (json, glb[json_end + 8..json_end + 8 + length(json_end)].to_vec())
}

#[test]
fn a_buffer_beside_the_scene_is_watched() {
    let display = Display::open();
    let (json, mut bin) = apart(&Demo::Mirror.glb(), "live.bin");
    fs::write(display.path("live.gltf"), json.to_string()).unwrap();
    fs::write(display.path("live.bin"), &bin).unwrap();
    let script = "key o\nwait-full\nscreenshot first.png\nsleep 60000";
    let running = display.start(&["live.gltf", "--size", "120x90"], script);
    wait_for_file(&display.path("first.png"));
    // The first mesh moves up.
    let accessor = json["meshes"][0]["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap() as usize;
    let accessor = &json["accessors"][accessor];
    let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let offset = |value: &serde_json::Value| value["byteOffset"].as_u64().unwrap_or(0) as usize;
    let start = offset(view) + offset(accessor);
    for vertex in 0..accessor["count"].as_u64().unwrap() as usize {
        let y = &mut bin[start + vertex * 12 + 4..][..4];
        let moved = f32::from_le_bytes(y.try_into().unwrap()) + 0.3;
        y.copy_from_slice(&moved.to_le_bytes());
    }
    fs::write(display.path("live.bin"), &bin).unwrap();
    let first = display.image("first.png");
    wait_for("the moved mesh", || {
        let screen = display.screen();
        FloatImage::from_fn(120, 90, |x, y| screen.pixels[(y * screen.width + x) as usize]) != first
    });
    drop(running);
    // Coarse while it moves, and whole when it rests.
    let script = "key o\nwait-full\norbit 30 10\nwait-frame\nscreenshot coarse.png\nwait-full\n\
                  screenshot fine.png\nkey c";
    let line = display.view(&["live.gltf", "--size", "120x90", "--coarse", "4"], script);
    display.run(line.trim());
    assert_eq!(display.image("fine.png"), display.image("picture.png"));
    assert_ne!(display.image("fine.png"), display.image("coarse.png"));
}

#[test]
fn files_are_dropped_and_read_again() {
    let display = Display::open();
    fs::write(display.path("broken.glb"), "no scene").unwrap();
    fs::write(display.path("live.glb"), Demo::Mirror.glb()).unwrap();
    let script = "key o\nwait-full\nscreenshot first.png\ndrop broken.glb\nwait-frame\ndrop mirror.glb\nwait-full\n\
                  screenshot dropped.png\ndrop live.glb\nwait-full\nscreenshot live.png\nsleep 60000";
    let after = "key o\nwait-frame\norbit 9 4\ndrop broken.glb\nwait-frame\norbit 9 4\nwait-full\nscreenshot on.png\nkey c\nquit";
    let output = display.start(&["cup.glb", "--size", "120x90"], after).finish();
    let (stdout, stderr) = (text(&output.stdout), text(&output.stderr));
    assert!(stderr.lines().all(|line| line.contains("broken.glb")) && !stderr.is_empty(), "{stderr}");
    assert!(stdout.starts_with("vtrace render cup.glb "), "what is shown goes on being shown: {stdout}");
    display.run(stdout.trim());
    assert_eq!(display.image("on.png"), display.image("picture.png"));

    let running = display.start(&["cup.glb", "--size", "120x90"], script);
    wait_for_file(&display.path("live.png"));
    assert_eq!(display.image("dropped.png"), display.image("live.png"));
    assert_ne!(display.image("first.png"), display.image("dropped.png"));
    fs::write(display.path("live.glb"), Demo::Cup.glb()).unwrap();
    let cup = display.image("first.png");
    wait_for("the changed scene", || {
        let screen = display.screen();
        FloatImage::from_fn(120, 90, |x, y| screen.pixels[(y * screen.width + x) as usize]) == cup
    });
    drop(running);
}
