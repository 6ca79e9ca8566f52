//! Device memory: which type suits what, and how much is in use.

use std::collections::BTreeMap;

use ash::vk;
use gpu_allocator::vulkan::{
    Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc,
};
use gpu_allocator::{AllocationError, AllocationSizes, AllocatorDebugSettings, MemoryLocation};

use super::Error;
use super::select::Limits;
use crate::memory::Budget;

/// Where a buffer lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MemoryKind {
    /// The device's own memory; the host reaches it by [`Device::upload`](super::Device::upload) and [`Device::download`](super::Device::download).
    Device,
    /// Mapped memory the host writes in order and the device reads.
    Upload,
    /// Mapped memory the device writes and the host reads, cached by the host where there is such memory.
    Readback,
}

/// Bytes of device memory in use.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct MemoryReport {
    /// Bytes allocated now.
    pub current: u64,
    /// Most bytes that were allocated at once since the device was opened, or since [`Device::reset_peak`](super::Device::reset_peak).
    pub peak: u64,
    /// Bytes allocated now, summed by the objects' names.
    pub by_name: BTreeMap<String, u64>,
}

/// What a buffer or image needs of the memory it is placed in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Requirements {
    /// Bytes.
    pub size: u64,
    /// The offset is a multiple of this. Offsets that keep to it keep buffers and images apart too
    /// (`bufferImageGranularity`).
    pub alignment: u64,
    /// One bit for each type of memory that will do.
    pub memory_type_bits: u32,
}

/// The allocator and its books.
pub(super) struct Memory {
    allocator: Allocator,
    properties: vk::PhysicalDeviceMemoryProperties,
    /// Bytes allocated from each heap.
    used: [u64; vk::MAX_MEMORY_HEAPS],
    peak: u64,
    largest: u64,
    /// Whether the device's memory is the host's.
    of_host: bool,
}

/// Allocations from this size (bytes) on are compared with the memory that the host has left, which takes a millisecond.
const LARGE: u64 = 64 << 20;

impl Memory {
    pub(super) fn new(
        instance: &ash::Instance,
        device: &ash::Device,
        physical: vk::PhysicalDevice,
        limits: &Limits,
        of_host: bool,
    ) -> Result<Self, Error> {
        const MIB: u64 = 1 << 20;
        let mut debug_settings = AllocatorDebugSettings::default();
        // `Drop` below reports leaks to `tracing`.
        debug_settings.log_leaks_on_shutdown = false;
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.clone(),
            device: device.clone(),
            physical_device: physical,
            debug_settings,
            buffer_device_address: true,
            allocation_sizes: AllocationSizes::new(16 * MIB, 8 * MIB)
                .with_max_device_memblock_size(256 * MIB)
                .with_max_host_memblock_size(64 * MIB),
        })
        .map_err(|e| Error::Allocation { what: "allocator".to_owned(), reason: e.to_string() })?;
        Ok(Self {
            allocator,
            properties: limits.memory,
            used: [0; vk::MAX_MEMORY_HEAPS],
            peak: 0,
            largest: limits.max_allocation,
            of_host,
        })
    }

    pub(super) fn allocate(
        &mut self,
        what: &str,
        requirements: Requirements,
        kind: MemoryKind,
        linear: bool,
    ) -> Result<(Allocation, u32), Error> {
        let Requirements { size, alignment, memory_type_bits } = requirements;
        let types = memory_types(kind, self.properties.memory_types_as_slice(), memory_type_bits);
        let free = if self.of_host && size >= LARGE { Budget::of_process().left() } else { u64::MAX };
        let mut available = 0;
        for ty in types {
            let heap = self.heap_of(ty);
            // lavapipe hands out more than the machine has, and the kernel then ends the process.
            let left = self.properties.memory_heaps[heap].size.saturating_sub(self.used[heap]).min(free);
            available = available.max(left.min(self.largest));
            if size > left || size > self.largest {
                continue;
            }
            let allocation = self.allocator.allocate(&AllocationCreateDesc {
                name: what,
                requirements: vk::MemoryRequirements { size, alignment, memory_type_bits: 1 << ty },
                location: MemoryLocation::Unknown,
                linear,
                allocation_scheme: AllocationScheme::GpuAllocatorManaged,
            });
            match allocation {
                Ok(allocation) => {
                    self.used[heap] += size;
                    self.peak = self.peak.max(self.current());
                    return Ok((allocation, ty));
                }
                Err(AllocationError::OutOfMemory) => {}
                Err(e) => return Err(Error::Allocation { what: what.to_owned(), reason: e.to_string() }),
            }
        }
        Err(Error::OutOfDeviceMemory { what: what.to_owned(), bytes: size, available })
    }

    pub(super) fn free(&mut self, allocation: Allocation, memory_type: u32) {
        let size = allocation.size();
        match self.allocator.free(allocation) {
            Ok(()) => {
                let heap = self.heap_of(memory_type);
                self.used[heap] -= size;
            }
            Err(e) => tracing::error!("freeing device memory: {e}"),
        }
    }

    fn heap_of(&self, memory_type: u32) -> usize {
        self.properties.memory_types[memory_type as usize].heap_index as usize
    }

    fn current(&self) -> u64 {
        let heaps = self.properties.memory_heaps_as_slice().iter().zip(self.used);
        heaps.filter(|(h, _)| h.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL)).map(|(_, used)| used).sum()
    }

    pub(super) fn report(&self) -> MemoryReport {
        let mut by_name = BTreeMap::new();
        for allocation in self.allocator.generate_report().allocations {
            *by_name.entry(allocation.name).or_default() += allocation.size;
        }
        MemoryReport { current: self.current(), peak: self.peak, by_name }
    }

    pub(super) fn reset_peak(&mut self) {
        self.peak = self.current();
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        for leak in self.allocator.generate_report().allocations {
            tracing::error!("device memory leaked: `{}`, {} bytes", leak.name, leak.size);
        }
    }
}

/// The memory types that suit `kind`, best first.
fn memory_types(kind: MemoryKind, types: &[vk::MemoryType], bits: u32) -> Vec<u32> {
    use vk::MemoryPropertyFlags as P;
    let mapped = P::HOST_VISIBLE | P::HOST_COHERENT;
    let cached = P::HOST_VISIBLE | P::HOST_CACHED;
    let preferences = match kind {
        MemoryKind::Device => vec![P::DEVICE_LOCAL],
        MemoryKind::Upload => vec![mapped | P::DEVICE_LOCAL, mapped],
        MemoryKind::Readback => vec![mapped | cached, cached, mapped],
    };
    // These need features of their own.
    let special = P::LAZILY_ALLOCATED | P::PROTECTED | P::DEVICE_COHERENT_AMD | P::DEVICE_UNCACHED_AMD;
    let mut found = Vec::new();
    for wanted in preferences {
        for (i, ty) in types.iter().enumerate() {
            let i = i as u32;
            let flags = ty.property_flags;
            if bits & (1 << i) != 0
                && flags.contains(wanted)
                && !flags.intersects(special)
                && !found.contains(&i)
            {
                found.push(i);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use vk::MemoryPropertyFlags as P;

    fn types(flags: &[P]) -> Vec<vk::MemoryType> {
        flags.iter().map(|&property_flags| vk::MemoryType { property_flags, heap_index: 0 }).collect()
    }

    const MAPPED: P = P::from_raw(P::HOST_VISIBLE.as_raw() | P::HOST_COHERENT.as_raw());

    #[test]
    fn readback_is_cached_where_it_can_be() {
        // A discrete GPU: its own memory, write-combined, cached, and the window into its own.
        let gpu = types(&[P::DEVICE_LOCAL, MAPPED, MAPPED | P::HOST_CACHED, MAPPED | P::DEVICE_LOCAL]);
        assert_eq!(memory_types(MemoryKind::Readback, &gpu, !0)[0], 2);
        assert_eq!(memory_types(MemoryKind::Upload, &gpu, !0), [3, 1, 2]);
        assert_eq!(memory_types(MemoryKind::Device, &gpu, !0), [0, 3]);
        assert_eq!(memory_types(MemoryKind::Readback, &gpu, 0b1011), [1, 3], "masked types are not taken");
        // A phone: cached memory is not coherent, and still better to read than write-combined.
        let phone = types(&[P::DEVICE_LOCAL | MAPPED, P::DEVICE_LOCAL | P::HOST_VISIBLE | P::HOST_CACHED]);
        assert_eq!(memory_types(MemoryKind::Readback, &phone, !0), [1, 0]);
        assert_eq!(memory_types(MemoryKind::Upload, &phone, !0), [0], "uploads are never flushed");
    }

    #[test]
    fn memory_that_needs_features_is_never_taken() {
        let amd = types(&[P::DEVICE_LOCAL | P::DEVICE_COHERENT_AMD, P::DEVICE_LOCAL | P::PROTECTED]);
        for kind in [MemoryKind::Device, MemoryKind::Upload, MemoryKind::Readback] {
            assert!(memory_types(kind, &amd, !0).is_empty());
        }
    }
}
