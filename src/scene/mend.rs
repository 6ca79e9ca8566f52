//! How strictly files are read: what is mended, and told, or refused.

use super::SceneError;
use std::cell::RefCell;
use std::collections::HashSet;
use std::hash::{BuildHasher, BuildHasherDefault, DefaultHasher};
use std::path::{Path, PathBuf};

/// How a file is read.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Which of several scenes in the file: a name or an index; the file's default otherwise.
    pub scene: Option<String>,
    /// Whether defects are errors that are mended and noted otherwise.
    pub strict: bool,
    /// Folders that files of the scene may lie in beside its own; nothing outside is read, whatever paths and links say.
    pub roots: Vec<PathBuf>,
    /// Whether the scene keeps what its file's animations move, for [`Scene::pose`](super::Scene::pose).
    pub motion: bool,
}

/// Defects that are mended, or, where a load is strict, errors.
pub(super) struct Mended {
    strict: bool,
    kinds: RefCell<Vec<Kind>>,
}

/// Defects mended in one way.
struct Kind {
    remedy: &'static str,
    /// The first of them, in words.
    first: String,
    /// Hashes of where they are; a file read twice has each of them once.
    places: HashSet<u64>,
}

impl Mended {
    pub(super) fn new(options: &LoadOptions) -> Self {
        Self { strict: options.strict, kinds: RefCell::default() }
    }

    /// Notes a defect of `scene`'s file or of one beside it; `remedy` says in a clause what is done about it.
    ///
    /// # Errors
    /// The defect itself, where the load is strict.
    pub(super) fn mend(
        &self,
        scene: &Path,
        defect: SceneError,
        remedy: &'static str,
    ) -> Result<(), SceneError> {
        if self.strict {
            return Err(defect);
        }
        let SceneError { file, element, problem, .. } = &defect;
        let mut kinds = self.kinds.borrow_mut();
        let kind = match kinds.iter_mut().position(|kind| kind.remedy == remedy) {
            Some(known) => &mut kinds[known],
            None => {
                let other = file.strip_prefix(scene.parent().unwrap_or(Path::new(""))).unwrap_or(file);
                let within = if file == scene { String::new() } else { format!("{}: ", other.display()) };
                let first = format!("{within}{element}: {problem}");
                kinds.push(Kind { remedy, first, places: HashSet::new() });
                kinds.last_mut().expect("just added")
            }
        };
        kind.places.insert(BuildHasherDefault::<DefaultHasher>::default().hash_one((file, element)));
        Ok(())
    }

    /// One note for each kind of defect.
    pub(super) fn notes(&self) -> Vec<String> {
        let note = |Kind { remedy, first, places }: &Kind| match places.len() {
            1 => format!("{first}; {remedy}"),
            count => format!("{first}; {remedy} (and in {} more places)", count - 1),
        };
        self.kinds.borrow().iter().map(note).collect()
    }
}
