//! What one picture took: the schema of `--stats`, and its summary in words (design §9).
//!
//! Every field is always present; what a picture left out is 0, `[]` or `null`.

use std::fmt;

use serde::Serialize;

use crate::{
    options::{Options, ReferenceOptions},
    scene::Scene,
};

/// Counts and times of one picture, by `vtrace render` or `vtrace reference`.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Stats {
    /// The scene as loaded.
    pub scene: SceneStats,
    /// The image.
    pub image: ImageStats,
    /// All that counts against `--max-samples`: vertices sampled, and pixels that were traced one by one to draw the picture
    /// (`--pixel-samples` is beside it). A step that took less than one counts as one. As `--max-samples` this number makes
    /// the picture of a frame that `--budget` ended.
    pub samples: u64,
    /// Vertices sampled.
    pub vertices: u64,
    /// Those of them whose samples an earlier frame had traced, of a renderer that keeps them; not in the file.
    #[serde(skip)]
    pub reused: u64,
    /// Rays cast.
    pub rays: Rays,
    /// Faces drawn.
    pub faces: Faces,
    /// Refinement steps.
    pub steps: u64,
    /// Why refinement stopped.
    pub stopped_by: Option<StoppedBy>,
    /// Predicted RMS displacement of what is reflected, in pixels over VT pixels.
    pub predicted_error: Option<f64>,
    /// Predicted root mean square error of linear radiance over the pixels of refined faces.
    pub predicted_rmse: Option<f64>,
    /// Colour draws of the reconstruction, in order.
    pub passes: Vec<Pass>,
    /// Wall times.
    pub time_ms: Times,
    /// What visibility read back.
    pub readback: Readback,
    /// Stages, passes and buffers that this picture did not need.
    pub left_out: Vec<LeftOut>,
    /// What was ignored, repaired or replaced while loading, one line each.
    pub notes: Vec<String>,
    /// The options that were in force.
    pub options: Option<UsedOptions>,
    /// What drew the picture.
    pub device: Device,
}

/// The options of either command.
#[derive(Debug, Clone, Serialize)]
#[serde(untagged)]
pub enum UsedOptions {
    /// Of `vtrace render`.
    Render(Box<Options>),
    /// Of `vtrace reference`.
    Reference(Box<ReferenceOptions>),
}

/// Size of the scene.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[allow(missing_docs)] // the names say it
pub struct SceneStats {
    pub triangles: u64,
    /// Faces of specular VT objects, never of diffuse shadow receivers.
    pub vt_faces: u64,
    pub textures: u64,
    pub lights: u64,
}

impl SceneStats {
    /// Counts what `scene`, classified, holds.
    pub fn of(scene: &Scene) -> Self {
        Self {
            triangles: scene.geometry.faces.len() as u64,
            vt_faces: scene.vt_faces() as u64,
            textures: scene.textures.len() as u64,
            lights: scene.lights.len() as u64,
        }
    }
}

/// Size of the image.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[allow(missing_docs)]
pub struct ImageStats {
    pub width: u32,
    pub height: u32,
    /// Pixels whose first hit is a specular VT object.
    pub vt_pixels: u64,
}

/// Rays cast, by kind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[allow(missing_docs)]
pub struct Rays {
    /// Sum of the others.
    pub total: u64,
    pub primary: u64,
    pub reflected: u64,
    pub transmitted: u64,
    pub shadow: u64,
    /// Rays of pixels that were traced one by one, and of points between them where shadows' borders are followed.
    pub pixel: u64,
}

/// Faces, by their part in the picture.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Faces {
    /// Specular base faces with at least one pixel.
    pub visible: u64,
    /// Faces of the refined mesh.
    pub leaves: u64,
    /// Specular leaves whose vertices all see the same target (paper §4).
    pub defined: u64,
    /// Specular leaves whose vertices do not.
    pub undefined: u64,
    /// Specular leaves whose pixels were traced one by one: neither of the two, whatever their vertices see.
    pub traced: u64,
}

/// Which limit ended refinement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum StoppedBy {
    /// `--error` was reached.
    Error,
    /// `--max-samples` was reached.
    MaxSamples,
    /// `--budget` was spent.
    Budget,
    /// `--preview` asked for no step.
    Preview,
    /// No face was left to split.
    NothingLeft,
}

/// One colour draw of the reconstruction.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Pass {
    /// Which contribution it draws.
    pub name: String,
    /// Its time on the device.
    pub ms: f64,
    /// Draws recorded in it.
    pub draws: u64,
}

/// Wall times in milliseconds.
///
/// `frame` runs from the camera to the finished linear image, without loading, BVH, image read-back,
/// encoding and files; those from `visibility` to `smooth` are its parts. Where the host has a part in the image, its
/// read-back is within: once in `smooth` with `--pixel-samples`, and in `draw` for every draw where `--ss` takes several,
/// as `--ss 16` does. So are drawing, read-back and file of every step with `--progressive`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct Times {
    pub load: f64,
    pub bvh: f64,
    /// First draw of every pipeline, where the driver compiles.
    pub warmup: f64,
    pub visibility: f64,
    pub readback: f64,
    pub scan: f64,
    pub trace: f64,
    pub refine: f64,
    pub upload: f64,
    pub draw: f64,
    /// Tracing edges again.
    pub smooth: f64,
    pub frame: f64,
}

/// What visibility read back from the device.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Readback {
    /// Bytes copied.
    pub bytes: u64,
    /// Kind of memory that the staging buffer lies in: `cached-coherent`, `cached` or `uncached`.
    pub memory: Option<String>,
}

/// Something that this picture did not need.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// The stage, pass or buffer.
    pub what: String,
    /// Why it is not needed.
    pub why: String,
}

/// What drew the picture.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Device {
    /// Its name; `None` if the device was not used.
    pub name: Option<String>,
    /// Its driver and the driver's version.
    pub driver: Option<String>,
}

impl fmt::Display for Stats {
    /// A few lines for people; a line that would hold only zeros is left out.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(name) = &self.device.name {
            let driver = self.device.driver.as_deref().map_or(String::new(), |driver| format!(" ({driver})"));
            writeln!(f, "device   {name}{driver}")?;
        }
        let Self { scene, image, rays, faces, .. } = self;
        writeln!(
            f,
            "scene    {} triangles ({} specular), {} textures, {} lights",
            scene.triangles, scene.vt_faces, scene.textures, scene.lights
        )?;
        writeln!(f, "image    {}x{}, {} specular pixels", image.width, image.height, image.vt_pixels)?;
        if self.samples > 0 {
            let Self { samples, vertices, steps, .. } = self;
            write!(f, "samples  {samples}, {vertices} of them vertices, in {steps} refinement steps")?;
            if let Some(stopped_by) = self.stopped_by {
                write!(f, ", {}", stopped_by.words())?;
            }
            if let Some(error) = self.predicted_error {
                write!(f, "; predicted error {error:.2} pixels")?;
            }
            writeln!(f)?;
        }
        let kinds = [
            ("primary", rays.primary),
            ("reflected", rays.reflected),
            ("transmitted", rays.transmitted),
            ("shadow", rays.shadow),
            ("pixel", rays.pixel),
        ];
        list(f, "rays", &format!("{}: ", rays.total), kinds.map(|(name, n)| (name, n as f64)), 0, "")?;
        let kinds = [
            ("visible", faces.visible),
            ("leaves", faces.leaves),
            ("defined", faces.defined),
            ("undefined", faces.undefined),
            ("traced", faces.traced),
        ];
        list(f, "faces", "", kinds.map(|(name, n)| (name, n as f64)), 0, "")?;
        list(f, "passes", "", self.passes.iter().map(|pass| (pass.name.as_str(), pass.ms)), 2, " ms")?;
        let t = &self.time_ms;
        list(f, "before", "", [("load", t.load), ("bvh", t.bvh), ("warm-up", t.warmup)], 1, " ms")?;
        let stages = [
            ("visibility", t.visibility),
            ("readback", t.readback),
            ("scan", t.scan),
            ("trace", t.trace),
            ("refine", t.refine),
            ("upload", t.upload),
            ("draw", t.draw),
            ("smooth", t.smooth),
        ];
        list(f, "frame", &format!("{:.1} ms: ", t.frame), stages, 1, " ms")
    }
}

/// One line of `kinds` that are not 0; nothing if all are.
fn list<'a>(
    f: &mut fmt::Formatter<'_>,
    title: &str,
    lead: &str,
    kinds: impl IntoIterator<Item = (&'a str, f64)>,
    digits: usize,
    unit: &str,
) -> fmt::Result {
    let present: Vec<String> = kinds
        .into_iter()
        .filter(|(_, value)| *value > 0.0)
        .map(|(name, value)| format!("{name} {value:.digits$}{unit}"))
        .collect();
    match (present.is_empty(), lead.trim_end_matches(": ")) {
        (false, _) => writeln!(f, "{title:<8} {lead}{}", present.join(", ")),
        (true, "" | "0" | "0.0 ms") => Ok(()),
        (true, lead) => writeln!(f, "{title:<8} {lead}"),
    }
}

impl StoppedBy {
    fn words(self) -> &'static str {
        match self {
            Self::Error => "stopped at the error asked for",
            Self::MaxSamples => "stopped by --max-samples",
            Self::Budget => "stopped by --budget",
            Self::Preview => "a preview",
            Self::NothingLeft => "nothing left to refine",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(value: &serde_json::Value) -> Vec<&str> {
        value.as_object().unwrap().keys().map(String::as_str).collect()
    }

    #[test]
    fn every_field_of_the_contract_is_present_when_all_is_left_out() {
        let json = serde_json::to_value(Stats::default()).unwrap();
        let contract: &[(&str, &[&str])] = &[
            ("scene", &["triangles", "vt_faces", "textures", "lights"]),
            ("image", &["width", "height", "vt_pixels"]),
            ("rays", &["total", "primary", "reflected", "transmitted", "shadow", "pixel"]),
            ("faces", &["visible", "leaves", "defined", "undefined", "traced"]),
            (
                "time_ms",
                &[
                    "load",
                    "bvh",
                    "warmup",
                    "visibility",
                    "readback",
                    "scan",
                    "trace",
                    "refine",
                    "upload",
                    "draw",
                    "frame",
                ],
            ),
            ("readback", &["bytes", "memory"]),
            ("device", &["name", "driver"]),
        ];
        for (group, fields) in contract {
            let present = keys(&json[group]);
            assert!(fields.iter().all(|field| present.contains(field)), "{group}: {present:?}");
        }
        for field in
            ["samples", "vertices", "steps", "stopped_by", "predicted_error", "passes", "left_out", "options"]
        {
            assert!(json.get(field).is_some(), "{field}");
        }
        assert!(json["passes"].is_array() && json["stopped_by"].is_null() && json["samples"] == 0);
    }

    #[test]
    fn summary_leaves_empty_lines_out() {
        let stats = Stats {
            rays: Rays { total: 7, primary: 7, ..Rays::default() },
            time_ms: Times { trace: 2.0, frame: 2.5, ..Times::default() },
            ..Stats::default()
        };
        let text = stats.to_string();
        assert!(text.contains("rays     7: primary 7\n"), "{text}");
        assert!(text.contains("frame    2.5 ms: trace 2.0 ms\n"), "{text}");
        assert!(!text.contains("samples") && !text.contains("faces") && !text.contains("passes"), "{text}");
    }
}
