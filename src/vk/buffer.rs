//! Buffers.

use std::sync::Arc;

use ash::vk;

use super::heap::{Block, Heap};
use super::{Device, Error, MemoryKind, Requirements};

/// A buffer, usable as storage, uniform, indirect and transfer buffer, and by address.
#[derive(Debug)]
pub struct Buffer {
    raw: vk::Buffer,
    address: u64,
    size: u64,
    kind: MemoryKind,
    name: String,
    block: Arc<Block>,
}

impl Buffer {
    /// Bytes, as asked for.
    #[must_use]
    pub fn size(&self) -> u64 {
        self.size
    }

    /// The address kernels reach it by, a multiple of 256.
    #[must_use]
    pub fn address(&self) -> u64 {
        self.address
    }

    /// The name it was given.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Where it lives.
    #[must_use]
    pub fn kind(&self) -> MemoryKind {
        self.kind
    }

    /// The bytes of an [upload](MemoryKind::Upload) buffer, to be written while the device does not use it, and
    /// never read: the memory is slow to read. `None` for other kinds.
    #[must_use]
    pub fn mapped_mut(&mut self) -> Option<&mut [u8]> {
        if self.kind != MemoryKind::Upload {
            return None;
        }
        let size = usize::try_from(self.size).ok()?;
        let pointer = self.block.allocation.mapped_ptr()?;
        // SAFETY: the block is mapped, at least `size` bytes long, used by this buffer alone (upload buffers are
        // never placed in heaps), and borrowed through `self`. Coherent memory needs no flush.
        Some(unsafe { std::slice::from_raw_parts_mut(pointer.as_ptr().cast(), size) })
    }

    /// The bytes of a [readback](MemoryKind::Readback) buffer, once the work that writes it has been waited
    /// for. `None` for other kinds.
    ///
    /// # Errors
    ///
    /// What the driver said on invalidating the host's cache.
    pub fn mapped(&self) -> Result<Option<&[u8]>, Error> {
        if self.kind != MemoryKind::Readback {
            return Ok(None);
        }
        let (Ok(size), Some(pointer)) = (usize::try_from(self.size), self.block.allocation.mapped_ptr())
        else {
            return Ok(None);
        };
        let allocation = &self.block.allocation;
        if !allocation.memory_properties().contains(vk::MemoryPropertyFlags::HOST_COHERENT) {
            // `Device::buffer` made offset and size multiples of the atom.
            let range = vk::MappedMemoryRange::default()
                .memory(self.block.raw())
                .offset(allocation.offset())
                .size(allocation.size());
            // SAFETY: the range is mapped.
            unsafe { self.block.device.raw().invalidate_mapped_memory_ranges(&[range]) }
                .map_err(Error::vulkan("vkInvalidateMappedMemoryRanges", &self.name))?;
        }
        // SAFETY: as in `mapped_mut`; the device has ended its writes.
        Ok(Some(unsafe { std::slice::from_raw_parts(pointer.as_ptr().cast(), size) }))
    }

    pub(crate) fn raw(&self) -> vk::Buffer {
        self.raw
    }

    /// The whole buffer, for a descriptor.
    pub(crate) fn descriptor(&self) -> vk::DescriptorBufferInfo {
        vk::DescriptorBufferInfo::default().buffer(self.raw).range(buffer_size(self.size))
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // SAFETY: by the rule of the module, nothing in flight uses it.
        unsafe { self.block.device.raw().destroy_buffer(self.raw, None) };
    }
}

/// Address alignment of buffers, enough for everything found by address: acceleration structures' instances
/// need 16 and their inputs less.
const ADDRESS_ALIGNMENT: u64 = 256;

/// Bytes of the Vulkan buffer behind `size` bytes: never none, and whole words for fills.
fn buffer_size(size: u64) -> u64 {
    size.max(1).saturating_add(3) & !3
}

impl Device {
    /// A buffer of `size` bytes, its contents undefined. 0 bytes are allowed.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfDeviceMemory`], or what the driver said.
    pub fn buffer(&self, name: &str, size: u64, kind: MemoryKind) -> Result<Buffer, Error> {
        let mut requirements = self.buffer_requirements(name, size)?;
        if kind == MemoryKind::Readback {
            let atom = self.0.limits.properties.non_coherent_atom_size;
            requirements.alignment = requirements.alignment.max(atom);
            requirements.size = requirements.size.next_multiple_of(atom);
        }
        let block = Block::new(self, name, requirements, kind, true)?;
        self.bind_buffer(name, size, kind, block, 0)
    }

    /// What a buffer of `size` bytes needs of its memory.
    pub(crate) fn buffer_requirements(&self, name: &str, size: u64) -> Result<Requirements, Error> {
        let limit = self.info().max_buffer_bytes;
        if size > limit {
            let what = name.to_owned();
            return Err(Error::OutOfDeviceMemory { what, bytes: size, available: limit });
        }
        let create = self.buffer_info(size);
        let info = vk::DeviceBufferMemoryRequirements::default().create_info(&create);
        let mut out = vk::MemoryRequirements2::default();
        // SAFETY: maintenance4 is enabled and the description valid.
        unsafe { self.raw().get_device_buffer_memory_requirements(&info, &mut out) };
        Ok(self.requirements(out.memory_requirements, ADDRESS_ALIGNMENT))
    }

    /// A buffer placed in `heap`. Whatever shares its bytes must not be in use at the same time.
    pub(crate) fn buffer_in(&self, heap: &Heap, offset: u64, size: u64, name: &str) -> Result<Buffer, Error> {
        self.bind_buffer(name, size, MemoryKind::Device, heap.0.clone(), offset)
    }

    fn buffer_info(&self, size: u64) -> vk::BufferCreateInfo<'static> {
        use vk::BufferUsageFlags as U;
        let mut usage = U::STORAGE_BUFFER
            | U::UNIFORM_BUFFER
            | U::INDIRECT_BUFFER
            | U::TRANSFER_SRC
            | U::TRANSFER_DST
            | U::SHADER_DEVICE_ADDRESS;
        if self.info().ray_query {
            usage |=
                U::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR | U::ACCELERATION_STRUCTURE_STORAGE_KHR;
        }
        vk::BufferCreateInfo::default().size(buffer_size(size)).usage(usage)
    }

    fn bind_buffer(
        &self,
        name: &str,
        size: u64,
        kind: MemoryKind,
        block: Arc<Block>,
        offset: u64,
    ) -> Result<Buffer, Error> {
        // SAFETY: the description is valid and its usages are enabled.
        let raw = unsafe { self.raw().create_buffer(&self.buffer_info(size), None) }
            .map_err(Error::vulkan("vkCreateBuffer", name))?;
        self.set_name(raw, name);
        let mut buffer = Buffer { raw, address: 0, size, kind, name: name.to_owned(), block };
        let block = &buffer.block;
        // SAFETY: the block is large enough from `offset` on and of a type that will do: it was allocated, or
        // its user placed the buffer, by the buffer's requirements.
        unsafe { self.raw().bind_buffer_memory(raw, block.raw(), block.allocation.offset() + offset) }
            .map_err(Error::vulkan("vkBindBufferMemory", name))?;
        // SAFETY: the buffer is bound and has the usage.
        buffer.address = unsafe {
            self.raw().get_buffer_device_address(&vk::BufferDeviceAddressInfo::default().buffer(raw))
        };
        Ok(buffer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_are_whole_words_and_never_empty() {
        assert_eq!([0, 1, 4, 5].map(buffer_size), [4, 4, 4, 8]);
    }
}
