//! Buffers by where they live: on the device alone, written by the host, or read by the host.
//!
//! Memory of a [`DeviceBuffer`] is never reachable from the host, whatever memory the device has: data comes
//! through [`Uploads`](super::Uploads) and leaves through a [`ReadbackBuffer`].

use std::{
    ptr::NonNull,
    sync::{
        Arc,
        atomic::{AtomicU8, AtomicU64, Ordering},
    },
};

use ash::vk;
use bytemuck::Pod;
use gpu_allocator::{MemoryLocation, vulkan::Allocation};

use super::{
    Access, Gpu, ReadbackChoice, ReadbackMemory, census::Kind, fault::out_of_memory, memory::atom_range,
};
use crate::error::{Error, Result};

/// A buffer that only the device reaches. Clones share it.
#[derive(Clone, Debug)]
pub struct DeviceBuffer {
    pub(super) raw: Arc<RawBuffer>,
}

/// A persistently mapped buffer that the host writes and the device copies from.
#[derive(Debug)]
pub struct UploadBuffer {
    pub(super) raw: Arc<RawBuffer>,
}

/// A persistently mapped buffer that the device copies to and the host reads.
#[derive(Debug)]
pub struct ReadbackBuffer {
    pub(super) raw: Arc<RawBuffer>,
    memory: ReadbackMemory,
    /// The content, for memory that must not be read in place.
    copy: Vec<u64>,
}

impl DeviceBuffer {
    /// A buffer of `size` bytes, usable as uniform, storage and texel buffer.
    ///
    /// # Errors
    /// No memory left.
    pub fn new(gpu: &Arc<Gpu>, name: &str, size: u64) -> Result<Self> {
        // All usages at once: drivers place a buffer by its memory type, not by its usage.
        let usage = vk::BufferUsageFlags::UNIFORM_BUFFER
            | vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST;
        let mut raw = RawBuffer::new(gpu, name, size, usage)?;
        raw.allocate(MemoryLocation::GpuOnly)?;
        Ok(Self { raw: Arc::new(raw) })
    }

    /// Size in bytes.
    pub fn size(&self) -> u64 {
        self.raw.size
    }
}

impl UploadBuffer {
    /// A buffer of `size` bytes.
    ///
    /// # Errors
    /// No memory left.
    pub fn new(gpu: &Arc<Gpu>, name: &str, size: u64) -> Result<Self> {
        let mut raw = RawBuffer::new(gpu, name, size, vk::BufferUsageFlags::TRANSFER_SRC)?;
        // gpu-allocator's choice for it is always coherent: nothing to flush.
        raw.allocate(MemoryLocation::CpuToGpu)?;
        Ok(Self { raw: Arc::new(raw) })
    }

    /// Size in bytes.
    pub fn size(&self) -> u64 {
        self.raw.size
    }

    /// Writes `data` at byte `offset`, once the device no longer reads what is there.
    ///
    /// # Errors
    /// A lost device.
    ///
    /// # Panics
    /// If it does not fit.
    pub fn write<T: Pod>(&mut self, offset: u64, data: &[T]) -> Result<()> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        assert!(offset + bytes.len() as u64 <= self.raw.size, "{}: write past the end", self.raw.name);
        self.raw.wait()?;
        let start = self.raw.mapped().as_ptr().wrapping_add(offset as usize);
        // SAFETY: in bounds (asserted), mapped for the buffer's life; `&mut self` is the only handle to
        // the mapping and the device is done with it (waited).
        unsafe { start.copy_from_nonoverlapping(bytes.as_ptr(), bytes.len()) };
        Ok(())
    }
}

impl ReadbackBuffer {
    /// A buffer of `size` bytes in the kind of memory that `choice` says.
    ///
    /// # Errors
    /// No such memory, or none left.
    pub fn new(gpu: &Arc<Gpu>, name: &str, size: u64, choice: ReadbackChoice) -> Result<Self> {
        let mut raw = RawBuffer::new(gpu, name, size, vk::BufferUsageFlags::TRANSFER_DST)?;
        let memory = raw.allocate_readback(choice)?;
        Ok(Self { raw: Arc::new(raw), memory, copy: Vec::new() })
    }

    /// Size in bytes.
    pub fn size(&self) -> u64 {
        self.raw.size
    }

    /// How its memory is read.
    pub fn memory(&self) -> ReadbackMemory {
        self.memory
    }

    /// Waits for the last submission that uses the buffer and makes what it wrote visible to the host.
    ///
    /// Returns the first `count` elements: in place, or a copy if the memory is slow to read.
    ///
    /// # Errors
    /// A lost device.
    ///
    /// # Panics
    /// If the buffer holds fewer.
    pub fn read<T: Pod>(&mut self, count: usize) -> Result<&[T]> {
        let size = count * size_of::<T>();
        assert!(size as u64 <= self.raw.size, "{}: read past the end", self.raw.name);
        self.raw.wait()?;
        if self.memory == ReadbackMemory::Cached {
            self.raw.invalidate(size as u64)?;
        }
        let mapped = self.raw.mapped();
        // SAFETY: mapped for the buffer's life and zeroed at creation; in bounds (asserted); the device is
        // done with it (waited) and only a submission made through `&mut` of this buffer could write again.
        let bytes = unsafe { std::slice::from_raw_parts(mapped.as_ptr(), size) };
        if self.memory != ReadbackMemory::Uncached {
            return Ok(bytemuck::cast_slice(bytes));
        }
        self.copy.resize(size.div_ceil(8), 0);
        let copy: &mut [u8] = bytemuck::cast_slice_mut(&mut self.copy);
        copy[..size].copy_from_slice(bytes);
        Ok(bytemuck::cast_slice(&bytemuck::cast_slice::<u64, u8>(&self.copy)[..size]))
    }
}

/// A buffer with its memory, freed when its last owner goes.
pub(super) struct RawBuffer {
    gpu: Arc<Gpu>,
    pub(super) name: String,
    pub(super) handle: vk::Buffer,
    pub(super) size: u64,
    memory: Memory,
    /// Last use recorded, an [`Access`].
    access: AtomicU8,
    /// Timeline value of the last submission that uses it.
    busy_until: AtomicU64,
}

enum Memory {
    None,
    Shared(Allocation),
    /// Of its own, mapped: gpu-allocator knows no non-coherent memory.
    Own {
        memory: vk::DeviceMemory,
        mapped: Option<NonNull<u8>>,
        size: u64,
    },
}

// SAFETY: the pointer is to memory that belongs to the buffer and moves with it; reads and writes through it
// are guarded by `&mut` of the one `UploadBuffer` or `ReadbackBuffer` that holds it.
unsafe impl Send for Memory {}
// SAFETY: as above: nothing is reached through a shared reference.
unsafe impl Sync for Memory {}

impl RawBuffer {
    fn new(gpu: &Arc<Gpu>, name: &str, size: u64, usage: vk::BufferUsageFlags) -> Result<Self> {
        // Empty scenes have empty arrays; Vulkan has no empty buffers.
        let size = size.next_multiple_of(4).max(16);
        if size > gpu.max_buffer_size {
            let problem = format!("{size} bytes; the device's largest buffers have {}", gpu.max_buffer_size);
            return Err(Error::DeviceMemory { object: format!("buffer {name}"), problem });
        }
        let info = vk::BufferCreateInfo::default().size(size).usage(usage);
        // SAFETY: a live device; `info` is complete.
        let handle = gpu
            .call("vkCreateBuffer", name, |device| unsafe { device.create_buffer(&info, None) })
            .map_err(|error| out_of_memory(name, size, error))?;
        gpu.name(handle, name);
        gpu.count(Kind::Buffer, name, size);
        Ok(Self {
            gpu: gpu.clone(),
            name: name.into(),
            handle,
            size,
            memory: Memory::None,
            access: AtomicU8::new(Access::Undefined as u8),
            busy_until: AtomicU64::new(0),
        })
    }

    fn requirements(&self) -> vk::MemoryRequirements {
        // SAFETY: a live buffer of this device.
        unsafe { self.gpu.device.get_buffer_memory_requirements(self.handle) }
    }

    fn bind(&self, memory: vk::DeviceMemory, offset: u64) -> Result<()> {
        // SAFETY: the memory was made for this buffer's requirements, and the buffer is not bound yet.
        self.gpu.call("vkBindBufferMemory", &self.name, |device| unsafe {
            device.bind_buffer_memory(self.handle, memory, offset)
        })
    }

    fn allocate(&mut self, location: MemoryLocation) -> Result<()> {
        let allocation = self.gpu.allocate(&self.name, self.requirements(), location, true)?;
        // SAFETY: the memory is only bound, and freed after the buffer.
        let (memory, offset) = (unsafe { allocation.memory() }, allocation.offset());
        self.memory = Memory::Shared(allocation);
        self.bind(memory, offset)
    }

    fn allocate_readback(&mut self, choice: ReadbackChoice) -> Result<ReadbackMemory> {
        let requirements = self.requirements();
        let (index, kind) = choice.resolve(&self.gpu, requirements.memory_type_bits, &self.name)?;
        let info =
            vk::MemoryAllocateInfo::default().allocation_size(requirements.size).memory_type_index(index);
        // SAFETY: the type exists; the memory is freed with the buffer.
        let memory = self
            .gpu
            .call("vkAllocateMemory", &self.name, |device| unsafe { device.allocate_memory(&info, None) })
            .map_err(|error| out_of_memory(&self.name, requirements.size, error))?;
        self.memory = Memory::Own { memory, mapped: None, size: requirements.size };
        self.gpu.name(memory, &self.name);
        // SAFETY: host-visible memory, not mapped yet.
        let mapped = self.gpu.call("vkMapMemory", &self.name, |device| unsafe {
            device.map_memory(memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty())
        })?;
        // SAFETY: mapped as a whole, used by nobody yet. Rust may only see initialised bytes.
        unsafe { mapped.cast::<u8>().write_bytes(0, requirements.size as usize) };
        self.memory = Memory::Own { memory, mapped: NonNull::new(mapped.cast()), size: requirements.size };
        self.bind(memory, 0)?;
        if kind == ReadbackMemory::Cached {
            // The zeros must not be written back over what the device writes.
            let range = [vk::MappedMemoryRange::default().memory(memory).size(vk::WHOLE_SIZE)];
            // SAFETY: mapped memory of this device.
            self.gpu.call("vkFlushMappedMemoryRanges", &self.name, |device| unsafe {
                device.flush_mapped_memory_ranges(&range)
            })?;
        }
        Ok(kind)
    }

    /// Where the host reaches a buffer that was allocated in memory that it can reach.
    fn mapped(&self) -> NonNull<u8> {
        let mapped = match &self.memory {
            Memory::None => None,
            Memory::Shared(allocation) => allocation.mapped_ptr().map(NonNull::cast),
            Memory::Own { mapped, .. } => *mapped,
        };
        mapped.expect("memory that the host reaches is mapped as long as its buffer lives")
    }

    fn invalidate(&self, bytes: u64) -> Result<()> {
        let Memory::Own { memory, size, .. } = self.memory else { return Ok(()) };
        let (offset, size) = atom_range(0, bytes, self.gpu.limits.non_coherent_atom_size, size);
        let range = [vk::MappedMemoryRange::default().memory(memory).offset(offset).size(size)];
        // SAFETY: mapped as a whole; the range is aligned and in bounds.
        self.gpu.call("vkInvalidateMappedMemoryRanges", &self.name, |device| unsafe {
            device.invalidate_mapped_memory_ranges(&range)
        })
    }

    /// Waits until no submission uses the buffer.
    fn wait(&self) -> Result<()> {
        self.gpu.wait(self.busy_until.load(Ordering::Acquire), &self.name)
    }

    pub(super) fn set_busy_until(&self, value: u64) {
        self.busy_until.fetch_max(value, Ordering::AcqRel);
    }

    /// Sets the last use recorded; returns the one before.
    pub(super) fn set_access(&self, access: Access) -> Access {
        Access::from_code(self.access.swap(access as u8, Ordering::AcqRel))
    }
}

impl Drop for RawBuffer {
    fn drop(&mut self) {
        // SAFETY: command buffers own what they use until the device is done, so nobody uses it any more;
        // freeing memory unmaps it.
        unsafe { self.gpu.device.destroy_buffer(self.handle, None) };
        match std::mem::replace(&mut self.memory, Memory::None) {
            Memory::None => {}
            Memory::Shared(allocation) => self.gpu.free(allocation),
            // SAFETY: allocated for this buffer alone, which is gone.
            Memory::Own { memory, .. } => unsafe { self.gpu.device.free_memory(memory, None) },
        }
    }
}

impl std::fmt::Debug for RawBuffer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "buffer {} of {} bytes", self.name, self.size)
    }
}
