//! Acceleration structures built by the driver, for kernels that trace rays by ray query.
//!
//! Structures over triangles and boxes are compacted; a structure over instances of those is what kernels trace through.

use std::time::Instant;

use ash::vk;
use vk::{AccessFlags2 as A, PipelineStageFlags2 as S};

use super::{Buffer, Device, Error, MemoryKind};

/// An acceleration structure over triangles or boxes, or over instances of such structures.
#[derive(Debug)]
pub struct AccelerationStructure {
    device: Device,
    raw: vk::AccelerationStructureKHR,
    address: u64,
    buffer: Buffer,
}

impl AccelerationStructure {
    /// Bytes of device memory.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.buffer.size()
    }

    /// The address instances refer to it by.
    pub(crate) fn address(&self) -> u64 {
        self.address
    }

    pub(crate) fn raw(&self) -> vk::AccelerationStructureKHR {
        self.raw
    }
}

impl Drop for AccelerationStructure {
    fn drop(&mut self) {
        if let Ok(fns) = self.device.acceleration_structure() {
            // SAFETY: by the rule of the module, nothing in flight uses it.
            unsafe { fns.destroy_acceleration_structure(self.raw, None) };
        }
    }
}

/// Triangles in device memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangles {
    /// Address of the first vertex's position, three `f32`.
    pub(crate) vertices: u64,
    /// Bytes from one vertex to the next, a multiple of 4.
    pub(crate) vertex_stride: u64,
    /// Vertices that indices may name.
    pub(crate) vertex_count: u32,
    /// Address of the first triangle's indices, three `u32`.
    pub(crate) indices: u64,
    /// Triangles; may be 0.
    pub(crate) triangle_count: u32,
    /// Whether a hit is final without a kernel's say.
    pub(crate) opaque: bool,
}

/// A placed structure of triangles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Instance {
    /// From the structure's space to the world, by rows.
    pub(crate) transform: [[f32; 4]; 3],
    /// What kernels see as the instance's custom index; 24 bits.
    pub(crate) custom_index: u32,
    /// A ray meets the instance where its mask shares a bit.
    pub(crate) mask: u8,
    /// What kernels see as its shader binding table record offset; 24 bits.
    pub(crate) record_offset: u32,
    /// How rays treat its triangles.
    pub(crate) flags: vk::GeometryInstanceFlagsKHR,
    /// [Address](AccelerationStructure::address) of the structure.
    pub(crate) structure: u64,
}

impl Instance {
    /// As `VkAccelerationStructureInstanceKHR` lies in memory.
    fn bytes(&self) -> [u8; INSTANCE_BYTES] {
        let mut bytes = [0; INSTANCE_BYTES];
        bytes[..48].copy_from_slice(bytemuck::bytes_of(&self.transform));
        let word = |low: u32, high: u32| (low | high << 24).to_ne_bytes();
        bytes[48..52].copy_from_slice(&word(self.custom_index, u32::from(self.mask)));
        bytes[52..56].copy_from_slice(&word(self.record_offset, self.flags.as_raw()));
        bytes[56..].copy_from_slice(&self.structure.to_ne_bytes());
        bytes
    }
}

const INSTANCE_BYTES: usize = size_of::<vk::AccelerationStructureInstanceKHR>();

const BOX_BYTES: u64 = size_of::<vk::AabbPositionsKHR>() as u64;

/// What a structure is built from.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Input<'a> {
    /// Triangles; each element is a geometry of the structure.
    Triangles(&'a [Triangles]),
    /// The same, whose vertices are to move: the structure can be updated, and is not compacted.
    Changing(&'a [Triangles]),
    /// `count` boxes, each the lowest and the highest coordinates (six `f32`), at a device address that is a
    /// multiple of 8.
    Boxes {
        /// Device address.
        address: u64,
        /// Boxes; may be 0.
        count: u32,
    },
    /// `count` instances, as [`Instance`] lays them out, at a device address that is a multiple of 16.
    Instances {
        /// Device address.
        address: u64,
        /// Instances; may be 0.
        count: u32,
    },
}

/// Bytes a build needs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BuildSizes {
    /// For the structure itself.
    pub(crate) structure: u64,
    /// For the build, or an update, at an address aligned by [`Device::align_scratch`].
    pub(crate) scratch: u64,
}

/// What building cost.
#[derive(Clone, Copy, Debug, Default, serde::Serialize)]
pub(crate) struct BuildReport {
    /// Bytes of the finished structures.
    pub(crate) bytes: u64,
    /// Bytes before they were compacted.
    pub(crate) bytes_before_compaction: u64,
    /// Bytes needed beside them while building.
    pub(crate) scratch_bytes: u64,
    /// Milliseconds on the host's clock, waiting for the device included.
    pub(crate) milliseconds: f64,
}

/// Scratch memory and structures not yet compacted that a batch of builds may take; a build that needs more is
/// alone. It bounds the time of a submission too: lavapipe builds about 500 MB of structures a second.
const BATCH_BYTES: u64 = 64 << 20;

/// Structures read or written by builds and copies. `ACCELERATION_STRUCTURE_COPY` would need an extension more.
const BUILD: (S, A) = (
    S::ACCELERATION_STRUCTURE_BUILD_KHR,
    A::from_raw(A::ACCELERATION_STRUCTURE_READ_KHR.as_raw() | A::ACCELERATION_STRUCTURE_WRITE_KHR.as_raw()),
);

impl Device {
    /// Bytes for a structure over `input`, once it is within the device's limits.
    pub(crate) fn structure_sizes(&self, name: &str, input: Input<'_>) -> Result<BuildSizes, Error> {
        let fns = self.acceleration_structure()?;
        let limits = &self.0.limits;
        let check = |what: &str, value: u64, limit: u64| {
            let what = format!("{what} of acceleration structure `{name}`");
            if value > limit { Err(Error::TooLarge { what, value, limit }) } else { Ok(()) }
        };
        match input {
            Input::Triangles(geometries) | Input::Changing(geometries) => {
                check("geometries", geometries.len() as u64, limits.max_geometries)?;
                let triangles = geometries.iter().map(|g| u64::from(g.triangle_count)).sum();
                check("triangles", triangles, limits.max_primitives)?;
            }
            Input::Boxes { count, .. } => check("boxes", u64::from(count), limits.max_primitives)?,
            Input::Instances { count, .. } => check("instances", u64::from(count), limits.max_instances)?,
        }
        let (geometries, ranges) = describe(input);
        let counts: Vec<_> = ranges.iter().map(|r| r.primitive_count).collect();
        let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
        // SAFETY: the counts are within the limits, one for each geometry.
        unsafe {
            fns.get_acceleration_structure_build_sizes(
                vk::AccelerationStructureBuildTypeKHR::DEVICE,
                &build_info(input, &geometries),
                &counts,
                &mut sizes,
            );
        }
        let structure = sizes.acceleration_structure_size;
        let scratch = sizes.build_scratch_size.max(sizes.update_scratch_size);
        Ok(BuildSizes { structure, scratch: self.align_scratch(scratch) })
    }

    /// Rounds up to what builds ask of scratch addresses.
    pub(crate) fn align_scratch(&self, value: u64) -> u64 {
        value.next_multiple_of(self.0.limits.scratch_alignment.max(1))
    }

    /// A structure of `bytes` bytes, for `input` to be built into or for a copy.
    pub(crate) fn create_structure(
        &self,
        name: &str,
        input: Input<'_>,
        bytes: u64,
    ) -> Result<AccelerationStructure, Error> {
        let fns = self.acceleration_structure()?;
        let buffer = self.buffer(name, bytes, MemoryKind::Device)?;
        let info = vk::AccelerationStructureCreateInfoKHR::default()
            .buffer(buffer.raw())
            .size(bytes)
            .ty(structure_type(input));
        // SAFETY: the buffer has the usage and the size.
        let raw = unsafe { fns.create_acceleration_structure(&info, None) }
            .map_err(Error::vulkan("vkCreateAccelerationStructureKHR", name))?;
        self.set_name(raw, name);
        let info = vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(raw);
        // SAFETY: the structure was just made.
        let address = unsafe { fns.get_acceleration_structure_device_address(&info) };
        Ok(AccelerationStructure { device: self.clone(), raw, address, buffer })
    }

    /// Records the build of `into` from `input`, with scratch memory of its [size](BuildSizes::scratch) at
    /// `scratch`; with `from`, of triangles whose vertices alone have moved since that was built, an update. Input, scratch and
    /// structures must be behind barriers before and after.
    pub(crate) fn record_build(
        &self,
        cmd: vk::CommandBuffer,
        input: Input<'_>,
        from: Option<&AccelerationStructure>,
        into: &AccelerationStructure,
        scratch: u64,
    ) -> Result<(), Error> {
        let (geometries, ranges) = describe(input);
        let mut info = build_info(input, &geometries)
            .dst_acceleration_structure(into.raw)
            .scratch_data(vk::DeviceOrHostAddressKHR { device_address: scratch });
        if let Some(from) = from {
            let mode = vk::BuildAccelerationStructureModeKHR::UPDATE;
            info = info.mode(mode).src_acceleration_structure(from.raw);
        }
        // SAFETY: `cmd` is being recorded; sizes and addresses are as `structure_sizes` asked.
        unsafe { self.acceleration_structure()?.cmd_build_acceleration_structures(cmd, &[info], &[&ranges]) };
        Ok(())
    }

    /// Builds and compacts a structure for each input, which is all in memory, and waits.
    ///
    /// # Errors
    ///
    /// [`Error::NoRayQuery`], [`Error::TooLarge`], [`Error::OutOfDeviceMemory`], [`Error::DeviceLost`], or what
    /// the driver said.
    pub(crate) fn build_bottom_structures(
        &self,
        name: &str,
        inputs: &[Input<'_>],
    ) -> Result<(Vec<AccelerationStructure>, BuildReport), Error> {
        let started = Instant::now();
        let mut report = BuildReport::default();
        let sizes =
            inputs.iter().map(|&input| self.structure_sizes(name, input)).collect::<Result<Vec<_>, _>>()?;
        let mut built = Vec::with_capacity(inputs.len());
        let mut rest = (inputs, sizes.as_slice());
        while !rest.1.is_empty() {
            let n = batch(rest.1);
            let (inputs, sizes) = (&rest.0[..n], &rest.1[..n]);
            rest = (&rest.0[n..], &rest.1[n..]);
            report.scratch_bytes = report.scratch_bytes.max(sizes.iter().map(|s| s.scratch).sum());
            report.bytes_before_compaction += sizes.iter().map(|s| s.structure).sum::<u64>();
            built.extend(self.build_batch(name, inputs, sizes)?);
        }
        report.bytes = built.iter().map(AccelerationStructure::bytes).sum();
        report.milliseconds = started.elapsed().as_secs_f64() * 1e3;
        Ok((built, report))
    }

    fn build_batch(
        &self,
        name: &str,
        inputs: &[Input<'_>],
        sizes: &[BuildSizes],
    ) -> Result<Vec<AccelerationStructure>, Error> {
        let fns = self.acceleration_structure()?;
        let scratch_bytes = sizes.iter().map(|s| s.scratch).sum::<u64>();
        let scratch = self.scratch(scratch_bytes)?;
        let structures = inputs
            .iter()
            .zip(sizes)
            .map(|(&input, s)| self.create_structure(name, input, s.structure))
            .collect::<Result<Vec<_>, _>>()?;
        let queries = CompactionQueries::new(self, structures.len() as u32)?;

        let commands = self.commands(name)?;
        let cmd = commands.raw();
        self.memory_barrier(cmd, (S::ALL_COMMANDS, A::MEMORY_WRITE), (BUILD.0, BUILD.1 | A::SHADER_READ));
        let mut at = self.align_scratch(scratch.address());
        for ((&input, size), structure) in inputs.iter().zip(sizes).zip(&structures) {
            self.record_build(cmd, input, None, structure, at)?;
            at += size.scratch;
        }
        self.memory_barrier(cmd, BUILD, BUILD);
        let raw: Vec<_> = structures.iter().map(AccelerationStructure::raw).collect();
        // SAFETY: the structures are built, behind a barrier, and the queries are reset and as many.
        unsafe {
            fns.cmd_write_acceleration_structures_properties(
                cmd,
                &raw,
                vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR,
                queries.raw,
                0,
            );
        }
        self.submit(commands)?.wait()?;
        drop(scratch);

        let compacted = queries
            .sizes()?
            .into_iter()
            .zip(inputs)
            .map(|(bytes, &input)| self.create_structure(name, input, bytes))
            .collect::<Result<Vec<_>, _>>()?;
        self.run(name, |cmd| {
            self.memory_barrier(cmd, BUILD, BUILD);
            for (from, to) in structures.iter().zip(&compacted) {
                let info = vk::CopyAccelerationStructureInfoKHR::default()
                    .src(from.raw)
                    .dst(to.raw)
                    .mode(vk::CopyAccelerationStructureModeKHR::COMPACT);
                // SAFETY: the target has the size that was asked for; both live until `run` has waited.
                unsafe { fns.cmd_copy_acceleration_structure(cmd, &info) };
            }
            self.memory_barrier(cmd, BUILD, (S::ALL_COMMANDS, A::MEMORY_READ));
        })?;
        Ok(compacted)
    }

    /// Builds the structure kernels trace through, and waits. No instances are legal: every ray misses.
    ///
    /// # Errors
    ///
    /// As [`Self::build_bottom_structures`].
    pub(crate) fn build_instance_structure(
        &self,
        name: &str,
        instances: &[Instance],
    ) -> Result<(AccelerationStructure, BuildReport), Error> {
        const CUSTOM_INDEX_LIMIT: u32 = (1 << 24) - 1;
        let started = Instant::now();
        if let Some(index) = instances.iter().map(|i| i.custom_index).find(|&i| i > CUSTOM_INDEX_LIMIT) {
            return Err(Error::TooLarge {
                what: format!("custom index in acceleration structure `{name}`"),
                value: u64::from(index),
                limit: u64::from(CUSTOM_INDEX_LIMIT),
            });
        }
        let bytes: Vec<u8> = instances.iter().flat_map(Instance::bytes).collect();
        let buffer = self.upload(name, &bytes)?;
        let count = u32::try_from(instances.len()).unwrap_or(u32::MAX);
        let input = Input::Instances { address: buffer.address(), count };
        let (structure, report) = self.build_structure(name, input)?;
        let milliseconds = started.elapsed().as_secs_f64() * 1e3;
        Ok((structure, BuildReport { milliseconds, ..report }))
    }

    /// Builds a structure that is not compacted, and waits.
    ///
    /// # Errors
    ///
    /// As [`Self::build_bottom_structures`].
    pub(crate) fn build_structure(
        &self,
        name: &str,
        input: Input<'_>,
    ) -> Result<(AccelerationStructure, BuildReport), Error> {
        let started = Instant::now();
        let sizes = self.structure_sizes(name, input)?;
        let structure = self.create_structure(name, input, sizes.structure)?;
        let scratch = self.scratch(sizes.scratch)?;
        let commands = self.commands(name)?;
        let cmd = commands.raw();
        self.memory_barrier(cmd, (S::ALL_COMMANDS, A::MEMORY_WRITE), (BUILD.0, BUILD.1 | A::SHADER_READ));
        self.record_build(cmd, input, None, &structure, self.align_scratch(scratch.address()))?;
        self.memory_barrier(cmd, BUILD, (S::ALL_COMMANDS, A::MEMORY_READ));
        self.submit(commands)?.wait()?;
        let report = BuildReport {
            bytes: structure.bytes(),
            bytes_before_compaction: structure.bytes(),
            scratch_bytes: sizes.scratch,
            milliseconds: started.elapsed().as_secs_f64() * 1e3,
        };
        Ok((structure, report))
    }

    /// Scratch memory with room to align its start.
    pub(crate) fn scratch(&self, bytes: u64) -> Result<Buffer, Error> {
        self.buffer("build scratch", bytes + self.0.limits.scratch_alignment, MemoryKind::Device)
    }
}

/// How many of the first builds run together: as many as share [`BATCH_BYTES`], and at least one.
fn batch(sizes: &[BuildSizes]) -> usize {
    let mut sum = 0;
    let fits = sizes.iter().take_while(|s| {
        sum += s.scratch + s.structure;
        sum <= BATCH_BYTES
    });
    fits.count().max(1)
}

fn structure_type(input: Input<'_>) -> vk::AccelerationStructureTypeKHR {
    match input {
        Input::Triangles(_) | Input::Changing(_) | Input::Boxes { .. } => {
            vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL
        }
        Input::Instances { .. } => vk::AccelerationStructureTypeKHR::TOP_LEVEL,
    }
}

type Described =
    (Vec<vk::AccelerationStructureGeometryKHR<'static>>, Vec<vk::AccelerationStructureBuildRangeInfoKHR>);

fn describe(input: Input<'_>) -> Described {
    let address = |device_address| vk::DeviceOrHostAddressConstKHR { device_address };
    let range = |count| vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(count);
    match input {
        Input::Triangles(geometries) | Input::Changing(geometries) => geometries
            .iter()
            .map(|g| {
                let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
                    .vertex_format(vk::Format::R32G32B32_SFLOAT)
                    .vertex_data(address(g.vertices))
                    .vertex_stride(g.vertex_stride)
                    .max_vertex(g.vertex_count.saturating_sub(1))
                    .index_type(vk::IndexType::UINT32)
                    .index_data(address(g.indices));
                let flags = if g.opaque {
                    vk::GeometryFlagsKHR::OPAQUE
                } else {
                    // Once a ray, or a kernel that counts or draws random numbers at a hit goes wrong.
                    vk::GeometryFlagsKHR::NO_DUPLICATE_ANY_HIT_INVOCATION
                };
                let geometry = vk::AccelerationStructureGeometryKHR::default()
                    .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
                    .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })
                    .flags(flags);
                (geometry, range(g.triangle_count))
            })
            .unzip(),
        Input::Boxes { address: at, count } => {
            let aabbs =
                vk::AccelerationStructureGeometryAabbsDataKHR::default().data(address(at)).stride(BOX_BYTES);
            let geometry = vk::AccelerationStructureGeometryKHR::default()
                .geometry_type(vk::GeometryTypeKHR::AABBS)
                .geometry(vk::AccelerationStructureGeometryDataKHR { aabbs });
            (vec![geometry], vec![range(count)])
        }
        Input::Instances { address: at, count } => {
            let instances = vk::AccelerationStructureGeometryInstancesDataKHR::default().data(address(at));
            let geometry = vk::AccelerationStructureGeometryKHR::default()
                .geometry_type(vk::GeometryTypeKHR::INSTANCES)
                .geometry(vk::AccelerationStructureGeometryDataKHR { instances });
            (vec![geometry], vec![range(count)])
        }
    }
}

fn build_info<'a>(
    input: Input<'_>,
    geometries: &'a [vk::AccelerationStructureGeometryKHR<'a>],
) -> vk::AccelerationStructureBuildGeometryInfoKHR<'a> {
    use vk::BuildAccelerationStructureFlagsKHR as F;
    let flags = match input {
        Input::Triangles(_) | Input::Boxes { .. } => F::PREFER_FAST_TRACE | F::ALLOW_COMPACTION,
        Input::Changing(_) => F::PREFER_FAST_TRACE | F::ALLOW_UPDATE,
        Input::Instances { .. } => F::PREFER_FAST_TRACE,
    };
    vk::AccelerationStructureBuildGeometryInfoKHR::default()
        .ty(structure_type(input))
        .flags(flags)
        .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
        .geometries(geometries)
}

/// The sizes structures will have once compacted.
struct CompactionQueries<'a> {
    device: &'a Device,
    raw: vk::QueryPool,
    count: u32,
}

impl<'a> CompactionQueries<'a> {
    fn new(device: &'a Device, count: u32) -> Result<Self, Error> {
        let info = vk::QueryPoolCreateInfo::default()
            .query_type(vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR)
            .query_count(count);
        // SAFETY: the extension is enabled wherever builds get this far.
        let raw = unsafe { device.raw().create_query_pool(&info, None) }
            .map_err(Error::vulkan("vkCreateQueryPool", "compacted sizes"))?;
        device.set_name(raw, "compacted sizes");
        // SAFETY: host query reset is enabled and the pool is new.
        unsafe { device.raw().reset_query_pool(raw, 0, count) };
        Ok(Self { device, raw, count })
    }

    fn sizes(&self) -> Result<Vec<u64>, Error> {
        let mut sizes = vec![0_u64; self.count as usize];
        let flags = vk::QueryResultFlags::TYPE_64;
        // SAFETY: the queries were written by work that has ended.
        unsafe { self.device.raw().get_query_pool_results(self.raw, 0, &mut sizes, flags) }
            .map_err(Error::vulkan("vkGetQueryPoolResults", "compacted sizes"))?;
        Ok(sizes)
    }
}

impl Drop for CompactionQueries<'_> {
    fn drop(&mut self) {
        // SAFETY: the work that wrote it has been waited for.
        unsafe { self.device.raw().destroy_query_pool(self.raw, None) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common;

    #[test]
    fn batches_share_memory_and_never_stall() {
        let size = |scratch, structure| BuildSizes { structure, scratch };
        let quarter = BATCH_BYTES / 4;
        assert_eq!(batch(&[size(quarter, quarter), size(quarter, quarter), size(1, 1)]), 2);
        assert_eq!(batch(&[size(quarter, quarter), size(quarter, quarter + 1)]), 1);
        assert_eq!(batch(&[size(1, BATCH_BYTES), size(1, 1)]), 1);
    }

    #[test]
    fn instances_lie_as_vulkan_says() {
        let transform = [[1., 2., 3., 4.], [5., 6., 7., 8.], [9., 10., 11., 12.]];
        let ours = Instance {
            transform,
            custom_index: 0x12_3456,
            mask: 0xab,
            record_offset: 0x65_4321,
            flags: vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE,
            structure: 0x0102_0304_0506_0708,
        };
        let theirs = vk::AccelerationStructureInstanceKHR {
            transform: vk::TransformMatrixKHR { matrix: std::array::from_fn(|i| transform[i / 4][i % 4]) },
            instance_custom_index_and_mask: vk::Packed24_8::new(0x12_3456, 0xab),
            instance_shader_binding_table_record_offset_and_flags: vk::Packed24_8::new(
                0x65_4321,
                vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE.as_raw() as u8,
            ),
            acceleration_structure_reference: vk::AccelerationStructureReferenceKHR {
                device_handle: 0x0102_0304_0506_0708,
            },
        };
        // SAFETY: the structure has no padding: 48 + 4 + 4 + 8 bytes.
        let theirs: [u8; INSTANCE_BYTES] = unsafe { std::mem::transmute(theirs) };
        assert_eq!(ours.bytes(), theirs);
    }

    #[test]
    fn limits_and_absence_are_named() {
        let Some((_guard, device)) = common::device() else { return };
        let count = u32::MAX;
        let error = device.structure_sizes("forest", Input::Instances { address: 0, count }).unwrap_err();
        if device.info().ray_query {
            assert!(matches!(error, Error::TooLarge { .. }), "{error}");
            assert!(error.to_string().contains("forest"), "{error}");
            let one = Triangles {
                vertices: 0,
                vertex_stride: 12,
                vertex_count: 3,
                indices: 0,
                triangle_count: u32::MAX,
                opaque: true,
            };
            let error = device.structure_sizes("tree", Input::Triangles(&[one, one])).unwrap_err();
            assert!(error.to_string().contains("triangles of acceleration structure `tree`"), "{error}");
        } else {
            assert!(matches!(error, Error::NoRayQuery { .. }), "{error}");
        }
    }
}
