//! How much a texture changes over a displacement (design §6).
//!
//! A reflected texture that is shifted by δ texels is wrong by E|T(x + δ) − T(x)|² on average: the
//! structure function D(δ). Refinement weighs predicted displacements by it, so that a plain wall takes no
//! samples and a fine chessboard many, without any texel ever driving the refinement by itself.

use glam::{Affine2, Vec2};
use rayon::prelude::*;

use crate::scene::{Scene, TextureSlot};
use crate::trace::texel::lookup;

/// Mean square and structure function of one texture, in linear light, averaged over colour channels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Structure {
    /// E T².
    pub mean_square: f32,
    /// D at displacements of 2⁰ … 2¹¹ half texels, non-decreasing.
    table: [f32; OCTAVES],
    /// Texels along u and v.
    size: [f32; 2],
}

const OCTAVES: usize = 12;
/// Displacement of the first table entry, in texels.
const FINEST: f32 = 0.5;
const POINTS: u32 = 1024;
const DIRECTIONS: u32 = 8;

impl Structure {
    /// An untextured surface: one colour everywhere.
    pub const PLAIN: Self = Self { mean_square: 1.0, table: [0.0; OCTAVES], size: [1.0; 2] };

    /// Measures the scene's texture `texture` at a fixed set of points.
    pub fn of(scene: &Scene, texture: u32) -> Self {
        let image = &scene.images[scene.textures[texture as usize].image as usize];
        let size = Vec2::new(image.width as f32, image.height as f32);
        let slot = TextureSlot { texture, uv_set: 0, transform: Affine2::IDENTITY };
        let at = |texel: Vec2| lookup(scene, &slot, texel / size).truncate();
        let mut mean_square = 0.0;
        let mut table = [0.0; OCTAVES];
        for point in 0..POINTS {
            // R2 sequence (Roberts 2018): covers the texture evenly at any count.
            let texel = (0.5 + Vec2::new(0.754_877_7, 0.569_840_3) * point as f32).fract() * size;
            let here = at(texel);
            mean_square += here.length_squared();
            let angle = std::f32::consts::TAU * (point % DIRECTIONS) as f32 / DIRECTIONS as f32;
            for (octave, value) in table.iter_mut().enumerate() {
                let step = FINEST * (1 << octave) as f32;
                let there = at(texel + Vec2::from_angle(angle) * step);
                *value += (there - here).length_squared();
            }
        }
        let scale = 1.0 / (3.0 * POINTS as f32);
        let mut highest: f32 = 0.0;
        for value in &mut table {
            highest = highest.max(*value * scale);
            *value = highest;
        }
        Self { mean_square: mean_square * scale, table, size: size.to_array() }
    }

    /// Structures of all textures of a scene.
    pub fn all(scene: &Scene) -> Vec<Self> {
        (0..scene.textures.len() as u32).into_par_iter().map(|texture| Self::of(scene, texture)).collect()
    }

    /// D for a displacement in texture coordinates.
    pub fn displaced(&self, uv: Vec2) -> f32 {
        let texels = (uv.x * self.size[0]).hypot(uv.y * self.size[1]);
        if texels.is_nan() {
            return self.table[OCTAVES - 1];
        }
        if texels <= FINEST {
            // Differentiable below a texel: D grows with the square of the displacement.
            return self.table[0] * (texels / FINEST).powi(2);
        }
        let octave = (texels / FINEST).log2().min((OCTAVES - 1) as f32);
        let low = octave.floor() as usize;
        let high = (low + 1).min(OCTAVES - 1);
        self.table[low] + (self.table[high] - self.table[low]) * octave.fract()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Geometry, Image, Sampler, Texture};

    fn structure(width: u32, height: u32, value: impl Fn(u32, u32) -> u8) -> Structure {
        let rgba: Vec<u8> = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .flat_map(|(x, y)| [value(x, y), value(x, y), value(x, y), 255])
            .collect();
        let texture = Texture { image: 0, sampler: Sampler::default(), srgb: false };
        let scene = Scene {
            name: String::new(),
            origin: glam::DVec3::ZERO,
            geometry: Geometry::default(),
            objects: vec![],
            materials: vec![],
            textures: vec![texture],
            images: vec![Image { name: String::new(), width, height, rgba: rgba.into() }],
            lights: vec![],
            cameras: vec![],
            background: Default::default(),
            ambient: 0.0,
            unread: Vec::new(),
            notes: vec![],
        };
        Structure::of(&scene, 0)
    }

    #[test]
    fn a_plain_texture_never_changes() {
        let plain = structure(16, 16, |_, _| 255);
        // Weights of a bilinear filter add up to 1 but for rounding.
        assert!(plain.displaced(Vec2::new(3.0, 1.0)) < 1e-12);
        assert!((plain.mean_square - 1.0).abs() < 1e-5);
    }

    #[test]
    fn stripes_decorrelate_and_never_recover() {
        // Black and white stripes of 32 texels: two independent points differ with probability 1/2.
        let stripes = structure(256, 256, |x, _| if x / 32 % 2 == 0 { 255 } else { 0 });
        let far = stripes.displaced(Vec2::new(1.0, 1.0));
        assert!((0.4..0.9).contains(&far), "{far}");
        assert!(stripes.displaced(Vec2::splat(1.0 / 256.0)) < 0.1 * far);
        let mut last = 0.0;
        for texels in 0..512 {
            let d = stripes.displaced(Vec2::new(texels as f32 / 256.0, 0.0));
            assert!(d >= last, "D falls at {texels} texels");
            last = d;
        }
    }
}
