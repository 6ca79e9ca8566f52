//! Where transients lie: first fit, largest first, sharing memory where lifetimes are disjoint.

use super::requirements::{Limits, Memory};
use serde::Serialize;

/// Memory that transients share.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Heap {
    /// Bytes.
    pub size: u64,
    /// The memory types that suit all that lies in it, one bit each.
    pub memory_type_bits: u32,
}

/// Where a transient lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Placement {
    /// Index in [`Plan::heaps`](super::Plan::heaps).
    pub heap: usize,
    /// Bytes from the heap's start.
    pub offset: u64,
    /// Bytes, with padding to the alignment.
    pub size: u64,
}

impl Placement {
    /// Whether some byte belongs to both.
    #[must_use]
    pub fn overlaps(&self, other: &Self) -> bool {
        self.heap == other.heap
            && self.offset < other.offset + other.size
            && other.offset < self.offset + self.size
    }
}

/// One transient to place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    pub(super) memory: Memory,
    /// First and last pass that touches it.
    pub(super) lifetime: [usize; 2],
}

/// All transients placed.
pub(super) struct Placed {
    /// In the order of the items.
    pub(super) placements: Vec<Placement>,
    pub(super) heaps: Vec<Heap>,
    /// Bytes of the heaps if nothing shared memory.
    pub(super) unaliased_bytes: u64,
}

/// Places every item; memory is shared if `alias`.
pub(super) fn place(items: &[Item], limits: &Limits, alias: bool) -> Placed {
    let (mut placements, mut heaps) = first_fit(items, limits, false);
    let unaliased_bytes = total(&heaps);
    if alias {
        let shared = first_fit(items, limits, true);
        // Alignment can make sharing the larger of the two.
        if total(&shared.1) < unaliased_bytes {
            (placements, heaps) = shared;
        }
    }
    Placed { placements, heaps, unaliased_bytes }
}

/// Bytes of all heaps.
pub(super) fn total(heaps: &[Heap]) -> u64 {
    heaps.iter().map(|heap| heap.size).sum()
}

fn first_fit(items: &[Item], limits: &Limits, alias: bool) -> (Vec<Placement>, Vec<Heap>) {
    let mut order: Vec<usize> = (0..items.len()).collect();
    order.sort_by_key(|&i| (std::cmp::Reverse(items[i].memory.size), items[i].lifetime, i));
    let mut placements: Vec<Option<Placement>> = vec![None; items.len()];
    let mut heaps: Vec<Heap> = Vec::new();
    for i in order {
        let Item { memory, lifetime } = items[i];
        let alignment = memory.alignment.max(1);
        let size = memory.size.next_multiple_of(alignment);
        let overlaps =
            |other: &Item| !alias || (lifetime[0] <= other.lifetime[1] && other.lifetime[0] <= lifetime[1]);
        let fit = heaps.iter().enumerate().find_map(|(h, heap)| {
            if heap.memory_type_bits & memory.memory_type_bits == 0 {
                return None;
            }
            let mut taken: Vec<[u64; 2]> = (placements.iter().zip(items))
                .filter_map(|(placed, item)| placed.filter(|p| p.heap == h && overlaps(item)))
                .map(|p| [p.offset, p.offset + p.size])
                .collect();
            taken.sort_unstable();
            let mut offset = 0_u64;
            for [start, end] in taken {
                if offset + size <= start {
                    break;
                }
                offset = offset.max(end.next_multiple_of(alignment));
            }
            (offset + size <= limits.max_allocation).then_some((h, offset))
        });
        let (h, offset) = fit.unwrap_or_else(|| {
            heaps.push(Heap { size: 0, memory_type_bits: memory.memory_type_bits });
            (heaps.len() - 1, 0)
        });
        heaps[h].size = heaps[h].size.max(offset + size);
        heaps[h].memory_type_bits &= memory.memory_type_bits;
        placements[i] = Some(Placement { heap: h, offset, size });
    }
    (placements.into_iter().map(|p| p.expect("every item was placed")).collect(), heaps)
}
