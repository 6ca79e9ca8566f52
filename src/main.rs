//! The `parhelion` command.

fn main() -> std::process::ExitCode {
    parhelion::cli::main()
}
