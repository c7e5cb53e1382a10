//! Texture and environment lookups, decoded from sRGB before filtering: bilinear at level 0, or over what a ray cone covers.

use std::f32::consts::{PI, TAU};
use std::ops::{Add, Mul};
use std::sync::LazyLock;

use glam::{Vec2, Vec3, Vec4};

use super::cone::Footprint;
use super::pyramid::Pyramid;
use crate::scene::{Environment, Filter, Image, Scene, TextureSlot, Wrap};

/// Value of every byte: as it is meant linearly, and decoded from sRGB (IEC 61966-2-1).
struct Decoded {
    linear: [f32; 256],
    srgb: [f32; 256],
}

static DECODED: LazyLock<Decoded> = LazyLock::new(|| Decoded {
    linear: std::array::from_fn(|byte| byte as f32 / 255.0),
    srgb: std::array::from_fn(|byte| {
        let encoded = byte as f64 / 255.0;
        let linear = if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) };
        linear as f32
    }),
});

/// The value of each byte, decoded from `srgb` or not.
pub(super) fn decoded(srgb: bool) -> &'static [f32; 256] {
    let decoded = &*DECODED;
    if srgb { &decoded.srgb } else { &decoded.linear }
}

/// Linear RGBA of the texture in `slot` at the mesh's coordinates `uv`.
///
/// Filtered bilinearly between texel centres at level 0, or not at all where the sampler magnifies by the
/// nearest texel.
pub fn lookup(scene: &Scene, slot: &TextureSlot, uv: Vec2) -> Vec4 {
    Texels::new(scene, slot).rgba(uv)
}

/// A texture as lookups need it.
#[derive(Clone, Copy)]
pub(super) struct Texels<'s> {
    slot: &'s TextureSlot,
    grid: Grid<'s>,
    /// Wrap modes along u and v.
    wrap: [Wrap; 2],
    filter: Filter,
    /// Value of each byte of a colour.
    color: &'static [f32; 256],
}

/// Texels of an image or of one of its mip levels.
#[derive(Clone, Copy)]
pub(super) struct Grid<'s> {
    /// Texels in a row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// RGBA8, row by row from the top.
    pub rgba: &'s [u8],
}

impl Grid<'_> {
    /// The texel at (`x`, `y`), undecoded.
    #[inline(always)]
    pub fn texel(&self, x: u32, y: u32) -> [u8; 4] {
        let i = (y as usize * self.width as usize + x as usize) * 4;
        let texel = &self.rgba[i..i + 4];
        [texel[0], texel[1], texel[2], texel[3]]
    }
}

impl<'s> From<&'s Image> for Grid<'s> {
    #[inline(always)]
    fn from(image: &'s Image) -> Self {
        Self { width: image.width, height: image.height, rgba: &image.rgba }
    }
}

impl<'s> Texels<'s> {
    /// The texture in `slot`.
    #[inline]
    pub fn new(scene: &'s Scene, slot: &'s TextureSlot) -> Self {
        let texture = &scene.textures[slot.texture as usize];
        Self {
            slot,
            grid: Grid::from(&scene.images[texture.image as usize]),
            wrap: [texture.sampler.wrap_u, texture.sampler.wrap_v],
            filter: texture.sampler.mag,
            color: decoded(texture.srgb),
        }
    }

    /// Linear RGBA at the mesh's coordinates `uv`.
    ///
    /// Filtered bilinearly between texel centres at level 0, or not at all where the sampler magnifies by the
    /// nearest texel.
    #[inline]
    pub fn rgba(&self, uv: Vec2) -> Vec4 {
        let place = self.place(uv);
        let texels = self.fetch(&place);
        let alpha = blend(texels.map(|texel| f32::from(texel[3]) / 255.0), place.weights);
        self.rgb(texels, &place).extend(alpha)
    }

    /// The same, filtered over `footprint`; at level 0 where there is none, or the texture has no mip levels.
    #[inline]
    pub fn rgba_over(&self, footprint: Option<&Footprint>, uv: Vec2) -> Vec4 {
        let texels = self.grid.width * self.grid.height;
        match footprint.and_then(|footprint| footprint.level(self.slot, texels)) {
            Some((pyramid, level)) => self.rgba_at(pyramid, level, uv),
            None => self.rgba(uv),
        }
    }

    /// The same at a `level` of `pyramid`, which need not be whole, as Vulkan has it (chapter "Texel filtering").
    #[inline(never)]
    fn rgba_at(&self, pyramid: &Pyramid, level: f32, uv: Vec2) -> Vec4 {
        let sampler = &pyramid.sampler;
        let at = |level: f32, filter| {
            let grid = pyramid.level(self.grid, level as usize);
            Texels { grid, filter, ..*self }.rgba(uv)
        };
        // What is no number counts as 0.
        let level = level.max(0.0).min(pyramid.last() as f32);
        if level == 0.0 {
            return at(0.0, sampler.mag);
        }
        if sampler.mip != Some(Filter::Linear) {
            return at((level + 0.5).ceil() - 1.0, sampler.min);
        }
        let share = level.fract();
        let finer = at(level, sampler.min);
        if share == 0.0 { finer } else { finer.lerp(at(level + 1.0, sampler.min), share) }
    }

    /// Where that is.
    #[inline(always)]
    pub fn place(&self, uv: Vec2) -> Place {
        let Self { slot, grid: Grid { width, height, .. }, wrap: [wrap_u, wrap_v], filter, .. } = *self;
        let uv = slot.transform(uv);
        // In f64 for the sake of speed as well: pairs of f32 would share a register with two stray lanes, and
        // a denormal number among those costs more than the whole lookup.
        let (x, y) = (f64::from(uv.x) * f64::from(width), f64::from(uv.y) * f64::from(height));
        if filter == Filter::Nearest {
            let (x, y) = (wrap(wrap_u, x.floor(), width), wrap(wrap_v, y.floor(), height));
            return Place { columns: [x; 2], rows: [y; 2], weights: [1.0, 0.0, 0.0, 0.0] };
        }
        let (columns, s) = neighbours(wrap_u, x, width);
        let (rows, t) = neighbours(wrap_v, y, height);
        Place { columns, rows, weights: bilinear(s, t) }
    }

    /// The texels there.
    #[inline(always)]
    pub fn fetch(&self, place: &Place) -> [[u8; 4]; 4] {
        let ([x0, x1], [y0, y1]) = (place.columns, place.rows);
        let Self { grid, .. } = self;
        [grid.texel(x0, y0), grid.texel(x1, y0), grid.texel(x0, y1), grid.texel(x1, y1)]
    }

    /// Their mean, linear.
    #[inline(always)]
    pub fn rgb(&self, texels: [[u8; 4]; 4], place: &Place) -> Vec3 {
        let channel = |channel: usize| {
            blend(texels.map(|texel| self.color[usize::from(texel[channel])]), place.weights)
        };
        Vec3::new(channel(0), channel(1), channel(2))
    }
}

/// The texels around a point, two by two, and their weights.
#[derive(Clone, Copy, Default)]
pub(super) struct Place {
    columns: [u32; 2],
    rows: [u32; 2],
    weights: [f32; 4],
}

/// Weights of four texels, two by two, for shares of the second column and of the second row.
#[inline(always)]
fn bilinear(s: f32, t: f32) -> [f32; 4] {
    [(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t]
}

#[inline(always)]
fn blend<T: Copy + Add<Output = T> + Mul<f32, Output = T>>([a, b, c, d]: [T; 4], weights: [f32; 4]) -> T {
    a * weights[0] + b * weights[1] + c * weights[2] + d * weights[3]
}

/// Linear radiance of the panorama in the unit direction `direction`, bilinear.
pub fn environment(panorama: &Environment, direction: Vec3) -> Vec3 {
    let (width, height) = (panorama.width, panorama.height);
    // The image's centre is −z, +x lies to its right, +y at its top.
    let u = 0.5 + direction.x.atan2(-direction.z) / TAU;
    let v = direction.y.clamp(-1.0, 1.0).acos() / PI;
    let ([x0, x1], s) = neighbours(Wrap::Repeat, f64::from(u) * f64::from(width), width);
    let ([y0, y1], t) = neighbours(Wrap::Clamp, f64::from(v) * f64::from(height), height);
    let texel = |x: u32, y: u32| panorama.radiance[y as usize * width as usize + x as usize];
    blend([texel(x0, y0), texel(x1, y0), texel(x0, y1), texel(x1, y1)], bilinear(s, t))
}

/// The two texels whose centres enclose `at`, and the weight of the second.
#[inline]
fn neighbours(mode: Wrap, at: f64, size: u32) -> ([u32; 2], f32) {
    let at = at - 0.5;
    // Most lookups lie between texels of the image; without SSE 4.1, `floor` is a call.
    if (0.0..f64::from(size - 1)).contains(&at) {
        let low = at as u32;
        return ([low, low + 1], (at - f64::from(low)) as f32);
    }
    let low = at.floor();
    ([wrap(mode, low, size), wrap(mode, low + 1.0, size)], (at - low) as f32)
}

/// The texel among `size` that the whole number `at` stands for.
#[inline]
fn wrap(mode: Wrap, at: f64, size: u32) -> u32 {
    // Casts saturate and turn NaN into 0: broken coordinates read some texel, never none.
    let (at, size) = (at as i64, i64::from(size));
    if (0..size).contains(&at) {
        return at as u32;
    }
    let inside = match mode {
        Wrap::Clamp => at.clamp(0, size - 1),
        Wrap::Repeat => at.rem_euclid(size),
        Wrap::Mirror => {
            let period = at.rem_euclid(2 * size);
            if period < size { period } else { 2 * size - 1 - period }
        }
    };
    inside as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wraps_both_ways() {
        let row = |mode| (-3..6).map(|at| wrap(mode, f64::from(at), 3)).collect::<Vec<_>>();
        assert_eq!(row(Wrap::Clamp), [0, 0, 0, 0, 1, 2, 2, 2, 2]);
        assert_eq!(row(Wrap::Repeat), [0, 1, 2, 0, 1, 2, 0, 1, 2]);
        assert_eq!(row(Wrap::Mirror), [2, 1, 0, 0, 1, 2, 2, 1, 0]);
        assert!(wrap(Wrap::Mirror, f64::NAN, 3) < 3 && wrap(Wrap::Repeat, f64::INFINITY, 3) < 3);
    }
}
