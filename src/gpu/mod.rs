//! The device: the only room that names `ash` and the only one with `unsafe`.
//!
//! Everything here is safe to call. A resource frees itself when its last owner goes; a command buffer
//! owns what it was recorded with until the device is done with it; host-visible memory waits for the
//! device before the host touches it. The room knows nothing of scenes, rays or faces.

#![allow(unsafe_code)]

mod access;
mod buffer;
pub mod census;
mod choice;
mod commands;
mod copy;
mod descriptor;
mod device;
mod draw;
mod end;
mod fault;
mod host_image;
mod image;
mod instance;
mod memory;
mod pipeline;
mod sampler;
mod staging;
#[cfg(feature = "view")]
mod surface;
#[cfg(feature = "view")]
mod swapchain;
mod texture;
mod timestamps;

pub use access::Access;
pub use buffer::{DeviceBuffer, ReadbackBuffer, UploadBuffer};
pub use census::Census;
pub use choice::{DeviceInfo, DeviceKind, devices};
pub use commands::{Commands, Recording, Submission};
pub use descriptor::{Binding, BindingKind, DescriptorSet, Resource, SetLayout};
pub use device::{Gpu, Options};
pub use draw::{ColorTarget, DepthTarget, Draws, Targets};
pub use end::{end_at_once, keeping_hangups_ignored};
pub use fault::Fault;
pub use host_image::HostImage;
pub use image::{Format, Image, ImageDesc, ImageUse, full_mips};
pub use instance::Messages;
pub use memory::{ReadbackChoice, ReadbackMemory};
pub use pipeline::{
    Blend, ComputePipeline, Cull, DepthMode, GraphicsDesc, GraphicsPipeline, Shader, StencilMode,
};
pub use sampler::{AddressMode, SamplerDesc, TexelFilter};
pub use staging::{ReadbackRing, Uploads};
#[cfg(feature = "view")]
pub use surface::{Surface, Window};
#[cfg(feature = "view")]
pub use swapchain::{Shown, Swapchain};
pub use timestamps::Timing;

/// The SPIR-V of a file under `glsl/`, as `build.rs` compiled it: `spirv!("id_buffer.vert")`.
#[macro_export]
macro_rules! spirv {
    ($name:literal) => {
        include_bytes!(concat!(env!("OUT_DIR"), "/", $name, ".spv"))
    };
}
