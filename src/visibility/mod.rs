//! Which faces are visible, and in which pixels (paper §3.1).

/// The ID buffer in host memory: the visible face of every pixel.
#[derive(Clone, Copy)]
pub struct IdImage<'a> {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// RGBA8 texels as little-endian words: face + 1 in the low 24 bits, 0 for none.
    pub texels: &'a [u32],
}

impl IdImage<'_> {
    /// The face seen at pixel (`x`, `y`).
    pub fn face(&self, x: u32, y: u32) -> Option<u32> {
        let texel = self.texels[(y * self.width + x) as usize] & 0xff_ffff;
        texel.checked_sub(1)
    }
}
