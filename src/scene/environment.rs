//! Loads latitude–longitude panoramas (.hdr, .exr) as environments.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;

use glam::Vec3;
use image::{ImageDecoder, ImageFormat, ImageReader};

use super::Environment;
use crate::constants::MAX_RADIANCE;
use crate::error::{Error, Result};
use crate::memory;

/// Most texels of a panorama: 8192 × 4096.
const MAX_TEXELS: u64 = 1 << 25;

/// Loads the panorama at `path`, OpenEXR or Radiance HDR by its content.
///
/// Radiance that is negative or not a number becomes 0, and what an RGBA16F target cannot hold (a sun)
/// becomes [`MAX_RADIANCE`].
///
/// # Errors
/// [`Error::Io`] if the file cannot be read; [`Error::Image`] if it is not such an image, or too large.
pub fn load(path: &Path) -> Result<Environment> {
    let refuse = |problem: String| Error::Image { path: path.into(), problem };
    // A device has no end, and opening a FIFO waits for ever.
    if !fs::metadata(path).map_err(Error::io(path))?.is_file() {
        return Err(refuse("not a regular file".into()));
    }
    let file = BufReader::new(File::open(path).map_err(Error::io(path))?);
    let reader = ImageReader::new(file).with_guessed_format().map_err(Error::io(path))?;
    if !matches!(reader.format(), Some(ImageFormat::Hdr | ImageFormat::OpenExr)) {
        return Err(refuse("neither Radiance HDR nor OpenEXR; convert the panorama to .hdr or .exr".into()));
    }
    let mut decoder = reader.into_decoder().map_err(|error| refuse(one_line(&error)))?;
    let (width, height) = decoder.dimensions();
    let texels = u64::from(width) * u64::from(height);
    if texels == 0 || texels > MAX_TEXELS {
        return Err(refuse(format!(
            "{width} × {height} texels; up to 8192 × 4096 are supported: scale it down"
        )));
    }
    // As the file has it, as three floats, and as what is kept.
    memory::check(decoder.total_bytes() + 28 * texels, &format!("{}", path.display()), "scale it down")?;
    let mut caps = image::Limits::no_limits();
    caps.max_alloc = Some(64 * texels + (64 << 20));
    decoder.set_limits(caps).map_err(|error| refuse(one_line(&error)))?;
    let decoded = image::DynamicImage::from_decoder(decoder).map_err(|error| refuse(one_line(&error)))?;
    let radiance =
        decoded.into_rgb32f().pixels().map(|texel| representable(Vec3::from_array(texel.0))).collect();
    let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    Ok(Environment { name, width, height, radiance })
}

/// A decoder's complaint; some span several lines.
fn one_line(error: &image::ImageError) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}

fn representable(radiance: Vec3) -> Vec3 {
    let within = |channel: f32| if channel.is_nan() { 0.0 } else { channel.clamp(0.0, MAX_RADIANCE) };
    Vec3::from_array(radiance.to_array().map(within))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_formats_keep_their_radiance() {
        let folder = tempfile::tempdir().unwrap();
        let panorama = image::Rgb32FImage::from_fn(4, 2, |x, y| image::Rgb([x as f32, y as f32, 2.5]));
        for name in ["sky.exr", "sky.hdr"] {
            let path = folder.path().join(name);
            image::DynamicImage::from(panorama.clone()).save(&path).unwrap();
            let loaded = load(&path).unwrap();
            assert_eq!((loaded.width, loaded.height, loaded.name.as_str()), (4, 2, name));
            assert!(
                (loaded.radiance[7] - Vec3::new(3.0, 1.0, 2.5)).length() < 0.02,
                "{}",
                loaded.radiance[7]
            );
        }
    }

    #[test]
    fn unusable_radiance() {
        let odd = Vec3::new(f32::NAN, -1.0, f32::INFINITY);
        assert_eq!(representable(odd), Vec3::new(0.0, 0.0, MAX_RADIANCE));
    }

    #[test]
    fn other_files_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        assert!(load(folder.path()).is_err());
        assert!(load(&folder.path().join("absent.hdr")).is_err());
        let path = folder.path().join("text.hdr");
        fs::write(&path, "no image").unwrap();
        assert!(load(&path).unwrap_err().to_string().contains(".exr"));
    }
}
