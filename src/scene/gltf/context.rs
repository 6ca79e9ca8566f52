use crate::memory::{Budget, Shortage};
use crate::scene::clip::Clip;
use crate::scene::file::Files;
use crate::scene::mend::Mended;
use crate::scene::{Fault, SceneError};
use ::gltf::json;
use std::borrow::Cow;
use std::cell::{Cell, RefCell};
use std::path::Path;
use std::sync::Arc;

/// A file being read.
pub(super) struct Context<'a> {
    pub(super) file: &'a Path,
    pub(super) files: &'a Files,
    pub(super) mended: &'a Mended,
    pub(super) root: &'a json::Root,
    /// The nodes as they are in the file, with all digits of their numbers.
    pub(super) nodes: &'a [json::Value],
    /// Parents of nodes.
    pub(super) parents: &'a [Option<usize>],
    pub(super) buffers: &'a [Buffer<'a>],
    /// Accessors that something read.
    pub(super) read: &'a [Cell<bool>],
    /// Vertex attributes may have the types of `KHR_mesh_quantization`.
    pub(super) quantized: bool,
    /// Animations, where the scene keeps what moves it.
    pub(super) clips: Arc<Vec<Clip>>,
    /// Pointers of channels that are right, and name what is not moved here.
    pub(super) unplayed: RefCell<Vec<String>>,
    /// Of the machine's memory.
    pub(super) budget: &'a RefCell<Budget>,
}

/// Data of a buffer.
pub(super) enum Buffer<'a> {
    /// Not always as long as it declares.
    Data(Cow<'a, [u8]>),
    /// It names none.
    Nowhere,
    /// Theirs can't be had.
    Lost(String),
}

impl Context<'_> {
    /// Notes a defect of `element`, and what is done about it; an error where the load is strict.
    pub(super) fn mend(
        &self,
        element: impl Into<String>,
        problem: impl Into<String>,
        remedy: &'static str,
    ) -> Result<(), SceneError> {
        self.mended.mend(self.file, self.error(element, problem), remedy)
    }

    pub(super) fn error(&self, element: impl Into<String>, problem: impl Into<String>) -> SceneError {
        SceneError::new(self.file, element, problem)
    }

    pub(super) fn fault(&self, element: impl Into<String>, fault: impl Into<Fault>) -> SceneError {
        fault.into().of(self.file, element)
    }

    /// Takes memory for `count` items of type `T`.
    pub(super) fn take<T>(&self, count: usize) -> Result<(), Shortage> {
        self.budget.borrow_mut().take(count as u64 * size_of::<T>() as u64)
    }
}
