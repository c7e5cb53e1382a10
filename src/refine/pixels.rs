//! Pixels of refined faces: which face a pixel shows, and how many pixels show a face.

use glam::{Vec2, Vec3};

use super::mesh::Mesh;
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

/// Columns and rows of points in the frame at which a face larger than it is looked for.
const FRAME_SIDE: u32 = 16;

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
    if let Some(ids) = shown.ids {
        return visible_in_image(mesh, view, ids, face);
    }
    let base = mesh.faces[face as usize].base;
    let whole = mesh.root(base).map_or(0.0, |root| mesh.area(root));
    let pixels = shown.counts[base as usize] as f32;
    (if whole > 0.0 { pixels * (mesh.area(face) / whole).min(1.0) } else { pixels }, false)
}

fn visible_in_image(mesh: &Mesh, view: &View, ids: IdImage, face: u32) -> (f32, bool) {
    let base = mesh.faces[face as usize].base;
    let corners =
        mesh.faces[face as usize].corners.map(|v| mesh.images[mesh.vertices[v as usize].point as usize]);
    let area = mesh.area(face);
    let frame = ids.pixels.len() as f32;
    if area > frame {
        return (frame * share_of_frame(mesh, view, ids, base, corners), false);
    }
    // Straight between projected corners: which points are looked at does not matter much.
    let projected =
        mesh.faces[face as usize].corners.map(|v| view.project(mesh.position(v)).map(|(pixel, _)| pixel));
    let shows = |weights: [f32; 3]| {
        let blend = |[a, b, c]: [Vec2; 3]| a * weights[0] + b * weights[1] + c * weights[2];
        let at = match projected {
            [Some(a), Some(b), Some(c)] => within(view, blend([a, b, c])),
            _ => pixel_of(view, corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2]),
        };
        at.is_some_and(|(x, y)| ids.face(x, y) == Some(base))
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
    (area * share, share == 1.0)
}

/// Share of the frame that shows `base` inside the image vectors `corners`: looked for from the frame's side, where a
/// face reaches so far beyond it that points spread over the face would miss it.
fn share_of_frame(mesh: &Mesh, view: &View, ids: IdImage, base: u32, corners: [Vec3; 3]) -> f32 {
    let [a, b, c] = corners;
    let edges = [a.cross(b), b.cross(c), c.cross(a)];
    let (columns, rows) = (view.width.min(FRAME_SIDE), view.height.min(FRAME_SIDE));
    let points = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row)));
    let middle = |cell: u32, cells: u32, size: u32| ((2 * cell + 1) * size / (2 * cells)).min(size - 1);
    let shown = points.filter(|&(column, row)| {
        let (x, y) = (middle(column, columns, view.width), middle(row, rows, view.height));
        let (origin, direction) = view.ray(Vec2::new(x as f32, y as f32) + 0.5);
        let image = if view.orthographic { mesh.image_of(origin) } else { direction };
        let sides = edges.map(|edge| edge.dot(image));
        ids.face(x, y) == Some(base)
            && (sides.iter().all(|&side| side >= 0.0) || sides.iter().all(|&side| side <= 0.0))
    });
    shown.count() as f32 / (columns * rows) as f32
}

/// The pixel that an image vector falls into, if it is inside the frame.
fn pixel_of(view: &View, image: Vec3) -> Option<(u32, u32)> {
    let plane = if view.orthographic {
        Vec2::new(image.x, image.y)
    } else {
        let depth = image.dot(view.forward);
        if depth <= 0.0 {
            return None;
        }
        Vec2::new(image.dot(view.right), image.dot(view.up)) / depth
    };
    let ndc = plane / view.half;
    let x = (ndc.x + 1.0) * 0.5 * view.width as f32;
    let y = (1.0 - ndc.y) * 0.5 * view.height as f32;
    within(view, Vec2::new(x, y))
}

/// The pixel that a point of the image plane falls into, if it is inside the frame.
fn within(view: &View, Vec2 { x, y }: Vec2) -> Option<(u32, u32)> {
    (x >= 0.0 && y >= 0.0 && x < view.width as f32 && y < view.height as f32).then_some((x as u32, y as u32))
}
