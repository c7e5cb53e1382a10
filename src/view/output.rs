//! What leaves the viewer: lines on the terminal, screenshots.

use std::{
    io::Write,
    path::{Path, PathBuf},
};

use super::exchange::Pixels;
use crate::{
    error::{Error, Result, one_line},
    report::{FloatImage, image::srgb_decode, output::write_image},
};

/// Most screenshots of one folder.
const MOST: u32 = 9999;

/// Writes `text` to standard output; a reader that closed the pipe has read enough.
pub fn tell(text: &str) {
    let _ = writeln!(std::io::stdout(), "{text}");
}

/// Writes an error that does not end the program to standard error.
pub fn complain(error: &Error) {
    let _ = writeln!(std::io::stderr(), "error: {}", one_line(&error.to_string()));
}

/// A file in the current folder that is not there yet.
///
/// # Errors
/// [`Error::Option`] if all names are taken.
pub fn next_screenshot() -> Result<PathBuf> {
    let mut names = (1..=MOST).map(|number| PathBuf::from(format!("vtrace-{number}.png")));
    names.find(|file| !file.exists()).ok_or_else(|| {
        Error::Option(format!("all names up to vtrace-{MOST}.png are taken; move some screenshots away"))
    })
}

/// Writes `pixels` byte for byte.
///
/// # Errors
/// See [`write_image`].
pub fn write_screenshot(file: &Path, pixels: &Pixels) -> Result<()> {
    let decoded: [f32; 256] = std::array::from_fn(|byte| srgb_decode(byte as f32 / 255.0));
    let linear = |p: &[u8]| [p[0], p[1], p[2]].map(|byte| decoded[usize::from(byte)]);
    let image = FloatImage {
        width: pixels.width,
        height: pixels.height,
        pixels: pixels.rgba.chunks_exact(4).map(linear).collect(),
    };
    write_image(file, &image, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn screenshots_keep_every_byte() {
        let mut pixels = Pixels::filled(256, 1, [0; 3]);
        for byte in 0..=255 {
            pixels.set(i32::from(byte), 0, [byte, 255 - byte, byte / 2]);
        }
        let file = tempfile::Builder::new().suffix(".png").tempfile().unwrap();
        write_screenshot(file.path(), &pixels).unwrap();
        let read = FloatImage::read(file.path()).unwrap();
        assert_eq!(super::super::encode::rgba(&read, 0.0), pixels.rgba);
    }
}
