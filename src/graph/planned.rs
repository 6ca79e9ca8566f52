//! A plan: what runs, in which memory, behind which barriers.

use super::{
    place::{Heap, Placement},
    resource::Desc,
    stages::Stages,
};
use serde::Serialize;

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
    pub(super) fn begins(&self, p: usize) -> bool {
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
    /// Values of the kernel's specialization constants, bits, in its order.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub constants: Vec<u32>,
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
