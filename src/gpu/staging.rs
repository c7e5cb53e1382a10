//! Staging: many uploads in one submission, and read-back buffers in a ring.

use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;

use super::{
    Access, Commands, DeviceBuffer, Gpu, Image, ReadbackBuffer, ReadbackChoice, Recording, UploadBuffer,
    buffer::RawBuffer, image::RawImage,
};
use crate::error::Result;

/// Offsets of uploads are multiples of this: the largest texel.
const ALIGNMENT: u64 = 16;

/// Collects uploads in a staging buffer and hands them to the device in one submission, or as few as fit.
pub struct Uploads {
    staging: UploadBuffer,
    /// Bytes of the staging buffer that pending uploads occupy.
    used: u64,
    pending: Vec<Upload>,
    commands: Commands,
    gpu: Arc<Gpu>,
    name: String,
}

enum Upload {
    Buffer { target: Arc<RawBuffer>, part: vk::BufferCopy },
    Layer { target: Arc<RawImage>, layer: u32, from: u64 },
    Mips { target: Arc<RawImage> },
}

impl Uploads {
    /// Uploads through a staging buffer of `capacity` bytes; a larger image makes it grow.
    ///
    /// # Errors
    /// No memory left.
    pub fn new(gpu: &Arc<Gpu>, name: &str, capacity: u64) -> Result<Self> {
        Ok(Self {
            staging: UploadBuffer::new(gpu, name, capacity.next_multiple_of(ALIGNMENT).max(ALIGNMENT))?,
            used: 0,
            pending: Vec::new(),
            commands: Commands::new(gpu, name, 0)?,
            gpu: gpu.clone(),
            name: name.into(),
        })
    }

    /// A new buffer that holds `data` once [`flush`](Self::flush)ed.
    ///
    /// # Errors
    /// No memory left.
    pub fn buffer<T: Pod>(&mut self, name: &str, data: &[T]) -> Result<DeviceBuffer> {
        let buffer = DeviceBuffer::new(&self.gpu, name, size_of_val(data) as u64)?;
        self.write(&buffer, 0, data)?;
        Ok(buffer)
    }

    /// Writes `data` to byte `offset` of `target`: both multiples of 4.
    ///
    /// # Errors
    /// A lost device, if earlier uploads had to be flushed to make room.
    ///
    /// # Panics
    /// If it does not fit or is not aligned.
    pub fn write<T: Pod>(&mut self, target: &DeviceBuffer, offset: u64, data: &[T]) -> Result<()> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        assert!(offset + bytes.len() as u64 <= target.size(), "{}: upload past the end", target.raw.name);
        assert!(offset.is_multiple_of(4) && bytes.len().is_multiple_of(4), "{}: alignment", target.raw.name);
        let mut done = 0;
        while done < bytes.len() {
            if self.used == self.staging.size() {
                self.flush()?;
            }
            let count = (bytes.len() - done).min((self.staging.size() - self.used) as usize);
            let from = self.stage(&bytes[done..done + count])?;
            let part =
                vk::BufferCopy { src_offset: from, dst_offset: offset + done as u64, size: count as u64 };
            self.pending.push(Upload::Buffer { target: target.raw.clone(), part });
            done += count;
        }
        Ok(())
    }

    pub(super) fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Writes level 0 of one layer of a texture.
    pub(super) fn write_layer(&mut self, target: &Image, layer: u32, texels: &[u8]) -> Result<()> {
        let bytes = texels.len() as u64;
        if self.used + bytes > self.staging.size() {
            self.flush()?;
            if bytes > self.staging.size() {
                self.staging = UploadBuffer::new(&self.gpu, &self.name, bytes.next_multiple_of(ALIGNMENT))?;
            }
        }
        let from = self.stage(texels)?;
        self.pending.push(Upload::Layer { target: target.raw.clone(), layer, from });
        Ok(())
    }

    /// Fills the mip levels of a texture after its layers are written.
    pub(super) fn make_mips(&mut self, target: &Image) {
        self.pending.push(Upload::Mips { target: target.raw.clone() });
    }

    /// Records the pending uploads in front of what uses them; everything is then ready for draws.
    ///
    /// The next write waits until the device is done with that recording.
    pub fn record<'a>(&'a mut self, recording: &mut Recording<'a>) {
        record(&self.staging, self.pending.drain(..), recording);
        self.used = 0;
    }

    /// Submits the pending uploads and waits until they are done.
    ///
    /// # Errors
    /// A lost device, or no memory left.
    pub fn flush(&mut self) -> Result<()> {
        if !self.pending.is_empty() {
            let mut recording = self.commands.begin()?;
            record(&self.staging, self.pending.drain(..), &mut recording);
            recording.submit_and_wait()?;
        }
        self.used = 0;
        Ok(())
    }

    /// Copies `bytes`, which fit, into the staging buffer; returns where they are.
    fn stage(&mut self, bytes: &[u8]) -> Result<u64> {
        let from = self.used;
        self.staging.write(from, bytes)?;
        self.used = (from + bytes.len() as u64).next_multiple_of(ALIGNMENT).min(self.staging.size());
        Ok(from)
    }
}

fn record<'a>(
    staging: &'a UploadBuffer,
    uploads: impl Iterator<Item = Upload>,
    recording: &mut Recording<'a>,
) {
    let mut buffers: Vec<Arc<RawBuffer>> = Vec::new();
    for upload in uploads {
        match upload {
            Upload::Buffer { target, part } => {
                recording.upload_buffer(staging, &target, &[part]);
                if !buffers.last().is_some_and(|last| Arc::ptr_eq(last, &target)) {
                    buffers.push(target);
                }
            }
            Upload::Layer { target, layer, from } => recording.upload_image(staging, from, &target, layer),
            Upload::Mips { target } => recording.make_mips(&target),
        }
    }
    for buffer in &buffers {
        recording.buffer_access(buffer, Access::ShaderRead);
    }
}

/// Read-back buffers of one size, used in turn, so that the device can fill one while the host reads another.
pub struct ReadbackRing {
    buffers: Vec<ReadbackBuffer>,
    next: usize,
}

impl ReadbackRing {
    /// `count` buffers, at least one, of `size` bytes each.
    ///
    /// # Errors
    /// No such memory, or none left.
    pub fn new(gpu: &Arc<Gpu>, name: &str, count: usize, size: u64, choice: ReadbackChoice) -> Result<Self> {
        let buffers =
            (0..count.max(1)).map(|index| ReadbackBuffer::new(gpu, &format!("{name} {index}"), size, choice));
        Ok(Self { buffers: buffers.collect::<Result<_>>()?, next: 0 })
    }

    /// The buffer whose turn it is, the one used longest ago.
    pub fn advance(&mut self) -> &mut ReadbackBuffer {
        let index = self.next;
        self.next = (index + 1) % self.buffers.len();
        &mut self.buffers[index]
    }

    /// The buffer that [`advance`](Self::advance) returned `age` calls before the last one.
    pub fn latest(&mut self, age: usize) -> &mut ReadbackBuffer {
        let count = self.buffers.len();
        &mut self.buffers[(self.next + 2 * count - 1 - age % count) % count]
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.buffers.len()
    }

    /// Whether there are none: never.
    pub fn is_empty(&self) -> bool {
        self.buffers.is_empty()
    }
}
