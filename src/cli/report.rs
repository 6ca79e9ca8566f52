//! What commands that write reports have in common.

use super::failure::{Failure, input};
use super::{args, scene};
use crate::config::{ConfigError, RenderConfig};
use crate::output;
use std::fs;
use std::path::{Path, PathBuf};

/// What every setting of a report begins with: the defaults, at the size and seed that are asked for.
pub(super) fn base(machine: &args::Machine) -> Result<RenderConfig, Failure> {
    let mut base = RenderConfig::default();
    base.size = machine.size.unwrap_or(base.size);
    base.seed = machine.seed.unwrap_or(base.seed);
    base.validate().map_err(|error| match error {
        ConfigError::Value { key, problem } if key == "size" => input!("--size: {problem}"),
        error => error.into(),
    })?;
    Ok(base)
}

/// Where the report on a scene goes, known to be writable before anything is computed; made when there is something to
/// write.
pub(super) fn folder<F: AsRef<Path>>(
    output: Option<&Path>,
    common: &args::Common,
    suffix: &str,
    files: impl IntoIterator<Item = F>,
) -> Result<PathBuf, Failure> {
    let folder = output.map_or_else(
        || {
            let mut name = scene::stem(common);
            name.push(suffix);
            name.into()
        },
        PathBuf::from,
    );
    check_folder(&folder, "report", files)?;
    Ok(folder)
}

/// Checks, before anything is computed, that a folder for a `report` can hold `files`; it may have to be made.
pub(super) fn check_folder<F: AsRef<Path>>(
    folder: &Path,
    report: &str,
    files: impl IntoIterator<Item = F>,
) -> Result<(), Failure> {
    match fs::metadata(folder) {
        Ok(metadata) if !metadata.is_dir() => {
            Err(input!("{}: a file; the {report} needs a folder (-o DIR)", folder.display()))
        }
        Ok(_) => files
            .into_iter()
            .try_for_each(|file| output::check_writable(&folder.join(file)).map_err(Failure::input)),
        Err(_) => output::check_writable(folder).map_err(Failure::input),
    }
}
