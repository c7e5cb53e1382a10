//! The local component of Eq. 1: emission, ambient, diffuse and highlight under hard shadows.

use std::f32::consts::{FRAC_1_PI, TAU};

use glam::Vec3;

use super::{Appearance, Rays, Surface, Tracer, texel};
use crate::constants::MAX_PHONG_EXPONENT;
use crate::scene::{Background, Scene};

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
    if diffuse_share(appearance) <= 0.0 && phong_exponent(appearance.roughness).is_none() {
        return ALL_LIT;
    }
    let origin = surface.front();
    let mut lit = ALL_LIT;
    for (index, light) in tracer.scene().lights.iter().take(MASK_LIGHTS).enumerate() {
        let incident = light.incident(origin);
        if incident.to_light.dot(surface.n) <= 0.0 || incident.irradiance.max_element() <= 0.0 {
            continue;
        }
        rays.shadow += 1;
        if tracer.occluded(origin, incident.to_light, incident.distance) {
            lit &= !(1 << index);
        }
    }
    lit
}

/// The local component at `surface` for a viewer that looks along the unit vector `direction`, under the
/// lights in the mask `lit` (design §2, "Local component").
pub fn local(scene: &Scene, surface: &Surface, appearance: &Appearance, direction: Vec3, lit: u32) -> Local {
    if scene.materials[surface.material as usize].unlit {
        return Local { textured: appearance.base, added: Vec3::ZERO };
    }
    let diffuse = diffuse_share(appearance);
    let exponent = phong_exponent(appearance.roughness);
    let mut local =
        Local { textured: appearance.base * (diffuse * scene.ambient), added: appearance.emission };
    if diffuse <= 0.0 && exponent.is_none() {
        return local;
    }
    let metal = appearance.base * appearance.metallic;
    let dielectric = appearance.specular * (1.0 - appearance.metallic);
    for (index, light) in scene.lights.iter().enumerate() {
        if index < MASK_LIGHTS && lit >> index & 1 == 0 {
            continue;
        }
        let incident = light.incident(surface.position);
        let cos = incident.to_light.dot(surface.n);
        if cos <= 0.0 {
            continue;
        }
        let irradiance = incident.irradiance * cos;
        local.textured += irradiance * appearance.base * (diffuse * FRAC_1_PI);
        if let Some(exponent) = exponent {
            let mirrored = surface.n * (2.0 * cos) - incident.to_light;
            let lobe = phong_lobe(exponent, -mirrored.dot(direction));
            local.textured += irradiance * metal * lobe;
            local.added += irradiance * dielectric * lobe;
        }
    }
    local
}

/// Radiance of a ray of unit direction `direction` that leaves the scene.
pub fn background(scene: &Scene, direction: Vec3) -> Vec3 {
    match &scene.background {
        Background::Color(radiance) => *radiance,
        Background::Environment(panorama) => texel::environment(panorama, direction),
    }
}

/// Share of the base colour that scatters diffusely.
fn diffuse_share(appearance: &Appearance) -> f32 {
    (1.0 - appearance.metallic) * (1.0 - appearance.transmission)
}

/// Phong exponent of a roughness: 2 / roughness⁴ − 2; `None` at roughness 0, which shows no highlight of
/// a light without extent.
fn phong_exponent(roughness: f32) -> Option<f32> {
    let exponent = (2.0 / roughness.powi(4) - 2.0).clamp(0.0, MAX_PHONG_EXPONENT);
    (roughness > 0.0).then_some(exponent)
}

/// The normalised Phong lobe: its integral with the cosine is 1 at normal incidence.
fn phong_lobe(exponent: f32, cos: f32) -> f32 {
    (exponent + 2.0) / TAU * cos.max(0.0).powf(exponent)
}
