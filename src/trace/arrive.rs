//! Rays that arrive at faces and what leaves from there; at those of one plain finish they are shaded side by side.

use glam::Vec3;

use super::cone::{Cone, Filtering};
use super::finish::Finish;
use super::light::Incident;
use super::optics::{self, At, BranchKind, Leaving};
use super::real::{Real, Triple};
use super::shade::{Lights, MASK_LIGHTS};
use super::shaft::Shafts;
use super::texel::{Place, Texels};
use super::vector::{Isa, Lanes3, Mask, Numbers, WIDTH, Work, get, put};
use super::{Hit, Rays, Settings, Tracer};
use crate::scene::Scene;

/// A specular ray of the next bounce.
pub(super) struct Ray {
    /// The point whose radiance it is part of.
    pub point: u32,
    /// As [`Branch`](optics::Branch) has them.
    pub origin: Vec3,
    pub direction: Vec3,
    pub start: Vec3,
    /// Share of the radiance along it that reaches the eye.
    pub throughput: Vec3,
    /// Where it starts; nothing where textures are not filtered.
    pub cone: Cone,
    /// Material of the body that it runs through, or [`OUTSIDE`](Self::OUTSIDE).
    pub body: u32,
}

/// A ray that has met something.
#[derive(Clone, Copy)]
pub(super) struct Arrival {
    /// The point whose radiance it is part of.
    pub point: u32,
    /// Its unit direction.
    pub direction: Vec3,
    pub hit: Hit,
    /// Share of the radiance along it that reaches the eye.
    pub throughput: Vec3,
    /// Where it arrives; nothing where textures are not filtered.
    pub cone: Cone,
}

impl Ray {
    /// No body.
    pub const OUTSIDE: u32 = u32::MAX;

    /// What its body lets through on the way to `end`; `None` for a ray that leaves the scene.
    pub fn transmittance(&self, scene: &Scene, end: Option<Vec3>) -> Vec3 {
        let volume = scene.materials.get(self.body as usize).and_then(|material| material.volume);
        optics::transmittance(volume, self.start, end)
    }
}

/// Rays below which shading side by side would mostly shade nothing.
pub(super) const FEWEST_POINTS: usize = 3;

/// Rays that arrive, and where what comes of them goes.
pub(super) struct Arrive<'a> {
    pub tracer: &'a Tracer<'a>,
    pub settings: &'a Settings,
    /// How textures are; `None` where they are read at level 0.
    pub filtering: Option<Filtering<'a>>,
    /// The finish of all the faces; plain.
    pub finish: &'a Finish,
    /// Among which shadow rays look; `None` where none are asked for.
    pub shafts: Option<&'a Shafts>,
    /// Rays that arrive, and which of them are meant.
    pub arrivals: &'a [Arrival],
    pub which: &'a [u32],
    /// Whether others leave.
    pub goes_on: bool,
    /// By point.
    pub radiances: &'a mut [Vec3],
    /// Reflected and refracted rays.
    pub next: &'a mut [Vec<Ray>; 2],
    pub rays: &'a mut Rays,
}

/// The same where textures are filtered: compiled apart, so that the others carry nothing of it.
pub(super) struct ArriveFiltered<'a>(pub Arrive<'a>);

impl Work for Arrive<'_> {
    #[inline(always)]
    fn run<S: Isa>(mut self, simd: S) {
        self.all::<S, false>(simd);
    }
}

impl Work for ArriveFiltered<'_> {
    #[inline(always)]
    fn run<S: Isa>(mut self, simd: S) {
        self.0.all::<S, true>(simd);
    }
}

impl Arrive<'_> {
    #[inline(always)]
    fn all<S: Isa, const FILTERED: bool>(&mut self, simd: S) {
        let slot = self.finish.texture.as_ref();
        let texture = slot.map(|slot| Texels::new(self.tracer.scene(), slot));
        for which in self.which.chunks(WIDTH) {
            self.some::<S, FILTERED>(simd, texture.as_ref(), which);
        }
    }

    #[inline(always)]
    fn some<S: Isa, const FILTERED: bool>(&mut self, simd: S, texture: Option<&Texels>, which: &[u32]) {
        let Self { tracer, settings, finish, .. } = *self;
        let filtering = if FILTERED { self.filtering } else { None };
        let scene = tracer.scene();
        let [mut positions, mut normals, mut facets, mut directions, mut throughputs, mut texels]: [Lanes3;
            6] = [[[0.0; WIDTH]; 3]; 6];
        let mut offsets = [0.0; WIDTH];
        let mut places = [Place::default(); WIDTH];
        for (lane, &index) in which.iter().enumerate().take(WIDTH) {
            let Arrival { direction, hit, throughput, cone, .. } = &self.arrivals[index as usize];
            let record = tracer.record(hit.face);
            put(&mut positions, lane, record.position(hit.u, hit.v));
            put(&mut normals, lane, record.normal(hit.u, hit.v));
            put(&mut facets, lane, record.ng);
            put(&mut directions, lane, *direction);
            put(&mut throughputs, lane, *throughput);
            offsets[lane] = record.offset;
            if let Some(texture) = texture {
                let uv = record.uv(hit.u, hit.v);
                match filtering {
                    None => places[lane] = texture.place(uv),
                    Some(filtering) => {
                        let footprint = filtering.footprint(tracer, hit.face, *cone, *direction);
                        put(&mut texels, lane, texture.rgba_over(Some(&footprint), uv).truncate());
                    }
                }
            }
        }
        if let (Some(texture), None) = (texture, filtering) {
            // In a loop of their own, so that the processor waits for all of them at once.
            let mut fetched = [[[0; 4]; 4]; WIDTH];
            for (fetched, place) in fetched.iter_mut().zip(&places[..which.len()]) {
                *fetched = texture.fetch(place);
            }
            for (lane, place) in places[..which.len()].iter().enumerate() {
                put(&mut texels, lane, texture.rgb(fetched[lane], place));
            }
        }
        let zero = Numbers::splat(simd, 0.0);
        let position = Triple::load(simd, &positions);
        let direction = Triple::load(simd, &directions);
        let throughput = Triple::load(simd, &throughputs);
        let facet = Triple::load(simd, &facets);
        let ng = facet.where_else(facet.dot(direction).lt(zero), -facet);
        let n = {
            let n = Triple::load(simd, &normals);
            let inverse = zero.all(1.0) / n.dot(n).sqrt();
            let usable = zero.lt(inverse) & inverse.lt(zero.all(f32::INFINITY));
            (n * inverse).where_else(usable, facet)
        };
        let inside = n.dot(ng).lt(zero);
        let n = (-n).where_else(inside, n);
        let texel = match texture {
            Some(_) => Triple::load(simd, &texels),
            None => Triple::all(zero, Vec3::ONE),
        };
        let front = position + ng * Numbers::load(simd, &offsets);

        let mut lights = Shadows { tracer, shafts: self.shafts, origins: front, rays: &mut *self.rays };
        let [textured, added] = finish.scattering.local(scene, position, n, direction, &mut lights);
        let [x, y, z] = (textured.times(texel) + added).times(throughput).store();
        for (lane, &index) in which.iter().enumerate().take(WIDTH) {
            let point = self.arrivals[index as usize].point;
            self.radiances[point as usize] += Vec3::new(x[lane], y[lane], z[lane]);
        }
        if !self.goes_on {
            return;
        }

        let at = At { n, ng, outside: !inside, base: Triple::all(zero, finish.appearance.base).times(texel) };
        let material = &scene.materials[finish.material as usize];
        let [reflected, refracted] = optics::leave(settings, material, &finish.appearance, &at, direction);
        let body = if material.volume.is_some() { finish.material } else { Ray::OUTSIDE };
        let glass = optics::glass(&finish.appearance) > 0.0;
        let inside = inside.bits();
        let behind = position - ng * Numbers::load(simd, &offsets);
        let ways = [(reflected, front, if glass { inside } else { 0 }), (refracted, behind, !inside)];
        for (way, ((leaving, origin, within), next)) in ways.into_iter().zip(&mut *self.next).enumerate() {
            let Some(Leaving { any, direction, attenuation }) = leaving else { continue };
            let throughput = attenuation.times(throughput);
            // Of what is no number nothing goes on.
            let strong = zero.all(settings.min_throughput).le(throughput.greatest());
            let mut lanes = (any & strong).bits() & (u16::MAX >> (WIDTH - which.len()));
            let (origins, directions, throughputs) = (origin.store(), direction.store(), throughput.store());
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize % WIDTH;
                lanes &= lanes - 1;
                let Arrival { point, hit, cone, .. } = &self.arrivals[which[lane] as usize];
                let cone = if FILTERED {
                    let kind = [BranchKind::Reflect, BranchKind::Refract][way];
                    cone.leaving(kind, tracer.record(hit.face), material, inside >> lane & 1 == 0)
                } else {
                    Cone::default()
                };
                next.push(Ray {
                    point: *point,
                    cone,
                    origin: get(&origins, lane),
                    direction: get(&directions, lane),
                    throughput: get(&throughputs, lane),
                    start: get(&positions, lane),
                    body: if within >> lane & 1 == 1 { body } else { Ray::OUTSIDE },
                });
            }
        }
    }
}

/// Shadow rays from a place a lane.
struct Shadows<'a, S: Isa> {
    tracer: &'a Tracer<'a>,
    shafts: Option<&'a Shafts>,
    origins: Triple<Numbers<S>>,
    rays: &'a mut Rays,
}

impl<S: Isa> Lights<Numbers<S>> for Shadows<'_, S> {
    #[inline(always)]
    fn lit(&mut self, index: usize, incident: &Incident<Numbers<S>>, facing: Mask<S>) -> Mask<S> {
        let (Some(shafts), true) = (self.shafts, index < MASK_LIGHTS) else { return facing };
        let Some(entries) = shafts.to(index) else { return facing };
        let lanes = facing.bits();
        self.rays.shadow += u64::from(lanes.count_ones());
        let occluded =
            self.tracer.occluded_of_each(entries, self.origins, incident.to_light, incident.distance, lanes);
        Mask::from_bits(facing.simd(), lanes & !occluded)
    }
}
