//! Buffers, images and the memory behind them.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, MutexGuard, PoisonError};

use ash::vk;
use gpu_allocator::vulkan::{
    Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc,
};
use gpu_allocator::{AllocationError, AllocationSizes, AllocatorDebugSettings, MemoryLocation};

use super::device::Limits;
use super::{Device, Error, Format};

/// Where a buffer lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MemoryKind {
    /// The device's own memory; the host reaches it by [`Device::upload`] and [`Device::download`].
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
    /// Most bytes that were allocated at once since the device was opened, or since [`Device::reset_peak`].
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
}

impl Memory {
    pub(super) fn new(
        instance: &ash::Instance,
        device: &ash::Device,
        physical: vk::PhysicalDevice,
        limits: &Limits,
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
        })
    }

    fn allocate(
        &mut self,
        what: &str,
        requirements: Requirements,
        kind: MemoryKind,
        linear: bool,
    ) -> Result<(Allocation, u32), Error> {
        let Requirements { size, alignment, memory_type_bits } = requirements;
        let types = memory_types(kind, self.properties.memory_types_as_slice(), memory_type_bits);
        let mut available = 0;
        for ty in types {
            let heap = self.heap_of(ty);
            // lavapipe hands out more than the machine has, and the kernel then ends the process.
            let left = self.properties.memory_heaps[heap].size.saturating_sub(self.used[heap]);
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

    fn free(&mut self, allocation: Allocation, memory_type: u32) {
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

/// Memory from which buffers and images are placed by hand, so that some may share it in turn.
///
/// Clones share it; it is freed when the last clone and everything placed in it are gone.
#[derive(Clone, Debug)]
pub struct Heap(Arc<Block>);

impl Heap {
    /// Bytes.
    #[must_use]
    pub fn size(&self) -> u64 {
        self.0.allocation.size()
    }
}

/// An allocation that frees itself.
#[derive(Debug)]
struct Block {
    device: Device,
    allocation: Allocation,
    memory_type: u32,
}

impl Block {
    fn new(
        device: &Device,
        name: &str,
        requirements: Requirements,
        kind: MemoryKind,
        linear: bool,
    ) -> Result<Arc<Self>, Error> {
        let (allocation, memory_type) = device.allocator().allocate(name, requirements, kind, linear)?;
        Ok(Arc::new(Self { device: device.clone(), allocation, memory_type }))
    }

    fn raw(&self) -> vk::DeviceMemory {
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

/// A two-dimensional storage image with one view.
#[derive(Debug)]
pub struct Image {
    raw: vk::Image,
    view: vk::ImageView,
    extent: [u32; 2],
    format: Format,
    name: String,
    /// Its layout has become `GENERAL`, where it stays.
    general: AtomicBool,
    block: Arc<Block>,
}

impl Image {
    /// Width and height in texels.
    #[must_use]
    pub fn extent(&self) -> [u32; 2] {
        self.extent
    }

    /// Texel format.
    #[must_use]
    pub fn format(&self) -> Format {
        self.format
    }

    /// The name it was given.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn raw(&self) -> vk::Image {
        self.raw
    }

    pub(crate) fn view(&self) -> vk::ImageView {
        self.view
    }

    pub(crate) fn is_general(&self) -> bool {
        self.general.load(Ordering::Relaxed)
    }

    /// To be called once the work that changes the layout has ended.
    pub(crate) fn set_general(&self) {
        self.general.store(true, Ordering::Relaxed);
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        let device = self.block.device.raw();
        // SAFETY: by the rule of the module, nothing in flight uses it.
        unsafe {
            device.destroy_image_view(self.view, None);
            device.destroy_image(self.raw, None);
        }
    }
}

impl Format {
    pub(crate) const ALL: [Self; 7] = [
        Self::Rgba32Float,
        Self::Rg32Float,
        Self::R32Float,
        Self::Rgba32Uint,
        Self::R32Uint,
        Self::Rgba16Float,
        Self::Rgba8Unorm,
    ];

    pub(crate) fn raw(self) -> vk::Format {
        match self {
            Self::Rgba32Float => vk::Format::R32G32B32A32_SFLOAT,
            Self::Rg32Float => vk::Format::R32G32_SFLOAT,
            Self::R32Float => vk::Format::R32_SFLOAT,
            Self::Rgba32Uint => vk::Format::R32G32B32A32_UINT,
            Self::R32Uint => vk::Format::R32_UINT,
            Self::Rgba16Float => vk::Format::R16G16B16A16_SFLOAT,
            Self::Rgba8Unorm => vk::Format::R8G8B8A8_UNORM,
        }
    }
}

/// All of a colour image.
pub(crate) const COLOR_RANGE: vk::ImageSubresourceRange = vk::ImageSubresourceRange {
    aspect_mask: vk::ImageAspectFlags::COLOR,
    base_mip_level: 0,
    level_count: 1,
    base_array_layer: 0,
    layer_count: 1,
};

/// Bytes moved at a time between host and device, so that staging never doubles a large buffer.
const STAGING_BYTES: u64 = 64 << 20;

/// Address alignment of buffers, enough for everything found by address: acceleration structures' instances
/// need 16 and their inputs less.
const ADDRESS_ALIGNMENT: u64 = 256;

/// Bytes of the Vulkan buffer behind `size` bytes: never none, and whole words for fills.
fn buffer_size(size: u64) -> u64 {
    size.max(1).saturating_add(3) & !3
}

impl Device {
    fn allocator(&self) -> MutexGuard<'_, Memory> {
        self.0.memory.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Device memory in use.
    #[must_use]
    pub fn memory(&self) -> MemoryReport {
        let memory = self.allocator();
        let mut by_name = BTreeMap::new();
        for allocation in memory.allocator.generate_report().allocations {
            *by_name.entry(allocation.name).or_default() += allocation.size;
        }
        MemoryReport { current: memory.current(), peak: memory.peak, by_name }
    }

    /// Begins to look for [`MemoryReport::peak`] anew.
    pub fn reset_peak(&self) {
        let mut memory = self.allocator();
        memory.peak = memory.current();
    }

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

    /// An image, its contents and layout undefined.
    ///
    /// # Errors
    ///
    /// [`Error::TooLarge`], [`Error::OutOfDeviceMemory`], or what the driver said.
    pub fn image(&self, name: &str, extent: [u32; 2], format: Format) -> Result<Image, Error> {
        let requirements = self.image_requirements(name, extent, format)?;
        let block = Block::new(self, name, requirements, MemoryKind::Device, false)?;
        self.bind_image(name, extent, format, block, 0)
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

    /// What an image needs of its memory.
    pub(crate) fn image_requirements(
        &self,
        name: &str,
        extent: [u32; 2],
        format: Format,
    ) -> Result<Requirements, Error> {
        let limit = self.info().max_image_dimension;
        if extent.iter().any(|&n| n == 0 || n > limit) {
            return Err(Error::TooLarge {
                what: format!("image `{name}` of {}x{} texels; its longer side", extent[0], extent[1]),
                value: u64::from(extent[0].max(extent[1])),
                limit: u64::from(limit),
            });
        }
        let create = image_info(extent, format);
        let info = vk::DeviceImageMemoryRequirements::default().create_info(&create);
        let mut out = vk::MemoryRequirements2::default();
        // SAFETY: as for buffers.
        unsafe { self.raw().get_device_image_memory_requirements(&info, &mut out) };
        Ok(self.requirements(out.memory_requirements, 1))
    }

    fn requirements(&self, raw: vk::MemoryRequirements, alignment: u64) -> Requirements {
        let granularity = self.0.limits.properties.buffer_image_granularity;
        Requirements {
            size: raw.size,
            alignment: raw.alignment.max(alignment).max(granularity),
            memory_type_bits: raw.memory_type_bits,
        }
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

    /// A buffer placed in `heap`. Whatever shares its bytes must not be in use at the same time.
    pub(crate) fn buffer_in(&self, heap: &Heap, offset: u64, size: u64, name: &str) -> Result<Buffer, Error> {
        self.bind_buffer(name, size, MemoryKind::Device, heap.0.clone(), offset)
    }

    /// An image placed in `heap`. Whatever shares its bytes must not be in use at the same time.
    pub(crate) fn image_in(
        &self,
        heap: &Heap,
        offset: u64,
        extent: [u32; 2],
        format: Format,
        name: &str,
    ) -> Result<Image, Error> {
        self.bind_image(name, extent, format, heap.0.clone(), offset)
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

    fn bind_image(
        &self,
        name: &str,
        extent: [u32; 2],
        format: Format,
        block: Arc<Block>,
        offset: u64,
    ) -> Result<Image, Error> {
        // SAFETY: the format was checked when the device was chosen, the extent with the requirements.
        let raw = unsafe { self.raw().create_image(&image_info(extent, format), None) }
            .map_err(Error::vulkan("vkCreateImage", name))?;
        self.set_name(raw, name);
        let view = vk::ImageView::null();
        let mut image =
            Image { raw, view, extent, format, name: name.to_owned(), general: false.into(), block };
        let block = &image.block;
        // SAFETY: as for buffers.
        unsafe { self.raw().bind_image_memory(raw, block.raw(), block.allocation.offset() + offset) }
            .map_err(Error::vulkan("vkBindImageMemory", name))?;
        let info = vk::ImageViewCreateInfo::default()
            .image(raw)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(format.raw())
            .subresource_range(COLOR_RANGE);
        // SAFETY: the image is bound.
        image.view = unsafe { self.raw().create_image_view(&info, None) }
            .map_err(Error::vulkan("vkCreateImageView", name))?;
        self.set_name(image.view, name);
        Ok(image)
    }

    /// A [device](MemoryKind::Device) buffer that holds `bytes`. Waits for the copy, which goes through 64 MiB
    /// of mapped memory at most.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfDeviceMemory`], [`Error::DeviceLost`], or what the driver said.
    pub fn upload(&self, name: &str, bytes: &[u8]) -> Result<Buffer, Error> {
        let buffer = self.buffer(name, bytes.len() as u64, MemoryKind::Device)?;
        let mut staging = None;
        for range in pieces(bytes.len() as u64) {
            let staging = match &mut staging {
                Some(staging) => staging,
                None => {
                    let size = range.end - range.start;
                    staging.insert(self.buffer("staging", size, MemoryKind::Upload)?)
                }
            };
            let piece = &bytes[range.start as usize..range.end as usize];
            let mapped = staging.mapped_mut().ok_or_else(|| unmapped(name))?;
            mapped[..piece.len()].copy_from_slice(piece);
            self.copy(name, (staging.raw(), 0), (buffer.raw(), range.start), piece.len() as u64)?;
        }
        Ok(buffer)
    }

    /// The contents of a buffer. Waits for the copy, which goes through 64 MiB of mapped memory at most; work
    /// that writes the buffer must have been submitted.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfDeviceMemory`], [`Error::DeviceLost`], or what the driver said.
    pub fn download(&self, buffer: &Buffer) -> Result<Vec<u8>, Error> {
        let mut bytes = Vec::with_capacity(buffer.size() as usize);
        let staging = self.buffer("staging", buffer.size().min(STAGING_BYTES), MemoryKind::Readback)?;
        for range in pieces(buffer.size()) {
            let size = range.end - range.start;
            self.copy(buffer.name(), (buffer.raw(), range.start), (staging.raw(), 0), size)?;
            let mapped = staging.mapped()?.ok_or_else(|| unmapped(buffer.name()))?;
            bytes.extend_from_slice(&mapped[..size as usize]);
        }
        Ok(bytes)
    }

    /// Copies `size` bytes between buffers and offsets, behind all earlier work and before all later.
    fn copy(
        &self,
        name: &str,
        from: (vk::Buffer, u64),
        to: (vk::Buffer, u64),
        size: u64,
    ) -> Result<(), Error> {
        use vk::{AccessFlags2 as A, PipelineStageFlags2 as S};
        self.run(name, |cmd| {
            let all = (S::ALL_COMMANDS, A::MEMORY_READ | A::MEMORY_WRITE);
            let transfer = (S::COPY, A::TRANSFER_READ | A::TRANSFER_WRITE);
            self.memory_barrier(cmd, all, transfer);
            let region = vk::BufferCopy { src_offset: from.1, dst_offset: to.1, size };
            // SAFETY: both ranges are inside their buffers, which live until `run` has waited.
            unsafe { self.raw().cmd_copy_buffer(cmd, from.0, to.0, &[region]) };
            self.memory_barrier(cmd, transfer, (S::ALL_COMMANDS | S::HOST, A::MEMORY_READ | A::MEMORY_WRITE));
        })
    }
}

fn image_info(extent: [u32; 2], format: Format) -> vk::ImageCreateInfo<'static> {
    vk::ImageCreateInfo::default()
        .image_type(vk::ImageType::TYPE_2D)
        .format(format.raw())
        .extent(vk::Extent3D { width: extent[0], height: extent[1], depth: 1 })
        .mip_levels(1)
        .array_layers(1)
        .samples(vk::SampleCountFlags::TYPE_1)
        .tiling(vk::ImageTiling::OPTIMAL)
        .usage(
            vk::ImageUsageFlags::STORAGE
                | vk::ImageUsageFlags::TRANSFER_SRC
                | vk::ImageUsageFlags::TRANSFER_DST,
        )
        .initial_layout(vk::ImageLayout::UNDEFINED)
}

/// `0..size` in pieces of at most [`STAGING_BYTES`].
fn pieces(size: u64) -> impl Iterator<Item = Range<u64>> {
    (0..size.div_ceil(STAGING_BYTES)).map(move |i| {
        let start = i * STAGING_BYTES;
        start..(start + STAGING_BYTES).min(size)
    })
}

fn unmapped(name: &str) -> Error {
    Error::Allocation { what: name.to_owned(), reason: "staging memory is not mapped".to_owned() }
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

    #[test]
    fn pieces_cover_everything_once() {
        for size in [0, 1, STAGING_BYTES - 1, STAGING_BYTES, STAGING_BYTES + 1, 3 * STAGING_BYTES + 7] {
            let mut end = 0;
            for piece in pieces(size) {
                assert_eq!(piece.start, end);
                assert!(piece.end > piece.start && piece.end - piece.start <= STAGING_BYTES);
                end = piece.end;
            }
            assert_eq!(end, size);
        }
    }

    #[test]
    fn buffers_are_whole_words_and_never_empty() {
        assert_eq!([0, 1, 4, 5].map(buffer_size), [4, 4, 4, 8]);
    }
}
