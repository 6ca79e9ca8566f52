//! Results on stdout.

use super::failure::Failure;
use super::interrupt;
use crate::text::printable_lines;
use std::io::{self, Write};

/// Prints a result, the last thing that a command does; a reader that has closed the pipe has read enough.
pub(super) fn print(text: &str) -> Result<(), Failure> {
    interrupt::finished();
    let mut out = io::stdout().lock();
    match out.write_all(printable_lines(text).as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}
