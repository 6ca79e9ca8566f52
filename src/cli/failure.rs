//! Errors that end a command, and the exit codes that they end it with.

use crate::config::ConfigError;
use crate::scene::SceneError;
use crate::{ErrorClass, denoise, output, renderer, vk};
use std::io;

/// An error that ends a command.
#[derive(Debug)]
pub(super) struct Failure {
    pub(super) class: ErrorClass,
    pub(super) error: anyhow::Error,
}

impl Failure {
    /// What the user gave cannot be used.
    pub(super) fn input(error: impl Into<anyhow::Error>) -> Self {
        Self { class: ErrorClass::Input, error: error.into() }
    }
}

/// The exit code that tells scripts of a failure: the one place that knows them.
pub(super) const fn exit_code(class: ErrorClass) -> u8 {
    match class {
        ErrorClass::Input => 2,
        ErrorClass::Device => 3,
        ErrorClass::Lost => 75,
        ErrorClass::Memory => 71,
        ErrorClass::Interrupted => 130,
        ErrorClass::Other => 1,
    }
}

/// Bad input, said in words.
macro_rules! input {
    ($($words:tt)*) => { $crate::cli::failure::Failure::input(anyhow::anyhow!($($words)*)) };
}
pub(super) use input;

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
            (vk::Error::OutOfDeviceMemory { what: word(), bytes: 2, available: 1 }.into(), 71),
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
