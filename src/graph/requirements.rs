//! What planning has to know of a device.

use super::resource::ImageDesc;
use crate::vk;

/// What a device asks of the memory of a resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memory {
    /// Bytes.
    pub size: u64,
    /// Of the offset, in bytes, a power of two. Where all keep to theirs, with sizes rounded up to it, buffers
    /// and images are as far apart as the device asks.
    pub alignment: u64,
    /// The memory types that will do, one bit each.
    pub memory_type_bits: u32,
}

/// The limits of a device that planning respects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Workgroups of a dispatch in x, y and z.
    pub max_groups: [u32; 3],
    /// Bytes of a storage buffer binding.
    pub max_storage_buffer_range: u64,
    /// Bytes of a buffer.
    pub max_buffer: u64,
    /// Texels along a side of an image.
    pub max_image_side: u32,
    /// Bytes of one allocation.
    pub max_allocation: u64,
}

/// What a plan needs to know of a device.
pub trait Requirements {
    /// Memory of a buffer of `size` bytes.
    fn buffer(&self, size: u64) -> Memory;
    /// Memory of an image.
    fn image(&self, desc: ImageDesc) -> Memory;
    /// Limits.
    fn limits(&self) -> Limits;
}

/// A common device, for plans where there is none at hand.
#[derive(Clone, Copy, Debug, Default)]
pub struct Typical;

impl Requirements for Typical {
    fn buffer(&self, size: u64) -> Memory {
        Memory { size, alignment: 256, memory_type_bits: 1 }
    }

    fn image(&self, desc: ImageDesc) -> Memory {
        Memory { size: desc.bytes(), alignment: 4096, memory_type_bits: 1 }
    }

    fn limits(&self) -> Limits {
        Limits {
            max_groups: [65535; 3],
            max_storage_buffer_range: 1 << 27,
            max_buffer: 1 << 30,
            max_image_side: 16384,
            max_allocation: 1 << 30,
        }
    }
}

impl Requirements for vk::Device {
    fn buffer(&self, size: u64) -> Memory {
        self.buffer_requirements("transient", size).map_or_else(|_| no_memory(size), memory)
    }

    fn image(&self, desc: ImageDesc) -> Memory {
        self.image_requirements("transient", desc.extent, desc.format)
            .map_or_else(|_| no_memory(desc.bytes()), memory)
    }

    fn limits(&self) -> Limits {
        let info = self.info();
        Limits {
            max_groups: info.max_workgroup_count,
            max_storage_buffer_range: info.max_storage_buffer_range,
            max_buffer: info.max_buffer_bytes,
            max_image_side: info.max_image_dimension,
            max_allocation: info.max_allocation_bytes,
        }
    }
}

fn memory(vk::Requirements { size, alignment, memory_type_bits }: vk::Requirements) -> Memory {
    Memory { size, alignment, memory_type_bits }
}

/// Of what is beyond the limits: no type of memory will do.
fn no_memory(size: u64) -> Memory {
    Memory { size, alignment: 1, memory_type_bits: 0 }
}
