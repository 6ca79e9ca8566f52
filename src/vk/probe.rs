//! What the devices of a machine have, and what they lack.

use std::ffi::CStr;

use ash::{khr, vk};

use super::instance::{Instance, has_extension, version_string};
use super::select::{DeviceInfo, DeviceKind, Limits, score};
use super::{Error, Format, manifest};

/// The devices of this machine, unsuitable ones too, in the loader's order.
///
/// # Errors
///
/// [`Error::NoLoader`] without a Vulkan loader, [`Error::NoDriver`] where drivers are installed and none works. No driver
/// at all is an empty list.
pub fn enumerate() -> Result<Vec<DeviceInfo>, Error> {
    match Instance::new(false) {
        Ok(instance) => Ok(instance.probe()?.into_iter().map(|p| p.info).collect()),
        Err(Error::NoDevice { .. }) => Ok(Vec::new()),
        Err(error) => Err(error),
    }
}

/// What ray queries need.
pub(super) const RAY_QUERY_EXTENSIONS: [&CStr; 3] =
    [khr::acceleration_structure::NAME, khr::ray_query::NAME, khr::deferred_host_operations::NAME];

/// A physical device and what was read from it.
pub(super) struct Probe {
    pub(super) physical: vk::PhysicalDevice,
    pub(super) queue_family: u32,
    pub(super) info: DeviceInfo,
    pub(super) limits: Limits,
}

impl Instance {
    pub(super) fn probe(&self) -> Result<Vec<Probe>, Error> {
        // SAFETY: a query without preconditions.
        let devices = unsafe { self.raw.enumerate_physical_devices() }.map_err(|result| match result {
            // The loader's word for drivers of which none has a device.
            vk::Result::ERROR_INITIALIZATION_FAILED => manifest::no_driver(),
            result => Error::vulkan("vkEnumeratePhysicalDevices", "instance")(result),
        })?;
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
