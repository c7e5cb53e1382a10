//! Pixels of refined faces: which face a pixel shows, and how many pixels show a face.

use std::ops::Range;

use glam::Vec2;

use super::footprint::Footprint;
use super::mesh::{Face, Mesh};
use crate::scene::View;
use crate::trace::eye::first_drawn;
use crate::trace::sample::Context;
use crate::visibility::{Class, Found, IdImage};

/// What is known of the pixels that show a face.
#[derive(Debug, Clone, Copy)]
pub struct Shown<'a> {
    /// How many pixels show each face of the scene.
    pub counts: &'a [u32],
    /// Which face every pixel shows, if that was read back.
    pub ids: Option<IdImage<'a>>,
}

impl<'a> From<&Found<'a>> for Shown<'a> {
    fn from(found: &Found<'a>) -> Self {
        Self { counts: &found.faces.pixels_per_face, ids: found.ids }
    }
}

/// Points at which a face is looked for in the ID buffer: barycentric lattices for small and large faces.
const FEW: &[[f32; 3]] =
    &[[1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0], [0.7, 0.15, 0.15], [0.15, 0.7, 0.15], [0.15, 0.15, 0.7]];
const MANY_SIDE: u32 = 6;

/// Rows in which a face is looked for that points spread over it would miss, and points in each of them.
const MOST_IN_ROW: u32 = 24;

/// The face that needs samples and shows at pixel (`x`, `y`), by a primary ray if no image says it.
pub fn face_at(context: &Context, shown: Shown, classes: &[Class], x: u32, y: u32) -> Option<u32> {
    if let Some(ids) = shown.ids {
        return ids.face(x, y);
    }
    let ray = context.view.ray(Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
    let face = first_drawn(context.tracer, ray).0?.face;
    let object = context.tracer.scene().geometry.face_objects[face as usize];
    (classes[object as usize] != Class::Occluder).then_some(face)
}

/// Estimated number of pixels that show `face`: its projected area times the share of points inside it at
/// which its base face shows; where counts alone are known, times the share of the base face's area that does. And whether
/// all these points show it: its halves are then not looked for, and what hides parts of them between the points is not seen.
pub fn visible(mesh: &Mesh, view: &View, shown: Shown, face: u32) -> (f32, bool) {
    let base = mesh.faces[face as usize].base;
    let pixels = shown.counts[base as usize] as f32;
    if let Some(ids) = shown.ids {
        let is_whole = mesh.root(base) == Some(face);
        return match visible_at_points(mesh, view, ids, face) {
            Some((found, all)) if found > 0.0 => (found, all),
            // What is seen of a face of the scene between all points is known.
            Some(_) if is_whole => (pixels, false),
            _ => match visible_in_rows(mesh, view, ids, face) {
                0.0 if is_whole => (pixels, false),
                found => (found, false),
            },
        };
    }
    let whole = mesh.root(base).map_or(0.0, |root| mesh.area(root));
    (if whole > 0.0 { pixels * (mesh.area(face) / whole).min(1.0) } else { pixels }, false)
}

/// The same by points that are spread over the face's image; `None` where that reaches far beyond the frame or behind the eye.
fn visible_at_points(mesh: &Mesh, view: &View, ids: IdImage, face: u32) -> Option<(f32, bool)> {
    let Face { corners, base, .. } = mesh.faces[face as usize];
    let area = mesh.area(face);
    let projected = corners.map(|v| view.project(mesh.position(v)).map(|(pixel, _)| pixel));
    let frame = ids.pixels.len() as f32;
    let [Some(a), Some(b), Some(c)] = projected else { return None };
    // The image of what is near the eye's plane is larger than its area as seen from the eye.
    if 0.5 * (b - a).perp_dot(c - a).abs() > frame || area > frame {
        return None;
    }
    // Straight between projected corners: which points are looked at does not matter much.
    let shows = |[u, v, w]: [f32; 3]| {
        within(view, a * u + b * v + c * w).is_some_and(|(x, y)| ids.face(x, y) == Some(base))
    };
    let share = if area <= 64.0 {
        FEW.iter().filter(|&&weights| shows(weights)).count() as f32 / FEW.len() as f32
    } else {
        let n = if area > 16384.0 { 4 * MANY_SIDE } else { MANY_SIDE };
        let lattice = (0..n).flat_map(|i| (0..n - i).map(move |j| (i, j)));
        let (mut seen, mut all) = (0, 0);
        for (i, j) in lattice {
            let (u, v) = ((i as f32 + 1.0 / 3.0) / n as f32, (j as f32 + 1.0 / 3.0) / n as f32);
            all += 1;
            seen += u32::from(shows([1.0 - u - v, u, v]));
        }
        seen as f32 / all as f32
    };
    Some((area * share, share == 1.0))
}

/// The same for a face that few points all over it miss, or that reaches far beyond the frame or behind the eye: it is looked
/// for row by row in the part of the frame that it covers.
fn visible_in_rows(mesh: &Mesh, view: &View, ids: IdImage, face: u32) -> f32 {
    let base = mesh.faces[face as usize].base;
    let footprint = Footprint::new(mesh, view, face);
    let spread = |Range { start, end }: Range<u32>| {
        let (length, count) = (end - start, (end - start).min(MOST_IN_ROW));
        (0..count).map(move |cell| start + (2 * cell + 1) * length / (2 * count))
    };
    let seen_in = |y: u32| {
        let span = footprint.span(y, 0.0);
        let points = (span.len() as u32).min(MOST_IN_ROW);
        let seen = spread(span.clone()).filter(|&x| ids.face(x, y) == Some(base)).count();
        if points == 0 { 0.0 } else { span.len() as f32 * seen as f32 / points as f32 }
    };
    let rows = (footprint.rows.len() as u32).min(MOST_IN_ROW);
    if rows == 0 {
        0.0
    } else {
        spread(footprint.rows.clone()).map(seen_in).sum::<f32>() * footprint.rows.len() as f32 / rows as f32
    }
}

/// The pixel that a point of the image plane falls into, if it is inside the frame.
fn within(view: &View, Vec2 { x, y }: Vec2) -> Option<(u32, u32)> {
    (x >= 0.0 && y >= 0.0 && x < view.width as f32 && y < view.height as f32).then_some((x as u32, y as u32))
}
