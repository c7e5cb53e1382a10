//! The one owner of the device: its queue, its allocator, its clock, and the order in which all end.

use std::{
    collections::HashMap,
    ffi::CStr,
    mem::ManuallyDrop,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use ash::{ext, khr, vk};
use gpu_allocator::{
    AllocationError, AllocationSizes, AllocatorDebugSettings, MemoryLocation,
    vulkan::{Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc},
};

use super::{
    census::{Census, Kind},
    choice::{self, Candidate, DeviceInfo},
    fault::{Fault, failed, no_memory, out_of_memory},
    instance::{Instance, Messages, with_present},
    sampler::SamplerDesc,
};
use crate::error::{Error, Result};

/// How a [`Gpu`] is opened.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Index, or part of the name, of the device; the best one if `None`.
    pub device: Option<String>,
    /// Whether the validation layer watches, with synchronization validation. The environment variable
    /// `VTRACE_VALIDATION=1` asks for the same.
    pub validation: bool,
}

impl Options {
    /// Whether validation is asked for, here or by the environment.
    pub(super) fn validated(&self) -> bool {
        self.validation || std::env::var_os("VTRACE_VALIDATION").is_some_and(|value| value == "1")
    }
}

/// An open Vulkan device with one queue. Every resource holds it by `Arc`, so it ends last.
pub struct Gpu {
    pub(super) device: ash::Device,
    pub(super) queue_family: u32,
    pub(super) limits: vk::PhysicalDeviceLimits,
    /// Bytes of the largest buffer.
    pub(super) max_buffer_size: u64,
    pub(super) memory: vk::PhysicalDeviceMemoryProperties,
    pub(super) features: vk::PhysicalDeviceFeatures,
    pub(super) timestamp_bits: u32,
    pub(super) samplers: Mutex<HashMap<SamplerDesc, vk::Sampler>>,
    queue: Mutex<Queue>,
    timeline: vk::Semaphore,
    allocator: ManuallyDrop<Mutex<Allocator>>,
    names: Option<ext::debug_utils::Device>,
    census: Mutex<Census>,
    faults: Mutex<Vec<(&'static str, vk::Result)>>,
    pub(super) physical: vk::PhysicalDevice,
    info: DeviceInfo,
    pub(super) instance: Instance,
}

struct Queue {
    handle: vk::Queue,
    /// Value that the timeline semaphore reaches when everything submitted so far is done.
    submitted: u64,
}

impl Drop for Gpu {
    /// The end of everything, in order.
    fn drop(&mut self) {
        // SAFETY: every resource held this `Gpu` by `Arc` and is gone; all of these were made in `new` and
        // are destroyed once, users before what they use.
        unsafe {
            let _ = self.device.device_wait_idle();
            for (_, sampler) in lock(&self.samplers).drain() {
                self.device.destroy_sampler(sampler, None);
            }
            self.device.destroy_semaphore(self.timeline, None);
            for leak in lock(&self.allocator).generate_report().allocations {
                self.instance.messages.error(format!("memory of {} was never freed", leak.name));
            }
            ManuallyDrop::drop(&mut self.allocator);
            self.device.destroy_device(None);
        }
        // `instance` drops itself last: messenger, instance, loader.
    }
}

impl Gpu {
    /// Opens a device.
    ///
    /// # Errors
    /// [`Error::NoDevice`] if no device can serve, or if validation is asked for and not installed.
    pub fn new(options: &Options) -> Result<Arc<Self>> {
        let instance = Instance::new(options.validated(), &[])?;
        let candidate = choice::choose(&instance, options.device.as_deref(), &|_, _| true)?;
        Self::open(instance, candidate, &[])
    }

    /// Opens `candidate`, a device of `instance`, with the extensions `extensions`, which it has.
    pub(super) fn open(instance: Instance, candidate: Candidate, extensions: &[&CStr]) -> Result<Arc<Self>> {
        let (mut vulkan12, mut vulkan13) = choice::required();
        let core = vk::PhysicalDeviceFeatures::default()
            .sampler_anisotropy(candidate.features.sampler_anisotropy == vk::TRUE);
        let queues = [vk::DeviceQueueCreateInfo::default()
            .queue_family_index(candidate.queue_family)
            .queue_priorities(&[1.0])];
        let info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_features(&core)
            .push_next(&mut vulkan12)
            .push_next(&mut vulkan13);
        let name = &candidate.info.name;
        // SAFETY: a device of this instance.
        let present = unsafe { instance.handle.enumerate_device_extension_properties(candidate.handle) }
            .map_err(failed("vkEnumerateDeviceExtensionProperties", name))?;
        // A device that has it lacks parts of Vulkan, none of which is used here, and wants that to be acknowledged.
        let extensions = with_present(extensions, &[khr::portability_subset::NAME], &present);
        let extensions: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
        let info = info.enabled_extension_names(&extensions);
        // SAFETY: the features were found present, the queue family exists, all pointers are alive.
        let device = unsafe { instance.handle.create_device(candidate.handle, &info, None) }
            .map_err(failed("vkCreateDevice", name))?;

        // From here on a failure has to destroy the device.
        let made = || -> Result<_> {
            // SAFETY: the family has one queue; a live device.
            let queue = unsafe { device.get_device_queue(candidate.queue_family, 0) };
            let allocator = Allocator::new(&AllocatorCreateDesc {
                instance: instance.handle.clone(),
                device: device.clone(),
                physical_device: candidate.handle,
                debug_settings: AllocatorDebugSettings::default(),
                buffer_device_address: false,
                // Grow from small blocks: a demo scene should not claim 256 MiB.
                allocation_sizes: AllocationSizes::new(32 << 20, 16 << 20)
                    .with_max_device_memblock_size(256 << 20)
                    .with_max_host_memblock_size(64 << 20),
            })
            .map_err(|error| Error::DeviceMemory { object: name.clone(), problem: error.to_string() })?;
            let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
            let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
            // SAFETY: the feature is enabled.
            let timeline = unsafe { device.create_semaphore(&info, None) }
                .map_err(failed("vkCreateSemaphore", "timeline"))?;
            Ok((queue, allocator, timeline))
        };
        let (queue, allocator, timeline) = made().inspect_err(|_| {
            // SAFETY: nothing made from the device is left.
            unsafe { device.destroy_device(None) };
        })?;
        // SAFETY: enumerated from this instance.
        let memory = unsafe { instance.handle.get_physical_device_memory_properties(candidate.handle) };
        let names = instance.debug_utils.then(|| ext::debug_utils::Device::new(&instance.handle, &device));
        let gpu = Self {
            device,
            queue_family: candidate.queue_family,
            limits: candidate.properties.limits,
            max_buffer_size: candidate.max_buffer_size,
            memory,
            features: core,
            timestamp_bits: candidate.timestamp_bits,
            samplers: Mutex::default(),
            queue: Mutex::new(Queue { handle: queue, submitted: 0 }),
            timeline,
            allocator: ManuallyDrop::new(Mutex::new(allocator)),
            names,
            census: Mutex::default(),
            faults: Mutex::default(),
            physical: candidate.handle,
            info: candidate.info,
            instance,
        };
        gpu.name(queue, "queue");
        gpu.name(timeline, "timeline");
        Ok(Arc::new(gpu))
    }

    /// Which device this is.
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// Whether the validation layer watches.
    pub fn validated(&self) -> bool {
        self.instance.validation
    }

    /// The errors that the validation layers report, which also hears of what is never freed, after this `Gpu` is gone.
    pub fn messages(&self) -> Arc<Messages> {
        self.instance.messages.clone()
    }

    /// Bytes of a storage buffer that a shader can be given at most.
    pub fn most_stored(&self) -> u64 {
        self.limits.max_storage_buffer_range.into()
    }

    /// Bytes of a texel buffer that a shader can be given at most.
    pub fn most_texels(&self) -> u64 {
        u64::from(self.limits.max_texel_buffer_elements) * super::descriptor::TEXEL_BYTES
    }

    /// Largest width and height of an image.
    pub fn max_image_size(&self) -> u32 {
        self.limits.max_image_dimension2_d
    }

    /// What was created on this device so far.
    pub fn census(&self) -> Census {
        lock(&self.census).clone()
    }

    /// Test hook: the next `call` (a name such as `vkCreateBuffer`) fails with `fault` and is not made.
    pub fn fail_next(&self, call: &'static str, fault: Fault) {
        lock(&self.faults).push((call, fault.code()));
    }

    /// Makes one Vulkan call for `object`; a failure says which call, on which object.
    pub(super) fn call<T>(
        &self,
        call: &'static str,
        object: &str,
        function: impl FnOnce(&ash::Device) -> Result<T, vk::Result>,
    ) -> Result<T> {
        let mut faults = lock(&self.faults);
        let injected = faults.iter().position(|fault| fault.0 == call).map(|index| faults.remove(index).1);
        drop(faults);
        let outcome = injected.map_or_else(|| function(&self.device), Err).map_err(failed(call, object))?;
        lock(&self.census).add_call(call);
        Ok(outcome)
    }

    /// Counts an object that was created.
    pub(super) fn count(&self, kind: Kind, name: &str, bytes: u64) {
        lock(&self.census).add(kind, name, bytes);
    }

    /// Gives `handle` the name that messages and debuggers show.
    pub(super) fn name<T: vk::Handle>(&self, handle: T, name: &str) {
        if let Some(names) = &self.names {
            let name = std::ffi::CString::new(name.replace('\0', " ")).unwrap_or_default();
            let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(handle).object_name(&name);
            // SAFETY: a live object of this device. A name that cannot be stored is no reason to fail.
            let _ = unsafe { names.set_debug_utils_object_name(&info) };
        }
    }

    /// Memory for a resource called `name`.
    pub(super) fn allocate(
        &self,
        name: &str,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
        linear: bool,
    ) -> Result<Allocation> {
        // The allocator makes the call itself, or none: this is where a test's fault strikes.
        self.call("vkAllocateMemory", name, |_| Ok(()))
            .map_err(|error| out_of_memory(name, requirements.size, error))?;
        let desc = AllocationCreateDesc {
            name,
            requirements,
            location,
            linear,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        };
        lock(&self.allocator).allocate(&desc).map_err(|error| match error {
            AllocationError::OutOfMemory => no_memory(name, requirements.size),
            error => Error::DeviceMemory { object: name.into(), problem: error.to_string() },
        })
    }

    pub(super) fn free(&self, allocation: Allocation) {
        if let Err(error) = lock(&self.allocator).free(allocation) {
            self.instance.messages.error(format!("memory could not be freed: {error}"));
        }
    }

    /// Index of the first memory type that `bits` allows and `suits` accepts.
    pub(super) fn memory_type(
        &self,
        bits: u32,
        suits: impl Fn(vk::MemoryPropertyFlags) -> bool,
    ) -> Option<(u32, vk::MemoryPropertyFlags)> {
        let types = self.memory.memory_types_as_slice().iter().enumerate();
        types
            .map(|(index, memory_type)| (index as u32, memory_type.property_flags))
            .find(|&(index, flags)| bits & (1 << index) != 0 && suits(flags))
    }

    /// Whether images of this kind can exist, and up to which size.
    pub(super) fn image_limits(
        &self,
        format: vk::Format,
        tiling: vk::ImageTiling,
        usage: vk::ImageUsageFlags,
    ) -> Result<vk::ImageFormatProperties, vk::Result> {
        // SAFETY: a device of this instance.
        unsafe {
            self.instance.handle.get_physical_device_image_format_properties(
                self.physical,
                format,
                vk::ImageType::TYPE_2D,
                tiling,
                usage,
                vk::ImageCreateFlags::empty(),
            )
        }
    }

    /// Submits one command buffer; returns the value of the timeline at which it is done. The first transfer in
    /// it waits for the semaphore `after`, and `before` is signalled when all is done.
    pub(super) fn submit(
        &self,
        commands: vk::CommandBuffer,
        name: &str,
        after: Option<vk::Semaphore>,
        before: Option<vk::Semaphore>,
    ) -> Result<u64> {
        let mut queue = lock(&self.queue);
        let value = queue.submitted + 1;
        let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(commands)];
        let all = vk::PipelineStageFlags2::ALL_COMMANDS;
        let semaphore =
            |handle, stages| vk::SemaphoreSubmitInfo::default().semaphore(handle).stage_mask(stages);
        let waits: Vec<_> =
            after.map(|after| semaphore(after, vk::PipelineStageFlags2::ALL_TRANSFER)).into_iter().collect();
        let mut signals = vec![semaphore(self.timeline, all).value(value)];
        signals.extend(before.map(|before| semaphore(before, all)));
        let submits = [vk::SubmitInfo2::default()
            .wait_semaphore_infos(&waits)
            .command_buffer_infos(&buffers)
            .signal_semaphore_infos(&signals)];
        // SAFETY: the queue is locked; the command buffer is recorded and owns everything that it uses.
        self.call("vkQueueSubmit2", name, |device| unsafe {
            device.queue_submit2(queue.handle, &submits, vk::Fence::null())
        })?;
        queue.submitted = value;
        Ok(value)
    }

    /// Lets `work` have the queue to itself.
    #[cfg(feature = "view")]
    pub(super) fn with_queue<T>(&self, work: impl FnOnce(vk::Queue) -> T) -> T {
        work(lock(&self.queue).handle)
    }

    /// Waits until the timeline reaches `value`.
    pub(super) fn wait(&self, value: u64, name: &str) -> Result<()> {
        if value == 0 {
            return Ok(()); // never submitted
        }
        let (semaphores, values) = ([self.timeline], [value]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        // SAFETY: a live timeline semaphore, which a submission made before will signal.
        self.call("vkWaitSemaphores", name, |device| unsafe { device.wait_semaphores(&info, u64::MAX) })
    }

    /// Whether the timeline has reached `value`.
    pub(super) fn reached(&self, value: u64) -> bool {
        // SAFETY: a live timeline semaphore.
        unsafe { self.device.get_semaphore_counter_value(self.timeline) }.is_ok_and(|done| done >= value)
    }
}

impl std::fmt::Debug for Gpu {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Gpu").field(&self.info.name).finish()
    }
}

/// The lock's content, whatever a panicking thread left there: each is a plain collection, valid at any time.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
