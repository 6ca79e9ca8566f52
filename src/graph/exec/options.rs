//! How a graph is run, and how far it has come.

use crate::vk::SceneSet;
use std::sync::{Arc, atomic::AtomicBool};

/// How a graph is run.
#[derive(Clone, Copy)]
pub struct RunOptions<'a> {
    /// Descriptor set 0, needed by kernels that use the scene. The run keeps it until its end.
    pub scene: Option<&'a Arc<SceneSet>>,
    /// Whether transients share memory. Off, every resource keeps its own: the results are the same.
    pub alias: bool,
    /// Milliseconds a submit should take at most. Kernels are split into bands of workgroups to keep to it; the
    /// results are the same. Less answers `cancel` sooner and costs more submits.
    pub submit_ms: f64,
    /// Whether each pass is timed. Many devices start no pass before the one before has ended where both are timed:
    /// off, independent passes overlap and only the whole is timed ([`Run::device_ms`](super::Run::device_ms)).
    /// Passes that never ran before are timed in any case.
    pub pass_times: bool,
    /// Asked before each pipeline is compiled and by [`Executor::run`](super::Executor::run) between submits; where it is
    /// true the run ends with
    /// [`Error::Cancelled`](crate::graph::Error::Cancelled).
    pub cancel: Option<&'a AtomicBool>,
    /// Told by [`Executor::run`](super::Executor::run) after each submit how far the run is.
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
