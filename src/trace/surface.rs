//! Surfaces: a hit interpreted as a point with normals, coordinates and material values.

use std::ops::{Add, Mul};

use glam::{Mat3, Vec2, Vec3, Vec4};

use super::cone::Footprint;
use super::texel::Texels;
use super::{Tracer, optics};
use crate::scene::{AlphaMode, Material, Scene, TextureSlot, mesh::unit};

/// Ray origins leave their face by this many roundings of the largest coordinate around it.
///
/// A point from barycentric weights lies within 3 roundings of its face, a hit within 8 of where the ray
/// was aimed; the rest is margin for a vertex's neighbours.
const OFFSET_ROUNDINGS: f32 = 32.0;

/// A point on a face, as seen by a ray that arrives there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Index into [`Geometry::faces`](crate::scene::Geometry::faces).
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
    #[inline]
    pub fn new(tracer: &Tracer, face: u32, u: f32, v: f32, direction: Vec3) -> Self {
        Self::over(None, tracer, face, u, v, direction)
    }

    /// The same, with the normal map filtered over `footprint`.
    #[inline]
    pub(super) fn over(
        footprint: Option<&Footprint>,
        tracer: &Tracer,
        face: u32,
        u: f32,
        v: f32,
        direction: Vec3,
    ) -> Self {
        let geometry = &tracer.scene().geometry;
        let record = tracer.record(face);
        let weights = [1.0 - u - v, u, v];
        let ng = record.facing(direction);
        let mut n = record.normals.blend(weights).normalize_or(record.ng);
        let outside = n.dot(ng) >= 0.0;
        let mut uvs = [record.uvs.blend(weights), Vec2::ZERO];
        let mut color = Vec4::ONE;
        if record.extras {
            let corners = geometry.faces[face as usize];
            uvs[1] = corners.map(|corner| geometry.uv(1, corner)).blend(weights);
            color = corners.map(|corner| geometry.color(corner)).blend(weights);
            n = mapped_normal(tracer.scene(), record, corners, weights, (uvs, footprint), n);
        }
        Self {
            face,
            object: record.object,
            material: record.material,
            vt: record.vt,
            outside,
            position: record.positions.blend(weights),
            ng,
            n: if outside { n } else { -n },
            uvs,
            color,
            offset: record.offset,
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

/// The shading normal bent by the material's normal map; `n` without one, and where the tangent or the
/// texel is unusable.
fn mapped_normal(
    scene: &Scene,
    record: &Record,
    corners: [u32; 3],
    weights: [f32; 3],
    (uvs, footprint): ([Vec2; 2], Option<&Footprint>),
    n: Vec3,
) -> Vec3 {
    let material = &scene.materials[record.material as usize];
    let tangents = &scene.geometry.tangents;
    let (Some(slot), false) = (&material.normal_texture, tangents.is_empty()) else { return n };
    let tangent = corners.map(|corner| tangents[corner as usize]).blend(weights);
    let across = tangent.truncate();
    let Some(t) = (across - n * n.dot(across)).try_normalize() else { return n };
    let b = n.cross(t) * tangent.w.signum();
    let texel = Texels::new(scene, slot).rgba_over(footprint, uvs[usize::from(slot.uv_set)]);
    let texel = texel.truncate() * 2.0 - 1.0;
    let scale = Vec3::new(material.normal_scale, material.normal_scale, 1.0);
    (Mat3::from_cols(t, b, n) * (texel * scale)).normalize_or(n)
}

/// Interpolation over a face.
trait Blend<T> {
    fn blend(self, weights: [f32; 3]) -> T;
}

impl<T: Copy + Add<Output = T> + Mul<f32, Output = T>> Blend<T> for [T; 3] {
    #[inline(always)]
    fn blend(self, [a, b, c]: [f32; 3]) -> T {
        self[0] * a + self[1] * b + self[2] * c
    }
}

/// All that most hits need of a face, in one place instead of six arrays.
#[derive(Debug, Clone, Copy)]
pub(super) struct Record {
    positions: [Vec3; 3],
    normals: [Vec3; 3],
    /// First texture coordinates.
    pub(super) uvs: [Vec2; 3],
    /// Unit geometric normal, counter-clockwise.
    pub(super) ng: Vec3,
    /// How far rays start off the face.
    pub(super) offset: f32,
    object: u32,
    pub(super) material: u32,
    pub(super) vt: bool,
    /// Whether lights may show on it.
    pub(super) scatters: bool,
    /// Whether vertex colours, the second coordinates or tangents are to be looked at.
    pub(super) extras: bool,
}

impl Record {
    /// Origin of a ray that leaves the point with barycentric weights (1 − u − v, u, v) to the side that `direction`
    /// arrives from.
    #[inline]
    pub fn front(&self, u: f32, v: f32, direction: Vec3) -> Vec3 {
        self.position(u, v) + self.facing(direction) * self.offset
    }

    /// The point with barycentric weights (1 − u − v, u, v).
    #[inline(always)]
    pub fn position(&self, u: f32, v: f32) -> Vec3 {
        self.positions.blend([1.0 - u - v, u, v])
    }

    /// Shading normal there, of any length.
    #[inline(always)]
    pub fn normal(&self, u: f32, v: f32) -> Vec3 {
        self.normals.blend([1.0 - u - v, u, v])
    }

    /// First texture coordinates there.
    #[inline(always)]
    pub fn uv(&self, u: f32, v: f32) -> Vec2 {
        self.uvs.blend([1.0 - u - v, u, v])
    }

    /// How much the normals of the corners part, over the edges' lengths: the curvature of the surface that the face is of,
    /// positive where it bulges to the side of its normals.
    pub fn curvature(&self) -> f32 {
        let ([a, b, c], [m, n, o]) = (self.positions, self.normals);
        let along = |edge: Vec3, parting: Vec3| {
            let squared = edge.length_squared();
            if squared > 0.0 { parting.dot(edge) / squared } else { 0.0 }
        };
        (along(b - a, n - m) + along(c - b, o - n) + along(a - c, m - o)) / 3.0
    }

    /// Length in texture coordinates, those of the corners being `uvs`, for a unit of length on the face: of a square of its
    /// area where they differ by direction.
    pub fn density(&self, uvs: [Vec2; 3]) -> f32 {
        let ([a, b, c], [m, n, o]) = (self.positions, uvs);
        ((n - m).perp_dot(o - m).abs() / (b - a).cross(c - a).length()).sqrt()
    }

    /// Unit geometric normal on the side that the unit vector `direction` arrives from.
    #[inline(always)]
    fn facing(&self, direction: Vec3) -> Vec3 {
        if self.ng.dot(direction) < 0.0 { self.ng } else { -self.ng }
    }
}

/// The records of all faces of `scene`.
///
/// Ray origins are offset by the largest coordinate of the face's one-ring: a vertex lies on all its
/// faces, so that the largest of them decides.
pub(super) fn records(scene: &Scene) -> Vec<Record> {
    let geometry = &scene.geometry;
    let reach = |face: &[u32; 3]| {
        face.iter().map(|&v| geometry.positions[v as usize].abs().max_element()).fold(0.0, f32::max)
    };
    let mut around = vec![0.0_f32; geometry.positions.len()];
    for face in &geometry.faces {
        let reach = reach(face);
        for &vertex in face {
            around[vertex as usize] = around[vertex as usize].max(reach);
        }
    }
    let record = |(face, corners): (usize, &[u32; 3])| {
        let object_index = geometry.face_objects[face];
        let object = &scene.objects[object_index as usize];
        let reach = corners.iter().map(|&v| around[v as usize]).fold(0.0, f32::max);
        Record {
            positions: geometry.corners(face as u32),
            normals: corners.map(|v| geometry.normals[v as usize]),
            uvs: corners.map(|v| geometry.uv(0, v)),
            ng: unit(geometry.area_normal(face as u32)).unwrap_or(Vec3::Y),
            offset: reach * (OFFSET_ROUNDINGS * f32::EPSILON * 0.5),
            object: object_index,
            material: object.material,
            vt: object.vt,
            scatters: scene.materials[object.material as usize].scatters(),
            extras: !geometry.colors.is_empty()
                || !geometry.uvs[1].is_empty()
                || scene.materials[object.material as usize].normal_texture.is_some(),
        }
    };
    geometry.faces.iter().enumerate().map(record).collect()
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
    /// The values of `material` without textures and vertex colours.
    pub(super) fn untextured(material: &Material) -> Self {
        Self {
            base: material.base_color.truncate(),
            base_texel: Vec3::ONE,
            alpha: material.base_color.w,
            metallic: material.metallic,
            roughness: material.roughness,
            transmission: material.transmission,
            specular: material.specular_color
                * (material.specular * optics::normal_reflectance(material.ior)),
            emission: material.emissive,
        }
    }

    /// The values of the surface's material at the surface.
    #[inline]
    pub fn new(scene: &Scene, surface: &Surface) -> Self {
        Self::over(None, scene, surface)
    }

    /// The same, with textures filtered over `footprint`.
    #[inline]
    pub(super) fn over(footprint: Option<&Footprint>, scene: &Scene, surface: &Surface) -> Self {
        let material = &scene.materials[surface.material as usize];
        let texel = |slot: &Option<TextureSlot>| match slot {
            Some(slot) => {
                Texels::new(scene, slot).rgba_over(footprint, surface.uvs[usize::from(slot.uv_set)])
            }
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
