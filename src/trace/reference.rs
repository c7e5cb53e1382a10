//! The conventional per-pixel ray tracer (Whitted) that vertex tracing is held against.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::bvh::{EntryPoints, Packet};
use super::eye::{MAX_LAYERS, ViewRays};
use super::optics::{self, Branch, BranchKind};
use super::shaft::Shafts;
use super::{Appearance, Hit, Rays, Settings, Surface, Tracer, shade, surface};
use crate::error::{Error, Result};
use crate::memory;
use crate::scene::View;

/// Side of the squares of pixels that are traced together, and the height of the bands that threads take turns at.
const TILE: u32 = 16;

/// Bytes of a pixel of a [`Reference`] while it is made: three floats, and two marks.
pub const PIXEL_BYTES: u64 = 14;

/// Samples that are followed together, but for those of a last pixel.
const MOST_TOGETHER: usize = 4096;

/// From this many samples a pixel on, no branch is dropped for its throughput (design §2), unless that is asked for.
const EXACT_SPP: u32 = 64;

/// How the conventional tracer follows rays. Its pictures are the same to within rounding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Following {
    /// Each pixel's by themselves but for the first surface: by other code than vertex tracing's, so that errors are measured
    /// against it.
    Alone,
    /// Those of neighbouring pixels bounce by bounce, as vertex tracing follows those of pixels that it traces: the fastest
    /// conventional tracing here, so that times are measured against it.
    Together,
}

/// Samples of each pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Samples {
    /// How many, at least 1.
    pub count: u32,
    /// How their rays are followed.
    pub following: Following,
    /// Branches with a largest throughput below this are dropped, 0 to 1; `None`: none of 64 and more samples, else those
    /// that [`Settings::min_throughput`] says.
    pub min_throughput: Option<f32>,
}

impl Samples {
    /// `settings` as they are for these samples.
    pub fn settings(self, settings: &Settings) -> Settings {
        let usual = if self.count >= EXACT_SPP { 0.0 } else { settings.min_throughput };
        Settings { min_throughput: self.min_throughput.unwrap_or(usual), ..*settings }
    }
}

impl From<u32> for Samples {
    /// As many, followed alone.
    fn from(count: u32) -> Self {
        Self { count, following: Following::Alone, min_throughput: None }
    }
}

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

/// Traces `view` with `samples` of each pixel.
///
/// A square number of samples lies on a regular grid, any other on the first points of the R₂ sequence.
/// Where `only` is given, pixels that it marks `false` stay black and cost nothing. The image is the same
/// for any number of threads. `progress` is told the finished share, 0 to 1.
///
/// # Errors
/// [`Error::Interrupted`] once `interrupt` is set; [`Error::HostMemory`] if the picture cannot be held.
pub fn render(
    tracer: &Tracer,
    view: &View,
    settings: &Settings,
    samples: impl Into<Samples>,
    only: Option<&[bool]>,
    interrupt: &AtomicBool,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<Reference> {
    let start = Instant::now();
    let samples = samples.into();
    let Samples { count: spp, following, .. } = samples;
    let pattern = sample_pattern(spp.max(1));
    let settings = samples.settings(settings);
    let wanted = |pixel: usize| only.is_none_or(|only| only[pixel]);
    memory::check_picture(view.width, view.height, PIXEL_BYTES)?;
    let mut image = vec![[0.0; 3]; view.pixels()];
    let mut centres = vec![false; view.pixels()];
    let band = (view.width * TILE) as usize;
    let bands = image.par_chunks_mut(band).zip(centres.par_chunks_mut(band));
    let (finished, count) = (AtomicUsize::new(0), view.height.div_ceil(TILE));
    // Straight into the image, since lists of pixels on the way would be new memory in every frame.
    let rays = bands.enumerate().map(|(index, (image, centres))| {
        let mut path = Path::new(tracer, &settings);
        let mut tile = Tile::default();
        let mut together = ViewRays::new(tracer, &settings, false);
        let rows = image.len() as u32 / view.width;
        let top = index as u32 * TILE;
        for left in (0..view.width).step_by(TILE as usize) {
            if interrupt.load(Ordering::Relaxed) {
                break;
            }
            let across = left..(left + TILE).min(view.width);
            let all = (0..rows).flat_map(|row| across.clone().map(move |x| (x, row)));
            let pixels = all.filter(|(x, row)| wanted(((top + row) * view.width + x) as usize));
            let ray = |(x, row), inside| view.ray(Vec2::new(x as f32, (top + row) as f32) + inside);
            match following {
                Following::Alone => {
                    for inside in &pattern {
                        tile.find(tracer, &settings, pixels.clone().map(|pixel| ray(pixel, *inside)));
                        for ((x, row), &(direction, hit)) in pixels.clone().zip(&tile.hits) {
                            let here = (row * view.width + x) as usize;
                            let sum =
                                Vec3::from(image[here]) + path.camera(direction, hit, Some(&tile.shafts));
                            image[here] = sum.to_array();
                            centres[here] = hit.is_some_and(|hit| tracer.record(hit.face).vt);
                        }
                    }
                }
                Following::Together => {
                    let mut rest = pixels.clone().peekable();
                    while rest.peek().is_some() {
                        let some: Vec<_> =
                            rest.by_ref().take(MOST_TOGETHER.div_ceil(pattern.len())).collect();
                        for &pixel in &some {
                            pattern.iter().for_each(|&inside| together.add(ray(pixel, inside)));
                        }
                        let radiances = together.radiances().chunks(pattern.len());
                        for (&(x, row), radiances) in some.iter().zip(radiances) {
                            let sum: Vec3 = radiances.iter().sum();
                            image[(row * view.width + x) as usize] = sum.to_array();
                        }
                    }
                }
            }
            for (x, row) in pixels {
                let here = (row * view.width + x) as usize;
                image[here] = (Vec3::from(image[here]) / pattern.len() as f32).to_array();
            }
        }
        let finished = finished.fetch_add(1, Ordering::Relaxed) + 1;
        progress(finished as f32 / count as f32);
        path.rays + together.rays()
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
    let found = following == Following::Alone && pattern.len() == 1 && only.is_none();
    let vt_mask = if found { centres } else { vt_mask(tracer, view) };
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
    let radiance = path.camera(direction, tracer.closest(origin, direction), None);
    (radiance, path.rays)
}

/// The camera rays of a tile, whose first hits and shadows are searched for together.
#[derive(Default)]
struct Tile {
    rays: Vec<(Vec3, Vec3)>,
    entries: EntryPoints,
    found: Vec<Option<Hit>>,
    /// Direction of each ray, and what it hits.
    hits: Vec<(Vec3, Option<Hit>)>,
    shafts: Shafts,
}

impl Tile {
    /// Traces `rays`, origins and unit directions, as far as the first surface.
    fn find(&mut self, tracer: &Tracer, settings: &Settings, rays: impl Iterator<Item = (Vec3, Vec3)>) {
        self.rays.clear();
        self.rays.extend(rays);
        let mut packet = Packet::EMPTY;
        for &(origin, direction) in &self.rays {
            packet.add(origin, direction);
        }
        tracer.find_entries(&packet, &mut self.entries);
        tracer.closest_of_each(&self.entries, &self.rays, &mut self.found);
        self.hits.clear();
        self.hits.extend(self.rays.iter().zip(&self.found).map(|(&(_, direction), &hit)| (direction, hit)));
        let met = self.hits.iter().filter_map(|(direction, hit)| Some((direction, hit.as_ref()?)));
        self.shafts.find(tracer, settings, 0, met);
    }
}

/// Positions inside the unit square: a regular grid for a square number, the centre for one.
pub fn sample_pattern(spp: u32) -> Vec<Vec2> {
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
}

impl<'t, 's> Path<'t, 's> {
    fn new(tracer: &'t Tracer<'s>, settings: &'t Settings) -> Self {
        Self { tracer, settings, rays: Rays::default() }
    }

    /// A ray from the eye that meets `hit` first: BLEND surfaces cover it in part, and it goes on straight behind them.
    /// The first surface's shadow rays look among `shafts`.
    fn camera(&mut self, direction: Vec3, mut hit: Option<Hit>, shafts: Option<&Shafts>) -> Vec3 {
        let scene = self.tracer.scene();
        let mut sum = Vec3::ZERO;
        let mut share = 1.0;
        for layer in 0..=MAX_LAYERS {
            self.rays.primary += 1;
            let Some(Hit { face, u, v, .. }) = hit else {
                return sum + shade::background(scene, direction) * share;
            };
            let at = Surface::new(self.tracer, face, u, v, direction);
            let appearance = Appearance::new(scene, &at);
            let material = &scene.materials[at.material as usize];
            let covered = if layer == MAX_LAYERS { 1.0 } else { surface::coverage(material, &appearance) };
            if covered > 0.0 {
                let throughput = Vec3::splat(share * covered);
                let shafts = shafts.filter(|_| layer == 0);
                sum += self.surface(&at, &appearance, shafts, direction, 0, throughput) * (share * covered);
            }
            share *= 1.0 - covered;
            if share <= self.settings.min_throughput {
                return sum;
            }
            hit = self.tracer.closest(at.behind(), direction);
        }
        sum
    }

    /// Radiance that leaves a surface against `direction`, after `bounces` specular bounces.
    fn surface(
        &mut self,
        at: &Surface,
        appearance: &Appearance,
        shafts: Option<&Shafts>,
        direction: Vec3,
        bounces: u32,
        throughput: Vec3,
    ) -> Vec3 {
        let scene = self.tracer.scene();
        let local = if self.settings.shadows.apply(at.vt, bounces) {
            shade::local_shadowed(self.tracer, shafts, at, appearance, direction, &mut self.rays)
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
        self.surface(&at, &appearance, None, branch.direction, bounces, throughput * inside) * inside
    }
}
