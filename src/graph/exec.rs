//! Running a plan: transient memory, command buffers, bands and times.

use super::{
    Barrier, Culled, Desc, Error, Graph, ImageDesc, Limits, Memory, Mistake, PassTime, Placement, Plan,
    PlannedPass, Requirements, Stages, Ticket, TimeNode,
    decl::{AnyRes, Buffer, Dispatch, Image, KernelWork, Object, Res, Work},
    roll_up,
};
use crate::vk::{
    self, Backend, BindingKind, CommandBuffer, MemoryKind, Pipeline, Pipelines, SceneSet, TimestampPool,
};
use ash::vk as raw;
use bytemuck::Pod;
use std::{
    collections::HashMap,
    ops::Range,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::Instant,
};

/// Staging memory above this is given back after each run.
const KEPT_STAGING: u64 = 64 << 20;

/// An unknown kernel starts with this part of its workgroups, and each further band has at most
/// [`GROWTH`] times the one before until its speed is known for the whole grid.
const PROBE: f64 = 1.0 / 256.0;
const GROWTH: f64 = 8.0;

/// Runs graphs on a device. Keeps pipelines, transient memory and how long each pass took, so that a graph
/// recorded anew every frame costs little.
#[derive(Debug)]
pub struct Executor {
    // Fields drop in order: objects before the heaps they lie in.
    objects: Vec<(Transient, Object)>,
    heaps: Vec<(super::Heap, vk::Heap)>,
    uploads: Option<vk::Buffer>,
    readbacks: Option<vk::Buffer>,
    timestamps: Option<TimestampPool>,
    pipelines: Pipelines,
    rates: HashMap<RateKey, f64>,
    backend: Backend,
    device: vk::Device,
}

/// What a transient's Vulkan object depends on.
type Transient = (Desc, Placement);

/// A pass whose milliseconds a workgroup are known: path, kernel and workgroups.
type RateKey = (String, Option<String>, Option<[u32; 3]>);

fn rate_key(pass: &PlannedPass) -> RateKey {
    (pass.path.clone(), pass.shader.clone(), pass.groups)
}

/// How a graph is run.
#[derive(Clone, Copy)]
pub struct RunOptions<'a> {
    /// Descriptor set 0, needed by kernels that use the scene.
    pub scene: Option<&'a SceneSet>,
    /// Whether transients share memory. Off, every resource keeps its own: the results are the same.
    pub alias: bool,
    /// Milliseconds a submit should take at most. Kernels are split into bands of workgroups to keep to it; the
    /// results are the same. Less answers `cancel` sooner and costs more submits.
    pub submit_ms: f64,
    /// Whether each pass is timed. Many devices start no pass before the one before has ended where both are timed:
    /// off, independent passes overlap and only the whole is timed ([`Run::device_ms`]). Passes that never ran before
    /// are timed in any case.
    pub pass_times: bool,
    /// Asked between submits; where it is true the run ends with [`Error::Cancelled`].
    pub cancel: Option<&'a AtomicBool>,
    /// Told after each submit how far the run is.
    pub progress: Option<&'a dyn Fn(Progress<'_>)>,
}

impl Default for RunOptions<'_> {
    fn default() -> Self {
        Self { scene: None, alias: true, submit_ms: 100.0, pass_times: true, cancel: None, progress: None }
    }
}

/// How far a run is.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// Path of the pass that ran last.
    pub pass: &'a str,
    /// Share of the work that is done, from 0 to 1; by time once all passes have run before.
    pub done: f64,
}

/// What a graph did and what it read back.
#[derive(Debug)]
pub struct Run {
    /// Time of each pass, in order of execution.
    pub passes: Vec<PassTime>,
    /// Passes that were recorded and did not run.
    pub culled: Vec<Culled>,
    /// What was run; [`Plan::dot`] and [`Plan::json`] show it with [`passes`](Self::passes).
    pub plan: Plan,
    /// Bytes of transient memory.
    pub transient_bytes: u64,
    /// Bytes it would be without sharing.
    pub unaliased_bytes: u64,
    /// Milliseconds on the device from the first pass's start to the end of the last that is no readback, waits
    /// between submits left out. With [`RunOptions::pass_times`] the sum over passes, readbacks left out. `None`
    /// where the device has no timestamps.
    pub device_ms: Option<f64>,
    /// Times that work was handed to the device.
    pub submits: u32,
    graph: u32,
    contents: Vec<Option<Vec<u8>>>,
}

impl Run {
    /// The contents that a readback or tap promised.
    ///
    /// # Panics
    /// If the ticket is of another graph.
    #[must_use]
    pub fn take<T: Pod>(&mut self, ticket: Ticket<T>) -> Vec<T> {
        assert_eq!(ticket.graph, self.graph, "{ticket:?} is of another graph");
        let bytes = self.contents[ticket.index].take().expect("a ticket is redeemed once");
        bytemuck::pod_collect_to_vec(&bytes)
    }

    /// Times summed by path.
    #[must_use]
    pub fn rollup(&self) -> TimeNode {
        roll_up(&self.passes)
    }
}

/// What a raw pass records with. Recording is the caller's own `unsafe`: it must touch no more than the pass
/// declares, and leave images in the general layout.
pub struct RawContext<'c> {
    frame: &'c Frame<'c>,
    graph: u32,
    command_buffer: raw::CommandBuffer,
}

impl RawContext<'_> {
    /// The device's functions.
    #[must_use]
    pub fn device(&self) -> &ash::Device {
        self.frame.device.raw()
    }

    /// In the recording state, behind the pass's barrier.
    #[must_use]
    pub fn command_buffer(&self) -> raw::CommandBuffer {
        self.command_buffer
    }

    /// A buffer the pass declares.
    ///
    /// # Panics
    /// If it is of another graph or no pass uses it.
    #[must_use]
    pub fn buffer(&self, buffer: Res<Buffer>) -> raw::Buffer {
        match self.object(buffer.into()) {
            Object::Buffer(object) => object.raw(),
            _ => panic!("{buffer:?} has no memory"),
        }
    }

    /// An image the pass declares, and its view.
    ///
    /// # Panics
    /// If it is of another graph or no pass uses it.
    #[must_use]
    pub fn image(&self, image: Res<Image>) -> (raw::Image, raw::ImageView) {
        match self.object(image.into()) {
            Object::Image(object) => (object.raw(), object.view()),
            _ => panic!("{image:?} has no memory"),
        }
    }

    fn object(&self, resource: AnyRes) -> &Object {
        resource.index_in(self.graph).map_or(&Object::None, |index| &self.frame.objects[index as usize])
    }
}

impl Requirements for vk::Device {
    fn buffer(&self, size: u64) -> Memory {
        self.buffer_requirements("transient", size).map_or_else(|_| no_memory(size), memory)
    }

    fn image(&self, desc: ImageDesc) -> Memory {
        self.image_requirements("transient", desc.extent, desc.format)
            .map_or_else(|_| no_memory(desc.bytes()), memory)
    }

    fn limits(&self) -> Limits {
        let info = self.info();
        Limits {
            max_groups: info.max_workgroup_count,
            max_storage_buffer_range: info.max_storage_buffer_range,
            max_buffer: info.max_buffer_bytes,
            max_image_side: info.max_image_dimension,
            max_allocation: info.max_allocation_bytes,
        }
    }
}

fn memory(vk::Requirements { size, alignment, memory_type_bits }: vk::Requirements) -> Memory {
    Memory { size, alignment, memory_type_bits }
}

/// Of what is beyond the limits: no type of memory will do.
fn no_memory(size: u64) -> Memory {
    Memory { size, alignment: 1, memory_type_bits: 0 }
}

impl Executor {
    /// An executor whose kernels trace rays by `backend`.
    ///
    /// # Errors
    /// What the driver says.
    pub fn new(device: &vk::Device, backend: Backend) -> Result<Self, Error> {
        Ok(Self {
            objects: Vec::new(),
            heaps: Vec::new(),
            uploads: None,
            readbacks: None,
            timestamps: None,
            pipelines: Pipelines::new(device)?,
            rates: HashMap::new(),
            backend,
            device: device.clone(),
        })
    }

    /// Plans a graph, runs it and waits for its end.
    ///
    /// # Errors
    /// Mistakes of the graph, [`Error::Cancelled`], and whatever the device says.
    pub fn run(&mut self, mut graph: Graph, options: &RunOptions<'_>) -> Result<Run, Error> {
        let plan = graph.plan_with(&self.device, options.alias)?;
        if cfg!(debug_assertions) {
            super::check(&plan)?;
        }
        check_objects(&graph, &plan)?;
        let kernels = self.kernels(&graph, &plan, options)?;
        self.allocate(&plan)?;
        self.stage(&graph, &plan)?;
        let capacity = plan.passes.len() as u32 + 1;
        if self.timestamps.as_ref().is_none_or(|pool| pool.capacity() < capacity) {
            self.timestamps = Some(TimestampPool::new(&self.device, "pass times", capacity)?);
        }
        let rates: Vec<Option<f64>> =
            plan.passes.iter().map(|pass| self.rates.get(&rate_key(pass)).copied()).collect();
        let mut transients = self.objects.iter();
        let objects: Vec<Object> = (plan.resources.iter().zip(&graph.resources))
            .map(|(planned, decl)| match planned.placement.and_then(|_| transients.next()) {
                Some((_, object)) => object.clone(),
                None => decl.object.clone(),
            })
            .collect();
        let mut frame = Frame {
            device: &self.device,
            timestamps: self.timestamps.as_mut().expect("made above"),
            plan: &plan,
            objects: &objects,
            options,
            measured: rates.iter().map(|&rate| Measured::new(rate)).collect(),
            weights: weights(&plan, &rates),
            commands: None,
            intervals: Vec::new(),
            expected: 0.0,
            submits: 0,
            whole: (!options.pass_times && rates.iter().all(Option::is_some)).then_some(0.0),
            last_work: plan
                .passes
                .iter()
                .rposition(|pass| !matches!(graph.passes[pass.recorded].work, Work::Readback { .. })),
        };
        for (p, pass) in plan.passes.iter().enumerate() {
            if let Some(barrier) = &pass.barrier {
                frame.barrier(barrier)?;
            }
            match (&mut graph.passes[pass.recorded].work, &kernels[p]) {
                (Work::Kernel(work), Some(kernel)) => frame.kernel(p, kernel, work)?,
                (Work::Raw(record), _) => {
                    let record = record.take().expect("each pass is recorded once");
                    frame.whole(p, raw::PipelineStageFlags2::ALL_COMMANDS, |frame, command_buffer| {
                        record(&RawContext { frame, graph: graph.id, command_buffer });
                    })?;
                }
                (work, _) => {
                    let (up, down, tickets) = (&self.uploads, &self.readbacks, &graph.tickets);
                    let (staging, at) = match work {
                        Work::Upload { at, .. } => (up.as_ref(), *at),
                        Work::Readback { ticket, .. } => (down.as_ref(), tickets[*ticket].start),
                        _ => (None, 0),
                    };
                    frame.whole(p, raw::PipelineStageFlags2::ALL_TRANSFER, |frame, cmd| {
                        frame.transfer(cmd, work, staging.map_or(raw::Buffer::null(), vk::Buffer::raw), at);
                    })?;
                }
            }
        }
        frame.flush()?;
        let Frame { measured, submits, whole, last_work, .. } = frame;
        for (pass, measured) in plan.passes.iter().zip(&measured) {
            if let Some(rate) = measured.mean_rate() {
                self.rates.insert(rate_key(pass), rate);
            }
        }
        let mapped =
            self.readbacks.as_ref().map(vk::Buffer::mapped).transpose()?.flatten().unwrap_or_default();
        let contents = |range: &Range<u64>| Some(mapped[range.start as usize..range.end as usize].to_vec());
        let contents = graph.tickets.iter().map(contents).collect();
        for staging in [&mut self.uploads, &mut self.readbacks] {
            staging.take_if(|buffer| buffer.size() > KEPT_STAGING);
        }
        let timed = self.device.info().timestamps;
        let sum = || {
            let readback =
                |p: &usize| matches!(graph.passes[plan.passes[*p].recorded].work, Work::Readback { .. });
            let work = (0..last_work.map_or(0, |last| last + 1)).filter(|p| !readback(p));
            work.map(|p| measured[p].ms).sum()
        };
        let device_ms = timed.then(|| whole.unwrap_or_else(sum));
        let passes = plan.passes.iter().zip(&measured).map(|(pass, measured)| PassTime {
            path: pass.path.clone(),
            ms: (timed && whole.is_none()).then_some(measured.ms),
            bands: measured.bands,
        });
        Ok(Run {
            passes: passes.collect(),
            culled: plan.culled.clone(),
            transient_bytes: plan.transient_bytes,
            unaliased_bytes: plan.unaliased_bytes,
            plan,
            device_ms,
            submits,
            graph: graph.id,
            contents,
        })
    }

    /// What the kernels of a plan are bound with, by pass.
    fn kernels(
        &self,
        graph: &Graph,
        plan: &Plan,
        options: &RunOptions<'_>,
    ) -> Result<Vec<Option<Kernel>>, Error> {
        let kernel = |pass: &PlannedPass| {
            let Work::Kernel(work) = &graph.passes[pass.recorded].work else { return Ok(None) };
            let scene = options.scene.filter(|_| work.code.uses_scene);
            let wrong = match scene {
                None if work.code.uses_scene => "uses the scene, and the run has none".to_owned(),
                Some(set) if set.backend() != self.backend => {
                    format!("runs with {:?}, the scene is for {:?}", self.backend, set.backend())
                }
                _ => {
                    let pipeline = self.pipelines.get(&work.code, &work.spec, self.backend)?;
                    return Ok(Some(Kernel { pipeline, scene: scene.map(SceneSet::raw) }));
                }
            };
            Err(Mistake::new(wrong).in_shader(&work.code.name).in_pass(&pass.path).into())
        };
        plan.passes.iter().map(kernel).collect()
    }

    /// Makes the transients of a plan, unless the last run left the same ones.
    fn allocate(&mut self, plan: &Plan) -> Result<(), Error> {
        let wanted = || plan.resources.iter().filter_map(|r| r.placement.map(|placement| (r, placement)));
        let same =
            wanted().map(|(r, placement)| (r.desc, placement)).eq(self.objects.iter().map(|(key, _)| *key));
        if same && self.heaps.len() == plan.heaps.len() {
            return Ok(());
        }
        // Each run waits for its end, so nothing here is in flight.
        self.objects.clear();
        let fits = |(have, _): &(super::Heap, vk::Heap), want: &super::Heap| {
            have.memory_type_bits == want.memory_type_bits && (want.size..=2 * want.size).contains(&have.size)
        };
        if self.heaps.len() != plan.heaps.len()
            || !self.heaps.iter().zip(&plan.heaps).all(|(h, w)| fits(h, w))
        {
            self.heaps.clear();
            for heap in &plan.heaps {
                let memory = self.device.heap("transients", heap.size, heap.memory_type_bits)?;
                self.heaps.push((heap.clone(), memory));
            }
        }
        for (resource, placement) in wanted() {
            let (heap, name) = (&self.heaps[placement.heap].1, &resource.name);
            let object = match resource.desc {
                Desc::Buffer(desc) => {
                    Object::Buffer(self.device.buffer_in(heap, placement.offset, desc.size, name)?.into())
                }
                Desc::Image(desc) => Object::Image(
                    self.device.image_in(heap, placement.offset, desc.extent, desc.format, name)?.into(),
                ),
                Desc::Scene => continue,
            };
            self.objects.push(((resource.desc, placement), object));
        }
        Ok(())
    }

    /// Makes room for what passes between host and device, and fills the part that goes up.
    fn stage(&mut self, graph: &Graph, plan: &Plan) -> Result<(), Error> {
        let staging = [
            (&mut self.uploads, graph.upload_bytes, MemoryKind::Upload, "uploads"),
            (&mut self.readbacks, graph.readback_bytes, MemoryKind::Readback, "readbacks"),
        ];
        for (buffer, size, kind, name) in staging {
            if buffer.as_ref().map_or(0, vk::Buffer::size) < size {
                *buffer = None;
                *buffer = Some(self.device.buffer(name, size, kind)?);
            }
        }
        let mut mapped = self.uploads.as_mut().and_then(vk::Buffer::mapped_mut);
        for pass in &plan.passes {
            if let (Work::Upload { at, bytes, .. }, Some(mapped)) =
                (&graph.passes[pass.recorded].work, &mut mapped)
            {
                mapped[*at as usize..][..bytes.len()].copy_from_slice(bytes);
            }
        }
        Ok(())
    }
}

/// Refuses imports that are only declared.
fn check_objects(graph: &Graph, plan: &Plan) -> Result<(), Mistake> {
    for (planned, decl) in plan.resources.iter().zip(&graph.resources) {
        let declared = planned.imported && planned.desc != Desc::Scene && matches!(decl.object, Object::None);
        if declared && planned.lifetime.is_some() {
            return Err(Mistake::new(format!(
                "`{}` is declared and not imported; it cannot run",
                planned.name
            )));
        }
    }
    Ok(())
}

/// Share of each pass in the whole, by time where all are known.
fn weights(plan: &Plan, rates: &[Option<f64>]) -> Vec<f64> {
    let ms = plan.passes.iter().zip(rates).map(|(pass, rate)| rate.map(|rate| rate * groups_of(pass)));
    let weights: Vec<f64> = ms.collect::<Option<_>>().unwrap_or_else(|| vec![1.0; plan.passes.len()]);
    let sum = weights.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    weights.into_iter().map(|weight| weight / sum).collect()
}

/// Workgroups of a pass; 1 where it is not split by them.
fn groups_of(pass: &PlannedPass) -> f64 {
    pass.groups.map_or(1.0, |groups| groups.iter().map(|&g| f64::from(g)).product())
}

/// A kernel ready to be bound.
struct Kernel {
    pipeline: Arc<Pipeline>,
    scene: Option<raw::DescriptorSet>,
}

/// What is known of a pass while it runs.
struct Measured {
    ms: f64,
    /// Workgroups that have run, or 1 for the whole of a pass that is not split.
    groups: f64,
    bands: u32,
    /// Milliseconds a workgroup took last.
    rate: Option<f64>,
    /// Most workgroups of the next band.
    limit: f64,
}

impl Measured {
    fn new(rate: Option<f64>) -> Self {
        Self { ms: 0.0, groups: 0.0, bands: 0, rate, limit: f64::INFINITY }
    }

    fn add(&mut self, ms: f64, groups: f64) {
        if self.rate.is_none() || self.limit.is_finite() {
            self.limit = GROWTH * groups;
        }
        // A clock too coarse must not make a workgroup free.
        self.rate = Some(ms.max(1e-6) / groups);
        self.ms += ms;
        self.groups += groups;
    }

    fn mean_rate(&self) -> Option<f64> {
        (self.groups > 0.0).then(|| self.ms.max(1e-6) / self.groups)
    }
}

/// The part of a pass that one submit holds.
struct Interval {
    pass: usize,
    groups: f64,
}

/// A run in progress.
struct Frame<'f> {
    device: &'f vk::Device,
    timestamps: &'f mut TimestampPool,
    plan: &'f Plan,
    objects: &'f [Object],
    options: &'f RunOptions<'f>,
    measured: Vec<Measured>,
    weights: Vec<f64>,
    /// Recorded and not yet submitted.
    commands: Option<CommandBuffer>,
    intervals: Vec<Interval>,
    /// Milliseconds it should take.
    expected: f64,
    submits: u32,
    /// Milliseconds so far where passes are not timed one by one.
    whole: Option<f64>,
    /// The last pass that is no readback.
    last_work: Option<usize>,
}

impl Frame<'_> {
    fn buffer(&self, resource: u32) -> raw::Buffer {
        match &self.objects[resource as usize] {
            Object::Buffer(buffer) => buffer.raw(),
            _ => raw::Buffer::null(),
        }
    }

    fn image(&self, resource: u32) -> raw::Image {
        match &self.objects[resource as usize] {
            Object::Image(image) => image.raw(),
            _ => raw::Image::null(),
        }
    }

    /// The command buffer being recorded. The first of a run waits for all earlier work on the device and
    /// gives new imports their layout.
    fn commands(&mut self) -> Result<raw::CommandBuffer, Error> {
        if let Some(commands) = &self.commands {
            return Ok(commands.raw());
        }
        let commands = self.device.commands("graph")?;
        let cmd = commands.raw();
        if self.submits == 0 {
            let fresh: Vec<raw::ImageMemoryBarrier2<'_>> = self
                .new_imports()
                .map(|image| {
                    layout_barrier(
                        image.raw(),
                        raw::PipelineStageFlags2::ALL_COMMANDS,
                        raw::AccessFlags2::MEMORY_WRITE,
                    )
                    .dst_stage_mask(raw::PipelineStageFlags2::ALL_COMMANDS)
                })
                .collect();
            let all = [raw::MemoryBarrier2::default()
                .src_stage_mask(raw::PipelineStageFlags2::ALL_COMMANDS)
                .src_access_mask(raw::AccessFlags2::MEMORY_WRITE)
                .dst_stage_mask(raw::PipelineStageFlags2::ALL_COMMANDS)
                .dst_access_mask(raw::AccessFlags2::MEMORY_READ | raw::AccessFlags2::MEMORY_WRITE)];
            let info = raw::DependencyInfo::default().memory_barriers(&all).image_memory_barriers(&fresh);
            // SAFETY: `cmd` is being recorded, and the images live as long as the graph.
            unsafe { self.device.raw().cmd_pipeline_barrier2(cmd, &info) };
        }
        self.commands = Some(commands);
        Ok(cmd)
    }

    /// Imported images that no graph has used before.
    fn new_imports(&self) -> impl Iterator<Item = &vk::Image> {
        self.plan.resources.iter().zip(self.objects).filter_map(|(planned, object)| match object {
            Object::Image(image) if planned.imported && planned.lifetime.is_some() && !image.is_general() => {
                Some(&**image)
            }
            _ => None,
        })
    }

    fn barrier(&mut self, barrier: &Barrier) -> Result<(), Error> {
        let cmd = self.commands()?;
        let (before, after) = (stage_flags(barrier.before), stage_flags(barrier.after));
        let written = if barrier.memory { raw::AccessFlags2::MEMORY_WRITE } else { raw::AccessFlags2::NONE };
        let used = raw::AccessFlags2::MEMORY_READ | raw::AccessFlags2::MEMORY_WRITE;
        let memory = [raw::MemoryBarrier2::default()
            .src_stage_mask(before)
            .src_access_mask(written)
            .dst_stage_mask(after)
            .dst_access_mask(if barrier.memory { used } else { raw::AccessFlags2::NONE })];
        let images: Vec<raw::ImageMemoryBarrier2<'_>> = (barrier.initialise.iter())
            .map(|&image| layout_barrier(self.image(image as u32), before, written).dst_stage_mask(after))
            .collect();
        let memory = if barrier.before.is_empty() { &[] } else { memory.as_slice() };
        let info = raw::DependencyInfo::default().memory_barriers(memory).image_memory_barriers(&images);
        // SAFETY: `cmd` is being recorded, and the images live as long as the executor.
        unsafe { self.device.raw().cmd_pipeline_barrier2(cmd, &info) };
        Ok(())
    }

    /// Records a part of a pass between its timestamps.
    fn record(
        &mut self,
        p: usize,
        groups: f64,
        stage: raw::PipelineStageFlags2,
        record: impl FnOnce(&Self, raw::CommandBuffer),
    ) -> Result<(), Error> {
        let cmd = self.commands()?;
        let interval = self.intervals.len() as u32;
        self.device.begin_label(cmd, &self.plan.passes[p].path);
        match self.whole {
            None => self.timestamps.begin(cmd, interval, stage),
            Some(_) if interval == 0 => {
                self.timestamps.begin(cmd, 0, raw::PipelineStageFlags2::ALL_COMMANDS);
            }
            Some(_) => {}
        }
        record(self, cmd);
        match self.whole {
            None => self.timestamps.end(cmd, interval, stage),
            Some(_) if Some(p) == self.last_work => self.end_whole(cmd),
            Some(_) => {}
        }
        self.device.end_label(cmd);
        self.intervals.push(Interval { pass: p, groups });
        self.measured[p].bands += 1;
        self.expected += groups * self.measured[p].rate.unwrap_or(0.0);
        Ok(())
    }

    fn end_whole(&self, cmd: raw::CommandBuffer) {
        self.timestamps.end(cmd, 0, raw::PipelineStageFlags2::ALL_COMMANDS);
    }

    /// Keeps a part of unknown length apart from the rest where only whole submits can be timed.
    fn before_unknown(&mut self) -> Result<(), Error> {
        if self.device.info().timestamps { Ok(()) } else { self.flush() }
    }

    /// A pass in one piece.
    fn whole(
        &mut self,
        p: usize,
        stage: raw::PipelineStageFlags2,
        record: impl FnOnce(&Self, raw::CommandBuffer),
    ) -> Result<(), Error> {
        let rate = self.measured[p].rate;
        match rate {
            Some(ms) if self.expected > 0.0 && self.expected + ms > self.options.submit_ms => self.flush()?,
            Some(_) => {}
            None => self.before_unknown()?,
        }
        self.record(p, 1.0, stage, record)?;
        if rate.is_none() { self.flush() } else { Ok(()) }
    }

    /// A kernel in bands of workgroups, each as long as a submit may be.
    fn kernel(&mut self, p: usize, kernel: &Kernel, work: &KernelWork) -> Result<(), Error> {
        let stage = raw::PipelineStageFlags2::COMPUTE_SHADER;
        let groups = match work.dispatch {
            Dispatch::Groups(groups) => groups,
            Dispatch::Indirect { buffer, offset } => {
                return self.whole(p, stage, |frame, cmd| {
                    frame.bind(cmd, kernel, work);
                    let device = frame.device.raw();
                    // SAFETY: the graph checked that the buffer holds the arguments, and a barrier made them
                    // visible; the pipeline and its resources are bound.
                    unsafe {
                        // lavapipe (up to Mesa 25.0 at least) adds the base of the dispatch before to an indirect one.
                        device.cmd_dispatch_base(cmd, 0, 0, 0, 0, 0, 0);
                        device.cmd_dispatch_indirect(cmd, frame.buffer(buffer), offset);
                    }
                });
            }
        };
        let mut rest = Bands::new(groups);
        while rest.left() > 0.0 {
            let Measured { rate, limit, .. } = self.measured[p];
            let want = match rate {
                None => {
                    self.before_unknown()?;
                    rest.left() * PROBE
                }
                Some(rate) => {
                    let room = (self.options.submit_ms - self.expected) / rate;
                    if rest.left() > room && self.expected > 0.0 {
                        self.flush()?;
                        continue;
                    }
                    room.min(limit)
                }
            };
            let (base, count) = rest.next(want);
            let size = count.iter().map(|&n| f64::from(n)).product();
            self.record(p, size, stage, |frame, cmd| {
                frame.bind(cmd, kernel, work);
                let ([x, y, z], [nx, ny, nz]) = (base, count);
                // SAFETY: the pipeline was made for base workgroups, its resources are bound, and the grid is
                // within the limits that planning checked.
                unsafe { frame.device.raw().cmd_dispatch_base(cmd, x, y, z, nx, ny, nz) };
            })?;
            if rate.is_none() || rest.left() > 0.0 {
                self.flush()?;
            }
        }
        Ok(())
    }

    fn bind(&self, cmd: raw::CommandBuffer, kernel: &Kernel, work: &KernelWork) {
        let (device, layout) = (self.device.raw(), kernel.pipeline.layout());
        let point = raw::PipelineBindPoint::COMPUTE;
        let infos: Vec<(raw::DescriptorBufferInfo, raw::DescriptorImageInfo)> = (work.bound.iter())
            .map(|&resource| match &self.objects[resource as usize] {
                Object::Buffer(buffer) => (buffer.descriptor(), raw::DescriptorImageInfo::default()),
                Object::Image(image) => {
                    let info = raw::DescriptorImageInfo::default()
                        .image_view(image.view())
                        .image_layout(raw::ImageLayout::GENERAL);
                    (raw::DescriptorBufferInfo::default(), info)
                }
                Object::None => Default::default(),
            })
            .collect();
        let writes: Vec<raw::WriteDescriptorSet<'_>> = (work.code.bindings.iter().zip(&infos))
            .map(|(binding, (buffer, image))| {
                let write = raw::WriteDescriptorSet::default()
                    .dst_binding(binding.binding)
                    .descriptor_type(binding.descriptor_type());
                match binding.kind {
                    BindingKind::Buffer { .. } => write.buffer_info(std::slice::from_ref(buffer)),
                    BindingKind::Image(_) => write.image_info(std::slice::from_ref(image)),
                }
            })
            .collect();
        // SAFETY: `cmd` is being recorded; pipeline, resources and scene live until the run has waited; the graph
        // checked that resources and parameters are those of the kernel the layout was made from.
        unsafe {
            device.cmd_bind_pipeline(cmd, point, kernel.pipeline.raw());
            if let Some(scene) = kernel.scene {
                device.cmd_bind_descriptor_sets(cmd, point, layout, 0, &[scene], &[]);
            }
            if !writes.is_empty() {
                self.device.push_descriptor().cmd_push_descriptor_set(cmd, point, layout, 1, &writes);
            }
            if !work.params.is_empty() {
                device.cmd_push_constants(cmd, layout, raw::ShaderStageFlags::COMPUTE, 0, &work.params);
            }
        }
    }

    fn transfer(&self, cmd: raw::CommandBuffer, work: &Work, staging: raw::Buffer, at: u64) {
        let device = self.device.raw();
        let general = raw::ImageLayout::GENERAL;
        let layers =
            raw::ImageSubresourceLayers::default().aspect_mask(raw::ImageAspectFlags::COLOR).layer_count(1);
        let extent = |resource: u32| match &self.objects[resource as usize] {
            Object::Image(image) => {
                let [width, height] = image.extent();
                raw::Extent3D { width, height, depth: 1 }
            }
            _ => raw::Extent3D::default(),
        };
        let texels = |resource| {
            [raw::BufferImageCopy::default()
                .buffer_offset(at)
                .image_subresource(layers)
                .image_extent(extent(resource))]
        };
        let is_image = |resource: u32| matches!(self.objects[resource as usize], Object::Image(_));
        let bytes = |src_offset, dst_offset, size| [raw::BufferCopy { src_offset, dst_offset, size }];
        // SAFETY: `cmd` is being recorded, all objects live until the run has waited, the graph checked that
        // offsets and sizes are inside of them, and every image is in the general layout.
        unsafe {
            match *work {
                Work::Fill { buffer, value } => {
                    let size = self.plan.resources[buffer as usize].desc.bytes();
                    device.cmd_fill_buffer(cmd, self.buffer(buffer), 0, size, value);
                }
                Work::Clear { image } => {
                    let (zero, all) = (raw::ClearColorValue::default(), [vk::COLOR_RANGE]);
                    device.cmd_clear_color_image(cmd, self.image(image), general, &zero, &all);
                }
                Work::Upload { to, .. } if is_image(to) => {
                    device.cmd_copy_buffer_to_image(cmd, staging, self.image(to), general, &texels(to));
                }
                Work::Upload { to, bytes: ref data, .. } => {
                    if !data.is_empty() {
                        device.cmd_copy_buffer(
                            cmd,
                            staging,
                            self.buffer(to),
                            &bytes(at, 0, data.len() as u64),
                        );
                    }
                }
                Work::CopyBuffer { from, from_offset, to, to_offset, size } => {
                    let region = bytes(from_offset, to_offset, size);
                    device.cmd_copy_buffer(cmd, self.buffer(from), self.buffer(to), &region);
                }
                Work::CopyImage { from, to } => {
                    let region = [raw::ImageCopy::default()
                        .src_subresource(layers)
                        .dst_subresource(layers)
                        .extent(extent(from))];
                    device.cmd_copy_image(cmd, self.image(from), general, self.image(to), general, &region);
                }
                Work::Readback { from, .. } if is_image(from) => {
                    device.cmd_copy_image_to_buffer(cmd, self.image(from), general, staging, &texels(from));
                }
                Work::Readback { from, .. } => {
                    let size = self.plan.resources[from as usize].desc.bytes();
                    device.cmd_copy_buffer(cmd, self.buffer(from), staging, &bytes(0, at, size));
                }
                Work::Kernel(_) | Work::Raw(_) => {}
            }
        }
    }

    /// Submits what was recorded, waits for it and reads its times.
    fn flush(&mut self) -> Result<(), Error> {
        let Some(commands) = self.commands.take() else { return Ok(()) };
        let intervals = std::mem::take(&mut self.intervals);
        // A submit that ends before the last pass of all ends its time here; one behind it is not timed.
        let last = intervals.last().map(|interval| interval.pass);
        let first = intervals.first().map(|interval| interval.pass);
        let timed = self.whole.is_some() && first.is_some() && first <= self.last_work;
        if timed && last < self.last_work {
            self.end_whole(commands.raw());
        }
        if self.options.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed)) {
            return Err(Error::Cancelled);
        }
        self.device.memory_barrier(
            commands.raw(),
            (raw::PipelineStageFlags2::ALL_COMMANDS, raw::AccessFlags2::MEMORY_WRITE),
            (raw::PipelineStageFlags2::HOST, raw::AccessFlags2::HOST_READ),
        );
        let begun = Instant::now();
        self.device.submit(commands)?.wait()?;
        let wall_ms = begun.elapsed().as_secs_f64() * 1e3;
        self.submits += 1;
        self.new_imports().for_each(vk::Image::set_general);
        self.expected = 0.0;
        let times = match self.whole {
            None => self.timestamps.nanoseconds(intervals.len() as u32)?,
            Some(sum) => {
                let span = if timed { self.timestamps.nanoseconds(1)? } else { None };
                self.whole = Some(sum + span.map_or(0.0, |ns| ns[0] as f64 * 1e-6));
                None
            }
        };
        self.timestamps.reset();
        for (i, interval) in intervals.iter().enumerate().filter(|_| self.whole.is_none()) {
            let ms = match &times {
                Some(times) => times[i] as f64 * 1e-6,
                None if intervals.len() == 1 => wall_ms,
                None => interval.groups * self.measured[interval.pass].rate.unwrap_or(0.0),
            };
            self.measured[interval.pass].add(ms, interval.groups);
        }
        if let (Some(progress), Some(last)) = (self.options.progress, intervals.last()) {
            let share = |p: usize| (self.measured[p].groups / groups_of(&self.plan.passes[p])).min(1.0);
            let done =
                self.weights.iter().enumerate().map(|(p, weight)| weight * share(p)).sum::<f64>().min(1.0);
            progress(Progress { pass: &self.plan.passes[last.pass].path, done });
        }
        Ok(())
    }
}

fn stage_flags(stages: Stages) -> raw::PipelineStageFlags2 {
    type S = raw::PipelineStageFlags2;
    if stages == Stages::ALL {
        return S::ALL_COMMANDS;
    }
    let flags = [
        (Stages::COMPUTE, S::COMPUTE_SHADER),
        (Stages::TRANSFER, S::ALL_TRANSFER),
        (Stages::INDIRECT, S::DRAW_INDIRECT),
    ];
    flags.iter().filter(|(stage, _)| stages.contains(*stage)).fold(S::NONE, |all, (_, flag)| all | *flag)
}

/// From an undefined layout to the one all images stay in, with the second stages still to be set.
fn layout_barrier(
    image: raw::Image,
    before: raw::PipelineStageFlags2,
    written: raw::AccessFlags2,
) -> raw::ImageMemoryBarrier2<'static> {
    raw::ImageMemoryBarrier2::default()
        .src_stage_mask(before)
        .src_access_mask(written)
        .dst_access_mask(raw::AccessFlags2::MEMORY_READ | raw::AccessFlags2::MEMORY_WRITE)
        .old_layout(raw::ImageLayout::UNDEFINED)
        .new_layout(raw::ImageLayout::GENERAL)
        .src_queue_family_index(raw::QUEUE_FAMILY_IGNORED)
        .dst_queue_family_index(raw::QUEUE_FAMILY_IGNORED)
        .image(image)
        .subresource_range(vk::COLOR_RANGE)
}

/// A grid of workgroups, cut into rectangles of whole rows, or of parts of one row.
struct Bands {
    groups: [u32; 3],
    /// First workgroup in x and y that is left.
    at: [u32; 2],
}

impl Bands {
    fn new(groups: [u32; 3]) -> Self {
        let none = groups.contains(&0);
        Self { groups, at: [0, if none { groups[1] } else { 0 }] }
    }

    fn left(&self) -> f64 {
        let [x, y, z] = self.groups.map(f64::from);
        let [at_x, at_y] = self.at.map(f64::from);
        ((y - at_y) * x - at_x) * z
    }

    /// The first workgroup and the number of them of about `want` workgroups, at least one; some must be left.
    fn next(&mut self, want: f64) -> ([u32; 3], [u32; 3]) {
        let [x, y, z] = self.groups;
        let [at_x, at_y] = self.at;
        let (base, columns) = ([at_x, at_y, 0], want / f64::from(z));
        let rows = (columns / f64::from(x)) as u32;
        if at_x == 0 && rows >= 1 {
            let rows = rows.min(y - at_y);
            self.at[1] += rows;
            return (base, [x, rows, z]);
        }
        let columns = (columns as u32).clamp(1, x - at_x);
        self.at = if at_x + columns == x { [0, at_y + 1] } else { [at_x + columns, at_y] };
        (base, [columns, 1, z])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn bands_cover_each_workgroup_once(
            x in 0_u32..9, y in 0_u32..9, z in 0_u32..4,
            wants in proptest::collection::vec(0.0_f64..60.0, 1..20),
        ) {
            let mut rest = Bands::new([x, y, z]);
            let mut seen = vec![0; (x * y * z) as usize];
            let mut wants = wants.iter().cycle();
            while rest.left() > 0.0 {
                let want = *wants.next().expect("endless");
                let before = rest.left();
                let (base, count) = rest.next(want);
                let size: u32 = count.iter().product();
                prop_assert!(size > 0);
                prop_assert!(f64::from(size) <= want.max(f64::from(z)));
                prop_assert_eq!(before - rest.left(), f64::from(size));
                for k in 0..count[2] {
                    for j in 0..count[1] {
                        for i in 0..count[0] {
                            let at = ((base[2] + k) * y + base[1] + j) * x + base[0] + i;
                            seen[at as usize] += 1;
                        }
                    }
                }
            }
            prop_assert!(seen.iter().all(|&n| n == 1));
        }
    }

    #[test]
    fn raw_passes_record_their_own_commands() {
        let Some((_guard, device)) = crate::common::device() else { return };
        let mut g = Graph::new();
        let (filled, copy) = (g.buffer("filled", 8), g.buffer("copy", 8));
        let image = g.image("image", ImageDesc::new([2, 1], vk::Format::R32Uint));
        g.raw(
            "fill",
            &[(filled.into(), vk::Access::Write), (image.into(), vk::Access::Write)],
            move |context| {
                let (cmd, buffer, (texels, _)) =
                    (context.command_buffer(), context.buffer(filled), context.image(image));
                let seven = raw::ClearColorValue { uint32: [7; 4] };
                // SAFETY: the command buffer is being recorded, and the pass declares both writes.
                unsafe {
                    context.device().cmd_fill_buffer(cmd, buffer, 0, 8, 5);
                    let range = [vk::COLOR_RANGE];
                    let general = raw::ImageLayout::GENERAL;
                    context.device().cmd_clear_color_image(cmd, texels, general, &seven, &range);
                }
            },
        );
        g.copy_buffer("copy", (filled, 0), (copy, 0), 8);
        let (bytes, texels) = (g.read_buffer::<u32>(copy), g.read_image::<u32>(image));
        let mut executor = Executor::new(&device, Backend::Software).unwrap();
        let mut run = executor.run(g, &RunOptions::default()).unwrap();
        assert_eq!(run.take(bytes), [5, 5]);
        assert_eq!(run.take(texels), [7, 7]);
    }

    #[test]
    fn an_unknown_pass_grows_by_steps_until_it_has_run() {
        let mut unknown = Measured::new(None);
        unknown.add(1.0, 10.0);
        assert_eq!((unknown.rate, unknown.limit), (Some(0.1), 80.0));
        unknown.add(0.0, 80.0);
        assert!(unknown.rate.is_some_and(|rate| rate > 0.0));
        assert_eq!(unknown.limit, 640.0);
        let mut known = Measured::new(Some(0.5));
        known.add(1.0, 10.0);
        assert_eq!((known.rate, known.limit), (Some(0.1), f64::INFINITY));
        assert_eq!(known.mean_rate(), Some(0.1));
    }
}
