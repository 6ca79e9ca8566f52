//! Running a plan: transient memory, command buffers, bands and times.

mod bands;
mod commands;
mod executor;
mod flight;
mod in_flight;
mod options;
mod plans;
mod rates;
mod run;
mod slots;
mod transients;

pub use executor::Executor;
pub use in_flight::InFlight;
pub use options::{Progress, RunOptions};
pub use run::Run;
