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
mod settings;
mod stats;
mod stress;
mod table;

use clap::{CommandFactory, Parser};
use failure::{Failure, exit_code};
use std::io::{self, Write};
use std::process::ExitCode;

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
    print::print(&String::from_utf8_lossy(&script))
}
