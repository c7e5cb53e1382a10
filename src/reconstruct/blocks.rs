//! Traced pixels as the device reads them: a small rectangle of radiances for each leaf that they cover.

use std::ops::Range;

use glam::Vec3;
use half::f16;
use rayon::prelude::*;

use super::table::Texel;
use crate::constants::MAX_RADIANCE;
use crate::refine::direct::DirectPixel;
use crate::refine::footprint::{Footprint, TOUCHED};
use crate::refine::mesh::Mesh;
use crate::refine::per_pixel::TracedPixel;
use crate::scene::View;

/// No traced pixel.
const NONE: u32 = u32::MAX;

/// The pixels around a pixel, the nearest first; of equally near ones, row by row.
const AROUND: [(i32, i32); 8] = [(0, -1), (-1, 0), (1, 0), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];

/// Blocks of some leaves, one after the other.
#[derive(Debug, Default)]
pub struct Blocks {
    texels: Vec<Texel>,
    /// Leaves that have one, ascending, and where theirs begins.
    starts: Vec<(u32, u32)>,
}

impl Blocks {
    /// The block of leaf `face`: the rectangle's corner and size, then its pixels as halves, two a texel. `None` for a leaf
    /// that is not traced, or near which no traced pixel is.
    pub fn get(&self, face: u32) -> Option<&[Texel]> {
        let index = self.starts.binary_search_by_key(&face, |&(face, _)| face).ok()?;
        let end = self.starts.get(index + 1).map_or(self.texels.len(), |&(_, start)| start as usize);
        Some(&self.texels[self.starts[index].1 as usize..end])
    }

    /// Those of the traced leaves `faces`, in ascending order, whose pixels are `traced`.
    ///
    /// Where a leaf reaches into a pixel whose centre it does not cover, sub-samples find a colour too: that of
    /// the nearest traced pixel, of this leaf if it has any. A pixel of a neighbour on the same face of the scene serves
    /// for itself: where its centre lies on their edge, the device may give it to either.
    pub fn new(view: &View, mesh: &Mesh, traced: &[TracedPixel], faces: &[u32]) -> Self {
        if faces.is_empty() {
            return Self::default();
        }
        let mut by_pixel = vec![NONE; view.width as usize * view.height as usize];
        for (pixel, number) in traced.iter().zip(0..) {
            by_pixel[pixel.index as usize] = number;
        }
        let near = Near { view, mesh, traced, by_pixel };
        let chunks: Vec<Self> = faces
            .par_chunks(64)
            .map(|faces| {
                let mut blocks = Self::default();
                for &face in faces {
                    let start = blocks.texels.len();
                    match near.append(face, &mut blocks.texels) {
                        Some(()) => blocks.starts.push((face, start as u32)),
                        None => blocks.texels.truncate(start),
                    }
                }
                blocks
            })
            .collect();
        let mut all = Self::default();
        all.texels.reserve(chunks.iter().map(|chunk| chunk.texels.len()).sum());
        for Self { texels, starts } in chunks {
            let offset = all.texels.len() as u32;
            all.starts.extend(starts.iter().map(|&(face, start)| (face, start + offset)));
            all.texels.extend(texels);
        }
        all
    }
}

/// Traced pixels and where they are.
struct Near<'a> {
    view: &'a View,
    mesh: &'a Mesh,
    traced: &'a [TracedPixel],
    by_pixel: Vec<u32>,
}

impl Near<'_> {
    /// Appends the block of `face`; `None` if some pixel of it finds no colour.
    fn append(&self, face: u32, texels: &mut Vec<Texel>) -> Option<()> {
        let footprint = Footprint::new(self.mesh, self.view, face);
        let (columns, rows) = (&footprint.columns, &footprint.rows);
        if footprint.is_empty() {
            return None;
        }
        texels.push([columns.start, rows.start, columns.len() as u32, rows.len() as u32]);
        let start = texels.len();
        texels.resize(start + footprint.len().div_ceil(2), Texel::default());
        let cells = || rows.clone().flat_map(|y| columns.clone().map(move |x| (x, y)));
        let own = cells().any(|(x, y)| self.at(x, y).is_some_and(|pixel| pixel.face == face));
        let mut found = false;
        for (row, y) in rows.clone().enumerate() {
            for x in footprint.span(y, TOUCHED) {
                let cell = row * columns.len() + (x - columns.start) as usize;
                let radiance = self.radiance(&footprint, face, own, x, y)?;
                put(&mut texels[start..], cell, radiance);
                found = true;
            }
        }
        found.then_some(())
    }

    fn at(&self, x: u32, y: u32) -> Option<&TracedPixel> {
        let index = y as usize * self.view.width as usize + x as usize;
        self.traced.get(self.by_pixel[index] as usize)
    }

    /// What leaf `face` shows at a pixel; `own` says whether it has a traced pixel.
    fn radiance(&self, footprint: &Footprint, face: u32, own: bool, x: u32, y: u32) -> Option<Vec3> {
        let base_of = |face: u32| self.mesh.faces[face as usize].base;
        let here = self.at(x, y);
        if let Some(pixel) = here.filter(|pixel| pixel.face == face || base_of(pixel.face) == base_of(face)) {
            return Some(pixel.radiance);
        }
        let is_usable = |pixel: &&TracedPixel| !own || pixel.face == face;
        if let Some(pixel) = here.filter(is_usable) {
            return Some(pixel.radiance);
        }
        let (columns, rows) = (&footprint.columns, &footprint.rows);
        let beside = AROUND.iter().find_map(|&(dx, dy)| {
            let (x, y) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
            let within = columns.contains(&x) && rows.contains(&y);
            within.then(|| self.at(x, y)).flatten().filter(is_usable)
        });
        let nearest = || {
            let cells = rows.clone().flat_map(|y| columns.clone().map(move |x| (x, y)));
            let usable = cells.filter_map(|(u, v)| Some((u, v, self.at(u, v).filter(is_usable)?)));
            let nearest = usable.min_by_key(|(u, v, _)| u.abs_diff(x).pow(2) + v.abs_diff(y).pow(2));
            nearest.map(|(.., pixel)| pixel)
        };
        beside.or_else(nearest).map(|pixel| pixel.radiance)
    }
}

/// One block over the rectangle around `pixels`, and that rectangle: columns, then rows. What it does not hold of it
/// is not drawn.
pub fn picture(view: &View, pixels: &[DirectPixel]) -> Option<([Range<u32>; 2], Vec<Texel>)> {
    let at = |pixel: &DirectPixel| [pixel.index % view.width, pixel.index / view.width];
    let (mut low, mut high) = ([u32::MAX; 2], [0; 2]);
    for pixel in pixels {
        let at = at(pixel);
        (low, high) = ([0, 1].map(|i| low[i].min(at[i])), [0, 1].map(|i| high[i].max(at[i] + 1)));
    }
    let [columns, rows] = [0, 1].map(|i| low[i]..high[i]);
    if columns.is_empty() {
        return None;
    }
    let mut texels = vec![Texel::default(); 1 + (columns.len() * rows.len()).div_ceil(2)];
    texels[0] = [columns.start, rows.start, columns.len() as u32, rows.len() as u32];
    for pixel in pixels {
        let [x, y] = at(pixel);
        let cell = (y - rows.start) as usize * columns.len() + (x - columns.start) as usize;
        put(&mut texels[1..], cell, pixel.radiance);
    }
    Some(([columns, rows], texels))
}

/// Writes a cell of a block.
fn put(texels: &mut [Texel], cell: usize, radiance: Vec3) {
    let [low, high] = halves(radiance);
    let texel = &mut texels[cell / 2];
    (texel[cell % 2 * 2], texel[cell % 2 * 2 + 1]) = (low, high);
}

/// A radiance that a half can hold, in two words; the fourth half says that there is one.
fn halves(radiance: Vec3) -> [u32; 2] {
    let [r, g, b] = radiance.clamp(Vec3::splat(-MAX_RADIANCE), Vec3::splat(MAX_RADIANCE)).to_array();
    let pair = |low: f32, high: f32| {
        u32::from(f16::from_f32(low).to_bits()) | u32::from(f16::from_f32(high).to_bits()) << 16
    };
    [pair(r, g), pair(b, 1.0)]
}
