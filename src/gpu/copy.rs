//! Copies between buffers, images and the mip levels of one.

use std::{ops::Range, sync::Arc};

use ash::vk;

use super::{
    Access, DeviceBuffer, Image, ReadbackBuffer, Recording, UploadBuffer, access::image_barrier,
    buffer::RawBuffer, image::RawImage,
};

impl<'a> Recording<'a> {
    /// Copies level 0 of the first layer of `image` (depth, of a depth image) to the start of `target`, row by row.
    ///
    /// # Panics
    /// If it does not fit.
    pub fn read_image(&mut self, image: &Image, target: &'a mut ReadbackBuffer) {
        self.read_rows(image, 0..image.height(), target);
    }

    /// As [`read_image`](Self::read_image), but only some rows.
    ///
    /// # Panics
    /// If they do not fit, or the image has no such rows.
    pub fn read_rows(&mut self, image: &Image, rows: Range<u32>, target: &'a mut ReadbackBuffer) {
        assert!(!rows.is_empty() && rows.end <= image.height(), "{} has no rows {rows:?}", image.raw.name);
        let bytes = image.row_bytes() * rows.len() as u64;
        let aspect =
            if image.format().is_depth() { vk::ImageAspectFlags::DEPTH } else { vk::ImageAspectFlags::COLOR };
        let region = vk::BufferImageCopy {
            image_offset: vk::Offset3D { x: 0, y: rows.start as i32, z: 0 },
            image_extent: vk::Extent3D { width: image.width(), height: rows.len() as u32, depth: 1 },
            ..image_copy(&image.raw, aspect, 0, 0)
        };
        self.read_region(image, region, bytes, target);
    }

    /// Copies one mip level of one layer of a texture to the start of `target`, row by row.
    ///
    /// # Panics
    /// If it does not fit, or the image has no such level or layer.
    pub fn read_level(&mut self, image: &Image, level: u32, layer: u32, target: &'a mut ReadbackBuffer) {
        let name = &image.raw.name;
        assert!(level < image.raw.mips && layer < image.raw.layers, "{name} has no level {level} of {layer}");
        let (width, height) = ((image.width() >> level).max(1), (image.height() >> level).max(1));
        let whole = image_copy(&image.raw, vk::ImageAspectFlags::COLOR, layer, 0);
        let region = vk::BufferImageCopy {
            image_subresource: vk::ImageSubresourceLayers { mip_level: level, ..whole.image_subresource },
            image_extent: vk::Extent3D { width, height, depth: 1 },
            ..whole
        };
        let bytes = u64::from(width) * u64::from(height) * image.format().texel_bytes();
        self.read_region(image, region, bytes, target);
    }

    fn read_region(
        &mut self,
        image: &Image,
        region: vk::BufferImageCopy,
        bytes: u64,
        target: &'a mut ReadbackBuffer,
    ) {
        assert!(bytes <= target.size(), "{} does not fit into {}", image.raw.name, target.raw.name);
        self.image_access(&image.raw, Access::TransferRead, false);
        self.buffer_access(&target.raw, Access::TransferWrite);
        // SAFETY: recording; the copy fits and both sides are in the right layout or access.
        unsafe {
            self.device().cmd_copy_image_to_buffer(
                self.raw(),
                image.raw.handle,
                Access::TransferRead.layout(),
                target.raw.handle,
                &[region],
            );
        }
        self.buffer_access(&target.raw, Access::HostRead);
    }

    /// Copies the first `bytes` bytes of `source` to the start of `target`.
    ///
    /// # Panics
    /// If either is smaller.
    pub fn read_buffer(&mut self, source: &DeviceBuffer, target: &'a mut ReadbackBuffer, bytes: u64) {
        assert!(bytes <= source.size() && bytes <= target.size(), "{}: copy past the end", source.raw.name);
        self.buffer_access(&source.raw, Access::TransferRead);
        self.buffer_access(&target.raw, Access::TransferWrite);
        let regions = [vk::BufferCopy::default().size(bytes.max(4))];
        // SAFETY: recording; in bounds; both sides are in the right access.
        unsafe { self.device().cmd_copy_buffer(self.raw(), source.raw.handle, target.raw.handle, &regions) };
        self.buffer_access(&target.raw, Access::HostRead);
    }

    /// Sets all of `buffer` to repetitions of `value`.
    pub fn fill(&mut self, buffer: &DeviceBuffer, value: u32) {
        self.buffer_access(&buffer.raw, Access::TransferWrite);
        // SAFETY: recording; the size of every buffer is a multiple of 4.
        unsafe { self.device().cmd_fill_buffer(self.raw(), buffer.raw.handle, 0, vk::WHOLE_SIZE, value) };
    }

    /// Copies parts of `source` to `target`, each a source offset, a target offset and a size in bytes.
    pub(super) fn upload_buffer(
        &mut self,
        source: &'a UploadBuffer,
        target: &Arc<RawBuffer>,
        parts: &[vk::BufferCopy],
    ) {
        self.buffer_access(&source.raw, Access::TransferRead);
        self.buffer_access(target, Access::TransferWrite);
        // SAFETY: recording; the caller checked the bounds.
        unsafe { self.device().cmd_copy_buffer(self.raw(), source.raw.handle, target.handle, parts) };
    }

    /// Copies `source`, from byte `offset`, to level 0 of one layer of a texture.
    pub(super) fn upload_image(
        &mut self,
        source: &'a UploadBuffer,
        offset: u64,
        target: &Arc<RawImage>,
        layer: u32,
    ) {
        self.buffer_access(&source.raw, Access::TransferRead);
        self.image_access(target, Access::TransferWrite, false);
        let regions = [image_copy(target, vk::ImageAspectFlags::COLOR, layer, offset)];
        // SAFETY: recording; the caller checked the bounds; the layout is the right one.
        unsafe {
            self.device().cmd_copy_buffer_to_image(
                self.raw(),
                source.raw.handle,
                target.handle,
                Access::TransferWrite.layout(),
                &regions,
            );
        }
    }

    /// Fills mip levels 1 and up of all layers from level 0 by repeated halving, and readies the image for
    /// shaders.
    pub(super) fn make_mips(&mut self, image: &Arc<RawImage>) {
        self.image_access(image, Access::TransferWrite, false);
        for level in 0..image.mips {
            if level > 0 {
                self.blit((image, level - 1), (image, level));
            }
            self.mip_barrier(image, (level, 1), (Access::TransferWrite, Access::TransferRead));
        }
        self.mip_barrier(image, (0, image.mips), (Access::TransferRead, Access::ShaderRead));
        self.touch_image(image, Access::ShaderRead);
    }

    /// Fills all of `to` with all of `from`: where each side of it is half as long, with the means of four texels each.
    ///
    /// # Panics
    /// If they differ in format.
    pub fn shrink(&mut self, from: &Image, to: &Image) {
        assert_eq!(from.format(), to.format(), "{} and {} differ in format", from.raw.name, to.raw.name);
        self.image_access(&from.raw, Access::TransferRead, false);
        self.image_access(&to.raw, Access::TransferWrite, true);
        self.blit((&from.raw, 0), (&to.raw, 0));
    }

    /// Copies one level to another, filtered linearly; the caller has readied both.
    fn blit(&mut self, from: (&RawImage, u32), to: (&RawImage, u32)) {
        let layers = |(image, level): (&RawImage, u32)| vk::ImageSubresourceLayers {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            mip_level: level,
            base_array_layer: 0,
            layer_count: image.layers,
        };
        let extent = |(image, level): (&RawImage, u32)| {
            let size = |size: u32| (size >> level).max(1) as i32;
            [vk::Offset3D::default(), vk::Offset3D { x: size(image.width), y: size(image.height), z: 1 }]
        };
        let region = [vk::ImageBlit2::default()
            .src_subresource(layers(from))
            .src_offsets(extent(from))
            .dst_subresource(layers(to))
            .dst_offsets(extent(to))];
        let info = vk::BlitImageInfo2::default()
            .src_image(from.0.handle)
            .src_image_layout(Access::TransferRead.layout())
            .dst_image(to.0.handle)
            .dst_image_layout(Access::TransferWrite.layout())
            .regions(&region)
            .filter(vk::Filter::LINEAR);
        // SAFETY: recording; the source is in the layout of a source, the other in that of a target.
        unsafe { self.device().cmd_blit_image2(self.raw(), &info) };
    }

    fn mip_barrier(&mut self, image: &RawImage, mips: (u32, u32), accesses: (Access, Access)) {
        let barriers = [image_barrier(image.handle, image.format.aspect(), mips, accesses, false)];
        let dependency = vk::DependencyInfo::default().image_memory_barriers(&barriers);
        // SAFETY: recording, outside of a render pass.
        unsafe { self.device().cmd_pipeline_barrier2(self.raw(), &dependency) };
    }
}

fn image_copy(
    image: &RawImage,
    aspect: vk::ImageAspectFlags,
    layer: u32,
    offset: u64,
) -> vk::BufferImageCopy {
    vk::BufferImageCopy::default()
        .buffer_offset(offset)
        .image_subresource(vk::ImageSubresourceLayers {
            aspect_mask: aspect,
            mip_level: 0,
            base_array_layer: layer,
            layer_count: 1,
        })
        .image_extent(vk::Extent3D { width: image.width, height: image.height, depth: 1 })
}
