use crate::ErrorClass;
use std::path::{Path, PathBuf};

/// A scene that cannot be used: its file, the element in it, and what is wrong with that element.
#[derive(Debug, thiserror::Error)]
#[error("{}: {element}: {problem}", file.display())]
pub struct SceneError {
    /// The file, or `builtin:NAME`, or `scene` for one made in code.
    pub file: PathBuf,
    /// Which element, as the format names it: `meshes[3].primitives[0]`, `accessors[7]`, `line 12`.
    pub element: String,
    /// What is wrong, and where it helps what was expected.
    pub problem: String,
}

impl SceneError {
    pub(crate) fn new(file: &Path, element: impl Into<String>, problem: impl Into<String>) -> Self {
        Self { file: file.to_owned(), element: element.into(), problem: problem.into() }
    }

    /// What kind of failure this is: bad input.
    #[must_use]
    pub fn class(&self) -> ErrorClass {
        ErrorClass::Input
    }
}
