//! BLEND faces, which view rays pass in part: their pixels are traced, for no order of drawing is right for all of them, and
//! what is drawn last has no samples that know of shadows. Leaves of specular ones hide what is behind them, whole.

use std::sync::atomic::{AtomicBool, Ordering};

use glam::Vec2;
use rayon::prelude::*;

use super::picture::PicturePixel;
use crate::error::{Error, Result};
use crate::refine::footprint::{Footprint, ROUNDING};
use crate::scene::{AlphaMode, Scene, View};
use crate::trace::Rays;
use crate::trace::eye::ViewRays;
use crate::trace::sample::Context;

/// Side of the squares of pixels that are traced together.
const TILE: u32 = 16;

/// The pixels that BLEND faces may show in.
#[derive(Debug, Default)]
pub struct Veils {
    /// By pixel; empty if there is none.
    covered: Vec<bool>,
    /// How many they are.
    pub pixels: u64,
    /// Specular objects among them, ascending.
    pub specular: Vec<u32>,
}

impl Veils {
    /// Those of the scene in `view`.
    pub fn find(scene: &Scene, view: &View) -> Self {
        let (mut covered, mut specular) = (Vec::new(), Vec::new());
        for (index, object) in (0..).zip(&scene.objects) {
            let material = &scene.materials[object.material as usize];
            if material.alpha_mode != AlphaMode::Blend {
                continue;
            }
            specular.extend(object.vt.then_some(index));
            for face in object.faces.clone() {
                let corners = scene.geometry.corners(face);
                if material.culls(scene.geometry.area_normal(face), view.direction_to(corners[0])) {
                    continue;
                }
                let footprint = Footprint::of(view, corners);
                if footprint.is_empty() {
                    continue;
                }
                covered.resize(view.pixels(), false);
                for y in footprint.rows.clone() {
                    let row = (y * view.width) as usize;
                    let span = footprint.span(y, ROUNDING);
                    covered[row + span.start as usize..row + span.end as usize].fill(true);
                }
            }
        }
        let pixels = covered.par_iter().filter(|&&covered| covered).count() as u64;
        Self { covered, pixels, specular }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.covered.is_empty()
    }

    /// Whether `face` is of a specular object among them: all that it shows is in their picture.
    pub fn holds(&self, scene: &Scene, face: u32) -> bool {
        let object = scene.geometry.face_objects[face as usize];
        !self.specular.is_empty() && self.specular.binary_search(&object).is_ok()
    }

    /// Whether pixel `index` is one of them.
    pub fn covers(&self, index: u32) -> bool {
        self.covered.get(index as usize).is_some_and(|&covered| covered)
    }

    /// Traces them, with all that is seen through them; where they are more than `most`, those of some rows alone, about as
    /// many.
    ///
    /// # Errors
    /// [`Error::Interrupted`] once `interrupt` is set.
    pub fn trace(
        &self,
        context: &Context,
        most: u64,
        interrupt: &AtomicBool,
    ) -> Result<(Vec<PicturePixel>, Rays)> {
        let Context { tracer, settings, view, .. } = *context;
        let filtering = context.filtering();
        let stride = self.pixels.div_ceil(most).max(1) as usize;
        let bands = (0..view.height.div_ceil(TILE)).into_par_iter().step_by(stride).map(|band| {
            let rows = band * TILE..((band + 1) * TILE).min(view.height);
            let mut rays = ViewRays::new(tracer, settings, true).filtered(filtering);
            let mut pixels: Vec<PicturePixel> = Vec::new();
            for left in (0..view.width).step_by(TILE as usize) {
                if interrupt.load(Ordering::Relaxed) {
                    return Err(Error::Interrupted);
                }
                let columns = left..(left + TILE).min(view.width);
                let first = pixels.len();
                for (x, y) in rows.clone().flat_map(|y| columns.clone().map(move |x| (x, y))) {
                    let index = y * view.width + x;
                    if self.covers(index) {
                        rays.add(view.ray(Vec2::new(x as f32, y as f32) + 0.5));
                        pixels.push(PicturePixel { index, radiance: Default::default() });
                    }
                }
                for (pixel, &radiance) in pixels[first..].iter_mut().zip(rays.radiances()) {
                    pixel.radiance = radiance.into();
                }
            }
            Ok((pixels, rays.rays()))
        });
        let bands: Vec<(Vec<PicturePixel>, Rays)> = bands.collect::<Result<_>>()?;
        let rays = bands.iter().fold(Rays::default(), |sum, &(_, rays)| sum + rays);
        Ok((bands.into_iter().flat_map(|(pixels, _)| pixels).collect(), rays))
    }
}
