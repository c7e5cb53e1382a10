//! Meshes of simple shapes: planes, boxes, spheres, waves.

use std::collections::HashMap;
use std::f32::consts::TAU;

use glam::{Vec2, Vec3, Vec3Swizzles};

use super::Mesh;

/// A parallelogram of two faces with its lower left corner at `corner`, seen from the side of
/// `right` × `up`. `tile` is the edge of the square, in world units, that one texture covers.
pub fn plane(corner: Vec3, right: Vec3, up: Vec3, tile: f32) -> Mesh {
    grid(corner, right, up, tile, 1, 1)
}

/// [`plane`] cut into `columns` × `rows` cells of two faces each (at least one).
///
/// The texture is anchored at the lower left corner; all faces share one affine map of coordinates.
pub fn grid(corner: Vec3, right: Vec3, up: Vec3, tile: f32, columns: u32, rows: u32) -> Mesh {
    let (columns, rows) = (columns.max(1), rows.max(1));
    let normal = right.cross(up).normalize_or_zero();
    let tiles = Vec2::new(right.length(), up.length()) / tile;
    let mut mesh = Mesh::default();
    for row in 0..=rows {
        for column in 0..=columns {
            let at = Vec2::new(column as f32 / columns as f32, row as f32 / rows as f32);
            mesh.push(corner + right * at.x + up * at.y, normal);
            mesh.uvs.push(Vec2::new(at.x * tiles.x, (1.0 - at.y) * tiles.y));
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let a = row * (columns + 1) + column;
            let (b, c, d) = (a + 1, a + columns + 2, a + columns + 1);
            mesh.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

/// A box between two corners, twelve faces, textured by [`plane`]'s rule; `low` < `high` on each axis.
pub fn cuboid(low: Vec3, high: Vec3, tile: f32) -> Mesh {
    let size = high - low;
    let (x, y, z) = (Vec3::X * size.x, Vec3::Y * size.y, Vec3::Z * size.z);
    plane(low + z, x, y, tile)
        .merged(&plane(low + x, -x, y, tile))
        .merged(&plane(low, z, y, tile))
        .merged(&plane(high - y, -z, y, tile))
        .merged(&plane(low + y + z, x, -z, tile))
        .merged(&plane(low, x, z, tile))
        .snapped(low, high)
}

/// An icosahedron subdivided `level` times: 20 · 4^`level` faces with the sphere's normals.
pub fn sphere(centre: Vec3, radius: f32, level: u32) -> Mesh {
    let golden = (1.0 + 5.0_f32.sqrt()) / 2.0;
    let mut points: Vec<Vec3> = Vec::new();
    for (a, b) in [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)] {
        points.extend([Vec3::new(a, b, 0.0), Vec3::new(0.0, a, b), Vec3::new(b, 0.0, a)]);
    }
    points.iter_mut().for_each(|point| *point = point.normalize());
    let mut faces = icosahedron_faces(&points);
    for _ in 0..level {
        let mut middles = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        faces = faces
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    let positions = points.iter().map(|&normal| centre + normal * radius).collect();
    Mesh { positions, normals: points, uvs: Vec::new(), faces }
}

/// The twenty triples of mutually nearest points, counter-clockwise seen from outside.
fn icosahedron_faces(points: &[Vec3]) -> Vec<[u32; 3]> {
    // Neighbours of an icosahedron enclose acos(1/√5); all others are farther.
    let near = |a: usize, b: usize| points[a].dot(points[b]) > 0.4;
    let mut faces = Vec::with_capacity(20);
    for a in 0..points.len() {
        for b in a + 1..points.len() {
            for c in b + 1..points.len() {
                if near(a, b) && near(b, c) && near(c, a) {
                    let outward = points[a].cross(points[b]).dot(points[c]) > 0.0;
                    faces.push(if outward { [a, b, c] } else { [a, c, b] }.map(|v| v as u32));
                }
            }
        }
    }
    faces
}

/// A horizontal square of waves, `cells` × `cells` cells of two faces each, centred on the origin.
///
/// The height is `amplitude` · sin(`waves` turns along x) · sin(the same along z); normals are exact.
pub fn waves(edge: f32, cells: u32, amplitude: f32, waves: f32) -> Mesh {
    let half = edge * 0.5;
    let corner = Vec3::new(-half, 0.0, half);
    let mut mesh = grid(corner, Vec3::X * edge, Vec3::NEG_Z * edge, edge, cells, cells);
    let frequency = TAU * waves / edge;
    for (position, normal) in mesh.positions.iter_mut().zip(&mut mesh.normals) {
        let (sin, cos) = (
            Vec2::from_array((position.xz() * frequency).to_array().map(f32::sin)),
            Vec2::from_array((position.xz() * frequency).to_array().map(f32::cos)),
        );
        position.y = amplitude * sin.x * sin.y;
        let slope = amplitude * frequency * Vec2::new(cos.x * sin.y, sin.x * cos.y);
        *normal = Vec3::new(-slope.x, 1.0, -slope.y).normalize();
    }
    mesh
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use glam::Affine3A;

    use super::*;

    fn area(mesh: &Mesh) -> f32 {
        mesh.faces
            .iter()
            .map(|face| {
                let [a, b, c] = face.map(|v| mesh.positions[v as usize]);
                (b - a).cross(c - a).length() * 0.5
            })
            .sum()
    }

    #[test]
    fn sizes_of_closed_shapes() {
        let cube = cuboid(Vec3::new(-1.0, 0.0, 2.0), Vec3::new(1.0, 3.0, 2.5), 1.0);
        assert!(cube.is_closed() && (cube.volume() - 3.0).abs() < 1e-5);
        let ball = sphere(Vec3::new(5.0, -2.0, 1.0), 0.5, 4);
        assert_eq!(ball.faces.len(), 20 * 4_usize.pow(4));
        assert!(ball.is_closed() && (ball.volume() / (4.0 / 3.0 * PI * 0.125) - 1.0).abs() < 0.01);
        assert!((area(&ball) / PI - 1.0).abs() < 0.01);
    }

    #[test]
    fn reflection_keeps_the_outside_out() {
        let mirrored = sphere(Vec3::X, 1.0, 1).transformed(Affine3A::from_scale(Vec3::new(-1.0, 2.0, 1.0)));
        assert!(mirrored.volume() > 0.0);
        let outward = |v: usize| (mirrored.positions[v] + Vec3::X).dot(mirrored.normals[v]) > 0.0;
        assert!((0..mirrored.positions.len()).all(outward));
    }

    #[test]
    fn an_open_shape_is_not_closed() {
        assert!(!plane(Vec3::ZERO, Vec3::X, Vec3::Y, 1.0).is_closed());
    }

    #[test]
    fn texture_tiles_have_the_size_asked_for() {
        let wall = grid(Vec3::ZERO, Vec3::X * 6.0, Vec3::Y * 3.0, 1.5, 3, 2);
        assert_eq!(wall.normals[0], Vec3::Z);
        for (position, uv) in wall.positions.iter().zip(&wall.uvs) {
            assert_eq!(*uv, Vec2::new(position.x / 1.5, 2.0 - position.y / 1.5));
        }
    }

    #[test]
    fn wave_normals_are_those_of_the_surface() {
        let sea = waves(4.0, 200, 0.1, 2.0);
        for face in &sea.faces {
            let [a, b, c] = face.map(|v| sea.positions[v as usize]);
            let normal = (b - a).cross(c - a).normalize();
            assert!(normal.dot(sea.normals[face[0] as usize]) > 0.999);
        }
    }
}
