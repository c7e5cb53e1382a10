//! Faces and vertices of all objects, flat and in world space.

use std::ops::Range;

use glam::{Vec2, Vec3, Vec4};

/// Vertex and face arrays shared by all objects.
///
/// Optional attributes are empty when no object has them, else as long as `positions`; an object that
/// lacks an attribute that others have holds its neutral value there (uv 0, colour 1).
#[derive(Debug, Clone, Default)]
pub struct Geometry {
    /// World positions relative to [`Scene::origin`](super::Scene::origin).
    pub positions: Vec<Vec3>,
    /// Unit shading normals, one per position.
    pub normals: Vec<Vec3>,
    /// Tangent and handedness (±1), for normal maps; empty if no material has one.
    pub tangents: Vec<Vec4>,
    /// Texture coordinates, glTF style: (0, 0) is the first texel of the first row. Either may be empty.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear RGBA vertex colours; empty if no primitive has any.
    pub colors: Vec<Vec4>,
    /// Vertex indices of each face, counter-clockwise seen from its front. No face is degenerate.
    pub faces: Vec<[u32; 3]>,
    /// Index of the object that each face belongs to.
    pub face_objects: Vec<u32>,
}

impl Geometry {
    /// Corner positions of a face.
    pub fn corners(&self, face: u32) -> [Vec3; 3] {
        self.faces[face as usize].map(|v| self.positions[v as usize])
    }

    /// Geometric normal of a face, with a length of twice its area.
    pub fn area_normal(&self, face: u32) -> Vec3 {
        let [a, b, c] = self.corners(face);
        (b - a).cross(c - a)
    }

    /// Texture coordinates of set `set` at vertex `vertex`; zero where the mesh has none.
    pub fn uv(&self, set: u8, vertex: u32) -> Vec2 {
        self.uvs[usize::from(set)].get(vertex as usize).copied().unwrap_or(Vec2::ZERO)
    }

    /// Linear vertex colour; white where the mesh has none.
    pub fn color(&self, vertex: u32) -> Vec4 {
        self.colors.get(vertex as usize).copied().unwrap_or(Vec4::ONE)
    }
}

/// Largest coordinate, as a distance from the scene's centre, whose squares and products single precision holds.
pub const MAX_REACH: f32 = 1e17;

/// `v` at length 1, whatever its magnitude; `None` for zero and for what is not finite.
///
/// The normal of a face has the square of its edges for a length, whose own square would leave the range of `f32`
/// for edges below 1e-9 or above 1e9 units.
pub fn unit(v: Vec3) -> Option<Vec3> {
    let largest = v.abs().max_element();
    (largest > 0.0).then(|| v / largest)?.try_normalize()
}

/// Where a ray meets the plane of a triangle: at what distance, in units of `direction`'s length, and with what
/// barycentric weights of the second and third corner, which off the triangle are negative or more than 1 together.
/// `None` for a triangle without area and a ray along its plane.
pub fn meet_plane([a, b, c]: [Vec3; 3], (origin, direction): (Vec3, Vec3)) -> Option<(f32, Vec2)> {
    let (e1, e2, s) = (b - a, c - a, origin - a);
    let (p, q) = (direction.cross(e2), s.cross(e1));
    let determinant = e1.dot(p);
    let weights = Vec2::new(s.dot(p) / determinant, direction.dot(q) / determinant);
    (determinant != 0.0).then(|| (e2.dot(q) / determinant, weights))
}

/// One instance of a mesh primitive.
#[derive(Debug, Clone)]
pub struct Object {
    /// Name of the node, else of the mesh, else `node 3`.
    pub name: String,
    /// Name of the mesh, if it has one.
    pub mesh_name: Option<String>,
    /// Index into [`Scene::materials`](super::Scene::materials).
    pub material: u32,
    /// Its faces in [`Geometry::faces`].
    pub faces: Range<u32>,
    /// Its vertices in [`Geometry::positions`]; shared with no other object.
    pub vertices: Range<u32>,
    /// `extras: {"vt": …}` of the node, or of the material where the node has none.
    pub vt_extra: Option<bool>,
    /// Whether it is a specular VT object: set by [`classify`](super::classify).
    pub vt: bool,
}
