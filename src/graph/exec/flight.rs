//! A run in progress: what is left to record, what is on the device, what has been measured.

use super::{
    bands::Bands,
    commands::{Kernel, Recorder},
    plans::Planned,
    rates::{Measured, PROBE, Rates, groups_of, weights},
    run::Run,
    slots::{Slot, Slots},
    transients::Transients,
};
use crate::graph::{
    error::Error,
    planned::Plan,
    record::Graph,
    times::PassTime,
    work::{Dispatch, Object, RawContext, Work},
};
use crate::vk::{self, CommandBuffer, SceneSet, Submission};
use ash::vk as raw;
use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Instant,
};

/// A run that others may have to wait for.
pub(super) type Shared = Arc<Mutex<Flight>>;

/// Locks a run; what panicked while it was locked has left it whole enough to be given up.
pub(super) fn lock(flight: &Mutex<Flight>) -> MutexGuard<'_, Flight> {
    flight.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What a run begins with.
pub(super) struct Start {
    pub(super) device: vk::Device,
    pub(super) graph: Graph,
    pub(super) planned: Planned,
    pub(super) kernels: Vec<Option<Kernel>>,
    pub(super) transients: Arc<Transients>,
    pub(super) scene: Option<Arc<SceneSet>>,
    pub(super) slot: Slot,
    pub(super) slots: Slots,
    pub(super) rates: Rates,
    pub(super) submit_ms: f64,
    pub(super) pass_times: bool,
    /// Its results are this run's input: nothing is submitted before all of it is.
    pub(super) before: Option<Shared>,
}

/// The part of a pass that one submit holds.
#[derive(Debug)]
struct Interval {
    pass: usize,
    groups: f64,
}

/// A run in progress.
pub(super) struct Flight {
    // Dropped first: waits until the device is done with all below.
    submission: Option<(Submission, Instant)>,
    /// Recorded and not yet submitted.
    commands: Option<CommandBuffer>,
    device: vk::Device,
    graph: Graph,
    planned: Planned,
    kernels: Vec<Option<Kernel>>,
    objects: Vec<Object>,
    _transients: Arc<Transients>,
    _scene: Option<Arc<SceneSet>>,
    slot: Option<Slot>,
    slots: Slots,
    rates: Rates,
    submit_ms: f64,
    before: Option<Shared>,
    /// The pass being recorded, and what is left of it; `None` before its barrier.
    pass: usize,
    rest: Option<Bands>,
    /// Whether nothing more will be recorded because the run was given up.
    abandoned: bool,
    /// What it failed by while another run saw to it.
    failed: Option<Error>,
    measured: Vec<Measured>,
    weights: Vec<f64>,
    intervals: Vec<Interval>,
    /// Milliseconds that what is recorded should take.
    expected: f64,
    submits: u32,
    /// Milliseconds so far where passes are not timed one by one.
    whole: Option<f64>,
    /// The last pass that is no readback.
    last_work: Option<usize>,
    /// The pass that ran last.
    last: usize,
}

impl Flight {
    pub(super) fn new(start: Start) -> Self {
        let Start { graph, planned, transients, .. } = start;
        let plan = &planned.plan;
        let mut placed = transients.objects();
        let objects = (plan.resources.iter().zip(&graph.resources))
            .map(|(planned, decl)| match planned.placement.and_then(|_| placed.next()) {
                Some(object) => object.clone(),
                None => decl.object.clone(),
            })
            .collect();
        let rates = start.rates.known(&planned.keys);
        Self {
            submission: None,
            commands: None,
            measured: rates.iter().map(|&rate| Measured::new(rate)).collect(),
            weights: weights(plan, &rates),
            whole: (!start.pass_times && rates.iter().all(Option::is_some)).then_some(0.0),
            last_work: plan.passes.iter().rposition(|pass| !is_readback(&graph.passes[pass.recorded].work)),
            objects,
            device: start.device,
            kernels: start.kernels,
            _scene: start.scene,
            slot: Some(start.slot),
            slots: start.slots,
            rates: start.rates,
            submit_ms: start.submit_ms,
            before: start.before,
            pass: 0,
            rest: None,
            abandoned: false,
            failed: None,
            intervals: Vec::new(),
            expected: 0.0,
            submits: 0,
            last: 0,
            graph,
            _transients: Arc::clone(&transients),
            planned,
        }
    }

    /// Whether all of it, and of what it stands behind, is on the device or has ended there.
    pub(super) fn is_submitted(&self) -> bool {
        let recorded = self.pass == self.planned.plan.passes.len() && self.commands.is_none();
        let first = || self.before.as_ref().is_none_or(|before| lock(before).is_submitted());
        (self.abandoned || recorded) && first()
    }

    /// Whether it has ended.
    pub(super) fn is_over(&self) -> bool {
        self.is_submitted() && self.submission.is_none()
    }

    /// Submits nothing more, and waits for what is submitted. Whoever stands behind it stands behind those before it.
    pub(super) fn abandon(&mut self) {
        self.abandoned = true;
        (self.commands, self.submission) = (None, None);
        if let Some(slot) = self.slot.take() {
            self.slots.give(slot);
        }
    }

    /// The pass that ran last, and the share of all work that is done.
    pub(super) fn progress(&self) -> (Arc<Plan>, usize, f64) {
        let plan = &self.planned.plan;
        let share = |p: usize| (self.measured[p].groups / groups_of(&plan.passes[p])).min(1.0);
        let done = self.weights.iter().enumerate().map(|(p, weight)| weight * share(p)).sum::<f64>().min(1.0);
        (Arc::clone(plan), self.last, done)
    }

    /// Goes on until the device is at work on something that this run has to wait for; whether all has ended. With
    /// `wait` it waits for one submit at most. A run that fails is given up.
    pub(super) fn advance(&mut self, wait: bool) -> Result<bool, Error> {
        if let Some(error) = self.failed.take() {
            return Err(error);
        }
        let advanced = self.try_advance(wait);
        if advanced.is_err() {
            self.abandon();
        }
        advanced
    }

    fn try_advance(&mut self, wait: bool) -> Result<bool, Error> {
        if let Some(before) = &self.before {
            let mut before = lock(before);
            if !before.is_submitted() {
                if let Err(error) = before.advance(wait) {
                    // For its owner to hear.
                    before.failed = Some(error);
                }
                if wait || !before.is_submitted() {
                    return Ok(false);
                }
            }
        }
        self.before = None;
        if let Some((submission, begun)) = &self.submission {
            if wait {
                submission.wait()?;
            } else if !submission.has_ended()? {
                return Ok(false);
            }
            let wall_ms = begun.elapsed().as_secs_f64() * 1e3;
            self.submission = None;
            self.read_times(wall_ms)?;
        }
        if !self.is_submitted() {
            self.record()?;
            self.submit()?;
        }
        Ok(self.is_over())
    }

    /// Records until something has to run before the rest can be, or until the end.
    fn record(&mut self) -> Result<(), Error> {
        let plan = Arc::clone(&self.planned.plan);
        while let Some(pass) = plan.passes.get(self.pass) {
            let p = self.pass;
            if self.rest.is_none() {
                if let Some(barrier) = &pass.barrier {
                    let cmd = self.commands()?;
                    self.recorder().barrier(cmd, barrier);
                }
                self.rest = Some(Bands::new(pass.groups.unwrap_or([1; 3])));
            }
            let rest = self.rest.as_mut().expect("made above");
            if rest.left() <= 0.0 {
                (self.pass, self.rest) = (p + 1, None);
                continue;
            }
            let Measured { rate, limit, .. } = self.measured[p];
            let want = match rate {
                // A part of unknown length is kept apart from the rest where only whole submits can be timed.
                None if !self.device.info().timestamps && !self.intervals.is_empty() => return Ok(()),
                None => PROBE,
                Some(rate) => {
                    let room = (self.submit_ms - self.expected) / rate;
                    if rest.left() > room && self.expected > 0.0 {
                        return Ok(());
                    }
                    room.min(limit)
                }
            };
            let band = rest.next(want);
            let more = rest.left() > 0.0;
            self.record_band(p, band)?;
            if rate.is_none() || more {
                return Ok(());
            }
        }
        Ok(())
    }

    /// Records a part of a pass between its timestamps.
    fn record_band(&mut self, p: usize, band: ([u32; 3], [u32; 3])) -> Result<(), Error> {
        let cmd = self.commands()?;
        let plan = Arc::clone(&self.planned.plan);
        let pass = &plan.passes[p];
        let work = &mut self.graph.passes[pass.recorded].work;
        let stage = match work {
            Work::Kernel(_) => raw::PipelineStageFlags2::COMPUTE_SHADER,
            Work::Raw(_) => raw::PipelineStageFlags2::ALL_COMMANDS,
            _ => raw::PipelineStageFlags2::ALL_TRANSFER,
        };
        let raw_work = if let Work::Raw(record) = work { record.take() } else { None };
        let groups = match work {
            Work::Kernel(work) if matches!(work.dispatch, Dispatch::Groups(_)) => {
                band.1.iter().map(|&n| f64::from(n)).product()
            }
            _ => 1.0,
        };
        let slot = self.slot.as_ref().expect("given back at the end");
        let interval = self.intervals.len() as u32;
        self.device.begin_label(cmd, &pass.path);
        match self.whole {
            None => slot.timestamps().begin(cmd, interval, stage),
            Some(_) if interval == 0 => {
                slot.timestamps().begin(cmd, 0, raw::PipelineStageFlags2::ALL_COMMANDS);
            }
            Some(_) => {}
        }
        let recorder = self.recorder();
        match (&self.graph.passes[pass.recorded].work, &self.kernels[p]) {
            (Work::Kernel(work), Some(kernel)) => recorder.dispatch(cmd, kernel, work, band),
            (Work::Raw(_), _) => {
                let context = RawContext {
                    device: &self.device,
                    objects: &self.objects,
                    graph: self.graph.id,
                    command_buffer: cmd,
                };
                raw_work.expect("each pass is recorded once")(&context);
            }
            (work, _) => {
                let (staging, at) = match work {
                    Work::Upload { at, .. } => (slot.uploads.as_ref(), *at),
                    Work::Readback { ticket, .. } => {
                        (slot.readbacks.as_ref(), self.graph.tickets[*ticket].start)
                    }
                    _ => (None, 0),
                };
                recorder.transfer(cmd, work, staging.map_or(raw::Buffer::null(), vk::Buffer::raw), at);
            }
        }
        match self.whole {
            None => slot.timestamps().end(cmd, interval, stage),
            Some(_) if Some(p) == self.last_work => self.end_whole(cmd),
            Some(_) => {}
        }
        self.device.end_label(cmd);
        self.intervals.push(Interval { pass: p, groups });
        self.measured[p].bands += 1;
        self.expected += groups * self.measured[p].rate.unwrap_or(0.0);
        Ok(())
    }

    /// Submits what was recorded.
    fn submit(&mut self) -> Result<(), Error> {
        let Some(commands) = self.commands.take() else { return Ok(()) };
        // A submit that ends before the last pass of all ends its time here; one behind it is not timed.
        if self.whole_is_timed() && self.intervals.last().map(|interval| interval.pass) < self.last_work {
            self.end_whole(commands.raw());
        }
        self.device.memory_barrier(
            commands.raw(),
            (raw::PipelineStageFlags2::ALL_COMMANDS, raw::AccessFlags2::MEMORY_WRITE),
            (raw::PipelineStageFlags2::HOST, raw::AccessFlags2::HOST_READ),
        );
        let begun = Instant::now();
        self.submission = Some((self.device.submit(commands)?, begun));
        self.submits += 1;
        // Submits run in order: whatever uses these next finds them in their layout.
        self.recorder().new_imports().for_each(vk::Image::set_general);
        self.expected = 0.0;
        Ok(())
    }

    /// Reads the times of the submit that has ended.
    fn read_times(&mut self, wall_ms: f64) -> Result<(), Error> {
        let timed = self.whole_is_timed();
        let intervals = std::mem::take(&mut self.intervals);
        let expected = |measured: &[Measured], interval: &Interval| {
            interval.groups * measured[interval.pass].rate.unwrap_or(0.0)
        };
        let slot = self.slot.as_mut().expect("given back at the end");
        let (times, took) = match self.whole {
            None => (slot.timestamps().nanoseconds(intervals.len() as u32)?, wall_ms),
            Some(sum) => {
                let span = if timed { slot.timestamps().nanoseconds(1)? } else { None };
                let span = span.map(|ns| ns[0] as f64 * 1e-6);
                self.whole = Some(sum + span.unwrap_or(0.0));
                (None, span.unwrap_or(wall_ms))
            }
        };
        slot.reset_timestamps();
        // Where only the whole is timed, each part has its expected share of it.
        let sum: f64 = intervals.iter().map(|interval| expected(&self.measured, interval)).sum();
        let share = if sum > 0.0 { took / sum } else { 1.0 };
        for (i, interval) in intervals.iter().enumerate() {
            let ms = match &times {
                Some(times) => times[i] as f64 * 1e-6,
                None if intervals.len() == 1 => took,
                None => share * expected(&self.measured, interval),
            };
            self.measured[interval.pass].add(ms, interval.groups);
        }
        if let Some(interval) = intervals.last() {
            self.last = interval.pass;
        }
        Ok(())
    }

    /// What came of it, once it is over; [`Error::Cancelled`] where it was given up.
    pub(super) fn finish(&mut self) -> Result<Run, Error> {
        if self.abandoned {
            return Err(Error::Cancelled);
        }
        self.rates.learn(&self.planned.keys, &self.measured);
        let slot = self.slot.take().expect("a run is finished once");
        let contents = slot.contents(&self.graph.tickets)?;
        self.slots.give(slot);
        let timed = self.device.info().timestamps;
        let plan = Arc::clone(&self.planned.plan);
        let (graph, measured, whole) = (&self.graph, &self.measured, self.whole);
        let sum = || {
            let work = 0..self.last_work.map_or(0, |last| last + 1);
            let work = work.filter(|&p| !is_readback(&graph.passes[plan.passes[p].recorded].work));
            work.map(|p| measured[p].ms).sum()
        };
        let passes = plan.passes.iter().zip(measured).map(|(pass, measured)| PassTime {
            path: pass.path.clone(),
            ms: (timed && whole.is_none()).then_some(measured.ms),
            bands: measured.bands,
        });
        Ok(Run {
            passes: passes.collect(),
            culled: plan.culled.clone(),
            transient_bytes: plan.transient_bytes,
            unaliased_bytes: plan.unaliased_bytes,
            device_ms: timed.then(|| whole.unwrap_or_else(sum)),
            submits: self.submits,
            graph: graph.id,
            contents,
            plan,
        })
    }

    fn recorder(&self) -> Recorder<'_> {
        Recorder { device: &self.device, plan: &self.planned.plan, objects: &self.objects }
    }

    /// The command buffer being recorded. The first of a run waits on the device for all earlier work.
    fn commands(&mut self) -> Result<raw::CommandBuffer, Error> {
        if let Some(commands) = &self.commands {
            return Ok(commands.raw());
        }
        let commands = self.device.commands("graph")?;
        let cmd = commands.raw();
        if self.submits == 0 {
            self.recorder().begin(cmd);
        }
        self.commands = Some(commands);
        Ok(cmd)
    }

    /// Whether the submit that `intervals` stand for is timed as a whole.
    fn whole_is_timed(&self) -> bool {
        let first = self.intervals.first().map(|interval| interval.pass);
        self.whole.is_some() && first.is_some() && first <= self.last_work
    }

    fn end_whole(&self, cmd: raw::CommandBuffer) {
        let slot = self.slot.as_ref().expect("given back at the end");
        slot.timestamps().end(cmd, 0, raw::PipelineStageFlags2::ALL_COMMANDS);
    }
}

fn is_readback(work: &Work) -> bool {
    matches!(work, Work::Readback { .. })
}
