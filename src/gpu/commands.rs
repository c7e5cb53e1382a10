//! Recording, submitting and waiting: a command buffer owns what it uses until the device is done with it.

use std::{any::Any, sync::Arc};

use ash::vk;
use bytemuck::Pod;

use super::{
    Access, ComputePipeline, DescriptorSet, DeviceBuffer, Gpu, Image, Timing,
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

    pub(super) fn touch_image(&mut self, image: &Arc<RawImage>, access: Access) -> Access {
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
