//! Barriers from hazards.

use super::{
    planned::{Barrier, PlannedPass, PlannedResource},
    resource::Desc,
    stages::Stages,
};

/// An access by one stage, and what the barriers since then have done for it.
#[derive(Clone, Copy, Default)]
struct Track {
    /// Stages that start after it has ended.
    ordered: Stages,
    /// For a write: it has been made available.
    available: bool,
    /// For a write: stages that see it.
    visible: Stages,
}

/// The accesses of a resource that a later one may have to wait for, by stage: the last write and the reads
/// since. Earlier ones were waited for by these.
#[derive(Clone, Default)]
struct State {
    writes: [Option<Track>; Stages::COUNT],
    reads: [Option<Track>; Stages::COUNT],
}

impl State {
    /// Adds to `barrier` what an access by `stages` still has to wait for.
    fn hazards(&self, barrier: &mut Barrier, stages: Stages, reads: bool, writes: bool) {
        let mut wait = |bit: usize, memory: bool| {
            barrier.before |= Stages::bit(bit);
            barrier.after |= stages;
            barrier.memory |= memory;
        };
        for (bit, write) in self.writes.iter().enumerate() {
            let Some(write) = write else { continue };
            if reads && !write.visible.contains(stages) {
                wait(bit, true);
            } else if writes && !(write.available && write.ordered.contains(stages)) {
                wait(bit, !write.available);
            }
        }
        for (bit, read) in self.reads.iter().enumerate() {
            if read.is_some_and(|read| writes && !read.ordered.contains(stages)) {
                wait(bit, false);
            }
        }
    }

    /// Adds what a change of layout has to wait for: it takes its turn only behind stages it names itself.
    fn before_layout(&self, barrier: &mut Barrier) {
        for (bit, (write, read)) in self.writes.iter().zip(&self.reads).enumerate() {
            if write.is_some() || read.is_some() {
                barrier.before |= Stages::bit(bit);
                barrier.memory |= write.is_some_and(|write| !write.available);
            }
        }
    }

    fn pass_barrier(&mut self, barrier: &Barrier) {
        for (bit, track) in (0..).zip(&mut self.writes).chain((0..).zip(&mut self.reads)) {
            let Some(track) = track else { continue };
            let direct = barrier.before.contains(Stages::bit(bit));
            if direct || barrier.before.intersects(track.ordered) {
                track.ordered |= barrier.after;
                track.available |= direct && barrier.memory;
                if track.available && barrier.memory {
                    track.visible |= barrier.after;
                }
            }
        }
    }

    fn touch(&mut self, stages: Stages, writes: bool) {
        if writes {
            *self = Self::default();
        }
        let tracks = if writes { &mut self.writes } else { &mut self.reads };
        for bit in stages.bits() {
            tracks[bit] = Some(Track::default());
        }
    }
}

/// Puts one merged barrier before each pass that has a hazard which no earlier barrier covers.
pub(super) fn barriers(passes: &mut [PlannedPass], resources: &[PlannedResource]) {
    let mut states = vec![State::default(); resources.len()];
    let shares = sharing(resources);
    let alone = |index: usize| {
        let resource = &resources[index];
        matches!(resource.desc, Desc::Image(_)) && resource.placement.is_some() && shares[index].is_empty()
    };
    // Images that follow none in their memory get their layout before the first pass: a barrier later on would keep
    // passes apart that need not wait for each other.
    let mut barrier =
        Barrier { initialise: (0..resources.len()).filter(|&i| alone(i)).collect(), ..Barrier::default() };
    let first_uses =
        passes.iter().enumerate().flat_map(|(p, pass)| pass.accesses.iter().map(move |a| (p, a)));
    for (_, access) in first_uses.filter(|(p, a)| alone(a.resource) && resources[a.resource].begins(*p)) {
        barrier.after |= access.stages;
    }
    for (p, pass) in passes.iter_mut().enumerate() {
        for access in &pass.accesses {
            let resource = &resources[access.resource];
            states[access.resource].hazards(&mut barrier, access.stages, access.reads, access.writes);
            if resource.imported || !resource.begins(p) {
                continue;
            }
            let image = matches!(resource.desc, Desc::Image(_));
            for &other in &shares[access.resource] {
                states[other].hazards(&mut barrier, access.stages, false, true);
                if image {
                    states[other].before_layout(&mut barrier);
                }
            }
            if image && !alone(access.resource) && !barrier.initialise.contains(&access.resource) {
                barrier.initialise.push(access.resource);
                barrier.after |= access.stages;
            }
        }
        let barrier = std::mem::take(&mut barrier);
        if !barrier.after.is_empty() {
            for state in &mut states {
                state.pass_barrier(&barrier);
            }
            pass.barrier = Some(barrier);
        }
        for writes in [true, false] {
            for access in pass.accesses.iter().filter(|access| access.writes == writes) {
                states[access.resource].touch(access.stages, writes);
            }
        }
    }
}

/// For each transient, the earlier ones that lie in its memory.
fn sharing(resources: &[PlannedResource]) -> Vec<Vec<usize>> {
    let placed = |i: usize| resources[i].placement.zip(resources[i].lifetime);
    let earlier = |i: usize| {
        let Some((here, [first, _])) = placed(i) else { return Vec::new() };
        let shares =
            |&j: &usize| placed(j).is_some_and(|(there, [_, last])| last < first && here.overlaps(&there));
        (0..resources.len()).filter(shares).collect()
    };
    (0..resources.len()).map(earlier).collect()
}
