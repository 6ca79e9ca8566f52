//! The Vulkan instance and its messenger.

use std::ffi::CStr;
use std::sync::Arc;

use ash::{ext, vk};

use super::{Error, ValidationLog, debug, manifest};

/// An instance and its messenger.
pub(super) struct Instance {
    pub(super) raw: ash::Instance,
    pub(super) debug_utils: bool,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    // Outlives the messenger, which writes to it.
    pub(super) log: Arc<ValidationLog>,
    _entry: ash::Entry,
}

impl Instance {
    pub(super) fn new(validation: bool) -> Result<Self, Error> {
        let no_loader = |reason: String| Error::NoLoader { reason };
        manifest::check()?;
        // SAFETY: the loader is a well-behaved library; `_entry` keeps it loaded as long as the instance.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| no_loader(e.to_string()))?;
        // SAFETY: a query without preconditions, as are the two below.
        let version = unsafe { entry.try_enumerate_instance_version() }
            .map_err(of_loader("vkEnumerateInstanceVersion"))?
            .unwrap_or(vk::API_VERSION_1_0);
        if version < vk::API_VERSION_1_3 {
            return Err(no_loader(format!("the one found is {}, 1.3 is needed", version_string(version))));
        }
        // SAFETY: as above.
        let layers = unsafe { entry.enumerate_instance_layer_properties() }
            .map_err(of_loader("vkEnumerateInstanceLayerProperties"))?;
        // SAFETY: as above.
        let extensions = unsafe { entry.enumerate_instance_extension_properties(None) }
            .map_err(of_loader("vkEnumerateInstanceExtensionProperties"))?;

        let has_layer = layers.iter().any(|l| l.layer_name_as_c_str() == Ok(debug::VALIDATION_LAYER));
        if validation && !has_layer {
            tracing::warn!("the validation layer was asked for and is not installed");
        }
        let validation = validation && has_layer;
        let debug_utils = has_extension(&extensions, ext::debug_utils::NAME);
        let log = Arc::new(ValidationLog::new(validation && debug_utils));

        let app = vk::ApplicationInfo::default()
            .application_name(c"parhelion")
            .engine_name(c"parhelion")
            .api_version(vk::API_VERSION_1_3);
        let layer_names: Vec<_> =
            validation.then_some(debug::VALIDATION_LAYER.as_ptr()).into_iter().collect();
        let mut extension_names: Vec<_> =
            debug_utils.then_some(ext::debug_utils::NAME.as_ptr()).into_iter().collect();
        let mut messenger_info = debug::messenger_info(&log);
        let checks = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&checks);
        let mut info =
            vk::InstanceCreateInfo::default().application_info(&app).enabled_layer_names(&layer_names);
        if debug_utils {
            info = info.push_next(&mut messenger_info);
        }
        if validation {
            // SAFETY: a query without preconditions; the layer exists.
            let of_layer =
                unsafe { entry.enumerate_instance_extension_properties(Some(debug::VALIDATION_LAYER)) }
                    .map_err(Error::vulkan("vkEnumerateInstanceExtensionProperties", "validation layer"))?;
            if has_extension(&of_layer, ext::validation_features::NAME) {
                extension_names.push(ext::validation_features::NAME.as_ptr());
                info = info.push_next(&mut features);
            }
        }
        let info = info.enabled_extension_names(&extension_names);
        // SAFETY: the layer and extensions named exist; the log outlives the instance.
        let raw = unsafe { entry.create_instance(&info, None) }.map_err(|result| match result {
            // The loader's word for having found no driver at all.
            vk::Result::ERROR_INCOMPATIBLE_DRIVER => manifest::no_driver(),
            result => of_loader("vkCreateInstance")(result),
        })?;
        let mut instance = Self { raw, debug_utils, messenger: None, log, _entry: entry };
        if debug_utils {
            let fns = ext::debug_utils::Instance::new(&instance._entry, &instance.raw);
            let info = debug::messenger_info(&instance.log);
            // SAFETY: the extension is enabled and the log outlives the messenger.
            let messenger = unsafe { fns.create_debug_utils_messenger(&info, None) }
                .map_err(Error::vulkan("vkCreateDebugUtilsMessengerEXT", "messenger"))?;
            instance.messenger = Some((fns, messenger));
        }
        Ok(instance)
    }
}

/// Maps the loader's own failures.
fn of_loader(call: &'static str) -> impl FnOnce(vk::Result) -> Error {
    move |result| {
        let broken = (result == vk::Result::ERROR_OUT_OF_HOST_MEMORY).then(manifest::broken_layer).flatten();
        broken.unwrap_or_else(|| Error::vulkan(call, "loader")(result))
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: the device, the only child that outlives a call, is destroyed before.
        unsafe {
            if let Some((fns, messenger)) = &self.messenger {
                fns.destroy_debug_utils_messenger(*messenger, None);
            }
            self.raw.destroy_instance(None);
        }
    }
}

pub(super) fn has_extension(extensions: &[vk::ExtensionProperties], name: &CStr) -> bool {
    extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name))
}

pub(super) fn version_string(version: u32) -> String {
    let (major, minor) = (vk::api_version_major(version), vk::api_version_minor(version));
    format!("{major}.{minor}.{}", vk::api_version_patch(version))
}
