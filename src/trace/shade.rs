//! The local component of Eq. 1: emission, ambient, diffuse and highlight under hard shadows.

use std::f32::consts::{FRAC_1_PI, TAU};
use std::ops::Sub;

use glam::Vec3;

use super::light::Incident;
use super::real::{Choice, Real, Triple};
use super::shaft::Shafts;
use super::{Appearance, Rays, Shadows, Surface, Tracer, texel};
use crate::constants::MAX_PHONG_EXPONENT;
use crate::scene::{Background, Scene, View, mesh::unit};

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

impl Sub for Local {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self { textured: self.textured - other.textured, added: self.added - other.added }
    }
}

impl Local {
    /// Radiance with the base colour texel `texel`.
    pub fn radiance(&self, texel: Vec3) -> Vec3 {
        self.textured * texel + self.added
    }
}

/// Which lights are not hidden from `surface`: bit i stands for light i.
///
/// A light is asked only where its answer shows. Below the horizon, unless a normal map may bend that, and on a surface that
/// neither diffuses nor highlights, its bit is 1: there the cosine already fades it out without a step, and a 0 would only
/// look like a shadow's edge to the refinement. Out of its cone or range it is asked: between there and a shadow within light would seem to shine.
pub fn visible_lights(tracer: &Tracer, surface: &Surface, appearance: &Appearance, rays: &mut Rays) -> u32 {
    let mut lit = ALL_LIT;
    if Lobes::of(appearance).is_none() {
        return lit;
    }
    let is_mapped = tracer.scene().materials[surface.material as usize].normal_texture.is_some();
    let mut asked = Asked { tracer, shafts: None, origin: surface.front(), rays };
    for (index, light) in tracer.scene().lights.iter().take(MASK_LIGHTS).enumerate() {
        let incident = light.incident(surface.position.into());
        if (is_mapped || incident.is_above(surface.n.into())) && !asked.lit(index, &incident, true) {
            lit &= !(1 << index);
        }
    }
    lit
}

/// Sine of the angle between a face and light up to which its shadow on itself is a matter of rounding.
const GRAZING: f32 = 1e-3;

/// Lights that `face` itself hides from the side of it that `view` shows, for they stand behind its plane, wherever the normals
/// of its vertices and its normal map point to: bit i stands for light i. None where `shadows` leave its own out.
pub fn lights_behind(scene: &Scene, shadows: Shadows, view: &View, face: u32) -> u32 {
    if !shadows.apply(scene.is_vt(face), 0) {
        return 0;
    }
    let corner = scene.geometry.corners(face)[0];
    let Some(normal) = unit(scene.geometry.area_normal(face)) else { return 0 };
    let side = -normal * normal.dot(view.direction_to(corner)).signum();
    let lights = scene.lights.iter().take(MASK_LIGHTS).enumerate();
    lights.fold(0, |behind, (index, light)| {
        let to_light = Vec3::from(light.incident(corner.into()).to_light);
        behind | u32::from(to_light.dot(side) < -GRAZING) << index
    })
}

/// The local component at `surface` for a viewer that looks along the unit vector `direction`, under the
/// lights in the mask `lit` (design §2, "Local component").
pub fn local(scene: &Scene, surface: &Surface, appearance: &Appearance, direction: Vec3, lit: u32) -> Local {
    local_at(scene, surface, appearance, direction, &mut { lit })
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
    let mut asked = Asked { tracer, shafts, origin: surface.front(), rays };
    local_at(tracer.scene(), surface, appearance, direction, &mut asked)
}

#[inline(always)]
fn local_at(
    scene: &Scene,
    surface: &Surface,
    appearance: &Appearance,
    direction: Vec3,
    lights: &mut impl Lights<f32>,
) -> Local {
    let unlit = scene.materials[surface.material as usize].unlit;
    let finish = Scattering::new(scene, appearance, surface.vt, unlit);
    let [textured, added] =
        finish.local(scene, surface.position.into(), surface.n.into(), direction.into(), lights);
    Local { textured: textured.into(), added: added.into() }
}

/// Tells which lights are seen.
pub(super) trait Lights<R: Real> {
    /// Where the light of this index is seen, among places that face it.
    fn lit(&mut self, index: usize, incident: &Incident<R>, facing: R::Choice) -> R::Choice;
}

/// A mask: bit i stands for light i.
impl Lights<f32> for u32 {
    #[inline(always)]
    fn lit(&mut self, index: usize, _: &Incident<f32>, _: bool) -> bool {
        index >= MASK_LIGHTS || *self >> index & 1 == 1
    }
}

/// Shadow rays from one place.
struct Asked<'a> {
    tracer: &'a Tracer<'a>,
    shafts: Option<&'a Shafts>,
    origin: Vec3,
    rays: &'a mut Rays,
}

impl Lights<f32> for Asked<'_> {
    #[inline(always)]
    fn lit(&mut self, index: usize, incident: &Incident<f32>, _: bool) -> bool {
        if index >= MASK_LIGHTS {
            return true;
        }
        self.rays.shadow += 1;
        let (to_light, distance) = (incident.to_light.into(), incident.distance);
        !match self.shafts.and_then(|shafts| shafts.to(index)) {
            Some(entries) => self.tracer.occluded_among(entries, self.origin, to_light, distance),
            None => self.tracer.occluded(self.origin, to_light, distance),
        }
    }
}

impl<R: Real> Incident<R> {
    /// Whether it arrives at the side that the unit normal `n` points to.
    #[inline(always)]
    pub(super) fn faces(&self, n: Triple<R>) -> R::Choice {
        self.is_above(n) & n.x.all(0.0).lt(self.irradiance.greatest())
    }

    /// Whether the light stands above the surface of unit normal `n`, in reach or not.
    #[inline(always)]
    fn is_above(&self, n: Triple<R>) -> R::Choice {
        n.x.all(0.0).lt(self.to_light.dot(n))
    }
}

/// What the local component of Eq. 1 is made of, but for place, light and the base colour's texture.
pub(super) struct Scattering {
    ambient: Vec3,
    emission: Vec3,
    lobes: Option<Lobes>,
}

impl Scattering {
    /// Of a material, which may be `unlit`, on an object that may be VT.
    #[inline(always)]
    pub fn new(scene: &Scene, appearance: &Appearance, vt: bool, unlit: bool) -> Self {
        if unlit {
            return Self { ambient: appearance.base, emission: Vec3::ZERO, lobes: None };
        }
        // Of a specular object its reflections take the place of ambient light; a rough metal has nothing else.
        let scattering = if vt { (1.0 - appearance.metallic) * (1.0 - appearance.transmission) } else { 1.0 };
        Self {
            ambient: appearance.base * (scattering * scene.ambient),
            emission: appearance.emission,
            lobes: Lobes::of(appearance),
        }
    }

    /// As [`Local`] has it: what the base colour's texel multiplies, and what is added; at points with unit normals `n`,
    /// for viewers that look along the unit vectors `direction`.
    #[inline(always)]
    pub fn local<R: Real>(
        &self,
        scene: &Scene,
        position: Triple<R>,
        n: Triple<R>,
        direction: Triple<R>,
        lights: &mut impl Lights<R>,
    ) -> [Triple<R>; 2] {
        let number = position.x;
        let mut textured = Triple::all(number, self.ambient);
        let mut added = Triple::all(number, self.emission);
        let Some(lobes) = &self.lobes else { return [textured, added] };
        for (index, light) in scene.lights.iter().enumerate() {
            let incident = light.incident(position);
            let facing = incident.faces(n);
            if !facing.any() {
                continue;
            }
            let lit = lights.lit(index, &incident, facing) & facing;
            if !lit.any() {
                continue;
            }
            let cos = incident.to_light.dot(n);
            let irradiance = (incident.irradiance * cos).where_else(lit, Triple::all(number, Vec3::ZERO));
            textured =
                textured + irradiance.times(Triple::all(number, lobes.diffuse)) * number.all(FRAC_1_PI);
            if let Some(exponent) = lobes.exponent {
                let mirrored = n * (number.all(2.0) * cos) - incident.to_light;
                let lobe = phong_lobe(exponent, -mirrored.dot(direction));
                textured = textured + irradiance.times(Triple::all(number, lobes.metal)) * lobe;
                added = added + irradiance.times(Triple::all(number, lobes.dielectric)) * lobe;
            }
        }
        [textured, added]
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
#[inline(always)]
fn phong_lobe<R: Real>(exponent: f32, cos: R) -> R {
    cos.all((exponent + 2.0) / TAU) * cos.power(exponent)
}
