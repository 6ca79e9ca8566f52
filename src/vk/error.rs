//! Errors of the Vulkan layer.

use crate::ErrorClass;
use crate::memory::Shortage;
use ash::vk;

/// An error of the Vulkan layer.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// No usable Vulkan loader on this machine.
    #[error("no Vulkan loader: {reason} (Debian and Ubuntu: packages libvulkan1 and mesa-vulkan-drivers)")]
    NoLoader {
        /// What loading it said.
        reason: String,
    },
    /// There is no device at all, or none that has what is needed.
    #[error("no suitable Vulkan device: {}", no_device(.found))]
    NoDevice {
        /// One line a device that was found: its name and what it lacks.
        found: Vec<String>,
    },
    /// Drivers are installed, or named by the environment, and none works.
    #[error("no suitable Vulkan device: no driver works: {}", .manifests.join("; "))]
    NoDriver {
        /// One line a manifest: its file and what is wrong.
        manifests: Vec<String>,
    },
    /// The device asked for does not exist.
    #[error("no Vulkan device matches `{asked}`; there {}", devices(.available))]
    NoSuchDevice {
        /// Index, name or UUID that was asked for.
        asked: String,
        /// The devices there are, one `index: name (uuid)` each.
        available: Vec<String>,
    },
    /// The device asked for lacks something that is needed.
    #[error("{device} ({driver}) lacks {}; {FIX}", .missing.join(", "))]
    Unsuitable {
        /// The device's name.
        device: String,
        /// Driver and version.
        driver: String,
        /// Every missing feature, extension and format.
        missing: Vec<String>,
    },
    /// Acceleration structures were asked of a device without ray query.
    #[error("{device} has no ray query (VK_KHR_ray_query and VK_KHR_acceleration_structure)")]
    NoRayQuery {
        /// The device's name.
        device: String,
    },
    /// The device stopped answering: a crash of the driver, a watchdog, a removed GPU.
    #[error("the Vulkan device was lost in {call} ({object})")]
    DeviceLost {
        /// The Vulkan function that reported it.
        call: &'static str,
        /// What it was called for.
        object: String,
    },
    /// An allocation the device has no room for.
    #[error("out of device memory: `{what}` needs {bytes} bytes; the device has {available} left")]
    OutOfDeviceMemory {
        /// The name of the buffer, image or heap.
        what: String,
        /// Bytes asked for.
        bytes: u64,
        /// Bytes a single allocation could still have.
        available: u64,
    },
    /// The host has no memory left.
    #[error("out of host memory in {call} ({object})")]
    OutOfHostMemory {
        /// The Vulkan function that reported it.
        call: &'static str,
        /// What it was called for.
        object: String,
    },
    /// The limit of this process's address space leaves no room for a driver, which would crash.
    #[error("a Vulkan driver with its compiler {0} (`ulimit -v`)")]
    NoAddresses(Shortage),
    /// A size or count beyond what the device can do.
    #[error("{what}: {value} is more than this device's limit of {limit}")]
    TooLarge {
        /// The thing that is too large, and in which unit.
        what: String,
        /// Size or count asked for.
        value: u64,
        /// The most the device takes.
        limit: u64,
    },
    /// A kernel that cannot become a pipeline.
    #[error("kernel `{name}`: {reason}")]
    Kernel {
        /// The kernel's name.
        name: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The allocator refused for another reason than a lack of memory.
    #[error("memory for `{what}`: {reason}")]
    Allocation {
        /// The name of the buffer, image or heap.
        what: String,
        /// The allocator's words.
        reason: String,
    },
    /// Any other failure of a Vulkan function.
    #[error("{call} failed with {result} ({object})")]
    Vulkan {
        /// The Vulkan function.
        call: &'static str,
        /// What it was called for.
        object: String,
        /// Its result.
        result: vk::Result,
    },
}

const FIX: &str = "a newer driver may have it (Mesa: 22.3 or newer), or choose another device";

fn no_device(found: &[String]) -> String {
    if found.is_empty() {
        "the loader found no driver (Debian and Ubuntu: package mesa-vulkan-drivers, whose lavapipe runs on \
         any CPU)"
            .to_owned()
    } else {
        format!("{}; {FIX}", found.join("; "))
    }
}

fn devices(available: &[String]) -> String {
    if available.is_empty() { "is none".to_owned() } else { format!("are {}", available.join(", ")) }
}

impl Error {
    /// What kind of failure this is.
    #[must_use]
    pub fn class(&self) -> ErrorClass {
        match self {
            Self::NoLoader { .. }
            | Self::NoDevice { .. }
            | Self::NoDriver { .. }
            | Self::NoSuchDevice { .. }
            | Self::Unsuitable { .. }
            | Self::NoRayQuery { .. } => ErrorClass::Device,
            Self::DeviceLost { .. } => ErrorClass::Lost,
            Self::OutOfDeviceMemory { .. }
            | Self::OutOfHostMemory { .. }
            | Self::NoAddresses(_)
            | Self::Vulkan { result: vk::Result::ERROR_OUT_OF_DEVICE_MEMORY, .. } => ErrorClass::Memory,
            Self::TooLarge { .. } | Self::Kernel { .. } | Self::Allocation { .. } | Self::Vulkan { .. } => {
                ErrorClass::Other
            }
        }
    }

    /// Maps the result of `call`, made for `object`.
    pub(crate) fn vulkan(call: &'static str, object: &str) -> impl FnOnce(vk::Result) -> Self {
        let object = object.to_owned();
        move |result| match result {
            vk::Result::ERROR_DEVICE_LOST => Self::DeviceLost { call, object },
            vk::Result::ERROR_OUT_OF_HOST_MEMORY => Self::OutOfHostMemory { call, object },
            result => Self::Vulkan { call, object, result },
        }
    }
}
