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

    /// Their block: the corner and the size of the rectangle in pixels, then the radiance of each, two a texel. Pixels that
    /// the picture does not hold are not drawn.
    pub fn texels(&self) -> Vec<Texel> {
        let [columns, rows] = &self.around;
        let mut texels = vec![Texel::default(); 1 + (columns.len() * rows.len()).div_ceil(2)];
        texels[0] = [columns.start, rows.start, columns.len() as u32, rows.len() as u32];
        for pixel in &self.picture.pixels {
            let (x, y) = (pixel.index % self.view.width, pixel.index / self.view.width);
            let cell = (y - rows.start) as usize * columns.len() + (x - columns.start) as usize;
            blocks::put(&mut texels[1..], cell, pixel.radiance);
        }
        texels
    }
}
