//! Pixels of leaves that interpolation cannot serve.

use std::sync::atomic::{AtomicBool, Ordering};

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::store::PixelStore;
use super::{HalfRadiance, point_on};
use crate::error::{Error, Result};
use crate::memory;
use crate::refine::footprint::{Footprint, ROUNDING};
use crate::refine::mesh::Mesh;
use crate::refine::shown::Shown;
use crate::trace::eye::first_drawn;
use crate::trace::sample::Context;
use crate::trace::wave::Points;
use crate::trace::{Hit, Rays};

/// Leaves whose pixels one task finds.
const CHUNK: usize = 16;

/// Tasks whose pixels are found before they are traced.
const BATCH: usize = 256;

/// Side of the squares of pixels that are traced together: their rays take similar ways.
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
    /// Linear radiance.
    pub radiance: HalfRadiance,
}

/// Traces the pixels whose centres lie in the leaves `faces`, from the point of the base face that shows
/// there. An image of the faces says where it does; without one, a primary ray a pixel. Pixels that `store` knows are
/// not traced, and it learns the others. Pixels of one face come together, row by row.
///
/// # Errors
/// [`Error::Interrupted`] once `interrupt` is set.
pub fn trace(
    context: &Context,
    mesh: &Mesh,
    shown: Shown,
    faces: &[u32],
    mut store: Option<&mut PixelStore>,
    interrupt: &AtomicBool,
) -> Result<(Vec<TracedPixel>, Rays)> {
    if let Some(store) = &mut store {
        store.look_at(context.view);
    }
    let pass = Pass { context, mesh, shown, known: store.as_deref() };
    let mut faces: Vec<u32> =
        faces.iter().copied().filter(|&face| mesh.faces[face as usize].is_leaf()).collect();
    faces.sort_by_cached_key(|&face| {
        let Footprint { columns, rows, .. } = Footprint::new(mesh, context.view, face);
        (rows.start / TILE, columns.start / TILE, face)
    });
    let mut all = Vec::new();
    let mut total = Rays::default();
    // A batch after the other, so that not all pixels are there twice.
    for batch in faces.chunks(CHUNK * BATCH) {
        if interrupt.load(Ordering::Relaxed) {
            return Err(Error::Interrupted);
        }
        let chunks = batch.par_chunks(CHUNK).map(|faces| {
            let mut chunk = Chunk::default();
            faces.iter().for_each(|&face| pass.find(face, &mut chunk));
            chunk
        });
        let chunks: Vec<Chunk> = chunks.collect();
        let found: usize = chunks.iter().map(|chunk| chunk.pixels.len()).sum();
        let bytes = (2 * (all.len() + found) * size_of::<TracedPixel>()) as u64;
        memory::check(bytes, "pixels that are traced", memory::SMALLER_PICTURE)?;
        all.reserve(found);
        let mut unknown = Vec::with_capacity(chunks.iter().map(|chunk| chunk.unknown.len()).sum());
        for chunk in chunks {
            let before = all.len() as u32;
            unknown.extend(chunk.unknown.iter().map(|point| Point { pixel: point.pixel + before, ..*point }));
            all.extend(chunk.pixels);
            total += chunk.primary;
        }
        total += trace_points(context, mesh, &unknown, &mut all);
    }
    all.shrink_to_fit();
    if let Some(store) = store {
        for pixel in &all {
            store.insert(pixel.index, mesh.faces[pixel.face as usize].base, pixel.radiance);
        }
    }
    Ok((all, total))
}

/// Traces `points` of `pixels`, those of a tile together.
fn trace_points(context: &Context, mesh: &Mesh, points: &[Point], pixels: &mut [TracedPixel]) -> Rays {
    let &Context { tracer, settings, view, .. } = context;
    if points.is_empty() {
        return Rays::default();
    }
    let filtering = context.filtering();
    let across = view.width.div_ceil(TILE);
    let place = |pixel: &TracedPixel| (pixel.index % view.width, pixel.index / view.width);
    let tile = |point: &Point| {
        let (x, y) = place(&pixels[point.pixel as usize]);
        (y / TILE * across + x / TILE) as usize
    };
    let mut starts = vec![0; (across * view.height.div_ceil(TILE)) as usize + 1];
    points.iter().for_each(|point| starts[tile(point) + 1] += 1);
    (1..starts.len()).for_each(|tile| starts[tile] += starts[tile - 1]);
    let mut next = starts.clone();
    let mut order = vec![0; points.len()];
    for (index, point) in points.iter().enumerate() {
        let next = &mut next[tile(point)];
        order[*next] = index as u32;
        *next += 1;
    }
    let tiles = starts.par_windows(2).filter(|ends| ends[0] < ends[1]).map_init(
        || Points::new(tracer, settings).filtered(filtering),
        |wave, ends| {
            let before = wave.rays();
            for &index in &order[ends[0]..ends[1]] {
                let Point { pixel, u, v } = points[index as usize];
                let pixel = &pixels[pixel as usize];
                let (x, y) = place(pixel);
                let (_, direction) = view.ray(Vec2::new(x as f32, y as f32) + 0.5);
                let face = mesh.faces[pixel.face as usize].base;
                wave.add(direction, Hit { face, t: 0.0, u, v });
            }
            (wave.radiances().map(HalfRadiance::from).collect::<Vec<_>>(), wave.rays() - before)
        },
    );
    let traced: Vec<_> = tiles.collect();
    let mut order = order.into_iter();
    let mut total = Rays::default();
    for (radiances, rays) in traced {
        for (radiance, index) in radiances.into_iter().zip(&mut order) {
            pixels[points[index as usize].pixel as usize].radiance = radiance;
        }
        total += rays;
    }
    total
}

/// The pixels of some leaves.
#[derive(Default)]
struct Chunk {
    pixels: Vec<TracedPixel>,
    /// Where those of `pixels` lie whose radiance is not known.
    unknown: Vec<Point>,
    /// Rays to find that.
    primary: Rays,
}

/// A point of its base face that a pixel shows.
#[derive(Clone, Copy)]
struct Point {
    /// Index of the pixel among those that are traced.
    pixel: u32,
    /// Barycentric weights, as [`Hit`] has them.
    u: f32,
    v: f32,
}

/// What tracing pixels takes.
#[derive(Clone, Copy)]
struct Pass<'a> {
    context: &'a Context<'a>,
    mesh: &'a Mesh,
    shown: Shown<'a>,
    known: Option<&'a PixelStore>,
}

impl Pass<'_> {
    /// Finds the pixels of a leaf.
    fn find(&self, face: u32, chunk: &mut Chunk) {
        let Self { context: &Context { view, .. }, mesh, shown, known } = *self;
        let base = mesh.faces[face as usize].base;
        let footprint = Footprint::new(mesh, view, face);
        for y in footprint.rows.clone() {
            for x in footprint.span(y, ROUNDING) {
                if shown.ids.is_some_and(|ids| ids.face(x, y) != Some(base)) {
                    continue;
                }
                let centre = view.ray(Vec2::new(x as f32, y as f32) + 0.5);
                // Near its sides the refined mesh says to which leaf a centre belongs: to one alone.
                if footprint.inside(x, y) < CERTAIN {
                    let image = if view.orthographic { mesh.image_of(centre.0) } else { centre.1 };
                    if mesh.leaf_at(base, image) != Some(face) {
                        continue;
                    }
                }
                let index = y * view.width + x;
                let kept = known.and_then(|known| known.get(index, base));
                if kept.is_none() {
                    let Some(Hit { u, v, .. }) = self.hit(base, centre, &mut chunk.primary) else { continue };
                    chunk.unknown.push(Point { pixel: chunk.pixels.len() as u32, u, v });
                }
                chunk.pixels.push(TracedPixel { index, face, radiance: kept.unwrap_or_default() });
            }
        }
    }

    /// The point of base face `base` under a view ray, if it shows there.
    fn hit(&self, base: u32, ray: (Vec3, Vec3), primary: &mut Rays) -> Option<Hit> {
        if self.shown.ids.is_some() {
            return point_on(self.context, base, ray);
        }
        let (hit, rays) = first_drawn(self.context.tracer, ray);
        primary.primary += rays;
        hit.filter(|hit| hit.face == base)
    }
}
