//! How much memory this process may still take, so that what a file's numbers decide is refused before it is made: an
//! allocation that fails ends a program, and one that succeeds on credit ends it later.

use sysinfo::{Pid, Process, ProcessRefreshKind, ProcessesToUpdate, System};

/// More than there is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("takes {} of memory, and there are {} left", size(*.needed), size(*.left))]
pub struct Shortage {
    /// Bytes that are needed.
    pub needed: u64,
    /// Bytes that are left.
    pub left: u64,
}

/// Memory that is left for one piece of work.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    left: u64,
    taken: u64,
}

impl Budget {
    /// All that this process may still take: what the machine has free, within the limits of its control groups and of its
    /// address space (`ulimit -v`), less a sixteenth for whatever is not counted.
    #[must_use]
    pub fn of_process() -> Self {
        let free = free();
        Self::of(free - free / 16)
    }

    /// What the limit of this process's address space (`ulimit -v`) leaves; without one, all there could be.
    pub(crate) fn of_address_space() -> Self {
        let used = || Some(own(&mut System::new().ok()?)?.virtual_memory());
        Self::of(address_space(|| used().unwrap_or(0)))
    }

    /// So many bytes.
    #[must_use]
    pub fn of(bytes: u64) -> Self {
        Self { left: bytes, taken: 0 }
    }

    /// Bytes that are not taken.
    #[must_use]
    pub fn left(&self) -> u64 {
        self.left.saturating_sub(self.taken)
    }

    /// Adds `bytes` to what is taken.
    ///
    /// # Errors
    /// All that is taken, if it is more than there was.
    pub fn take(&mut self, bytes: u64) -> Result<(), Shortage> {
        self.taken = self.taken.saturating_add(bytes);
        if self.taken <= self.left { Ok(()) } else { Err(Shortage { needed: self.taken, left: self.left }) }
    }
}

/// Bytes that this process may still take; all there could be where the system does not tell.
fn free() -> u64 {
    let Ok(mut system) = System::new() else { return u64::MAX };
    system.refresh_memory();
    let mut free = system.available_memory().saturating_add(system.free_swap());
    if let Some(process) = own(&mut system) {
        if let Some(group) = process.cgroup_limits() {
            // Files that it holds in memory make way.
            let left = group.total_memory.saturating_sub(group.rss);
            free = free.min(left.saturating_add(group.free_swap));
        }
        free = free.min(address_space(|| process.virtual_memory()));
    }
    free
}

/// This process, with its memory.
fn own(system: &mut System) -> Option<&Process> {
    let own = Pid::from_u32(std::process::id());
    let memory = ProcessRefreshKind::nothing().with_memory();
    system.refresh_processes_specifics(ProcessesToUpdate::Some(&[own]), true, memory);
    system.process(own)
}

/// Bytes that the limit of the address space leaves beside those in use.
fn address_space(#[allow(unused)] used: impl FnOnce() -> u64) -> u64 {
    #[cfg(unix)]
    if let Some(limit) = rustix::process::getrlimit(rustix::process::Resource::As).current {
        return limit.saturating_sub(used());
    }
    u64::MAX
}

/// A number of bytes in words.
fn size(bytes: u64) -> String {
    let (unit, name) = match bytes {
        0x4000_0000.. => (1 << 30, "GiB"),
        0x10_0000.. => (1 << 20, "MiB"),
        _ => (1 << 10, "KiB"),
    };
    format!("{:.1} {name}", bytes as f64 / f64::from(unit))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_is_kept_and_both_numbers_are_told() {
        let mut budget = Budget::of(3 << 20);
        budget.take(1 << 20).unwrap();
        budget.take(2 << 20).unwrap();
        let shortage = budget.take(1 << 19).unwrap_err();
        assert_eq!(shortage.to_string(), "takes 3.5 MiB of memory, and there are 3.0 MiB left");
        assert!(budget.take(u64::MAX).is_err());
    }

    #[test]
    fn this_process_has_some_and_no_more_than_the_machine() {
        let mut system = System::new().unwrap();
        system.refresh_memory();
        let free = free();
        assert!(free > 1 << 20 && free <= system.total_memory() + system.total_swap(), "{free}");
    }
}
