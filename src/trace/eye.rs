//! View rays of neighbouring pixels, traced as one packet: what a rasterised picture shows along them.

use glam::Vec3;

use super::bvh::{EntryPoints, Packet};
use super::cone::Filtering;
use super::surface::coverage;
use super::wave::Points;
use super::{Appearance, Hit, Rays, Settings, Surface, Tracer, shade};
use crate::scene::Material;

/// Surfaces that one view ray passes before the next stops it.
pub(super) const MAX_LAYERS: u32 = 64;

/// The first point along a view ray, origin and unit direction, on a face that an ID buffer shows, and the rays that it took:
/// backs of one-sided faces are not drawn there, and BLEND faces only if they belong to VT objects.
pub fn first_drawn(tracer: &Tracer, (mut origin, direction): (Vec3, Vec3)) -> (Option<Hit>, u64) {
    for layer in 0..=MAX_LAYERS {
        let Some(hit) = tracer.closest(origin, direction) else { return (None, u64::from(layer) + 1) };
        let record = tracer.record(hit.face);
        let material = &tracer.scene().materials[record.material as usize];
        if !material.culls(record.ng, direction) && !material.is_veil(record.vt) {
            return (Some(hit), u64::from(layer) + 1);
        }
        origin = Surface::new(tracer, hit.face, hit.u, hit.v, direction).behind();
    }
    (None, u64::from(MAX_LAYERS) + 1)
}

/// Some view rays, and room for what they take.
///
/// BLEND surfaces stop a view ray in part.
pub struct ViewRays<'t, 's> {
    tracer: &'t Tracer<'s>,
    settings: &'t Settings,
    /// Origins and unit directions.
    rays: Vec<(Vec3, Vec3)>,
    /// What each meets first.
    hits: Vec<Option<Hit>>,
    entries: EntryPoints,
    points: Points<'t, 's>,
    /// Of each of the points: its ray, and which share of that ray it stops.
    shares: Vec<(u32, f32)>,
    radiances: Vec<Vec3>,
    traced: u64,
    /// By material: whether a view ray may go on behind it.
    passable: Vec<bool>,
    /// Whether it does behind the back of a one-sided face.
    culled: bool,
    /// Whether BLEND surfaces of specular objects stop it whole.
    whole: bool,
}

impl<'t, 's> ViewRays<'t, 's> {
    /// No ray yet. Of a `culled` picture, view rays pass the backs of one-sided faces, as the rasteriser has it.
    pub fn new(tracer: &'t Tracer<'s>, settings: &'t Settings, culled: bool) -> Self {
        let passable = |material: &Material| culled && !material.double_sided || material.is_veil(false);
        Self {
            tracer,
            settings,
            rays: Vec::new(),
            hits: Vec::new(),
            entries: EntryPoints::default(),
            points: Points::new(tracer, settings),
            shares: Vec::new(),
            radiances: Vec::new(),
            traced: 0,
            passable: tracer.scene().materials.iter().map(passable).collect(),
            culled,
            whole: false,
        }
    }

    /// The same of a picture in which specular objects were drawn `whole`, be they BLEND or not.
    #[must_use]
    pub fn of_whole(self, whole: bool) -> Self {
        Self { whole, ..self }
    }

    /// The same with textures filtered over what pixels cover, where that is asked for: the rays are those of pixels.
    #[must_use]
    pub fn filtered(self, filtering: Option<Filtering<'t>>) -> Self {
        Self { points: self.points.filtered(filtering), ..self }
    }

    /// Takes in the ray from `origin` along the unit vector `direction`.
    pub fn add(&mut self, (origin, direction): (Vec3, Vec3)) {
        self.rays.push((origin, direction));
    }

    /// Radiance along each of the rays, in their order; then there is none any more.
    pub fn radiances(&mut self) -> &[Vec3] {
        let Self { tracer, rays, entries, .. } = self;
        let mut packet = Packet::EMPTY;
        for &(origin, direction) in &*rays {
            packet.add(origin, direction);
        }
        tracer.find_entries(&packet, entries);
        self.radiances.clear();
        self.radiances.resize(self.rays.len(), Vec3::ZERO);
        self.tracer.closest_of_each(&self.entries, &self.rays, &mut self.hits);
        for ray in 0..self.rays.len() {
            self.radiances[ray] = self.stop(ray as u32, self.rays[ray].1, self.hits[ray]);
        }
        let Self { points, shares, radiances, .. } = self;
        for (radiance, (ray, share)) in points.radiances().zip(shares.drain(..)) {
            radiances[ray as usize] += radiance * share;
        }
        self.rays.clear();
        &self.radiances
    }

    /// Notes the points that stop a ray which meets `hit` first; what it sees of the background behind them.
    fn stop(&mut self, ray: u32, direction: Vec3, mut hit: Option<Hit>) -> Vec3 {
        let mut share = 1.0;
        for layer in 0..=MAX_LAYERS {
            self.traced += 1;
            let Some(Hit { face, u, v, .. }) = hit else {
                return shade::background(self.tracer.scene(), direction) * share;
            };
            let (stopped, behind) = match layer {
                MAX_LAYERS => (1.0, Vec3::ZERO),
                _ => self.stopped(face, u, v, direction),
            };
            if stopped > 0.0 {
                self.points.add(direction, Hit { face, u, v, t: 0.0 });
                self.shares.push((ray, share * stopped));
            }
            share *= 1.0 - stopped;
            if share <= self.settings.min_throughput {
                break;
            }
            hit = self.tracer.closest(behind, direction);
        }
        Vec3::ZERO
    }

    /// Share of a view ray that a face stops, 0 to 1, and where the rest goes on.
    fn stopped(&self, face: u32, u: f32, v: f32, direction: Vec3) -> (f32, Vec3) {
        let record = self.tracer.record(face);
        if !self.passable[record.material as usize] {
            return (1.0, Vec3::ZERO);
        }
        let material = &self.tracer.scene().materials[record.material as usize];
        let is_back = self.culled && material.culls(record.ng, direction);
        if !is_back && !material.is_veil(self.whole && record.vt) {
            return (1.0, Vec3::ZERO);
        }
        let at = Surface::new(self.tracer, face, u, v, direction);
        (if is_back { 0.0 } else { self.covered(&at, direction) }, at.behind())
    }

    /// Share that a BLEND surface stops.
    #[inline(never)]
    fn covered(&self, at: &Surface, direction: Vec3) -> f32 {
        let Self { tracer, points, .. } = self;
        let footprint = points.filtering().map(|filtering| {
            let cone = filtering.at_first(at.position, direction);
            filtering.footprint(tracer, at.face, cone, direction)
        });
        let material = &tracer.scene().materials[at.material as usize];
        coverage(material, &Appearance::over(footprint.as_ref(), tracer.scene(), at))
    }

    /// Rays traced so far.
    pub fn rays(&self) -> Rays {
        Rays { primary: self.traced, ..self.points.rays() }
    }
}
