//! The conventional per-pixel ray tracer (Whitted) that vertex tracing is held against.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::optics::{self, Branch, BranchKind};
use super::{Appearance, Rays, Settings, Surface, Tracer, shade, surface};
use crate::error::{Error, Result};
use crate::scene::View;

/// Side of the squares of pixels that are traced together, and the height of the bands that threads take turns at.
const TILE: u32 = 8;

/// BLEND surfaces that one camera ray passes before the next counts as opaque.
const MAX_LAYERS: u32 = 64;

/// From this many samples a pixel on, no branch is dropped for its throughput (design §2).
const EXACT_SPP: u32 = 64;

/// An image traced pixel by pixel.
#[derive(Debug, Clone)]
pub struct Reference {
    /// Linear radiance, row by row from the top.
    pub image: Vec<[f32; 3]>,
    /// Rays traced for it.
    pub rays: Rays,
    /// Whether the first surface behind a pixel's centre belongs to a VT object.
    pub vt_mask: Vec<bool>,
    /// Wall-clock time of the image alone.
    pub time_ms: f64,
}

/// Traces `view` with `spp` samples a pixel (at least 1).
///
/// A square number of samples lies on a regular grid, any other on the first points of the R₂ sequence.
/// Where `only` is given, pixels that it marks `false` stay black and cost nothing. The image is the same
/// for any number of threads. `progress` is told the finished share, 0 to 1.
///
/// # Errors
/// [`Error::Interrupted`] once `interrupt` is set.
pub fn render(
    tracer: &Tracer,
    view: &View,
    settings: &Settings,
    spp: u32,
    only: Option<&[bool]>,
    interrupt: &AtomicBool,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<Reference> {
    let start = Instant::now();
    let pattern = sample_pattern(spp.max(1));
    let mut settings = *settings;
    if spp >= EXACT_SPP {
        settings.min_throughput = 0.0;
    }
    let wanted = |pixel: usize| only.is_none_or(|only| only[pixel]);
    let mut image = vec![[0.0; 3]; view.pixels()];
    let mut centres = vec![false; view.pixels()];
    let band = (view.width * TILE) as usize;
    let bands = image.par_chunks_mut(band).zip(centres.par_chunks_mut(band));
    let (finished, count) = (AtomicUsize::new(0), view.height.div_ceil(TILE));
    // Straight into the image, since lists of pixels on the way would be new memory in every frame.
    let rays = bands.enumerate().map(|(index, (image, centres))| {
        let mut path = Path::new(tracer, &settings);
        for (x, row) in band_pixels(view.width, image.len() as u32 / view.width) {
            if x % TILE == 0 && row == 0 && interrupt.load(Ordering::Relaxed) {
                break;
            }
            let (here, y) = ((row * view.width + x) as usize, index as u32 * TILE + row);
            if wanted((y * view.width + x) as usize) {
                image[here] = path.pixel(view, &pattern, x, y).to_array();
                centres[here] = path.first_is_vt;
            }
        }
        let finished = finished.fetch_add(1, Ordering::Relaxed) + 1;
        progress(finished as f32 / count as f32);
        path.rays
    });
    let rays = rays.reduce(Rays::default, |mut sum, rays| {
        sum += rays;
        sum
    });
    if interrupt.load(Ordering::Relaxed) {
        return Err(Error::Interrupted);
    }
    let time_ms = start.elapsed().as_secs_f64() * 1e3;
    // One sample a pixel lies at its centre and has found the first surface there.
    let vt_mask = if pattern.len() == 1 && only.is_none() { centres } else { vt_mask(tracer, view) };
    Ok(Reference { image, rays, vt_mask, time_ms })
}

/// Whether the first surface behind each pixel's centre belongs to a VT object, row by row from the top.
pub fn vt_mask(tracer: &Tracer, view: &View) -> Vec<bool> {
    let scene = tracer.scene();
    (0..view.pixels())
        .into_par_iter()
        .with_min_len(TILE as usize * TILE as usize)
        .map(|pixel| {
            let (x, y) = (pixel as u32 % view.width, pixel as u32 / view.width);
            let (origin, direction) = view.ray(Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
            tracer.closest(origin, direction).is_some_and(|hit| scene.is_vt(hit.face))
        })
        .collect()
}

/// Radiance along one camera ray, and the rays that it took.
pub fn radiance(tracer: &Tracer, settings: &Settings, origin: Vec3, direction: Vec3) -> (Vec3, Rays) {
    let mut path = Path::new(tracer, settings);
    let radiance = path.camera(origin, direction);
    (radiance, path.rays)
}

/// Column and row of the pixels in a band of `height` rows, tile by tile: neighbouring rays share the cache.
fn band_pixels(width: u32, height: u32) -> impl Iterator<Item = (u32, u32)> {
    (0..width).step_by(TILE as usize).flat_map(move |left| {
        (0..height).flat_map(move |row| (left..(left + TILE).min(width)).map(move |x| (x, row)))
    })
}

/// Positions inside the unit square.
fn sample_pattern(spp: u32) -> Vec<Vec2> {
    let side = spp.isqrt();
    if side * side == spp {
        let step = 1.0 / side as f32;
        return (0..spp)
            .map(|i| Vec2::new((i % side) as f32 + 0.5, (i / side) as f32 + 0.5) * step)
            .collect();
    }
    // Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences": powers of the plastic number.
    const PLASTIC: f64 = 1.324_717_957_244_746;
    let point = |i: f64| {
        Vec2::new((0.5 + i / PLASTIC).fract() as f32, (0.5 + i / (PLASTIC * PLASTIC)).fract() as f32)
    };
    (0..spp).map(|i| point(f64::from(i))).collect()
}

/// The tree of rays behind a pixel.
struct Path<'t, 's> {
    tracer: &'t Tracer<'s>,
    settings: &'t Settings,
    rays: Rays,
    /// Whether the last camera ray met a VT object first.
    first_is_vt: bool,
}

impl<'t, 's> Path<'t, 's> {
    fn new(tracer: &'t Tracer<'s>, settings: &'t Settings) -> Self {
        Self { tracer, settings, rays: Rays::default(), first_is_vt: false }
    }

    fn pixel(&mut self, view: &View, pattern: &[Vec2], x: u32, y: u32) -> Vec3 {
        let corner = Vec2::new(x as f32, y as f32);
        let mut sum = Vec3::ZERO;
        for &inside in pattern {
            let (origin, direction) = view.ray(corner + inside);
            sum += self.camera(origin, direction);
        }
        sum / pattern.len() as f32
    }

    /// A ray from the eye: BLEND surfaces cover it in part, and it goes on straight behind them.
    fn camera(&mut self, mut origin: Vec3, direction: Vec3) -> Vec3 {
        let scene = self.tracer.scene();
        let mut sum = Vec3::ZERO;
        let mut share = 1.0;
        self.first_is_vt = false;
        for layer in 0..=MAX_LAYERS {
            self.rays.primary += 1;
            let Some(hit) = self.tracer.closest(origin, direction) else {
                return sum + shade::background(scene, direction) * share;
            };
            let at = Surface::new(self.tracer, hit.face, hit.u, hit.v, direction);
            let appearance = Appearance::new(scene, &at);
            self.first_is_vt |= layer == 0 && at.vt;
            let material = &scene.materials[at.material as usize];
            let covered = if layer == MAX_LAYERS { 1.0 } else { surface::coverage(material, &appearance) };
            if covered > 0.0 {
                let throughput = Vec3::splat(share * covered);
                sum += self.surface(&at, &appearance, direction, 0, throughput) * (share * covered);
            }
            share *= 1.0 - covered;
            if share <= self.settings.min_throughput {
                return sum;
            }
            origin = at.behind();
        }
        sum
    }

    /// Radiance that leaves a surface against `direction`, after `bounces` specular bounces.
    fn surface(
        &mut self,
        at: &Surface,
        appearance: &Appearance,
        direction: Vec3,
        bounces: u32,
        throughput: Vec3,
    ) -> Vec3 {
        let scene = self.tracer.scene();
        let local = if self.settings.shadows.apply(at.vt, bounces) {
            shade::local_shadowed(self.tracer, at, appearance, direction, &mut self.rays)
        } else {
            shade::local(scene, at, appearance, direction, shade::ALL_LIT)
        };
        let mut sum = local.radiance(appearance.base_texel);
        if !at.vt || bounces >= self.settings.depth {
            return sum;
        }
        let material = &scene.materials[at.material as usize];
        for branch in optics::branches(self.settings, material, appearance, at, direction).iter().flatten() {
            let throughput = throughput * branch.attenuation;
            if throughput.max_element() >= self.settings.min_throughput {
                sum += branch.attenuation * self.branch(branch, bounces + 1, throughput);
            }
        }
        sum
    }

    fn branch(&mut self, branch: &Branch, bounces: u32, throughput: Vec3) -> Vec3 {
        match branch.kind {
            BranchKind::Reflect => self.rays.reflected += 1,
            BranchKind::Refract => self.rays.transmitted += 1,
        }
        let scene = self.tracer.scene();
        let Some(hit) = self.tracer.closest(branch.origin, branch.direction) else {
            return shade::background(scene, branch.direction) * branch.transmittance(None);
        };
        let at = Surface::new(self.tracer, hit.face, hit.u, hit.v, branch.direction);
        let inside = branch.transmittance(Some(at.position));
        let appearance = Appearance::new(scene, &at);
        self.surface(&at, &appearance, branch.direction, bounces, throughput * inside) * inside
    }
}
