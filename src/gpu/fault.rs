//! Result codes of Vulkan as errors of the library, which names none of its types.

use ash::vk;

use crate::error::Error;

/// An error that [`Gpu::fail_next`](super::Gpu::fail_next) can cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The device has no memory left.
    OutOfDeviceMemory,
    /// The driver found no memory of the host.
    OutOfHostMemory,
    /// The device was reset or taken away.
    DeviceLost,
    /// The window changed since its swapchain was made.
    OutOfDate,
    /// The window's surface is no more.
    SurfaceLost,
}

impl Fault {
    pub(super) fn code(self) -> vk::Result {
        match self {
            Self::OutOfDeviceMemory => vk::Result::ERROR_OUT_OF_DEVICE_MEMORY,
            Self::OutOfHostMemory => vk::Result::ERROR_OUT_OF_HOST_MEMORY,
            Self::DeviceLost => vk::Result::ERROR_DEVICE_LOST,
            Self::OutOfDate => vk::Result::ERROR_OUT_OF_DATE_KHR,
            Self::SurfaceLost => vk::Result::ERROR_SURFACE_LOST_KHR,
        }
    }
}

/// The failure of `call` for `object`; made to be handed to `map_err`.
pub(super) fn failed(call: &str, object: &str) -> impl FnOnce(vk::Result) -> Error + use<> {
    let call = if object.is_empty() { call.into() } else { format!("{call} ({object})") };
    move |code| {
        let problem = match code {
            vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
                "the driver found no memory of the host; a smaller image or scene needs less".into()
            }
            vk::Result::ERROR_OUT_OF_DEVICE_MEMORY => {
                "no device memory is left; a smaller image or scene needs less".into()
            }
            code => code.to_string(),
        };
        Error::Vulkan { call, code: code.as_raw(), problem }
    }
}

/// The result code that `error` came from, if it did from one.
pub(super) fn code_of(error: &Error) -> Option<vk::Result> {
    match error {
        Error::Vulkan { code, .. } => Some(vk::Result::from_raw(*code)),
        _ => None,
    }
}

/// `error`, said as a lack of `bytes` for `object` if it is one.
pub(super) fn out_of_memory(object: &str, bytes: u64, error: Error) -> Error {
    match code_of(&error) {
        Some(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY) => {
            no_memory(object, bytes)
        }
        _ => error,
    }
}

/// A lack of `bytes` for `object`.
pub(super) fn no_memory(object: &str, bytes: u64) -> Error {
    let mib = bytes as f64 / f64::from(1 << 20);
    Error::DeviceMemory {
        object: object.into(),
        problem: format!("none left for {mib:.1} MiB; a smaller image or scene needs less"),
    }
}
