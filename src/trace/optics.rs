//! Reflection, refraction and the Fresnel equations.

use glam::Vec3;

use super::real::{Choice, Real, Triple};
use super::{Appearance, Settings, Surface};
use crate::constants::REFLECTION_LIFT;
use crate::scene::{Material, Volume};

/// The unit direction `d` mirrored at the unit normal `n`, lifted above the facet with normal `ng`.
///
/// An interpolated normal can reflect a grazing ray under its own facet; such a direction is raised until
/// it clears the facet by [`REFLECTION_LIFT`] (design §2). `ng` lies on the side of `n`.
pub fn reflect(d: Vec3, n: Vec3, ng: Vec3) -> Vec3 {
    mirror(Triple::from(d), n.into(), ng.into()).into()
}

#[inline(always)]
fn mirror<R: Real>(d: Triple<R>, n: Triple<R>, ng: Triple<R>) -> Triple<R> {
    let r = d - n * (d.x.all(2.0) * d.dot(n));
    let (above, lift) = (r.dot(ng), d.x.all(REFLECTION_LIFT));
    let low = above.lt(lift);
    if low.any() { (r + ng * (lift - above)).unit().where_else(low, r) } else { r }
}

/// What a smooth interface between two dielectrics does with a ray.
struct Dielectric<R: Real> {
    /// Reflected share of unpolarised light, 0 to 1; 1 in total internal reflection.
    reflectance: R,
    /// Unit direction of the transmitted ray; meaningless in total internal reflection.
    refracted: Triple<R>,
}

/// Fresnel's equations and Snell's law for the unit direction `d` at the unit normal `n`, which faces
/// against `d`; `eta` is the index of the side that the ray comes from over that of the other.
#[inline(always)]
fn dielectric<R: Real>(d: Triple<R>, n: Triple<R>, eta: R) -> Dielectric<R> {
    let (zero, one) = (eta.all(0.0), eta.all(1.0));
    let cos_in = (-d.dot(n)).max(zero).min(one);
    let sin_out_squared = eta * eta * (one - cos_in * cos_in);
    let passes = sin_out_squared.lt(one);
    let cos_out = (one - sin_out_squared).max(zero).sqrt();
    let s = (eta * cos_in - cos_out) / (eta * cos_in + cos_out);
    let p = (cos_in - eta * cos_out) / (cos_in + eta * cos_out);
    let reflectance = (eta.all(0.5) * (s * s + p * p)).max(zero).min(one);
    Dielectric {
        reflectance: passes.select(reflectance, one),
        refracted: (d * eta + n * (eta * cos_in - cos_out)).unit(),
    }
}

/// Reflectance of a thin wall, both of whose interfaces reflect `interface`: 2F / (1 + F).
#[inline(always)]
fn thin_wall_reflectance<R: Real>(interface: R) -> R {
    interface.all(2.0) * interface / (interface.all(1.0) + interface)
}

/// Schlick's approximation of the reflectance at the angle of cosine `cos` for `f0` at normal incidence.
#[inline(always)]
fn schlick<R: Real>(f0: Triple<R>, cos: R) -> Triple<R> {
    let (zero, one) = (cos.all(0.0), cos.all(1.0));
    let grazing = one - cos.max(zero).min(one);
    let squared = grazing * grazing;
    f0 + (Triple::all(cos, Vec3::ONE) - f0) * (squared * squared * grazing)
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

impl BranchKind {
    /// Its place in pairs of reflected and transmitted values.
    pub fn index(self) -> usize {
        match self {
            Self::Reflect => 0,
            Self::Refract => 1,
        }
    }
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
        transmittance(self.medium, self.start, end)
    }
}

/// What the body `medium` lets through from `start` to `end`; `None` for a ray that leaves the scene.
#[inline]
pub(super) fn transmittance(medium: Option<Volume>, start: Vec3, end: Option<Vec3>) -> Vec3 {
    medium.map_or(Vec3::ONE, |volume| {
        volume.transmittance(end.map_or(f32::INFINITY, |end| end.distance(start)))
    })
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
    let at = At {
        n: surface.n.into(),
        ng: surface.ng.into(),
        outside: surface.outside,
        base: (appearance.base * appearance.base_texel).into(),
    };
    let [reflected, refracted] = leave(settings, material, appearance, &at, direction.into());
    let outward = |leaving: Leaving<f32>| Branch {
        kind: BranchKind::Reflect,
        start: surface.position,
        origin: surface.front(),
        direction: leaving.direction.into(),
        attenuation: leaving.attenuation.into(),
        medium: material.volume.filter(|_| glass(appearance) > 0.0 && !surface.outside),
    };
    let through = |leaving: Leaving<f32>| Branch {
        kind: BranchKind::Refract,
        start: surface.position,
        origin: surface.behind(),
        direction: leaving.direction.into(),
        attenuation: leaving.attenuation.into(),
        medium: material.volume.filter(|_| surface.outside),
    };
    [reflected.filter(|ray| ray.any).map(outward), refracted.filter(|ray| ray.any).map(through)]
}

/// Share of light that is transmitted or reflected by a dielectric's interface, 0 to 1.
pub(super) fn glass(appearance: &Appearance) -> f32 {
    (1.0 - appearance.metallic) * appearance.transmission
}

/// What a specular surface is at a point, or one a lane.
pub(super) struct At<R: Real> {
    /// Unit shading normal, against the ray that arrives.
    pub n: Triple<R>,
    /// Unit geometric normal on that side.
    pub ng: Triple<R>,
    /// Whether the ray arrives from outside.
    pub outside: R::Choice,
    /// Base colour, textured.
    pub base: Triple<R>,
}

/// A ray that leaves, or one a lane.
pub(super) struct Leaving<R: Real> {
    /// Where there is one.
    pub any: R::Choice,
    /// Unit direction.
    pub direction: Triple<R>,
    /// As [`Branch::attenuation`].
    pub attenuation: Triple<R>,
}

/// What [`branches`] are made of: reflected rays and refracted ones. Of the `appearance`, its base colour is not looked at.
#[inline(always)]
pub(super) fn leave<R: Real>(
    settings: &Settings,
    material: &Material,
    appearance: &Appearance,
    at: &At<R>,
    direction: Triple<R>,
) -> [Option<Leaving<R>>; 2] {
    let number = direction.x;
    let glass = glass(appearance);
    let mut reflected = if settings.fresnel {
        let (specular, metallic) =
            (Triple::all(number, appearance.specular), number.all(appearance.metallic));
        let f0 = specular * (number.all(1.0) - metallic) + at.base * metallic;
        schlick(f0, -direction.dot(at.n)) * number.all(1.0 - glass)
    } else {
        at.base * number.all(appearance.metallic)
    };
    let mut refraction = None;
    if glass > 0.0 {
        let (into, out) = (number.all(material.ior.recip()), number.all(material.ior));
        let (reflectance, through) = match material.volume {
            Some(_) => {
                let interface = dielectric(direction, at.n, at.outside.select(into, out));
                (interface.reflectance, interface.refracted)
            }
            None => {
                let interface = dielectric(direction, at.n, into);
                (thin_wall_reflectance(interface.reflectance), direction)
            }
        };
        let share = number.all(glass) * reflectance;
        reflected = reflected + Triple { x: share, y: share, z: share };
        // An interpolated normal that turns away from the ray reflects all of it.
        refraction = Some(Leaving {
            any: reflectance.lt(number.all(1.0)),
            direction: through,
            attenuation: at.base * (number.all(glass) * (number.all(1.0) - reflectance)),
        });
    }
    let any = number.all(0.0).lt(reflected.greatest());
    let reflection =
        any.any().then(|| Leaving { any, direction: mirror(direction, at.n, at.ng), attenuation: reflected });
    [reflection, refraction]
}
