//! Visible faces from the primary-face codes in the alpha of the finished base image (paper §5; design §3).
//!
//! The image is drawn once in the ordinary way, and what was drawn stays. Alpha is a half, so that a code has
//! [`CODES`] values: a scene of no more faces has a code for each, and the codes alone tell what is visible.
//! In larger scenes several faces share a code and the position decides: every face of that code whose
//! bounds reach the pixel is marked, which is sometimes too much and never too little.

use std::time::{Duration, Instant};

use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::{
    Class, Found, IdImage, Times, VisibleFaces,
    face_draw::faces_of,
    scan::{Scanner, visible_in},
};
use crate::{
    error::Result,
    gpu::{ReadbackMemory, Timing},
    scene::{Scene, View, mesh::meet_plane},
};

/// Number of codes: the positive normal halves, which every device stores exactly.
pub const CODES: u32 = 0x7800;
/// Bits of the first of them.
const FIRST_CODE: u16 = 0x0400;
/// Pixels by which bounds are grown: the rasteriser rounds corners to 1/256.
const MARGIN: f32 = 1.0;

/// The primary-face code of a face that needs samples: the bits of a half. 0 means no such face.
pub fn code(face: u32) -> u16 {
    FIRST_CODE + (face % CODES) as u16
}

/// A base image as it was read back.
#[derive(Debug)]
pub struct CodedImage<'a> {
    /// Red, green, blue and code, the bits of halves, row by row from the top.
    pub pixels: &'a [[u16; 4]],
    /// What the device says it took: `base image` and `copy`.
    pub timings: Vec<Timing>,
    /// Time until the host could read.
    pub until_read: Duration,
    /// The last part of it: making the staging buffer readable.
    pub map: Duration,
    /// Kind of memory that it was read from.
    pub memory: ReadbackMemory,
}

/// Recovers the faces of one scene from coded images; keeps its buffers from frame to frame.
pub struct Recovery<'s> {
    scene: &'s Scene,
    classes: Vec<Class>,
    /// Where each face is in the image: left, top, right, bottom; only where faces share codes.
    bounds: Vec<Vec4>,
    ids: Vec<u32>,
    scanner: Scanner,
    faces: VisibleFaces,
    marked: Vec<u32>,
}

impl<'s> Recovery<'s> {
    /// For `scene` with a class for each object.
    pub fn new(scene: &'s Scene, classes: &[Class]) -> Self {
        Self {
            scene,
            classes: classes.to_vec(),
            bounds: Vec::new(),
            ids: Vec::new(),
            scanner: Scanner::default(),
            faces: VisibleFaces::default(),
            marked: Vec::new(),
        }
    }

    /// Finds the visible faces of `view` in the base image that `draw` makes.
    ///
    /// A pixel counts for the nearest face of its code at the pixel's centre; other faces of that code there
    /// are found visible too, with no pixels.
    ///
    /// # Errors
    /// Those of `draw`.
    pub fn run<'i>(
        &mut self,
        view: &View,
        draw: impl FnOnce() -> Result<CodedImage<'i>>,
    ) -> Result<Found<'_>> {
        let image = draw()?;
        let start = Instant::now();
        self.recover(view, image.pixels);
        let scan = start.elapsed();
        Ok(Found {
            visible: &self.marked,
            faces: &self.faces,
            ids: Some(IdImage { width: view.width, height: view.height, pixels: &self.ids }),
            visible_vt: visible_in(&self.marked, &faces_of(self.scene, &self.classes, Class::Vt)),
            times: Times::new("base image", &image.timings, image.until_read, scan).with_map(image.map),
            readback_bytes: size_of_val(image.pixels) as u64,
            readback_memory: image.memory,
        })
    }

    fn recover(&mut self, view: &View, pixels: &[[u16; 4]]) {
        let faces = self.scene.geometry.faces.len();
        self.bounds.clear();
        if faces > CODES as usize {
            let mut bounds = std::mem::take(&mut self.bounds);
            let faces = (0..faces as u32).into_par_iter();
            faces.map(|face| self.bounds_of(view, face)).collect_into_vec(&mut bounds);
            self.bounds = bounds;
        }
        let mut ids = std::mem::take(&mut self.ids);
        ids.clear();
        ids.resize(pixels.len(), 0);
        let width = view.width.max(1) as usize;
        let rows = ids.par_chunks_mut(width).zip(pixels.par_chunks(width)).enumerate();
        let others: Vec<Vec<u32>> = rows.map(|(y, (ids, row))| self.recover_row(view, y, row, ids)).collect();
        self.ids = ids;
        self.scanner.scan(&self.ids, faces, &mut self.faces);
        self.marked.clone_from(&self.faces.visible);
        self.marked.extend(others.into_iter().flatten());
        self.marked.sort_unstable();
        self.marked.dedup();
    }

    /// Sets the `ids` of one row; returns the faces of runs where the code leaves a choice.
    fn recover_row(&self, view: &View, y: usize, row: &[[u16; 4]], ids: &mut [u32]) -> Vec<u32> {
        let mut others = Vec::new();
        let mut candidates = Vec::new();
        let mut x = 0;
        for run in row.chunk_by(|a, b| a[3] == b[3]) {
            let ids = &mut ids[x..x + run.len()];
            if let Some(first) = run[0][3].checked_sub(FIRST_CODE) {
                candidates.clear();
                self.candidates(first.into(), x..x + run.len(), y, &mut candidates);
                match candidates[..] {
                    [] => {}
                    [face] => ids.fill(self.id(face)),
                    _ => {
                        for (x, id) in (x..).zip(ids) {
                            let centre = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                            *id = self.id(self.nearest(view, centre, &candidates));
                        }
                        others.extend(&candidates);
                    }
                }
            }
            x += run.len();
        }
        others
    }

    /// Faces of a code that reach pixels `columns` of row `y`; all of that code if none seems to.
    fn candidates(&self, first: u32, columns: std::ops::Range<usize>, y: usize, found: &mut Vec<u32>) {
        let faces = self.scene.geometry.faces.len() as u32;
        if self.bounds.is_empty() {
            found.extend((first < faces).then_some(first));
            return;
        }
        let same =
            || (first..faces).step_by(CODES as usize).filter(|&face| self.class(face) != Class::Occluder);
        found.extend(same().filter(|&face| {
            let bounds = self.bounds[face as usize];
            bounds.x < columns.end as f32
                && bounds.z > columns.start as f32
                && bounds.y < y as f32 + 1.0
                && bounds.w > y as f32
        }));
        if found.is_empty() {
            found.extend(same());
        }
    }

    fn bounds_of(&self, view: &View, face: u32) -> Vec4 {
        let (everywhere, nowhere) = (f32::INFINITY, Vec4::new(f32::MAX, f32::MAX, f32::MIN, f32::MIN));
        if self.class(face) == Class::Occluder || self.surely_culled(view, face) {
            return nowhere;
        }
        let corners = self.scene.geometry.corners(face).map(|corner| view.project(corner));
        let [Some((a, _)), Some((b, _)), Some((c, _))] = corners else {
            return Vec4::new(-everywhere, -everywhere, everywhere, everywhere);
        };
        let (low, high) = (a.min(b).min(c) - MARGIN, a.max(b).max(c) + MARGIN);
        Vec4::new(low.x, low.y, high.x, high.y)
    }

    fn surely_culled(&self, view: &View, face: u32) -> bool {
        /// Cosine below which rounding may decide.
        const GRAZING: f32 = 1e-3;
        let normal = self.scene.geometry.area_normal(face);
        let direction = view.direction_to(self.scene.geometry.corners(face)[0]);
        let is_grazing = normal.dot(direction).abs() <= GRAZING * normal.length();
        !is_grazing && self.scene.face_material(face).culls(normal, direction)
    }

    /// The candidate that shows at an image point: the nearest that covers it, else the least far off it.
    fn nearest(&self, view: &View, centre: Vec2, candidates: &[u32]) -> u32 {
        /// Barycentric distance at which a face still covers a point.
        const SLACK: f32 = 1e-3;
        let ray = view.ray(centre);
        let rank = |face: u32| {
            let (off, distance) = meet(self.scene.geometry.corners(face), ray);
            if off <= SLACK { (0.0, distance) } else { (off, distance) }
        };
        let order = |a: &(f32, f32), b: &(f32, f32)| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1));
        let ranked = candidates.iter().map(|&face| (rank(face), face));
        ranked.min_by(|a, b| order(&a.0, &b.0)).map_or(0, |(_, face)| face)
    }

    fn class(&self, face: u32) -> Class {
        self.classes[self.scene.geometry.face_objects[face as usize] as usize]
    }

    /// As the ID buffer has it.
    fn id(&self, face: u32) -> u32 {
        u32::from(self.class(face).code()) << 24 | (face + 1)
    }
}

/// How far off a triangle a ray meets its plane, in barycentric coordinates (0 inside), and at what distance.
fn meet(corners: [Vec3; 3], ray: (Vec3, Vec3)) -> (f32, f32) {
    const NOWHERE: (f32, f32) = (f32::MAX, f32::MAX);
    let Some((t, weights)) = meet_plane(corners, ray) else { return NOWHERE };
    let off = (-weights.x).max(-weights.y).max(weights.element_sum() - 1.0).max(0.0);
    if t > 0.0 && off.is_finite() { (off, t) } else { NOWHERE }
}

#[cfg(test)]
mod tests {
    use half::f16;

    use super::*;

    #[test]
    fn codes_are_distinct_normal_halves() {
        let bits: Vec<u16> = (0..CODES).map(code).collect();
        assert!(bits.windows(2).all(|pair| pair[0] < pair[1]));
        assert!(bits.iter().all(|&bits| f16::from_bits(bits).is_normal()));
        assert_eq!(code(CODES + 7), code(7));
    }

    #[test]
    fn rays_meet_triangles() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        assert_eq!(meet(corners, (Vec3::new(0.25, 0.25, 2.0), Vec3::NEG_Z)), (0.0, 2.0));
        assert_eq!(meet(corners, (Vec3::new(1.5, 0.0, 2.0), Vec3::NEG_Z)), (0.5, 2.0));
        assert_eq!(meet(corners, (Vec3::new(0.2, 0.2, -1.0), Vec3::NEG_Z)).0, f32::MAX, "behind");
    }
}
