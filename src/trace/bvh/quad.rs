//! Four triangles tested side by side against a ray, without gaps at their edges.

use glam::{Vec3, Vec3Swizzles, Vec4};

use super::Hit;

/// Triangles in a [`Quad`], and boxes in a node of the BVH: the lanes of a [`Vec4`].
pub(super) const LANES: usize = 4;

/// A ray in the sheared space where it runs along the third axis from the origin (Woop, Benthin and Wald
/// 2013, "Watertight Ray/Triangle Intersection").
pub(super) struct Probe {
    /// The coordinate axes that become the first, second and third; the direction is longest in the third.
    axes: [usize; 3],
    origin: [Vec4; 3],
    shear: [Vec4; 2],
    /// Distance along the ray for a distance of 1 along the third axis.
    scale: Vec4,
}

impl Probe {
    /// The ray from `origin` along the unit vector `direction`.
    #[inline(always)]
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        let axes = axes(direction);
        let (origin, direction) = match axes[2] {
            2 => (origin, direction),
            1 => (origin.zxy(), direction.zxy()),
            _ => (origin.yzx(), direction.yzx()),
        };
        let inverse = direction.z.recip();
        Self {
            axes,
            origin: origin.to_array().map(Vec4::splat),
            shear: [Vec4::splat(direction.x * inverse), Vec4::splat(direction.y * inverse)],
            scale: Vec4::splat(inverse),
        }
    }
}

/// Which coordinate axes become the first, second and third of a ray's sheared space, where the direction is longest in the
/// last of them.
pub(super) const AXES: [[usize; 3]; 3] = [[0, 1, 2], [2, 0, 1], [1, 2, 0]];

/// Those of a ray of this direction.
#[inline(always)]
pub(super) fn axes(direction: Vec3) -> [usize; 3] {
    let size = direction.abs();
    if size.z >= size.x && size.z >= size.y {
        AXES[0]
    } else if size.y >= size.x {
        AXES[1]
    } else {
        AXES[2]
    }
}

/// Up to four triangles, one a lane.
#[derive(Clone)]
pub(super) struct Quad {
    /// By axis and corner. Lanes without a triangle are NaN, which nothing hits.
    corners: [[Vec4; 3]; 3],
    /// The scene's face of each lane.
    faces: [u32; LANES],
}

/// Where a ray meets the triangles of a [`Quad`].
pub(super) struct Crossing {
    /// Lanes that are hit, a bit each.
    lanes: u32,
    t: [f32; LANES],
    u: [f32; LANES],
    v: [f32; LANES],
}

impl Quad {
    /// The triangles of `faces`, at most four; `corners` tells their positions.
    pub fn new(faces: &[u32], corners: impl Fn(u32) -> [Vec3; 3]) -> Self {
        let mut quad = Self { corners: [[Vec4::NAN; 3]; 3], faces: [0; LANES] };
        for (lane, &face) in faces.iter().take(LANES).enumerate() {
            quad.faces[lane] = face;
            for (index, corner) in corners(face).into_iter().enumerate() {
                for (axis, value) in corner.to_array().into_iter().enumerate() {
                    quad.corners[axis][index][lane] = value;
                }
            }
        }
        quad
    }

    /// The scene's faces that it holds.
    pub fn faces(&self) -> impl Iterator<Item = u32> {
        let held = !self.corners[0][0].is_nan_mask();
        (0..LANES).filter(move |&lane| held.test(lane)).map(|lane| self.faces[lane])
    }

    /// The triangle of a lane: the scene's face, and by axis the coordinates of its corners; the first lanes are taken.
    #[inline(always)]
    pub fn triangle(&self, lane: usize) -> Option<(u32, [[f32; 3]; 3])> {
        let [x, y, z] = &self.corners;
        let along = |axis: &[Vec4; 3]| [axis[0][lane], axis[1][lane], axis[2][lane]];
        (!x[0][lane].is_nan()).then(|| (self.faces[lane], [along(x), along(y), along(z)]))
    }

    /// Hits between 0 and `end`, both excluded; `None` without any.
    ///
    /// A corner is sheared to the same two numbers in every triangle that has it, and the sign of an edge's
    /// function x·y' − y·x' is never wrong, only ever 0, which counts as inside on both sides: no ray
    /// slips between triangles at an edge or a corner.
    #[inline(always)]
    pub fn intersect(&self, ray: &Probe, end: f32) -> Option<Crossing> {
        let [kx, ky, kz] = ray.axes;
        let z = self.corners[kz].map(|z| z - ray.origin[2]);
        let sheared = |axis: usize, index: usize, corner: usize| {
            self.corners[axis][corner] - ray.origin[index] - ray.shear[index] * z[corner]
        };
        let x: [Vec4; 3] = std::array::from_fn(|corner| sheared(kx, 0, corner));
        let y: [Vec4; 3] = std::array::from_fn(|corner| sheared(ky, 1, corner));
        // Edge i runs from corner i to i + 1 and weighs the corner opposite to it, i + 2.
        let edge = |i: usize, j: usize| x[i] * y[j] - y[i] * x[j];
        let (e0, e1, e2) = (edge(0, 1), edge(1, 2), edge(2, 0));
        let below = e0.min(e1).min(e2).cmplt(Vec4::ZERO);
        let above = e0.max(e1).max(e2).cmpgt(Vec4::ZERO);
        if (below & above).all() {
            return None;
        }
        let sum = e0 + e1 + e2;
        let (w, u, v) = (e1 / sum, e2 / sum, e0 / sum);
        let t = (w * z[0] + u * z[1] + v * z[2]) * ray.scale;
        let lanes = (t.cmpgt(Vec4::ZERO) & t.cmplt(Vec4::splat(end)) & !(below & above)).bitmask();
        (lanes != 0).then(|| Crossing { lanes, t: t.to_array(), u: u.to_array(), v: v.to_array() })
    }
}

impl Crossing {
    /// What one of the lanes hits.
    #[inline(always)]
    pub fn hit(&self, lane: usize, quad: &Quad) -> Hit {
        Hit { face: quad.faces[lane], t: self.t[lane], u: self.u[lane], v: self.v[lane] }
    }

    /// The lanes that are hit.
    #[inline(always)]
    pub fn each(&self) -> impl Iterator<Item = usize> + use<> {
        let mut lanes = self.lanes;
        std::iter::from_fn(move || {
            let lane = lanes.trailing_zeros() as usize % LANES;
            (lanes != 0).then(|| {
                lanes &= lanes - 1;
                lane
            })
        })
    }
}
