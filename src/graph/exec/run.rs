//! What came of a run.

use crate::graph::{
    planned::{Culled, Plan},
    resource::Ticket,
    times::{PassTime, TimeNode, roll_up},
};
use bytemuck::Pod;
use std::sync::Arc;

/// What a graph did and what it read back.
#[derive(Debug)]
pub struct Run {
    /// Time of each pass, in order of execution.
    pub passes: Vec<PassTime>,
    /// Passes that were recorded and did not run.
    pub culled: Vec<Culled>,
    /// What was run; [`Plan::dot`] and [`Plan::json`] show it with [`passes`](Self::passes).
    pub plan: Arc<Plan>,
    /// Bytes of transient memory.
    pub transient_bytes: u64,
    /// Bytes it would be without sharing.
    pub unaliased_bytes: u64,
    /// Milliseconds on the device from the first pass's start to the end of the last that is no readback, waits
    /// between submits left out. With [`RunOptions::pass_times`](super::RunOptions::pass_times) the sum over passes,
    /// readbacks left out. `None` where the device has no timestamps.
    pub device_ms: Option<f64>,
    /// Times that work was handed to the device.
    pub submits: u32,
    pub(super) graph: u32,
    pub(super) contents: Vec<Option<Vec<u8>>>,
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
