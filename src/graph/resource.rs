//! What resources are, and handles of those of a graph.

use crate::vk::Format;
use std::{fmt, marker::PhantomData};

/// Marks handles of storage buffers, [`Res<Buffer>`].
#[derive(Clone, Copy, Debug)]
pub enum Buffer {}

/// Marks handles of two-dimensional storage images, [`Res<Image>`].
#[derive(Clone, Copy, Debug)]
pub enum Image {}

/// Handle of a resource of one graph. Using it in another graph is an error that names the pass.
pub struct Res<T> {
    pub(super) any: AnyRes,
    kind: PhantomData<fn() -> T>,
}

impl<T> Res<T> {
    pub(super) fn new(graph: u32, index: u32) -> Self {
        Self { any: AnyRes { graph, index }, kind: PhantomData }
    }
}

impl<T> Clone for Res<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Res<T> {}

impl<T> fmt::Debug for Res<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Res({}.{})", self.any.graph, self.any.index)
    }
}

/// Handle of a resource whose kind is checked when it is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AnyRes {
    graph: u32,
    index: u32,
}

impl AnyRes {
    pub(super) const fn new(graph: u32, index: u32) -> Self {
        Self { graph, index }
    }

    /// The index of a resource of the graph with this id.
    pub(super) fn index_in(self, graph: u32) -> Option<u32> {
        (self.graph == graph).then_some(self.index)
    }
}

impl<T> From<Res<T>> for AnyRes {
    fn from(res: Res<T>) -> Self {
        res.any
    }
}

/// Size and format of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ImageDesc {
    /// Width and height in texels.
    pub extent: [u32; 2],
    /// Format of a texel.
    pub format: Format,
}

impl ImageDesc {
    /// An image of `extent` texels.
    #[must_use]
    pub const fn new(extent: [u32; 2], format: Format) -> Self {
        Self { extent, format }
    }

    /// The grid of `n`×`n` windows that covers the image: each side divided by `n`, rounded up.
    ///
    /// ```
    /// use parhelion::{graph::ImageDesc, vk::Format};
    /// let full = ImageDesc::new([801, 600], Format::Rgba16Float);
    /// assert_eq!(full.scaled_down(4).extent, [201, 150]);
    /// ```
    ///
    /// # Panics
    /// If `n` is 0.
    #[must_use]
    pub const fn scaled_down(self, n: u32) -> Self {
        let [width, height] = self.extent;
        Self { extent: [width.div_ceil(n), height.div_ceil(n)], ..self }
    }

    /// The same size in another format.
    #[must_use]
    pub const fn with_format(self, format: Format) -> Self {
        Self { format, ..self }
    }

    /// Bytes of the texels, tightly packed.
    #[must_use]
    pub fn bytes(self) -> u64 {
        u64::from(self.extent[0]) * u64::from(self.extent[1]) * u64::from(self.format.size())
    }
}

/// Size of a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BufferDesc {
    /// Bytes.
    pub size: u64,
}

/// What a resource is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Desc {
    /// A storage buffer.
    Buffer(BufferDesc),
    /// A storage image.
    Image(ImageDesc),
    /// Descriptor set 0 and all it leads to, see [`Graph::scene`](super::Graph::scene).
    Scene,
}

impl Desc {
    /// Bytes of the contents; 0 for the scene, which the graph does not own.
    #[must_use]
    pub fn bytes(self) -> u64 {
        match self {
            Self::Buffer(desc) => desc.size,
            Self::Image(desc) => desc.bytes(),
            Self::Scene => 0,
        }
    }

    pub(super) fn noun(self) -> &'static str {
        match self {
            Self::Buffer(_) => "buffer",
            Self::Image(_) => "image",
            Self::Scene => "scene",
        }
    }
}

/// A promise of contents, redeemed once with [`Run::take`](super::Run::take).
pub struct Ticket<T> {
    pub(super) graph: u32,
    pub(super) index: usize,
    kind: PhantomData<fn() -> T>,
}

impl<T> Ticket<T> {
    pub(super) fn new(graph: u32, index: usize) -> Self {
        Self { graph, index, kind: PhantomData }
    }
}

impl<T> fmt::Debug for Ticket<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Ticket({}.{})", self.graph, self.index)
    }
}

/// A promise of the bytes a pass left in a resource, from [`Graph::tap`](super::Graph::tap).
#[derive(Debug)]
pub struct Tap {
    /// Redeems the bytes; images come row by row from the top left, tightly packed.
    pub ticket: Ticket<u8>,
    /// What they are.
    pub desc: Desc,
}
