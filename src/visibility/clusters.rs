//! Runs of faces with their bounds: what a view misses is not drawn, and what its frustum cuts is drawn apart.
//!
//! Draws are cut to the measure of Mesa's software rasteriser, which other devices do not mind. It shades up to 4,096
//! vertices at once, eight by eight, and sends all of them through a clipping path whose cost grows with their square if
//! one leaves the frustum, or if eights do not go into their number.

use std::ops::Range;
use std::sync::Arc;

use glam::Vec3;

use crate::scene::Geometry;
use crate::scene::frustum::{Frustum, Overlap};

/// Faces of a run: an eight of vertices goes into it.
const RUN: usize = 128;

/// Most triangles of a draw of which none is clipped. Eight go into it, and their vertices into 4,096.
pub const AT_ONCE: u32 = 1280;
/// Most triangles of a draw that may be clipped.
pub const CUT_AT_ONCE: u32 = 64;

/// Draws over `triangles` that are all inside the frustum, or are `cut` by it.
pub fn split(triangles: Range<u32>, cut: bool) -> impl Iterator<Item = Range<u32>> {
    let Range { mut start, end } = triangles;
    std::iter::from_fn(move || {
        let left = end - start;
        let count = match left {
            _ if cut => left.min(CUT_AT_ONCE),
            ..8 => left,
            _ => (left & !7).min(AT_ONCE),
        };
        start += count;
        (count > 0).then(|| start - count..start)
    })
}

/// The runs of one draw; clones share them.
#[derive(Debug, Clone, Default)]
pub struct Clusters {
    runs: Arc<[Run]>,
}

#[derive(Debug, Clone, PartialEq)]
struct Run {
    /// Of the draw list, not of the scene's faces.
    entries: Range<u32>,
    low: Vec3,
    high: Vec3,
}

impl Clusters {
    /// Runs of `faces`, which a draw list holds from entry `first` on.
    pub fn new(geometry: &Geometry, first: u32, faces: &[u32]) -> Self {
        let run = |(index, faces): (usize, &[u32])| {
            let start = first + (index * RUN) as u32;
            let corners = || faces.iter().flat_map(|&face| geometry.corners(face));
            Run {
                entries: start..start + faces.len() as u32,
                low: corners().fold(Vec3::INFINITY, Vec3::min),
                high: corners().fold(Vec3::NEG_INFINITY, Vec3::max),
            }
        };
        Self { runs: faces.chunks(RUN).enumerate().map(run).collect() }
    }

    /// Ranges of entries to draw, in order.
    pub fn draws(&self, frustum: &Frustum) -> impl Iterator<Item = Range<u32>> {
        let overlaps = self.runs.iter().map(|run| (run, frustum.of_box(run.low, run.high)));
        let mut shown: Vec<(Range<u32>, bool)> = Vec::new();
        for (run, overlap) in overlaps.filter(|&(_, overlap)| overlap != Overlap::Outside) {
            let cut = overlap == Overlap::Cut;
            match shown.last_mut() {
                Some((last, was_cut)) if *was_cut == cut && last.end == run.entries.start => {
                    last.end = run.entries.end;
                }
                _ => shown.push((run.entries.clone(), cut)),
            }
        }
        shown.into_iter().flat_map(|(entries, cut)| split(entries, cut))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Camera, View};

    /// A strip of small faces along x, from −`half` on.
    fn strip(faces: u32, half: f32) -> Geometry {
        let step = 2.0 * half / faces as f32;
        let corner = |i: u32| Vec3::new(i as f32 / 3.0 * step - half, (i % 3) as f32 * 0.01, -5.0);
        Geometry {
            positions: (0..3 * faces).map(corner).collect(),
            faces: (0..faces).map(|face| [0, 1, 2].map(|i| 3 * face + i)).collect(),
            ..Geometry::default()
        }
    }

    fn draws(half: f32, faces: u32) -> Vec<Range<u32>> {
        let camera = Camera::look_at(Vec3::ZERO, Vec3::NEG_Z, 1.0);
        let view = View::new(&camera, 64, 64, (Vec3::splat(-10.0), Vec3::splat(10.0)));
        let list: Vec<u32> = (0..faces).collect();
        let frustum = Frustum::new(&view.clip_from_eye_relative(), view.eye);
        Clusters::new(&strip(faces, half), 7, &list).draws(&frustum).collect()
    }

    #[test]
    fn what_is_inside_is_drawn_in_eights() {
        assert_eq!(draws(2.0, 2565), [7..1287, 1287..2567, 2567..2572]);
    }

    #[test]
    fn what_is_outside_is_not_drawn_and_what_is_cut_is_drawn_apart() {
        // The frustum ends at ±2.73: of eight runs of 128, from −4 to 4, it holds four and cuts one at either side.
        assert_eq!(draws(4.0, 1024), [135..199, 199..263, 263..775, 775..839, 839..903]);
    }
}
