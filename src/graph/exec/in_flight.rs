//! A run that somebody waits for, or does not.

use super::{
    flight::{Shared, lock},
    options::Progress,
    run::Run,
};
use crate::graph::error::Error;
use std::fmt;

/// A graph on its way. It owns what it uses: imports, scene, staging and transients live until its end, whatever becomes
/// of the executor and of this handle.
///
/// Dropped, it submits nothing more and waits for what it has submitted.
#[must_use = "dropping a run in flight gives up what is not yet submitted, and waits"]
pub struct InFlight(Shared);

impl fmt::Debug for InFlight {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let progress = self.progress(|progress| progress.done);
        f.debug_struct("InFlight").field("done", &progress).finish_non_exhaustive()
    }
}

impl InFlight {
    pub(super) fn new(flight: Shared) -> Self {
        Self(flight)
    }

    /// Goes on without waiting for the device: where a submit has ended and parts of the graph are left, the next is
    /// handed over. Returns whether all has ended.
    ///
    /// # Errors
    /// Whatever the device says.
    pub fn poll(&mut self) -> Result<bool, Error> {
        lock(&self.0).advance(false)
    }

    /// Whether all of it has been handed to the device, so that nothing is left for [`poll`](Self::poll) to do but to
    /// see its end.
    #[must_use]
    pub fn is_submitted(&self) -> bool {
        lock(&self.0).is_submitted()
    }

    /// As [`poll`](Self::poll), after waiting for what is on the device now.
    ///
    /// # Errors
    /// Whatever the device says.
    pub fn step(&mut self) -> Result<bool, Error> {
        lock(&self.0).advance(true)
    }

    /// Tells `told` how far it is.
    pub fn progress<R>(&self, told: impl FnOnce(Progress<'_>) -> R) -> R {
        let (plan, pass, done) = lock(&self.0).progress();
        told(Progress { pass: plan.passes.get(pass).map_or("", |pass| &pass.path), done })
    }

    /// Waits for its end.
    ///
    /// # Errors
    /// Whatever the device says; [`Error::Cancelled`] after an error before.
    pub fn wait(mut self) -> Result<Run, Error> {
        while !self.step()? {}
        lock(&self.0).finish()
    }
}

impl Drop for InFlight {
    fn drop(&mut self) {
        lock(&self.0).abandon();
    }
}
