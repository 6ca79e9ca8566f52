//! Ctrl-C: work that can stop in good order is asked to, anything else ends at once.

use crate::output::discard_unfinished;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};

/// Set by the first signal.
pub(super) static CANCEL: AtomicBool = AtomicBool::new(false);

/// Whether the work at hand looks at [`CANCEL`].
static HEEDED: AtomicBool = AtomicBool::new(false);

/// From now on the first signal only sets [`CANCEL`]; the second ends the program.
pub(super) fn heeded() {
    HEEDED.store(true, Ordering::SeqCst);
}

/// Listens for SIGINT and SIGTERM.
#[cfg(unix)]
pub(super) fn listen() -> io::Result<()> {
    use crate::ErrorClass;
    use signal_hook::consts::{SIGINT, SIGTERM};
    let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM])?;
    std::thread::Builder::new().name("signals".into()).spawn(move || {
        for _ in signals.forever() {
            if CANCEL.swap(true, Ordering::SeqCst) || !HEEDED.load(Ordering::SeqCst) {
                discard_unfinished();
                // Without exit handlers: drivers' own run while their threads still work.
                signal_hook::low_level::exit(i32::from(super::failure::exit_code(ErrorClass::Interrupted)));
            }
        }
    })?;
    Ok(())
}

/// Elsewhere the system ends the program; files appear whole or not at all.
#[cfg(not(unix))]
pub(super) fn listen() -> io::Result<()> {
    Ok(())
}
