//! Tracing the pixels that interpolation cannot serve, one by one.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::footprint::{Footprint, ROUNDING};
use super::mesh::Mesh;
use super::pixels::Shown;
use super::store::PixelStore;
use crate::trace::reference::sample_pattern;
use crate::trace::sample::{self, Context};
use crate::trace::{Rays, Surface};

/// Leaves whose pixels one task traces.
const CHUNK: usize = 16;

/// Side of the squares of pixels whose leaves are traced one after another: their rays take similar ways.
const TILE: u32 = 16;

/// Distance from all sides of a leaf, in pixels, at which a pixel's centre is certainly in it.
const CERTAIN: f32 = 2.0 * ROUNDING;

/// A pixel traced by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TracedPixel {
    /// `y · width + x`.
    pub index: u32,
    /// The leaf that covers its centre.
    pub face: u32,
    /// The scene's face that the leaf is part of.
    pub base: u32,
    /// Linear radiance.
    pub radiance: Vec3,
}

/// Traces the pixels whose centres lie in the leaves `faces`, from the point of the base face that shows
/// there. An image of the faces says where it does; without one, a primary ray a pixel. Pixels that `store` knows are
/// not traced, and it learns the others. Pixels of one face come together, row by row.
///
/// Of several samples a pixel those count that lie in the leaf, and no store is asked.
pub fn trace(
    context: &Context,
    mesh: &Mesh,
    shown: Shown,
    faces: &[u32],
    store: Option<&mut PixelStore>,
) -> (Vec<TracedPixel>, Rays) {
    let pattern = sample_pattern(context.settings.pixel_samples);
    let mut store = store.filter(|_| pattern.len() == 1);
    if let Some(store) = &mut store {
        store.look_at(context.view);
    }
    let pass = Pass { context, mesh, shown, known: store.as_deref(), pattern: &pattern };
    let mut faces: Vec<u32> =
        faces.iter().copied().filter(|&face| mesh.faces[face as usize].is_leaf()).collect();
    faces.sort_by_cached_key(|&face| {
        let Footprint { columns, rows, .. } = Footprint::new(mesh, context.view, face);
        (rows.start / TILE, columns.start / TILE, face)
    });
    let chunks: Vec<Chunk> = faces
        .par_chunks(CHUNK)
        .map(|faces| {
            let mut chunk = Chunk::default();
            for &face in faces {
                pass.trace_face(face, &mut chunk);
            }
            chunk
        })
        .collect();
    let mut all = Vec::with_capacity(chunks.iter().map(|chunk| chunk.pixels.len()).sum());
    let mut total = Rays::default();
    for Chunk { pixels, rays, .. } in chunks {
        all.extend(pixels);
        total += rays;
    }
    if let Some(store) = store {
        for pixel in &all {
            store.insert(pixel.index, pixel.base, pixel.radiance);
        }
    }
    (all, total)
}

/// The pixels of some leaves.
#[derive(Default)]
struct Chunk {
    pixels: Vec<TracedPixel>,
    rays: Rays,
    /// Nodes of the sample at hand.
    nodes: Vec<sample::Node>,
}

/// What tracing pixels takes.
struct Pass<'a> {
    context: &'a Context<'a>,
    mesh: &'a Mesh,
    shown: Shown<'a>,
    known: Option<&'a PixelStore>,
    /// Where the samples of a pixel lie in it.
    pattern: &'a [Vec2],
}

impl Pass<'_> {
    fn trace_face(&self, face: u32, chunk: &mut Chunk) {
        let Self { context: &Context { view, .. }, mesh, shown, known, pattern } = *self;
        let base = mesh.faces[face as usize].base;
        let footprint = Footprint::new(mesh, view, face);
        for y in footprint.rows.clone() {
            for x in footprint.span(y, ROUNDING) {
                if matches!(shown, Shown::Image(ids) if ids.face(x, y) != Some(base)) {
                    continue;
                }
                let corner = Vec2::new(x as f32, y as f32);
                let centre = view.ray(corner + 0.5);
                // Near its sides the refined mesh says to which leaf a centre belongs: to one alone.
                if footprint.inside(x, y) < CERTAIN {
                    let image = if view.orthographic { mesh.image_of(centre.0) } else { centre.1 };
                    if mesh.leaf_at(base, image) != Some(face) {
                        continue;
                    }
                }
                let index = y * view.width + x;
                let kept = known.and_then(|known| known.get(index, base));
                let mut several = || {
                    let points = pattern.iter().map(|&inside| corner + inside);
                    let within = points.filter(|&point| footprint.inside_at(point) >= 0.0);
                    mean(within.filter_map(|point| self.radiance(base, view.ray(point), chunk)))
                };
                let seen = kept.or_else(|| if pattern.len() > 1 { several() } else { None });
                let radiance = seen.or_else(|| self.radiance(base, centre, chunk));
                chunk.pixels.extend(radiance.map(|radiance| TracedPixel { index, face, base, radiance }));
            }
        }
    }

    /// What a view ray sees of base face `base`, if it shows there.
    fn radiance(&self, base: u32, ray: (Vec3, Vec3), chunk: &mut Chunk) -> Option<Vec3> {
        let Chunk { rays, nodes, .. } = chunk;
        if matches!(self.shown, Shown::Counts(_)) {
            rays.primary += 1;
            self.context.tracer.closest(ray.0, ray.1).filter(|hit| hit.face == base)?;
        }
        radiance(self.context, base, ray, nodes, rays)
    }
}

/// Mean of some radiances; `None` of none.
pub(super) fn mean(radiances: impl Iterator<Item = Vec3>) -> Option<Vec3> {
    let (sum, count) = radiances.fold((Vec3::ZERO, 0), |(sum, count), radiance| (sum + radiance, count + 1));
    (count > 0).then(|| sum / count as f32)
}

/// What a view ray, origin and direction, sees of base face `base`; `None` if that has no area. `nodes` is room to work in.
pub(super) fn radiance(
    context: &Context,
    base: u32,
    (origin, direction): (Vec3, Vec3),
    nodes: &mut Vec<sample::Node>,
    rays: &mut Rays,
) -> Option<Vec3> {
    let surface = surface_at(context, base, origin, direction)?;
    nodes.clear();
    let from_eye = context.view.distance_to(surface.position);
    let primary = sample::trace_surface(context, &surface, direction, from_eye, nodes, rays);
    let own = primary.local.radiance(primary.texel);
    Some(nodes.iter().fold(own, |sum, node| sum + node.radiance()))
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
