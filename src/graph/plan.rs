//! From declarations to a plan, in phases: validate, cull, lifetimes, place, barriers.

use super::{
    barriers::barriers,
    error::{Error, Mistake},
    place::{self, Heap, Item},
    planned::{Culled, Plan, PlannedAccess, PlannedPass, PlannedResource},
    record::Graph,
    requirements::{Limits, Requirements},
    resource::Desc,
    work::{Dispatch, PassDecl, Work},
};
use crate::vk::BindingKind;

impl Graph {
    /// Decides what runs, in which memory and behind which barriers. Pure: the device comes in as data.
    ///
    /// # Errors
    /// The first mistake made while recording, or a limit of the device that is passed.
    pub fn plan(&self, requirements: &dyn Requirements) -> Result<Plan, Error> {
        self.plan_with(requirements, true)
    }

    /// [`plan`](Self::plan) with the sharing of memory between transients on or off.
    ///
    /// # Errors
    /// Those of `plan`.
    pub fn plan_with(&self, requirements: &dyn Requirements, alias: bool) -> Result<Plan, Error> {
        Ok(plan(self, requirements, alias)?)
    }
}

fn plan(graph: &Graph, requirements: &dyn Requirements, alias: bool) -> Result<Plan, Mistake> {
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

fn planned(pass: &PassDecl, recorded: usize) -> PlannedPass {
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
        shader: pass.work.shader().map(|name| name.clone().into_owned()),
        constants: pass.work.constants().to_vec(),
        groups: pass.work.groups(),
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
