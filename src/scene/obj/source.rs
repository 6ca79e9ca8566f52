//! The file that is read: where those beside it are, what it may take, and what is wrong with it.

use super::text;
use crate::memory::{Budget, Shortage};
use crate::scene::file::{self, Files, Found};
use crate::scene::mend::Mended;
use crate::scene::{Fault, Image, LoadOptions, SceneError};
use std::cell::RefCell;
use std::path::{Path, PathBuf};

pub(super) struct Source<'a> {
    pub(super) path: &'a Path,
    files: Files,
    mended: Mended,
    budget: RefCell<Budget>,
}

impl<'a> Source<'a> {
    pub(super) fn new(path: &'a Path, options: &LoadOptions) -> Result<Self, SceneError> {
        let budget = RefCell::new(Budget::of_process());
        Ok(Self { path, files: Files::of(path, options)?, mended: Mended::new(options), budget })
    }

    /// As [`Mended::mend`], of a line in `file`.
    pub(super) fn mend(
        &self,
        file: &Path,
        line: usize,
        problem: impl Into<String>,
        remedy: &'static str,
    ) -> Result<(), SceneError> {
        self.mended.mend(self.path, SceneError::new(file, format!("line {line}"), problem), remedy)
    }

    /// The same of the scene's file as a whole.
    pub(super) fn mend_whole(
        &self,
        problem: impl Into<String>,
        remedy: &'static str,
    ) -> Result<(), SceneError> {
        self.mended.mend(self.path, SceneError::new(self.path, "file", problem), remedy)
    }

    pub(super) fn notes(&self) -> Vec<String> {
        self.mended.notes()
    }

    /// Counts memory that is about to be taken.
    pub(super) fn take(&self, bytes: u64) -> Result<(), Shortage> {
        self.budget.borrow_mut().take(bytes)
    }

    /// A picture of the file at `path`, which the scene calls `name`.
    pub(super) fn image(&self, path: &Path, name: &str) -> Result<Image, Fault> {
        let budget = &mut *self.budget.borrow_mut();
        // The encoded bytes go again.
        let bytes = file::read_file(path, &mut budget.clone())?;
        file::decode_image(name, &bytes, budget)
    }

    pub(super) fn short(&self, shortage: Shortage) -> SceneError {
        SceneError::short(self.path, "file", shortage)
    }

    /// The text of the scene's file or of one beside it; none where that can't be read, of which the inner `Err` says why.
    pub(super) fn text(&self, path: &Path) -> Result<Result<String, String>, SceneError> {
        let budget = &mut *self.budget.borrow_mut();
        let read = file::read_file(path, budget).and_then(|bytes| {
            // Text that is not what its bytes are already.
            budget.take(bytes.len() as u64)?;
            Ok(text::decoded(bytes)?)
        });
        match read {
            Ok(text) => Ok(Ok(text)),
            Err(Fault::Broken(problem)) => Ok(Err(problem)),
            Err(short) => Err(short.of(path, "file")),
        }
    }

    pub(super) fn is_there(&self, name: &str) -> bool {
        self.files.find(&slashed(name)).is_ok()
    }

    /// The path of a file as it is from the scene's, where it lies in that folder.
    pub(super) fn beside_scene(&self, real: &Path) -> PathBuf {
        let folder = self.path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
        match folder.canonicalize().ok().and_then(|folder| Some(real.strip_prefix(folder).ok()?.to_owned())) {
            Some(rest) => self.path.with_file_name(rest),
            None => real.to_owned(),
        }
    }

    /// What stands before the name of a file beside the one at `path`, where it lies in another folder than the scene.
    pub(super) fn folder_of(&self, path: &Path) -> String {
        let folder = path.parent().unwrap_or(Path::new(""));
        let folder = folder.strip_prefix(self.path.parent().unwrap_or(Path::new(""))).unwrap_or(folder);
        if folder == Path::new("") { String::new() } else { format!("{}/", folder.display()) }
    }

    /// A file named in `line` of `file`: as it stands there, or beside `folder` (that of the file which names it, as seen
    /// from the scene's), or else under another name that is much like it. `Err` says why there is none.
    pub(super) fn find(
        &self,
        file: &Path,
        line: usize,
        folder: &str,
        name: &str,
    ) -> Result<Result<Found, String>, SceneError> {
        let name = slashed(name);
        let exact = |name: &str| self.files.find(name).ok().filter(|found| found.differs.is_none());
        let beside = format!("{folder}{name}");
        let found = match exact(&name).or_else(|| exact(&beside)) {
            Some(found) => found,
            None => match self
                .files
                .search(&name)
                .or_else(|problem| self.files.search(&beside).map_err(|_| problem))
            {
                Ok(found) => found,
                Err(problem) => return Ok(Err(problem)),
            },
        };
        if let Some(differs) = &found.differs {
            let problem =
                format!("`{}` is not there, but `{}` is", file::shortened(&name), file::shortened(differs));
            self.mend(file, line, problem, "files of nearly that name, or that lie elsewhere, are taken")?;
        }
        Ok(Ok(found))
    }
}

fn slashed(name: &str) -> String {
    name.trim_matches('"').replace('\\', "/")
}
