use crate::ErrorClass;
use crate::memory::Shortage;
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
    pub(super) class: ErrorClass,
}

impl SceneError {
    pub(crate) fn new(file: &Path, element: impl Into<String>, problem: impl Into<String>) -> Self {
        let class = ErrorClass::Input;
        Self { file: file.to_owned(), element: element.into(), problem: problem.into(), class }
    }

    /// A scene that this machine has too little memory for.
    pub(crate) fn short(file: &Path, element: impl Into<String>, shortage: Shortage) -> Self {
        Self { class: ErrorClass::Memory, ..Self::new(file, element, shortage.to_string()) }
    }

    /// What kind of failure this is: bad input, or too little memory.
    #[must_use]
    pub fn class(&self) -> ErrorClass {
        self.class
    }
}
