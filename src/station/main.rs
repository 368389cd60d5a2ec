//! Starts the program.

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Production test station for GNC modules
#[derive(Debug, Parser)]
#[command(version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Compute calibrations, deviations and spectra from a record
    Compute(gnc_station::compute::Args),
}

fn main() -> ExitCode {
    match Cli::parse().command {
        Command::Compute(args) => gnc_station::compute::run(&args),
    }
}
