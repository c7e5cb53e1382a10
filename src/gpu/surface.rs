//! The surface of a window, and the device that can show images on it.

use std::{ffi::CStr, sync::Arc};

use ash::{khr, vk};
use raw_window_handle::{HasDisplayHandle, HasWindowHandle};

use super::{Gpu, choice, device::Options, fault::failed, instance::Instance};
use crate::error::{Error, Result};

/// A window that a [`Surface`] can be made of.
pub trait Window: HasDisplayHandle + HasWindowHandle + Send + Sync + 'static {}

impl<W: HasDisplayHandle + HasWindowHandle + Send + Sync + 'static> Window for W {}

/// Where the images of a window appear. Holds the window, which thus cannot vanish first.
pub struct Surface {
    pub(super) gpu: Arc<Gpu>,
    pub(super) loader: khr::surface::Instance,
    pub(super) handle: vk::SurfaceKHR,
    window: Arc<dyn Window>,
}

impl Gpu {
    /// Opens a device that can show images in `window`.
    ///
    /// # Errors
    /// [`Error::NoDevice`] as for [`new`](Self::new), and if no device can show images there.
    pub fn for_window(options: &Options, window: &Arc<dyn Window>) -> Result<Arc<Self>> {
        let display = window.display_handle().map_err(no_window)?.as_raw();
        let names = ash_window::enumerate_required_extensions(display)
            .map_err(|code| Error::NoDevice(format!("Vulkan knows no windows of this kind: {code}")))?;
        // SAFETY: these point to names that live as long as the program.
        let names: Vec<&CStr> = names.iter().map(|&name| unsafe { CStr::from_ptr(name) }).collect();
        let instance = Instance::new(options.validated(), &names)?;
        let loader = khr::surface::Instance::new(&instance.entry, &instance.handle);
        // Lives only for the choice: the surface that stays is the device's child.
        let surface = create(&instance, &**window)?;
        let presents = |device, family| {
            // SAFETY: a device of this instance with this family; a live surface.
            let shows = unsafe { loader.get_physical_device_surface_support(device, family, surface) };
            // SAFETY: as above.
            let extensions = unsafe { instance.handle.enumerate_device_extension_properties(device) };
            let swapchain =
                |e: &vk::ExtensionProperties| e.extension_name_as_c_str() == Ok(khr::swapchain::NAME);
            shows.unwrap_or(false) && extensions.is_ok_and(|all| all.iter().any(swapchain))
        };
        let candidate = choice::choose(&instance, options.device.as_deref(), &presents);
        // SAFETY: made above and used no more.
        unsafe { loader.destroy_surface(surface, None) };
        Self::open(instance, candidate?, &[khr::swapchain::NAME])
    }
}

impl Surface {
    /// The surface of `window`, for which `gpu` was opened by [`Gpu::for_window`].
    ///
    /// # Errors
    /// The window is gone, or has a surface already.
    pub fn new(gpu: &Arc<Gpu>, window: &Arc<dyn Window>) -> Result<Self> {
        Ok(Self {
            gpu: gpu.clone(),
            loader: khr::surface::Instance::new(&gpu.instance.entry, &gpu.instance.handle),
            handle: create(&gpu.instance, &**window)?,
            window: window.clone(),
        })
    }

    /// Makes the surface anew, after the window system lost it. Nothing may be left that was made of the old one.
    pub(super) fn renew(&mut self) -> Result<()> {
        // SAFETY: its swapchain is gone; the null that stays if the next call fails is ignored.
        unsafe { self.loader.destroy_surface(std::mem::take(&mut self.handle), None) };
        self.handle = create(&self.gpu.instance, &*self.window)?;
        Ok(())
    }
}

impl Drop for Surface {
    fn drop(&mut self) {
        // SAFETY: its swapchain is gone; the window is still there.
        unsafe { self.loader.destroy_surface(self.handle, None) };
    }
}

fn create(instance: &Instance, window: &dyn Window) -> Result<vk::SurfaceKHR> {
    let display = window.display_handle().map_err(no_window)?.as_raw();
    let handle = window.window_handle().map_err(no_window)?.as_raw();
    // SAFETY: the extensions for this display are enabled; the caller's window outlives the surface.
    unsafe { ash_window::create_surface(&instance.entry, &instance.handle, display, handle, None) }
        .map_err(failed("vkCreateSurfaceKHR", "window"))
}

fn no_window(error: raw_window_handle::HandleError) -> Error {
    Error::NoDevice(format!("the window cannot be drawn to: {error}"))
}
