use super::hardware::Hardware;
use super::{Error, Geometry, software::SoftwareBvh};
use crate::shaders::SceneData;
use crate::vk::{self, AccelerationStructure, Backend};
use std::time::Instant;

/// What was built, how long it took and what it takes.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct StructureReport {
    /// `software`, `blas` or `tlas`.
    pub name: String,
    /// Milliseconds from the geometry to a structure on the device.
    pub build_ms: f64,
    /// Bytes on the device.
    pub bytes: u64,
    /// Triangles in it; for a top level, instances.
    pub primitives: u64,
}

/// A structure on the device that answers rays for one backend.
#[derive(Debug)]
pub struct Structure {
    built: Built,
    reports: Vec<StructureReport>,
}

#[derive(Debug)]
enum Built {
    Software { nodes: vk::Buffer, triangles: Option<vk::Buffer>, stack_depth: u32 },
    Hardware(Hardware),
}

impl Structure {
    /// Builds what `backend` needs and nothing else.
    ///
    /// # Errors
    /// Too much geometry for the device, or too little memory.
    pub fn build(device: &vk::Device, backend: Backend, geometry: &Geometry) -> Result<Self, Error> {
        if backend == Backend::RayQuery {
            let (hardware, reports) = Hardware::build(device, geometry)?;
            return Ok(Self { built: Built::Hardware(hardware), reports: reports.into() });
        }
        let start = Instant::now();
        let bvh = SoftwareBvh::build(geometry, device.info().memory_bytes)?;
        let nodes = device.upload("bvh.nodes", bvh.node_bytes())?;
        let triangles = match bvh.triangle_bytes() {
            [] => None,
            bytes => Some(device.upload("bvh.triangles", bytes)?),
        };
        let report = StructureReport {
            name: backend.name().into(),
            build_ms: start.elapsed().as_secs_f64() * 1e3,
            bytes: bvh.bytes(),
            primitives: geometry.world_triangle_count(),
        };
        let built = Built::Software { nodes, triangles, stack_depth: bvh.stack_depth };
        Ok(Self { built, reports: vec![report] })
    }

    /// Fills in the addresses that kernels traverse.
    pub fn describe(&self, data: &mut SceneData) {
        if let Built::Software { nodes, triangles, .. } = &self.built {
            data.bvh_nodes = nodes.address();
            data.bvh_triangles = triangles.as_ref().map_or(0, vk::Buffer::address);
        }
    }

    /// For binding 1 of set 0, where the backend is [`Backend::RayQuery`].
    #[must_use]
    pub fn top_level(&self) -> Option<&AccelerationStructure> {
        match &self.built {
            Built::Hardware(hardware) => Some(&hardware.top),
            Built::Software { .. } => None,
        }
    }

    /// What kernels must set `STACK_DEPTH` to.
    #[must_use]
    pub fn stack_depth(&self) -> u32 {
        match &self.built {
            Built::Hardware(_) => 1,
            Built::Software { stack_depth, .. } => *stack_depth,
        }
    }

    /// One report a structure.
    #[must_use]
    pub fn reports(&self) -> &[StructureReport] {
        &self.reports
    }
}
