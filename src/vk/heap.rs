//! Memory that buffers and images are placed in.

use std::sync::{Arc, MutexGuard, PoisonError};

use ash::vk;
use gpu_allocator::vulkan::Allocation;

use super::allocator::Memory;
use super::{Device, Error, MemoryKind, MemoryReport, Requirements};

/// Memory from which buffers and images are placed by hand, so that some may share it in turn.
///
/// Clones share it; it is freed when the last clone and everything placed in it are gone.
#[derive(Clone, Debug)]
pub struct Heap(pub(super) Arc<Block>);

impl Heap {
    /// Bytes.
    #[must_use]
    pub fn size(&self) -> u64 {
        self.0.allocation.size()
    }
}

/// An allocation that frees itself.
#[derive(Debug)]
pub(super) struct Block {
    pub(super) device: Device,
    pub(super) allocation: Allocation,
    memory_type: u32,
}

impl Block {
    pub(super) fn new(
        device: &Device,
        name: &str,
        requirements: Requirements,
        kind: MemoryKind,
        linear: bool,
    ) -> Result<Arc<Self>, Error> {
        let (allocation, memory_type) = device.allocator().allocate(name, requirements, kind, linear)?;
        Ok(Arc::new(Self { device: device.clone(), allocation, memory_type }))
    }

    pub(super) fn raw(&self) -> vk::DeviceMemory {
        // SAFETY: the memory is only bound to objects that hold this block.
        unsafe { self.allocation.memory() }
    }
}

impl Drop for Block {
    fn drop(&mut self) {
        let allocation = std::mem::take(&mut self.allocation);
        self.device.allocator().free(allocation, self.memory_type);
    }
}

impl Device {
    fn allocator(&self) -> MutexGuard<'_, Memory> {
        self.0.memory.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Device memory in use.
    #[must_use]
    pub fn memory(&self) -> MemoryReport {
        self.allocator().report()
    }

    /// Begins to look for [`MemoryReport::peak`] anew.
    pub fn reset_peak(&self) {
        self.allocator().reset_peak();
    }

    /// Memory of `size` bytes for [`Self::buffer_in`] and [`Self::image_in`], of a type among
    /// `memory_type_bits`.
    pub(crate) fn heap(&self, name: &str, size: u64, memory_type_bits: u32) -> Result<Heap, Error> {
        // Drivers tile large images in blocks of up to 256 KiB. Whole granules keep both ends clear of neighbours
        // of the other sort.
        let alignment = 1 << 20;
        let size = size.max(1).next_multiple_of(self.0.limits.properties.buffer_image_granularity.max(4096));
        let requirements = Requirements { size, alignment, memory_type_bits };
        Block::new(self, name, requirements, MemoryKind::Device, true).map(Heap)
    }

    /// Of an object at addresses that are multiples of `alignment`.
    pub(super) fn requirements(&self, raw: vk::MemoryRequirements, alignment: u64) -> Requirements {
        let granularity = self.0.limits.properties.buffer_image_granularity;
        Requirements {
            size: raw.size,
            alignment: raw.alignment.max(alignment).max(granularity),
            memory_type_bits: raw.memory_type_bits,
        }
    }
}
