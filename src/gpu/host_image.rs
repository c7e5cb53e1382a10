//! Render targets that the host reads where they were drawn, without a copy.

use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;

use super::{
    Access, ColorTarget, DepthTarget, Draws, Format, Gpu, Image, ImageDesc, ImageUse, Recording, Targets,
    image::RawImage,
};
use crate::error::Result;

/// A linear image in host-cached, coherent memory, without gaps between its rows. Worth it where device and
/// host share their memory: a graphics card would draw over the bus.
///
/// Nothing but [`render_to_host`](Recording::render_to_host) draws to it, which borrows it: what the host
/// reads never changes under it.
#[derive(Debug)]
pub struct HostImage {
    image: Image,
    /// Byte of the memory at which the first row begins.
    start: usize,
}

impl HostImage {
    /// A render target; `None` if the device has none of this format and size that can be read in place.
    ///
    /// # Errors
    /// No memory left.
    pub fn new(
        gpu: &Arc<Gpu>,
        name: &str,
        format: Format,
        (width, height): (u32, u32),
    ) -> Result<Option<Self>> {
        let desc =
            ImageDesc { usage: ImageUse::HostTarget, ..ImageDesc::target(name, format, width, height) };
        if !RawImage::supported(gpu, &desc) {
            return Ok(None);
        }
        let image = Image::new(gpu, &desc)?;
        let part = vk::ImageSubresource::default().aspect_mask(vk::ImageAspectFlags::COLOR);
        // SAFETY: a live image with linear tiling.
        let layout = unsafe { gpu.device.get_image_subresource_layout(image.raw.handle, part) };
        let wanted = vk::MemoryPropertyFlags::HOST_CACHED | vk::MemoryPropertyFlags::HOST_COHERENT;
        let Some(allocation) = image.raw.allocation() else { return Ok(None) };
        let Some(mapped) = allocation.mapped_ptr() else { return Ok(None) };
        let end = layout.offset + image.bytes();
        if layout.row_pitch != u64::from(width) * format.texel_bytes()
            || !allocation.memory_properties().contains(wanted)
            || end > allocation.size()
        {
            return Ok(None);
        }
        // SAFETY: mapped, in bounds (checked), used by nobody yet. Rust may only see initialised bytes.
        unsafe { mapped.as_ptr().cast::<u8>().write_bytes(0, end as usize) };
        Ok(Some(Self { start: layout.offset as usize, image }))
    }

    /// Waits for the last submission that uses the image; returns its texels, row by row from the top.
    ///
    /// # Errors
    /// A lost device.
    pub fn read<T: Pod>(&mut self) -> Result<&[T]> {
        self.image.raw.wait()?;
        let Some(mapped) = self.image.raw.allocation().and_then(|allocation| allocation.mapped_ptr()) else {
            return Ok(&[]);
        };
        // SAFETY: mapped for the image's life, initialised and in bounds since creation; the device is done
        // with it (waited).
        let bytes = unsafe {
            std::slice::from_raw_parts(
                mapped.as_ptr().cast::<u8>().add(self.start),
                self.image.bytes() as usize,
            )
        };
        Ok(bytemuck::cast_slice(bytes))
    }

    /// Width and height in texels.
    pub fn size(&self) -> (u32, u32) {
        (self.image.width(), self.image.height())
    }

    /// Bytes of its texels.
    pub fn bytes(&self) -> u64 {
        self.image.bytes()
    }
}

impl<'a> Recording<'a> {
    /// Draws into `target`, cleared to 0, what `work` records, and makes it readable for the host.
    pub fn render_to_host(
        &mut self,
        target: &'a mut HostImage,
        depth: Option<DepthTarget<'_>>,
        work: impl FnOnce(&mut Draws<'_, 'a>),
    ) {
        let colors = [ColorTarget { image: &target.image, clear: Some([0.0; 4]), resolve: None }];
        self.render(&Targets { colors: &colors, depth }, work);
        self.image_access(&target.image.raw, Access::HostRead, false);
    }
}
