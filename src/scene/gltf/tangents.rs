//! Tangents for normal-mapped faces whose mesh brings none, by MikkTSpace, as glTF 2.0 §3.7.2.1 asks.

use std::collections::HashMap;

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{Vec2, Vec3, Vec4};

struct Corners<'a> {
    positions: &'a [Vec3],
    normals: &'a [Vec3],
    uvs: &'a [Vec2],
    faces: &'a [[u32; 3]],
    tangents: Vec<[Vec4; 3]>,
}

/// Work that may be spent on the tangents of one file, in the unit of [`effort`]: a few seconds.
pub const MAX_EFFORT: u64 = 500_000_000;

/// A bound on the work of [`generate`]: it compares the faces at a vertex pair by pair.
pub fn effort(positions: &[Vec3], faces: &[[u32; 3]]) -> u64 {
    let mut valence: HashMap<[u32; 3], u64> = HashMap::new();
    for &vertex in faces.iter().flatten() {
        // Vertices are welded by place, whatever their numbers are.
        *valence.entry(positions[vertex as usize].to_array().map(f32::to_bits)).or_default() += 1;
    }
    valence.values().fold(0, |sum, faces| sum.saturating_add(faces * faces))
}

/// A tangent and its handedness for each corner of each face: corners of one vertex may differ, where the
/// texture is mirrored. `uvs` are those of the normal map, transformed.
pub fn generate(positions: &[Vec3], normals: &[Vec3], uvs: &[Vec2], faces: &[[u32; 3]]) -> Vec<[Vec4; 3]> {
    let tangents =
        faces.iter().map(|face| face.map(|vertex| any_tangent(normals[vertex as usize]))).collect();
    let mut corners = Corners { positions, normals, uvs, faces, tangents };
    if let Err(error) = generate_tangents(&mut corners) {
        log::warn!("tangents: {error}");
    }
    corners.tangents
}

/// A tangent where the texture gives no direction.
pub fn any_tangent(normal: Vec3) -> Vec4 {
    normal.any_orthonormal_vector().extend(1.0)
}

impl Corners<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.faces[face][corner] as usize
    }
}

impl Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.faces.len()
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.positions[self.vertex(face, corner)].to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        self.normals[self.vertex(face, corner)].to_array()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        self.uvs[self.vertex(face, corner)].to_array()
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        let Some(space) = space else { return };
        let [x, y, z, sign] = space.tangent_encoded();
        if let Some(tangent) = Vec3::new(x, y, z).try_normalize() {
            // glTF's v points down the image, MikkTSpace's up.
            self.tangents[face][corner] = tangent.extend(-sign);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn upright_and_mirrored_textures() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::ONE - Vec3::Z, Vec3::Y];
        let faces = [[0, 1, 2], [0, 2, 3]];
        let upright = positions.map(|p| Vec2::new(p.x, 1.0 - p.y));
        for corner in generate(&positions, &[Vec3::Z; 4], &upright, &faces).iter().flatten() {
            assert!((*corner - Vec4::new(1.0, 0.0, 0.0, 1.0)).length() < 1e-6, "{corner}");
        }
        let mirrored = positions.map(|p| Vec2::new(-p.x, 1.0 - p.y));
        for corner in generate(&positions, &[Vec3::Z; 4], &mirrored, &faces).iter().flatten() {
            assert!((*corner - Vec4::new(-1.0, 0.0, 0.0, -1.0)).length() < 1e-6, "{corner}");
        }
        let none = [Vec2::ZERO; 4];
        for corner in generate(&positions, &[Vec3::Z; 4], &none, &faces).iter().flatten() {
            assert!(
                corner.truncate().dot(Vec3::Z).abs() < 1e-6
                    && (corner.truncate().length() - 1.0).abs() < 1e-5
            );
        }
    }
}
