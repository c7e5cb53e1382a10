//! Recording, submitting and waiting: a command buffer owns what it uses until the device is done with it.

use std::{any::Any, ops::Range, sync::Arc};

use ash::vk;
use bytemuck::Pod;

use super::{
    Access, ComputePipeline, DescriptorSet, DeviceBuffer, Gpu, Image, ReadbackBuffer, Timing, UploadBuffer,
    access::{image_barrier, memory_barrier},
    buffer::RawBuffer,
    image::RawImage,
    timestamps::Timestamps,
};
use crate::error::Result;

/// A command buffer that is recorded and submitted again and again.
pub struct Commands {
    gpu: Arc<Gpu>,
    name: String,
    pool: vk::CommandPool,
    buffer: vk::CommandBuffer,
    timestamps: Option<Timestamps>,
    /// Timeline value of the last submission.
    submitted: u64,
    /// Everything that the last recording uses, with the access that each had before.
    touched: Vec<Touched>,
    held: Vec<Arc<dyn Any + Send + Sync>>,
}

enum Touched {
    Buffer(Arc<RawBuffer>, Access),
    Image(Arc<RawImage>, Access),
}

impl Commands {
    /// A command buffer with room for `scopes` timed scopes.
    ///
    /// # Errors
    /// No memory left.
    pub fn new(gpu: &Arc<Gpu>, name: &str, scopes: u32) -> Result<Self> {
        let info = vk::CommandPoolCreateInfo::default().queue_family_index(gpu.queue_family);
        // SAFETY: a live device; the queue family exists.
        let pool = gpu
            .call("vkCreateCommandPool", name, |device| unsafe { device.create_command_pool(&info, None) })?;
        // From here on `commands` frees the pool if a later step fails.
        let mut commands = Self {
            gpu: gpu.clone(),
            name: name.into(),
            pool,
            buffer: vk::CommandBuffer::null(),
            timestamps: None,
            submitted: 0,
            touched: Vec::new(),
            held: Vec::new(),
        };
        gpu.name(pool, name);
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        // SAFETY: a live pool, which only this object uses.
        commands.buffer = gpu.call("vkAllocateCommandBuffers", name, |device| unsafe {
            device.allocate_command_buffers(&info)
        })?[0];
        gpu.name(commands.buffer, name);
        commands.timestamps = Some(Timestamps::new(gpu, name, scopes)?);
        Ok(commands)
    }

    /// Starts a recording, once the device is done with the last one.
    ///
    /// Recordings that use the same resources must be submitted in the order in which they were recorded.
    ///
    /// # Errors
    /// A lost device.
    pub fn begin(&mut self) -> Result<Recording<'_>> {
        self.gpu.wait(self.submitted, &self.name)?;
        self.touched.clear();
        self.held.clear();
        if let Some(timestamps) = &mut self.timestamps {
            timestamps.reset();
        }
        // SAFETY: the device is done with the pool's only command buffer.
        self.gpu.call("vkResetCommandPool", &self.name, |device| unsafe {
            device.reset_command_pool(self.pool, vk::CommandPoolResetFlags::empty())
        })?;
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the command buffer was reset.
        self.gpu.call("vkBeginCommandBuffer", &self.name, |device| unsafe {
            device.begin_command_buffer(self.buffer, &info)
        })?;
        Ok(Recording { commands: self, submitted: false })
    }

    /// Waits for the last submission; returns the time of each of its scopes, none without timestamps.
    ///
    /// # Errors
    /// A lost device.
    pub fn timings(&self) -> Result<Vec<Timing>> {
        self.gpu.wait(self.submitted, &self.name)?;
        self.timestamps.as_ref().map_or(Ok(Vec::new()), Timestamps::read)
    }
}

impl Drop for Commands {
    fn drop(&mut self) {
        // A lost device has finished too.
        let _ = self.gpu.wait(self.submitted, &self.name);
        // SAFETY: the device is done with the pool's only command buffer, which goes with it.
        unsafe { self.gpu.device.destroy_command_pool(self.pool, None) };
    }
}

/// A command buffer while it is recorded. Dropped without [`submit`](Self::submit), it has no effect.
pub struct Recording<'a> {
    commands: &'a mut Commands,
    submitted: bool,
}

/// Work under way on the device.
#[must_use = "the work goes on, but errors are only seen by waiting"]
pub struct Submission {
    gpu: Arc<Gpu>,
    value: u64,
    name: String,
}

impl<'a> Recording<'a> {
    /// Records `work` as a scope called `name`, whose time [`Commands::timings`] tells.
    pub fn timed<T>(&mut self, name: &'static str, work: impl FnOnce(&mut Self) -> T) -> T {
        let buffer = self.commands.buffer;
        let scope = self.commands.timestamps.as_mut().and_then(|timestamps| {
            let scope = timestamps.open(name)?;
            timestamps.write(buffer, scope, false);
            Some(scope)
        });
        let result = work(self);
        if let (Some(scope), Some(timestamps)) = (scope, &self.commands.timestamps) {
            timestamps.write(buffer, scope, true);
        }
        result
    }

    /// Lets `access` to `image` follow what was recorded before. Render passes and copies do this themselves.
    pub fn use_image(&mut self, image: &Image, access: Access) {
        self.image_access(&image.raw, access, false);
    }

    /// Lets `access` to `buffer` follow what was recorded before. Copies do this themselves.
    pub fn use_buffer(&mut self, buffer: &DeviceBuffer, access: Access) {
        self.buffer_access(&buffer.raw, access);
    }

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

    /// Runs `groups` workgroups of a compute pipeline.
    ///
    /// # Panics
    /// If `push` is not of the size that the pipeline was made for.
    pub fn dispatch<P: Pod>(
        &mut self,
        pipeline: &ComputePipeline,
        sets: &[&DescriptorSet],
        push: &P,
        groups: [u32; 3],
    ) {
        let (raw, commands) = (&pipeline.raw, self.raw());
        let bytes = bytemuck::bytes_of(push);
        assert_eq!(bytes.len(), raw.push_bytes as usize, "size of push constants");
        let handles: Vec<_> = sets.iter().map(|set| set.raw.handle).collect();
        let point = vk::PipelineBindPoint::COMPUTE;
        let device = self.device();
        // SAFETY: recording; everything bound is held until the device is done.
        unsafe {
            device.cmd_bind_pipeline(commands, point, raw.handle);
            if !handles.is_empty() {
                device.cmd_bind_descriptor_sets(commands, point, raw.layout, 0, &handles, &[]);
            }
            if !bytes.is_empty() {
                device.cmd_push_constants(commands, raw.layout, raw.push_stages, 0, bytes);
            }
            device.cmd_dispatch(commands, groups[0], groups[1], groups[2]);
        }
        self.hold(raw.clone());
        for set in sets {
            self.hold(set.raw.clone());
        }
    }

    /// Hands the recording to the device.
    ///
    /// # Errors
    /// A lost device, or no memory left.
    pub fn submit(self) -> Result<Submission> {
        self.submit_between(None, None)
    }

    /// As [`submit`](Self::submit); the first transfer waits for `after`, and `before` is signalled at the end.
    pub(super) fn submit_between(
        mut self,
        after: Option<vk::Semaphore>,
        before: Option<vk::Semaphore>,
    ) -> Result<Submission> {
        let commands = &mut *self.commands;
        let (gpu, buffer) = (&commands.gpu, commands.buffer);
        // SAFETY: recording, outside of a render pass.
        gpu.call("vkEndCommandBuffer", &commands.name, |device| unsafe {
            device.end_command_buffer(buffer)
        })?;
        let value = gpu.submit(buffer, &commands.name, after, before)?;
        commands.submitted = value;
        for touched in &commands.touched {
            match touched {
                Touched::Buffer(buffer, _) => buffer.set_busy_until(value),
                Touched::Image(image, _) => image.set_busy_until(value),
            }
        }
        let submission = Submission { gpu: gpu.clone(), value, name: commands.name.clone() };
        self.submitted = true;
        Ok(submission)
    }

    /// Hands the recording to the device and waits until it is done.
    ///
    /// # Errors
    /// As [`submit`](Self::submit).
    pub fn submit_and_wait(self) -> Result<()> {
        self.submit()?.wait()
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

    pub(super) fn buffer_access(&mut self, buffer: &Arc<RawBuffer>, access: Access) {
        let before = buffer.set_access(access);
        self.commands.touched.push(Touched::Buffer(buffer.clone(), before));
        // What the host wrote before a submission is visible to it without a barrier.
        if before != Access::Undefined && before.needs_barrier(access) {
            let barriers = [memory_barrier(before, access)];
            let dependency = vk::DependencyInfo::default().memory_barriers(&barriers);
            // SAFETY: recording, outside of a render pass.
            unsafe { self.device().cmd_pipeline_barrier2(self.raw(), &dependency) };
        }
    }

    /// As [`use_image`](Self::use_image); `discard` throws the content away.
    pub(super) fn image_access(&mut self, image: &Arc<RawImage>, access: Access, discard: bool) {
        let before = self.touch_image(image, access);
        if discard || before.needs_barrier(access) {
            let mips = (0, image.mips);
            let barriers =
                [image_barrier(image.handle, image.format.aspect(), mips, (before, access), discard)];
            let dependency = vk::DependencyInfo::default().image_memory_barriers(&barriers);
            // SAFETY: recording, outside of a render pass.
            unsafe { self.device().cmd_pipeline_barrier2(self.raw(), &dependency) };
        }
    }

    fn touch_image(&mut self, image: &Arc<RawImage>, access: Access) -> Access {
        let before = image.set_access(access);
        self.commands.touched.push(Touched::Image(image.clone(), before));
        before
    }

    /// Keeps `object` until the device is done.
    pub(super) fn hold(&mut self, object: Arc<dyn Any + Send + Sync>) {
        self.commands.held.push(object);
    }

    pub(super) fn device(&self) -> &ash::Device {
        &self.commands.gpu.device
    }

    pub(super) fn raw(&self) -> vk::CommandBuffer {
        self.commands.buffer
    }
}

impl Drop for Recording<'_> {
    fn drop(&mut self) {
        if !self.submitted {
            // None of it will happen.
            if let Some(timestamps) = &mut self.commands.timestamps {
                timestamps.reset();
            }
            for touched in self.commands.touched.drain(..).rev() {
                match touched {
                    Touched::Buffer(buffer, before) => drop(buffer.set_access(before)),
                    Touched::Image(image, before) => drop(image.set_access(before)),
                }
            }
        }
    }
}

impl Submission {
    /// Waits until the work is done.
    ///
    /// # Errors
    /// A lost device.
    pub fn wait(self) -> Result<()> {
        self.gpu.wait(self.value, &self.name)
    }

    /// Whether the work is done.
    pub fn done(&self) -> bool {
        self.gpu.reached(self.value)
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
