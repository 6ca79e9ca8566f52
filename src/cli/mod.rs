//! Commands: what they are asked, what they print and how they end.

mod args;
mod chart;
mod choose;
mod compare;
mod doctor;
mod economy;
mod graph;
mod interrupt;
mod methods;
mod paper;
mod progress;
mod render;
mod scene;
mod settings;
mod stats;
mod stress;
mod table;

use crate::config::{ConfigError, RenderConfig};
use crate::renderer;
use crate::scene::{LoadOptions, Scene, SceneError, builtin};
use crate::{ErrorClass, denoise, output, vk};
use clap::{CommandFactory, Parser};
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// An error that ends a command.
#[derive(Debug)]
struct Failure {
    class: ErrorClass,
    error: anyhow::Error,
}

impl Failure {
    /// What the user gave cannot be used.
    fn input(error: impl Into<anyhow::Error>) -> Self {
        Self { class: ErrorClass::Input, error: error.into() }
    }
}

/// The exit code that tells scripts of a failure: the one place that knows them.
const fn exit_code(class: ErrorClass) -> u8 {
    match class {
        ErrorClass::Input => 2,
        ErrorClass::Device => 3,
        ErrorClass::Lost | ErrorClass::Memory => 75,
        ErrorClass::Interrupted => 130,
        ErrorClass::Other => 1,
    }
}

/// Bad input, said in words.
macro_rules! input {
    ($($words:tt)*) => { $crate::cli::Failure::input(anyhow::anyhow!($($words)*)) };
}
use input;

/// Errors of the library tell their class.
macro_rules! classed {
    ($($error:ty),* $(,)?) => {
        $(impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                Self { class: error.class(), error: error.into() }
            }
        })*
    };
}
classed!(
    SceneError,
    ConfigError,
    crate::chart::grid::GridError,
    crate::chart::reference::ReferenceError,
    crate::chart::sweep::Error,
    crate::docs::Error,
    output::Error,
    renderer::Error,
    vk::Error,
);

impl From<denoise::Error> for Failure {
    fn from(error: denoise::Error) -> Self {
        Self { class: error.class(), error: anyhow::anyhow!("--denoise: {error}") }
    }
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self { class: ErrorClass::Other, error: error.into() }
    }
}

pub fn main() -> ExitCode {
    let run = || match args::Cli::parse().command {
        args::Command::Render(args) => render::run(&args),
        args::Command::Paper(args) => paper::run(&args),
        args::Command::Chart(args) => chart::run(&args),
        args::Command::Compare(args) => compare::run(&args),
        args::Command::Stress(args) => stress::run(&args),
        args::Command::Methods(args) => methods::run(&args),
        args::Command::Doctor(args) => doctor::run(&args),
        args::Command::Graph(args) => graph::run(&args),
        args::Command::Completions(args) => completions(args.shell),
    };
    match std::panic::catch_unwind(run) {
        Ok(Ok(())) => ExitCode::SUCCESS,
        // The panic has said what it is; 101 is no exit code of ours.
        Err(_) => ExitCode::FAILURE,
        Ok(Err(Failure { class, error })) => {
            let _ = writeln!(io::stderr(), "error: {error}");
            ExitCode::from(exit_code(class))
        }
    }
}

/// Prints the script that makes a shell complete this command's words.
fn completions(shell: clap_complete::Shell) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut args::Cli::command(), "parhelion", &mut script);
    print(&String::from_utf8_lossy(&script))
}

/// Prints a result; a reader that has closed the pipe has read enough.
fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}

/// Loads the scene asked for, or the default room.
fn load(scene: Option<&Path>, which: Option<String>) -> Result<Scene, Failure> {
    let default = format!("builtin:{}", builtin::DEFAULT);
    let path = scene.unwrap_or(Path::new(&default));
    Ok(crate::scene::load(path, &LoadOptions { scene: which })?)
}

/// What every setting of a report begins with: the defaults, at the size and seed that are asked for.
fn base(machine: &args::Machine) -> Result<RenderConfig, Failure> {
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
fn folder<F: AsRef<Path>>(
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
fn check_folder<F: AsRef<Path>>(
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors of each class, and the code that they end the command with; README lists them all.
    #[test]
    fn exit_codes_follow_from_classes() {
        let word = || "x".to_owned();
        let source = || io::Error::from(io::ErrorKind::StorageFull);
        let cases: [(Failure, u8); 9] = [
            (ConfigError::Assignment(word()).into(), 2),
            (renderer::Error::SoftwareOnly { visibility: "boxes" }.into(), 2),
            (vk::Error::NoDevice { found: Vec::new() }.into(), 3),
            (renderer::Error::NoRayQuery { device: word() }.into(), 3),
            (
                renderer::Error::from(vk::Error::DeviceLost { call: "vkQueueSubmit2", object: word() })
                    .into(),
                75,
            ),
            (vk::Error::OutOfDeviceMemory { what: word(), bytes: 2, available: 1 }.into(), 75),
            (renderer::Error::Cancelled.into(), 130),
            (output::Error { file: "a.exr".into(), source: source() }.into(), 1),
            (source().into(), 1),
        ];
        let readme = include_str!("../../README.md");
        let listed = readme.split("Exit codes:").nth(1).and_then(|text| text.split("\n- ").next()).unwrap();
        for (Failure { class, error }, expected) in cases {
            let code = exit_code(class);
            assert_eq!(code, expected, "{error}");
            assert!(listed.split([' ', ';', '\n']).any(|word| word == code.to_string()), "{code}: {listed}");
        }
    }
}
