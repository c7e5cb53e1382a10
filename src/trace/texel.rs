//! Texture and environment lookups: bilinear at level 0, decoded from sRGB before filtering.

use std::f32::consts::{PI, TAU};
use std::sync::LazyLock;

use glam::{Vec2, Vec3, Vec4};

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

/// Linear RGBA of the texture in `slot` at the mesh's coordinates `uv`.
///
/// Filtered bilinearly between texel centres at level 0, or not at all where the sampler magnifies by the
/// nearest texel.
pub fn lookup(scene: &Scene, slot: &TextureSlot, uv: Vec2) -> Vec4 {
    let texture = &scene.textures[slot.texture as usize];
    let image = &scene.images[texture.image as usize];
    let sampler = &texture.sampler;
    let uv = slot.transform(uv);
    let (width, height) = (image.width, image.height);
    let decoded = &*DECODED;
    let color = if texture.srgb { &decoded.srgb } else { &decoded.linear };
    // In f64 for the sake of speed as well: pairs of f32 would share a register with two stray lanes, and
    // a denormal number among those costs more than the whole lookup.
    let (x, y) = (f64::from(uv.x) * f64::from(width), f64::from(uv.y) * f64::from(height));
    if sampler.mag == Filter::Nearest {
        return texel(
            image,
            color,
            wrap(sampler.wrap_u, x.floor(), width),
            wrap(sampler.wrap_v, y.floor(), height),
        );
    }
    let ([x0, x1], s) = neighbours(sampler.wrap_u, x, width);
    let ([y0, y1], t) = neighbours(sampler.wrap_v, y, height);
    let corners = [
        texel(image, color, x0, y0),
        texel(image, color, x1, y0),
        texel(image, color, x0, y1),
        texel(image, color, x1, y1),
    ];
    bilinear(corners, s, t)
}

#[inline]
fn texel(image: &Image, color: &[f32; 256], x: u32, y: u32) -> Vec4 {
    let i = (y as usize * image.width as usize + x as usize) * 4;
    let texel = &image.rgba[i..i + 4];
    Vec4::new(
        color[usize::from(texel[0])],
        color[usize::from(texel[1])],
        color[usize::from(texel[2])],
        f32::from(texel[3]) / 255.0,
    )
}

/// Linear radiance of the panorama in the unit direction `direction`, bilinear.
pub fn environment(panorama: &Environment, direction: Vec3) -> Vec3 {
    let (width, height) = (panorama.width, panorama.height);
    // The image's centre is −z, +x lies to its right, +y at its top.
    let u = 0.5 + direction.x.atan2(-direction.z) / TAU;
    let v = direction.y.clamp(-1.0, 1.0).acos() / PI;
    let ([x0, x1], s) = neighbours(Wrap::Repeat, f64::from(u) * f64::from(width), width);
    let ([y0, y1], t) = neighbours(Wrap::Clamp, f64::from(v) * f64::from(height), height);
    let texel = |x: u32, y: u32| panorama.radiance[y as usize * width as usize + x as usize].extend(0.0);
    bilinear([texel(x0, y0), texel(x1, y0), texel(x0, y1), texel(x1, y1)], s, t).truncate()
}

#[inline]
fn bilinear([a, b, c, d]: [Vec4; 4], s: f32, t: f32) -> Vec4 {
    a * ((1.0 - s) * (1.0 - t)) + b * (s * (1.0 - t)) + c * ((1.0 - s) * t) + d * (s * t)
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
