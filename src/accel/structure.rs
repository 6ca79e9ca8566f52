use super::boxes::{BoxOptions, Boxes};
use super::hardware::{Hardware, HardwareBoxes, Remade};
use super::{
    Error, Geometry, StructureReport,
    levels::{self, Deforming, Meshes, Places},
    lower::SoftwareLower,
    software::{MAX_STACK_DEPTH, SoftwareBoxes, SoftwareBvh},
    upload,
};
use crate::shaders::SceneData;
use crate::vk::{self, AccelerationStructure, Backend};
use std::sync::Arc;
use std::time::Instant;

/// How the software structure is arranged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Arrangement {
    /// Whether each triangle lies in one leaf, whose box is its own. Otherwise [large slanted ones](SoftwareBvh::build) do in
    /// several.
    pub whole: bool,
    /// Whether placements have a level of their own.
    pub levels: Levels,
    /// When nodes over what [is brought into shape](crate::scene::Scene::deformations) are built anew.
    pub rebuild: Rebuild,
}

/// When nodes over what [is brought into shape](crate::scene::Scene::deformations) are built anew, rather than fitted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rebuild {
    /// Once a ray is expected to visit twice what it was after the last build, nodes and triangles, by their surface areas.
    #[default]
    AsNeeded,
    /// Never.
    Never,
    /// For each shape.
    Always,
}

/// Whether placements have a level of their own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Levels {
    /// Where something [is to move](crate::scene::Instance::moves), for what does; for all where that [saves much
    /// memory](levels::worthwhile).
    #[default]
    AsNeeded,
    /// Never.
    One,
    /// For all placements.
    Two,
}

/// Names of reports on what is done for each shape: all that is fitted, and what is built anew.
pub(crate) const DEFORMED: [&str; 2] = ["refit", "rebuild"];

/// A structure on the device that answers rays for one backend. Clones share what is built.
#[derive(Clone, Debug)]
pub struct Structure {
    built: Arc<Built>,
    boxes: Option<Arc<BuiltBoxes>>,
    reports: Vec<StructureReport>,
}

#[derive(Debug)]
enum Built {
    Software(Software),
    Hardware(Hardware),
}

#[derive(Debug)]
struct Software {
    lower: Arc<SoftwareLower>,
    top: Option<SoftwareTop>,
    stack_depth: u32,
    whole: bool,
}

#[derive(Clone, Debug)]
struct SoftwareTop {
    nodes: Arc<vk::Buffer>,
    placements: Option<Arc<vk::Buffer>>,
    /// Where something is to move.
    places: Option<Places>,
}

impl Software {
    fn build(
        device: &vk::Device,
        geometry: &Geometry,
        arrangement: Arrangement,
    ) -> Result<(Self, Vec<StructureReport>), Error> {
        let Arrangement { whole, levels, .. } = arrangement;
        let start = Instant::now();
        let each = levels == Levels::Two || levels == Levels::AsNeeded && levels::worthwhile(geometry);
        if each || levels == Levels::AsNeeded && geometry.moves() {
            let meshes = Meshes::build(geometry, !whole, each)?;
            let bytes = size_of_val(&meshes.nodes[..]) + size_of_val(&meshes.triangles[..]);
            fits(device, geometry, bytes as u64)?;
            let (places, triangles) = (meshes.places.clone(), meshes.triangles.len() as u64);
            let lower = SoftwareLower::of(device, meshes)?;
            let of_lower = report(Backend::Software.name(), start, bytes, triangles);
            let (top, stack_depth, upper) = SoftwareTop::build(device, places)?;
            let built = Self { lower, top: Some(top), stack_depth, whole };
            return Ok((built, vec![of_lower, upper]));
        }
        let bvh = SoftwareBvh::build(geometry, !whole, device.info().memory_bytes)?;
        let lower = SoftwareLower::upload(device, bvh.node_bytes(), bvh.triangle_bytes(), Vec::new())?;
        let bytes = bvh.bytes() as usize;
        let report = report(Backend::Software.name(), start, bytes, geometry.world_triangle_count());
        Ok((Self { lower, top: None, stack_depth: bvh.stack_depth, whole }, vec![report]))
    }
}

impl SoftwareTop {
    /// With what kernels must set `STACK_DEPTH` to.
    fn build(device: &vk::Device, places: Places) -> Result<(Self, u32, StructureReport), Error> {
        let start = Instant::now();
        let top = places.top()?;
        let stack_depth = places.stack_depth(&top);
        let built = Self {
            nodes: device.upload("bvh.top", bytemuck::cast_slice(&top.nodes))?.into(),
            placements: upload(device, "bvh.placements", bytemuck::cast_slice(&top.placements))?
                .map(Arc::new),
            places: places.move_any().then_some(places),
        };
        let bytes = size_of_val(&top.nodes[..]) + size_of_val(&top.placements[..]);
        Ok((built, stack_depth, report("software-top", start, bytes, top.placements.len() as u64)))
    }
}

/// Refuses what takes more than the device has.
fn fits(device: &vk::Device, geometry: &Geometry, bytes: u64) -> Result<(), Error> {
    let (triangles, available) = (geometry.world_triangle_count(), device.info().memory_bytes);
    if bytes > available { Err(Error::TooLarge { triangles, bytes, available }) } else { Ok(()) }
}

fn report(name: &str, start: Instant, bytes: usize, primitives: u64) -> StructureReport {
    let build_ms = start.elapsed().as_secs_f64() * 1e3;
    StructureReport { name: name.into(), build_ms, bytes: bytes as u64, primitives }
}

/// What kernels must know of a software structure to traverse it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Traversal {
    /// What `STACK_DEPTH` must be.
    pub stack_depth: u32,
    /// What `TWO_LEVELS` must be.
    pub two_levels: bool,
}

impl Default for Traversal {
    /// Of one level, whatever its depth.
    fn default() -> Self {
        Self { stack_depth: MAX_STACK_DEPTH, two_levels: false }
    }
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
    /// Builds what `backend` needs and nothing else; the software structure as arranged.
    ///
    /// # Errors
    /// Too much geometry for the device, or too little memory.
    pub fn build(
        device: &vk::Device,
        backend: Backend,
        geometry: &Geometry,
        arrangement: Arrangement,
    ) -> Result<Self, Error> {
        if backend == Backend::RayQuery {
            let (hardware, reports) = Hardware::build(device, geometry)?;
            let built = Arc::new(Built::Hardware(hardware));
            return Ok(Self { built, boxes: None, reports: reports.into() });
        }
        let (software, reports) = Software::build(device, geometry, arrangement)?;
        Ok(Self { built: Arc::new(Built::Software(software)), boxes: None, reports })
    }

    /// The same with what moves placed as `geometry` has it, of which nothing else has changed: the top level alone is built
    /// anew. None where that does not do. Structures over boxes are left out.
    ///
    /// # Errors
    /// Too many levels of nodes, or too little memory.
    pub fn moved(&self, device: &vk::Device, geometry: &Geometry) -> Result<Option<Self>, Error> {
        let (built, report) = match &*self.built {
            Built::Hardware(hardware) => {
                let (hardware, report) = hardware.moved(device, geometry)?;
                (Built::Hardware(hardware), report)
            }
            Built::Software(Software { lower, top: Some(top), whole, .. }) => {
                let Some(places) = top.places.as_ref().and_then(|places| places.moved(geometry)) else {
                    return Ok(None);
                };
                let (top, stack_depth, report) = SoftwareTop::build(device, places)?;
                let lower = Arc::clone(lower);
                let software = Software { lower, top: Some(top), stack_depth, whole: *whole };
                (Built::Software(software), report)
            }
            Built::Software(_) => return Ok(None),
        };
        let kept =
            self.reports.iter().filter(|known| known.name != report.name && !known.name.starts_with("boxes"));
        let reports = kept.cloned().chain([report.clone()]).collect();
        Ok(Some(Self { built: Arc::new(built), boxes: None, reports }))
    }

    /// Our nodes and triangles of the lower level, and what of them is to be brought into shape, if anything is.
    pub(crate) fn deforming(&self) -> Option<(&Arc<vk::Buffer>, &Arc<vk::Buffer>, &[Deforming])> {
        let lower = match &*self.built {
            Built::Software(software) => &software.lower,
            Built::Hardware(hardware) => hardware.changing()?,
        };
        let (nodes, triangles) = (lower.nodes.as_ref()?, lower.triangles.as_ref()?);
        (!lower.deforming.is_empty()).then_some((nodes, triangles, &lower.deforming))
    }

    /// The driver's structures for meshes in the shape that `positions` have, `anew` those of these numbers; none where there
    /// are only ours.
    ///
    /// # Errors
    /// Too little memory.
    pub(crate) fn remake(
        &self,
        device: &vk::Device,
        positions: &Arc<vk::Buffer>,
        anew: &[usize],
    ) -> Result<Vec<Arc<Remade>>, Error> {
        match &*self.built {
            Built::Software(_) => Ok(Vec::new()),
            Built::Hardware(hardware) => {
                Ok(hardware.remake(device, positions, anew)?.into_iter().map(Arc::new).collect())
            }
        }
    }

    /// The same with other nodes and triangles of our lower level, the driver's structures that were remade, which are yet to be
    /// [placed](Self::moved), and what it took; structures over boxes are left out.
    pub(crate) fn deformed(
        &self,
        nodes: Arc<vk::Buffer>,
        triangles: Arc<vk::Buffer>,
        remade: &[Arc<Remade>],
        made: impl IntoIterator<Item = StructureReport>,
    ) -> Self {
        let mut reports = self.reports.clone();
        reports.retain(|report| !DEFORMED.contains(&&*report.name) && !report.name.starts_with("boxes"));
        reports.extend(made);
        let lower = |before: &SoftwareLower| SoftwareLower {
            nodes: Some(nodes),
            triangles: Some(triangles),
            deforming: Arc::clone(&before.deforming),
        };
        let built = match &*self.built {
            Built::Software(Software { lower: before, top, stack_depth, whole }) => {
                let (lower, top) = (Arc::new(lower(before)), top.clone());
                Built::Software(Software { lower, top, stack_depth: *stack_depth, whole: *whole })
            }
            Built::Hardware(hardware) => {
                let before = hardware.changing().expect("something is brought into shape");
                Built::Hardware(hardware.deformed(lower(before), remade))
            }
        };
        Self { built: Arc::new(built), boxes: None, reports }
    }

    /// Whether the boxes of all leaves bound whole triangles in the world, as visibility by leaves' boxes needs.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        matches!(*self.built, Built::Software(Software { whole: true, top: None, .. }))
    }

    /// Builds the software structure again, over whole triangles in one level.
    ///
    /// # Errors
    /// Too little memory; then all stays as it was.
    pub fn rebuild_whole(&mut self, device: &vk::Device, geometry: &Geometry) -> Result<(), Error> {
        let whole = Arrangement { whole: true, levels: Levels::One, ..Arrangement::default() };
        let (software, reports) = Software::build(device, geometry, whole)?;
        let boxes = self.reports.drain(..).filter(|report| report.name.starts_with("boxes"));
        self.reports = reports.into_iter().chain(boxes).collect();
        self.built = Arc::new(Built::Software(software));
        Ok(())
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
        fits(device, geometry, bytes)?;
        let arrays = |boxes: &Boxes| {
            let bounds = upload(device, "boxes.bounds", bytemuck::cast_slice(&boxes.bounds))?;
            let planes = upload(device, "boxes.planes", bytemuck::cast_slice(&boxes.planes))?;
            Ok::<_, vk::Error>((bounds, planes))
        };
        let primitives = boxes.bounds.len() as u64;
        let mut reports = Vec::new();
        let (arrays, traced) = if let Built::Software(_) = *self.built {
            let built = SoftwareBoxes::build(&boxes)?;
            let bytes = bytes + built.node_bytes().len() as u64;
            fits(device, geometry, bytes)?;
            let nodes = device.upload("boxes.nodes", built.node_bytes())?;
            let arrays = arrays(&built.boxes)?;
            reports.push(report("boxes", start, bytes as usize, primitives));
            (arrays, TracedBoxes::Software { nodes, stack_depth: built.stack_depth })
        } else {
            let arrays = arrays(&boxes)?;
            reports.push(report("boxes", start, bytes as usize, primitives));
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
        let address = |buffer: &Option<vk::Buffer>| buffer.as_ref().map_or(0, vk::Buffer::address);
        let shared = |buffer: &Option<Arc<vk::Buffer>>| buffer.as_ref().map_or(0, |buffer| buffer.address());
        if let Built::Software(Software { lower, top, .. }) = &*self.built {
            data.bvh_nodes = shared(&lower.nodes);
            data.bvh_triangles = shared(&lower.triangles);
            data.bvh_top = top.as_ref().map_or(0, |top| top.nodes.address());
            data.bvh_placements = top.as_ref().map_or(0, |top| shared(&top.placements));
        }
        let Some(boxes) = &self.boxes else { return };
        data.boxes = address(&boxes.bounds);
        data.box_planes = address(&boxes.planes);
        if let TracedBoxes::Software { nodes, .. } = &boxes.traced {
            data.box_nodes = nodes.address();
        }
    }

    /// For binding 1 of set 0, where the backend is [`Backend::RayQuery`].
    #[must_use]
    pub fn top_level(&self) -> Option<&AccelerationStructure> {
        match &*self.built {
            Built::Hardware(hardware) => Some(&hardware.top),
            Built::Software(_) => None,
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

    /// What kernels must be specialised to.
    #[must_use]
    pub fn traversal(&self) -> Traversal {
        let over_boxes = match self.boxes.as_ref().map(|boxes| &boxes.traced) {
            Some(TracedBoxes::Software { stack_depth, .. }) => *stack_depth,
            _ => 1,
        };
        match &*self.built {
            Built::Hardware(_) => Traversal { stack_depth: 1, two_levels: false },
            Built::Software(software) => Traversal {
                stack_depth: over_boxes.max(software.stack_depth),
                two_levels: software.top.is_some(),
            },
        }
    }

    /// One report a structure.
    #[must_use]
    pub fn reports(&self) -> &[StructureReport] {
        &self.reports
    }
}
