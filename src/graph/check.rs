//! The oracle: proves a plan right from its passes, placements and barriers alone, without the planner's
//! bookkeeping, in quadratic time.

use super::{
    error::Violation,
    place::Placement,
    planned::{Plan, PlannedAccess},
    resource::Desc,
    stages::Stages,
};

/// Proves that every two accesses to the same memory of which one writes are ordered, that what is read has
/// been made visible, that no transient in use is overwritten by another, and that every transient is
/// written, and every image initialised, before it is read.
///
/// # Errors
/// The first violation.
pub fn check(plan: &Plan) -> Result<(), Violation> {
    check_lives(plan)?;
    check_layouts(plan)?;
    for first in 0..plan.passes.len() {
        for access in &plan.passes[first].accesses {
            for bit in access.stages.bits() {
                check_from(plan, first, access, Stages::bit(bit))?;
            }
        }
    }
    Ok(())
}

/// The first and last pass that touches a resource.
fn life(plan: &Plan, resource: usize) -> Option<[usize; 2]> {
    let touches = |&p: &usize| plan.passes[p].accesses.iter().any(|a| a.resource == resource);
    let first = (0..plan.passes.len()).find(touches)?;
    let last = (0..plan.passes.len()).rfind(touches)?;
    Some([first, last])
}

fn check_lives(plan: &Plan) -> Result<(), Violation> {
    let mut lives: Vec<(String, [usize; 2], Placement)> = Vec::new();
    for (index, resource) in plan.resources.iter().enumerate().filter(|(_, r)| !r.imported) {
        let Some([first, last]) = life(plan, index) else { continue };
        let name = || resource.name.clone();
        let placement = resource
            .placement
            .filter(|p| p.size >= resource.desc.bytes() && p.offset + p.size <= plan.heaps[p.heap].size)
            .ok_or_else(|| Violation::Unplaced { resource: name() })?;
        let pass = &plan.passes[first];
        if pass.accesses.iter().any(|a| a.resource == index && a.reads) {
            return Err(Violation::Unwritten { pass: pass.path.clone(), resource: name() });
        }
        for (other, [from, to], there) in &lives {
            if placement.overlaps(there) && first <= *to && *from <= last {
                return Err(Violation::Clobbered { first: other.clone(), second: name() });
            }
        }
        lives.push((name(), [first, last], placement));
    }
    Ok(())
}

fn check_layouts(plan: &Plan) -> Result<(), Violation> {
    let barrier = |p: usize| plan.passes[p].barrier.as_ref();
    let initialised = |image: usize| {
        (0..plan.passes.len()).filter(move |&p| barrier(p).is_some_and(|b| b.initialise.contains(&image)))
    };
    for (index, resource) in plan.resources.iter().enumerate() {
        let transient = matches!(resource.desc, Desc::Image(_)) && !resource.imported;
        let wrong = |p: usize, missing: bool| Violation::Layout {
            pass: plan.passes[p].path.clone(),
            resource: resource.name.clone(),
            missing,
        };
        let mut places = initialised(index);
        let Some([first, _]) = life(plan, index).filter(|_| transient) else {
            match places.next() {
                Some(p) => return Err(wrong(p, false)),
                None => continue,
            }
        };
        let Some(p) = places.next() else { return Err(wrong(first, true)) };
        // Once, before its first use, and with nothing else in its memory between.
        let clobbers = |a: &PlannedAccess| {
            let there = plan.resources[a.resource].placement;
            a.resource != index && there.zip(resource.placement).is_some_and(|(a, b)| a.overlaps(&b))
        };
        let between = plan.passes.get(p..first).unwrap_or_default();
        if let Some(again) = places.next() {
            return Err(wrong(again, false));
        }
        if p > first || between.iter().any(|pass| pass.accesses.iter().any(clobbers)) {
            return Err(wrong(p, false));
        }
        let after = barrier(p).map_or(Stages::NONE, |barrier| barrier.after);
        let uses = plan.passes[first].accesses.iter().filter(|a| a.resource == index);
        if uses.into_iter().any(|access| !after.contains(access.stages)) {
            return Err(wrong(first, true));
        }
    }
    Ok(())
}

/// Follows one access by one stage through all later barriers, in the terms of the specification: a barrier
/// orders what its first scope holds, or what an earlier barrier ordered before a stage of its first scope;
/// a write is available once a memory barrier names its stage, and visible to the second scope of that or
/// any later memory barrier in the chain.
fn check_from(plan: &Plan, first: usize, access: &PlannedAccess, stage: Stages) -> Result<(), Violation> {
    let mut ordered = Stages::NONE;
    let mut available = !access.writes;
    let mut visible = Stages::NONE;
    let memory = |r: usize| plan.resources[r].placement;
    let shares = |r: usize| {
        r == access.resource || memory(r).zip(memory(access.resource)).is_some_and(|(a, b)| a.overlaps(&b))
    };
    for pass in &plan.passes[first + 1..] {
        let unordered = |later: usize| Violation::Unordered {
            first: plan.passes[first].path.clone(),
            second: pass.path.clone(),
            earlier: plan.resources[access.resource].name.clone(),
            later: plan.resources[later].name.clone(),
        };
        if let Some(barrier) = &pass.barrier {
            let named = barrier.before.contains(stage);
            let chained = named || barrier.before.intersects(ordered);
            available |= named && barrier.memory;
            // The change of layout happens between the two scopes.
            for &image in barrier.initialise.iter().filter(|&&image| shares(image)) {
                if !chained || !available {
                    return Err(unordered(image));
                }
            }
            if chained {
                ordered |= barrier.after;
                if available && barrier.memory {
                    visible |= barrier.after;
                }
            }
        }
        for later in pass.accesses.iter().filter(|later| shares(later.resource)) {
            let sees = access.writes && later.reads && later.resource == access.resource;
            let conflict = access.writes || later.writes;
            if conflict && !(available && ordered.contains(later.stages))
                || sees && !visible.contains(later.stages)
            {
                return Err(unordered(later.resource));
            }
        }
    }
    Ok(())
}
