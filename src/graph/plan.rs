//! From declarations to a plan, in phases: validate, cull, lifetimes, place, barriers.

use super::{
    Desc, ImageDesc, Mistake, Stages,
    decl::{Dispatch, Graph, Work},
    place::{self, Item},
};
use crate::vk::BindingKind;
use serde::Serialize;

/// What a device asks of the memory of a resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memory {
    /// Bytes.
    pub size: u64,
    /// Of the offset, in bytes, a power of two. Where all keep to theirs, with sizes rounded up to it, buffers
    /// and images are as far apart as the device asks.
    pub alignment: u64,
    /// The memory types that will do, one bit each.
    pub memory_type_bits: u32,
}

/// The limits of a device that planning respects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Workgroups of a dispatch in x, y and z.
    pub max_groups: [u32; 3],
    /// Bytes of a storage buffer binding.
    pub max_storage_buffer_range: u64,
    /// Bytes of a buffer.
    pub max_buffer: u64,
    /// Texels along a side of an image.
    pub max_image_side: u32,
    /// Bytes of one allocation.
    pub max_allocation: u64,
}

/// What a plan needs to know of a device.
pub trait Requirements {
    /// Memory of a buffer of `size` bytes.
    fn buffer(&self, size: u64) -> Memory;
    /// Memory of an image.
    fn image(&self, desc: ImageDesc) -> Memory;
    /// Limits.
    fn limits(&self) -> Limits;
}

/// A common device, for plans where there is none at hand.
#[derive(Clone, Copy, Debug, Default)]
pub struct Typical;

impl Requirements for Typical {
    fn buffer(&self, size: u64) -> Memory {
        Memory { size, alignment: 256, memory_type_bits: 1 }
    }

    fn image(&self, desc: ImageDesc) -> Memory {
        Memory { size: desc.bytes(), alignment: 4096, memory_type_bits: 1 }
    }

    fn limits(&self) -> Limits {
        Limits {
            max_groups: [65535; 3],
            max_storage_buffer_range: 1 << 27,
            max_buffer: 1 << 30,
            max_image_side: 16384,
            max_allocation: 1 << 30,
        }
    }
}

/// Memory that transients share.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Heap {
    /// Bytes.
    pub size: u64,
    /// The memory types that suit all that lies in it, one bit each.
    pub memory_type_bits: u32,
}

/// Where a transient lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Placement {
    /// Index in [`Plan::heaps`].
    pub heap: usize,
    /// Bytes from the heap's start.
    pub offset: u64,
    /// Bytes, with padding to the alignment.
    pub size: u64,
}

impl Placement {
    /// Whether some byte belongs to both.
    #[must_use]
    pub fn overlaps(&self, other: &Self) -> bool {
        self.heap == other.heap
            && self.offset < other.offset + other.size
            && other.offset < self.offset + self.size
    }
}

/// A resource as planned.
#[derive(Clone, Debug, Serialize)]
pub struct PlannedResource {
    /// As declared; names may repeat.
    pub name: String,
    /// What it is.
    pub desc: Desc,
    /// Whether its contents outlive the graph.
    pub imported: bool,
    /// The first and the last pass of [`Plan::passes`] that touches it, if one does.
    pub lifetime: Option<[usize; 2]>,
    /// Where it lies, if it is a transient that some pass touches.
    pub placement: Option<Placement>,
}

impl PlannedResource {
    /// Whether pass `p` is the first that touches it.
    fn begins(&self, p: usize) -> bool {
        self.lifetime.is_some_and(|[first, _]| first == p)
    }
}

/// One resource a pass touches.
#[derive(Clone, Debug, Serialize)]
pub struct PlannedAccess {
    /// Index in [`Plan::resources`].
    pub resource: usize,
    /// The shader's variable, or what a transfer calls its operand.
    pub variable: String,
    /// Where in the pipeline.
    pub stages: Stages,
    /// Whether earlier contents are read.
    pub reads: bool,
    /// Whether contents change.
    pub writes: bool,
}

/// What precedes a pass: one `vkCmdPipelineBarrier2`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Barrier {
    /// Stages of earlier passes that must have ended. Empty where only images are initialised that share
    /// their memory with nothing earlier.
    pub before: Stages,
    /// Stages of this and later passes that wait.
    pub after: Stages,
    /// Whether writes in `before` are made available and visible to `after`; else it only orders.
    pub memory: bool,
    /// Images whose first use this is (indices in [`Plan::resources`]): their layout becomes `GENERAL` and
    /// their contents undefined.
    pub initialise: Vec<usize>,
}

/// A pass that runs.
#[derive(Clone, Debug, Serialize)]
pub struct PlannedPass {
    /// Names of its groups and its own, joined by `/`; a repeated path ends in `#2`, `#3`, ….
    pub path: String,
    /// `kernel`, `transfer`, `readback` or `raw`.
    pub kind: &'static str,
    /// The kernel's name.
    pub shader: Option<String>,
    /// Workgroups, if the host knows.
    pub groups: Option<[u32; 3]>,
    /// What it touches.
    pub accesses: Vec<PlannedAccess>,
    /// What precedes it, if anything must.
    pub barrier: Option<Barrier>,
    /// Its place among the passes recorded.
    #[serde(skip)]
    pub(super) recorded: usize,
}

/// A pass that does not run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Culled {
    /// Its path.
    pub path: String,
    /// Why nobody misses it.
    pub why: String,
}

/// What runs, in which memory, behind which barriers. Before the first pass all earlier work on the device
/// has ended and is visible; after the last, all is made visible to the host.
#[derive(Clone, Debug, Serialize)]
pub struct Plan {
    /// Everything declared.
    pub resources: Vec<PlannedResource>,
    /// In order of execution.
    pub passes: Vec<PlannedPass>,
    /// What was recorded and is left out.
    pub culled: Vec<Culled>,
    /// Memory of the transients.
    pub heaps: Vec<Heap>,
    /// Bytes of the heaps.
    pub transient_bytes: u64,
    /// Bytes they would have if no memory were shared.
    pub unaliased_bytes: u64,
}

pub(super) fn plan(graph: &Graph, requirements: &dyn Requirements, alias: bool) -> Result<Plan, Mistake> {
    let limits = requirements.limits();
    validate(graph, &limits)?;
    let (mut passes, culled) = cull(graph);
    let mut resources = lifetimes(graph, &passes);
    let (heaps, unaliased_bytes) = place(&mut resources, requirements, &limits, alias);
    barriers(&mut passes, &resources);
    let transient_bytes = place::total(&heaps);
    Ok(Plan { resources, passes, culled, heaps, transient_bytes, unaliased_bytes })
}

/// Returns what recording found wrong, and what this device cannot do.
fn validate(graph: &Graph, limits: &Limits) -> Result<(), Mistake> {
    if let Some(mistake) = &graph.mistake {
        return Err(mistake.clone());
    }
    for decl in graph.resources.iter().filter(|decl| !decl.imported) {
        let (bytes, max) = (decl.desc.bytes(), limits.max_buffer);
        let what = match decl.desc {
            Desc::Buffer(_) if bytes > max => {
                format!("buffer `{}` of {bytes} bytes, the device takes {max}", decl.name)
            }
            Desc::Image(desc) if desc.extent.iter().any(|&side| side > limits.max_image_side) => format!(
                "image `{}` of {}×{} texels, the device takes {} a side",
                decl.name, desc.extent[0], desc.extent[1], limits.max_image_side
            ),
            _ => continue,
        };
        return Err(Mistake::new(what));
    }
    for pass in &graph.passes {
        let Work::Kernel(kernel) = &pass.work else { continue };
        let in_pass = |mistake: Mistake| mistake.in_shader(&kernel.code.name).in_pass(&pass.path);
        if let Dispatch::Groups(groups) = kernel.dispatch
            && groups.iter().zip(limits.max_groups).any(|(&g, max)| g > max)
        {
            let what = format!("{groups:?} workgroups, the device takes {:?}", limits.max_groups);
            return Err(in_pass(Mistake::new(what).at("grid")));
        }
        for (binding, &resource) in kernel.code.bindings.iter().zip(&kernel.bound) {
            let decl = &graph.resources[resource as usize];
            let bytes = decl.desc.bytes();
            if matches!(binding.kind, BindingKind::Buffer { .. }) && bytes > limits.max_storage_buffer_range {
                let what = format!(
                    "buffer `{}` of {bytes} bytes, the device binds {}",
                    decl.name, limits.max_storage_buffer_range
                );
                return Err(in_pass(Mistake::new(what).at(&binding.name)));
            }
        }
    }
    Ok(())
}

/// Walks backwards from what is seen outside and keeps the passes it depends on.
///
/// A write is taken to change a part of its resource, so it never makes an earlier one needless.
fn cull(graph: &Graph) -> (Vec<PlannedPass>, Vec<Culled>) {
    let mut needed: Vec<bool> = graph.resources.iter().map(|resource| resource.imported).collect();
    for &kept in &graph.kept {
        needed[kept as usize] = true;
    }
    let mut kept = Vec::new();
    let mut culled = Vec::new();
    for (recorded, pass) in graph.passes.iter().enumerate().rev() {
        let writes = || pass.uses.iter().filter(|u| u.access.writes());
        if matches!(pass.work, Work::Readback { .. } | Work::Raw(_))
            || writes().any(|u| needed[u.resource as usize])
        {
            for read in pass.uses.iter().filter(|u| u.access.reads()) {
                needed[read.resource as usize] = true;
            }
            kept.push(planned(pass, recorded));
        } else {
            let names: Vec<String> =
                writes().map(|u| format!("`{}`", graph.resources[u.resource as usize].name)).collect();
            let why = if names.is_empty() {
                "it writes nothing".into()
            } else {
                format!("{} reaches no readback, tap, import or kept resource from here", names.join(", "))
            };
            culled.push(Culled { path: pass.path.clone(), why });
        }
    }
    kept.reverse();
    culled.reverse();
    (kept, culled)
}

fn planned(pass: &super::decl::PassDecl, recorded: usize) -> PlannedPass {
    let (shader, groups) = match &pass.work {
        Work::Kernel(kernel) => (
            Some(kernel.code.name.clone().into_owned()),
            match kernel.dispatch {
                Dispatch::Groups(groups) => Some(groups),
                Dispatch::Indirect { .. } => None,
            },
        ),
        _ => (None, None),
    };
    let accesses = pass.uses.iter().map(|u| PlannedAccess {
        resource: u.resource as usize,
        variable: u.variable.clone().into_owned(),
        stages: u.stages,
        reads: u.access.reads(),
        writes: u.access.writes(),
    });
    PlannedPass {
        path: pass.path.clone(),
        kind: pass.work.noun(),
        shader,
        groups,
        accesses: accesses.collect(),
        barrier: None,
        recorded,
    }
}

/// Finds the first and last pass that touches each resource.
fn lifetimes(graph: &Graph, passes: &[PlannedPass]) -> Vec<PlannedResource> {
    let mut resources: Vec<PlannedResource> = (graph.resources.iter())
        .map(|decl| PlannedResource {
            name: decl.name.clone().into_owned(),
            desc: decl.desc,
            imported: decl.imported,
            lifetime: None,
            placement: None,
        })
        .collect();
    for (p, pass) in passes.iter().enumerate() {
        for access in &pass.accesses {
            resources[access.resource].lifetime.get_or_insert([p, p])[1] = p;
        }
    }
    resources
}

/// Gives each transient in use its memory.
fn place(
    resources: &mut [PlannedResource],
    requirements: &dyn Requirements,
    limits: &Limits,
    alias: bool,
) -> (Vec<Heap>, u64) {
    let mut indices = Vec::new();
    let mut items = Vec::new();
    for (index, resource) in resources.iter().enumerate() {
        if let (false, Some(lifetime)) = (resource.imported, resource.lifetime) {
            let memory = match resource.desc {
                Desc::Buffer(desc) => requirements.buffer(desc.size),
                Desc::Image(desc) => requirements.image(desc),
                Desc::Scene => continue,
            };
            indices.push(index);
            items.push(Item { memory, lifetime });
        }
    }
    let placed = place::place(&items, limits, alias);
    for (index, placement) in indices.into_iter().zip(placed.placements) {
        resources[index].placement = Some(placement);
    }
    (placed.heaps, placed.unaliased_bytes)
}

/// An access by one stage, and what the barriers since then have done for it.
#[derive(Clone, Copy, Default)]
struct Track {
    /// Stages that start after it has ended.
    ordered: Stages,
    /// For a write: it has been made available.
    available: bool,
    /// For a write: stages that see it.
    visible: Stages,
}

/// The accesses of a resource that a later one may have to wait for, by stage: the last write and the reads
/// since. Earlier ones were waited for by these.
#[derive(Clone, Default)]
struct State {
    writes: [Option<Track>; Stages::COUNT],
    reads: [Option<Track>; Stages::COUNT],
}

impl State {
    /// Adds to `barrier` what an access by `stages` still has to wait for.
    fn hazards(&self, barrier: &mut Barrier, stages: Stages, reads: bool, writes: bool) {
        let mut wait = |bit: usize, memory: bool| {
            barrier.before |= Stages::bit(bit);
            barrier.after |= stages;
            barrier.memory |= memory;
        };
        for (bit, write) in self.writes.iter().enumerate() {
            let Some(write) = write else { continue };
            if reads && !write.visible.contains(stages) {
                wait(bit, true);
            } else if writes && !(write.available && write.ordered.contains(stages)) {
                wait(bit, !write.available);
            }
        }
        for (bit, read) in self.reads.iter().enumerate() {
            if read.is_some_and(|read| writes && !read.ordered.contains(stages)) {
                wait(bit, false);
            }
        }
    }

    /// Adds what a change of layout has to wait for: it takes its turn only behind stages it names itself.
    fn before_layout(&self, barrier: &mut Barrier) {
        for (bit, (write, read)) in self.writes.iter().zip(&self.reads).enumerate() {
            if write.is_some() || read.is_some() {
                barrier.before |= Stages::bit(bit);
                barrier.memory |= write.is_some_and(|write| !write.available);
            }
        }
    }

    fn pass_barrier(&mut self, barrier: &Barrier) {
        for (bit, track) in (0..).zip(&mut self.writes).chain((0..).zip(&mut self.reads)) {
            let Some(track) = track else { continue };
            let direct = barrier.before.contains(Stages::bit(bit));
            if direct || barrier.before.intersects(track.ordered) {
                track.ordered |= barrier.after;
                track.available |= direct && barrier.memory;
                if track.available && barrier.memory {
                    track.visible |= barrier.after;
                }
            }
        }
    }

    fn touch(&mut self, stages: Stages, writes: bool) {
        if writes {
            *self = Self::default();
        }
        let tracks = if writes { &mut self.writes } else { &mut self.reads };
        for bit in stages.bits() {
            tracks[bit] = Some(Track::default());
        }
    }
}

/// Puts one merged barrier before each pass that has a hazard which no earlier barrier covers.
fn barriers(passes: &mut [PlannedPass], resources: &[PlannedResource]) {
    let mut states = vec![State::default(); resources.len()];
    let shares = sharing(resources);
    let alone = |index: usize| {
        let resource = &resources[index];
        matches!(resource.desc, Desc::Image(_)) && resource.placement.is_some() && shares[index].is_empty()
    };
    // Images that follow none in their memory get their layout before the first pass: a barrier later on would keep
    // passes apart that need not wait for each other.
    let mut barrier =
        Barrier { initialise: (0..resources.len()).filter(|&i| alone(i)).collect(), ..Barrier::default() };
    let first_uses =
        passes.iter().enumerate().flat_map(|(p, pass)| pass.accesses.iter().map(move |a| (p, a)));
    for (_, access) in first_uses.filter(|(p, a)| alone(a.resource) && resources[a.resource].begins(*p)) {
        barrier.after |= access.stages;
    }
    for (p, pass) in passes.iter_mut().enumerate() {
        for access in &pass.accesses {
            let resource = &resources[access.resource];
            states[access.resource].hazards(&mut barrier, access.stages, access.reads, access.writes);
            if resource.imported || !resource.begins(p) {
                continue;
            }
            let image = matches!(resource.desc, Desc::Image(_));
            for &other in &shares[access.resource] {
                states[other].hazards(&mut barrier, access.stages, false, true);
                if image {
                    states[other].before_layout(&mut barrier);
                }
            }
            if image && !alone(access.resource) && !barrier.initialise.contains(&access.resource) {
                barrier.initialise.push(access.resource);
                barrier.after |= access.stages;
            }
        }
        let barrier = std::mem::take(&mut barrier);
        if !barrier.after.is_empty() {
            for state in &mut states {
                state.pass_barrier(&barrier);
            }
            pass.barrier = Some(barrier);
        }
        for writes in [true, false] {
            for access in pass.accesses.iter().filter(|access| access.writes == writes) {
                states[access.resource].touch(access.stages, writes);
            }
        }
    }
}

/// For each transient, the earlier ones that lie in its memory.
fn sharing(resources: &[PlannedResource]) -> Vec<Vec<usize>> {
    let placed = |i: usize| resources[i].placement.zip(resources[i].lifetime);
    let earlier = |i: usize| {
        let Some((here, [first, _])) = placed(i) else { return Vec::new() };
        let shares =
            |&j: &usize| placed(j).is_some_and(|(there, [_, last])| last < first && here.overlaps(&there));
        (0..resources.len()).filter(shares).collect()
    };
    (0..resources.len()).map(earlier).collect()
}
