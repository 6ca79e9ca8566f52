//! Structures the driver builds: a compacted bottom level a mesh range, a top level over their placements.
//! `glsl/trace/ray_query.glsl` reads the ids back.

use super::{Error, Geometry, MeshRange, StructureReport};
use crate::vk::accel::{Instance, Triangles};
use crate::vk::{self, AccelerationStructure};
use ash::vk::GeometryInstanceFlagsKHR;

/// What kernels see of an instance beside its id has 24 bits.
const RECORD_OFFSET_LIMIT: u64 = (1 << 24) - 1;

/// The top level and what it refers to.
#[derive(Debug)]
pub(super) struct Hardware {
    pub(super) top: AccelerationStructure,
    _bottom: Vec<AccelerationStructure>,
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
        let upload = |name: &str, bytes: &[u8]| {
            if bytes.is_empty() { Ok(None) } else { device.upload(name, bytes).map(Some) }
        };
        let vertices = upload("blas.positions", bytemuck::cast_slice(&geometry.positions))?;
        let indices = upload("blas.triangles", bytemuck::cast_slice(&geometry.triangles))?;
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
        let filled: Vec<&[Triangles]> =
            meshes.iter().filter(|mesh| !mesh.is_empty()).map(Vec::as_slice).collect();
        let (bottom, bottom_report) = device.build_triangle_structures("blas", &filled)?;

        let mut built = bottom.iter();
        let addresses: Vec<Option<u64>> = meshes
            .iter()
            .map(|mesh| if mesh.is_empty() { None } else { built.next().map(AccelerationStructure::address) })
            .collect();
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
                    structure: addresses[placed.mesh as usize]?,
                })
            })
            .collect();
        let (top, top_report) = device.build_instance_structure("tlas", &instances)?;
        let reports = [
            StructureReport {
                name: "blas".into(),
                build_ms: bottom_report.milliseconds,
                bytes: bottom_report.bytes,
                primitives: geometry.triangles.len() as u64,
            },
            StructureReport {
                name: "tlas".into(),
                build_ms: top_report.milliseconds,
                bytes: top_report.bytes,
                primitives: instances.len() as u64,
            },
        ];
        Ok((Self { top, _bottom: bottom }, reports))
    }
}
