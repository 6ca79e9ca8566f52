//! Signals that ask the program to stop: work that can stop in good order is asked to, anything else ends at once.

use crate::output::{Writing, discard_unfinished, writing};
use std::io;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::time::{Duration, Instant};

/// Set by the first signal.
pub(super) static CANCEL: AtomicBool = AtomicBool::new(false);

/// What the main thread is at, one of the three below.
static STATE: AtomicU8 = AtomicU8::new(AT_ONCE);

/// Nothing that would be lost: the first signal ends the program.
const AT_ONCE: u8 = 0;
/// Work that looks at [`CANCEL`], and may yet be stuck in one call of the driver.
const HEEDED: u8 = 1;
/// Writing what there is.
const FINISHING: u8 = 2;

/// How long work may take to see [`CANCEL`].
const PATIENCE: Duration = Duration::from_secs(4);

/// From now on the first signal only sets [`CANCEL`]; the second ends the program, as it ends by itself where the work
/// does not.
pub(super) fn heeded() {
    STATE.store(HEEDED, Ordering::SeqCst);
}

/// From now on what has been drawn is written, however long it takes.
pub(super) fn finishing() {
    STATE.store(FINISHING, Ordering::SeqCst);
}

/// From now on nothing is left to be lost.
pub(super) fn finished() {
    STATE.store(AT_ONCE, Ordering::SeqCst);
}

/// Listens for SIGINT, SIGTERM, SIGQUIT and SIGHUP; for the last not where it is ignored, as `nohup` has it.
#[cfg(unix)]
pub(super) fn listen() -> io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
    let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM, SIGQUIT])?;
    if !is_ignored(SIGHUP) {
        signals.add_signal(SIGHUP)?;
    }
    std::thread::Builder::new().name("signals".into()).spawn(move || {
        for _ in signals.forever() {
            let first = !CANCEL.swap(true, Ordering::SeqCst);
            let heeds = STATE.load(Ordering::SeqCst) != AT_ONCE && writing() != Some(Writing::Stream);
            // Without a thread to watch the work is not waited for.
            if !(first && heeds) || std::thread::Builder::new().name("patience".into()).spawn(watch).is_err()
            {
                end();
            }
        }
    })?;
    Ok(())
}

/// Ends the program where the work has not stopped in time; never in the middle of a file that is whole in a moment.
#[cfg(unix)]
fn watch() {
    let begun = Instant::now();
    loop {
        std::thread::sleep(Duration::from_millis(50));
        let busy = match writing() {
            Some(Writing::File) => true,
            Some(Writing::Stream) => false,
            None => STATE.load(Ordering::SeqCst) == FINISHING,
        };
        if !busy && begun.elapsed() > PATIENCE {
            end();
        }
    }
}

#[cfg(unix)]
fn end() -> ! {
    discard_unfinished();
    // Without exit handlers: drivers' own run while their threads still work.
    let code = super::failure::exit_code(crate::ErrorClass::Interrupted);
    signal_hook::low_level::exit(i32::from(code))
}

/// Whether a signal was ignored when the program began; false where the system does not tell.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok())
        .is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

/// Elsewhere the system ends the program; files appear whole or not at all.
#[cfg(not(unix))]
pub(super) fn listen() -> io::Result<()> {
    Ok(())
}
