//! What is drawn over the picture on the CPU: text, lines, the divider.

use std::ops::Range;

use font8x8::legacy::BASIC_LEGACY;
use glam::Vec2;

use super::exchange::Pixels;

/// Side of a glyph's cell in pixels.
pub const GLYPH: u32 = 8;

/// Height of a line of text in pixels.
pub const LINE: u32 = 10;

/// Border of lines and marks.
const BORDER: Color = [16, 16, 16];

/// An opaque sRGB colour.
pub type Color = [u8; 3];

impl Pixels {
    /// An image of one colour.
    pub fn filled(width: u32, height: u32, [r, g, b]: Color) -> Self {
        Self { width, height, rgba: [r, g, b, 255].repeat(width as usize * height as usize) }
    }

    /// The same picture at another size, between its pixels linear in their bytes.
    pub fn scaled(&self, width: u32, height: u32) -> Self {
        if (self.width, self.height) == (width, height) {
            return self.clone();
        }
        if self.rgba.is_empty() {
            return Self::filled(width, height, [0; 3]);
        }
        let columns = between(width, self.width);
        let mut rgba = Vec::with_capacity(width as usize * height as usize * 4);
        for (top, bottom, down) in between(height, self.height) {
            let row = |y: usize| self.rgba[y * self.width as usize * 4..].as_chunks::<4>().0;
            let (upper, lower) = (row(top), row(bottom));
            rgba.extend(columns.iter().flat_map(|&(left, right, across)| {
                let corners = [upper[left], upper[right], lower[left], lower[right]];
                let mix = |a: u8, b: u8, share: u32| u32::from(a) * (256 - share) + u32::from(b) * share;
                std::array::from_fn::<u8, 4, _>(|channel| {
                    let [a, b, c, d] = corners.map(|pixel| pixel[channel]);
                    let sum = mix(a, b, across) * (256 - down) + mix(c, d, across) * down;
                    ((sum + (1 << 15)) >> 16) as u8
                })
            }));
        }
        Self { width, height, rgba }
    }

    /// Takes the columns from `column` on from `other`, which is of the same size.
    pub fn take_right(&mut self, column: u32, other: &Self) {
        if (self.width, self.height) != (other.width, other.height) || column >= self.width {
            return;
        }
        let (row, from) = (self.width as usize * 4, column as usize * 4);
        for (mine, theirs) in self.rgba.chunks_exact_mut(row).zip(other.rgba.chunks_exact(row)) {
            mine[from..].copy_from_slice(&theirs[from..]);
        }
    }

    /// Sets a pixel; outside of the image nothing happens.
    pub fn set(&mut self, x: i32, y: i32, color: Color) {
        if x >= 0 && y >= 0 && x < self.width as i32 && y < self.height as i32 {
            let at = (y as usize * self.width as usize + x as usize) * 4;
            self.rgba[at..at + 3].copy_from_slice(&color);
        }
    }

    /// Darkens a rectangle, so that text on it can be read.
    pub fn darken(&mut self, left: u32, top: u32, width: u32, height: u32) {
        let right = left.saturating_add(width).min(self.width);
        for y in top..top.saturating_add(height).min(self.height) {
            for x in left.min(right)..right {
                let at = (y as usize * self.width as usize + x as usize) * 4;
                for byte in &mut self.rgba[at..at + 3] {
                    *byte /= 4;
                }
            }
        }
    }

    /// Writes ASCII text with its top left corner at (`x`, `y`).
    pub fn text(&mut self, x: i32, y: i32, text: &str, color: Color) {
        for (index, char) in text.chars().enumerate() {
            let glyph = BASIC_LEGACY.get(char as usize).unwrap_or(&BASIC_LEGACY['?' as usize]);
            let left = x.saturating_add(index as i32 * GLYPH as i32);
            if left >= self.width as i32 {
                break;
            }
            for (row, bits) in glyph.iter().enumerate() {
                for column in (0..GLYPH as i32).filter(|column| bits >> column & 1 == 1) {
                    self.set(left + column, y + row as i32, color);
                }
            }
        }
    }

    /// Writes lines on a darkened ground, their top left corner at (`left`, `top`).
    pub fn lines(&mut self, left: u32, top: u32, lines: &[String], color: Color) {
        let Some(longest) = lines.iter().map(|line| line.chars().count() as u32).max() else { return };
        self.darken(left, top, longest * GLYPH + 8, lines.len() as u32 * LINE + 6);
        for (row, line) in lines.iter().enumerate() {
            self.text(left as i32 + 4, top as i32 + 4 + row as i32 * LINE as i32, line, color);
        }
    }

    /// Draws a line, two pixels wide, with a dark border that parts it from a bright ground.
    pub fn line(&mut self, from: Vec2, to: Vec2, color: Color) {
        self.stroke(from, to, BORDER, -1..3);
        self.stroke(from, to, color, 0..2);
    }

    /// Draws a mark around a point, with a dark border.
    pub fn mark(&mut self, at: Vec2, color: Color) {
        self.stroke(at, at, BORDER, -3..5);
        self.stroke(at, at, color, -2..4);
    }

    /// Draws squares along a line, which reach over `brush` beside each point on both axes.
    fn stroke(&mut self, from: Vec2, to: Vec2, color: Color, brush: Range<i32>) {
        let Some((from, to)) = clip(from, to, Vec2::new(self.width as f32, self.height as f32)) else {
            return;
        };
        let steps = (to - from).abs().max_element().ceil().max(1.0);
        for step in 0..=steps as u32 {
            let at = from.lerp(to, step as f32 / steps).floor().as_ivec2();
            for y in brush.clone() {
                brush.clone().for_each(|x| self.set(at.x + x, at.y + y, color));
            }
        }
    }
}

/// Between which two of `from` pixels the centre of each of `of` lies, and how near to the second, 0 to 256.
fn between(of: u32, from: u32) -> Vec<(usize, usize, u32)> {
    let last = from.saturating_sub(1);
    let place = |at: u32| {
        let centre = (f64::from(at) + 0.5) * f64::from(from) / f64::from(of) - 0.5;
        let centre = centre.clamp(0.0, last.into());
        let first = centre as u32;
        let share = ((centre - f64::from(first)) * 256.0) as u32;
        (first as usize, (first + 1).min(last) as usize, share)
    };
    (0..of).map(place).collect()
}

/// The part of a line inside the image, a little more than that; `None` if there is none (Liang and Barsky).
fn clip(from: Vec2, to: Vec2, size: Vec2) -> Option<(Vec2, Vec2)> {
    let (mut enter, mut leave) = (0.0_f32, 1.0_f32);
    let along = to - from;
    for axis in 0..2 {
        for (distance, speed) in
            [(from[axis] + 2.0, -along[axis]), (size[axis] + 2.0 - from[axis], along[axis])]
        {
            if speed == 0.0 && distance < 0.0 {
                return None;
            } else if speed > 0.0 {
                leave = leave.min(distance / speed);
            } else if speed < 0.0 {
                enter = enter.max(distance / speed);
            }
        }
    }
    (enter <= leave).then(|| (from + along * enter, from + along * leave))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lit(pixels: &Pixels) -> usize {
        pixels.rgba.chunks_exact(4).filter(|pixel| pixel[0] == 255).count()
    }

    #[test]
    fn drawing_stays_inside() {
        let mut pixels = Pixels::filled(20, 10, [0; 3]);
        pixels.text(-3, 5, "Wide text that does not fit", [255; 3]);
        pixels.line(Vec2::new(-1e9, -3e8), Vec2::new(1e9, 4e8), [255; 3]);
        pixels.line(Vec2::new(-10.0, 50.0), Vec2::new(30.0, 60.0), [255; 3]);
        pixels.lines(15, 8, &["a".into(), "long line".into()], [255; 3]);
        assert!(lit(&pixels) > 10 && pixels.rgba.len() == 20 * 10 * 4);
        let mut dot = Pixels::filled(1, 1, [0; 3]);
        dot.lines(0, 0, &["x".into()], [255; 3]);
        dot.line(Vec2::ZERO, Vec2::ONE, [255; 3]);
    }

    #[test]
    fn a_line_outside_is_clipped_away() {
        let size = Vec2::new(20.0, 10.0);
        assert_eq!(clip(Vec2::new(-9.0, 0.0), Vec2::new(-5.0, 9.0), size), None);
        let (from, to) = clip(Vec2::new(-100.0, 5.0), Vec2::new(100.0, 5.0), size).unwrap();
        assert!((from.x + 2.0).abs() < 1e-4 && (to.x - 22.0).abs() < 1e-4);
    }

    #[test]
    fn scaling_is_linear_between_centres() {
        let mut pixels = Pixels::filled(2, 1, [0; 3]);
        pixels.set(1, 0, [255; 3]);
        let wide = pixels.scaled(4, 2);
        assert_eq!((wide.width, wide.height), (4, 2));
        let row: Vec<u8> = wide.rgba.chunks_exact(4).map(|pixel| pixel[1]).collect();
        assert_eq!(row, [0, 64, 191, 255].repeat(2));
        assert!(wide.rgba.chunks_exact(4).all(|pixel| pixel[3] == 255));
        assert_eq!(pixels.scaled(1, 1).rgba.len(), 4);
        assert_eq!(Pixels::filled(3, 5, [7; 3]).scaled(8, 4).rgba, Pixels::filled(8, 4, [7; 3]).rgba);
    }

    #[test]
    fn the_divider_parts_two_images() {
        let mut left = Pixels::filled(4, 2, [0; 3]);
        left.take_right(3, &Pixels::filled(4, 2, [255; 3]));
        assert_eq!(lit(&left), 2);
        left.take_right(9, &Pixels::filled(4, 2, [255; 3]));
        assert_eq!(lit(&left), 2);
    }
}
