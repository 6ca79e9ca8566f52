//! The logical device.

use std::mem::ManuallyDrop;
use std::sync::{Arc, Mutex};

use ash::{ext, khr, vk};

use super::allocator::Memory;
use super::instance::Instance;
use super::probe::{Probe, RAY_QUERY_EXTENSIONS};
use super::queue::Queue;
use super::select::{DeviceInfo, DeviceKind, Limits, select};
use super::{Backend, Error, ValidationLog, debug, manifest};
use crate::memory::Budget;

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

/// Address space that a driver takes (bytes): lavapipe's compiler has been seen to take 1.3 GiB.
const DRIVER_ADDRESSES: u64 = 3 << 29;

impl Device {
    /// Opens the device that `options` select.
    ///
    /// # Errors
    ///
    /// [`Error::NoLoader`], [`Error::NoDevice`], [`Error::NoDriver`], [`Error::NoSuchDevice`] or [`Error::Unsuitable`], which names
    /// all that is missing; [`Error::NoAddresses`]; otherwise what the driver said.
    pub fn open(options: &DeviceOptions) -> Result<Self, Error> {
        let validation = options.validation || std::env::var("PARHELION_VALIDATION").is_ok_and(|v| v == "1");
        Budget::of_address_space().take(DRIVER_ADDRESSES).map_err(Error::NoAddresses)?;
        let instance = Instance::new(validation)?;
        let mut probes = instance.probe()?;
        if probes.is_empty() {
            return Err(manifest::no_driver());
        }
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

        let memory = Memory::new(&instance.raw, &raw, physical, &limits, info.kind == DeviceKind::Cpu);
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
