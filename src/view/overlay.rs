//! What the window shows: the picture, the reference beside it, a specular path, figures and help.

use std::time::Duration;

use glam::Vec3;

use super::{
    canvas::{Color, GLYPH, LINE},
    exchange::{Picture, Pixels},
    inspect::{Met, Segment},
    keys,
    viewer::Viewer,
};
use crate::{report::Stats, scene::View, trace::optics::BranchKind};

const WHITE: Color = [255, 255, 255];
const WARNING: Color = [255, 150, 90];
const EYE_RAY: Color = [255, 255, 255];
const REFLECTED: Color = [255, 208, 48];
const TRANSMITTED: Color = [72, 200, 255];

impl Viewer {
    /// What the window shows now, of the window's size.
    pub fn compose(&self) -> Pixels {
        let (width, height) = self.size;
        let Some(picture) = &self.picture else {
            let mut empty = Pixels::filled(width, height, [32; 3]);
            empty.text(8, 8, "loading ...", WHITE);
            return empty;
        };
        let mut canvas = picture.pixels.scaled(width, height);
        if let Some(share) = self.split {
            let column = (share * f64::from(width)) as u32;
            if let Some(reference) = &self.reference {
                canvas.take_right(column, reference);
            }
            for y in 0..height as i32 {
                canvas.set(column as i32, y, WHITE);
            }
            if self.overlay {
                let label = if self.reference.is_some() { "reference" } else { "tracing ..." };
                canvas.lines(column + 4, height.saturating_sub(LINE + 8), &[label.into()], WHITE);
            }
        }
        if let Some(path) = &self.path {
            // The picture of a moving camera may be coarser than the window.
            let view = View { width, height, ..picture.view };
            path.segments.iter().for_each(|segment| draw(&mut canvas, &view, segment));
            path.segments
                .iter()
                .zip(&path.met)
                .for_each(|(segment, met)| mark(&mut canvas, &view, segment, met));
        }
        if self.overlay && !self.help {
            canvas.lines(0, 0, &self.figures(picture), WHITE);
            if let Some(path) = &self.path {
                let lines = path.lines();
                let top = height.saturating_sub((lines.len() as u32 + 1) * LINE + 8);
                canvas.lines(0, top, &lines, WHITE);
            }
        }
        if self.help {
            let lines = keys::help();
            let widest = lines.iter().map(String::len).max().unwrap_or(0) as u32;
            canvas.lines(width.saturating_sub(widest * GLYPH + 8), 0, &lines, WHITE);
        }
        if let Some(problem) = &self.problem {
            canvas.lines(0, height / 2, &wrapped(problem, width), WARNING);
        }
        canvas
    }

    fn figures(&self, picture: &Picture) -> Vec<String> {
        let options = &self.asked.options;
        let (method, paths) = (&options.method, &options.paths);
        let (steps, samples, error) = picture.progress;
        let state = if picture.complete {
            "complete"
        } else if picture.stats.is_some() {
            "moving"
        } else {
            "refining"
        };
        let mut lines = vec![
            format!(
                "{} {} eq {} {} {}",
                method.mode, method.reconstruction, method.equation, method.visibility, method.filter
            ),
            format!(
                "shadows {} depth {} msaa {} ss {}{}{}",
                options.scene.shadows,
                paths.depth,
                method.msaa,
                method.ss,
                if options.scene.fresnel { " fresnel" } else { "" },
                options.show.map_or(String::new(), |show| format!(" showing {show}")),
            ),
            format!("{state}: {samples} samples, {steps} steps, error {error:.2} px"),
        ];
        if let Some(stats) = &picture.stats {
            lines.extend(stage_lines(stats));
        }
        if let Some(frame) = self.timing.latest() {
            lines.push(format!("{:.1} ms between frames", milliseconds(frame)));
        }
        lines
    }
}

fn stage_lines(stats: &Stats) -> [String; 4] {
    let (t, faces, image) = (&stats.time_ms, &stats.faces, &stats.image);
    [
        format!(
            "{} samples traced, {} kept; {}x{}",
            stats.vertices - stats.reused,
            stats.reused,
            image.width,
            image.height
        ),
        format!(
            "{} rays, {} leaves: {} undefined, {} traced",
            stats.rays.total, faces.leaves, faces.undefined, faces.traced
        ),
        format!(
            "frame {:.1} ms: find {:.1} trace {:.1}",
            t.frame,
            t.visibility + t.readback + t.scan,
            t.trace
        ),
        format!("refine {:.1} upload {:.1} draw {:.1}", t.refine, t.upload, t.draw),
    ]
}

fn color(segment: &Segment) -> Color {
    match segment.kind {
        None => EYE_RAY,
        Some(BranchKind::Reflect) => REFLECTED,
        Some(BranchKind::Refract) => TRANSMITTED,
    }
}

/// Marks where a part of a path ends on an object.
fn mark(canvas: &mut Pixels, view: &View, segment: &Segment, met: &Met) {
    if let (Some(_), Some((at, _))) = (&met.object, view.project(segment.to)) {
        canvas.mark(at, color(segment));
    }
}

/// Draws what `view` sees of a part of a path.
fn draw(canvas: &mut Pixels, view: &View, segment: &Segment) {
    let color = color(segment);
    let Some((from, to)) = before_eye(view, segment.from, segment.to) else { return };
    if let (Some((from, _)), Some((to, _))) = (view.project(from), view.project(to)) {
        canvas.line(from, to, color);
    }
}

/// The part of a line that lies before the eye.
fn before_eye(view: &View, from: Vec3, to: Vec3) -> Option<(Vec3, Vec3)> {
    // Twice the near plane's distance, or what rounds to it: a point on the plane itself may be clipped.
    let near = view.near * 2.0 + (to - from).length() * 1e-4;
    let depth = |point: Vec3| (point - view.eye).dot(view.forward) - near;
    let (a, b) = (depth(from), depth(to));
    match (a > 0.0, b > 0.0) {
        (true, true) => Some((from, to)),
        (false, false) => None,
        (true, false) => Some((from, from.lerp(to, a / (a - b)))),
        (false, true) => Some((from.lerp(to, a / (a - b)), to)),
    }
}

fn wrapped(text: &str, width: u32) -> Vec<String> {
    let columns = (width.saturating_sub(8) / GLYPH).max(1) as usize;
    let chars: Vec<char> = text.chars().collect();
    chars.chunks(columns).map(|line| line.iter().collect()).collect()
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}
