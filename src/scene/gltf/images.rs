//! Decodes the images in use to RGBA8, within a budget that is checked before the decoder starts.

use std::borrow::Cow;
use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

use gltf::json::{Image as Source, Root};
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};

use super::Limits;
use super::buffers::Buffers;
use super::textures::image_of;
use super::uri::Resolver;
use crate::error::{Error, Result};
use crate::memory;
use crate::scene::Image;

/// Longest side of an image; what Vulkan devices commonly allow.
const MAX_SIDE: u32 = 16384;

/// Encoded bytes of unused images that are looked at.
const MAX_UNUSED_BYTES: u64 = 1 << 30;

/// Decodes the images `used`, in their order.
pub fn load(
    root: &Root,
    used: &[usize],
    buffers: &Buffers,
    resolver: &Resolver,
    file: &Path,
    limits: &Limits,
) -> Result<Vec<Image>> {
    let refuse =
        |index: usize| move |problem: String| Error::scene(file, format!("images[{index}]"), problem);
    // All headers before the first decoding, so that a file over the budget is refused at once.
    let (mut decoded, mut largest, mut encoded_left) = (0_u64, 0, limits.max_file_bytes);
    let mut sources = Vec::with_capacity(used.len());
    for &index in used {
        let bytes = encoded(root, &root.images[index], buffers, resolver).map_err(refuse(index))?;
        // Images may lie over the same bytes, which some decoders read to the end every time.
        encoded_left = encoded_left
            .checked_sub(bytes.len() as u64)
            .ok_or_else(|| refuse(index)("too many bytes of encoded images in all; share images".into()))?;
        let budget = limits.max_texture_bytes.saturating_sub(decoded);
        let cost = Cost::of(&bytes).and_then(|cost| cost.within(budget)).map_err(refuse(index))?;
        decoded += cost.rgba;
        largest = largest.max(cost.peak());
        sources.push((index, bytes));
    }
    memory::check(decoded + largest, "textures", memory::SMALLER_TEXTURES)?;
    sources
        .into_iter()
        .map(|(index, bytes)| {
            let (width, height, rgba) = decode(&bytes).map_err(refuse(index))?;
            Ok(Image { name: name(&root.images[index], index), width, height, rgba })
        })
        .collect()
}

/// What an image costs to decode, from its header.
struct Cost {
    width: u32,
    height: u32,
    /// Bytes of its RGBA8 form.
    rgba: u64,
    /// Bytes of the form that it is decoded to first.
    raw: u64,
}

impl Cost {
    fn of(bytes: &[u8]) -> std::result::Result<Self, String> {
        let decoder = open(bytes)?;
        let (width, height) = decoder.dimensions();
        if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE {
            return Err(format!("{width} × {height} texels; sides of 1 to {MAX_SIDE} are supported"));
        }
        let rgba = 4 * u64::from(width) * u64::from(height);
        Ok(Self { width, height, rgba, raw: decoder.total_bytes() })
    }

    /// The decoded texels, their RGBA8 form and the shared copy: never more than two of them at a time.
    fn peak(&self) -> u64 {
        self.rgba + self.rgba.max(self.raw)
    }

    fn within(self, budget: u64) -> std::result::Result<Self, String> {
        let peak = self.peak();
        if peak <= budget {
            return Ok(self);
        }
        Err(format!(
            "{} × {} texels take {peak} bytes to decode, but the texture budget has {budget} left; \
             shrink the image or raise --max-texture-bytes N",
            self.width, self.height
        ))
    }
}

/// Width, height and RGBA8 texels of an encoded image whose cost is known to be bearable.
fn decode(bytes: &[u8]) -> std::result::Result<(u32, u32, Arc<[u8]>), String> {
    let mut decoder = open(bytes)?;
    let mut caps = image::Limits::no_limits();
    caps.max_alloc = Some(decoder.total_bytes() + (64 << 20));
    decoder.set_limits(caps).map_err(one_line)?;
    let rgba = DynamicImage::from_decoder(decoder).map_err(one_line)?.into_rgba8();
    Ok((rgba.width(), rgba.height(), rgba.into_raw().into()))
}

/// Every image must be there and have the header of one, used or not, unless only an extension knows it. Returns the
/// bytes that those not `used` would take as RGBA8; none of them is decoded.
pub fn check_unused(
    root: &Root,
    used: &[usize],
    buffers: &Buffers,
    resolver: &Resolver,
    file: &Path,
) -> Result<u64> {
    // An image that no texture names may belong to an extension of one, in a format of its own.
    let no_extensions = root.textures.iter().all(|texture| texture.extensions.is_none());
    let mut wanted = vec![no_extensions; root.images.len()];
    root.textures.iter().filter_map(|texture| image_of(root, texture)).for_each(|index| wanted[index] = true);
    used.iter().for_each(|&index| wanted[index] = false);
    let (mut bytes_left, mut decoded) = (MAX_UNUSED_BYTES, 0);
    for (index, source) in root.images.iter().enumerate().filter(|(index, _)| wanted[*index]) {
        let refuse = |problem: String| Error::scene(file, format!("images[{index}]"), problem);
        let bytes = encoded(root, source, buffers, resolver).map_err(refuse)?;
        let Some(rest) = bytes_left.checked_sub(bytes.len() as u64) else { break };
        bytes_left = rest;
        let (width, height) = open(&bytes).map_err(refuse)?.dimensions();
        decoded += 4 * u64::from(width) * u64::from(height);
    }
    Ok(decoded)
}

/// The bytes of an image as the file holds them.
fn encoded<'a>(
    root: &Root,
    source: &Source,
    buffers: &'a Buffers,
    resolver: &Resolver,
) -> std::result::Result<Cow<'a, [u8]>, String> {
    match (&source.uri, source.buffer_view) {
        (_, Some(view)) => Ok(Cow::Borrowed(buffers.view(root, view))),
        (Some(uri), None) => resolver.read(uri).map(Cow::Owned),
        (None, None) => Err("has no data".into()),
    }
}

/// A decoder that has read the header of an encoded image. The format is told by content: names and MIME
/// types are often wrong.
fn open(bytes: &[u8]) -> std::result::Result<impl ImageDecoder, String> {
    let format = image::guess_format(bytes).ok();
    let format = format.filter(|it| matches!(it, ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP));
    let format = format.ok_or("not a PNG, JPEG or WebP image")?;
    ImageReader::with_format(Cursor::new(bytes), format).into_decoder().map_err(one_line)
}

/// A decoder's complaint; some span several lines.
fn one_line(error: image::ImageError) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}

fn name(source: &Source, index: usize) -> String {
    let uri = source.uri.as_ref().filter(|uri| !uri.starts_with("data:"));
    source.name.clone().or_else(|| uri.cloned()).unwrap_or_else(|| format!("image {index}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn png(image: &DynamicImage) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, ImageFormat::Png).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn grey_and_deep_images_become_rgba8() {
        let grey = png(&DynamicImage::ImageLuma8(image::GrayImage::from_pixel(2, 1, image::Luma([77]))));
        assert_eq!(&*decode(&grey).unwrap().2, [77, 77, 77, 255, 77, 77, 77, 255]);
        let deep = image::ImageBuffer::from_pixel(1, 1, image::Rgba([65535_u16, 32896, 257, 0]));
        let deep = png(&DynamicImage::ImageRgba16(deep));
        assert_eq!(&*decode(&deep).unwrap().2, [255, 128, 1, 0]);
    }

    #[test]
    fn the_budget_is_checked_from_the_header() {
        let mut bomb = png(&DynamicImage::new_luma8(8, 8));
        // 16384 × 16384 in the header, no data to match: the cost is known without decoding.
        bomb[16..24].copy_from_slice(&[0, 0, 64, 0, 0, 0, 64, 0]);
        let crc = crc32(&bomb[12..29]);
        bomb[29..33].copy_from_slice(&crc.to_be_bytes());
        let cost = Cost::of(&bomb).unwrap();
        assert_eq!((cost.rgba, cost.raw), (1 << 30, 1 << 28));
        assert!(cost.within((1 << 31) - 1).is_err_and(|problem| problem.contains("--max-texture-bytes")));
    }

    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0_u32, |crc, byte| {
            (0..8)
                .fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
        })
    }
}
