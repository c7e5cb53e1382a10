//! The swapchain: whole images from host memory into a window, whatever becomes of its size.

use std::sync::Arc;

use ash::{khr, vk};

use super::fault::{code_of, failed};
use super::{Access, Commands, Gpu, Recording, Surface, UploadBuffer, access::image_barrier};
use crate::error::{Error, Result};

/// How long to wait for the window system to hand an image over.
const PATIENCE_NS: u64 = 1_000_000_000;

/// What became of an image that was to be shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shown {
    /// The window shows it.
    Yes,
    /// The window is of this size by now, in pixels; an image of that size will be shown.
    Resized(u32, u32),
    /// The window is minimised or hands no image over now; a later try may succeed.
    NotNow,
}

/// The images of a window, made anew when its size or surface changes.
pub struct Swapchain {
    // In the order in which they go: the chain before its surface.
    chain: Option<Chain>,
    commands: Commands,
    staging: Option<UploadBuffer>,
    surface: Surface,
    gpu: Arc<Gpu>,
}

/// A swapchain for one size of the window.
struct Chain {
    gpu: Arc<Gpu>,
    loader: khr::swapchain::Device,
    handle: vk::SwapchainKHR,
    images: Vec<vk::Image>,
    extent: vk::Extent2D,
    /// Whether red and blue change places.
    bgra: bool,
    /// Signalled when the image that comes next is handed over.
    acquired: vk::Semaphore,
    /// For each image, signalled when it can be shown.
    drawn: Vec<vk::Semaphore>,
}

impl Swapchain {
    /// The images of `surface`.
    ///
    /// # Errors
    /// No memory left.
    pub fn new(surface: Surface) -> Result<Self> {
        let gpu = surface.gpu.clone();
        Ok(Self { chain: None, commands: Commands::new(&gpu, "present", 0)?, staging: None, surface, gpu })
    }

    /// Shows `rgba`, a `width` × `height` image of sRGB bytes, row by row from the top, in a window of that size.
    ///
    /// # Errors
    /// A lost device; no memory left; a window that is gone.
    ///
    /// # Panics
    /// If `rgba` is not of that size.
    pub fn show(&mut self, (width, height): (u32, u32), rgba: &[u8]) -> Result<Shown> {
        assert_eq!(rgba.len(), width as usize * height as usize * 4, "bytes of a {width}x{height} image");
        // A second try, with a swapchain made anew, for a window that changed since the last image.
        for _ in 0..2 {
            let shown = self.try_show((width, height), rgba);
            match shown.as_ref().err().and_then(code_of) {
                Some(vk::Result::ERROR_OUT_OF_DATE_KHR) => self.chain = None,
                Some(vk::Result::ERROR_SURFACE_LOST_KHR) => {
                    self.chain = None;
                    self.surface.renew()?;
                }
                _ => return shown,
            }
        }
        Ok(Shown::NotNow)
    }

    fn try_show(&mut self, (width, height): (u32, u32), rgba: &[u8]) -> Result<Shown> {
        let wanted = vk::Extent2D { width, height };
        if self.chain.as_ref().is_none_or(|chain| chain.extent != wanted) {
            self.chain = None; // before the next one: a window has one swapchain at a time
            self.chain = match Chain::new(&self.surface, wanted)? {
                Ok(chain) => Some(chain),
                Err(instead) => return Ok(instead),
            };
        }
        let Some(chain) = &self.chain else { return Ok(Shown::NotNow) };
        let mut recording = self.commands.begin()?; // waits until the image before is on its way
        let bytes = rgba.len() as u64;
        if self.staging.as_ref().is_none_or(|staging| staging.size() < bytes) {
            self.staging = Some(UploadBuffer::new(&self.gpu, "present", bytes)?);
        }
        let Some(staging) = &mut self.staging else { return Ok(Shown::NotNow) };
        if chain.bgra {
            let swapped: Vec<[u8; 4]> = rgba.chunks_exact(4).map(|p| [p[2], p[1], p[0], p[3]]).collect();
            staging.write(0, swapped.as_flattened())?;
        } else {
            staging.write(0, rgba)?;
        }
        let acquired = chain.acquire();
        if let Some(vk::Result::TIMEOUT | vk::Result::NOT_READY) = acquired.as_ref().err().and_then(code_of) {
            return Ok(Shown::NotNow);
        }
        let (index, suboptimal) = acquired?;
        recording.fill_swapchain_image(staging, chain.images[index as usize], chain.extent);
        let drawn = chain.drawn[index as usize];
        let _ = recording.submit_between(Some(chain.acquired), Some(drawn))?;
        let worn = chain.present(index, drawn)? || suboptimal;
        if worn {
            self.chain = None;
        }
        Ok(Shown::Yes)
    }
}

impl Chain {
    /// A swapchain of the size that `wanted` is, or why not.
    fn new(surface: &Surface, wanted: vk::Extent2D) -> Result<Result<Self, Shown>> {
        let gpu = &surface.gpu;
        let failed = |call: &str| failed(call, "window");
        // SAFETY: a live surface and the device that was chosen for it; so for the next two.
        let capabilities =
            unsafe { surface.loader.get_physical_device_surface_capabilities(gpu.physical, surface.handle) }
                .map_err(failed("vkGetPhysicalDeviceSurfaceCapabilitiesKHR"))?;
        // SAFETY: as above.
        let formats =
            unsafe { surface.loader.get_physical_device_surface_formats(gpu.physical, surface.handle) }
                .map_err(failed("vkGetPhysicalDeviceSurfaceFormatsKHR"))?;
        // SAFETY: as above.
        let modes =
            unsafe { surface.loader.get_physical_device_surface_present_modes(gpu.physical, surface.handle) }
                .map_err(failed("vkGetPhysicalDeviceSurfacePresentModesKHR"))?;

        let now = capabilities.current_extent;
        if now.width == 0 || now.height == 0 {
            return Ok(Err(Shown::NotNow)); // minimised
        }
        // Where the window system leaves the size to the swapchain, all bits are set.
        if now.width != u32::MAX && (now.width, now.height) != (wanted.width, wanted.height) {
            return Ok(Err(Shown::Resized(now.width, now.height)));
        }
        let Some((format, bgra)) = pick_format(&formats) else {
            return Err(Error::NoDevice("the window takes no images with 8 bits a channel".into()));
        };
        // Newest image first where there is the choice: showing then never waits for the screen.
        let mailbox = modes.contains(&vk::PresentModeKHR::MAILBOX);
        let most = if capabilities.max_image_count == 0 { u32::MAX } else { capabilities.max_image_count };
        let alpha = [
            vk::CompositeAlphaFlagsKHR::OPAQUE,
            vk::CompositeAlphaFlagsKHR::INHERIT,
            vk::CompositeAlphaFlagsKHR::PRE_MULTIPLIED,
        ];
        let alpha = alpha.into_iter().find(|&mode| capabilities.supported_composite_alpha.contains(mode));
        let (least, largest) = (capabilities.min_image_extent, capabilities.max_image_extent);
        let fits = (least.width..=largest.width).contains(&wanted.width)
            && (least.height..=largest.height).contains(&wanted.height);
        let usage = vk::ImageUsageFlags::TRANSFER_DST;
        let (Some(alpha), true) = (alpha, fits && capabilities.supported_usage_flags.contains(usage)) else {
            return Err(Error::NoDevice(format!(
                "the window takes no images of {}x{} pixels that are copied to",
                wanted.width, wanted.height
            )));
        };
        let info = vk::SwapchainCreateInfoKHR::default()
            .surface(surface.handle)
            .min_image_count((capabilities.min_image_count + 1).min(most))
            .image_format(format.format)
            .image_color_space(format.color_space)
            .image_extent(wanted)
            .image_array_layers(1)
            .image_usage(usage)
            .image_sharing_mode(vk::SharingMode::EXCLUSIVE)
            .pre_transform(capabilities.current_transform)
            .composite_alpha(alpha)
            .present_mode(if mailbox { vk::PresentModeKHR::MAILBOX } else { vk::PresentModeKHR::FIFO })
            .clipped(true);
        let loader = khr::swapchain::Device::new(&gpu.instance.handle, &gpu.device);
        // SAFETY: within the surface's capabilities, as just asked; no other swapchain of it is left.
        let handle =
            gpu.call("vkCreateSwapchainKHR", "window", |_| unsafe { loader.create_swapchain(&info, None) })?;
        // From here on `chain` frees what was made if a later step fails.
        let mut chain = Self {
            gpu: gpu.clone(),
            loader,
            handle,
            images: Vec::new(),
            extent: wanted,
            bgra,
            acquired: vk::Semaphore::null(),
            drawn: Vec::new(),
        };
        // SAFETY: a live swapchain.
        chain.images = gpu.call("vkGetSwapchainImagesKHR", "window", |_| unsafe {
            chain.loader.get_swapchain_images(handle)
        })?;
        chain.acquired = semaphore(gpu, "image acquired")?;
        for _ in 0..chain.images.len() {
            chain.drawn.push(semaphore(gpu, "image drawn")?);
        }
        Ok(Ok(chain))
    }

    /// The index of the image that comes next, and whether the window has changed a little.
    fn acquire(&self) -> Result<(u32, bool)> {
        // SAFETY: a live swapchain; what waited for the semaphore before is done, as `Commands::begin` saw.
        self.gpu.call("vkAcquireNextImageKHR", "window", |_| unsafe {
            self.loader.acquire_next_image(self.handle, PATIENCE_NS, self.acquired, vk::Fence::null())
        })
    }

    /// Shows an image once `drawn` is signalled; returns whether the window has changed a little.
    fn present(&self, index: u32, drawn: vk::Semaphore) -> Result<bool> {
        let (semaphores, chains, indices) = ([drawn], [self.handle], [index]);
        let info = vk::PresentInfoKHR::default()
            .wait_semaphores(&semaphores)
            .swapchains(&chains)
            .image_indices(&indices);
        self.gpu.call("vkQueuePresentKHR", "window", |_| {
            // SAFETY: the queue is locked; the image was acquired, and a submission will signal the semaphore.
            self.gpu.with_queue(|queue| unsafe { self.loader.queue_present(queue, &info) })
        })
    }
}

impl Drop for Chain {
    fn drop(&mut self) {
        // SAFETY: the queue is locked and idle, so nothing uses the images or waits for the semaphores.
        self.gpu.with_queue(|queue| unsafe {
            let _ = self.gpu.device.queue_wait_idle(queue);
            for &semaphore in self.drawn.iter().chain([&self.acquired]) {
                self.gpu.device.destroy_semaphore(semaphore, None);
            }
            self.loader.destroy_swapchain(self.handle, None);
        });
    }
}

impl Recording<'_> {
    /// Copies all of `source` to `image`, which was just acquired, and makes it ready to be shown.
    fn fill_swapchain_image(&mut self, source: &UploadBuffer, image: vk::Image, extent: vk::Extent2D) {
        self.buffer_access(&source.raw, Access::TransferRead);
        let aspect = vk::ImageAspectFlags::COLOR;
        let region = [vk::BufferImageCopy::default()
            .image_subresource(vk::ImageSubresourceLayers {
                aspect_mask: aspect,
                layer_count: 1,
                ..Default::default()
            })
            .image_extent(extent.into())];
        // The copy waits for the image to be acquired in the stage of transfers: so does the change of layout.
        let before =
            image_barrier(image, aspect, (0, 1), (Access::TransferWrite, Access::TransferWrite), true);
        let after = image_barrier(image, aspect, (0, 1), (Access::TransferWrite, Access::Undefined), false)
            .new_layout(vk::ImageLayout::PRESENT_SRC_KHR);
        let barrier = |barrier: &vk::ImageMemoryBarrier2<'_>| {
            let barriers = [*barrier];
            let dependency = vk::DependencyInfo::default().image_memory_barriers(&barriers);
            // SAFETY: recording, outside of a render pass.
            unsafe { self.device().cmd_pipeline_barrier2(self.raw(), &dependency) };
        };
        barrier(&before);
        // SAFETY: recording; `source` holds the whole image, which is in the layout of a target.
        unsafe {
            self.device().cmd_copy_buffer_to_image(
                self.raw(),
                source.raw.handle,
                image,
                Access::TransferWrite.layout(),
                &region,
            );
        }
        barrier(&after);
    }
}

fn semaphore(gpu: &Gpu, name: &str) -> Result<vk::Semaphore> {
    let info = vk::SemaphoreCreateInfo::default();
    // SAFETY: a live device.
    let handle =
        gpu.call("vkCreateSemaphore", name, |device| unsafe { device.create_semaphore(&info, None) })?;
    gpu.name(handle, name);
    Ok(handle)
}

/// A format whose bytes are shown as they are, and whether they go blue, green, red.
fn pick_format(formats: &[vk::SurfaceFormatKHR]) -> Option<(vk::SurfaceFormatKHR, bool)> {
    // A copy into an sRGB format keeps the bytes too.
    let known = [
        (vk::Format::B8G8R8A8_UNORM, true),
        (vk::Format::R8G8B8A8_UNORM, false),
        (vk::Format::B8G8R8A8_SRGB, true),
        (vk::Format::R8G8B8A8_SRGB, false),
    ];
    known.into_iter().find_map(|(wanted, bgra)| {
        let suits = |format: &&vk::SurfaceFormatKHR| {
            format.format == wanted && format.color_space == vk::ColorSpaceKHR::SRGB_NONLINEAR
        };
        Some((*formats.iter().find(suits)?, bgra))
    })
}
