//! Pictures and numbers as files. Every file is written beside its place and renamed when complete, so that
//! no reader ever sees half of one.

mod exr;
mod file;
mod magma;
mod png;

pub use exr::{Attribute, Channels, Picture, ReadPicture, read_exr, write_exr};
pub use file::{
    Sink, Writing, check_writable, discard_unfinished, extension, is_stream, write_file, writing,
};
pub use magma::magma;
pub use png::{read_png_texts, write_png};

use crate::ErrorClass;
use std::path::PathBuf;

/// Name and version of this library, for what pictures say of the software that wrote them.
pub const SOFTWARE: &str = concat!("parhelion ", env!("CARGO_PKG_VERSION"));

/// A file that cannot be written or read.
#[derive(Debug, thiserror::Error)]
#[error("{}: {source}", file.display())]
pub struct Error {
    /// The file.
    pub file: PathBuf,
    /// What went wrong.
    pub source: std::io::Error,
}

impl Error {
    /// What kind of failure this is: too little memory, or none that the input is known to be the cause of.
    #[must_use]
    pub fn class(&self) -> ErrorClass {
        match self.source.kind() {
            std::io::ErrorKind::OutOfMemory => ErrorClass::Memory,
            _ => ErrorClass::Other,
        }
    }
}
