use crate::scene::SceneError;
use crate::scene::file::Files;
use crate::scene::import::Mended;
use ::gltf::json;
use std::borrow::Cow;
use std::path::Path;

/// A file being read.
pub(super) struct Context<'a> {
    pub(super) file: &'a Path,
    pub(super) files: &'a Files,
    pub(super) mended: &'a Mended,
    pub(super) root: &'a json::Root,
    /// The nodes as they are in the file, with all digits of their numbers.
    pub(super) nodes: &'a json::Value,
    /// Data of each buffer, as long as it declares; none where it has no URI.
    pub(super) buffers: &'a [Option<Cow<'a, [u8]>>],
    /// Vertex attributes may have the types of `KHR_mesh_quantization`.
    pub(super) quantized: bool,
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
}
