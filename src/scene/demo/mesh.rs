//! The mesh of one object before it is placed in a scene.

use std::collections::HashMap;

use glam::{Affine3A, Vec2, Vec3};

/// Vertices and faces of one primitive, before it is placed in a scene.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Positions in world units.
    pub positions: Vec<Vec3>,
    /// Shading normals, one per position; any length but zero.
    pub normals: Vec<Vec3>,
    /// glTF texture coordinates, one per position or none at all.
    pub uvs: Vec<Vec2>,
    /// Vertex indices, counter-clockwise seen from the front.
    pub faces: Vec<[u32; 3]>,
}

impl Mesh {
    /// Both meshes as one. If either lacks texture coordinates, so does the result.
    pub fn merged(mut self, other: &Mesh) -> Mesh {
        let base = self.positions.len() as u32;
        if self.uvs.len() == self.positions.len() && other.uvs.len() == other.positions.len() {
            self.uvs.extend_from_slice(&other.uvs);
        } else {
            self.uvs.clear();
        }
        self.positions.extend_from_slice(&other.positions);
        self.normals.extend_from_slice(&other.normals);
        self.faces.extend(other.faces.iter().map(|face| face.map(|v| base + v)));
        self
    }

    /// The mesh moved by an invertible transform; a reflection also turns the faces round.
    pub fn transformed(mut self, transform: Affine3A) -> Mesh {
        let normal_matrix = transform.matrix3.inverse().transpose();
        for position in &mut self.positions {
            *position = transform.transform_point3(*position);
        }
        for normal in &mut self.normals {
            *normal = (normal_matrix * *normal).normalize_or_zero();
        }
        if transform.matrix3.determinant() < 0.0 {
            self.faces.iter_mut().for_each(|face| face.swap(1, 2));
        }
        self
    }

    /// The mesh moved by `offset`.
    pub fn translated(self, offset: Vec3) -> Mesh {
        self.transformed(Affine3A::from_translation(offset))
    }

    /// The mesh turned about the y axis by `angle` radians, counter-clockwise seen from above.
    pub fn turned(self, angle: f32) -> Mesh {
        self.transformed(Affine3A::from_rotation_y(angle))
    }

    /// The mesh of the sides of a box with its vertices moved to the very corners, bit for bit, so that
    /// sides built apart from each other leave no crack.
    pub(super) fn snapped(mut self, low: Vec3, high: Vec3) -> Mesh {
        let middle = (low + high) * 0.5;
        for position in &mut self.positions {
            *position = Vec3::select(position.cmplt(middle), low, high);
        }
        self
    }

    pub(super) fn push(&mut self, position: Vec3, normal: Vec3) -> u32 {
        self.positions.push(position);
        self.normals.push(normal);
        self.positions.len() as u32 - 1
    }

    /// Whether the surface encloses a body: every edge, by the positions of its ends, belongs to as many
    /// faces in one direction as in the other. Solid glass must be closed.
    pub fn is_closed(&self) -> bool {
        // Adding zero makes -0 and 0 the same bits.
        let corner = |v: u32| (self.positions[v as usize] + 0.0).to_array().map(f32::to_bits);
        let mut balance: HashMap<_, i32> = HashMap::new();
        for &[a, b, c] in &self.faces {
            for (from, to) in [(a, b), (b, c), (c, a)].map(|(from, to)| (corner(from), corner(to))) {
                *balance.entry((from.min(to), from.max(to))).or_default() += if from < to { 1 } else { -1 };
            }
        }
        balance.values().all(|&excess| excess == 0)
    }

    /// The volume that a closed surface encloses; negative if its faces look inward.
    pub fn volume(&self) -> f32 {
        let cone = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|v| self.positions[v as usize].as_dvec3());
            a.dot(b.cross(c)) / 6.0
        };
        self.faces.iter().map(cone).sum::<f64>() as f32
    }
}
