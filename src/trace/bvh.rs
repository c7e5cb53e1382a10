//! Closest hits and occlusion: a watertight triangle test inside an obvhs BVH.

use std::time::Duration;

use glam::{Vec3, Vec3A, Vec3Swizzles};
use obvhs::{
    Boundable, BvhBuildParams,
    aabb::Aabb,
    cwbvh::{CwBvh, builder::build_cwbvh},
    ray::{Ray, RayHit},
};

use super::{
    surface::{self, Record},
    texel,
};
use crate::scene::{AlphaMode, Scene};

/// Rays end this fraction of the distance short of a light, so that a light on a surface is seen.
const SHADOW_END: f32 = 1e-4;

/// Ray parameters are counted in this fraction of the scene's extent. obvhs rejects boxes that a ray
/// leaves before t = 1e-4; in this unit that is 1e-8 of the extent, less than a position's rounding.
const RAY_UNIT: f32 = 1e-4;

/// Smallest magnitude of a direction's component that is inverted as it is.
const SMALLEST_COMPONENT: f32 = 1e-15;

/// The nearest surface along a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Index into [`Geometry::faces`](crate::scene::Geometry::faces).
    pub face: u32,
    /// Distance from the ray's origin.
    pub t: f32,
    /// Barycentric weight of the face's second corner.
    pub u: f32,
    /// Barycentric weight of the face's third corner.
    pub v: f32,
}

/// A scene made ready for rays.
///
/// Rays hit both sides of every face. Faces with a MASK material count where their alpha reaches the
/// cutoff; BLEND is opaque (coverage on camera rays is [`surface::coverage`](super::surface::coverage)).
pub struct Tracer<'s> {
    scene: &'s Scene,
    bvh: CwBvh,
    /// Corners in the order of the BVH's leaves, and the face that each came from.
    triangles: Vec<Triangle>,
    faces: Vec<u32>,
    /// Distance that a ray parameter of 1 stands for; a power of two, so that scaling is exact.
    unit: f32,
    masked: bool,
    /// In the order of the scene's faces.
    records: Vec<Record>,
}

impl<'s> Tracer<'s> {
    /// Builds the BVH over all faces of `scene`.
    pub fn new(scene: &'s Scene) -> Self {
        let geometry = &scene.geometry;
        let by_face: Vec<Triangle> =
            (0..geometry.faces.len() as u32).map(|face| Triangle::new(geometry.corners(face))).collect();
        let bvh = if by_face.is_empty() {
            CwBvh::default()
        } else {
            build_cwbvh(&by_face, BvhBuildParams::medium_build(), &mut Duration::default())
        };
        let (low, high) = scene.bounds();
        let extent = low.abs().max(high.abs()).max_element().max(f32::MIN_POSITIVE / RAY_UNIT);
        let masked = scene.materials.iter().any(|material| matches!(material.alpha_mode, AlphaMode::Mask(_)));
        Self {
            scene,
            triangles: bvh.primitive_indices.iter().map(|&face| by_face[face as usize]).collect(),
            faces: bvh.primitive_indices.clone(),
            bvh,
            unit: (extent * RAY_UNIT).log2().floor().exp2(),
            masked,
            records: surface::records(scene),
        }
    }

    /// The scene that is traced.
    pub fn scene(&self) -> &'s Scene {
        self.scene
    }

    #[inline]
    pub(super) fn record(&self, face: u32) -> &Record {
        &self.records[face as usize]
    }

    /// The nearest hit from `origin` along the unit vector `direction`.
    #[inline]
    pub fn closest(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        if self.masked {
            self.closest_of::<true>(origin, direction)
        } else {
            self.closest_of::<false>(origin, direction)
        }
    }

    /// Whether anything lies between `origin` and the point `distance` (may be infinite) away along the
    /// unit vector `direction`.
    #[inline]
    pub fn occluded(&self, origin: Vec3, direction: Vec3, distance: f32) -> bool {
        if self.masked {
            self.occluded_of::<true>(origin, direction, distance)
        } else {
            self.occluded_of::<false>(origin, direction, distance)
        }
    }

    #[inline]
    fn closest_of<const MASKED: bool>(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        let probe = Probe::new(origin, direction, self.unit);
        let mut nearest = RayHit::none();
        let mut weights = Vec3A::ZERO;
        self.bvh.ray_traverse(self.ray(origin, direction, f32::INFINITY), &mut nearest, |ray, leaf| {
            let (t, w) = self.triangles[leaf].intersect(&probe);
            if t > 0.0 && t < ray.tmax && (!MASKED || self.covers(leaf, w)) {
                weights = w;
                t
            } else {
                f32::INFINITY
            }
        });
        (nearest.t < f32::INFINITY).then(|| Hit {
            face: self.faces[nearest.primitive_id as usize],
            t: nearest.t * self.unit,
            u: weights.y,
            v: weights.z,
        })
    }

    #[inline]
    fn occluded_of<const MASKED: bool>(&self, origin: Vec3, direction: Vec3, distance: f32) -> bool {
        let probe = Probe::new(origin, direction, self.unit);
        let end = distance / self.unit * (1.0 - SHADOW_END);
        !self.bvh.ray_traverse_miss(self.ray(origin, direction, end), |_, leaf| {
            let (t, w) = self.triangles[leaf].intersect(&probe);
            if t > 0.0 && t < end && (!MASKED || self.covers(leaf, w)) { t } else { f32::INFINITY }
        })
    }

    /// Whether a MASK material lets the hit with barycentric weights `w` count.
    fn covers(&self, leaf: usize, w: Vec3A) -> bool {
        let face = self.faces[leaf];
        let material = self.scene.face_material(face);
        let AlphaMode::Mask(cutoff) = material.alpha_mode else { return true };
        let geometry = &self.scene.geometry;
        let corners = geometry.faces[face as usize];
        let w = w.to_array();
        let mut alpha = material.base_color.w;
        if !geometry.colors.is_empty() {
            alpha *= corners.iter().zip(w).map(|(&corner, w)| geometry.color(corner).w * w).sum::<f32>();
        }
        if let Some(slot) = &material.base_color_texture {
            let uv = corners.iter().zip(w).map(|(&corner, w)| geometry.uv(slot.uv_set, corner) * w).sum();
            alpha *= texel::lookup(self.scene, slot, uv).w;
        }
        alpha >= cutoff
    }

    fn ray(&self, origin: Vec3, direction: Vec3, tmax: f32) -> Ray {
        let (origin, direction) = (Vec3A::from(origin), Vec3A::from(direction));
        // A finite inverse keeps 0 · ∞ out of the box test.
        let invertible = direction.abs().max(Vec3A::splat(SMALLEST_COMPONENT)).copysign(direction);
        Ray { origin, direction, inv_direction: (invertible * self.unit).recip(), tmin: 0.0, tmax }
    }
}

/// A triangle's corners, one coordinate axis a vector, so that its three edges are tested side by side.
#[derive(Clone, Copy)]
struct Triangle {
    x: Vec3A,
    y: Vec3A,
    z: Vec3A,
}

/// A ray as [`Triangle::intersect`] wants it: every component in all lanes.
struct Probe {
    origin: [Vec3A; 3],
    direction: [Vec3A; 3],
    per_unit: f32,
}

impl Probe {
    #[inline(always)]
    fn new(origin: Vec3, direction: Vec3, unit: f32) -> Self {
        Self {
            origin: origin.to_array().map(Vec3A::splat),
            direction: direction.to_array().map(Vec3A::splat),
            per_unit: unit.recip(),
        }
    }
}

impl Triangle {
    fn new([a, b, c]: [Vec3; 3]) -> Self {
        Self { x: Vec3A::new(a.x, b.x, c.x), y: Vec3A::new(a.y, b.y, c.y), z: Vec3A::new(a.z, b.z, c.z) }
    }

    /// The ray parameter and the barycentric weights of the hit; infinity or NaN for a miss.
    ///
    /// An edge's function d · ((b − a) × (b + a)), corners relative to the ray's origin, changes nothing
    /// but its sign when the edge's ends are exchanged, to the last bit. A ray therefore never slips
    /// between two faces that share an edge (the "robust" test of Embree does the same).
    #[inline(always)]
    fn intersect(&self, ray: &Probe) -> (f32, Vec3A) {
        let [ox, oy, oz] = ray.origin;
        let [dx, dy, dz] = ray.direction;
        let (x, y, z) = (self.x - ox, self.y - oy, self.z - oz);
        let (next_x, next_y, next_z) = (x.yzx(), y.yzx(), z.yzx());
        let (ex, ey, ez) = (next_x - x, next_y - y, next_z - z);
        let (sx, sy, sz) = (next_x + x, next_y + y, next_z + z);
        let edges = (ey * sz - ez * sy) * dx + (ez * sx - ex * sz) * dy + (ex * sy - ey * sx) * dz;
        if edges.cmplt(Vec3A::ZERO).any() && edges.cmpgt(Vec3A::ZERO).any() {
            return (f32::INFINITY, Vec3A::ZERO);
        }
        // Edge i runs from corner i to i + 1 and weighs the corner opposite to it, i + 2.
        let weights = edges.yzx() / (edges.x + edges.y + edges.z);
        let depth = x * dx + y * dy + z * dz;
        (weights.dot(depth) * ray.per_unit, weights)
    }
}

impl Boundable for Triangle {
    fn aabb(&self) -> Aabb {
        Aabb {
            min: Vec3A::new(self.x.min_element(), self.y.min_element(), self.z.min_element()),
            max: Vec3A::new(self.x.max_element(), self.y.max_element(), self.z.max_element()),
        }
    }
}
