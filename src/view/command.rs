//! The view as a `vtrace render` command line that makes the same picture.

use std::path::Path;

use glam::{DVec3, Vec3};

use crate::options::{CameraChoice, Choice, Options};

/// The line for `scene` under `options`, at `exposure` stops, for a POSIX shell. Options at their defaults are left out.
pub fn render_line(scene: &Path, options: &Options, exposure: f32) -> String {
    let mut line = Line(vec!["vtrace".into(), "render".into(), quoted(&scene.to_string_lossy())]);
    let default = Options::default();
    let Options { view, method, effort, paths, scene, device, show, everything } = options;
    line.add("-o", "picture.png");
    line.add("--size", &format!("{}x{}", view.width, view.height));
    match &view.camera {
        CameraChoice::First => {}
        CameraChoice::Named(name) => line.add("--camera", name),
        CameraChoice::Eye { eye, target } => {
            line.add("--eye", &point(*eye));
            if let Some(target) = target {
                line.add("--target", &point(*target));
            }
        }
    }
    line.given("--fov", view.fov.map(|fov| fov.to_string()));
    line.choice("--mode", method.mode);
    line.choice("--equation", method.equation);
    line.choice("--reconstruction", method.reconstruction);
    line.changed("--nodes", method.nodes, default.method.nodes);
    line.choice("--visibility", method.visibility);
    line.choice("--msaa", method.msaa);
    line.choice("--ss", method.ss);
    line.choice("--pixel-samples", method.pixel_samples);
    line.choice("--filter", method.filter);
    line.flag("--preview", effort.preview);
    line.given("--error", effort.error.map(|error| error.to_string()));
    line.given("--max-samples", effort.max_samples.map(|samples| samples.to_string()));
    line.flag("--sparing", effort.sparing);
    line.given("--budget", effort.budget.map(|budget| budget.as_millis().to_string()));
    if effort.shaft_guard != default.effort.shaft_guard {
        line.add("--shaft-guard", if effort.shaft_guard { "on" } else { "off" });
    }
    line.changed("--depth", paths.depth, default.paths.depth);
    line.changed("--min-throughput", paths.min_throughput, default.paths.min_throughput);
    line.choice("--shadows", scene.shadows);
    line.flag("--fresnel", scene.fresnel);
    for name in &scene.vt.force {
        line.add("--vt", name);
    }
    for name in &scene.vt.forbid {
        line.add("--no-vt", name);
    }
    line.changed("--roughness-threshold", scene.vt.roughness_threshold, default.scene.vt.roughness_threshold);
    line.given("--background", scene.background.map(color));
    line.given("--environment", scene.environment.as_ref().map(|file| file.to_string_lossy().into_owned()));
    line.given("--max-triangles", scene.max_triangles.map(|n| n.to_string()));
    line.given("--max-texture-bytes", scene.max_texture_bytes.map(|n| n.to_string()));
    line.given("--max-nodes", scene.max_nodes.map(|n| n.to_string()));
    line.changed("--exposure", exposure, 0.0);
    line.given("--show", show.map(|show| show.to_string()));
    line.flag("--everything", *everything);
    line.given("--device", device.clone());
    line.0.join(" ")
}

struct Line(Vec<String>);

impl Line {
    fn add(&mut self, option: &str, value: &str) {
        let value = quoted(value);
        // A value that looks like an option is told apart only this way.
        if value.starts_with('-') {
            self.0.push(format!("{option}={value}"));
        } else {
            self.0.extend([option.into(), value]);
        }
    }

    fn given(&mut self, option: &str, value: Option<String>) {
        if let Some(value) = value {
            self.add(option, &value);
        }
    }

    fn changed<T: PartialEq + ToString>(&mut self, option: &str, value: T, default: T) {
        self.given(option, (value != default).then(|| value.to_string()));
    }

    fn choice<T: Choice + Default>(&mut self, option: &str, value: T) {
        self.given(option, (value != T::default()).then(|| value.name().into()));
    }

    fn flag(&mut self, option: &str, given: bool) {
        if given {
            self.0.push(option.into());
        }
    }
}

/// All digits, so that it reads back as the same numbers.
fn point(p: DVec3) -> String {
    format!("{},{},{}", p.x, p.y, p.z)
}

fn color(c: Vec3) -> String {
    format!("{},{},{}", c.x, c.y, c.z)
}

fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./,=+:@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.into()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_for_the_shell() {
        assert_eq!(quoted("a/b-1.glb"), "a/b-1.glb");
        assert_eq!(quoted("my cup's.glb"), "'my cup'\\''s.glb'");
        assert_eq!(quoted(""), "''");
    }

    #[test]
    fn defaults_are_left_out() {
        let line = render_line(Path::new("a b.glb"), &Options::default(), 0.0);
        assert_eq!(line, "vtrace render 'a b.glb' -o picture.png --size 1280x1024");
        let mut options = Options::default();
        options.view.camera = CameraChoice::Eye { eye: DVec3::new(-1.0, 0.1, 2.0), target: None };
        assert!(render_line(Path::new("s.glb"), &options, 0.0).ends_with("--eye=-1,0.1,2"));
    }
}
