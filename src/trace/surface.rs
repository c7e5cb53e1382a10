//! Surfaces: a hit interpreted as a point with normals, coordinates and material values.

use glam::{Mat3, Vec2, Vec3, Vec4};

use super::{Tracer, optics, texel};
use crate::scene::{AlphaMode, Geometry, Material, Scene, TextureSlot};

/// Ray origins leave their face by this many roundings of the largest coordinate around it.
///
/// A point from barycentric weights lies within 3 roundings of its face, a hit within 8 of where the ray
/// was aimed; the rest is margin for a vertex's neighbours.
const OFFSET_ROUNDINGS: f32 = 32.0;

/// A point on a face, as seen by a ray that arrives there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Index into [`Geometry::faces`].
    pub face: u32,
    /// Index into [`Scene::objects`].
    pub object: u32,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Whether the object is a specular VT object.
    pub vt: bool,
    /// Whether the ray arrives from outside, where the shading normals point to.
    pub outside: bool,
    /// The point, on the face's plane to within rounding.
    pub position: Vec3,
    /// Unit geometric normal on the side that the ray arrives from.
    pub ng: Vec3,
    /// Unit shading normal on the side of `ng`, the normal map applied.
    pub n: Vec3,
    /// Both sets of texture coordinates.
    pub uvs: [Vec2; 2],
    /// Linear vertex colour.
    pub color: Vec4,
    /// How far rays start off the face (design §8: no global epsilon).
    pub offset: f32,
}

impl Surface {
    /// The point of `face` with barycentric weights (1 − u − v, u, v), seen along the unit vector
    /// `direction`.
    pub fn new(tracer: &Tracer, face: u32, u: f32, v: f32, direction: Vec3) -> Self {
        let scene = tracer.scene();
        let geometry = &scene.geometry;
        let corners = geometry.faces[face as usize];
        let [a, b, c] = corners.map(|corner| geometry.positions[corner as usize]);
        let [na, nb, nc] = corners.map(|corner| geometry.normals[corner as usize]);
        let w = 1.0 - u - v;
        let object = geometry.face_objects[face as usize];
        let material = scene.objects[object as usize].material;

        let mut ng = (b - a).cross(c - a).normalize();
        let mut n = (na * w + nb * u + nc * v).normalize_or(ng);
        if n.dot(ng) < 0.0 {
            ng = -ng;
        }
        let uvs = [0, 1].map(|set| {
            if geometry.uvs[set].is_empty() {
                return Vec2::ZERO;
            }
            let [a, b, c] = corners.map(|corner| geometry.uvs[set][corner as usize]);
            a * w + b * u + c * v
        });
        let material_of = &scene.materials[material as usize];
        if let (Some(slot), false) = (&material_of.normal_texture, geometry.tangents.is_empty()) {
            let [ta, tb, tc] = corners.map(|corner| geometry.tangents[corner as usize]);
            let uv = uvs[usize::from(slot.uv_set)];
            n = mapped_normal(scene, material_of, slot, uv, n, ta * w + tb * u + tc * v);
        }
        let outside = ng.dot(direction) < 0.0;
        if !outside {
            (ng, n) = (-ng, -n);
        }
        let color = if geometry.colors.is_empty() {
            Vec4::ONE
        } else {
            let [a, b, c] = corners.map(|corner| geometry.colors[corner as usize]);
            a * w + b * u + c * v
        };
        Self {
            face,
            object,
            material,
            vt: scene.objects[object as usize].vt,
            outside,
            position: a * w + b * u + c * v,
            ng,
            n,
            uvs,
            color,
            offset: tracer.offset(face),
        }
    }

    /// Origin of a ray that leaves to the side that `ng` points to.
    pub fn front(&self) -> Vec3 {
        self.position + self.ng * self.offset
    }

    /// Origin of a ray that leaves through the surface.
    pub fn behind(&self) -> Vec3 {
        self.position - self.ng * self.offset
    }
}

/// The shading normal bent by a normal map; `n` where the tangent or the texel is unusable.
fn mapped_normal(
    scene: &Scene,
    material: &Material,
    slot: &TextureSlot,
    uv: Vec2,
    n: Vec3,
    tangent: Vec4,
) -> Vec3 {
    let across = tangent.truncate();
    let Some(t) = (across - n * n.dot(across)).try_normalize() else { return n };
    let b = n.cross(t) * tangent.w.signum();
    let texel = texel::lookup(scene, slot, uv).truncate() * 2.0 - 1.0;
    let scale = Vec3::new(material.normal_scale, material.normal_scale, 1.0);
    (Mat3::from_cols(t, b, n) * (texel * scale)).normalize_or(n)
}

/// Distance by which rays start off each face, from the largest coordinate and edge of its one-ring:
/// a vertex lies on all its faces, so that the largest of them decides.
pub(super) fn offsets(geometry: &Geometry) -> Vec<f32> {
    let mut around = vec![0.0_f32; geometry.positions.len()];
    let reach = |face: &[u32; 3]| {
        face.iter().map(|&v| geometry.positions[v as usize].abs().max_element()).fold(0.0, f32::max)
    };
    for face in &geometry.faces {
        let reach = reach(face);
        for &vertex in face {
            around[vertex as usize] = around[vertex as usize].max(reach);
        }
    }
    let largest = |face: &[u32; 3]| face.iter().map(|&v| around[v as usize]).fold(0.0, f32::max);
    geometry.faces.iter().map(|face| largest(face) * (OFFSET_ROUNDINGS * f32::EPSILON * 0.5)).collect()
}

/// Material values at a point, textures looked up; the base colour texture is kept apart, since the
/// reconstruction looks it up again for every pixel (Eq. 3).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Appearance {
    /// Base colour factor × vertex colour, linear.
    pub base: Vec3,
    /// Linear texel of the base colour texture; 1 without one.
    pub base_texel: Vec3,
    /// Opacity: factor × texel × vertex colour, 0 to 1.
    pub alpha: f32,
    /// 0 to 1.
    pub metallic: f32,
    /// 0 to 1.
    pub roughness: f32,
    /// 0 to 1.
    pub transmission: f32,
    /// Reflectance of the dielectric part at normal incidence (KHR_materials_specular).
    pub specular: Vec3,
    /// Emitted radiance, linear.
    pub emission: Vec3,
}

impl Appearance {
    /// The values of the surface's material at the surface.
    pub fn new(scene: &Scene, surface: &Surface) -> Self {
        let material = &scene.materials[surface.material as usize];
        let texel = |slot: &Option<TextureSlot>| match slot {
            Some(slot) => texel::lookup(scene, slot, surface.uvs[usize::from(slot.uv_set)]),
            None => Vec4::ONE,
        };
        let base_texel = texel(&material.base_color_texture);
        let metallic_roughness = texel(&material.metallic_roughness_texture);
        let specular = material.specular * texel(&material.specular_texture).w;
        let specular_color = material.specular_color * texel(&material.specular_color_texture).truncate();
        Self {
            base: (material.base_color * surface.color).truncate(),
            base_texel: base_texel.truncate(),
            alpha: material.base_color.w * surface.color.w * base_texel.w,
            metallic: material.metallic * metallic_roughness.z,
            roughness: material.roughness * metallic_roughness.y,
            transmission: material.transmission * texel(&material.transmission_texture).x,
            specular: specular_color * (specular * optics::normal_reflectance(material.ior)),
            emission: material.emissive * texel(&material.emissive_texture).truncate(),
        }
    }
}

/// Share of a camera ray that a surface stops, 0 to 1; the rest goes on straight behind it. All other
/// rays stop at every surface (design §2, "Occlusion").
pub fn coverage(material: &Material, appearance: &Appearance) -> f32 {
    match material.alpha_mode {
        AlphaMode::Blend => appearance.alpha.clamp(0.0, 1.0),
        AlphaMode::Opaque | AlphaMode::Mask(_) => 1.0,
    }
}
