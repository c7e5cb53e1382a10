//! Vertices and faces of one object while it is put together.

use std::collections::HashMap;

use glam::{DVec3, Vec2, Vec3, Vec4};
use gltf::json::Root;
use gltf::json::accessor::Type;
use gltf::json::mesh::{Primitive, Semantic};

use super::accessor::Reader;
use super::buffers::Buffers;
use super::deform::Vertices;
use super::tangents;
use super::triangles::attribute;
use crate::scene::camera::relative;
use crate::scene::mesh::MAX_REACH;
use crate::scene::{Geometry, TextureSlot};

/// Parallel vertex arrays, and faces over them.
pub struct Piece {
    /// The vertex of the primitive that each vertex came from.
    sources: Vec<u32>,
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    tangents: Vec<Vec4>,
    /// Counter-clockwise faces.
    pub faces: Vec<[u32; 3]>,
}

/// How many faces cannot be drawn, and why.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Those without area.
    pub without_area: usize,
    /// Those with a vertex that is NaN or infinite, or is so once placed.
    pub not_finite: usize,
}

/// Attributes that need no transform.
pub struct Attributes<'a> {
    uvs: [Option<Reader<'a>>; 2],
    colors: Option<Reader<'a>>,
}

impl<'a> Attributes<'a> {
    /// Texture coordinates and colours of `primitive`.
    pub fn of(root: &Root, buffers: &'a Buffers, primitive: &Primitive) -> Self {
        let read = |semantic| attribute(primitive, semantic).and_then(|it| Reader::new(root, buffers, it));
        Self {
            uvs: [read(Semantic::TexCoords(0)), read(Semantic::TexCoords(1))],
            colors: read(Semantic::Colors(0)),
        }
    }

    /// Texture coordinates of a vertex, zero where there are none.
    fn uv(&self, set: u8, vertex: u32) -> Vec2 {
        let reader = self.uvs[usize::from(set)].as_ref();
        reader.map_or(Vec2::ZERO, |reader| Vec2::from_array(reader.floats(vertex as usize)))
    }
}

impl Piece {
    /// Places the vertices that `faces` use, relative to `origin`, and turns the faces that a mirroring
    /// transform has turned inside out. Fails with the number of a joint that the skin does not have.
    pub fn place(vertices: &Vertices, mut faces: Vec<[u32; 3]>, origin: DVec3) -> Result<Self, u32> {
        let sources = compact(&mut faces);
        let mut positions = Vec::with_capacity(sources.len());
        let mut mirrored = Vec::with_capacity(sources.len());
        for &source in &sources {
            let frame = vertices.frame(source as usize)?;
            positions.push(relative(vertices.position(source as usize, &frame), origin));
            mirrored.push(frame.sign < 0.0);
        }
        for face in faces.iter_mut().filter(|face| mirrored[face[0] as usize]) {
            face.swap(1, 2);
        }
        Ok(Self { sources, positions, normals: Vec::new(), tangents: Vec::new(), faces })
    }

    /// The largest coordinate beyond what single precision can square, if there is one. Vertices at no finite place
    /// do not count: their faces are dropped.
    pub fn beyond_reach(&self) -> Option<f32> {
        let used = self.faces.iter().flatten().map(|&v| self.positions[v as usize]);
        let largest =
            used.filter(|position| position.is_finite()).map(|position| position.abs().max_element());
        largest.reduce(f32::max).filter(|&largest| largest > MAX_REACH)
    }

    /// Drops the faces that cannot be drawn and returns how many they were.
    pub fn drop_degenerate(&mut self) -> Dropped {
        let mut dropped = Dropped::default();
        let positions = &self.positions;
        self.faces.retain(|face| {
            let normal = area_normal(positions, *face);
            let is_placed = face.iter().all(|&v| positions[v as usize].is_finite());
            let has_area = normal.is_finite() && normal != Vec3::ZERO;
            dropped.not_finite += usize::from(!is_placed);
            dropped.without_area += usize::from(is_placed && !has_area);
            is_placed && has_area
        });
        if dropped != Dropped::default() {
            let kept = compact(&mut self.faces);
            self.select(&kept);
        }
        dropped
    }

    /// Gives every vertex a unit normal: the file's; for a primitive without normals the face's, with no
    /// vertex shared (§3.7.2.1); for one without direction that of a face at it. Returns how often the last.
    pub fn shade(&mut self, vertices: &Vertices) -> Result<usize, u32> {
        if !vertices.has_normals() {
            let corners: Vec<u32> = self.faces.iter().flatten().copied().collect();
            self.select(&corners);
            self.faces =
                (0..corners.len() as u32 / 3).map(|face| [3 * face, 3 * face + 1, 3 * face + 2]).collect();
            let flat = self.faces.iter().flat_map(|face| [face_normal(&self.positions, *face); 3]);
            self.normals = flat.collect();
            return Ok(0);
        }
        let mut missing = 0;
        self.normals.reserve_exact(self.sources.len());
        for &source in &self.sources {
            let frame = vertices.frame(source as usize)?;
            let normal = vertices.normal(source as usize, &frame);
            missing += usize::from(normal.is_none());
            self.normals.push(normal.unwrap_or(Vec3::ZERO));
        }
        if missing > 0 {
            for face in &self.faces {
                for &vertex in face {
                    let normal = &mut self.normals[vertex as usize];
                    if *normal == Vec3::ZERO {
                        *normal = face_normal(&self.positions, *face);
                    }
                }
            }
        }
        Ok(missing)
    }

    /// Gives every vertex a tangent for the normal map in `slot`, splitting vertices where it is mirrored.
    ///
    /// `effort_left` is what may be spent on making tangents; returns false if that was not enough, and
    /// tangents of no particular direction were given.
    pub fn orient(
        &mut self,
        vertices: &Vertices,
        attributes: &Attributes,
        slot: TextureSlot,
        effort_left: &mut u64,
    ) -> Result<bool, u32> {
        if vertices.has_tangents() {
            for (&source, &normal) in self.sources.iter().zip(&self.normals) {
                let frame = vertices.frame(source as usize)?;
                let tangent = vertices.tangent(source as usize, &frame);
                self.tangents.push(tangent.unwrap_or_else(|| tangents::any_tangent(normal)));
            }
            return Ok(true);
        }
        let Some(rest) = effort_left.checked_sub(tangents::effort(&self.positions, &self.faces)) else {
            self.tangents = self.normals.iter().map(|&normal| tangents::any_tangent(normal)).collect();
            return Ok(false);
        };
        *effort_left = rest;
        let uv = |&source: &u32| finite(slot.transform(attributes.uv(slot.uv_set, source)));
        let uvs: Vec<Vec2> = self.sources.iter().map(uv).collect();
        let corners = tangents::generate(&self.positions, &self.normals, &uvs, &self.faces);
        let mut numbers: HashMap<(u32, [u32; 4]), u32> = HashMap::new();
        let (mut kept, mut split) = (Vec::new(), Vec::new());
        for (face, tangents) in self.faces.iter_mut().zip(corners) {
            for (vertex, tangent) in face.iter_mut().zip(tangents) {
                let key = (*vertex, tangent.to_array().map(f32::to_bits));
                *vertex = *numbers.entry(key).or_insert_with(|| {
                    kept.push(key.0);
                    split.push(tangent);
                    kept.len() as u32 - 1
                });
            }
        }
        self.select(&kept);
        self.tangents = split;
        Ok(true)
    }

    /// Appends the piece to `geometry` as object `object`; returns how many attribute values it repaired.
    pub fn append(self, geometry: &mut Geometry, attributes: &Attributes, object: u32) -> usize {
        let start = geometry.positions.len();
        let mut repaired = 0;
        for (set, uvs) in geometry.uvs.iter_mut().enumerate() {
            if attributes.uvs[set].is_some() {
                uvs.resize(start, Vec2::ZERO);
                uvs.extend(self.sources.iter().map(|&source| {
                    let uv = attributes.uv(set as u8, source);
                    repaired += usize::from(!uv.is_finite());
                    finite(uv)
                }));
            }
        }
        if let Some(reader) = &attributes.colors {
            geometry.colors.resize(start, Vec4::ONE);
            geometry.colors.extend(self.sources.iter().map(|&source| {
                let mut color = Vec4::from_array(reader.floats(source as usize));
                if reader.format().kind == Type::Vec3 {
                    color.w = 1.0;
                }
                let color_in_range =
                    if color.is_nan() { Vec4::ONE } else { color.clamp(Vec4::ZERO, Vec4::ONE) };
                repaired += usize::from(color != color_in_range);
                color_in_range
            }));
        }
        if !self.tangents.is_empty() {
            geometry.tangents.resize(start, NEUTRAL_TANGENT);
            geometry.tangents.extend(self.tangents);
        }
        geometry.faces.extend(self.faces.iter().map(|face| face.map(|vertex| vertex + start as u32)));
        geometry.face_objects.resize(geometry.faces.len(), object);
        geometry.positions.extend(self.positions);
        geometry.normals.extend(self.normals);
        repaired
    }

    /// Makes vertex `i` what vertex `kept[i]` was.
    fn select(&mut self, kept: &[u32]) {
        fn pick<T: Copy>(array: &mut Vec<T>, kept: &[u32]) {
            if !array.is_empty() {
                *array = kept.iter().map(|&vertex| array[vertex as usize]).collect();
            }
        }
        pick(&mut self.sources, kept);
        pick(&mut self.positions, kept);
        pick(&mut self.normals, kept);
        pick(&mut self.tangents, kept);
    }
}

const NEUTRAL_TANGENT: Vec4 = Vec4::new(1.0, 0.0, 0.0, 1.0);

/// Brings the optional attributes that some object has to full length.
pub fn pad(geometry: &mut Geometry) {
    let length = geometry.positions.len();
    for uvs in geometry.uvs.iter_mut().filter(|uvs| !uvs.is_empty()) {
        uvs.resize(length, Vec2::ZERO);
    }
    if !geometry.colors.is_empty() {
        geometry.colors.resize(length, Vec4::ONE);
    }
    if !geometry.tangents.is_empty() {
        geometry.tangents.resize(length, NEUTRAL_TANGENT);
    }
}

/// Numbers the vertices that `faces` use from 0 on, in ascending order, and returns their old numbers.
fn compact(faces: &mut [[u32; 3]]) -> Vec<u32> {
    let corners = faces.len() * 3;
    let highest = faces.iter().flatten().copied().max().unwrap_or(0) as usize;
    // A table for the usual case; a few indices far apart must not cost one of the size of their distance.
    if highest < 4 * corners {
        let mut numbers = vec![0_u32; highest + 1];
        faces.iter().flatten().for_each(|&vertex| numbers[vertex as usize] = 1);
        let mut kept = Vec::new();
        for (vertex, number) in numbers.iter_mut().enumerate().filter(|(_, number)| **number == 1) {
            *number = kept.len() as u32;
            kept.push(vertex as u32);
        }
        faces.iter_mut().flatten().for_each(|vertex| *vertex = numbers[*vertex as usize]);
        return kept;
    }
    let mut kept: Vec<u32> = faces.iter().flatten().copied().collect();
    kept.sort_unstable();
    kept.dedup();
    for vertex in faces.iter_mut().flatten() {
        *vertex = kept.partition_point(|&other| other < *vertex) as u32;
    }
    kept
}

fn area_normal(positions: &[Vec3], face: [u32; 3]) -> Vec3 {
    let [a, b, c] = face.map(|vertex| positions[vertex as usize]);
    (b - a).cross(c - a)
}

/// Unit normal of a face that has an area, however small: `f32` would underflow on the way.
fn face_normal(positions: &[Vec3], face: [u32; 3]) -> Vec3 {
    let [a, b, c] = face.map(|vertex| positions[vertex as usize].as_dvec3());
    (b - a).cross(c - a).try_normalize().unwrap_or(DVec3::Z).as_vec3()
}

fn finite(uv: Vec2) -> Vec2 {
    if uv.is_finite() { uv } else { Vec2::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn compacting_near_and_far() {
        let mut near = [[4, 2, 6], [6, 2, 7]];
        assert_eq!(compact(&mut near), [2, 4, 6, 7]);
        assert_eq!(near, [[1, 0, 2], [2, 0, 3]]);
        let mut far = [[4_000_000_000, 2, 6], [6, 2, 7]];
        assert_eq!(compact(&mut far), [2, 6, 7, 4_000_000_000]);
        assert_eq!(far, [[3, 0, 1], [1, 0, 2]]);
        assert!(compact(&mut []).is_empty());
    }
}
