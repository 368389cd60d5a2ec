//! The command line.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::args::{RecordsCommand, RunArgs};
use crate::refusal::USAGE;

const EXIT_CODES: &str = "\
Exit codes:
  0  passed or marginal
  1  failed: the module violates a limit
  2  usage, or a plan or bench file is refused
  3  errored: the station could not tell
  4  aborted by a person or a signal";

/// Production test station for GNC modules. Without a command and without --auto it opens the operator's screen.
#[derive(Debug, Parser)]
#[command(name = "gnc-station", version, args_conflicts_with_subcommands = true, after_help = EXIT_CODES)]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    run: RunArgs,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Lists the serial ports that are there.
    Ports,
    /// Looks at ports, rights, buses, disk and clock, and names what mends them; changes nothing.
    Doctor {
        /// The bench file; `bench.toml` if that is there.
        #[arg(long, value_name = "FILE")]
        bench: Option<PathBuf>,
        /// The records folder; the bench file's, if not given.
        #[arg(long, value_name = "DIR")]
        records: Option<PathBuf>,
    },
    /// Computes calibrations, deviations and spectra from a record.
    Compute(crate::compute::Args),
    /// Looks at plans without running them.
    Plan {
        #[command(subcommand)]
        what: PlanCommand,
    },
    /// Works out all figures and verdicts of a run once more, from its raw record and its plan.
    #[command(after_help = crate::recompute::EXIT_CODES)]
    Recompute {
        /// Its folder, whole or below the records folder.
        run: PathBuf,
        /// Judges by this plan instead, into a new folder beside the run.
        #[arg(long, value_name = "FILE")]
        plan: Option<PathBuf>,
        /// The records folder.
        #[arg(long, value_name = "DIR", default_value = "records")]
        records: PathBuf,
    },
    /// Writes the raw samples of a run as tables, for programs that do not read MCAP.
    Export {
        /// Its folder, whole or below the records folder.
        run: PathBuf,
        /// The form.
        #[arg(long, value_enum, default_value = "csv")]
        format: crate::export::Format,
        /// The folder that is made for it; RUN-export here, if not given.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        /// The records folder.
        #[arg(long, value_name = "DIR", default_value = "records")]
        records: PathBuf,
    },
    /// Looks through the records.
    Records {
        #[command(subcommand)]
        what: RecordsCommand,
        /// The records folder.
        #[arg(long, value_name = "DIR", default_value = "records", global = true)]
        records: PathBuf,
    },
}

/// What to do with plans.
#[derive(Debug, Subcommand)]
pub(crate) enum PlanCommand {
    /// Reports all mistakes at once, each with line and column, also what the bench lacks.
    Check {
        /// The plans.
        #[arg(required = true, value_name = "FILE")]
        plans: Vec<PathBuf>,
        /// The bench that is to run them; `bench.toml` if that is there.
        #[arg(long, value_name = "FILE", conflicts_with = "sim")]
        bench: Option<PathBuf>,
        /// The simulated bench is to run them.
        #[arg(long)]
        sim: bool,
    },
}

/// Runs the program.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let _ = error.print();
            return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(USAGE));
        }
    };
    match cli.command {
        Some(Command::Compute(args)) => crate::compute::run(&args),
        Some(Command::Ports) => crate::ports::run(),
        Some(Command::Doctor { bench, records }) => crate::doctor::run(bench.as_deref(), records.as_deref()),
        Some(Command::Plan { what: PlanCommand::Check { plans, bench, sim } }) => {
            crate::check::run(&plans, bench.as_deref(), sim)
        }
        Some(Command::Recompute { run, plan, records }) => crate::recompute::run(&run, &records, plan.as_deref()),
        Some(Command::Export { run, format, out, records }) => {
            crate::export::run(&run, &records, format, out.as_deref())
        }
        Some(Command::Records { what, records }) => crate::records::run(&what, &records),
        None if cli.run.auto.is_some() => crate::auto::run(&cli.run),
        None => crate::tui::run(&cli.run),
    }
}
