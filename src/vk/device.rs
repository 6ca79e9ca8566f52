//! Instance, physical device and logical device.

use std::ffi::CStr;
use std::mem::ManuallyDrop;
use std::sync::{Arc, Mutex};

use ash::{ext, khr, vk};

use super::command::Queue;
use super::memory::Memory;
use super::select::{DeviceInfo, DeviceKind, score, select};
use super::{Backend, Error, Format, ValidationLog, debug};

/// How to open a device.
#[derive(Clone, Debug, Default)]
pub struct DeviceOptions {
    /// Index, part of the name in any case, or UUID; the best device where absent.
    pub select: Option<String>,
    /// Load the validation layer, with its checks of synchronisation, and collect its messages; also switched
    /// on by the environment variable `PARHELION_VALIDATION=1`. Costs time in every Vulkan call.
    pub validation: bool,
}

/// A Vulkan device, its queue and its memory. Clones share it.
///
/// ```no_run
/// use parhelion::vk::{Device, DeviceOptions};
///
/// let device = Device::open(&DeviceOptions { select: Some("llvmpipe".into()), ..Default::default() })?;
/// println!("{} with {}", device.info().name, device.info().driver());
/// let buffer = device.upload("numbers", &[1, 2, 3])?;
/// assert_eq!(device.download(&buffer)?, [1, 2, 3]);
/// # Ok::<(), parhelion::vk::Error>(())
/// ```
#[derive(Clone)]
pub struct Device(pub(super) Arc<DeviceInner>);

pub(super) struct DeviceInner {
    pub(super) raw: ash::Device,
    pub(super) memory: ManuallyDrop<Mutex<Memory>>,
    pub(super) queue: Queue,
    pub(super) limits: Limits,
    push_descriptor: khr::push_descriptor::Device,
    acceleration_structure: Option<khr::acceleration_structure::Device>,
    debug_utils: Option<ext::debug_utils::Device>,
    /// Layouts of set 0, in the order of [`Backend`]'s variants.
    scene_layouts: [vk::DescriptorSetLayout; 2],
    info: DeviceInfo,
    // After the device: fields drop in order of declaration.
    instance: Instance,
}

/// Limits the library needs beyond those in [`DeviceInfo`].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Limits {
    pub(super) properties: vk::PhysicalDeviceLimits,
    pub(super) memory: vk::PhysicalDeviceMemoryProperties,
    pub(super) pipeline_cache_uuid: [u8; 16],
    pub(super) max_allocation: u64,
    pub(super) max_push_descriptors: u32,
    pub(super) timestamp_bits: u32,
    pub(super) max_geometries: u64,
    pub(super) max_instances: u64,
    pub(super) max_primitives: u64,
    pub(super) scratch_alignment: u64,
}

/// The devices of this machine, unsuitable ones too, in the loader's order.
///
/// # Errors
///
/// [`Error::NoLoader`] without a Vulkan loader. No device at all is an empty list.
pub fn enumerate() -> Result<Vec<DeviceInfo>, Error> {
    match Instance::new(false) {
        Ok(instance) => Ok(instance.probe()?.into_iter().map(|p| p.info).collect()),
        Err(Error::NoDevice { .. }) => Ok(Vec::new()),
        Err(error) => Err(error),
    }
}

/// An instance and its messenger.
struct Instance {
    raw: ash::Instance,
    debug_utils: bool,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    // Outlives the messenger, which writes to it.
    log: Arc<ValidationLog>,
    _entry: ash::Entry,
}

/// A physical device and what was read from it.
struct Probe {
    physical: vk::PhysicalDevice,
    queue_family: u32,
    info: DeviceInfo,
    limits: Limits,
}

impl Instance {
    fn new(validation: bool) -> Result<Self, Error> {
        let no_loader = |reason: String| Error::NoLoader { reason };
        // SAFETY: the loader is a well-behaved library; `_entry` keeps it loaded as long as the instance.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| no_loader(e.to_string()))?;
        // SAFETY: a query without preconditions, as are the two below.
        let version = unsafe { entry.try_enumerate_instance_version() }
            .map_err(Error::vulkan("vkEnumerateInstanceVersion", "loader"))?
            .unwrap_or(vk::API_VERSION_1_0);
        if version < vk::API_VERSION_1_3 {
            return Err(no_loader(format!("the one found is {}, 1.3 is needed", version_string(version))));
        }
        // SAFETY: as above.
        let layers = unsafe { entry.enumerate_instance_layer_properties() }
            .map_err(Error::vulkan("vkEnumerateInstanceLayerProperties", "loader"))?;
        // SAFETY: as above.
        let extensions = unsafe { entry.enumerate_instance_extension_properties(None) }
            .map_err(Error::vulkan("vkEnumerateInstanceExtensionProperties", "loader"))?;

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
            vk::Result::ERROR_INCOMPATIBLE_DRIVER => Error::NoDevice { found: Vec::new() },
            result => Error::vulkan("vkCreateInstance", "instance")(result),
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

    fn probe(&self) -> Result<Vec<Probe>, Error> {
        // SAFETY: a query without preconditions.
        let devices = unsafe { self.raw.enumerate_physical_devices() }
            .map_err(Error::vulkan("vkEnumeratePhysicalDevices", "instance"))?;
        devices.into_iter().enumerate().map(|(index, d)| self.probe_device(index, d)).collect()
    }

    fn probe_device(&self, index: usize, physical: vk::PhysicalDevice) -> Result<Probe, Error> {
        // SAFETY: `physical` belongs to this instance; the same for the queries below.
        let properties = unsafe { self.raw.get_physical_device_properties(physical) };
        let name = properties.device_name_as_c_str().unwrap_or(c"?").to_string_lossy().into_owned();
        // SAFETY: as above.
        let extensions = unsafe { self.raw.enumerate_device_extension_properties(physical) }
            .map_err(Error::vulkan("vkEnumerateDeviceExtensionProperties", &name))?;
        // SAFETY: as above.
        let families = unsafe { self.raw.get_physical_device_queue_family_properties(physical) };
        // SAFETY: as above.
        let memory = unsafe { self.raw.get_physical_device_memory_properties(physical) };

        let is_1_3 = properties.api_version >= vk::API_VERSION_1_3;
        let has_push_descriptor = has_extension(&extensions, khr::push_descriptor::NAME);
        let ray_extensions = RAY_QUERY_EXTENSIONS.iter().all(|e| has_extension(&extensions, e));

        // Structures a device does not know must not be chained.
        let mut p11 = vk::PhysicalDeviceVulkan11Properties::default();
        let mut p12 = vk::PhysicalDeviceVulkan12Properties::default();
        let mut p13 = vk::PhysicalDeviceVulkan13Properties::default();
        let mut p_push = vk::PhysicalDevicePushDescriptorPropertiesKHR::default();
        let mut p_accel = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
        let mut p2 = vk::PhysicalDeviceProperties2::default();
        let mut f12 = vk::PhysicalDeviceVulkan12Features::default();
        let mut f13 = vk::PhysicalDeviceVulkan13Features::default();
        let mut f_accel = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default();
        let mut f_query = vk::PhysicalDeviceRayQueryFeaturesKHR::default();
        let mut f2 = vk::PhysicalDeviceFeatures2::default();
        if is_1_3 {
            p2 = p2.push_next(&mut p11).push_next(&mut p12).push_next(&mut p13);
            f2 = f2.push_next(&mut f12).push_next(&mut f13);
        }
        if has_push_descriptor {
            p2 = p2.push_next(&mut p_push);
        }
        if ray_extensions {
            p2 = p2.push_next(&mut p_accel);
            f2 = f2.push_next(&mut f_accel).push_next(&mut f_query);
        }
        if properties.api_version >= vk::API_VERSION_1_1 {
            // SAFETY: as above; every chained structure belongs to a version or extension the device has.
            unsafe {
                self.raw.get_physical_device_properties2(physical, &mut p2);
                self.raw.get_physical_device_features2(physical, &mut f2);
            }
        }
        let f10 = f2.features;
        let limits = properties.limits;

        let family = queue_family(&families);
        let mut missing = Vec::new();
        let mut need = |present: bool, what: &str| {
            if !present {
                missing.push(what.to_owned());
            }
        };
        if is_1_3 {
            need(f10.shader_int64 != 0, "shaderInt64");
            need(f10.shader_storage_image_extended_formats != 0, "shaderStorageImageExtendedFormats");
            need(f12.buffer_device_address != 0, "bufferDeviceAddress");
            need(f12.scalar_block_layout != 0, "scalarBlockLayout");
            need(f12.host_query_reset != 0, "hostQueryReset");
            need(f12.timeline_semaphore != 0, "timelineSemaphore");
            need(f13.synchronization2 != 0, "synchronization2");
            need(f13.maintenance4 != 0, "maintenance4");
        } else {
            let have = version_string(properties.api_version);
            need(false, &format!("Vulkan 1.3 (it has {have})"));
        }
        need(has_push_descriptor, "VK_KHR_push_descriptor");
        need(family.is_some(), "a queue for compute");
        for format in Format::ALL {
            // SAFETY: as above.
            let has = unsafe { self.raw.get_physical_device_format_properties(physical, format.raw()) }
                .optimal_tiling_features
                .contains(
                    vk::FormatFeatureFlags::STORAGE_IMAGE
                        | vk::FormatFeatureFlags::TRANSFER_SRC
                        | vk::FormatFeatureFlags::TRANSFER_DST,
                );
            need(has, &format!("storage images of format {format:?}"));
        }

        let ray_query = ray_extensions && f_accel.acceleration_structure != 0 && f_query.ray_query != 0;
        let kind = match properties.device_type {
            vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
            vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::Integrated,
            vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::Discrete,
            vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::Virtual,
            _ => DeviceKind::Other,
        };
        let memory_bytes = memory
            .memory_heaps_as_slice()
            .iter()
            .filter(|h| h.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
            .map(|h| h.size)
            .max()
            .unwrap_or(0);
        let timestamp_bits = family.map_or(0, |f| families[f].timestamp_valid_bits);
        let info = DeviceInfo {
            index,
            kind,
            vendor_id: properties.vendor_id,
            device_id: properties.device_id,
            uuid: uuid_string(&p11.device_uuid),
            driver_name: p12.driver_name_as_c_str().unwrap_or_default().to_string_lossy().into_owned(),
            driver_info: p12.driver_info_as_c_str().unwrap_or_default().to_string_lossy().into_owned(),
            driver_version: driver_version_string(properties.vendor_id, properties.driver_version),
            api_version: version_string(properties.api_version),
            ray_query,
            subgroup_size: p11.subgroup_size,
            memory_bytes,
            max_allocation_bytes: p11.max_memory_allocation_size,
            max_buffer_bytes: p13.max_buffer_size,
            max_storage_buffer_range: u64::from(limits.max_storage_buffer_range),
            max_image_dimension: limits.max_image_dimension2_d,
            max_workgroup_invocations: limits.max_compute_work_group_invocations,
            max_workgroup_count: limits.max_compute_work_group_count,
            max_shared_memory: limits.max_compute_shared_memory_size,
            timestamps: timestamp_bits > 0 && limits.timestamp_period > 0.0,
            score: score(kind, missing.is_empty(), ray_query, memory_bytes),
            missing,
            name,
        };
        let limits = Limits {
            properties: limits,
            memory,
            pipeline_cache_uuid: properties.pipeline_cache_uuid,
            max_allocation: p11.max_memory_allocation_size,
            max_push_descriptors: p_push.max_push_descriptors,
            timestamp_bits,
            max_geometries: p_accel.max_geometry_count,
            max_instances: p_accel.max_instance_count,
            max_primitives: p_accel.max_primitive_count,
            scratch_alignment: u64::from(p_accel.min_acceleration_structure_scratch_offset_alignment),
        };
        Ok(Probe { physical, queue_family: family.map_or(0, |f| f as u32), info, limits })
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

const RAY_QUERY_EXTENSIONS: [&CStr; 3] =
    [khr::acceleration_structure::NAME, khr::ray_query::NAME, khr::deferred_host_operations::NAME];

impl Device {
    /// Opens the device that `options` select.
    ///
    /// # Errors
    ///
    /// [`Error::NoLoader`], [`Error::NoDevice`], [`Error::NoSuchDevice`] or [`Error::Unsuitable`], which names
    /// all that is missing; otherwise what the driver said.
    pub fn open(options: &DeviceOptions) -> Result<Self, Error> {
        let validation = options.validation || std::env::var("PARHELION_VALIDATION").is_ok_and(|v| v == "1");
        let instance = Instance::new(validation)?;
        let mut probes = instance.probe()?;
        let infos: Vec<_> = probes.iter().map(|p| p.info.clone()).collect();
        let Probe { physical, queue_family, info, limits } =
            probes.swap_remove(select(&infos, options.select.as_deref())?);

        let mut extensions = vec![khr::push_descriptor::NAME.as_ptr()];
        let mut f12 = vk::PhysicalDeviceVulkan12Features::default()
            .buffer_device_address(true)
            .scalar_block_layout(true)
            .host_query_reset(true)
            .timeline_semaphore(true);
        let mut f13 = vk::PhysicalDeviceVulkan13Features::default().synchronization2(true).maintenance4(true);
        let mut f_accel =
            vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(true);
        let mut f_query = vk::PhysicalDeviceRayQueryFeaturesKHR::default().ray_query(true);
        let mut f2 = vk::PhysicalDeviceFeatures2::default()
            .features(
                vk::PhysicalDeviceFeatures::default()
                    .shader_int64(true)
                    .shader_storage_image_extended_formats(true),
            )
            .push_next(&mut f12)
            .push_next(&mut f13);
        if info.ray_query {
            extensions.extend(RAY_QUERY_EXTENSIONS.iter().map(|e| e.as_ptr()));
            f2 = f2.push_next(&mut f_accel).push_next(&mut f_query);
        }
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&[1.0])];
        let create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&extensions)
            .push_next(&mut f2);
        // SAFETY: `select` returned a device that has every extension and feature asked for.
        let raw = unsafe { instance.raw.create_device(physical, &create, None) }
            .map_err(Error::vulkan("vkCreateDevice", &info.name))?;

        let memory = Memory::new(&instance.raw, &raw, physical, &limits);
        let memory = match memory {
            Ok(memory) => memory,
            Err(error) => {
                // SAFETY: nothing was created from the device.
                unsafe { raw.destroy_device(None) };
                return Err(error);
            }
        };
        // SAFETY: the family is the one the device was created with, which has one queue.
        let queue = unsafe { raw.get_device_queue(queue_family, 0) };
        let mut inner = DeviceInner {
            memory: ManuallyDrop::new(Mutex::new(memory)),
            queue: Queue::new(queue, queue_family),
            limits,
            push_descriptor: khr::push_descriptor::Device::new(&instance.raw, &raw),
            acceleration_structure: info
                .ray_query
                .then(|| khr::acceleration_structure::Device::new(&instance.raw, &raw)),
            debug_utils: instance.debug_utils.then(|| ext::debug_utils::Device::new(&instance.raw, &raw)),
            scene_layouts: [vk::DescriptorSetLayout::null(); 2],
            info,
            raw,
            instance,
        };
        inner.queue.create_timeline(&inner.raw)?;
        inner.scene_layouts[Backend::Software as usize] = inner.create_scene_layout(Backend::Software)?;
        if inner.info.ray_query {
            inner.scene_layouts[Backend::RayQuery as usize] = inner.create_scene_layout(Backend::RayQuery)?;
        }
        let device = Self(Arc::new(inner));
        device.set_name(device.0.queue.timeline, "queue timeline");
        for backend in [Backend::Software, Backend::RayQuery] {
            let layout = device.0.scene_layouts[backend as usize];
            if layout != vk::DescriptorSetLayout::null() {
                device.set_name(layout, &format!("scene ({backend:?})"));
            }
        }
        Ok(device)
    }

    /// What the device is and can do.
    #[must_use]
    pub fn info(&self) -> &DeviceInfo {
        &self.0.info
    }

    /// The messages of the validation layer.
    #[must_use]
    pub fn validation(&self) -> &ValidationLog {
        &self.0.instance.log
    }

    /// Checks that a kernel can see `bytes` of `what` through one storage buffer binding.
    ///
    /// # Errors
    ///
    /// [`Error::TooLarge`] where it cannot: such data is reached by [address](super::Buffer::address).
    pub fn check_storage_range(&self, what: &str, bytes: u64) -> Result<(), Error> {
        let limit = self.0.info.max_storage_buffer_range;
        if bytes <= limit {
            return Ok(());
        }
        Err(Error::TooLarge {
            what: format!("bytes of `{what}` bound as a storage buffer"),
            value: bytes,
            limit,
        })
    }

    /// Waits until the device has nothing left to do.
    ///
    /// # Errors
    ///
    /// [`Error::DeviceLost`], or what the driver said.
    pub fn wait_idle(&self) -> Result<(), Error> {
        let _queue = self.0.queue.lock();
        // SAFETY: the lock keeps every other thread off the only queue.
        unsafe { self.0.raw.device_wait_idle() }.map_err(Error::vulkan("vkDeviceWaitIdle", &self.0.info.name))
    }

    pub(crate) fn raw(&self) -> &ash::Device {
        &self.0.raw
    }

    pub(crate) fn push_descriptor(&self) -> &khr::push_descriptor::Device {
        &self.0.push_descriptor
    }

    /// The functions of `VK_KHR_acceleration_structure`.
    pub(crate) fn acceleration_structure(&self) -> Result<&khr::acceleration_structure::Device, Error> {
        self.0
            .acceleration_structure
            .as_ref()
            .ok_or_else(|| Error::NoRayQuery { device: self.0.info.name.clone() })
    }

    /// The layout of set 0.
    pub(super) fn scene_layout(&self, backend: Backend) -> Result<vk::DescriptorSetLayout, Error> {
        match self.0.scene_layouts[backend as usize] {
            layout if layout == vk::DescriptorSetLayout::null() => {
                Err(Error::NoRayQuery { device: self.0.info.name.clone() })
            }
            layout => Ok(layout),
        }
    }

    /// Gives a Vulkan object the name that tools and validation messages show.
    pub(crate) fn set_name(&self, object: impl vk::Handle, name: &str) {
        if let Some(fns) = &self.0.debug_utils {
            let name = debug::c_name(name);
            let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&name);
            // SAFETY: `object` is a live child of this device. A name that cannot be stored is no failure.
            let _ = unsafe { fns.set_debug_utils_object_name(&info) };
        }
    }

    /// Opens a labelled range in a command buffer.
    pub(crate) fn begin_label(&self, cmd: vk::CommandBuffer, name: &str) {
        if let Some(fns) = &self.0.debug_utils {
            let name = debug::c_name(name);
            let label = vk::DebugUtilsLabelEXT::default().label_name(&name);
            // SAFETY: `cmd` is being recorded.
            unsafe { fns.cmd_begin_debug_utils_label(cmd, &label) };
        }
    }

    /// Closes the range opened last.
    pub(crate) fn end_label(&self, cmd: vk::CommandBuffer) {
        if let Some(fns) = &self.0.debug_utils {
            // SAFETY: `cmd` is being recorded and has an open label.
            unsafe { fns.cmd_end_debug_utils_label(cmd) };
        }
    }
}

impl std::fmt::Debug for Device {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Device({})", self.0.info.name)
    }
}

impl DeviceInner {
    fn create_scene_layout(&self, backend: Backend) -> Result<vk::DescriptorSetLayout, Error> {
        let binding = |number, ty| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(number)
                .descriptor_type(ty)
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
        };
        let mut bindings = vec![binding(0, vk::DescriptorType::UNIFORM_BUFFER)];
        if backend == Backend::RayQuery {
            bindings.push(binding(1, vk::DescriptorType::ACCELERATION_STRUCTURE_KHR));
            bindings.push(binding(2, vk::DescriptorType::ACCELERATION_STRUCTURE_KHR));
        }
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: acceleration structures are only named where their extension is enabled.
        unsafe { self.raw.create_descriptor_set_layout(&info, None) }
            .map_err(Error::vulkan("vkCreateDescriptorSetLayout", "scene"))
    }
}

impl Drop for DeviceInner {
    fn drop(&mut self) {
        // SAFETY: buffers, images, pipelines and command buffers hold the device, so none is left; the layouts
        // and the queue's objects are the last children. `memory` is not used again.
        unsafe {
            // A lost device is destroyed like any other.
            let _ = self.raw.device_wait_idle();
            for layout in self.scene_layouts {
                self.raw.destroy_descriptor_set_layout(layout, None);
            }
            self.queue.destroy(&self.raw);
            drop(ManuallyDrop::take(&mut self.memory));
            self.raw.destroy_device(None);
        }
    }
}

fn has_extension(extensions: &[vk::ExtensionProperties], name: &CStr) -> bool {
    extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name))
}

/// The queue family for everything: compute, timed where possible, with graphics where there is a choice, since
/// families without it are meant to run beside a frame.
fn queue_family(families: &[vk::QueueFamilyProperties]) -> Option<usize> {
    (0..families.len())
        .filter(|&i| families[i].queue_count > 0 && families[i].queue_flags.contains(vk::QueueFlags::COMPUTE))
        .max_by_key(|&i| {
            let family = &families[i];
            let graphics = family.queue_flags.contains(vk::QueueFlags::GRAPHICS);
            (family.timestamp_valid_bits > 0, graphics, std::cmp::Reverse(i))
        })
}

fn version_string(version: u32) -> String {
    let (major, minor) = (vk::api_version_major(version), vk::api_version_minor(version));
    format!("{major}.{minor}.{}", vk::api_version_patch(version))
}

/// NVIDIA packs its versions its own way; the others use Vulkan's.
fn driver_version_string(vendor: u32, version: u32) -> String {
    const NVIDIA: u32 = 0x10de;
    if vendor == NVIDIA {
        format!("{}.{}.{}", version >> 22, (version >> 14) & 0xff, (version >> 6) & 0xff)
    } else {
        version_string(version)
    }
}

fn uuid_string(uuid: &[u8; 16]) -> String {
    let mut text = String::with_capacity(36);
    for (i, byte) in uuid.iter().enumerate() {
        if matches!(i, 4 | 6 | 8 | 10) {
            text.push('-');
        }
        text.push_str(&format!("{byte:02x}"));
    }
    text
}
