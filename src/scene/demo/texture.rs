//! Procedural textures: chessboard, bricks, wood and panels, the same bytes on every run.
//!
//! All repeat without a seam. Colours are sRGB and held to few levels, so that PNG files stay small.

use glam::{FloatExt, UVec2, Vec2, Vec3};

use crate::scene::Image;

/// A board of 8 × 8 squares, ivory and slate, each tinted a little; `edge` texels wide and high.
pub fn chessboard(edge: u32) -> Image {
    paint("chessboard", edge, |uv| {
        let (square, within) = cell(uv, 8.0, 8.0);
        let tint = 0.96 + 0.08 * hash(square, 1);
        let joint = Vec2::min(within, 1.0 - within).min_element() < 1.5 * 8.0 / edge as f32;
        let color = match (joint, (square.x + square.y) % 2 == 0) {
            (true, _) => return Vec3::new(0.33, 0.31, 0.29),
            (_, true) => Vec3::new(0.90, 0.86, 0.77),
            (_, false) => Vec3::new(0.15, 0.16, 0.19),
        };
        color * tint
    })
}

/// A running bond of 8 rows of 4 bricks with mortar joints; bricks differ in tint.
pub fn brick(edge: u32) -> Image {
    const ROWS: f32 = 8.0;
    const COLUMNS: f32 = 4.0;
    paint("brick", edge, |uv| {
        let wobble = Vec2::new(noise(uv, 32, 11) - 0.5, noise(uv, 32, 12) - 0.5) * 0.006;
        let at = (uv + wobble).rem_euclid(Vec2::ONE);
        let odd = (at.y * ROWS) as u32 % 2;
        let shifted = Vec2::new((at.x + odd as f32 * 0.5 / COLUMNS).fract(), at.y);
        let (brick, within) = cell(shifted, COLUMNS, ROWS);
        // Distance to the nearest joint, in heights of a brick.
        let aspect = ROWS / COLUMNS;
        let inside = ((within.x.min(1.0 - within.x)) * aspect).min(within.y.min(1.0 - within.y));
        let face = smooth(0.045, 0.085, inside);
        // Light from above: the upper edge of a brick is lit, the lower one is not.
        let bevel = (1.0 - smooth(0.07, 0.16, inside)) * (0.5 - within.y) * 0.35;
        let tint = hash(brick, 2);
        let warm = Vec3::new(0.62, 0.31, 0.23).lerp(Vec3::new(0.74, 0.45, 0.33), tint);
        let burnt = if hash(brick, 3) > 0.86 { 0.72 } else { 1.0 };
        let grain = 0.92 + 0.16 * (0.6 * noise(uv, 64, 4) + 0.4 * noise(uv, 16, 5));
        let mortar = Vec3::new(0.72, 0.68, 0.62) * (0.90 + 0.14 * noise(uv, 64, 6));
        mortar.lerp(warm * burnt * grain * (1.0 + bevel), face)
    })
}

/// Five planks along v with staggered ends and growth rings.
pub fn wood(edge: u32) -> Image {
    const PLANKS: f32 = 5.0;
    paint("wood", edge, |uv| {
        let plank = (uv.x * PLANKS) as u32;
        let id = UVec2::new(plank, 0);
        let along = (uv.y + hash(id, 21)).fract();
        let across = (uv.x * PLANKS).fract();
        let half = (along * 2.0) as u32;
        let board = UVec2::new(plank, half + 1);
        let lines = Vec2::new(uv.x, (uv.y + hash(board, 22)).fract());
        let warp = noise_xy(lines, UVec2::new(10, 3), 23) + 0.35 * noise_xy(lines, UVec2::new(20, 8), 24);
        let ring =
            ((across * 3.0 + warp * 1.6 + hash(board, 25) * 7.0) * std::f32::consts::TAU).sin() * 0.5 + 0.5;
        let fibre = noise_xy(lines, UVec2::new(128, 6), 26);
        let color =
            Vec3::new(0.72, 0.50, 0.31).lerp(Vec3::new(0.55, 0.35, 0.20), 0.7 * ring * ring + 0.3 * fibre);
        let tint = 0.86 + 0.24 * hash(board, 27);
        let joint = across.min(1.0 - across) / PLANKS;
        let end = (along * 2.0).fract().min(1.0 - (along * 2.0).fract()) / 2.0;
        let gap = smooth(0.0015, 0.004, joint.min(end));
        Vec3::new(0.20, 0.12, 0.07).lerp(color * tint, gap)
    })
}

/// Pale wall panels, 4 × 4, in two close tones with darker joints.
pub fn panels(edge: u32) -> Image {
    paint("panels", edge, |uv| {
        let (panel, within) = cell(uv, 4.0, 4.0);
        let inside = Vec2::min(within, 1.0 - within).min_element();
        let tone = 0.97 + 0.05 * hash(panel, 31);
        let joint = smooth(0.02, 0.035, inside);
        Vec3::new(0.48, 0.50, 0.50).lerp(Vec3::new(0.78, 0.80, 0.78) * tone, joint)
    })
}

/// An image of `edge` × `edge` texels (at least one) from a colour for each texture coordinate.
///
/// `color` gets the centre of a texel, (0, 0) at the upper left corner of the image, and returns sRGB
/// in 0..=1, rounded here to 64 levels.
pub fn paint(name: &str, edge: u32, color: impl Fn(Vec2) -> Vec3) -> Image {
    let edge = edge.max(1);
    let mut rgba = Vec::with_capacity(4 * edge as usize * edge as usize);
    for y in 0..edge {
        for x in 0..edge {
            let texel = color((Vec2::new(x as f32, y as f32) + 0.5) / edge as f32);
            rgba.extend(
                texel.to_array().map(|value| ((value.clamp(0.0, 1.0) * 63.0).round() * 255.0 / 63.0) as u8),
            );
            rgba.push(255);
        }
    }
    Image { name: name.into(), width: edge, height: edge, rgba: rgba.into() }
}

/// Index of the cell of a regular division of the unit square, and the place inside it.
fn cell(uv: Vec2, columns: f32, rows: f32) -> (UVec2, Vec2) {
    let scaled = uv * Vec2::new(columns, rows);
    (scaled.as_uvec2(), scaled.fract())
}

fn smooth(low: f32, high: f32, value: f32) -> f32 {
    let t = ((value - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A number in [0, 1) that depends on nothing but its arguments.
fn hash(at: UVec2, seed: u32) -> f32 {
    let mut bits =
        at.x.wrapping_mul(0x8da6_b343) ^ at.y.wrapping_mul(0xd816_3841) ^ seed.wrapping_mul(0xcb1a_b31f);
    // Finaliser of MurmurHash3 (public domain).
    bits = (bits ^ (bits >> 16)).wrapping_mul(0x85eb_ca6b);
    bits = (bits ^ (bits >> 13)).wrapping_mul(0xc2b2_ae35);
    bits ^= bits >> 16;
    (bits >> 8) as f32 / (1 << 24) as f32
}

fn noise(uv: Vec2, cells: u32, seed: u32) -> f32 {
    noise_xy(uv, UVec2::splat(cells), seed)
}

/// Value noise in [0, 1), periodic over the unit square.
fn noise_xy(uv: Vec2, cells: UVec2, seed: u32) -> f32 {
    let scaled = uv * cells.as_vec2();
    let low = scaled.floor().as_uvec2() % cells;
    let t = scaled.fract();
    let t = t * t * (3.0 - 2.0 * t);
    let corner = |x, y| hash((low + UVec2::new(x, y)) % cells, seed);
    corner(0, 0).lerp(corner(1, 0), t.x).lerp(corner(0, 1).lerp(corner(1, 1), t.x), t.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean difference between two neighbouring rows or columns, in 0..=1.
    fn step(image: &Image, texel: impl Fn(u32, u32) -> (u32, u32), line: u32, next: u32) -> f32 {
        let edge = image.width;
        let difference = |i| {
            let [(ax, ay), (bx, by)] = [texel(line, i), texel(next, i)];
            (image.texel(ax, ay) - image.texel(bx, by)).abs().element_sum()
        };
        (0..edge).map(difference).sum::<f32>() / edge as f32
    }

    #[test]
    fn textures_repeat_without_a_seam() {
        for image in [chessboard(256), brick(256), wood(256), panels(256)] {
            for (axis, texel) in
                [(|l, i| (l, i)) as fn(u32, u32) -> (u32, u32), |l, i| (i, l)].into_iter().enumerate()
            {
                let worst = (0..255).map(|line| step(&image, texel, line, line + 1)).fold(0.0, f32::max);
                let seam = step(&image, texel, 255, 0);
                assert!(
                    seam <= worst * 1.05,
                    "{} axis {axis}: {seam} at the seam, {worst} inside",
                    image.name
                );
            }
        }
    }

    #[test]
    fn squares_alternate() {
        let board = chessboard(256);
        for square in 0..64 {
            let (x, y) = (square % 8, square / 8);
            let light = board.texel(x * 32 + 16, y * 32 + 16).x > 0.5;
            assert_eq!(light, (x + y) % 2 == 0, "square {x}, {y}");
        }
    }

    #[test]
    fn any_size_is_an_image() {
        for edge in [0, 1, 3, 100] {
            let image = brick(edge);
            assert_eq!(image.rgba.len() as u32, 4 * image.width * image.height);
            assert!(image.width >= 1);
        }
    }
}
