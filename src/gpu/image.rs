//! Images on the device: render targets and array textures.

use std::sync::{
    Arc,
    atomic::{AtomicU8, AtomicU64, Ordering},
};

use ash::vk;
use gpu_allocator::{MemoryLocation, vulkan::Allocation};

use super::{Access, Gpu, census::Kind, fault::out_of_memory};
use crate::error::{Error, Result};

/// Texel format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Format {
    /// One 8-bit channel, 0 to 1.
    R8,
    /// Four 8-bit channels, 0 to 1.
    Rgba8,
    /// Four 8-bit channels, colour decoded from sRGB when read.
    Rgba8Srgb,
    /// Four halves.
    Rgba16f,
    /// Depth as a float.
    Depth32f,
    /// Depth as a float, and an 8-bit stencil.
    Depth32fStencil8,
}

impl Format {
    pub(super) fn vk(self) -> vk::Format {
        match self {
            Self::R8 => vk::Format::R8_UNORM,
            Self::Rgba8 => vk::Format::R8G8B8A8_UNORM,
            Self::Rgba8Srgb => vk::Format::R8G8B8A8_SRGB,
            Self::Rgba16f => vk::Format::R16G16B16A16_SFLOAT,
            Self::Depth32f => vk::Format::D32_SFLOAT,
            Self::Depth32fStencil8 => vk::Format::D32_SFLOAT_S8_UINT,
        }
    }

    /// Bytes of a texel when copied to a buffer; of a depth image its depth alone.
    pub fn texel_bytes(self) -> u64 {
        match self {
            Self::R8 => 1,
            Self::Rgba8 | Self::Rgba8Srgb | Self::Depth32f | Self::Depth32fStencil8 => 4,
            Self::Rgba16f => 8,
        }
    }

    /// Whether it is a depth format.
    pub fn is_depth(self) -> bool {
        matches!(self, Self::Depth32f | Self::Depth32fStencil8)
    }

    /// Whether it has a stencil.
    pub fn has_stencil(self) -> bool {
        self == Self::Depth32fStencil8
    }

    pub(super) fn aspect(self) -> vk::ImageAspectFlags {
        match self {
            Self::Depth32f => vk::ImageAspectFlags::DEPTH,
            Self::Depth32fStencil8 => vk::ImageAspectFlags::DEPTH | vk::ImageAspectFlags::STENCIL,
            _ => vk::ImageAspectFlags::COLOR,
        }
    }
}

/// What an image is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageUse {
    /// Drawn to, then copied or sampled.
    Target,
    /// Drawn to, in memory that the host reads: see [`HostImage`](super::HostImage).
    HostTarget,
    /// Uploaded, then sampled as a `sampler2DArray`.
    Texture,
}

impl ImageUse {
    fn tiling(self) -> vk::ImageTiling {
        match self {
            Self::Target | Self::Texture => vk::ImageTiling::OPTIMAL,
            Self::HostTarget => vk::ImageTiling::LINEAR,
        }
    }
}

/// Description of an [`Image`].
#[derive(Debug, Clone, Copy)]
pub struct ImageDesc<'a> {
    /// Debug name.
    pub name: &'a str,
    /// Texel format.
    pub format: Format,
    /// What it is for.
    pub usage: ImageUse,
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// Array layers: more than 1 for textures only.
    pub layers: u32,
    /// Mip levels: more than 1 for textures only.
    pub mips: u32,
    /// Samples a pixel, 1 or 4; more than 1 for targets only.
    pub samples: u32,
}

impl<'a> ImageDesc<'a> {
    /// A render target with one sample a pixel.
    pub fn target(name: &'a str, format: Format, width: u32, height: u32) -> Self {
        Self { name, format, usage: ImageUse::Target, width, height, layers: 1, mips: 1, samples: 1 }
    }

    /// The same target with `samples` a pixel.
    pub fn with_samples(self, samples: u32) -> Self {
        Self { samples, ..self }
    }

    /// An array texture of `layers` layers, with all mip levels if `mipped`.
    pub fn texture(
        name: &'a str,
        format: Format,
        (width, height): (u32, u32),
        layers: u32,
        mipped: bool,
    ) -> Self {
        let mips = if mipped { full_mips(width, height) } else { 1 };
        Self { name, format, usage: ImageUse::Texture, width, height, layers, mips, samples: 1 }
    }

    /// Bytes of all its texels: levels, layers and samples; of a depth image without its stencil.
    pub fn bytes(&self) -> u64 {
        let level = |mip: u32| {
            let side = |side: u32| u64::from((side >> mip).max(1));
            side(self.width) * side(self.height)
        };
        let texels: u64 = (0..self.mips).map(level).sum();
        texels * self.format.texel_bytes() * u64::from(self.layers) * u64::from(self.samples)
    }
}

/// Mip levels of a `width` × `height` image down to a single texel.
pub fn full_mips(width: u32, height: u32) -> u32 {
    width.max(height).max(1).ilog2() + 1
}

/// An image on the device with a view of all of it. Clones share it.
#[derive(Clone, Debug)]
pub struct Image {
    pub(super) raw: Arc<RawImage>,
}

impl Image {
    /// Creates the image; its content is undefined.
    ///
    /// # Errors
    /// A size or sample count that the device does not support; no memory left.
    pub fn new(gpu: &Arc<Gpu>, desc: &ImageDesc<'_>) -> Result<Self> {
        Ok(Self { raw: Arc::new(RawImage::new(gpu, desc)?) })
    }

    /// Whether the device has any such image of this size.
    pub fn is_supported(gpu: &Gpu, desc: &ImageDesc<'_>) -> bool {
        RawImage::supported(gpu, desc)
    }

    /// Width in texels.
    pub fn width(&self) -> u32 {
        self.raw.width
    }

    /// Height in texels.
    pub fn height(&self) -> u32 {
        self.raw.height
    }

    /// Texel format.
    pub fn format(&self) -> Format {
        self.raw.format
    }

    /// Bytes of level 0 of one layer when copied to a buffer.
    pub fn bytes(&self) -> u64 {
        self.row_bytes() * u64::from(self.raw.height)
    }

    /// Bytes of a row of these.
    pub fn row_bytes(&self) -> u64 {
        u64::from(self.raw.width) * self.raw.format.texel_bytes()
    }
}

/// An image with its view and memory, freed when its last owner goes.
pub(super) struct RawImage {
    gpu: Arc<Gpu>,
    pub(super) name: String,
    pub(super) handle: vk::Image,
    pub(super) view: vk::ImageView,
    pub(super) format: Format,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) layers: u32,
    pub(super) mips: u32,
    allocation: Option<Allocation>,
    /// Last use recorded, an [`Access`].
    access: AtomicU8,
    /// Timeline value of the last submission that uses it.
    busy_until: AtomicU64,
}

impl RawImage {
    /// Whether the device has any such image of this size.
    pub(super) fn supported(gpu: &Gpu, desc: &ImageDesc<'_>) -> bool {
        let samples = vk::SampleCountFlags::from_raw(desc.samples);
        check_limits(gpu, desc, desc.usage.tiling(), usage_flags(desc), samples).is_ok()
    }

    fn new(gpu: &Arc<Gpu>, desc: &ImageDesc<'_>) -> Result<Self> {
        let usage = usage_flags(desc);
        let samples = vk::SampleCountFlags::from_raw(desc.samples);
        let host = desc.usage == ImageUse::HostTarget;
        let tiling = desc.usage.tiling();
        check_limits(gpu, desc, tiling, usage, samples)?;
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(desc.format.vk())
            .extent(vk::Extent3D { width: desc.width, height: desc.height, depth: 1 })
            .mip_levels(desc.mips)
            .array_layers(desc.layers)
            .samples(samples)
            .tiling(tiling)
            .usage(usage)
            .initial_layout(vk::ImageLayout::UNDEFINED);
        let bytes = desc.bytes();
        // SAFETY: a live device; the description was checked against its limits.
        let handle = gpu
            .call("vkCreateImage", desc.name, |device| unsafe { device.create_image(&info, None) })
            .map_err(|error| out_of_memory(desc.name, bytes, error))?;
        // From here on `image` frees what was made if a later step fails.
        let mut image = Self {
            gpu: gpu.clone(),
            name: desc.name.into(),
            handle,
            view: vk::ImageView::null(),
            format: desc.format,
            width: desc.width,
            height: desc.height,
            layers: desc.layers,
            mips: desc.mips,
            allocation: None,
            access: AtomicU8::new(Access::Undefined as u8),
            busy_until: AtomicU64::new(0),
        };
        gpu.name(handle, desc.name);
        gpu.count(Kind::Image, desc.name, bytes);
        // SAFETY: a live image of this device.
        let requirements = unsafe { gpu.device.get_image_memory_requirements(handle) };
        let location = if host { MemoryLocation::GpuToCpu } else { MemoryLocation::GpuOnly };
        let allocation = image.allocation.insert(gpu.allocate(desc.name, requirements, location, host)?);
        // SAFETY: the memory was made for this image, which is not bound yet.
        gpu.call("vkBindImageMemory", desc.name, |device| unsafe {
            device.bind_image_memory(handle, allocation.memory(), allocation.offset())
        })?;
        let view_type = match desc.usage {
            ImageUse::Target | ImageUse::HostTarget => vk::ImageViewType::TYPE_2D,
            ImageUse::Texture => vk::ImageViewType::TYPE_2D_ARRAY,
        };
        let info = vk::ImageViewCreateInfo::default()
            .image(handle)
            .view_type(view_type)
            .format(desc.format.vk())
            .subresource_range(vk::ImageSubresourceRange {
                aspect_mask: desc.format.aspect(),
                base_mip_level: 0,
                level_count: desc.mips,
                base_array_layer: 0,
                layer_count: desc.layers,
            });
        // SAFETY: a live image, bound to memory.
        image.view = gpu.call("vkCreateImageView", desc.name, |device| unsafe {
            device.create_image_view(&info, None)
        })?;
        gpu.name(image.view, desc.name);
        Ok(image)
    }

    /// The memory, if the host can see it.
    pub(super) fn allocation(&self) -> Option<&Allocation> {
        self.allocation.as_ref()
    }

    /// Waits until no submission uses the image.
    pub(super) fn wait(&self) -> Result<()> {
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

impl Drop for RawImage {
    fn drop(&mut self) {
        // SAFETY: command buffers own what they use until the device is done, so nobody uses it any more;
        // a null view is ignored.
        unsafe {
            self.gpu.device.destroy_image_view(self.view, None);
            self.gpu.device.destroy_image(self.handle, None);
        }
        if let Some(allocation) = self.allocation.take() {
            self.gpu.free(allocation);
        }
    }
}

impl std::fmt::Debug for RawImage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "image {} {}x{} {:?}", self.name, self.width, self.height, self.format)
    }
}

fn usage_flags(desc: &ImageDesc<'_>) -> vk::ImageUsageFlags {
    let attachment = if desc.format.is_depth() {
        vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT
    } else {
        vk::ImageUsageFlags::COLOR_ATTACHMENT
    };
    match (desc.usage, desc.samples) {
        (ImageUse::HostTarget, _) => attachment | vk::ImageUsageFlags::TRANSFER_SRC,
        (ImageUse::Target, 1) => {
            attachment | vk::ImageUsageFlags::TRANSFER_SRC | vk::ImageUsageFlags::SAMPLED
        }
        (ImageUse::Target, _) => attachment,
        // Blits read the level above.
        (ImageUse::Texture, _) => {
            vk::ImageUsageFlags::SAMPLED
                | vk::ImageUsageFlags::TRANSFER_DST
                | vk::ImageUsageFlags::TRANSFER_SRC
        }
    }
}

fn check_limits(
    gpu: &Gpu,
    desc: &ImageDesc<'_>,
    tiling: vk::ImageTiling,
    usage: vk::ImageUsageFlags,
    samples: vk::SampleCountFlags,
) -> Result<()> {
    let refuse =
        |problem: String| Err(Error::DeviceMemory { object: format!("image {}", desc.name), problem });
    let limits = match gpu.image_limits(desc.format.vk(), tiling, usage) {
        Ok(limits) => limits,
        Err(_) => return refuse(format!("the device does not support {:?} for this use", desc.format)),
    };
    let (width, height) = (limits.max_extent.width, limits.max_extent.height);
    if desc.width == 0 || desc.height == 0 || desc.width > width || desc.height > height {
        return refuse(format!(
            "{}x{} is outside of the device's 1x1 to {width}x{height}",
            desc.width, desc.height
        ));
    }
    if desc.layers == 0 || desc.layers > limits.max_array_layers {
        return refuse(format!("{} layers; the device allows 1 to {}", desc.layers, limits.max_array_layers));
    }
    if !limits.sample_counts.contains(samples) || !desc.samples.is_power_of_two() {
        return refuse(format!("the device does not support {} samples a pixel", desc.samples));
    }
    Ok(())
}
