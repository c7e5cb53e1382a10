//! Reflection, refraction and the Fresnel equations.

use glam::Vec3;

use super::{Appearance, Settings, Surface};
use crate::constants::REFLECTION_LIFT;
use crate::scene::{Material, Volume};

/// The unit direction `d` mirrored at the unit normal `n`, lifted above the facet with normal `ng`.
///
/// An interpolated normal can reflect a grazing ray under its own facet; such a direction is raised until
/// it clears the facet by [`REFLECTION_LIFT`] (design §2). `ng` lies on the side of `n`.
pub fn reflect(d: Vec3, n: Vec3, ng: Vec3) -> Vec3 {
    let r = d - n * (2.0 * d.dot(n));
    let above = r.dot(ng);
    if above < REFLECTION_LIFT { (r + ng * (REFLECTION_LIFT - above)).normalize() } else { r }
}

/// What a smooth interface between two dielectrics does with a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dielectric {
    /// Reflected share of unpolarised light, 0 to 1; 1 in total internal reflection.
    pub reflectance: f32,
    /// Unit direction of the transmitted ray; `None` in total internal reflection.
    pub refracted: Option<Vec3>,
}

/// Fresnel's equations and Snell's law for the unit direction `d` at the unit normal `n`, which faces
/// against `d`; `eta` is the index of the side that the ray comes from over that of the other.
pub fn dielectric(d: Vec3, n: Vec3, eta: f32) -> Dielectric {
    let cos_in = (-d.dot(n)).clamp(0.0, 1.0);
    let sin_out_squared = eta * eta * (1.0 - cos_in * cos_in);
    if sin_out_squared >= 1.0 {
        return Dielectric { reflectance: 1.0, refracted: None };
    }
    let cos_out = (1.0 - sin_out_squared).sqrt();
    let s = (eta * cos_in - cos_out) / (eta * cos_in + cos_out);
    let p = (cos_in - eta * cos_out) / (cos_in + eta * cos_out);
    Dielectric {
        reflectance: (0.5 * (s * s + p * p)).clamp(0.0, 1.0),
        refracted: Some((d * eta + n * (eta * cos_in - cos_out)).normalize()),
    }
}

/// Reflectance of a thin wall, both of whose interfaces reflect `interface`: 2F / (1 + F).
pub fn thin_wall_reflectance(interface: f32) -> f32 {
    2.0 * interface / (1.0 + interface)
}

/// Schlick's approximation of the reflectance at the angle of cosine `cos` for `f0` at normal incidence.
pub fn schlick(f0: Vec3, cos: f32) -> Vec3 {
    f0 + (Vec3::ONE - f0) * (1.0 - cos.clamp(0.0, 1.0)).powi(5)
}

/// Reflectance at normal incidence of a dielectric of index `ior` in air.
pub fn normal_reflectance(ior: f32) -> f32 {
    ((ior - 1.0) / (ior + 1.0)).powi(2)
}

/// Which way a specular branch goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BranchKind {
    /// Back to the side that the ray came from.
    Reflect,
    /// Through the surface, bent or, at a thin wall, straight.
    Refract,
}

/// A specular ray that leaves a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Branch {
    /// Reflection or refraction.
    pub kind: BranchKind,
    /// Where it leaves the surface.
    pub start: Vec3,
    /// Origin for tracing: `start` moved off the surface to the side that the ray leaves to.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Share of the radiance along it that goes on towards the viewer.
    pub attenuation: Vec3,
    /// The body that the ray runs through: Beer's law holds over its length.
    pub medium: Option<Volume>,
}

impl Branch {
    /// What the medium lets through on the way to `end`; `None` for a ray that leaves the scene.
    pub fn transmittance(&self, end: Option<Vec3>) -> Vec3 {
        self.medium.map_or(Vec3::ONE, |volume| {
            volume.transmittance(end.map_or(f32::INFINITY, |end| end.distance(self.start)))
        })
    }
}

/// The specular branches at a surface that a ray of unit direction `direction` arrives at: reflection
/// first, then refraction (design §2, "Metals" and "Glass").
///
/// Throughput limits and the depth limit are the caller's. Radiance is not scaled by η², so that a body's
/// refractions in and out cancel and the paper's Eq. 1 holds.
pub fn branches(
    settings: &Settings,
    material: &Material,
    appearance: &Appearance,
    surface: &Surface,
    direction: Vec3,
) -> [Option<Branch>; 2] {
    let base = appearance.base * appearance.base_texel;
    let glass = (1.0 - appearance.metallic) * appearance.transmission;
    let mut reflected = if settings.fresnel {
        let f0 = appearance.specular.lerp(base, appearance.metallic);
        schlick(f0, -direction.dot(surface.n)) * (1.0 - glass)
    } else {
        base * appearance.metallic
    };
    let mut refraction = None;
    if glass > 0.0 {
        let eta = if surface.outside { material.ior.recip() } else { material.ior };
        let (reflectance, through) = match material.volume {
            Some(_) => {
                let interface = dielectric(direction, surface.n, eta);
                (interface.reflectance, interface.refracted)
            }
            None => {
                let interface = dielectric(direction, surface.n, material.ior.recip());
                (thin_wall_reflectance(interface.reflectance), Some(direction))
            }
        };
        reflected += Vec3::splat(glass * reflectance);
        // An interpolated normal that turns away from the ray reflects all of it.
        refraction = through.filter(|_| reflectance < 1.0).map(|through| Branch {
            kind: BranchKind::Refract,
            start: surface.position,
            origin: surface.behind(),
            direction: through,
            attenuation: base * (glass * (1.0 - reflectance)),
            medium: material.volume.filter(|_| surface.outside),
        });
    }
    let reflection = (reflected.max_element() > 0.0).then(|| Branch {
        kind: BranchKind::Reflect,
        start: surface.position,
        origin: surface.front(),
        direction: reflect(direction, surface.n, surface.ng),
        attenuation: reflected,
        medium: material.volume.filter(|_| glass > 0.0 && !surface.outside),
    });
    [reflection, refraction]
}
