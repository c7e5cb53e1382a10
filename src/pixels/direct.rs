//! Faces so many and so small that the refined mesh need not know them: their pixels are traced from the image of the faces
//! alone, and drawn as one picture.

use std::sync::atomic::{AtomicBool, Ordering};

use glam::Vec2;
use rayon::prelude::*;

use super::picture::{self, PicturePixel};
use super::point_on;
use super::store::PixelStore;
use crate::error::{Error, Result};
use crate::options::Options;
use crate::scene::{Scene, View};
use crate::trace::Rays;
use crate::trace::cone::Filtering;
use crate::trace::sample::Context;
use crate::trace::wave::Points;
use crate::visibility::{Found, IdImage};

/// Number of such faces from which leaving them out of the mesh is worth a picture of the frame's size: one for so many of
/// its pixels, and how many at least.
const PIXELS_A_FACE: usize = 1024;
const MANY: usize = 512;

/// The same where samples are spared, against which all their pixels count.
const SPARING: usize = 16_384;

/// Visible pixels below which a face is one of them: about as long as its pixels take to be traced, its share of the mesh
/// takes to be refined and drawn.
const FEW_PIXELS: u32 = 8;

/// Rows that one task traces, and columns that it traces together.
const TILE: usize = 8;

/// Tasks whose pixels are kept apart until all of them are done.
const BATCH: usize = 64;

/// Share of the way from the eye to the nearest of these faces at which their picture is drawn: before all that they hide.
const BEFORE: f32 = 0.5;

/// The same of where a pixel shows them, if what is drawn among them is blended: more than rounding may move either, so that
/// what they hide stays behind them.
const NEARER: f32 = 1.0 - 1e-5;

/// The visible faces that are traced directly.
#[derive(Debug, Clone, Default)]
pub struct Direct {
    /// By face of the scene; empty if there is none.
    is_direct: Vec<bool>,
    /// Objects that have such faces, ascending.
    pub objects: Vec<u32>,
    /// Pixels that they own.
    pixels: u64,
    /// Depth before the eye, along the view's axis, at which their picture is drawn: nearer than any of them, if its corners can
    /// be told apart there.
    pub depth: f32,
}

impl Direct {
    /// Those of `found` that are `wanted`, if they are many: faces of fewer than eight pixels, specular ones alone where a pixel
    /// has several samples that are drawn. It must be known which pixels show them.
    pub fn find(
        scene: &Scene,
        view: &View,
        found: &Found,
        options: &Options,
        wanted: impl Fn(u32) -> bool + Sync,
    ) -> Self {
        let Options { method, effort, .. } = options;
        let many = match effort.spared_samples() {
            Some(_) => SPARING,
            None => (view.pixels() / PIXELS_A_FACE).max(MANY),
        };
        let all = !method.has_sub_samples();
        let counts = &found.faces.pixels_per_face;
        let is_small = |&&face: &&u32| {
            (1..FEW_PIXELS).contains(&counts[face as usize]) && (all || scene.is_vt(face)) && wanted(face)
        };
        if found.ids.is_none() || found.visible.len() < many {
            return Self::default();
        }
        let faces: Vec<u32> = found.visible.par_iter().filter(is_small).copied().collect();
        if faces.len() < many {
            return Self::default();
        }
        let mut objects: Vec<u32> =
            faces.iter().map(|&face| scene.geometry.face_objects[face as usize]).collect();
        objects.dedup();
        objects.sort_unstable();
        objects.dedup();
        let mut direct = Self { is_direct: vec![false; counts.len()], objects, pixels: 0, depth: 0.0 };
        for &face in &faces {
            direct.is_direct[face as usize] = true;
            direct.pixels += u64::from(counts[face as usize]);
        }
        let depth_of = |&face: &u32| {
            let depths = scene.geometry.corners(face).map(|corner| (corner - view.eye).dot(view.forward));
            depths.into_iter().fold(f32::INFINITY, f32::min)
        };
        let nearest = faces.par_iter().map(depth_of).reduce(|| f32::INFINITY, f32::min);
        direct.depth = (nearest * BEFORE).max(picture::nearest_depth(view));
        direct
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.is_direct.is_empty()
    }

    /// Whether `face` of the scene is one of them.
    pub fn is(&self, face: u32) -> bool {
        self.is_direct.get(face as usize).is_some_and(|&is| is)
    }

    /// Traces their pixels in `ids`, row by row; where they are more than `most`, those of some rows alone, about as many.
    /// Pixels that `store` knows are not traced, and it learns the others.
    ///
    /// # Errors
    /// [`Error::Interrupted`] once `interrupt` is set.
    pub fn trace(
        &self,
        context: &Context,
        ids: Option<IdImage>,
        most: u64,
        mut store: Option<&mut PixelStore>,
        interrupt: &AtomicBool,
    ) -> Result<(Vec<PicturePixel>, Rays)> {
        let Some(ids) = ids.filter(|_| !self.is_empty()) else { return Ok(Default::default()) };
        if let Some(store) = &mut store {
            store.look_at(context.view);
        }
        let known = store.as_deref();
        let filtering = context.filtering();
        let stride = self.pixels.div_ceil(most).max(1) as usize;
        let rows: Vec<u32> = (0..context.view.height).step_by(stride).collect();
        let mut total = Rays::default();
        let mut all = Vec::with_capacity((self.pixels / stride as u64) as usize);
        // A batch after the other, so that not all pixels are there twice.
        for rows in rows.chunks(TILE * BATCH) {
            if interrupt.load(Ordering::Relaxed) {
                return Err(Error::Interrupted);
            }
            let bands =
                rows.par_chunks(TILE).map(|rows| self.trace_band(context, filtering, ids, rows, known));
            for (pixels, rays) in bands.collect::<Vec<_>>() {
                total += rays;
                all.extend(pixels);
            }
        }
        if let Some(store) = store {
            for &PicturePixel { index, radiance } in &all {
                if let Some(base) = ids.face(index % context.view.width, index / context.view.width) {
                    store.insert(index, base, radiance);
                }
            }
        }
        Ok((all, total))
    }

    /// Depths before the eye, along the view's axis, of what each of the traced `pixels` shows, a little nearer than there.
    pub fn depths(&self, context: &Context, ids: IdImage, pixels: &[PicturePixel]) -> Vec<f32> {
        let view = context.view;
        let depth = |&PicturePixel { index, .. }: &PicturePixel| {
            let (x, y) = (index % view.width, index / view.width);
            let (origin, direction) = view.ray(Vec2::new(x as f32, y as f32) + 0.5);
            let hit = point_on(context, ids.face(x, y)?, (origin, direction))?;
            let depth = (origin + direction * hit.t - view.eye).dot(view.forward);
            (depth >= view.near).then_some(depth * NEARER)
        };
        pixels.par_iter().with_min_len(TILE * TILE).map(|pixel| depth(pixel).unwrap_or(self.depth)).collect()
    }

    /// One sample of each pixel in neighbouring `rows`.
    fn trace_band(
        &self,
        context: &Context,
        filtering: Option<Filtering>,
        ids: IdImage,
        rows: &[u32],
        known: Option<&PixelStore>,
    ) -> (Vec<PicturePixel>, Rays) {
        let Context { tracer, settings, view, .. } = *context;
        let (mut pixels, mut pending) = (Vec::new(), Vec::new());
        let mut points = Points::new(tracer, settings).filtered(filtering);
        for left in (0..view.width).step_by(TILE) {
            let columns = left..(left + TILE as u32).min(view.width);
            for (x, y) in rows.iter().flat_map(|&y| columns.clone().map(move |x| (x, y))) {
                let Some(base) = ids.face(x, y).filter(|&base| self.is(base)) else { continue };
                let index = y * view.width + x;
                let kept = known.and_then(|known| known.get(index, base));
                if kept.is_none() {
                    let ray = view.ray(Vec2::new(x as f32, y as f32) + 0.5);
                    if let Some(hit) = point_on(context, base, ray) {
                        pending.push(pixels.len());
                        points.add(ray.1, hit);
                    }
                }
                pixels.push(PicturePixel { index, radiance: kept.unwrap_or_default() });
            }
            for (pixel, radiance) in pending.drain(..).zip(points.radiances()) {
                pixels[pixel].radiance = radiance.into();
            }
        }
        (pixels, points.rays())
    }
}
