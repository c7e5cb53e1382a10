//! The Vulkan instance, its validation layers, and the messages that they send.

use std::{
    borrow::Cow,
    ffi::{CStr, c_void},
    sync::{Arc, Mutex, PoisonError},
};

use ash::{ext, khr, vk};

use super::fault::failed;
use crate::error::{Error, Result};
use crate::memory;

/// What installs a software Vulkan device on Debian.
pub(super) const INSTALL_DRIVER: &str = "apt-get install mesa-vulkan-drivers libvulkan1";
const INSTALL_VALIDATION: &str = "apt-get install vulkan-validationlayers";
const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Bytes that loading a driver takes; Mesa's llvmpipe, with LLVM, is the largest.
const DRIVER_BYTES: u64 = 256 << 20;

/// Errors that the validation layers and the allocator reported, in order.
///
/// Outlives the device, so that objects it never freed are still reported.
#[derive(Debug, Default)]
pub struct Messages {
    errors: Mutex<Vec<String>>,
}

impl Messages {
    /// Every error so far.
    pub fn errors(&self) -> Vec<String> {
        self.errors.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    pub(super) fn error(&self, message: String) {
        log::error!("{message}");
        self.errors.lock().unwrap_or_else(PoisonError::into_inner).push(message);
    }
}

/// Loader, instance and messenger; destroyed after everything made from them.
pub(super) struct Instance {
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    pub(super) handle: ash::Instance,
    /// Whether objects can be named.
    pub(super) debug_utils: bool,
    pub(super) validation: bool,
    pub(super) messages: Arc<Messages>,
    // Last: unloads the library.
    pub(super) entry: ash::Entry,
}

impl Instance {
    /// An instance for Vulkan 1.3 with the extensions `wanted`, and with core and synchronization validation if
    /// `validation` asks for them.
    pub(super) fn new(validation: bool, wanted: &[&CStr]) -> Result<Self> {
        // Loaders take drivers that find no memory for absent.
        memory::check(DRIVER_BYTES, "a Vulkan driver", "free some, or allow more")?;
        // SAFETY: libvulkan is a well-behaved library, whose initialisers have no requirements.
        let entry = unsafe { ash::Entry::load() }.map_err(|error| {
            Error::NoDevice(format!("no Vulkan loader ({error}); install one with `{INSTALL_DRIVER}`"))
        })?;
        let failed = |call: &str| failed(call, "");
        // SAFETY: no requirements beyond a loaded entry.
        let version = unsafe { entry.try_enumerate_instance_version() }
            .map_err(failed("vkEnumerateInstanceVersion"))?
            .unwrap_or(vk::API_VERSION_1_0);
        if version < vk::API_VERSION_1_3 {
            return Err(Error::NoDevice(format!(
                "the Vulkan loader is older than 1.3; install a newer one with `{INSTALL_DRIVER}`"
            )));
        }
        let messages = Arc::new(Messages::default());
        // SAFETY: no requirements beyond a loaded entry.
        let layers = unsafe { entry.enumerate_instance_layer_properties() }
            .map_err(failed("vkEnumerateInstanceLayerProperties"))?;
        if validation && !layers.iter().any(|layer| layer.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) {
            return Err(Error::NoDevice(format!(
                "validation was asked for, but its Vulkan layer is not installed: `{INSTALL_VALIDATION}`"
            )));
        }
        // SAFETY: as above.
        let extensions = unsafe { entry.enumerate_instance_extension_properties(None) }
            .map_err(failed("vkEnumerateInstanceExtensionProperties"))?;
        let present =
            |name: &CStr| extensions.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name));
        let debug_utils = validation || present(ext::debug_utils::NAME);
        if let Some(lacking) = wanted.iter().find(|name| !present(name)) {
            return Err(Error::NoDevice(format!(
                "no Vulkan driver can show images in a window of this kind (none has {}); install one with \
                 `{INSTALL_DRIVER}`",
                lacking.to_string_lossy()
            )));
        }

        let enabled = with_present(wanted, &[khr::portability_enumeration::NAME], &extensions);
        let mut names: Vec<_> = enabled.iter().map(|name| name.as_ptr()).collect();
        if debug_utils {
            names.push(ext::debug_utils::NAME.as_ptr());
        }
        let mut layer_names = Vec::new();
        if validation {
            names.push(ext::validation_features::NAME.as_ptr());
            layer_names.push(VALIDATION_LAYER.as_ptr());
        }
        let application = vk::ApplicationInfo::default()
            .application_name(c"vertex-tracing")
            .api_version(vk::API_VERSION_1_3);
        let synchronization = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&synchronization);
        let mut chained = messenger_info(&messages);
        let mut info = vk::InstanceCreateInfo::default()
            .flags(flags(&enabled))
            .application_info(&application)
            .enabled_extension_names(&names)
            .enabled_layer_names(&layer_names);
        if debug_utils {
            // Hears of errors in creating and destroying the instance itself.
            info = info.push_next(&mut chained);
        }
        if validation {
            info = info.push_next(&mut features);
        }
        // SAFETY: every pointer in `info` lives until the end of this function; `messages` outlives the instance.
        let handle = unsafe { entry.create_instance(&info, None) }.map_err(|code| match code {
            vk::Result::ERROR_INCOMPATIBLE_DRIVER => {
                Error::NoDevice(format!("no Vulkan driver; install one with `{INSTALL_DRIVER}`"))
            }
            code => failed("vkCreateInstance")(code),
        })?;
        let mut instance = Self { messenger: None, handle, debug_utils, validation, messages, entry };
        if debug_utils {
            let loader = ext::debug_utils::Instance::new(&instance.entry, &instance.handle);
            // SAFETY: `messages`, the user data, is held by `instance` until after the messenger is destroyed.
            let messenger =
                unsafe { loader.create_debug_utils_messenger(&messenger_info(&instance.messages), None) }
                    .map_err(failed("vkCreateDebugUtilsMessengerEXT"))?;
            instance.messenger = Some((loader, messenger));
        }
        Ok(instance)
    }
}

/// The extensions `wanted`, and those of `optional` that are `present`.
pub(super) fn with_present<'n>(
    wanted: &[&'n CStr],
    optional: &[&'n CStr],
    present: &[vk::ExtensionProperties],
) -> Vec<&'n CStr> {
    let known = |name: &&CStr| present.iter().any(|e| e.extension_name_as_c_str() == Ok(*name));
    wanted.iter().chain(optional.iter().filter(|name| known(name))).copied().collect()
}

/// Flags of an instance with these extensions. Loaders hide drivers that lack parts of Vulkan, such as those upon Metal,
/// from whoever does not ask for them; what is needed of a device is checked when it is chosen.
fn flags(enabled: &[&CStr]) -> vk::InstanceCreateFlags {
    match enabled.contains(&khr::portability_enumeration::NAME) {
        true => vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR,
        false => vk::InstanceCreateFlags::empty(),
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: the last users of the instance, made in `new`; devices were destroyed by their owner before.
        unsafe {
            if let Some((loader, messenger)) = self.messenger.take() {
                loader.destroy_debug_utils_messenger(messenger, None);
            }
            self.handle.destroy_instance(None);
        }
    }
}

fn messenger_info(messages: &Arc<Messages>) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(
            vk::DebugUtilsMessageSeverityFlagsEXT::ERROR | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING,
        )
        .message_type(
            vk::DebugUtilsMessageTypeFlagsEXT::GENERAL
                | vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
                | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
        )
        .pfn_user_callback(Some(on_message))
        .user_data(Arc::as_ptr(messages).cast_mut().cast())
}

/// Logs a message and keeps it if it is an error.
unsafe extern "system" fn on_message(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    types: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the loader hands valid callback data, and the user data of `messenger_info`, a live `Messages`.
    let (text, messages) = unsafe {
        let text = (*data).message_as_c_str().map_or(Cow::Borrowed(""), CStr::to_string_lossy);
        (text, &*user.cast::<Messages>())
    };
    // Loaders report drivers that they skip as GENERAL errors: those are not this program's.
    let ours = !types.contains(vk::DebugUtilsMessageTypeFlagsEXT::GENERAL);
    if severity.contains(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR) && ours {
        messages.error(text.into_owned());
    } else if types.contains(vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE) {
        log::debug!("{text}");
    } else {
        log::warn!("{text}");
    }
    vk::FALSE
}

#[cfg(test)]
mod tests {
    use super::*;

    fn present(names: &[&CStr]) -> Vec<vk::ExtensionProperties> {
        let named = |name: &&CStr| vk::ExtensionProperties::default().extension_name(name).unwrap();
        names.iter().map(named).collect()
    }

    #[test]
    fn drivers_that_lack_parts_are_asked_for_where_the_loader_can() {
        let portability = khr::portability_enumeration::NAME;
        let enabled = |present: &[vk::ExtensionProperties]| {
            with_present(&[khr::surface::NAME], &[portability], present)
        };
        let with = enabled(&present(&[ext::debug_utils::NAME, portability]));
        assert_eq!(with, [khr::surface::NAME, portability]);
        assert_eq!(flags(&with), vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR);
        let without = enabled(&present(&[ext::debug_utils::NAME]));
        assert_eq!(without, [khr::surface::NAME]);
        assert!(flags(&without).is_empty());
    }
}
