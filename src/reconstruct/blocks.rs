//! Traced pixels as the device reads them: a small rectangle of radiances for each leaf that they cover.

use std::ops::Range;

use rustc_hash::FxHashMap;

use super::table::Texel;
use crate::pixels::HalfRadiance;
use crate::pixels::leaves::TracedPixel;
use crate::refine::footprint::{Footprint, TOUCHED};
use crate::refine::mesh::Mesh;
use crate::scene::View;

/// No traced pixel.
const NONE: u32 = u32::MAX;

/// Traced pixels, and where they are.
pub struct Blocks<'a> {
    view: &'a View,
    mesh: &'a Mesh,
    traced: &'a [TracedPixel],
    /// The rectangle around them: columns, then rows.
    around: [Range<u32>; 2],
    /// By pixel of it: place in `traced`, or [`NONE`].
    by_pixel: Vec<u32>,
    /// Where in `traced` the pixels of each leaf are.
    by_face: FxHashMap<u32, Range<usize>>,
}

/// The pixels around a pixel, the nearest first; of equally near ones, row by row.
const AROUND: [(i32, i32); 8] = [(0, -1), (-1, 0), (1, 0), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];

/// A leaf that is traced.
struct Leaf<'a> {
    face: u32,
    /// The scene's face that it is part of.
    base: u32,
    footprint: Footprint,
    /// Its traced pixels.
    own: &'a [TracedPixel],
}

impl<'a> Blocks<'a> {
    /// Blocks of leaves of `mesh` whose pixels are `traced`, those of one leaf together.
    pub fn new(view: &'a View, mesh: &'a Mesh, traced: &'a [TracedPixel]) -> Self {
        let around = around(view, traced.iter().map(|pixel| pixel.index)).unwrap_or_default();
        let by_pixel = vec![NONE; around[0].len() * around[1].len()];
        let mut by_face = FxHashMap::default();
        let mut start = 0;
        for pixels in traced.chunk_by(|a, b| a.face == b.face) {
            by_face.insert(pixels[0].face, start..start + pixels.len());
            start += pixels.len();
        }
        let mut blocks = Self { view, mesh, traced, around, by_pixel, by_face };
        for (pixel, number) in traced.iter().zip(0..) {
            let (x, y) = (pixel.index % view.width, pixel.index / view.width);
            let cell = blocks.cell(x, y).expect("the rectangle is around all");
            blocks.by_pixel[cell] = number;
        }
        blocks
    }

    /// Appends the block of leaf `face`: the corner and the size of the rectangle of pixels around it, then these as halves,
    /// two a texel. `None`, and nothing is appended, if near some pixel of it none is traced.
    ///
    /// Where a leaf reaches into a pixel whose centre it does not cover, sub-samples find a colour too: that of
    /// the nearest traced pixel of this leaf; if it has none, of one beside that pixel, or any near the leaf. A pixel of a
    /// neighbour on the same face of the scene serves for itself: where its centre lies on their edge, the device may give
    /// it to either.
    pub fn append(&self, face: u32, texels: &mut Vec<Texel>) -> Option<()> {
        let leaf = Leaf {
            face,
            base: self.mesh.faces[face as usize].base,
            footprint: Footprint::new(self.mesh, self.view, face),
            own: self.by_face.get(&face).map_or(&[], |range| &self.traced[range.clone()]),
        };
        let Footprint { columns, rows, .. } = &leaf.footprint;
        let head = texels.len();
        texels.push([columns.start, rows.start, columns.len() as u32, rows.len() as u32]);
        let start = texels.len();
        texels.resize(start + leaf.footprint.len().div_ceil(2), Texel::default());
        let mut touched = (0..).zip(rows.clone()).flat_map(|(row, y)| {
            let cell = move |x| (row * columns.len() + (x - columns.start) as usize, x, y);
            leaf.footprint.span(y, TOUCHED).map(cell)
        });
        let filled = touched.try_fold(0, |filled, (cell, x, y)| {
            put(&mut texels[start..], cell, self.shown(&leaf, x, y)?.radiance);
            Some(filled + 1)
        });
        if filled.is_none_or(|filled| filled == 0) {
            texels.truncate(head);
            return None;
        }
        Some(())
    }

    /// Place of a pixel in the rectangle.
    fn cell(&self, x: u32, y: u32) -> Option<usize> {
        let [columns, rows] = &self.around;
        let within = columns.contains(&x) && rows.contains(&y);
        within.then(|| (y - rows.start) as usize * columns.len() + (x - columns.start) as usize)
    }

    fn at(&self, x: u32, y: u32) -> Option<&TracedPixel> {
        self.traced.get(self.by_pixel[self.cell(x, y)?] as usize)
    }

    /// The traced pixel that `leaf` shows at a pixel.
    fn shown(&self, leaf: &Leaf<'a>, x: u32, y: u32) -> Option<&TracedPixel> {
        let is_usable = |pixel: &&TracedPixel| leaf.own.is_empty() || pixel.face == leaf.face;
        if let Some(pixel) = self.at(x, y)
            && (self.mesh.faces[pixel.face as usize].base == leaf.base || is_usable(&pixel))
        {
            return Some(pixel);
        }
        let Footprint { columns, rows, .. } = &leaf.footprint;
        let beside = AROUND.iter().find_map(|&(dx, dy)| {
            let (x, y) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
            let within = columns.contains(&x) && rows.contains(&y);
            within.then(|| self.at(x, y)).flatten().filter(is_usable)
        });
        let far = |pixel: &&TracedPixel| {
            let (u, v) = (pixel.index % self.view.width, pixel.index / self.view.width);
            u.abs_diff(x).pow(2) + v.abs_diff(y).pow(2)
        };
        let nearest = || leaf.own.iter().min_by_key(far);
        // Of a leaf without a pixel next to nothing shows.
        let any = || rows.clone().find_map(|y| columns.clone().find_map(|x| self.at(x, y)));
        beside.or_else(nearest).or_else(any)
    }
}

/// The rectangle around pixels: columns, then rows; `None` without any.
pub fn around(view: &View, pixels: impl Iterator<Item = u32>) -> Option<[Range<u32>; 2]> {
    let (mut low, mut high) = ([u32::MAX; 2], [0; 2]);
    for index in pixels {
        let at = [index % view.width, index / view.width];
        (low, high) = ([0, 1].map(|i| low[i].min(at[i])), [0, 1].map(|i| high[i].max(at[i] + 1)));
    }
    (high[0] > 0).then(|| [0, 1].map(|i| low[i]..high[i]))
}

/// Writes a cell of a block.
pub fn put(texels: &mut [Texel], cell: usize, HalfRadiance([low, high]): HalfRadiance) {
    let texel = &mut texels[cell / 2];
    (texel[cell % 2 * 2], texel[cell % 2 * 2 + 1]) = (low, high);
}
