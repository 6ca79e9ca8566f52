//! The render graph: passes declare what they touch, and the graph decides what runs, in which memory and
//! behind which barriers.
//!
//! A [`Graph`] is recorded anew for every frame, needs no device and costs microseconds a pass. What is worth
//! keeping (pipelines, transient memory, the speed of each pass) lives in an [`Executor`].
//!
//! # Rules
//!
//! - Recording order is execution order. A pass's accesses come from its kernel (`readonly` reads, `writeonly`
//!   writes, neither does both) and are the only thing that orders it.
//! - A transient ([`Graph::image`], [`Graph::buffer`]) has no contents before its first write; reading it earlier
//!   is a mistake. A write may change a part of a resource and leaves the rest as it was.
//! - An import ([`Graph::import_image`], [`Graph::import_buffer`]) keeps its contents from graph to graph.
//! - A pass that reaches no readback, tap, import or [kept](Graph::keep) resource is left out and reported; raw passes always run.
//! - Hazards are tracked for whole resources. A pass has at most one barrier, merged, and only where a hazard
//!   asks for it that no earlier barrier covers: passes that are independent overlap. All images stay in the
//!   layout `GENERAL`.
//! - What a kernel reaches by device address is not tracked: a pass that writes nothing else is left out, and
//!   nothing else in the graph may read what it writes there.
//! - Transients whose lives are apart share memory. [`RunOptions::alias`] turns that off; no result changes.
//! - Kernels run in bands of workgroups, so that a submit ends in about [`RunOptions::submit_ms`]; no result
//!   changes as long as a kernel does not read `gl_NumWorkGroups`, which counts those of its band. Once a graph
//!   has run, the speed of its passes is known and a frame below that time is one submit.
//! - Names are paths ([`Graph::group`]); the times of passes roll up by them ([`Run::rollup`]).
//! - Runs follow each other on the device in the order of [`Executor::submit`], which waits for nothing: while one is
//!   at work there, the next can be recorded. [`Executor::run`] is submit and wait. A run owns what it uses until its
//!   end.
//!
//! A mistake is remembered and returned when the graph is planned or run; it names pass, shader and variable.
//!
//! # Planning
//!
//! [`Graph::plan`] is a pure function of the declarations and of a device's [`Requirements`], [`Typical`] where
//! there is none. [`check`] proves a plan right by other means than those that made it; [`Plan::dot`] and
//! [`Plan::json`] show it.
//!
//! ```
//! use parhelion::graph::{Graph, ImageDesc, Typical, check};
//! use parhelion::vk::Format;
//!
//! let mut g = Graph::new();
//! let desc = ImageDesc::new([640, 480], Format::Rgba16Float);
//! let [first, second, unused] = ["first", "second", "unused"].map(|name| g.image(name, desc));
//! g.clear_image("clear", first);
//! g.group("copies", |g| {
//!     g.copy_image("one", first, second);
//!     g.copy_image("two", second, unused);
//! });
//! let ticket = g.read_image::<u8>(second);
//!
//! let plan = g.plan(&Typical)?;
//! check(&plan).expect("the planner and the oracle agree");
//! assert_eq!(plan.culled[0].path, "copies/two");
//! println!("{}", plan.dot(&[]));
//! # let _ = ticket;
//! # Ok::<(), parhelion::graph::Error>(())
//! ```
//!
//! # Running
//!
//! ```no_run
//! use parhelion::graph::{Executor, Graph, Grid, RuntimeKernel, RunOptions};
//! use parhelion::vk::{Backend, Device, DeviceOptions};
//!
//! /// The kernel has a `writeonly buffer Squares { uint data[]; } squares` and a parameter `uint count`.
//! fn squares(kernel: &RuntimeKernel) -> Result<(), parhelion::graph::Error> {
//!     let device = Device::open(&DeviceOptions::default())?;
//!     let mut executor = Executor::new(&device, Backend::Software)?;
//!
//!     let mut g = Graph::new();
//!     let squares = g.buffer("squares", 4 * 1000);
//!     let bind = [("squares", squares.into())];
//!     g.pass_named("square", kernel, &bind, &[("count", 1000_u32.into())], Grid::Of([1000, 1, 1]))?;
//!     let ticket = g.read_buffer::<u32>(squares);
//!
//!     let mut run = executor.run(g, &RunOptions::default())?;
//!     println!("{:?} in {:?} ms", run.take(ticket), run.rollup().ms);
//!     Ok(())
//! }
//! ```

mod barriers;
mod check;
mod dump;
mod error;
mod exec;
mod kernel;
mod passes;
mod place;
mod plan;
mod planned;
mod record;
mod requirements;
mod resource;
mod stages;
mod times;
mod transfers;
mod work;

pub use check::check;
pub use error::{Error, Mistake, Violation};
pub use exec::{Executor, InFlight, Progress, Run, RunOptions};
pub use kernel::{Bindings, Kernel, ParamValue, Params, RuntimeKernel};
pub use place::{Heap, Placement};
pub use planned::{Barrier, Culled, Plan, PlannedAccess, PlannedPass, PlannedResource};
pub use record::Graph;
pub use requirements::{Limits, Memory, Requirements, Typical};
pub use resource::{AnyRes, Buffer, BufferDesc, Desc, Image, ImageDesc, Res, Tap, Ticket};
pub use stages::Stages;
pub use times::{PassTime, TimeNode, roll_up};
pub use work::{Grid, RawContext};

#[cfg(test)]
mod tests;
