//! Radiance of neighbouring points, traced bounce by bounce: rays that have taken the same branches are searched for as
//! one packet, their shadow rays as one for each light.

use glam::Vec3;

use super::arrive::{Arrival, Arrive, ArriveFiltered, FEWEST_POINTS, Ray};
use super::bvh::{EntryPoints, Packet};
use super::cone::{Cone, Filtering};
use super::finish::{Finish, finish_of};
use super::optics::{self, Branch, BranchKind};
use super::shaft::Shafts;
use super::{Appearance, Hit, Rays, Settings, Surface, Tracer, shade};

/// Points of faces that neighbouring view rays meet.
pub struct Points<'t, 's> {
    tracer: &'t Tracer<'s>,
    settings: &'t Settings,
    filtering: Option<Filtering<'t>>,
    /// Rays of the wave at hand that have met something.
    arrivals: Vec<Arrival>,
    /// Which of them arrive at faces of each finish, and the finishes that have any.
    by_finish: Vec<Vec<u32>>,
    finishes: Vec<u32>,
    points: u32,
    radiances: Vec<Vec3>,
    entries: EntryPoints,
    shafts: Shafts,
    /// Room for waves to come.
    free: Vec<Vec<Ray>>,
    /// Rays of the wave at hand, origins and directions, and what they meet.
    search: (Vec<(Vec3, Vec3)>, Vec<Option<Hit>>),
    rays: Rays,
}

impl<'t, 's> Points<'t, 's> {
    /// No point yet; textures are read at level 0.
    pub fn new(tracer: &'t Tracer<'s>, settings: &'t Settings) -> Self {
        Self {
            tracer,
            settings,
            filtering: None,
            arrivals: Vec::new(),
            by_finish: Vec::new(),
            finishes: Vec::new(),
            points: 0,
            radiances: Vec::new(),
            entries: EntryPoints::default(),
            shafts: Shafts::default(),
            free: Vec::new(),
            search: Default::default(),
            rays: Rays::default(),
        }
    }

    /// The same with textures filtered over what pixels cover, where that is asked for: view rays are those of pixels.
    #[must_use]
    pub fn filtered(self, filtering: Option<Filtering<'t>>) -> Self {
        Self { filtering, ..self }
    }

    /// How textures are.
    pub(super) fn filtering(&self) -> Option<Filtering<'t>> {
        self.filtering
    }

    /// Takes in the point that a view ray along the unit vector `direction` meets.
    pub fn add(&mut self, direction: Vec3, hit: Hit) {
        let cone = match self.filtering {
            Some(filtering) => {
                filtering.at_first(self.tracer.record(hit.face).position(hit.u, hit.v), direction)
            }
            None => Cone::default(),
        };
        self.arrivals.push(Arrival { point: self.points, direction, hit, throughput: Vec3::ONE, cone });
        self.points += 1;
    }

    /// Radiance that leaves each of the points against its view ray, in their order; then there is none any more. BLEND
    /// surfaces count as opaque.
    pub fn radiances(&mut self) -> impl Iterator<Item = Vec3> {
        self.radiances.clear();
        self.radiances.resize(self.points as usize, Vec3::ZERO);
        self.points = 0;
        self.arrive(0);
        self.radiances.drain(..)
    }

    /// Rays traced for all points so far; view rays are the caller's.
    pub fn rays(&self) -> Rays {
        self.rays
    }

    /// An empty wave.
    fn room(&mut self) -> Vec<Ray> {
        self.free.pop().unwrap_or_default()
    }

    /// Follows rays of `bounces` bounces, all of one history.
    fn trace(&mut self, kind: BranchKind, wave: &[Ray], bounces: u32) {
        let Self { tracer, .. } = *self;
        let scene = tracer.scene();
        let mut packet = Packet::EMPTY;
        let (rays, found) = &mut self.search;
        rays.clear();
        for ray in wave {
            packet.add(ray.origin, ray.direction);
            rays.push((ray.origin, ray.direction));
        }
        tracer.find_entries(&packet, &mut self.entries);
        tracer.closest_of_each(&self.entries, rays, found);
        for (ray, hit) in wave.iter().zip(found) {
            let &Ray { point, direction, .. } = ray;
            match *hit {
                Some(hit) => {
                    let mut throughput = ray.throughput;
                    if ray.body != Ray::OUTSIDE {
                        let end = tracer.record(hit.face).position(hit.u, hit.v);
                        throughput *= ray.transmittance(scene, Some(end));
                    }
                    let cone = ray.cone.after(hit.t);
                    self.arrivals.push(Arrival { point, direction, hit, throughput, cone });
                }
                None => {
                    let seen = shade::background(scene, direction) * ray.transmittance(scene, None);
                    self.radiances[point as usize] += seen * ray.throughput;
                }
            }
        }
        match kind {
            BranchKind::Reflect => self.rays.reflected += wave.len() as u64,
            BranchKind::Refract => self.rays.transmitted += wave.len() as u64,
        }
        self.arrive(bounces);
    }

    /// Adds what rays of `bounces` bounces see where they arrive, and follows those that leave from there: what was
    /// reflected, and what was refracted.
    fn arrive(&mut self, bounces: u32) {
        let Self { tracer, settings, .. } = *self;
        let met = self.arrivals.iter().map(|arrival| (&arrival.direction, &arrival.hit));
        self.shafts.find(tracer, settings, bounces, met);
        self.by_finish.resize_with(tracer.finishes().len(), Vec::new);
        for (index, arrival) in self.arrivals.iter().enumerate() {
            let finish = finish_of(tracer.record(arrival.hit.face));
            if self.by_finish[finish].is_empty() {
                self.finishes.push(finish as u32);
            }
            self.by_finish[finish].push(index as u32);
        }
        let mut next = [self.room(), self.room()];
        let mut finishes = std::mem::take(&mut self.finishes);
        for index in finishes.drain(..) {
            let mut which = std::mem::take(&mut self.by_finish[index as usize]);
            self.arrive_at(&tracer.finishes()[index as usize], &which, bounces, &mut next);
            which.clear();
            self.by_finish[index as usize] = which;
        }
        self.finishes = finishes;
        self.arrivals.clear();
        for (kind, mut wave) in [BranchKind::Reflect, BranchKind::Refract].into_iter().zip(next) {
            if !wave.is_empty() {
                self.trace(kind, &wave, bounces + 1);
                wave.clear();
            }
            self.free.push(wave);
        }
    }

    /// The same for those that arrive at faces of one finish.
    fn arrive_at(&mut self, finish: &Finish, which: &[u32], bounces: u32, next: &mut [Vec<Ray>; 2]) {
        let Self { tracer, settings, filtering, .. } = *self;
        let shadows = settings.shadows.apply(finish.vt, bounces);
        let goes_on = finish.vt && bounces < settings.depth;
        if finish.plain
            && which.len() >= FEWEST_POINTS
            && let Some(processor) = tracer.processor()
        {
            let arrive = Arrive {
                tracer,
                settings,
                filtering,
                finish,
                shafts: shadows.then_some(&self.shafts),
                arrivals: &self.arrivals,
                which,
                goes_on,
                radiances: &mut self.radiances,
                next,
                rays: &mut self.rays,
            };
            return match filtering {
                Some(_) => processor.run(ArriveFiltered(arrive)),
                None => processor.run(arrive),
            };
        }
        let scene = tracer.scene();
        for &index in which {
            let Arrival { point, direction, hit, throughput, cone } = self.arrivals[index as usize];
            let footprint = filtering.map(|filtering| filtering.footprint(tracer, hit.face, cone, direction));
            let at = Surface::over(footprint.as_ref(), tracer, hit.face, hit.u, hit.v, direction);
            let appearance = Appearance::over(footprint.as_ref(), scene, &at);
            let local = if shadows {
                shade::local_shadowed(tracer, Some(&self.shafts), &at, &appearance, direction, &mut self.rays)
            } else {
                shade::local(scene, &at, &appearance, direction, shade::ALL_LIT)
            };
            self.radiances[point as usize] += local.radiance(appearance.base_texel) * throughput;
            if !goes_on {
                continue;
            }
            let material = &scene.materials[at.material as usize];
            for branch in
                optics::branches(settings, material, &appearance, &at, direction).into_iter().flatten()
            {
                let throughput = throughput * branch.attenuation;
                if throughput.max_element() >= settings.min_throughput {
                    let Branch { kind, start, origin, direction, medium, .. } = branch;
                    let body = if medium.is_some() { at.material } else { Ray::OUTSIDE };
                    let cone = match filtering {
                        Some(_) => cone.leaving(kind, tracer.record(hit.face), material, at.outside),
                        None => cone,
                    };
                    let ray = Ray { point, origin, direction, start, throughput, cone, body };
                    next[kind.index()].push(ray);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, vec3};

    use super::super::eye::ViewRays;
    use super::super::pyramid::Pyramids;
    use super::super::reference;
    use super::super::vector::Processor;
    use super::*;
    use crate::options::{FilterMode, ViewOptions};
    use crate::scene::classify::{VtRules, classify};
    use crate::scene::demo::{Demo, SceneBuilder, chrome, glass, matte, shape, texture};
    use crate::scene::light::{Light, LightKind};
    use crate::scene::{Camera, Material, Scene, Volume};

    /// What the demos lack: every kind of light, highlights, a thin wall, a body that absorbs, vertex normals that turn away
    /// from the eye, and a material without light.
    fn showroom() -> Scene {
        let mut scene = SceneBuilder::new("showroom");
        let boards = scene.texture(texture::chessboard(64));
        let floor = scene.material(Material { roughness: 0.4, ..matte("floor").textured(boards) });
        scene.mesh("floor", shape::plane(vec3(-3.0, 0.0, 3.0), Vec3::X * 6.0, Vec3::Z * -6.0, 0.5), floor);
        let brass = scene.material(Material {
            roughness: 0.3,
            metallic: 0.8,
            ..matte("brass").colored(vec3(0.8, 0.6, 0.2))
        });
        scene.mesh("brass", shape::sphere(vec3(-1.2, 0.5, 0.3), 0.5, 1), brass);
        let attenuation = Volume { attenuation_color: vec3(0.9, 0.3, 0.2), attenuation_distance: 0.7 };
        let ruby = scene.material(Material { volume: Some(attenuation), ..glass("ruby", 1.7) });
        scene.mesh("ruby", shape::sphere(vec3(0.0, 0.6, 0.4), 0.6, 1), ruby);
        let pane = scene.material(Material { volume: None, double_sided: true, ..glass("pane", 1.5) });
        scene.mesh("pane", shape::plane(vec3(0.2, 0.0, 1.0), Vec3::X, Vec3::Y, 1.0), pane);
        let mirror = scene.material(chrome("mirror", vec3(0.9, 0.8, 0.7)));
        scene.mesh("mirror", shape::sphere(vec3(1.3, 0.6, -0.2), 0.6, 1), mirror);
        let sign = scene.material(Material { unlit: true, ..matte("sign").textured(boards) });
        scene.mesh("sign", shape::plane(vec3(-2.0, 0.0, -1.5), Vec3::X * 4.0, Vec3::Y * 2.0, 1.0), sign);
        let (position, direction) = (vec3(1.0, 3.0, 2.0), vec3(-0.2, -0.9, -0.4).normalize());
        for (kind, intensity) in [
            (LightKind::Point { position, range: 4.5 }, 9.0),
            (
                LightKind::Spot {
                    position: -position.with_y(-2.5),
                    direction,
                    range: f32::INFINITY,
                    inner_cos: 0.95,
                    outer_cos: 0.8,
                },
                12.0,
            ),
            (LightKind::Directional { direction }, 0.8),
        ] {
            scene.light(Light { name: "lamp".into(), kind, intensity: Vec3::splat(intensity) });
        }
        scene.camera(Camera::look_at(vec3(0.0, 1.2, 4.0), vec3(0.0, 0.6, 0.0), 0.8));
        scene.build().unwrap()
    }

    #[test]
    fn together_points_show_what_they_show_alone() {
        let exact = Settings { fresnel: true, min_throughput: 0.0, ..Settings::default() };
        for (mut scene, settings) in [
            (Demo::CupAndGlass.scene(), Settings::default()),
            (Demo::GlassBowl.scene(), exact),
            (showroom(), exact),
            (showroom(), Settings::default()),
        ] {
            classify(&mut scene, &VtRules::default()).unwrap();
            let view =
                ViewOptions { width: 40, height: 32, ..ViewOptions::default() }.resolve(&scene).unwrap();
            let rays: Vec<_> = (0..view.pixels() as u32)
                .map(|pixel| {
                    view.ray(Vec2::new((pixel % view.width) as f32, (pixel / view.width) as f32) + 0.5)
                })
                .collect();
            let mut tracer = Tracer::new(&scene);
            let seen = |tracer: &Tracer, filtering| {
                let mut together = ViewRays::new(tracer, &settings, false).filtered(filtering);
                rays.iter().for_each(|&ray| together.add(ray));
                let radiances = together.radiances().to_vec();
                (radiances, together.rays())
            };
            tracer.set_processor(None);
            let alone = seen(&tracer, None);
            let all = vec![true; scene.textures.len()];
            let filters = [FilterMode::File, FilterMode::Trilinear, FilterMode::Aniso8];
            let pyramids = filters.map(|filter| Pyramids::new(&scene, &all, filter));
            for pyramids in &pyramids {
                tracer.set_processor(None);
                let filtering = pyramids.as_ref().map(|pyramids| pyramids.filtering(&scene, &view));
                let seen_by_one = seen(&tracer, filtering);
                assert_eq!(seen_by_one.1, alone.1, "the same rays");
                assert_eq!(seen_by_one.0 == alone.0, filtering.is_none(), "{}: mip levels show", scene.name);
                for processor in Processor::all() {
                    tracer.set_processor(Some(processor));
                    assert_eq!(seen(&tracer, filtering), seen_by_one, "{}: {processor:?}", scene.name);
                }
            }
            // The conventional tracer adds up in another order.
            for (&(origin, direction), &radiance) in rays.iter().zip(&alone.0) {
                let (other, _) = reference::radiance(&tracer, &settings, origin, direction);
                let off = (radiance - other).abs().max_element();
                assert!(off <= 1e-4 * other.max_element().max(0.01), "{}: {radiance} {other}", scene.name);
            }
        }
    }
}
