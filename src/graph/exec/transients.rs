//! Memory of transients. Runs share it, since each waits on the device for those before; what is replaced dies when the
//! last run that uses it has ended.

use crate::graph::{
    error::Error,
    place::{Heap, Placement},
    planned::Plan,
    resource::Desc,
    work::Object,
};
use crate::vk;

/// What a transient's Vulkan object depends on.
type Transient = (Desc, Placement);

/// The transients of a plan, in the order of its resources.
#[derive(Debug, Default)]
pub(super) struct Transients {
    objects: Vec<(Transient, Object)>,
    heaps: Vec<(Heap, vk::Heap)>,
}

impl Transients {
    /// Whether these are the transients of a plan.
    pub(super) fn serve(&self, plan: &Plan) -> bool {
        let wanted = plan.resources.iter().filter_map(|r| Some((r.desc, r.placement?)));
        self.heaps.len() == plan.heaps.len() && wanted.eq(self.objects.iter().map(|(key, _)| *key))
    }

    /// Makes them, in the heaps of `before`, which nobody uses, where these fit.
    pub(super) fn new(device: &vk::Device, plan: &Plan, before: Self) -> Result<Self, Error> {
        // Objects before the heaps they lie in, heaps before new ones ask for memory.
        let Self { objects, heaps } = before;
        drop(objects);
        let fits = |(have, _): &(Heap, vk::Heap), want: &Heap| {
            have.memory_type_bits == want.memory_type_bits && (want.size..=2 * want.size).contains(&have.size)
        };
        let fit = heaps.len() == plan.heaps.len()
            && heaps.iter().zip(&plan.heaps).all(|(have, want)| fits(have, want));
        let heaps = if fit {
            heaps
        } else {
            drop(heaps);
            let heap = |heap: &Heap| {
                let memory = device.heap("transients", heap.size, heap.memory_type_bits)?;
                Ok((heap.clone(), memory))
            };
            plan.heaps.iter().map(heap).collect::<Result<_, Error>>()?
        };
        let mut objects = Vec::new();
        for resource in &plan.resources {
            let Some(placement) = resource.placement else { continue };
            let (heap, name) = (&heaps[placement.heap].1, &resource.name);
            let object = match resource.desc {
                Desc::Buffer(desc) => {
                    Object::Buffer(device.buffer_in(heap, placement.offset, desc.size, name)?.into())
                }
                Desc::Image(desc) => Object::Image(
                    device.image_in(heap, placement.offset, desc.extent, desc.format, name)?.into(),
                ),
                Desc::Scene => continue,
            };
            objects.push(((resource.desc, placement), object));
        }
        Ok(Self { objects, heaps })
    }

    pub(super) fn objects(&self) -> impl Iterator<Item = &Object> {
        self.objects.iter().map(|(_, object)| object)
    }
}
