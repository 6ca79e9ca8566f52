use super::boxes::{BoxOptions, Boxes};
use super::hardware::{Hardware, HardwareBoxes};
use super::{
    Error, Geometry, StructureReport,
    software::{SoftwareBoxes, SoftwareBvh},
};
use crate::shaders::SceneData;
use crate::vk::{self, AccelerationStructure, Backend};
use std::sync::Arc;
use std::time::Instant;

/// A structure on the device that answers rays for one backend. Clones share what is built.
#[derive(Clone, Debug)]
pub struct Structure {
    built: Arc<Built>,
    boxes: Option<Arc<BuiltBoxes>>,
    reports: Vec<StructureReport>,
}

#[derive(Debug)]
enum Built {
    Software { nodes: vk::Buffer, triangles: Option<vk::Buffer>, stack_depth: u32, split: bool },
    Hardware(Hardware),
}

/// The second structure, over triangles' boxes.
#[derive(Debug)]
struct BuiltBoxes {
    options: BoxOptions,
    bounds: Option<vk::Buffer>,
    planes: Option<vk::Buffer>,
    traced: TracedBoxes,
}

#[derive(Debug)]
enum TracedBoxes {
    Software { nodes: vk::Buffer, stack_depth: u32 },
    Hardware(HardwareBoxes),
}

impl Structure {
    /// Builds what `backend` needs and nothing else. `split`: as for [`SoftwareBvh::build`].
    ///
    /// # Errors
    /// Too much geometry for the device, or too little memory.
    pub fn build(
        device: &vk::Device,
        backend: Backend,
        geometry: &Geometry,
        split: bool,
    ) -> Result<Self, Error> {
        if backend == Backend::RayQuery {
            let (hardware, reports) = Hardware::build(device, geometry)?;
            let built = Arc::new(Built::Hardware(hardware));
            return Ok(Self { built, boxes: None, reports: reports.into() });
        }
        let (built, report) = Self::software(device, geometry, split)?;
        Ok(Self { built: Arc::new(built), boxes: None, reports: vec![report] })
    }

    /// Whether the boxes of all leaves bound whole triangles, as visibility by leaves' boxes needs.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        matches!(*self.built, Built::Software { split: false, .. })
    }

    /// Builds the software structure again, over whole triangles.
    ///
    /// # Errors
    /// Too little memory; then all stays as it was.
    pub fn rebuild_whole(&mut self, device: &vk::Device, geometry: &Geometry) -> Result<(), Error> {
        let (built, report) = Self::software(device, geometry, false)?;
        self.reports.iter_mut().filter(|old| old.name == report.name).for_each(|old| *old = report.clone());
        self.built = Arc::new(built);
        Ok(())
    }

    fn software(
        device: &vk::Device,
        geometry: &Geometry,
        split: bool,
    ) -> Result<(Built, StructureReport), Error> {
        let start = Instant::now();
        let bvh = SoftwareBvh::build(geometry, split, device.info().memory_bytes)?;
        let nodes = device.upload("bvh.nodes", bvh.node_bytes())?;
        let triangles = match bvh.triangle_bytes() {
            [] => None,
            bytes => Some(device.upload("bvh.triangles", bytes)?),
        };
        let report = StructureReport {
            name: Backend::Software.name().into(),
            build_ms: start.elapsed().as_secs_f64() * 1e3,
            bytes: bvh.bytes(),
            primitives: geometry.world_triangle_count(),
        };
        Ok((Built::Software { nodes, triangles, stack_depth: bvh.stack_depth, split }, report))
    }

    /// Whether [`Self::build_boxes`] has built what `options` ask for.
    #[must_use]
    pub fn has_boxes(&self, options: &BoxOptions) -> bool {
        let fits = |built: &BoxOptions| {
            built.split == options.split && built.planes >= options.planes && built.panes == options.panes
        };
        self.boxes.as_ref().is_some_and(|boxes| fits(&boxes.options))
    }

    /// Builds the second structure, over triangles' boxes, in place of the one there was.
    ///
    /// # Errors
    /// Too many boxes, or too little memory; then all stays as it was.
    pub fn build_boxes(
        &mut self,
        device: &vk::Device,
        geometry: &Geometry,
        options: &BoxOptions,
    ) -> Result<(), Error> {
        let start = Instant::now();
        let boxes = Boxes::of(geometry, options)?;
        let bytes = (size_of_val(&boxes.bounds[..]) + size_of_val(&boxes.planes[..])) as u64;
        let fits = |bytes| {
            let (triangles, available) = (geometry.world_triangle_count(), device.info().memory_bytes);
            if bytes > available { Err(Error::TooLarge { triangles, bytes, available }) } else { Ok(()) }
        };
        fits(bytes)?;
        let upload = |name: &str, bytes: &[u8]| {
            if bytes.is_empty() { Ok(None) } else { device.upload(name, bytes).map(Some) }
        };
        let arrays = |boxes: &Boxes| {
            let bounds = upload("boxes.bounds", bytemuck::cast_slice(&boxes.bounds))?;
            Ok::<_, vk::Error>((bounds, upload("boxes.planes", bytemuck::cast_slice(&boxes.planes))?))
        };
        let primitives = boxes.bounds.len() as u64;
        let report = |bytes, build_ms| StructureReport { name: "boxes".into(), build_ms, bytes, primitives };
        let milliseconds = |start: Instant| start.elapsed().as_secs_f64() * 1e3;
        let mut reports = Vec::new();
        let (arrays, traced) = if let Built::Software { .. } = *self.built {
            let built = SoftwareBoxes::build(&boxes)?;
            let bytes = bytes + built.node_bytes().len() as u64;
            fits(bytes)?;
            let nodes = device.upload("boxes.nodes", built.node_bytes())?;
            let arrays = arrays(&built.boxes)?;
            reports.push(report(bytes, milliseconds(start)));
            (arrays, TracedBoxes::Software { nodes, stack_depth: built.stack_depth })
        } else {
            let arrays = arrays(&boxes)?;
            reports.push(report(bytes, milliseconds(start)));
            let (hardware, built) = HardwareBoxes::build(device, &boxes, geometry.ray_epsilon())?;
            reports.extend(built);
            (arrays, TracedBoxes::Hardware(hardware))
        };
        let (bounds, planes) = arrays;
        self.boxes = Some(Arc::new(BuiltBoxes { options: *options, bounds, planes, traced }));
        self.reports.retain(|report| !report.name.starts_with("boxes"));
        self.reports.extend(reports);
        Ok(())
    }

    /// Fills in the addresses that kernels traverse.
    pub fn describe(&self, data: &mut SceneData) {
        if let Built::Software { nodes, triangles, .. } = &*self.built {
            data.bvh_nodes = nodes.address();
            data.bvh_triangles = triangles.as_ref().map_or(0, vk::Buffer::address);
        }
        let Some(boxes) = &self.boxes else { return };
        data.boxes = boxes.bounds.as_ref().map_or(0, vk::Buffer::address);
        data.box_planes = boxes.planes.as_ref().map_or(0, vk::Buffer::address);
        if let TracedBoxes::Software { nodes, .. } = &boxes.traced {
            data.box_nodes = nodes.address();
        }
    }

    /// For binding 1 of set 0, where the backend is [`Backend::RayQuery`].
    #[must_use]
    pub fn top_level(&self) -> Option<&AccelerationStructure> {
        match &*self.built {
            Built::Hardware(hardware) => Some(&hardware.top),
            Built::Software { .. } => None,
        }
    }

    /// For [`vk::SceneSet::set_boxes`], where the driver built a structure over boxes.
    #[must_use]
    pub fn box_top_level(&self) -> Option<&AccelerationStructure> {
        match &self.boxes.as_ref()?.traced {
            TracedBoxes::Hardware(hardware) => Some(&hardware.top),
            TracedBoxes::Software { .. } => None,
        }
    }

    /// What kernels must set `STACK_DEPTH` to.
    #[must_use]
    pub fn stack_depth(&self) -> u32 {
        let over_boxes = match self.boxes.as_ref().map(|boxes| &boxes.traced) {
            Some(TracedBoxes::Software { stack_depth, .. }) => *stack_depth,
            _ => 1,
        };
        match &*self.built {
            Built::Hardware(_) => 1,
            Built::Software { stack_depth, .. } => over_boxes.max(*stack_depth),
        }
    }

    /// One report a structure.
    #[must_use]
    pub fn reports(&self) -> &[StructureReport] {
        &self.reports
    }
}
