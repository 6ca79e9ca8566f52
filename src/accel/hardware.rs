//! Structures the driver builds: a compacted bottom level a mesh range, a top level over their placements.
//! `glsl/trace/ray_query.glsl` reads the ids back.

use super::boxes::{Bounds, Boxes};
use super::levels::{Deforming, Meshes};
use super::lower::SoftwareLower;
use super::{Error, Geometry, MeshRange, StructureReport, upload};
use crate::vk::accel::{BuildReport, Input, Instance, Triangles};
use crate::vk::{self, AccelerationStructure};
use ash::vk::{CommandBuffer, GeometryInstanceFlagsKHR};
use std::sync::Arc;

/// What kernels see of an instance beside its id has 24 bits.
const RECORD_OFFSET_LIMIT: u64 = (1 << 24) - 1;

/// The top level and what it refers to.
#[derive(Debug)]
pub(super) struct Hardware {
    pub(super) top: Arc<AccelerationStructure>,
    bottom: Arc<Bottom>,
}

/// The bottom levels.
#[derive(Clone, Debug)]
struct Bottom {
    /// Of each mesh range that holds triangles.
    structures: Vec<Option<Arc<AccelerationStructure>>>,
    changing: Option<Changing>,
}

/// Meshes that are to be brought into shape.
#[derive(Clone, Debug)]
struct Changing {
    /// Nodes of our own over them, which say when the driver's have become slow.
    lower: Arc<SoftwareLower>,
    /// Of each its range.
    ranges: Arc<[MeshRange]>,
    indices: Arc<vk::Buffer>,
    vertex_count: u32,
}

/// The structure of a mesh that is brought into shape.
#[derive(Debug)]
pub(crate) struct Remade {
    /// Index into the mesh ranges.
    mesh: usize,
    /// What it is an update of; none where it is built anew.
    from: Option<Arc<AccelerationStructure>>,
    into: Arc<AccelerationStructure>,
    parts: Vec<Triangles>,
    scratch: vk::Buffer,
    _inputs: [Arc<vk::Buffer>; 2],
}

impl Remade {
    /// Records the build or update, behind barriers before and after.
    pub(crate) fn record(&self, device: &vk::Device, commands: CommandBuffer) -> Result<(), vk::Error> {
        let scratch = device.align_scratch(self.scratch.address());
        device.record_build(commands, Input::Changing(&self.parts), self.from.as_deref(), &self.into, scratch)
    }
}

/// Opaque triangles of a range, then alpha-masked ones, of what there are. `vertices` and `indices` are addresses of all.
fn parts(range: &MeshRange, vertices: u64, vertex_count: u32, indices: u64) -> Vec<Triangles> {
    let part = |first: u32, triangle_count: u32, opaque: bool| Triangles {
        vertices,
        vertex_stride: 12,
        vertex_count,
        indices: indices + 12 * u64::from(first),
        triangle_count,
        opaque,
    };
    let MeshRange { first_triangle, triangle_count, masked_from } = *range;
    let opaque = part(first_triangle, masked_from, true);
    let masked = part(first_triangle + masked_from, triangle_count - masked_from, false);
    [opaque, masked].into_iter().filter(|part| part.triangle_count > 0).collect()
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
        let vertex_count = geometry.positions.len() as u32;
        let parts = |range: &MeshRange| parts(range, address(&vertices), vertex_count, address(&indices));
        let meshes: Vec<Vec<Triangles>> = geometry.meshes.iter().map(parts).collect();
        let changes = |mesh: usize| geometry.deformed(mesh as u32).is_some();
        let filled: Vec<(usize, &Vec<Triangles>)> =
            meshes.iter().enumerate().filter(|(_, mesh)| !mesh.is_empty()).collect();
        let still = filled.iter().filter(|(mesh, _)| !changes(*mesh));
        let inputs: Vec<Input<'_>> = still.clone().map(|(_, parts)| Input::Triangles(parts)).collect();
        let (built, mut report) = device.build_bottom_structures("blas", &inputs)?;
        let mut structures = vec![None; meshes.len()];
        for ((mesh, _), structure) in still.zip(built) {
            structures[*mesh] = Some(Arc::new(structure));
        }
        for (mesh, parts) in filled.iter().filter(|(mesh, _)| changes(*mesh)) {
            let (structure, of_one) = device.build_structure("blas", Input::Changing(parts))?;
            report.bytes += of_one.bytes;
            report.milliseconds += of_one.milliseconds;
            structures[*mesh] = Some(Arc::new(structure));
        }
        let deforming = Meshes::deforming(geometry)?;
        let changing = match indices.filter(|_| !deforming.deforming.is_empty()) {
            Some(indices) => Some(Changing {
                ranges: deforming.deforming.iter().map(|of| geometry.meshes[of.mesh as usize]).collect(),
                lower: SoftwareLower::of(device, deforming)?,
                indices: Arc::new(indices),
                vertex_count,
            }),
            None => None,
        };
        let lower = StructureReport {
            name: "blas".into(),
            build_ms: report.milliseconds,
            bytes: report.bytes,
            primitives: geometry.triangles.len() as u64,
        };
        let (hardware, upper) = Self::over(device, geometry, Arc::new(Bottom { structures, changing }))?;
        Ok((hardware, [lower, upper]))
    }

    /// Nodes of our own over what is to be brought into shape, if anything is.
    pub(super) fn changing(&self) -> Option<&Arc<SoftwareLower>> {
        self.bottom.changing.as_ref().map(|changing| &changing.lower)
    }

    /// Structures for meshes in the shape that `positions` have, `anew` those of these numbers.
    pub(super) fn remake(
        &self,
        device: &vk::Device,
        positions: &Arc<vk::Buffer>,
        anew: &[usize],
    ) -> Result<Vec<Remade>, Error> {
        let Some(Changing { lower, ranges, indices, vertex_count }) = &self.bottom.changing else {
            return Ok(Vec::new());
        };
        let remade = |(number, (of, range)): (usize, (&Deforming, &MeshRange))| {
            let mesh = of.mesh as usize;
            let parts = parts(range, positions.address(), *vertex_count, indices.address());
            let input = Input::Changing(&parts);
            let sizes = device.structure_sizes("blas", input)?;
            let into = Arc::new(device.create_structure("blas", input, sizes.structure)?);
            let from = self.bottom.structures[mesh].clone().filter(|_| !anew.contains(&number));
            let scratch = device.scratch(sizes.scratch)?;
            let _inputs = [Arc::clone(positions), Arc::clone(indices)];
            Ok(Remade { mesh, from, into, parts, scratch, _inputs })
        };
        lower.deforming.iter().zip(&**ranges).enumerate().map(remade).collect()
    }

    /// The same with structures that were remade, which are to be placed.
    pub(super) fn deformed(&self, lower: SoftwareLower, remade: &[Arc<Remade>]) -> Self {
        let mut bottom = Bottom::clone(&self.bottom);
        for Remade { mesh, into, .. } in remade.iter().map(|remade| &**remade) {
            bottom.structures[*mesh] = Some(Arc::clone(into));
        }
        bottom.changing = bottom.changing.map(|changing| Changing { lower: Arc::new(lower), ..changing });
        Self { top: Arc::clone(&self.top), bottom: Arc::new(bottom) }
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
                    structure: bottom.structures[placed.mesh as usize].as_ref()?.address(),
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
        Ok((Self { top: Arc::new(top), bottom }, report))
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
