//! Pictures of the method's data in place of the image (`--show`).

use glam::{Mat3, Vec2, Vec3, Vec4};
use rayon::prelude::*;

use crate::options::Show;
use crate::refine::mesh::Mesh;
use crate::refine::samples::Samples;
use crate::report::image::{FloatImage, srgb_decode};
use crate::scene::{Scene, View};

/// What a leaf of the refined mesh is to the reconstruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LeafKind {
    /// All its vertices see the same (paper, Fig. 5).
    Defined,
    /// They do not (paper, Fig. 6).
    Undefined,
    /// Its pixels were traced one by one.
    Traced,
    /// A diffuse face that is sampled for its shadows alone.
    Receiver,
}

/// The data of one frame.
#[derive(Clone, Copy)]
pub struct FrameData<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The frame's view.
    pub view: &'a View,
    /// The refined mesh.
    pub mesh: &'a Mesh,
    /// The samples of its vertices.
    pub samples: &'a Samples,
    /// The face that each pixel shows, if it is sampled: column and row in, face of the scene out.
    pub face_at: &'a (dyn Fn(u32, u32) -> Option<u32> + Sync),
    /// Predicted displacement of what each leaf reflects, in pixels.
    pub displacement: &'a (dyn Fn(u32) -> f32 + Sync),
    /// What each leaf is.
    pub kind: &'a (dyn Fn(u32) -> LeafKind + Sync),
}

/// How much of the image is left where a picture shows nothing of its own.
const DIMMED: f32 = 0.25;

/// A picture over the image: colours with their coverage in w.
#[derive(Debug, Clone)]
pub struct Overlay {
    width: u32,
    pixels: Vec<Vec4>,
    dimmed: f32,
}

impl Overlay {
    /// The overlay on `image`, which is of the same size.
    pub fn over(&self, image: &FloatImage) -> FloatImage {
        let blend = |(below, above): (&[f32; 3], &Vec4)| {
            let below = Vec3::from(*below).clamp(Vec3::ZERO, Vec3::ONE) * self.dimmed;
            below.lerp(above.truncate(), above.w).to_array()
        };
        let pixels = image.pixels.iter().zip(&self.pixels).map(blend).collect();
        FloatImage { width: image.width, height: image.height, pixels }
    }

    fn from_fn(view: &View, pixel: impl Fn(u32, u32) -> Option<Vec3> + Sync) -> Self {
        let pixels = (0..view.pixels() as u32)
            .into_par_iter()
            .with_min_len(1024)
            .map(|i| pixel(i % view.width, i / view.width).map_or(Vec4::ZERO, |color| color.extend(1.0)))
            .collect();
        Self { width: view.width, pixels, dimmed: DIMMED }
    }
}

/// The picture that `show` asks for.
pub fn overlay(show: Show, data: &FrameData) -> Overlay {
    let FrameData { scene, view, .. } = *data;
    match show {
        Show::Faces => faces(data),
        Show::Samples => samples(data),
        Show::Error => Overlay::from_fn(view, |x, y| {
            let (base, leaf) = data.leaf_at(x, y)?;
            scene.is_vt(base).then(|| ramp(doublings((data.displacement)(leaf))))
        }),
        Show::Depth => Overlay::from_fn(view, |x, y| {
            let (base, leaf) = data.leaf_at(x, y)?;
            scene.is_vt(base).then(|| ramp(data.bounces(x, y, leaf)))
        }),
        Show::Ids => {
            let ids = Overlay::from_fn(view, |x, y| (data.face_at)(x, y).map(hashed_color));
            Overlay { dimmed: 0.0, ..ids }
        }
        Show::VtMask => {
            let is_vt = |x, y| (data.face_at)(x, y).is_some_and(|face| scene.is_vt(face));
            let mask = Overlay::from_fn(view, |x, y| is_vt(x, y).then_some(Vec3::ONE));
            Overlay { dimmed: 0.0, ..mask }
        }
    }
}

impl FrameData<'_> {
    /// Direction from the eye through a pixel's centre, as [`Mesh::images`] has it.
    fn image_vector(&self, x: u32, y: u32) -> Vec3 {
        let (origin, direction) = self.view.ray(Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
        if self.view.orthographic { self.mesh.image_of(origin) } else { direction }
    }

    /// The face of the scene and the leaf that a pixel shows.
    fn leaf_at(&self, x: u32, y: u32) -> Option<(u32, u32)> {
        let base = (self.face_at)(x, y)?;
        Some((base, self.mesh.leaf_at(base, self.image_vector(x, y))?))
    }

    /// Number of specular bounces of the longest path, interpolated over a leaf.
    fn bounces(&self, x: u32, y: u32, leaf: u32) -> f32 {
        let corners = self.mesh.faces[leaf as usize].corners;
        let images = corners.map(|v| self.mesh.image(v));
        let longest = corners
            .map(|v| self.samples.get(v).nodes.iter().map(|node| node.bounces).max().map_or(0.0, f32::from));
        let weights = Mat3::from_cols(images[0], images[1], images[2]).inverse() * self.image_vector(x, y);
        let weights = weights.max(Vec3::ZERO);
        let sum = weights.element_sum();
        if sum > 0.0 && sum.is_finite() { weights.dot(Vec3::from(longest)) / sum } else { longest[0] }
    }
}

/// Leaves coloured by kind, with their edges.
fn faces(data: &FrameData) -> Overlay {
    let leaves: Vec<Option<u32>> = (0..data.view.pixels() as u32)
        .into_par_iter()
        .with_min_len(1024)
        .map(|i| data.leaf_at(i % data.view.width, i / data.view.width).map(|(_, leaf)| leaf))
        .collect();
    let kinds: Vec<Option<LeafKind>> = (0..data.mesh.faces.len() as u32)
        .into_par_iter()
        .map(|face| data.mesh.faces[face as usize].is_leaf().then(|| (data.kind)(face)))
        .collect();
    let at = |x: u32, y: u32| leaves[(y * data.view.width + x) as usize];
    Overlay::from_fn(data.view, |x, y| {
        let leaf = at(x, y)?;
        let color = match kinds[leaf as usize]? {
            LeafKind::Defined => color(0x4f, 0x9d, 0x69),
            LeafKind::Undefined => color(0xd9, 0x8e, 0x32),
            LeafKind::Traced => color(0xc0, 0x39, 0x4b),
            LeafKind::Receiver => color(0x4a, 0x5d, 0x78),
        };
        let differs = |x: u32, y: u32| x < data.view.width && y < data.view.height && at(x, y) != Some(leaf);
        Some(if differs(x + 1, y) || differs(x, y + 1) { color * 0.25 } else { color })
    })
}

/// A dot for each sample that is not hidden: primary vertices large and yellow, refined ones small.
fn samples(data: &FrameData) -> Overlay {
    let mut overlay = Overlay::from_fn(data.view, |_, _| None);
    let (width, height) = (data.view.width as i32, data.view.height as i32);
    let mut dot = |centre: Vec2, radius: i32, color: Vec3| {
        let (column, row) = (centre.x.floor() as i32, centre.y.floor() as i32);
        for y in (row - radius).max(0)..(row + radius + 1).min(height) {
            for x in (column - radius).max(0)..(column + radius + 1).min(width) {
                overlay.pixels[y as usize * overlay.width as usize + x as usize] = color.extend(1.0);
            }
        }
    };
    let shows = |pixel: Vec2, base: u32| {
        // A vertex lies on the border of its faces: any face of its object beside it will do.
        let object = data.scene.geometry.face_objects[base as usize];
        let near = |x: f32, y: f32| {
            let inside = x >= 0.0 && y >= 0.0 && x < width as f32 && y < height as f32;
            let face = inside.then(|| (data.face_at)(x as u32, y as u32)).flatten();
            face.is_some_and(|face| data.scene.geometry.face_objects[face as usize] == object)
        };
        [(0.0, 0.0), (-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)]
            .into_iter()
            .any(|(x, y)| near(pixel.x + x, pixel.y + y))
    };
    let primary = |vertex: &crate::refine::mesh::Vertex| vertex.parents[0] == crate::refine::mesh::NONE;
    for wanted in [false, true] {
        let vertices = data.mesh.vertices.iter().filter(|&vertex| primary(vertex) == wanted);
        for vertex in vertices {
            let position = data.mesh.points[vertex.point as usize];
            let Some((pixel, _)) = data.view.project(position) else { continue };
            let towards = vertex.geometric.dot(data.view.direction_to(position));
            let faces_eye = (towards > 0.0) == vertex.back;
            if faces_eye && shows(pixel, vertex.base) {
                let vt = data.scene.is_vt(vertex.base);
                match (wanted, vt) {
                    (true, _) => dot(pixel, 1, color(0xff, 0xd0, 0x30)),
                    (false, true) => dot(pixel, 0, Vec3::ONE),
                    (false, false) => dot(pixel, 0, color(0x7a, 0xa8, 0xe0)),
                }
            }
        }
    }
    overlay
}

/// Steps of [`ramp`] for a displacement in pixels: none, a quarter, a half, 1, 2, 4 and more.
fn doublings(pixels: f32) -> f32 {
    const FIRST: f32 = 0.25;
    if pixels > FIRST { 1.0 + (pixels / FIRST).log2() } else { pixels / FIRST }
}

/// A number of steps, 0 to 5, from dark to bright: none, then blue, green, yellow, orange, red.
fn ramp(bounces: f32) -> Vec3 {
    const STOPS: [[u8; 3]; 6] =
        [[24, 24, 28], [44, 92, 160], [62, 158, 120], [228, 200, 72], [224, 128, 48], [190, 44, 52]];
    let at = bounces.clamp(0.0, (STOPS.len() - 1) as f32);
    let low = (at as usize).min(STOPS.len() - 2);
    let [from, to] = [STOPS[low], STOPS[low + 1]].map(|[r, g, b]| color(r, g, b));
    from.lerp(to, at - low as f32)
}

/// A colour that tells a face from its neighbours: bits of a hash (Steele and Vigna's mixer).
fn hashed_color(face: u32) -> Vec3 {
    let mut h = u64::from(face).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    h = (h ^ h >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let [r, g, b, ..] = (h ^ h >> 27).to_le_bytes();
    color(r | 0x30, g | 0x30, b | 0x30)
}

/// The linear colour of sRGB bytes.
fn color(r: u8, g: u8, b: u8) -> Vec3 {
    Vec3::from([r, g, b].map(|byte| srgb_decode(f32::from(byte) / 255.0)))
}
