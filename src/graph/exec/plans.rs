//! Plans of the graphs that ran last. A frame like the one before has the same declarations, hence the same plan.

use super::rates::RateKey;
use crate::graph::{
    check::check,
    error::Error,
    planned::Plan,
    record::Graph,
    resource::Desc,
    stages::Stages,
    work::{ResourceDecl, Work},
};
use crate::vk::{self, Access};
use std::{borrow::Cow, mem::Discriminant, mem::discriminant, sync::Arc};

/// Graphs remembered: a progressive picture takes turns between two or three.
const REMEMBERED: usize = 8;

/// A plan and what runs ask of it.
#[derive(Debug)]
pub(super) struct Planned {
    pub(super) plan: Arc<Plan>,
    pub(super) keys: Arc<[RateKey]>,
}

impl Clone for Planned {
    fn clone(&self) -> Self {
        Self { plan: Arc::clone(&self.plan), keys: Arc::clone(&self.keys) }
    }
}

/// The plans, the last one used first.
#[derive(Debug, Default)]
pub(super) struct Plans(Vec<(Declarations, Planned)>);

impl Plans {
    /// The plan of a graph, remembered or made.
    pub(super) fn of(&mut self, device: &vk::Device, graph: &Graph, alias: bool) -> Result<Planned, Error> {
        if let Some(mistake) = &graph.mistake {
            return Err(mistake.clone().into());
        }
        if let Some(place) = self.0.iter().position(|(declared, _)| declared.are_those_of(graph, alias)) {
            self.0[..=place].rotate_right(1);
            return Ok(self.0[0].1.clone());
        }
        let plan = graph.plan_with(device, alias)?;
        if cfg!(debug_assertions) {
            check(&plan)?;
        }
        let keys = plan.passes.iter().map(RateKey::of).collect();
        let planned = Planned { plan: Arc::new(plan), keys };
        self.0.truncate(REMEMBERED - 1);
        self.0.insert(0, (Declarations::of(graph, alias), planned.clone()));
        Ok(planned)
    }
}

/// All of a graph that its plan depends on.
#[derive(Debug)]
struct Declarations {
    alias: bool,
    resources: Vec<(Cow<'static, str>, Desc, bool)>,
    passes: Vec<Pass>,
    kept: Vec<u32>,
}

#[derive(Debug)]
struct Pass {
    path: String,
    kind: Discriminant<Work>,
    shader: Option<Cow<'static, str>>,
    groups: Option<[u32; 3]>,
    uses: Vec<(u32, Cow<'static, str>, Stages, Access)>,
}

impl Declarations {
    fn of(graph: &Graph, alias: bool) -> Self {
        let resources = graph.resources.iter().map(|r| (r.name.clone(), r.desc, r.imported));
        let passes = graph.passes.iter().map(|pass| Pass {
            path: pass.path.clone(),
            kind: discriminant(&pass.work),
            shader: pass.work.shader().cloned(),
            groups: pass.work.groups(),
            uses: pass.uses.iter().map(|u| (u.resource, u.variable.clone(), u.stages, u.access)).collect(),
        });
        Self { alias, resources: resources.collect(), passes: passes.collect(), kept: graph.kept.clone() }
    }

    fn are_those_of(&self, graph: &Graph, alias: bool) -> bool {
        let same = |resource: &ResourceDecl, declared: &(Cow<'_, str>, Desc, bool)| {
            resource.name == declared.0 && resource.desc == declared.1 && resource.imported == declared.2
        };
        self.alias == alias
            && self.kept == graph.kept
            && self.resources.len() == graph.resources.len()
            && graph
                .resources
                .iter()
                .zip(&self.resources)
                .all(|(resource, declared)| same(resource, declared))
            && self.passes.len() == graph.passes.len()
            && graph.passes.iter().zip(&self.passes).all(|(pass, declared)| {
                let uses = pass.uses.iter().map(|u| (u.resource, &u.variable, u.stages, u.access));
                pass.path == declared.path
                    && discriminant(&pass.work) == declared.kind
                    && pass.work.shader() == declared.shader.as_ref()
                    && pass.work.groups() == declared.groups
                    && uses.eq(declared
                        .uses
                        .iter()
                        .map(|(r, variable, stages, access)| (*r, variable, *stages, *access)))
            })
    }
}
