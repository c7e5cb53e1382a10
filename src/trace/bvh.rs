//! Closest hits and occlusion: a watertight triangle test inside an obvhs BVH.

use std::time::Duration;

use glam::{Vec3, Vec3A, Vec3Swizzles};
use obvhs::{
    BvhBuildParams,
    aabb::Aabb,
    bvh2::{Bvh2, builder::build_bvh2},
    ray::{Ray, RayHit},
};

use super::{
    surface::{self, Record},
    texel,
};
use crate::scene::{AlphaMode, Scene};

/// Rays end this fraction of the distance short of a light, so that a light on a surface is seen.
const SHADOW_END: f32 = 1e-4;

/// How the BVH is built over `faces` faces.
///
/// Two triangles a leaf, since a triangle test costs about as much as a box test. Reinsertion repairs the
/// greedy build: all nodes of a small scene, where it pays back within a frame, and as many of a large one
/// as keep the time in proportion.
fn build_params(faces: usize) -> BvhBuildParams {
    BvhBuildParams {
        reinsertion_batch_ratio: (20_000.0 / faces as f32).clamp(0.05, 1.0),
        max_prims_per_leaf: 2,
        collapse_traversal_cost: 1.0,
        ..BvhBuildParams::medium_build()
    }
}

/// Boxes are wider than their triangles by this fraction of the scene's extent: as much as a box test errs
/// for a ray from inside the scene, so that it does not lose what the triangle test would find.
const BOX_PADDING: f32 = 4.0 * f32::EPSILON;

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
/// cutoff; BLEND is opaque (coverage on camera rays is [`coverage`](super::surface::coverage)).
pub struct Tracer<'s> {
    scene: &'s Scene,
    bvh: Bvh2,
    /// Corners in the order of the BVH's leaves, and the face that each came from.
    triangles: Vec<Triangle>,
    faces: Vec<u32>,
    masked: bool,
    /// In the order of the scene's faces.
    records: Vec<Record>,
}

/// What a [`Tracer`] builds of faces and materials, without the scene that they are of.
pub struct Hierarchy {
    bvh: Bvh2,
    triangles: Vec<Triangle>,
    faces: Vec<u32>,
    masked: bool,
    records: Vec<Record>,
}

impl<'s> Tracer<'s> {
    /// Builds the BVH over all faces of `scene`.
    pub fn new(scene: &'s Scene) -> Self {
        let geometry = &scene.geometry;
        let by_face: Vec<Triangle> =
            (0..geometry.faces.len() as u32).map(|face| Triangle::new(geometry.corners(face))).collect();
        let (low, high) = scene.bounds();
        let extent = low.abs().max(high.abs()).max_element();
        let boxes: Vec<Aabb> = by_face.iter().map(|triangle| triangle.bounds(extent * BOX_PADDING)).collect();
        let bvh = if boxes.is_empty() {
            Bvh2::default()
        } else {
            build_bvh2(&boxes, build_params(boxes.len()), &mut Duration::default())
        };
        let masked = scene.materials.iter().any(|material| matches!(material.alpha_mode, AlphaMode::Mask(_)));
        Self {
            scene,
            triangles: bvh.primitive_indices.iter().map(|&face| by_face[face as usize]).collect(),
            faces: bvh.primitive_indices.clone(),
            bvh,
            masked,
            records: surface::records(scene),
        }
    }

    /// The tracer of `scene`, whose faces, objects and materials are those that `hierarchy` was built of; its lights
    /// may be others.
    pub fn with(scene: &'s Scene, hierarchy: Hierarchy) -> Self {
        let Hierarchy { bvh, triangles, faces, masked, records } = hierarchy;
        Self { scene, bvh, triangles, faces, masked, records }
    }

    /// What was built, for another tracer.
    pub fn into_hierarchy(self) -> Hierarchy {
        let Self { bvh, triangles, faces, masked, records, .. } = self;
        Hierarchy { bvh, triangles, faces, masked, records }
    }

    /// The scene that is traced.
    pub fn scene(&self) -> &'s Scene {
        self.scene
    }

    /// Lets rays start `distance` off every face instead of what its position and size ask for: made to
    /// compare images with renderers that have one global epsilon.
    pub fn set_offset(&mut self, distance: f32) {
        for record in &mut self.records {
            record.offset = distance;
        }
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

    /// Whether `accepts` any of the faces in boxes that `meets` says are worth opening; `meets` is given the lower and
    /// the upper corner of a box.
    pub fn any_face(&self, meets: impl Fn(Vec3, Vec3) -> bool, mut accepts: impl FnMut(u32) -> bool) -> bool {
        let mut open = if self.bvh.nodes.is_empty() { Vec::new() } else { vec![0] };
        while let Some(index) = open.pop() {
            let node = &self.bvh.nodes[index as usize];
            if !meets(node.aabb.min.into(), node.aabb.max.into()) {
                continue;
            }
            if !node.is_leaf() {
                open.extend([node.first_index, node.first_index + 1]);
            } else if (0..node.prim_count).any(|i| accepts(self.faces[(node.first_index + i) as usize])) {
                return true;
            }
        }
        false
    }

    #[inline(always)]
    fn closest_of<const MASKED: bool>(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        let probe = Probe::new(origin, direction);
        let mut nearest = RayHit::none();
        let mut weights = Vec3A::ZERO;
        self.bvh.ray_traverse(ray(origin, direction, f32::INFINITY), &mut nearest, |ray, leaf| {
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
            t: nearest.t,
            u: weights.y,
            v: weights.z,
        })
    }

    #[inline(always)]
    fn occluded_of<const MASKED: bool>(&self, origin: Vec3, direction: Vec3, distance: f32) -> bool {
        let probe = Probe::new(origin, direction);
        let end = distance * (1.0 - SHADOW_END);
        !self.bvh.ray_traverse_miss(ray(origin, direction, end), |_, leaf| {
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
}

/// The ray as the box tests want it.
#[inline(always)]
fn ray(origin: Vec3, direction: Vec3, tmax: f32) -> Ray {
    let direction = Vec3A::from(direction);
    // A finite inverse keeps 0 · ∞ out of the box test.
    let invertible = direction.abs().max(Vec3A::splat(SMALLEST_COMPONENT)).copysign(direction);
    Ray { origin: origin.into(), direction, inv_direction: invertible.recip(), tmin: 0.0, tmax }
}

/// A triangle's corners, one coordinate axis a vector, so that its three edges are tested side by side.
#[derive(Clone, Copy)]
struct Triangle {
    axes: [Vec3A; 3],
}

/// A ray in the sheared space where it runs along the third axis from the origin (Woop, Benthin and Wald
/// 2013, "Watertight Ray/Triangle Intersection").
struct Probe {
    /// The coordinate axes that become the first, second and third; the direction is longest in the third.
    axes: [usize; 3],
    origin: [Vec3A; 3],
    shear: [Vec3A; 2],
    /// Distance along the ray for a distance of 1 along the third axis.
    scale: f32,
}

impl Probe {
    #[inline(always)]
    fn new(origin: Vec3, direction: Vec3) -> Self {
        let size = direction.abs();
        let (axes, origin, direction) = if size.z >= size.x && size.z >= size.y {
            ([0, 1, 2], origin, direction)
        } else if size.y >= size.x {
            ([2, 0, 1], origin.zxy(), direction.zxy())
        } else {
            ([1, 2, 0], origin.yzx(), direction.yzx())
        };
        let inverse = direction.z.recip();
        Self {
            axes,
            origin: origin.to_array().map(Vec3A::splat),
            shear: [Vec3A::splat(direction.x * inverse), Vec3A::splat(direction.y * inverse)],
            scale: inverse,
        }
    }
}

impl Triangle {
    fn new([a, b, c]: [Vec3; 3]) -> Self {
        Self { axes: std::array::from_fn(|axis| Vec3A::new(a[axis], b[axis], c[axis])) }
    }

    /// The distance and the barycentric weights of the hit; infinity or NaN for a miss.
    ///
    /// A corner is sheared to the same two numbers in every triangle that has it, and the sign of an edge's
    /// function x·y' − y·x' is never wrong, only ever 0, which counts as inside on both sides: no ray
    /// slips between triangles at an edge or a corner.
    #[inline(always)]
    fn intersect(&self, ray: &Probe) -> (f32, Vec3A) {
        let [kx, ky, kz] = ray.axes;
        let z = self.axes[kz] - ray.origin[2];
        let x = self.axes[kx] - ray.origin[0] - ray.shear[0] * z;
        let y = self.axes[ky] - ray.origin[1] - ray.shear[1] * z;
        let edges = x * y.yzx() - y * x.yzx();
        if edges.cmplt(Vec3A::ZERO).any() && edges.cmpgt(Vec3A::ZERO).any() {
            return (f32::INFINITY, Vec3A::ZERO);
        }
        // Edge i runs from corner i to i + 1 and weighs the corner opposite to it, i + 2.
        let weights = edges.yzx() / (edges.x + edges.y + edges.z);
        (weights.dot(z) * ray.scale, weights)
    }

    /// The box around the corners, `padding` wider on all sides.
    fn bounds(&self, padding: f32) -> Aabb {
        let [x, y, z] = self.axes;
        Aabb {
            min: Vec3A::new(x.min_element(), y.min_element(), z.min_element()) - padding,
            max: Vec3A::new(x.max_element(), y.max_element(), z.max_element()) + padding,
        }
    }
}
