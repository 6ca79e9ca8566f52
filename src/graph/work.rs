//! What passes do, as recorded.

use super::{
    resource::{AnyRes, Buffer, Desc, Image, Res},
    stages::Stages,
};
use crate::vk::{self, Access, KernelCode};
use ash::vk as raw;
use std::{borrow::Cow, sync::Arc};

/// How many invocations a kernel pass starts. Kernels check their own bounds: the last workgroups may
/// reach past the end.
#[derive(Clone, Copy, Debug)]
pub enum Grid {
    /// One a texel of this image.
    Over(Res<Image>),
    /// This many invocations in x, y and z.
    Of([u32; 3]),
    /// As many *workgroups* as three 32-bit numbers in a buffer say (`VkDispatchIndirectCommand`).
    /// Declared as a read; never split into bands.
    Indirect {
        /// Holds the three numbers.
        buffer: Res<Buffer>,
        /// Where they are, in bytes, a multiple of 4.
        offset: u64,
    },
}

pub(super) type RecordRaw = Box<dyn FnOnce(&RawContext<'_>) + Send>;

pub(super) enum Code {
    Static(&'static KernelCode),
    Shared(Arc<KernelCode>),
}

impl std::ops::Deref for Code {
    type Target = KernelCode;

    fn deref(&self) -> &KernelCode {
        match self {
            Self::Static(code) => code,
            Self::Shared(code) => code,
        }
    }
}

pub(super) enum Dispatch {
    Groups([u32; 3]),
    Indirect { buffer: u32, offset: u64 },
}

pub(super) struct KernelWork {
    pub(super) code: Code,
    pub(super) spec: Vec<u32>,
    /// Resources in the order of the code's bindings.
    pub(super) bound: Vec<u32>,
    pub(super) params: Vec<u8>,
    pub(super) dispatch: Dispatch,
}

pub(super) enum Work {
    Kernel(KernelWork),
    Fill {
        buffer: u32,
        value: u32,
    },
    Clear {
        image: u32,
    },
    Upload {
        to: u32,
        /// Where in staging memory.
        at: u64,
        bytes: Vec<u8>,
    },
    CopyBuffer {
        from: u32,
        from_offset: u64,
        to: u32,
        to_offset: u64,
        size: u64,
    },
    CopyImage {
        from: u32,
        to: u32,
    },
    Readback {
        from: u32,
        ticket: usize,
    },
    /// Taken when it is recorded.
    Raw(Option<RecordRaw>),
}

impl Work {
    /// Values of the kernel's specialization constants, of kernels.
    pub(super) fn constants(&self) -> &[u32] {
        match self {
            Self::Kernel(kernel) => &kernel.spec,
            _ => &[],
        }
    }

    /// The kernel's name, of kernels.
    pub(super) fn shader(&self) -> Option<&Cow<'static, str>> {
        match self {
            Self::Kernel(kernel) => Some(&kernel.code.name),
            _ => None,
        }
    }

    /// Workgroups of kernels, where the host knows.
    pub(super) fn groups(&self) -> Option<[u32; 3]> {
        match self {
            Self::Kernel(KernelWork { dispatch: Dispatch::Groups(groups), .. }) => Some(*groups),
            _ => None,
        }
    }

    pub(super) fn noun(&self) -> &'static str {
        match self {
            Self::Kernel(_) => "kernel",
            Self::Raw(_) => "raw",
            Self::Readback { .. } => "readback",
            _ => "transfer",
        }
    }
}

pub(super) struct Use {
    pub(super) resource: u32,
    pub(super) variable: Cow<'static, str>,
    pub(super) stages: Stages,
    pub(super) access: Access,
}

pub(super) struct PassDecl {
    pub(super) path: String,
    pub(super) uses: Vec<Use>,
    pub(super) work: Work,
}

/// What an import stands for.
#[derive(Clone, Debug)]
pub(super) enum Object {
    /// A transient, the scene, or an import that is only declared.
    None,
    Buffer(Arc<vk::Buffer>),
    Image(Arc<vk::Image>),
}

pub(super) struct ResourceDecl {
    pub(super) name: Cow<'static, str>,
    pub(super) desc: Desc,
    pub(super) imported: bool,
    pub(super) object: Object,
    /// A pass recorded so far writes it, or it is imported.
    pub(super) written: bool,
}

/// What a raw pass records with. Recording is the caller's own `unsafe`: it must touch no more than the pass
/// declares, and leave images in the general layout.
pub struct RawContext<'c> {
    pub(super) device: &'c vk::Device,
    pub(super) objects: &'c [Object],
    pub(super) graph: u32,
    pub(super) command_buffer: raw::CommandBuffer,
}

impl RawContext<'_> {
    /// The device's functions.
    #[must_use]
    pub fn device(&self) -> &ash::Device {
        self.device.raw()
    }

    /// In the recording state, behind the pass's barrier.
    #[must_use]
    pub fn command_buffer(&self) -> raw::CommandBuffer {
        self.command_buffer
    }

    /// A buffer the pass declares.
    ///
    /// # Panics
    /// If it is of another graph or no pass uses it.
    #[must_use]
    pub fn buffer(&self, buffer: Res<Buffer>) -> raw::Buffer {
        match self.object(buffer.into()) {
            Object::Buffer(object) => object.raw(),
            _ => panic!("{buffer:?} has no memory"),
        }
    }

    /// An image the pass declares, and its view.
    ///
    /// # Panics
    /// If it is of another graph or no pass uses it.
    #[must_use]
    pub fn image(&self, image: Res<Image>) -> (raw::Image, raw::ImageView) {
        match self.object(image.into()) {
            Object::Image(object) => (object.raw(), object.view()),
            _ => panic!("{image:?} has no memory"),
        }
    }

    fn object(&self, resource: AnyRes) -> &Object {
        resource.index_in(self.graph).map_or(&Object::None, |index| &self.objects[index as usize])
    }
}
