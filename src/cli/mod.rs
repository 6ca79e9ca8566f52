//! Commands: what they are asked, what they print and how they end.

mod args;
mod chart;
mod choose;
mod compare;
mod doctor;
mod economy;
mod failure;
mod graph;
mod interrupt;
mod methods;
mod paper;
mod print;
mod progress;
mod render;
mod report;
mod scene;
mod sequence;
mod settings;
mod sheet;
mod stats;
mod stress;
mod table;

use crate::{text, vk};
use clap::{CommandFactory, Parser};
use failure::{Failure, exit_code};
use std::io::{self, Write};
use std::process::ExitCode;

pub fn main() -> ExitCode {
    leave_out_broken_drivers();
    let run = || match parse().command {
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
            let _ = writeln!(io::stderr(), "error: {}", text::line(&error.to_string()));
            ExitCode::from(exit_code(class))
        }
    }
}

/// Begins anew, with the drivers that work, where one that does not would keep the Vulkan loader from all others: it takes
/// their names from its environment, which a running program cannot change safely.
#[cfg(unix)]
fn leave_out_broken_drivers() {
    use std::os::unix::process::CommandExt;
    use std::process::Command;
    let mut words = std::env::args_os();
    if let (Some(drivers), Ok(program), Some(name)) =
        (vk::usable_drivers(), std::env::current_exe(), words.next())
    {
        let mut again = Command::new(program);
        // What fails here fails later, and is told then.
        let _ = again.arg0(name).args(words).env("VK_DRIVER_FILES", drivers).exec();
    }
}

#[cfg(not(unix))]
fn leave_out_broken_drivers() {}

/// What is asked for; complaints show words of it, names of files among them, as messages do.
fn parse() -> args::Cli {
    args::Cli::try_parse().unwrap_or_else(|error| {
        let shown = std::env::args_os().map(|word| text::line(&word.to_string_lossy()));
        args::Cli::try_parse_from(shown).err().unwrap_or(error).exit()
    })
}

/// Prints the script that makes a shell complete this command's words.
fn completions(shell: clap_complete::Shell) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut args::Cli::command(), "parhelion", &mut script);
    print::print(&String::from_utf8_lossy(&script))
}
