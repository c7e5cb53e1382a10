//! The local component of Eq. 1: emission, ambient, diffuse and highlight under hard shadows.

use std::f32::consts::{FRAC_1_PI, TAU};

use glam::Vec3;

use super::{Appearance, Rays, Surface, Tracer, packet::EntryPoints, shaft::Shafts, texel};
use crate::constants::MAX_PHONG_EXPONENT;
use crate::scene::{Background, Scene, light::Incident};

/// Lights whose visibility fits a mask; later lights shine through everything.
pub const MASK_LIGHTS: usize = u32::BITS as usize;

/// The mask of a surface that sees all lights.
pub const ALL_LIT: u32 = u32::MAX;

/// Radiance of a surface without its mirror images, the base colour texture kept apart (Eq. 3).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Local {
    /// Multiplied by the base colour texel.
    pub textured: Vec3,
    /// Added.
    pub added: Vec3,
}

impl Local {
    /// Radiance with the base colour texel `texel`.
    pub fn radiance(&self, texel: Vec3) -> Vec3 {
        self.textured * texel + self.added
    }
}

/// Which lights are not hidden from `surface`: bit i stands for light i.
///
/// A light is asked only where its answer shows. Below the horizon, out of its cone or range, and on a
/// surface that neither diffuses nor highlights, its bit is 1: there the cosine or the falloff already
/// fades it out without a step, and a 0 would only look like a shadow's edge to the refinement.
pub fn visible_lights(tracer: &Tracer, surface: &Surface, appearance: &Appearance, rays: &mut Rays) -> u32 {
    let mut lit = ALL_LIT;
    if Lobes::of(appearance).is_none() {
        return lit;
    }
    for (index, light) in tracer.scene().lights.iter().take(MASK_LIGHTS).enumerate() {
        let incident = light.incident(surface.position);
        if faces(surface, &incident) && hidden(tracer, None, surface, &incident, rays) {
            lit &= !(1 << index);
        }
    }
    lit
}

/// The local component at `surface` for a viewer that looks along the unit vector `direction`, under the
/// lights in the mask `lit` (design §2, "Local component").
pub fn local(scene: &Scene, surface: &Surface, appearance: &Appearance, direction: Vec3, lit: u32) -> Local {
    let is_lit = |index: usize, _: &Incident| index >= MASK_LIGHTS || lit >> index & 1 == 1;
    local_where(scene, surface, appearance, direction, is_lit)
}

/// [`local`] under the lights that [`visible_lights`] would tell, asked on the way; among `shafts` that were found for
/// this surface and others, or in the whole scene.
#[inline]
pub(super) fn local_shadowed(
    tracer: &Tracer,
    shafts: Option<&Shafts>,
    surface: &Surface,
    appearance: &Appearance,
    direction: Vec3,
    rays: &mut Rays,
) -> Local {
    let is_lit = |index: usize, incident: &Incident| {
        let entries = shafts.and_then(|shafts| shafts.to(index));
        index >= MASK_LIGHTS || !hidden(tracer, entries, surface, incident, rays)
    };
    local_where(tracer.scene(), surface, appearance, direction, is_lit)
}

#[inline(always)]
fn local_where(
    scene: &Scene,
    surface: &Surface,
    appearance: &Appearance,
    direction: Vec3,
    mut is_lit: impl FnMut(usize, &Incident) -> bool,
) -> Local {
    if scene.materials[surface.material as usize].unlit {
        return Local { textured: appearance.base, added: Vec3::ZERO };
    }
    // Of a specular object its reflections take the place of ambient light; a rough metal has nothing else.
    let scattering =
        if surface.vt { (1.0 - appearance.metallic) * (1.0 - appearance.transmission) } else { 1.0 };
    let ambient = appearance.base * (scattering * scene.ambient);
    let mut local = Local { textured: ambient, added: appearance.emission };
    let Some(lobes) = Lobes::of(appearance) else { return local };
    for (index, light) in scene.lights.iter().enumerate() {
        let incident = light.incident(surface.position);
        if !faces(surface, &incident) || !is_lit(index, &incident) {
            continue;
        }
        let cos = incident.to_light.dot(surface.n);
        let irradiance = incident.irradiance * cos;
        local.textured += irradiance * lobes.diffuse * FRAC_1_PI;
        if let Some(exponent) = lobes.exponent {
            let mirrored = surface.n * (2.0 * cos) - incident.to_light;
            let lobe = phong_lobe(exponent, -mirrored.dot(direction));
            local.textured += irradiance * lobes.metal * lobe;
            local.added += irradiance * lobes.dielectric * lobe;
        }
    }
    local
}

/// Whether light arrives at the side of the surface that is seen.
#[inline]
fn faces(surface: &Surface, incident: &Incident) -> bool {
    incident.to_light.dot(surface.n) > 0.0 && incident.irradiance.max_element() > 0.0
}

#[inline]
fn hidden(
    tracer: &Tracer,
    entries: Option<&EntryPoints>,
    surface: &Surface,
    incident: &Incident,
    rays: &mut Rays,
) -> bool {
    rays.shadow += 1;
    match entries {
        Some(entries) => {
            tracer.occluded_among(entries, surface.front(), incident.to_light, incident.distance)
        }
        None => tracer.occluded(surface.front(), incident.to_light, incident.distance),
    }
}

/// Radiance of a ray of unit direction `direction` that leaves the scene.
pub fn background(scene: &Scene, direction: Vec3) -> Vec3 {
    match &scene.background {
        Background::Color(radiance) => *radiance,
        Background::Environment(panorama) => texel::environment(panorama, direction),
    }
}

/// How a surface scatters light, without the base colour texture.
struct Lobes {
    /// Diffuse albedo.
    diffuse: Vec3,
    /// k_s of the metal, which takes the base colour's texture.
    metal: Vec3,
    /// k_s of the dielectric.
    dielectric: Vec3,
    /// Phong exponent; `None` without a highlight.
    exponent: Option<f32>,
}

impl Lobes {
    /// `None` for a surface that does not scatter at all.
    #[inline]
    fn of(appearance: &Appearance) -> Option<Self> {
        let diffuse = (1.0 - appearance.metallic) * (1.0 - appearance.transmission);
        let metal = appearance.base * appearance.metallic;
        let dielectric = appearance.specular * (1.0 - appearance.metallic);
        // Roughness 0 shows no highlight of a light without extent.
        let highlights = appearance.roughness > 0.0 && (metal + dielectric).max_element() > 0.0;
        (diffuse > 0.0 || highlights).then(|| Self {
            diffuse: appearance.base * diffuse,
            metal,
            dielectric,
            exponent: highlights.then(|| phong_exponent(appearance.roughness)),
        })
    }
}

/// 2 / roughness⁴ − 2, within what f32 can hold.
fn phong_exponent(roughness: f32) -> f32 {
    (2.0 / roughness.powi(4) - 2.0).clamp(0.0, MAX_PHONG_EXPONENT)
}

/// The normalised Phong lobe: its integral with the cosine is 1 at normal incidence.
fn phong_lobe(exponent: f32, cos: f32) -> f32 {
    (exponent + 2.0) / TAU * cos.max(0.0).powf(exponent)
}
