//! What a compute kernel is, apart from any device.

use std::borrow::Cow;

/// Which traversal answers a kernel's rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Backend {
    /// `VK_KHR_ray_query` over acceleration structures built by the driver.
    RayQuery,
    /// A compressed wide BVH traversed by the kernel itself.
    Software,
}

impl Backend {
    /// The word for it on the command line, in statistics and in messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::RayQuery => "ray-query",
            Self::Software => "software",
        }
    }
}

/// How a pass touches a resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Access {
    /// Reads only.
    Read,
    /// Writes every element it is responsible for and reads none.
    Write,
    /// Reads and writes.
    ReadWrite,
}

impl Access {
    /// Whether the pass depends on earlier contents.
    #[must_use]
    pub fn reads(self) -> bool {
        self != Self::Write
    }

    /// Whether the pass changes the contents.
    #[must_use]
    pub fn writes(self) -> bool {
        self != Self::Read
    }
}

/// Texel formats of storage images.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// Four 32-bit floats.
    Rgba32Float,
    /// Two 32-bit floats.
    Rg32Float,
    /// One 32-bit float.
    R32Float,
    /// Four 32-bit unsigned integers.
    Rgba32Uint,
    /// One 32-bit unsigned integer.
    R32Uint,
    /// Four 16-bit floats.
    Rgba16Float,
    /// Four 8-bit unsigned normalised numbers.
    Rgba8Unorm,
}

impl Format {
    /// Bytes a texel.
    #[must_use]
    pub fn size(self) -> u32 {
        match self {
            Self::Rgba32Float | Self::Rgba32Uint => 16,
            Self::Rg32Float | Self::Rgba16Float => 8,
            Self::R32Float | Self::R32Uint | Self::Rgba8Unorm => 4,
        }
    }
}

/// What a binding of set 1 holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BindingKind {
    /// A storage buffer; `stride` is the size of its runtime array's element, 0 where it has none.
    Buffer {
        /// Bytes an element of the trailing runtime array.
        stride: u32,
    },
    /// A storage image.
    Image(Format),
}

/// One binding of set 1, as reflected from GLSL.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Binding {
    /// The variable's name in GLSL.
    pub name: Cow<'static, str>,
    /// Binding number; never written by hand in Rust.
    pub binding: u32,
    /// Type.
    pub kind: BindingKind,
    /// From `readonly` / `writeonly`.
    pub access: Access,
}

/// One member of a kernel's push constants.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParamMember {
    /// GLSL name.
    pub name: Cow<'static, str>,
    /// GLSL type, e.g. `vec3`.
    pub ty: Cow<'static, str>,
    /// Byte offset.
    pub offset: u32,
    /// Bytes.
    pub size: u32,
}

/// SPIR-V of a kernel, for each backend where it traces rays.
#[derive(Clone, Debug)]
pub enum Modules {
    /// Traces no ray: one module for every device.
    Plain(Cow<'static, [u32]>),
    /// Traces rays. A kernel compiled at run time holds the one its renderer uses.
    Tracing {
        /// For [`Backend::Software`].
        software: Option<Cow<'static, [u32]>>,
        /// For [`Backend::RayQuery`].
        ray_query: Option<Cow<'static, [u32]>>,
    },
}

/// Everything about a compute kernel that does not depend on a device.
#[derive(Clone, Debug)]
pub struct KernelCode {
    /// Path under `glsl/` without extension, or the name given at run time.
    pub name: Cow<'static, str>,
    /// Invocations in a workgroup.
    pub workgroup: [u32; 3],
    /// Set 1, in order of declaration.
    pub bindings: Cow<'static, [Binding]>,
    /// Size of the push constants in bytes, at most 128.
    pub params_size: u32,
    /// Members of the push constants.
    pub params: Cow<'static, [ParamMember]>,
    /// Ids of the specialization constants, in the order their values are passed (32 bits each).
    pub spec_ids: Cow<'static, [u32]>,
    /// Whether it reads set 0 (the scene).
    pub uses_scene: bool,
    /// The code.
    pub modules: Modules,
}

impl KernelCode {
    /// The module for a backend, `None` where the kernel was not compiled for it.
    #[must_use]
    pub fn module(&self, backend: Backend) -> Option<&[u32]> {
        match &self.modules {
            Modules::Plain(words) => Some(words),
            Modules::Tracing { software, ray_query } => match backend {
                Backend::Software => software.as_deref(),
                Backend::RayQuery => ray_query.as_deref(),
            },
        }
    }
}
