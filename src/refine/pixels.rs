//! Pixels of refined faces: how many show a face, and tracing those that interpolation cannot serve.

use std::ops::Range;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::mesh::Mesh;
use super::store::PixelStore;
use crate::scene::View;
use crate::trace::sample::{self, Context};
use crate::trace::{Rays, Surface};
use crate::visibility::{Class, Found, IdImage};

/// What is known of the pixels that show a face.
#[derive(Debug, Clone, Copy)]
pub enum Shown<'a> {
    /// Which face every pixel shows.
    Image(IdImage<'a>),
    /// How many pixels show each face of the scene.
    Counts(&'a [u32]),
}

impl<'a> From<&Found<'a>> for Shown<'a> {
    fn from(found: &Found<'a>) -> Self {
        found.ids.map_or(Self::Counts(&found.faces.pixels_per_face), Self::Image)
    }
}

/// A pixel traced by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TracedPixel {
    /// `y · width + x`.
    pub index: u32,
    /// The leaf that covers its centre.
    pub face: u32,
    /// Linear radiance.
    pub radiance: Vec3,
}

/// Points at which a face is looked for in the ID buffer: barycentric lattices for small and large faces.
const FEW: &[[f32; 3]] =
    &[[1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0], [0.7, 0.15, 0.15], [0.15, 0.7, 0.15], [0.15, 0.15, 0.7]];
const MANY_SIDE: u32 = 6;

/// Columns and rows of points in the frame at which a face larger than it is looked for.
const FRAME_SIDE: u32 = 16;

/// The face that needs samples and shows at pixel (`x`, `y`), by a primary ray if no image says it.
pub fn face_at(context: &Context, shown: Shown, classes: &[Class], x: u32, y: u32) -> Option<u32> {
    match shown {
        Shown::Image(ids) => ids.face(x, y),
        Shown::Counts(_) => {
            let (origin, direction) = context.view.ray(Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
            let face = context.tracer.closest(origin, direction)?.face;
            let object = context.tracer.scene().geometry.face_objects[face as usize];
            (classes[object as usize] != Class::Occluder).then_some(face)
        }
    }
}

/// Most pixels around a face at which it is worth counting those that show it.
const COUNTED: u32 = 1024;

/// Number of pixels that show the unrefined `face`; `None` if it reaches over too many to be counted.
pub fn count(mesh: &Mesh, view: &View, shown: Shown, face: u32) -> Option<u32> {
    let base = mesh.faces[face as usize].base;
    let [columns, rows] = bounds(mesh, view, face);
    if columns.len() as u32 * rows.len() as u32 > COUNTED {
        return None;
    }
    Some(match shown {
        Shown::Image(ids) => {
            let shows = |y: u32| columns.clone().filter(|&x| ids.face(x, y) == Some(base)).count() as u32;
            rows.map(shows).sum()
        }
        Shown::Counts(counts) => counts[base as usize],
    })
}

/// Estimated number of pixels that show `face`: its projected area times the share of points inside it at
/// which its base face shows; where counts alone are known, times the share of the base face's area that does.
pub fn visible(mesh: &Mesh, view: &View, shown: Shown, face: u32) -> f32 {
    match shown {
        Shown::Image(ids) => visible_in_image(mesh, view, ids, face),
        Shown::Counts(counts) => {
            let base = mesh.faces[face as usize].base;
            let whole = mesh.root(base).map_or(0.0, |root| mesh.area(root));
            let pixels = counts[base as usize] as f32;
            if whole > 0.0 { pixels * (mesh.area(face) / whole).min(1.0) } else { pixels }
        }
    }
}

fn visible_in_image(mesh: &Mesh, view: &View, ids: IdImage, face: u32) -> f32 {
    let base = mesh.faces[face as usize].base;
    let corners =
        mesh.faces[face as usize].corners.map(|v| mesh.images[mesh.vertices[v as usize].point as usize]);
    let area = mesh.area(face);
    let frame = ids.pixels.len() as f32;
    if area > frame {
        return frame * share_of_frame(mesh, view, ids, base, corners);
    }
    let shows = |weights: [f32; 3]| {
        let image = corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
        pixel_of(view, image).is_some_and(|(x, y)| ids.face(x, y) == Some(base))
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
    area * share
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
    (x >= 0.0 && y >= 0.0 && x < view.width as f32 && y < view.height as f32).then_some((x as u32, y as u32))
}

/// Traces the pixels whose centres lie in the leaves `faces`, from the point of the base face that shows
/// there. An image of the faces says where it does; without one, a primary ray a pixel. Pixels that `store` knows are
/// not traced, and it learns the others.
pub fn trace(
    context: &Context,
    mesh: &Mesh,
    shown: Shown,
    faces: &[u32],
    mut store: Option<&mut PixelStore>,
) -> (Vec<TracedPixel>, Rays) {
    if let Some(store) = &mut store {
        store.look_at(context.view);
    }
    let known = store.as_deref();
    let chunks: Vec<(Vec<TracedPixel>, Rays)> = faces
        .par_chunks(16)
        .map(|faces| {
            let (mut pixels, mut nodes, mut rays) = (Vec::new(), Vec::new(), Rays::default());
            for &face in faces {
                for (x, y) in pixels_around(mesh, context.view, face) {
                    let base = mesh.faces[face as usize].base;
                    if matches!(shown, Shown::Image(ids) if ids.face(x, y) != Some(base)) {
                        continue;
                    }
                    let centre = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                    let (origin, direction) = context.view.ray(centre);
                    let image = if context.view.orthographic { mesh.image_of(origin) } else { direction };
                    if mesh.leaf_at(base, image) != Some(face) {
                        continue;
                    }
                    let index = y * context.view.width + x;
                    if let Some(radiance) = known.and_then(|known| known.get(index, base)) {
                        pixels.push(TracedPixel { index, face, radiance });
                        continue;
                    }
                    if matches!(shown, Shown::Counts(_)) {
                        rays.primary += 1;
                        if context.tracer.closest(origin, direction).is_none_or(|hit| hit.face != base) {
                            continue;
                        }
                    }
                    let Some(surface) = surface_at(context, base, origin, direction) else { continue };
                    nodes.clear();
                    let from_eye = context.view.distance_to(surface.position);
                    let primary =
                        sample::trace_surface(context, &surface, direction, from_eye, &mut nodes, &mut rays);
                    let radiance = nodes
                        .iter()
                        .fold(primary.local.radiance(primary.texel), |sum, node| sum + node.radiance());
                    pixels.push(TracedPixel { index, face, radiance });
                }
            }
            (pixels, rays)
        })
        .collect();
    let mut all = Vec::new();
    let mut total = Rays::default();
    for (pixels, rays) in chunks {
        all.extend(pixels);
        total += rays;
    }
    if let Some(store) = store {
        for pixel in &all {
            store.insert(pixel.index, mesh.faces[pixel.face as usize].base, pixel.radiance);
        }
    }
    (all, total)
}

/// Pixels whose centres may lie in `face`.
fn pixels_around(mesh: &Mesh, view: &View, face: u32) -> impl Iterator<Item = (u32, u32)> + use<> {
    let [columns, rows] = bounds(mesh, view, face);
    let corners = mesh.faces[face as usize].corners.map(|v| view.project(mesh.position(v)));
    let sides = match corners {
        [Some((a, _)), Some((b, _)), Some((c, _))] => sides([a, b, c]),
        _ => [Vec3::ZERO; 3],
    };
    rows.flat_map(move |y| columns.clone().map(move |x| (x, y))).filter(move |&(x, y)| {
        let centre = Vec3::new(x as f32 + 0.5, y as f32 + 0.5, 1.0);
        sides.iter().all(|side| side.dot(centre) >= -ROUNDING)
    })
}

/// The lines along a triangle's sides: distances to them, in pixels and positive inside, are products with (x, y, 1).
/// All zero for a triangle without area.
fn sides(corners: [Vec2; 3]) -> [Vec3; 3] {
    let [a, b, c] = corners;
    let turn = (b - a).perp_dot(c - a).signum();
    [(a, b), (b, c), (c, a)].map(|(from, to)| {
        let normal = (to - from).perp().normalize_or_zero() * turn;
        normal.extend(-normal.dot(from))
    })
}

/// Pixels by which a device's projection of a point may differ from ours.
const ROUNDING: f32 = 0.05;

/// Columns and rows of the pixels that `face` may reach into.
pub fn bounds(mesh: &Mesh, view: &View, face: u32) -> [Range<u32>; 2] {
    let mut low = Vec2::splat(f32::INFINITY);
    let mut high = Vec2::splat(f32::NEG_INFINITY);
    for corner in mesh.faces[face as usize].corners {
        if let Some((pixel, _)) = view.project(mesh.position(corner)) {
            low = low.min(pixel);
            high = high.max(pixel);
        }
    }
    let range = |low: f32, high: f32, size: u32| {
        let first = (low - ROUNDING).max(0.0) as u32;
        let end = if high >= -ROUNDING { ((high + ROUNDING) as u32 + 1).min(size) } else { 0 };
        first..end
    };
    [range(low.x, high.x, view.width), range(low.y, high.y, view.height)]
}

/// The point of base face `base` under a view ray.
fn surface_at(context: &Context, base: u32, origin: Vec3, direction: Vec3) -> Option<Surface> {
    let [a, b, c] = context.tracer.scene().geometry.corners(base);
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(e2);
    let determinant = e1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let t = origin - a;
    let q = t.cross(e1);
    let u = (t.dot(p) / determinant).clamp(0.0, 1.0);
    let v = (direction.dot(q) / determinant).clamp(0.0, 1.0 - u);
    Some(Surface::new(context.tracer, base, u, v, direction))
}
