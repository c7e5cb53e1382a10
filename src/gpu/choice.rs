//! Which device serves: what is required of it, and the order of preference.

use std::ffi::CStr;

use ash::vk;

use super::fault::failed;
use super::instance::{INSTALL_DRIVER, Instance};
use crate::constants::MAX_BANK_ARRAYS;
use crate::error::{Error, Result};

/// Components that the vertices of a leaf hand on to its fragments: locations 0 to 23 of glsl/leaf.vert. Vulkan
/// promises 64; graphics cards have 116 and more.
const VARYINGS: u32 = 24 * 4;

/// Samplers of a fragment shader: the bank's, the environment's, and those of a draw's own three arrays. Vulkan promises 16.
const SAMPLERS: u32 = MAX_BANK_ARRAYS + 4;

/// Texel buffers of a fragment shader, which count as sampled images: the tables of the scene and of nodes.
const TEXEL_BUFFERS: u32 = 2;

/// A Vulkan device of this machine.
#[derive(Debug, Clone)]
pub struct DeviceInfo {
    /// Its index, for `--device`.
    pub index: usize,
    /// Its name, such as `llvmpipe (LLVM 15.0.6, 256 bits)`.
    pub name: String,
    /// Its driver's name and version.
    pub driver: String,
    /// What it is made of.
    pub kind: DeviceKind,
    /// Vulkan version: major, minor, patch.
    pub api_version: [u32; 3],
    /// Whether it can serve, and if not, why.
    pub usable: Result<(), String>,
}

/// What a device is made of, best first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum DeviceKind {
    /// A graphics card.
    Discrete,
    /// A GPU that shares the CPU's memory.
    Integrated,
    /// A GPU handed to a virtual machine.
    Virtual,
    /// A software rasteriser.
    Cpu,
    /// Something else.
    Other,
}

/// Every Vulkan device of this machine, whether it can serve or not.
///
/// # Errors
/// [`Error::NoDevice`] without a loader or driver.
pub fn devices() -> Result<Vec<DeviceInfo>> {
    Ok(list(&Instance::new(false, &[])?, &|_, _| true)?.into_iter().map(|candidate| candidate.info).collect())
}

pub(super) struct Candidate {
    pub(super) handle: vk::PhysicalDevice,
    pub(super) info: DeviceInfo,
    pub(super) queue_family: u32,
    /// Bits of a timestamp that count; 0 without timestamps.
    pub(super) timestamp_bits: u32,
    pub(super) properties: vk::PhysicalDeviceProperties,
    pub(super) features: vk::PhysicalDeviceFeatures,
    pub(super) max_buffer_size: u64,
}

/// Whether a queue family of a device can show images where they are to be shown.
pub(super) type Presents<'a> = &'a dyn Fn(vk::PhysicalDevice, u32) -> bool;

/// The device named by `wanted` (an index, if it is a number, or a part of a name in any case), else the best one.
pub(super) fn choose(instance: &Instance, wanted: Option<&str>, presents: Presents<'_>) -> Result<Candidate> {
    let mut candidates = list(instance, presents)?;
    let infos: Vec<&DeviceInfo> = candidates.iter().map(|candidate| &candidate.info).collect();
    let index = pick(&infos, wanted)?;
    Ok(candidates.swap_remove(index))
}

fn pick(infos: &[&DeviceInfo], wanted: Option<&str>) -> Result<usize> {
    let list = |entry: fn(&DeviceInfo) -> String| {
        infos.iter().map(|info| entry(info)).collect::<Vec<_>>().join("; ")
    };
    if infos.is_empty() {
        return Err(Error::NoDevice(format!(
            "no Vulkan device; install a software one with `{INSTALL_DRIVER}`"
        )));
    }
    if let Some(wanted) = wanted {
        let named = |info: &DeviceInfo| info.name.to_lowercase().contains(&wanted.to_lowercase());
        let index = match wanted.parse::<i64>() {
            // No part of a name: those of software devices are full of numbers.
            Ok(number) => usize::try_from(number).ok().filter(|index| *index < infos.len()),
            Err(_) => infos.iter().position(|info| named(info)),
        };
        let index = index.ok_or_else(|| {
            let known = list(|info| format!("{} {}", info.index, info.name));
            Error::NoDevice(format!("no Vulkan device is called or numbered {wanted:?}; there are: {known}"))
        })?;
        return match &infos[index].usable {
            Ok(()) => Ok(index),
            Err(reason) => Err(Error::NoDevice(format!("Vulkan device {}: {reason}", infos[index].name))),
        };
    }
    let usable = (0..infos.len()).filter(|&index| infos[index].usable.is_ok());
    usable.min_by_key(|&index| (infos[index].kind, index)).ok_or_else(|| {
        let reasons = list(|info| {
            format!("{}: {}", info.name, info.usable.as_ref().err().cloned().unwrap_or_default())
        });
        Error::NoDevice(format!(
            "no Vulkan device can serve ({reasons}); install a software one with `{INSTALL_DRIVER}`"
        ))
    })
}

fn list(instance: &Instance, presents: Presents<'_>) -> Result<Vec<Candidate>> {
    // SAFETY: a live instance.
    let handles = unsafe { instance.handle.enumerate_physical_devices() }
        .map_err(failed("vkEnumeratePhysicalDevices", ""))?;
    Ok(handles
        .into_iter()
        .enumerate()
        .map(|(index, handle)| inspect(instance, index, handle, presents))
        .collect())
}

fn inspect(
    instance: &Instance,
    index: usize,
    handle: vk::PhysicalDevice,
    presents: Presents<'_>,
) -> Candidate {
    // SAFETY: `handle` was enumerated from this instance; a 1.0 query.
    let properties = unsafe { instance.handle.get_physical_device_properties(handle) };
    let mut driver = String::new();
    let mut max_buffer_size = 0;
    let mut features = vk::PhysicalDeviceFeatures::default();
    let mut usable = Err(format!("speaks Vulkan {}, not 1.3", version(properties.api_version)));
    if properties.api_version >= vk::API_VERSION_1_3 {
        let mut driver_properties = vk::PhysicalDeviceDriverProperties::default();
        let mut properties13 = vk::PhysicalDeviceVulkan13Properties::default();
        let mut properties2 = vk::PhysicalDeviceProperties2::default()
            .push_next(&mut driver_properties)
            .push_next(&mut properties13);
        let mut features12 = vk::PhysicalDeviceVulkan12Features::default();
        let mut features13 = vk::PhysicalDeviceVulkan13Features::default();
        let mut features2 =
            vk::PhysicalDeviceFeatures2::default().push_next(&mut features12).push_next(&mut features13);
        // SAFETY: the device speaks 1.3, which knows all chained structures.
        unsafe {
            instance.handle.get_physical_device_properties2(handle, &mut properties2);
            instance.handle.get_physical_device_features2(handle, &mut features2);
        }
        features = features2.features;
        let text = |text: Result<&CStr, _>| {
            text.map_or(String::new(), |text: &CStr| text.to_string_lossy().into_owned())
        };
        driver = format!(
            "{} {}",
            text(driver_properties.driver_name_as_c_str()),
            text(driver_properties.driver_info_as_c_str())
        );
        max_buffer_size = properties13.max_buffer_size;
        let mut missing = missing(&features12, &features13);
        missing.extend(short_of(&properties.limits));
        usable = if missing.is_empty() { Ok(()) } else { Err(format!("lacks {}", missing.join(", "))) };
    }
    // SAFETY: as above.
    let families = unsafe { instance.handle.get_physical_device_queue_family_properties(handle) };
    let wanted = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
    let family = families.iter().position(|family| family.queue_flags.contains(wanted));
    if usable.is_ok() && family.is_none() {
        usable = Err("has no queue for both graphics and compute".into());
    }
    let family = family.unwrap_or(0);
    if usable.is_ok() && !presents(handle, family as u32) {
        usable = Err("cannot show images in a window".into());
    }
    Candidate {
        handle,
        info: DeviceInfo {
            index,
            name: properties
                .device_name_as_c_str()
                .map_or("?".into(), |name| name.to_string_lossy().into_owned()),
            driver: driver.trim().into(),
            kind: kind(properties.device_type),
            api_version: version_parts(properties.api_version),
            usable,
        },
        queue_family: family as u32,
        timestamp_bits: families.get(family).map_or(0, |family| family.timestamp_valid_bits),
        properties,
        features,
        max_buffer_size,
    }
}

/// The features that every device must have; [`missing`] asks for these and no others.
pub(super) fn required()
-> (vk::PhysicalDeviceVulkan12Features<'static>, vk::PhysicalDeviceVulkan13Features<'static>) {
    let vulkan12 = vk::PhysicalDeviceVulkan12Features::default()
        .scalar_block_layout(true)
        .host_query_reset(true)
        .timeline_semaphore(true);
    // SPIR-V 1.6 compute shaders need maintenance4. Which of the last two a `discard` needs depends on the
    // version of the shader compiler.
    let vulkan13 = vk::PhysicalDeviceVulkan13Features::default()
        .dynamic_rendering(true)
        .synchronization2(true)
        .maintenance4(true)
        .shader_demote_to_helper_invocation(true)
        .shader_terminate_invocation(true);
    (vulkan12, vulkan13)
}

/// What shaders need more of than every Vulkan device has.
fn short_of(limits: &vk::PhysicalDeviceLimits) -> Vec<&'static str> {
    let short = [
        (
            limits.max_fragment_input_components < VARYINGS,
            "enough fragment shader inputs (maxFragmentInputComponents)",
        ),
        // Its position is one, too.
        (
            limits.max_vertex_output_components < VARYINGS + 4,
            "enough vertex shader outputs (maxVertexOutputComponents)",
        ),
        (
            limits.max_per_stage_descriptor_samplers < SAMPLERS,
            "enough samplers (maxPerStageDescriptorSamplers)",
        ),
        (
            limits.max_per_stage_descriptor_sampled_images < SAMPLERS + TEXEL_BUFFERS,
            "enough sampled images (maxPerStageDescriptorSampledImages)",
        ),
    ];
    short.into_iter().filter_map(|(short, what)| short.then_some(what)).collect()
}

fn missing(
    vulkan12: &vk::PhysicalDeviceVulkan12Features<'_>,
    vulkan13: &vk::PhysicalDeviceVulkan13Features<'_>,
) -> Vec<&'static str> {
    [
        (vulkan12.scalar_block_layout, "scalarBlockLayout"),
        (vulkan12.host_query_reset, "hostQueryReset"),
        (vulkan12.timeline_semaphore, "timelineSemaphore"),
        (vulkan13.dynamic_rendering, "dynamicRendering"),
        (vulkan13.synchronization2, "synchronization2"),
        (vulkan13.maintenance4, "maintenance4"),
        (vulkan13.shader_demote_to_helper_invocation, "shaderDemoteToHelperInvocation"),
        (vulkan13.shader_terminate_invocation, "shaderTerminateInvocation"),
    ]
    .into_iter()
    .filter_map(|(present, name)| (present == vk::FALSE).then_some(name))
    .collect()
}

fn kind(device_type: vk::PhysicalDeviceType) -> DeviceKind {
    match device_type {
        vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::Discrete,
        vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::Integrated,
        vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::Virtual,
        vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
        _ => DeviceKind::Other,
    }
}

fn version_parts(version: u32) -> [u32; 3] {
    [vk::api_version_major(version), vk::api_version_minor(version), vk::api_version_patch(version)]
}

fn version(version: u32) -> String {
    version_parts(version).map(|part| part.to_string()).join(".")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info(index: usize, name: &str, kind: DeviceKind, usable: Result<(), &str>) -> DeviceInfo {
        DeviceInfo {
            index,
            name: name.into(),
            driver: "driver".into(),
            kind,
            api_version: [1, 3, 0],
            usable: usable.map_err(Into::into),
        }
    }

    #[test]
    fn best_kind_that_can_serve_wins() {
        let cpu = info(0, "llvmpipe (LLVM 15.0.6, 256 bits)", DeviceKind::Cpu, Ok(()));
        let old = info(1, "Old Card", DeviceKind::Discrete, Err("speaks Vulkan 1.1.0, not 1.3"));
        let integrated = info(2, "Laptop Graphics", DeviceKind::Integrated, Ok(()));
        let infos = [&cpu, &old, &integrated];
        assert_eq!(pick(&infos, None).unwrap(), 2);
        assert_eq!(pick(&infos[..2], None).unwrap(), 0);
        assert_eq!(pick(&infos, Some("0")).unwrap(), 0);
        assert_eq!(pick(&infos, Some("LAPTOP")).unwrap(), 2);
        let refused = pick(&infos, Some("old")).unwrap_err().to_string();
        assert!(refused.contains("Old Card: speaks Vulkan 1.1.0"), "{refused}");
        let unknown = pick(&infos, Some("voodoo")).unwrap_err().to_string();
        assert!(unknown.contains("voodoo") && unknown.contains("0 llvmpipe"), "{unknown}");
        assert_eq!(pick(&infos, Some("15.0.6")).unwrap(), 0, "a part of a name");
        for number in ["3", "5", "256", "-1"] {
            let unknown = pick(&infos, Some(number)).unwrap_err().to_string();
            assert!(unknown.contains(&format!("{number:?}; there are: 0 llvmpipe")), "{unknown}");
        }
    }

    #[test]
    fn no_device_names_the_remedy() {
        let old = info(0, "Old Card", DeviceKind::Discrete, Err("lacks synchronization2"));
        for infos in [&[][..], &[&old][..]] {
            let message = pick(infos, None).unwrap_err().to_string();
            assert!(message.contains(INSTALL_DRIVER), "{message}");
        }
    }

    #[test]
    fn the_required_features_are_the_checked_ones() {
        let (vulkan12, vulkan13) = required();
        assert!(missing(&vulkan12, &vulkan13).is_empty());
        assert_eq!(missing(&Default::default(), &Default::default()).len(), 8);
    }

    #[test]
    fn limits_that_shaders_exceed_are_named() {
        // What every device has.
        let mut limits = vk::PhysicalDeviceLimits {
            max_fragment_input_components: 64,
            max_vertex_output_components: 64,
            max_per_stage_descriptor_samplers: 16,
            max_per_stage_descriptor_sampled_images: 16,
            ..Default::default()
        };
        assert_eq!(short_of(&limits).len(), 3);
        limits.max_fragment_input_components = 112;
        limits.max_vertex_output_components = 128;
        limits.max_per_stage_descriptor_sampled_images = 128;
        assert!(short_of(&limits).is_empty());
    }
}
