//! Mip levels on the host, as the device makes them: for pixels that are traced.

use std::sync::{LazyLock, OnceLock};

use rayon::prelude::*;

use super::cone::Filtering;
use super::texel::{Grid, decoded};
use crate::options::FilterMode;
use crate::scene::{Sampler, Scene, Texture, View};

/// The mip levels of a scene's textures, made when they are first asked for.
pub struct Pyramids {
    /// How textures are filtered, and which are meant.
    made_for: (FilterMode, Vec<bool>),
    made: OnceLock<Vec<Option<Pyramid>>>,
}

/// The levels of one texture.
#[derive(Debug)]
pub struct Pyramid {
    /// How they are filtered.
    pub(super) sampler: Sampler,
    /// Level 1 and the following.
    levels: Vec<Level>,
}

/// A level but the first.
#[derive(Debug)]
struct Level {
    width: u32,
    height: u32,
    rgba: Vec<u8>,
}

impl Pyramids {
    /// Those of textures of `scene` that are `wanted` and have mip levels under `filter`; `None` if there are none.
    pub fn new(scene: &Scene, wanted: &[bool], filter: FilterMode) -> Option<Self> {
        let wanted: Vec<bool> = scene
            .textures
            .iter()
            .zip(wanted)
            .map(|(texture, &wanted)| wanted && filter.sampler(&texture.sampler).mip.is_some())
            .collect();
        wanted.contains(&true).then(|| Self { made_for: (filter, wanted), made: OnceLock::new() })
    }

    /// `self`, unless `other` is of the same textures under the same filter.
    #[must_use]
    pub fn or_same(self, other: Option<Self>) -> Self {
        other.filter(|other| other.made_for == self.made_for).unwrap_or(self)
    }

    /// How textures are filtered.
    pub fn filter(&self) -> FilterMode {
        self.made_for.0
    }

    /// Filtering for the pixels of `view`. The first call makes the levels, on all cores: it must not be one of several
    /// tasks, which would wait for each other.
    pub fn filtering<'a>(&'a self, scene: &Scene, view: &'a View) -> Filtering<'a> {
        let (filter, wanted) = &self.made_for;
        let pyramid = |(texture, &wanted): (&Texture, &bool)| {
            wanted.then(|| Pyramid::new(scene, texture, filter.sampler(&texture.sampler)))
        };
        let pyramids = self.made.get_or_init(|| scene.textures.par_iter().zip(wanted).map(pyramid).collect());
        Filtering { pyramids, anisotropy: filter.anisotropy().into(), view }
    }
}

impl Pyramid {
    fn new(scene: &Scene, texture: &Texture, sampler: Sampler) -> Self {
        let mut levels: Vec<Level> = Vec::new();
        let first = Grid::from(&scene.images[texture.image as usize]);
        loop {
            let last = levels.last().map_or(first, Grid::from);
            if last.width == 1 && last.height == 1 {
                break Self { sampler, levels };
            }
            let next = Level::halved(last, texture.srgb);
            levels.push(next);
        }
    }

    /// The texels of a level, `first` being the first; of the last beyond that.
    pub(super) fn level<'a>(&'a self, first: Grid<'a>, level: usize) -> Grid<'a> {
        match level.min(self.levels.len()) {
            0 => first,
            level => Grid::from(&self.levels[level - 1]),
        }
    }

    /// The last level.
    pub(super) fn last(&self) -> usize {
        self.levels.len()
    }
}

impl<'a> From<&'a Level> for Grid<'a> {
    fn from(Level { width, height, rgba }: &'a Level) -> Self {
        Self { width: *width, height: *height, rgba }
    }
}

impl Level {
    /// The level after `from`: half as many texels along each side, rounded down, read between those of `from`.
    fn halved(from: Grid, srgb: bool) -> Self {
        let half = |size: u32| (size / 2).max(1);
        let (width, height) = (half(from.width), half(from.height));
        let [columns, rows] = [taps(from.width, width), taps(from.height, height)];
        let mut rgba = vec![0; 4 * (width * height) as usize];
        rgba.par_chunks_mut(4 * width as usize).zip(rows).for_each(|(row, ([y0, y1], t))| {
            for (texel, &([x0, x1], s)) in row.as_chunks_mut::<4>().0.iter_mut().zip(&columns) {
                let around = [[x0, y0], [x1, y0], [x0, y1], [x1, y1]].map(|[x, y]| from.texel(x, y));
                *texel = std::array::from_fn(|channel| {
                    let srgb = srgb && channel < 3;
                    let [a, b, c, d] = around.map(|texel| decoded(srgb)[usize::from(texel[channel])]);
                    let mean = (a * (1.0 - s) + b * s) * (1.0 - t) + (c * (1.0 - s) + d * s) * t;
                    if srgb { srgb_byte(mean) } else { (mean * 255.0 + 0.5) as u8 }
                });
            }
        });
        Self { width, height, rgba }
    }
}

/// Of each of `to` texels along a side: the two of `from` around its centre, and the share of the second.
fn taps(from: u32, to: u32) -> Vec<([u32; 2], f32)> {
    let tap = |texel: u32| {
        let at = (texel as f32 + 0.5) * from as f32 / to as f32 - 0.5;
        let low = at.floor();
        ([low as u32, (low as u32 + 1).min(from - 1)], at - low)
    };
    (0..to).map(tap).collect()
}

/// The byte that stands for the linear value `value`, encoded as sRGB.
fn srgb_byte(value: f32) -> u8 {
    /// Values halfway, as encoded, between those of neighbouring bytes.
    static BETWEEN: LazyLock<[f32; 255]> = LazyLock::new(|| {
        std::array::from_fn(|byte| {
            let encoded = (byte as f64 + 0.5) / 255.0;
            let linear =
                if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) };
            linear as f32
        })
    });
    BETWEEN.partition_point(|&between| between <= value) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::demo::{SceneBuilder, texture};
    use crate::scene::{Filter, Image};

    /// The levels of an image, the first left out.
    fn levels(width: u32, height: u32, srgb: bool, texel: impl Fn(u32, u32) -> [u8; 4]) -> Vec<Level> {
        let texels = (0..width * height).map(|i| texel(i % width, i / width)).collect::<Vec<_>>();
        let rgba = texels.as_flattened().into();
        let mut scene = SceneBuilder::new("levels");
        scene.sampled_texture(Image { name: "image".into(), width, height, rgba }, Sampler::default(), srgb);
        let scene = scene.build().unwrap();
        Pyramid::new(&scene, &scene.textures[0], Sampler::default()).levels
    }

    #[test]
    fn a_chessboard_becomes_its_mean() {
        let chess = |x, y| if (x + y) % 2 == 0 { [0, 255, 0, 255] } else { [255, 255, 0, 0] };
        for (srgb, grey) in [(true, 188), (false, 128)] {
            let levels = levels(16, 4, srgb, chess);
            let sizes = levels.iter().map(|level| (level.width, level.height)).collect::<Vec<_>>();
            assert_eq!(sizes, [(8, 2), (4, 1), (2, 1), (1, 1)]);
            for Level { rgba, .. } in levels {
                assert!(rgba.chunks(4).all(|texel| texel == [grey, 255, 0, 128]), "{rgba:?}");
            }
        }
    }

    #[test]
    fn odd_sides_are_read_between_texels() {
        // Around 1.5 / 6 and 4.5 / 6 of five texels; the third row of three is the middle one.
        let levels = levels(5, 3, false, |x, y| [10 * x as u8, y as u8, 0, 0]);
        assert_eq!(
            levels.iter().map(|level| (level.width, level.height)).collect::<Vec<_>>(),
            [(2, 1), (1, 1)]
        );
        assert_eq!(levels[0].rgba, [8, 1, 0, 0, 33, 1, 0, 0]);
    }

    #[test]
    fn bytes_of_srgb_come_back() {
        for byte in 0..=u8::MAX {
            assert_eq!(srgb_byte(decoded(true)[usize::from(byte)]), byte);
        }
    }

    #[test]
    fn only_textures_with_mip_levels_have_them() {
        let mut scene = SceneBuilder::new("textures");
        scene.texture(texture::chessboard(8));
        scene.sampled_texture(texture::chessboard(8), Sampler::default(), true);
        let nearest = Sampler { mag: Filter::Nearest, mip: None, ..Sampler::default() };
        scene.sampled_texture(texture::chessboard(8), nearest, true);
        let scene = scene.build().unwrap();
        let has = |wanted: [bool; 3], filter| {
            Pyramids::new(&scene, &wanted, filter).map(|pyramids| pyramids.made_for.1)
        };
        assert_eq!(has([true; 3], FilterMode::File), Some(vec![false, true, false]));
        assert_eq!(has([true, false, true], FilterMode::File), None);
        assert_eq!(has([true, false, true], FilterMode::Aniso8), Some(vec![true, false, true]));
    }
}
