//! Structures the driver builds: a compacted bottom level a mesh range, a top level over their placements.
//! `glsl/trace/ray_query.glsl` reads the ids back.

use super::boxes::{Bounds, Boxes};
use super::{Error, Geometry, MeshRange, StructureReport, upload};
use crate::vk::accel::{BuildReport, Input, Instance, Triangles};
use crate::vk::{self, AccelerationStructure};
use ash::vk::GeometryInstanceFlagsKHR;
use std::sync::Arc;

/// What kernels see of an instance beside its id has 24 bits.
const RECORD_OFFSET_LIMIT: u64 = (1 << 24) - 1;

/// The top level and what it refers to.
#[derive(Debug)]
pub(super) struct Hardware {
    pub(super) top: AccelerationStructure,
    bottom: Arc<Bottom>,
}

/// The bottom levels, and the address of each mesh range's that has one.
#[derive(Debug)]
struct Bottom {
    _structures: Vec<AccelerationStructure>,
    addresses: Vec<Option<u64>>,
}

impl Hardware {
    pub(super) fn build(
        device: &vk::Device,
        geometry: &Geometry,
    ) -> Result<(Self, [StructureReport; 2]), Error> {
        for range in geometry.meshes.iter().filter(|range| range.masked_from < range.triangle_count) {
            let what = "opaque triangles in a mesh with alpha-masked ones";
            super::at_most(what, range.masked_from.into(), RECORD_OFFSET_LIMIT)?;
        }
        let vertices = upload(device, "blas.positions", bytemuck::cast_slice(&geometry.positions))?;
        let indices = upload(device, "blas.triangles", bytemuck::cast_slice(&geometry.triangles))?;
        let address = |buffer: &Option<vk::Buffer>| buffer.as_ref().map_or(0, vk::Buffer::address);
        let part = |first: u32, triangle_count: u32, opaque: bool| Triangles {
            vertices: address(&vertices),
            vertex_stride: 12,
            vertex_count: geometry.positions.len() as u32,
            indices: address(&indices) + 12 * u64::from(first),
            triangle_count,
            opaque,
        };
        let parts = |range: &MeshRange| {
            let MeshRange { first_triangle, triangle_count, masked_from } = *range;
            let opaque = part(first_triangle, masked_from, true);
            let masked = part(first_triangle + masked_from, triangle_count - masked_from, false);
            [opaque, masked].into_iter().filter(|part| part.triangle_count > 0).collect::<Vec<_>>()
        };
        let meshes: Vec<Vec<Triangles>> = geometry.meshes.iter().map(parts).collect();
        let filled: Vec<Input<'_>> =
            meshes.iter().filter(|mesh| !mesh.is_empty()).map(|mesh| Input::Triangles(mesh)).collect();
        let (bottom, bottom_report) = device.build_bottom_structures("blas", &filled)?;

        let mut built = bottom.iter();
        let addresses: Vec<Option<u64>> = meshes
            .iter()
            .map(|mesh| if mesh.is_empty() { None } else { built.next().map(AccelerationStructure::address) })
            .collect();
        let bottom = Arc::new(Bottom { _structures: bottom, addresses });
        let lower = StructureReport {
            name: "blas".into(),
            build_ms: bottom_report.milliseconds,
            bytes: bottom_report.bytes,
            primitives: geometry.triangles.len() as u64,
        };
        let (hardware, upper) = Self::over(device, geometry, bottom)?;
        Ok((hardware, [lower, upper]))
    }

    /// The same with what moves placed as `geometry` has it, of which nothing else has changed.
    pub(super) fn moved(
        &self,
        device: &vk::Device,
        geometry: &Geometry,
    ) -> Result<(Self, StructureReport), Error> {
        Self::over(device, geometry, Arc::clone(&self.bottom))
    }

    fn over(
        device: &vk::Device,
        geometry: &Geometry,
        bottom: Arc<Bottom>,
    ) -> Result<(Self, StructureReport), Error> {
        let instances: Vec<Instance> = geometry
            .instances
            .iter()
            .zip(0..)
            .filter(|(placed, _)| placed.transform.matrix3.determinant() != 0.0)
            .filter_map(|(placed, custom_index)| {
                let rows = glam::Mat4::from(placed.transform).transpose().to_cols_array_2d();
                Some(Instance {
                    transform: [rows[0], rows[1], rows[2]],
                    custom_index,
                    record_offset: geometry.meshes[placed.mesh as usize].masked_from
                        & RECORD_OFFSET_LIMIT as u32,
                    mask: 0xff,
                    flags: GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE,
                    structure: bottom.addresses[placed.mesh as usize]?,
                })
            })
            .collect();
        let (top, top_report) = device.build_instance_structure("tlas", &instances)?;
        let report = StructureReport {
            name: "tlas".into(),
            build_ms: top_report.milliseconds,
            bytes: top_report.bytes,
            primitives: instances.len() as u64,
        };
        Ok((Self { top, bottom }, report))
    }
}

/// How far (in ray epsilons, each eight units of 2⁻²⁴ of the scene's largest coordinate) the boxes that the driver
/// sees stand out: a driver's test may subtract the origin, multiply by a rounded inverse and take a quantised
/// parent's word first, each a few such units, and flat boxes must be found as well. More costs candidates that the
/// kernel then refuses.
const PADDING: f32 = 8.0;

/// Structures over boxes: the driver finds candidates, `glsl/trace/boxes.glsl` decides.
#[derive(Debug)]
pub(super) struct HardwareBoxes {
    pub(super) top: AccelerationStructure,
    _bottom: Vec<AccelerationStructure>,
}

impl HardwareBoxes {
    pub(super) fn build(
        device: &vk::Device,
        boxes: &Boxes,
        ray_epsilon: f32,
    ) -> Result<(Self, [StructureReport; 2]), Error> {
        super::at_most("bounding boxes", boxes.bounds.len() as u64, u32::MAX.into())?;
        let padding = PADDING * ray_epsilon;
        let pad = |b: &Bounds| Bounds { low: b.low - padding, high: b.high + padding };
        let padded: Vec<Bounds> = boxes.bounds.iter().map(pad).collect();
        let (mut bottom, mut bottom_report) = (Vec::new(), BuildReport::default());
        if !padded.is_empty() {
            let buffer = device.upload("boxes.blas.input", bytemuck::cast_slice(&padded))?;
            let input = Input::Boxes { address: buffer.address(), count: padded.len() as u32 };
            (bottom, bottom_report) = device.build_bottom_structures("boxes.blas", &[input])?;
        }
        let instances: Vec<Instance> = bottom
            .iter()
            .map(|structure| Instance {
                transform: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
                custom_index: 0,
                record_offset: 0,
                mask: 0xff,
                flags: GeometryInstanceFlagsKHR::empty(),
                structure: structure.address(),
            })
            .collect();
        let (top, top_report) = device.build_instance_structure("boxes.tlas", &instances)?;
        let reports = [
            StructureReport {
                name: "boxes-blas".into(),
                build_ms: bottom_report.milliseconds,
                bytes: bottom_report.bytes,
                primitives: padded.len() as u64,
            },
            StructureReport {
                name: "boxes-tlas".into(),
                build_ms: top_report.milliseconds,
                bytes: top_report.bytes,
                primitives: instances.len() as u64,
            },
        ];
        Ok((Self { top, _bottom: bottom }, reports))
    }
}
