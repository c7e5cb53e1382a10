//! Meshes of simple shapes: planes, boxes, spheres, surfaces of revolution and swept tubes.

use std::collections::HashMap;
use std::f32::consts::{PI, TAU};

use glam::{Affine3A, Vec2, Vec3, Vec3Swizzles};

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

    fn push(&mut self, position: Vec3, normal: Vec3) -> u32 {
        self.positions.push(position);
        self.normals.push(normal);
        self.positions.len() as u32 - 1
    }
}

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

/// A plane curve made of straight lines and cubic Bézier pieces, as the points that it is sampled at.
///
/// [`revolve`] reads a point as (radius, height), [`tube`] paths are lifted from it.
#[derive(Debug, Clone)]
pub struct Curve(Vec<Vec2>);

impl Curve {
    /// A curve that starts at `start`.
    pub fn from(start: impl Into<Vec2>) -> Self {
        Self(vec![start.into()])
    }

    /// Goes on straight to `end`.
    pub fn line(mut self, end: impl Into<Vec2>) -> Self {
        self.0.push(end.into());
        self
    }

    /// Goes on to `end` along the Bézier curve with the control points `first` and `second`, in `steps`
    /// steps (at least one).
    pub fn bend(
        mut self,
        first: impl Into<Vec2>,
        second: impl Into<Vec2>,
        end: impl Into<Vec2>,
        steps: u32,
    ) -> Self {
        let [a, b, c, d] = [self.last(), first.into(), second.into(), end.into()];
        self.0.extend((1..=steps.max(1)).map(|step| {
            let t = step as f32 / steps.max(1) as f32;
            let s = 1.0 - t;
            a * (s * s * s) + b * (3.0 * s * s * t) + c * (3.0 * s * t * t) + d * (t * t * t)
        }));
        self
    }

    /// The points, start and end included.
    pub fn points(&self) -> &[Vec2] {
        &self.0
    }

    fn last(&self) -> Vec2 {
        self.0[self.0.len() - 1]
    }
}

/// The circle of `radius` about `centre` as a closed profile for [`revolve`]: a torus.
pub fn circle(centre: Vec2, radius: f32, segments: u32) -> Curve {
    let segments = segments.max(3);
    let point = |i: u32| centre + Vec2::from_angle((i % segments) as f32 / segments as f32 * TAU) * radius;
    Curve((0..=segments).map(point).collect())
}

/// Half a circle from the lower to the upper pole as a profile for [`revolve`]: a sphere with
/// texture coordinates, if they are asked for.
pub fn meridian(radius: f32, segments: u32) -> Curve {
    let segments = segments.max(2);
    let point = |i: u32| match i {
        0 => Vec2::new(0.0, -radius),
        i if i == segments => Vec2::new(0.0, radius),
        i => Vec2::from_angle(PI * (i as f32 / segments as f32 - 0.5)) * radius,
    };
    Curve((0..=segments).map(point).collect())
}

/// Whether a surface of revolution carries texture coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Uv {
    /// None: the surface closes without a seam.
    None,
    /// u once round, v = 0 at the profile's end; costs a seam column and split poles.
    Wrapped,
}

/// The surface that `profile` sweeps about the y axis in `segments` steps (at least three).
///
/// The outside is to the right of the profile as it is walked. A point of radius 0 becomes a pole; a
/// profile that ends where it began closes to a ring.
pub fn revolve(profile: &Curve, segments: u32, uv: Uv) -> Mesh {
    let segments = segments.max(3);
    let mut points = profile.points().to_vec();
    points.dedup();
    let closed = points.len() > 3 && points[0] == points[points.len() - 1];
    let normals = profile_normals(&points, closed);
    let total: f32 = points.windows(2).map(|w| w[0].distance(w[1])).sum();

    let mut mesh = Mesh::default();
    let mut rings: Vec<(u32, bool)> = Vec::with_capacity(points.len());
    let mut walked = 0.0;
    for (k, (&point, &normal)) in points.iter().zip(&normals).enumerate() {
        walked += if k > 0 { point.distance(points[k - 1]) } else { 0.0 };
        if closed && uv == Uv::None && k == points.len() - 1 {
            rings.push(rings[0]);
            break;
        }
        let pole = point.x == 0.0;
        rings.push((mesh.positions.len() as u32, pole));
        let columns = match (uv, pole) {
            (Uv::None, true) => 1,
            (Uv::None, false) | (Uv::Wrapped, true) => segments,
            (Uv::Wrapped, false) => segments + 1,
        };
        for i in 0..columns {
            let (sin, cos) = ((i % segments) as f32 / segments as f32 * TAU).sin_cos();
            let swept = |p: Vec2| Vec3::new(p.x * cos, p.y, p.x * sin);
            mesh.push(swept(point), swept(normal));
            if uv == Uv::Wrapped {
                let middle = if pole { 0.5 } else { 0.0 };
                mesh.uvs.push(Vec2::new(1.0 - (i as f32 + middle) / segments as f32, 1.0 - walked / total));
            }
        }
    }

    let vertex = |(start, pole): (u32, bool), segment: u32, next: u32| match (uv, pole) {
        (Uv::None, true) => start,
        (Uv::Wrapped, true) => start + segment,
        (Uv::None, false) => start + (segment + next) % segments,
        (Uv::Wrapped, false) => start + segment + next,
    };
    for pair in rings.windows(2) {
        for i in 0..segments {
            let [a, b] = [vertex(pair[0], i, 0), vertex(pair[0], i, 1)];
            let [c, d] = [vertex(pair[1], i, 0), vertex(pair[1], i, 1)];
            if !pair[1].1 {
                mesh.faces.push([a, c, d]);
            }
            if !pair[0].1 {
                mesh.faces.push([a, d, b]);
            }
        }
    }
    mesh
}

/// Unit normals to the right of the points of a profile, second order in the spacing.
fn profile_normals(points: &[Vec2], closed: bool) -> Vec<Vec2> {
    let last = points.len() - 1;
    let tangent = |k: usize| {
        let before = if k > 0 { k - 1 } else { last - 1 };
        let after = if k < last { k + 1 } else { 1 };
        let (back, ahead) = (points[k] - points[before], points[after] - points[k]);
        match k {
            0 if !closed => ahead,
            k if k == last && !closed => back,
            _ => back.normalize() * ahead.length() + ahead.normalize() * back.length(),
        }
    };
    (0..points.len())
        .map(|k| {
            let t = tangent(k);
            let normal = Vec2::new(t.y, -t.x);
            let on_axis = points[k].x == 0.0;
            (if on_axis { Vec2::new(0.0, normal.y) } else { normal }).normalize_or(Vec2::Y)
        })
        .collect()
}

/// A closed tube about a plane path (z = 0), with an elliptic cross-section and flat ends.
///
/// `radii` gives, for the fraction 0 to 1 of the path's points, the half axis in the path's plane and the
/// half axis across it. The path must not be shorter than two points.
pub fn tube(path: &Curve, sides: u32, radii: impl Fn(f32) -> Vec2) -> Mesh {
    let sides = sides.max(3);
    let mut points = path.points().to_vec();
    points.dedup();
    let last = points.len() - 1;
    let normals = profile_normals(&points, false);
    let mut mesh = Mesh::default();
    for (k, (&point, &normal)) in points.iter().zip(&normals).enumerate() {
        let radius = radii(k as f32 / last.max(1) as f32);
        for i in 0..sides {
            let (sin, cos) = (i as f32 / sides as f32 * TAU).sin_cos();
            let offset = (normal * radius.x * cos).extend(radius.y * sin);
            // The normal of an ellipse has the half axes swapped.
            let slope = (normal * radius.y * cos).extend(radius.x * sin);
            mesh.push(point.extend(0.0) + offset, slope.normalize());
        }
    }
    for k in 0..last as u32 {
        for i in 0..sides {
            let j = (i + 1) % sides;
            let [a, b] = [k * sides + i, k * sides + j];
            let [c, d] = [a + sides, b + sides];
            mesh.faces.extend([[a, b, d], [a, d, c]]);
        }
    }
    for (ring, forward) in [(0, false), (last, true)] {
        let along = Vec2::new(-normals[ring].y, normals[ring].x).extend(0.0);
        let outward = if forward { along } else { -along };
        let centre = mesh.push(points[ring].extend(0.0), outward);
        let rim: Vec<u32> = (0..sides)
            .map(|i| mesh.push(mesh.positions[ring * sides as usize + i as usize], outward))
            .collect();
        for i in 0..sides as usize {
            let (a, b) = (rim[i], rim[(i + 1) % sides as usize]);
            mesh.faces.push(if forward { [centre, a, b] } else { [centre, b, a] });
        }
    }
    mesh
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
