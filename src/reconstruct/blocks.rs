//! Traced pixels as the device reads them: a small rectangle of radiances for each leaf that they cover.

use std::ops::Range;
use std::sync::LazyLock;

use rustc_hash::FxHashMap;

use super::table::Texel;
use crate::pixels::HalfRadiance;
use crate::pixels::leaves::TracedPixel;
use crate::refine::footprint::{Footprint, TOUCHED};
use crate::refine::mesh::Mesh;
use crate::scene::{Scene, View};
use crate::visibility::IdImage;

/// Cosine of the angle up to which two faces are taken for parts of a plane.
const FLAT: f32 = 0.99999;

/// A leaf is wide if one of so many pixels that it reaches into is its own.
const WIDE: usize = 3;

/// No traced pixel.
const NONE: u32 = u32::MAX;

/// Cosine of the angle within which two faces have some normals in common where one continues the other.
const SAME: f32 = 0.99;

/// What the pixels of blocks are taken from.
#[derive(Clone, Copy)]
pub struct Pixels<'a> {
    /// Traced ones, those of one leaf together.
    pub traced: &'a [TracedPixel],
    /// Which face every pixel shows, if that was read back.
    pub ids: Option<IdImage<'a>>,
}

/// By pixel of a rectangle: the pixel of the plain picture, of one sample a pixel, whose colour it gets, or [`UNTOUCHED`].
#[derive(Debug, Clone)]
pub struct Sources {
    /// Columns of the rectangle.
    pub columns: Range<u32>,
    /// Its rows.
    pub rows: Range<u32>,
    /// Row by row.
    pub pixels: Vec<u32>,
}

/// A cell that gets no colour.
pub const UNTOUCHED: u32 = u32::MAX;

/// Where a cell of a leaf's block gets its colour from.
enum Cell {
    Traced(HalfRadiance),
    /// From the plain picture.
    Plain(u32),
    /// Nowhere: what lies behind shows, or before.
    Hidden,
}

/// A leaf's block as several samples a pixel show it.
#[derive(Default)]
pub struct SmoothBlock {
    /// Whether it has any colour.
    pub has_color: bool,
    /// What gets colours of the plain picture, if anything does.
    pub rest: Option<Sources>,
    /// Whether some of it is not drawn.
    pub hides: bool,
}

/// Traced pixels, and where they are.
pub struct Blocks<'a> {
    scene: &'a Scene,
    view: &'a View,
    mesh: &'a Mesh,
    traced: &'a [TracedPixel],
    ids: Option<IdImage<'a>>,
    /// The rectangle around them: columns, then rows.
    around: [Range<u32>; 2],
    /// By pixel of it: place in `traced`, or [`NONE`].
    by_pixel: Vec<u32>,
    /// Where in `traced` the pixels of each leaf are.
    by_face: FxHashMap<u32, Range<usize>>,
}

/// The pixels around a pixel, the nearest first; of equally near ones, row by row.
const AROUND: [(i32, i32); 8] = [(0, -1), (-1, 0), (1, 0), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];

/// A pixel and those at most three columns and rows from it, the nearest first.
static NEAR: LazyLock<Vec<(i32, i32)>> = LazyLock::new(|| {
    let mut near: Vec<(i32, i32)> = (-3..=3).flat_map(|y| (-3..=3).map(move |x| (x, y))).collect();
    near.sort_by_key(|&(x, y)| x * x + y * y);
    near
});

/// A leaf that is traced.
struct Leaf<'a> {
    face: u32,
    /// The scene's face that it is part of.
    base: u32,
    footprint: Footprint,
    /// Its traced pixels.
    own: &'a [TracedPixel],
    /// Whether these are many of those that it reaches into.
    is_wide: bool,
}

impl<'a> Blocks<'a> {
    /// Blocks of leaves of `mesh`.
    pub fn new(scene: &'a Scene, view: &'a View, mesh: &'a Mesh, pixels: Pixels<'a>) -> Self {
        let Pixels { traced, ids } = pixels;
        let around = around(view, traced.iter().map(|pixel| pixel.index)).unwrap_or_default();
        let by_pixel = vec![NONE; around[0].len() * around[1].len()];
        let mut by_face = FxHashMap::default();
        let mut start = 0;
        for pixels in traced.chunk_by(|a, b| a.face == b.face) {
            by_face.insert(pixels[0].face, start..start + pixels.len());
            start += pixels.len();
        }
        let mut blocks = Self { scene, view, mesh, traced, ids, around, by_pixel, by_face };
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
        self.append_cells(&self.leaf(face), texels, |leaf, x, y| {
            self.shown(leaf, x, y).map(|pixel| Some(pixel.radiance))
        })
    }

    /// The same for several samples a pixel: what only some of them show gets colours that pixels' centres have, too, of the
    /// plain picture where these were not traced.
    pub fn append_smooth(&self, face: u32, texels: &mut Vec<Texel>) -> SmoothBlock {
        let leaf = self.leaf(face);
        let (mut rest, mut hides): (Option<Sources>, _) = (None, false);
        let Footprint { columns, rows, .. } = leaf.footprint.clone();
        let appended = self.append_cells(&leaf, texels, |leaf, x, y| match self.cell_of(leaf, x, y) {
            Cell::Traced(radiance) => Some(Some(radiance)),
            Cell::Plain(pixel) => {
                let rest = rest.get_or_insert_with(|| Sources {
                    pixels: vec![UNTOUCHED; columns.len() * rows.len()],
                    columns: columns.clone(),
                    rows: rows.clone(),
                });
                let cell = (y - rows.start) as usize * columns.len() + (x - columns.start) as usize;
                rest.pixels[cell] = pixel;
                Some(None)
            }
            Cell::Hidden => {
                hides = true;
                Some(None)
            }
        });
        SmoothBlock { has_color: appended.is_some(), rest, hides }
    }

    /// Whether no pixel's centre shows leaf `face`; false where it is not known what they show.
    pub fn owns_no_pixel(&self, face: u32) -> bool {
        let Some(ids) = self.ids else { return false };
        let base = Some(self.mesh.faces[face as usize].base);
        let footprint = Footprint::new(self.mesh, self.view, face);
        !footprint.rows.clone().any(|y| footprint.span(y, 0.0).any(|x| ids.face(x, y) == base))
    }

    fn leaf(&self, face: u32) -> Leaf<'_> {
        let footprint = Footprint::new(self.mesh, self.view, face);
        let own = self.by_face.get(&face).map_or(&[][..], |range| &self.traced[range.clone()]);
        let touched: usize = footprint.rows.clone().map(|y| footprint.span(y, TOUCHED).len()).sum();
        let is_wide = WIDE * own.len() >= touched;
        Leaf { face, base: self.mesh.faces[face as usize].base, footprint, own, is_wide }
    }

    fn append_cells<'s>(
        &'s self,
        leaf: &Leaf<'s>,
        texels: &mut Vec<Texel>,
        mut color: impl FnMut(&Leaf<'s>, u32, u32) -> Option<Option<HalfRadiance>>,
    ) -> Option<()> {
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
            let Some(radiance) = color(leaf, x, y)? else { return Some(filled) };
            put(&mut texels[start..], cell, radiance);
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

    /// What several samples of a pixel show of `leaf`. Where the surface continues to what is seen at the centre that has the
    /// whole pixel's colour, as without them: a colour from beside it would be spread. Where it turns and both were traced, it
    /// mixes with that of a wide leaf's own pixel, which is nearer to the mean.
    fn cell_of(&self, leaf: &Leaf, x: u32, y: u32) -> Cell {
        let traced = self.at(x, y);
        let seen = self.ids.and_then(|ids| ids.face(x, y));
        let traced_base = traced.map(|pixel| self.mesh.faces[pixel.face as usize].base);
        let continues = traced_base.or(seen).is_some_and(|base| self.continues(leaf.base, base));
        let mixes = || leaf.is_wide && traced_base.is_some_and(|base| self.turns(leaf.base, base));
        if continues && !mixes() {
            return self.plain(x, y);
        }
        // Farther than beside it a narrow leaf shows something else.
        let mut beside = AROUND
            .iter()
            .filter_map(|&(dx, dy)| self.at(x.wrapping_add_signed(dx), y.wrapping_add_signed(dy)));
        if let Some(pixel) = beside.find(|pixel| pixel.face == leaf.face) {
            return Cell::Traced(pixel.radiance);
        }
        if continues {
            return self.plain(x, y);
        }
        if self.ids.is_none() {
            return self.plain(x, y);
        }
        if self.is_hidden(leaf, x, y) {
            return Cell::Hidden;
        }
        let objects = &self.scene.geometry.face_objects;
        let shows = |x: u32, y: u32| {
            let face = self.ids.and_then(|ids| ids.face(x, y));
            face.is_some_and(|face| objects[face as usize] == objects[leaf.base as usize])
        };
        nearest(self.view, (x, y), shows).map_or(Cell::Hidden, |(x, y)| self.plain(x, y))
    }

    /// The plain picture's colour of a pixel: what was traced there is known without drawing it.
    fn plain(&self, x: u32, y: u32) -> Cell {
        let pixel = y * self.view.width + x;
        self.at(x, y).map_or(Cell::Plain(pixel), |pixel| Cell::Traced(pixel.radiance))
    }

    /// Whether other faces lie before `leaf` all over a pixel that it covers, as far as the centres around it tell.
    fn is_hidden(&self, leaf: &Leaf, x: u32, y: u32) -> bool {
        let shows = |x: u32, y: u32| {
            self.ids.and_then(|ids| ids.face(x, y)).is_some_and(|face| self.continues(leaf.base, face))
        };
        leaf.footprint.inside(x, y) > TOUCHED
            && !AROUND.iter().any(|&(dx, dy)| {
                let (x, y) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
                x < self.view.width && y < self.view.height && shows(x, y)
            })
    }

    /// Whether two faces of the scene lie in different planes.
    fn turns(&self, one: u32, other: u32) -> bool {
        let normal = |face: u32| self.scene.geometry.area_normal(face).normalize_or_zero();
        one != other && normal(one).dot(normal(other)) < FLAT
    }

    /// Whether two faces of the scene are parts of one smooth surface, as far as their normals tell.
    fn continues(&self, one: u32, other: u32) -> bool {
        let geometry = &self.scene.geometry;
        if one == other {
            return true;
        }
        if geometry.face_objects[one as usize] != geometry.face_objects[other as usize] {
            return false;
        }
        let normals = |face: u32| geometry.faces[face as usize].map(|v| geometry.normals[v as usize]);
        normals(one).iter().any(|a| {
            normals(other).iter().any(|b| a.dot(*b) > SAME * (a.length_squared() * b.length_squared()).sqrt())
        })
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

/// The pixel of a frame nearest to (`x`, `y`) that `shows` something, if one near does.
pub fn nearest(view: &View, (x, y): (u32, u32), shows: impl Fn(u32, u32) -> bool) -> Option<(u32, u32)> {
    let around = NEAR.iter().map(|&(dx, dy)| (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy)));
    around.into_iter().find(|&(x, y)| x < view.width && y < view.height && shows(x, y))
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
