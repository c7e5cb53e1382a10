//! Shafts: where the shadow rays of neighbouring points have to look on their way to each light.

use glam::Vec3;

use super::{
    Hit, Settings, Tracer,
    bvh::{EntryPoints, Packet},
    shade::MASK_LIGHTS,
};

/// The entry points of shadow rays, by light.
#[derive(Default)]
pub(super) struct Shafts(Vec<EntryPoints>);

impl Shafts {
    /// Makes them those of the shadow rays from what rays of the given directions hit, after `bounces` specular bounces.
    pub fn find<'h>(
        &mut self,
        tracer: &Tracer,
        settings: &Settings,
        bounces: u32,
        hits: impl Iterator<Item = (&'h Vec3, &'h Hit)>,
    ) {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let mut count = 0;
        for (direction, hit) in hits {
            let record = tracer.record(hit.face);
            if record.scatters && settings.shadows.apply(record.vt, bounces) {
                let origin = record.front(hit.u, hit.v, *direction);
                (low, high) = (low.min(origin), high.max(origin));
                count += 1;
            }
        }
        let lights = &tracer.scene().lights;
        self.0.resize_with(lights.len().min(MASK_LIGHTS), EntryPoints::default);
        for (light, entries) in lights.iter().zip(&mut self.0) {
            let (directions, distance) = light.directions([low, high]);
            let packet = Packet { origins: [low, high], directions, end: distance, rays: count };
            tracer.find_entries(&packet, entries);
        }
    }

    /// Where rays to the light look; nothing for lights beyond those that throw shadows.
    pub fn to(&self, light: usize) -> Option<&EntryPoints> {
        self.0.get(light)
    }
}
