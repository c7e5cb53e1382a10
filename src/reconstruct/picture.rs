//! The picture of pixels that were traced beside the mesh, as the device draws it: two leaves of a rectangle around them.

use std::ops::Range;

use bytemuck::Zeroable;
use glam::{Vec2, Vec3};

use super::blocks;
use super::leaves::GpuLeaf;
use super::table::Texel;
use crate::constants::LEAF_TRACED;
use crate::pixels::picture::Picture;
use crate::scene::View;

/// Corners of its leaves.
const LEAVES: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

/// The rectangle.
pub struct Quad<'a> {
    picture: &'a Picture,
    view: &'a View,
    /// Its columns, then its rows.
    around: [Range<u32>; 2],
    /// Its corners in the world.
    pub corners: [Vec3; 4],
}

impl<'a> Quad<'a> {
    /// That of `picture`; `None` of an empty one.
    pub fn new(view: &'a View, picture: &'a Picture) -> Option<Self> {
        let around = blocks::around(view, picture.pixels.iter().map(|pixel| pixel.index))?;
        // A pixel farther than it reaches, for its corners are rounded; what is not of it is not drawn.
        let [(left, right), (top, bottom)] =
            [&around[0], &around[1]].map(|range| (range.start as f32 - 1.0, range.end as f32 + 1.0));
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
            .map(|(x, y)| view.at_depth(Vec2::new(x, y), picture.depth));
        Some(Self { picture, view, around, corners })
    }

    /// The corners of its leaves.
    pub fn triangles(&self) -> [[Vec3; 3]; 2] {
        LEAVES.map(|corners| corners.map(|corner| self.corners[corner as usize]))
    }

    /// Its leaves, of four vertices from `first` on; their block is the first of the node table.
    pub fn leaves(&self, first: u32) -> [GpuLeaf; 2] {
        LEAVES.map(|corners| GpuLeaf {
            vertices: corners.map(|corner| first + corner),
            flags: LEAF_TRACED,
            ..GpuLeaf::zeroed()
        })
    }

    /// Their block: the corner and the size of the rectangle in pixels, the radiance of each, two a texel, and, if the picture
    /// has them, the depths, four a texel. Pixels that the picture does not hold are not drawn.
    pub fn texels(&self) -> Vec<Texel> {
        let Self { picture: Picture { pixels, depths, .. }, view, around: [columns, rows], .. } = self;
        let all = columns.len() * rows.len();
        let radiances = all.div_ceil(2);
        let deep = if depths.is_empty() { 0 } else { all.div_ceil(4) };
        let mut texels = vec![Texel::default(); 1 + radiances + deep];
        texels[0] = [columns.start, rows.start, columns.len() as u32, rows.len() as u32];
        let cell = |index: u32| {
            let (x, y) = (index % view.width, index / view.width);
            (y - rows.start) as usize * columns.len() + (x - columns.start) as usize
        };
        for pixel in pixels {
            blocks::put(&mut texels[1..], cell(pixel.index), pixel.radiance);
        }
        for (pixel, depth) in pixels.iter().zip(depths) {
            let cell = cell(pixel.index);
            texels[1 + radiances + cell / 4][cell % 4] = view.depth_value(*depth).to_bits();
        }
        texels
    }
}
