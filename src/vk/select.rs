//! Properties of devices, and which device to take.

use ash::vk;

use super::Error;

/// Kind of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum DeviceKind {
    /// The driver runs kernels on the CPU.
    Cpu,
    /// A GPU that shares the host's memory.
    Integrated,
    /// A GPU with memory of its own.
    Discrete,
    /// A GPU seen from inside a virtual machine.
    Virtual,
    /// The driver does not say.
    Other,
}

/// What a device is and can do.
#[derive(Clone, Debug, serde::Serialize)]
pub struct DeviceInfo {
    /// Position in the loader's order.
    pub index: usize,
    /// The device's name.
    pub name: String,
    /// Kind of device.
    pub kind: DeviceKind,
    /// PCI vendor, or a Khronos vendor id.
    pub vendor_id: u32,
    /// The vendor's number for the device.
    pub device_id: u32,
    /// UUID, in hexadecimal with dashes.
    pub uuid: String,
    /// The driver's name.
    pub driver_name: String,
    /// The driver's own version string.
    pub driver_info: String,
    /// The driver's version number, in its vendor's notation.
    pub driver_version: String,
    /// Vulkan version of the device.
    pub api_version: String,
    /// Whether kernels can trace rays through acceleration structures.
    pub ray_query: bool,
    /// Invocations in a subgroup.
    pub subgroup_size: u32,
    /// Size of the largest device-local heap, in bytes.
    pub memory_bytes: u64,
    /// Most bytes one allocation can have.
    pub max_allocation_bytes: u64,
    /// Most bytes one buffer can have.
    pub max_buffer_bytes: u64,
    /// Most bytes a kernel sees through one storage buffer binding.
    pub max_storage_buffer_range: u64,
    /// Most texels along a side of an image.
    pub max_image_dimension: u32,
    /// Most invocations in a workgroup.
    pub max_workgroup_invocations: u32,
    /// Most workgroups in a dispatch, by axis.
    pub max_workgroup_count: [u32; 3],
    /// Bytes of shared memory in a workgroup.
    pub max_shared_memory: u32,
    /// Whether passes can be timed on the device.
    pub timestamps: bool,
    /// Rank among the devices of a machine: higher is better, negative is unusable.
    pub score: i64,
    /// Everything it lacks; empty where the device is suitable.
    pub missing: Vec<String>,
}

impl DeviceInfo {
    /// Driver and version, as a person would write them.
    #[must_use]
    pub fn driver(&self) -> String {
        format!("{} {}", self.driver_name, self.driver_info).trim().to_owned()
    }

    fn summary(&self) -> String {
        format!("{}: {} ({})", self.index, self.name, self.uuid)
    }
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

/// Rank of a device. Kind comes first, so that every GPU is before every CPU; ray query is next, memory in GiB
/// decides between equals.
pub(super) fn score(kind: DeviceKind, suitable: bool, ray_query: bool, memory_bytes: u64) -> i64 {
    if !suitable {
        return -1;
    }
    let kind = match kind {
        DeviceKind::Discrete => 4,
        DeviceKind::Integrated => 3,
        DeviceKind::Virtual => 2,
        DeviceKind::Other => 1,
        DeviceKind::Cpu => 0,
    };
    let gib = i64::try_from(memory_bytes >> 30).unwrap_or(i64::MAX).min(9_999);
    kind * 100_000 + i64::from(ray_query) * 10_000 + gib
}

/// The position in `devices` of the one to use: the best, or the best of those `asked` names (an index, a part
/// of the name in any case that is no number below 100, or a UUID).
pub(super) fn select(devices: &[DeviceInfo], asked: Option<&str>) -> Result<usize, Error> {
    let best = |matches: &dyn Fn(&DeviceInfo) -> bool| {
        let of = (0..devices.len()).filter(|&i| matches(&devices[i]));
        of.max_by_key(|&i| (devices[i].score, std::cmp::Reverse(i)))
    };
    let Some(asked) = asked else {
        return best(&|d| d.missing.is_empty()).ok_or_else(|| Error::NoDevice {
            found: devices.iter().map(|d| format!("{} lacks {}", d.name, d.missing.join(", "))).collect(),
        });
    };
    let plain = |text: &str| text.replace('-', "").to_lowercase();
    let index = asked.trim().parse::<usize>().ok();
    let found = best(&|d| index == Some(d.index))
        .or_else(|| best(&|d| plain(&d.uuid) == plain(asked.trim())))
        .or_else(|| {
            let word = asked.trim().to_lowercase();
            // An index that is not there is no part of a version.
            let names = !word.is_empty() && index.is_none_or(|index| index >= 100);
            best(&|d| names && d.name.to_lowercase().contains(&word))
        })
        .ok_or_else(|| Error::NoSuchDevice {
            asked: asked.to_owned(),
            available: devices.iter().map(DeviceInfo::summary).collect(),
        })?;
    let device = &devices[found];
    if device.missing.is_empty() {
        Ok(found)
    } else {
        Err(Error::Unsuitable {
            device: device.name.clone(),
            driver: device.driver(),
            missing: device.missing.clone(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ErrorClass;

    fn device(index: usize, name: &str, kind: DeviceKind, missing: &[&str]) -> DeviceInfo {
        let missing: Vec<_> = missing.iter().map(|m| (*m).to_owned()).collect();
        DeviceInfo {
            index,
            name: name.to_owned(),
            kind,
            vendor_id: 0,
            device_id: 0,
            uuid: format!("0000000{index}-0000-0000-0000-0000000000aB"),
            driver_name: "driver".to_owned(),
            driver_info: "1".to_owned(),
            driver_version: "1".to_owned(),
            api_version: "1.3.0".to_owned(),
            ray_query: false,
            subgroup_size: 32,
            memory_bytes: 0,
            max_allocation_bytes: 0,
            max_buffer_bytes: 0,
            max_storage_buffer_range: 0,
            max_image_dimension: 0,
            max_workgroup_invocations: 0,
            max_workgroup_count: [0; 3],
            max_shared_memory: 0,
            timestamps: false,
            score: score(kind, missing.is_empty(), false, 0),
            missing,
        }
    }

    fn machine() -> Vec<DeviceInfo> {
        vec![
            device(0, "llvmpipe", DeviceKind::Cpu, &[]),
            device(1, "GeForce GTX 480", DeviceKind::Discrete, &["synchronization2", "maintenance4"]),
            device(2, "GeForce RTX 4090", DeviceKind::Discrete, &[]),
            device(3, "Iris Xe", DeviceKind::Integrated, &[]),
        ]
    }

    #[test]
    fn every_gpu_ranks_before_every_cpu() {
        let cpu = score(DeviceKind::Cpu, true, true, u64::MAX);
        for kind in [DeviceKind::Other, DeviceKind::Virtual, DeviceKind::Integrated, DeviceKind::Discrete] {
            assert!(score(kind, true, false, 0) > cpu, "{kind:?}");
        }
        assert!(score(DeviceKind::Cpu, true, false, 0) > score(DeviceKind::Discrete, false, true, u64::MAX));
    }

    #[test]
    fn ray_query_counts_more_than_memory_and_less_than_kind() {
        let with = score(DeviceKind::Discrete, true, true, 8 << 30);
        let without = score(DeviceKind::Discrete, true, false, 80 << 30);
        assert!(with > without);
        assert!(without > score(DeviceKind::Integrated, true, true, 80 << 30));
    }

    #[test]
    fn default_is_the_best_suitable_device() {
        assert_eq!(select(&machine(), None).unwrap(), 2);
        let twins = [device(0, "a", DeviceKind::Discrete, &[]), device(1, "a", DeviceKind::Discrete, &[])];
        assert_eq!(select(&twins, None).unwrap(), 0);
    }

    #[test]
    fn index_name_and_uuid_select() {
        let machine = machine();
        assert_eq!(select(&machine, Some("3")).unwrap(), 3);
        assert_eq!(select(&machine, Some("LLVM")).unwrap(), 0);
        assert_eq!(select(&machine, Some("geforce")).unwrap(), 2, "the suitable one of two");
        assert_eq!(select(&machine, Some("4090")).unwrap(), 2, "a number that is no index is a name");
        assert!(select(&machine, Some("40")).is_err(), "nor is an index that is not there a part of one");
        assert_eq!(select(&machine, Some("00000003-0000-0000-0000-0000000000AB")).unwrap(), 3);
        assert_eq!(select(&machine, Some("000000030000000000000000000000ab")).unwrap(), 3);
    }

    #[test]
    fn errors_name_everything_at_once() {
        let unsuitable = select(&machine(), Some("GTX 480")).unwrap_err();
        assert_eq!(unsuitable.class(), ErrorClass::Device);
        let text = unsuitable.to_string();
        for word in ["GTX 480", "synchronization2", "maintenance4", "newer driver"] {
            assert!(text.contains(word), "{text}");
        }
        let unknown = select(&machine(), Some("Voodoo")).unwrap_err();
        assert_eq!(unknown.class(), ErrorClass::Device);
        for word in ["Voodoo", "llvmpipe", "GTX 480", "Iris Xe"] {
            assert!(unknown.to_string().contains(word), "{unknown}");
        }
        assert!(select(&machine(), Some("")).is_err());
        let none = select(&machine()[1..2], None).unwrap_err();
        assert!(none.to_string().contains("maintenance4"), "{none}");
        assert!(select(&[], None).unwrap_err().to_string().contains("mesa-vulkan-drivers"));
    }
}
