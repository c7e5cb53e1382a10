//! Radiance of neighbouring points, traced bounce by bounce: rays that have taken the same branches are searched for as
//! one packet, their shadow rays as one for each light.

use glam::Vec3;

use super::optics::{self, Branch, BranchKind};
use super::packet::{EntryPoints, Packet};
use super::shaft::Shafts;
use super::{Appearance, Hit, Rays, Settings, Surface, Tracer, shade};

/// Points of faces that neighbouring view rays meet.
pub struct Points<'t, 's> {
    tracer: &'t Tracer<'s>,
    settings: &'t Settings,
    /// Direction of each ray of the wave at hand, and what it meets.
    hits: Vec<(Vec3, Option<Hit>)>,
    radiances: Vec<Vec3>,
    entries: EntryPoints,
    shafts: Shafts,
    /// Room for waves to come.
    free: Vec<Vec<Ray>>,
    /// Rays of the wave at hand, origins and directions, and what they meet.
    search: (Vec<(Vec3, Vec3)>, Vec<Option<Hit>>),
    rays: Rays,
}

/// A specular ray of the next bounce.
struct Ray {
    /// The point whose radiance it is part of.
    point: u32,
    branch: Branch,
    /// Share of the radiance along it that reaches the eye.
    throughput: Vec3,
}

impl<'t, 's> Points<'t, 's> {
    /// No point yet.
    pub fn new(tracer: &'t Tracer<'s>, settings: &'t Settings) -> Self {
        Self {
            tracer,
            settings,
            hits: Vec::new(),
            radiances: Vec::new(),
            entries: EntryPoints::default(),
            shafts: Shafts::default(),
            free: Vec::new(),
            search: Default::default(),
            rays: Rays::default(),
        }
    }

    /// Takes in the point that a view ray along the unit vector `direction` meets.
    pub fn add(&mut self, direction: Vec3, hit: Hit) {
        self.hits.push((direction, Some(hit)));
    }

    /// Radiance that leaves each of the points against its view ray, in their order; then there is none any more. BLEND
    /// surfaces count as opaque.
    pub fn radiances(&mut self) -> impl Iterator<Item = Vec3> {
        self.radiances.clear();
        self.radiances.resize(self.hits.len(), Vec3::ZERO);
        self.shafts.find(self.tracer, self.settings, 0, self.hits.iter());
        let mut next = [self.room(), self.room()];
        for point in 0..self.hits.len() {
            let (direction, Some(hit)) = self.hits[point] else { continue };
            let at = Surface::new(self.tracer, hit.face, hit.u, hit.v, direction);
            self.arrive(point as u32, &at, direction, Vec3::ONE, 0, &mut next);
        }
        self.go_on(next, 1);
        self.hits.clear();
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

    /// Follows two waves that left after `bounces` − 1 bounces: what was reflected, and what was refracted.
    fn go_on(&mut self, waves: [Vec<Ray>; 2], bounces: u32) {
        for mut wave in waves {
            if !wave.is_empty() {
                self.trace(&wave, bounces);
                wave.clear();
            }
            self.free.push(wave);
        }
    }

    /// Follows rays of `bounces` bounces, all of one history.
    fn trace(&mut self, wave: &[Ray], bounces: u32) {
        let Self { tracer, settings, .. } = *self;
        let scene = tracer.scene();
        let mut packet = Packet::EMPTY;
        for Ray { branch, .. } in wave {
            packet.add(branch.origin, branch.direction);
        }
        tracer.find_entries(&packet, &mut self.entries);
        self.hits.clear();
        let (rays, found) = &mut self.search;
        rays.clear();
        rays.extend(wave.iter().map(|ray| (ray.branch.origin, ray.branch.direction)));
        tracer.closest_of_each(&self.entries, rays, found);
        for (Ray { point, branch, throughput }, &hit) in wave.iter().zip(&*found) {
            if hit.is_none() {
                let seen = shade::background(scene, branch.direction) * branch.transmittance(None);
                self.radiances[*point as usize] += seen * throughput;
            }
            self.hits.push((branch.direction, hit));
        }
        match wave[0].branch.kind {
            BranchKind::Reflect => self.rays.reflected += wave.len() as u64,
            BranchKind::Refract => self.rays.transmitted += wave.len() as u64,
        }
        self.shafts.find(tracer, settings, bounces, self.hits.iter());
        let mut next = [self.room(), self.room()];
        for (index, Ray { point, branch, throughput }) in wave.iter().enumerate() {
            let (direction, Some(hit)) = self.hits[index] else { continue };
            let at = Surface::new(tracer, hit.face, hit.u, hit.v, direction);
            let throughput = throughput * branch.transmittance(Some(at.position));
            self.arrive(*point, &at, direction, throughput, bounces, &mut next);
        }
        self.go_on(next, bounces + 1);
    }

    /// Adds what a ray sees where it arrives, and the rays that leave from there to those of the `next` bounce.
    fn arrive(
        &mut self,
        point: u32,
        at: &Surface,
        direction: Vec3,
        throughput: Vec3,
        bounces: u32,
        next: &mut [Vec<Ray>; 2],
    ) {
        let Self { tracer, settings, .. } = *self;
        let scene = tracer.scene();
        let appearance = Appearance::new(scene, at);
        let local = if settings.shadows.apply(at.vt, bounces) {
            shade::local_shadowed(tracer, Some(&self.shafts), at, &appearance, direction, &mut self.rays)
        } else {
            shade::local(scene, at, &appearance, direction, shade::ALL_LIT)
        };
        self.radiances[point as usize] += local.radiance(appearance.base_texel) * throughput;
        if !at.vt || bounces >= settings.depth {
            return;
        }
        let material = &scene.materials[at.material as usize];
        for branch in optics::branches(settings, material, &appearance, at, direction).into_iter().flatten() {
            let throughput = throughput * branch.attenuation;
            if throughput.max_element() >= settings.min_throughput {
                next[usize::from(branch.kind == BranchKind::Refract)].push(Ray { point, branch, throughput });
            }
        }
    }
}
