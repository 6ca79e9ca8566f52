//! What runs share: pipelines, plans, transient memory and the speed of passes.

use super::{
    commands::Kernel,
    flight::{Flight, Start, lock},
    in_flight::InFlight,
    options::RunOptions,
    plans::Plans,
    rates::Rates,
    run::Run,
    slots::Slots,
    transients::Transients,
};
use crate::graph::{
    error::{Error, Mistake},
    planned::{Plan, PlannedPass},
    record::Graph,
    resource::Desc,
    work::{Object, Work},
};
use crate::vk::{self, Backend, Pipelines};
use std::{
    fmt,
    sync::{Arc, Mutex, Weak, atomic::Ordering},
};

/// Runs graphs on a device. Keeps pipelines, plans, transient memory and how long each pass took, so that a graph
/// recorded anew every frame costs little.
pub struct Executor {
    transients: Arc<Transients>,
    plans: Plans,
    slots: Slots,
    rates: Rates,
    pipelines: Pipelines,
    /// Runs that were not wholly submitted when the last one came.
    unsubmitted: Vec<Weak<Mutex<Flight>>>,
    backend: Backend,
    device: vk::Device,
}

impl fmt::Debug for Executor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Executor").field("backend", &self.backend).finish_non_exhaustive()
    }
}

impl Executor {
    /// An executor whose kernels trace rays by `backend`.
    ///
    /// # Errors
    /// What the driver says.
    pub fn new(device: &vk::Device, backend: Backend) -> Result<Self, Error> {
        Ok(Self {
            transients: Arc::default(),
            plans: Plans::default(),
            slots: Slots::default(),
            rates: Rates::default(),
            pipelines: Pipelines::new(device)?,
            unsubmitted: Vec::new(),
            backend,
            device: device.clone(),
        })
    }

    /// Plans a graph and hands it to the device, behind all that was submitted before; never waits for the device.
    ///
    /// A graph whose passes have all run before and fit one submit is on the device when this returns. Of others the
    /// first part is; [`InFlight::poll`] hands over the next. A run behind one that is not wholly submitted begins, when
    /// it is polled, by handing over what is left of that one.
    ///
    /// # Errors
    /// Mistakes of the graph, and whatever the device says.
    pub fn submit(&mut self, graph: Graph, options: &RunOptions<'_>) -> Result<InFlight, Error> {
        let planned = self.plans.of(&self.device, &graph, options.alias)?;
        check_objects(&graph, &planned.plan)?;
        let kernels = self.kernels(&graph, &planned.plan, options)?;
        if !self.transients.serve(&planned.plan) {
            // Where nobody uses the ones before, their memory is free for those that follow.
            let before = Arc::get_mut(&mut self.transients).map(std::mem::take);
            let before = before.unwrap_or_default();
            self.transients = Arc::new(Transients::new(&self.device, &planned.plan, before)?);
        }
        let slot = self.slots.take(&self.device, &graph, &planned.plan)?;
        self.unsubmitted.retain(|flight| {
            let flight = flight.upgrade();
            flight.is_some_and(|flight| !lock(&flight).is_submitted())
        });
        let flight = Arc::new(Mutex::new(Flight::new(Start {
            device: self.device.clone(),
            graph,
            planned,
            kernels,
            transients: Arc::clone(&self.transients),
            scene: options.scene.cloned(),
            slot,
            slots: self.slots.clone(),
            rates: self.rates.clone(),
            submit_ms: options.submit_ms,
            pass_times: options.pass_times,
            before: self.unsubmitted.last().and_then(Weak::upgrade),
        })));
        self.unsubmitted.push(Arc::downgrade(&flight));
        let mut flight = InFlight::new(flight);
        flight.poll()?;
        Ok(flight)
    }

    /// Plans a graph, runs it and waits for its end.
    ///
    /// # Errors
    /// Mistakes of the graph, [`Error::Cancelled`], and whatever the device says.
    pub fn run(&mut self, graph: Graph, options: &RunOptions<'_>) -> Result<Run, Error> {
        let cancelled = || options.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed));
        if cancelled() {
            return Err(Error::Cancelled);
        }
        let mut flight = self.submit(graph, options)?;
        loop {
            let over = flight.step()?;
            if let Some(report) = options.progress {
                flight.progress(report);
            }
            if over {
                return flight.wait();
            }
            if cancelled() {
                return Err(Error::Cancelled);
            }
        }
    }

    /// What the kernels of a plan are bound with, by pass.
    fn kernels(
        &self,
        graph: &Graph,
        plan: &Plan,
        RunOptions { scene, cancel, .. }: &RunOptions<'_>,
    ) -> Result<Vec<Option<Kernel>>, Error> {
        let cancelled = || cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed));
        let works = plan.passes.iter().filter_map(|pass| match &graph.passes[pass.recorded].work {
            Work::Kernel(work) => Some((&*work.code, &work.spec[..])),
            _ => None,
        });
        // Compiling takes seconds on some drivers.
        self.pipelines.compile(&works.collect::<Vec<_>>(), self.backend, &cancelled);
        let kernel = |pass: &PlannedPass| {
            let Work::Kernel(work) = &graph.passes[pass.recorded].work else { return Ok(None) };
            let scene = scene.filter(|_| work.code.uses_scene);
            let wrong = match scene {
                None if work.code.uses_scene => "uses the scene, and the run has none".to_owned(),
                Some(set) if set.backend() != self.backend => {
                    format!("runs with {:?}, the scene is for {:?}", self.backend, set.backend())
                }
                _ if cancelled() => return Err(Error::Cancelled),
                _ => {
                    let pipeline = self.pipelines.get(&work.code, &work.spec, self.backend)?;
                    return Ok(Some(Kernel { pipeline, scene: scene.map(|set| set.raw()) }));
                }
            };
            Err(Mistake::new(wrong).in_shader(&work.code.name).in_pass(&pass.path).into())
        };
        plan.passes.iter().map(kernel).collect()
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
