//! What the host touches of a run: staging memory and queries. Every run in flight has its own.

use crate::graph::{error::Error, planned::Plan, record::Graph, work::Work};
use crate::vk::{self, MemoryKind, TimestampPool};
use std::{
    ops::Range,
    sync::{Arc, Mutex, PoisonError},
};

/// Staging memory above this is given back after each run.
const KEPT_STAGING: u64 = 64 << 20;

/// Slots that no run is using.
#[derive(Clone, Debug, Default)]
pub(super) struct Slots(Arc<Mutex<Vec<Slot>>>);

impl Slots {
    /// A slot with room for a graph, holding what goes up.
    pub(super) fn take(&self, device: &vk::Device, graph: &Graph, plan: &Plan) -> Result<Slot, Error> {
        let mut slot = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default();
        slot.prepare(device, graph, plan)?;
        Ok(slot)
    }

    /// Takes back the slot of a run that has ended.
    pub(super) fn give(&self, mut slot: Slot) {
        for staging in [&mut slot.uploads, &mut slot.readbacks] {
            staging.take_if(|buffer| buffer.size() > KEPT_STAGING);
        }
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(slot);
    }
}

/// Staging memory and queries of one run.
#[derive(Debug, Default)]
pub(super) struct Slot {
    pub(super) uploads: Option<vk::Buffer>,
    pub(super) readbacks: Option<vk::Buffer>,
    pub(super) timestamps: Option<TimestampPool>,
}

impl Slot {
    fn prepare(&mut self, device: &vk::Device, graph: &Graph, plan: &Plan) -> Result<(), Error> {
        let staging = [
            (&mut self.uploads, graph.upload_bytes, MemoryKind::Upload, "uploads"),
            (&mut self.readbacks, graph.readback_bytes, MemoryKind::Readback, "readbacks"),
        ];
        for (buffer, size, kind, name) in staging {
            if buffer.as_ref().map_or(0, vk::Buffer::size) < size {
                *buffer = None;
                *buffer = Some(device.buffer(name, size, kind)?);
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
        let capacity = plan.passes.len() as u32 + 1;
        match &mut self.timestamps {
            Some(pool) if pool.capacity() >= capacity => pool.reset(),
            _ => self.timestamps = Some(TimestampPool::new(device, "pass times", capacity)?),
        }
        Ok(())
    }

    pub(super) fn timestamps(&self) -> &TimestampPool {
        self.timestamps.as_ref().expect("made when the slot was taken")
    }

    pub(super) fn reset_timestamps(&mut self) {
        self.timestamps.as_mut().expect("made when the slot was taken").reset();
    }

    /// What arrived, once the run has ended.
    pub(super) fn contents(&self, tickets: &[Range<u64>]) -> Result<Vec<Option<Vec<u8>>>, Error> {
        let mapped =
            self.readbacks.as_ref().map(vk::Buffer::mapped).transpose()?.flatten().unwrap_or_default();
        let contents = |range: &Range<u64>| Some(mapped[range.start as usize..range.end as usize].to_vec());
        Ok(tickets.iter().map(contents).collect())
    }
}
