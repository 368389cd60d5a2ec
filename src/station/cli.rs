//! The command line.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::OsStrExt as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use clap::{CommandFactory as _, Parser, Subcommand};
use signal_hook::consts::SIGXFSZ;

use crate::args::{RecordsCommand, RunArgs};
use crate::auto::JunitFile;
use crate::exit_code::USAGE;
use crate::help_files::{self, Shell};
use crate::records::RecordsArgs;
use crate::refusal::complain;
use crate::version;

const EXIT_CODES: &str = "\
Exit codes:
  0  passed or marginal: the whole plan was run, and every limit is kept
  1  failed: the module violates a limit
  2  the command line, a plan or a bench file is refused
  3  errored: the station could not judge the module
  4  aborted by a person or a signal
  5  the chosen items are good (--only): no pass of the module
  6  marginal, with --strict
Of several rounds the worst counts: 4, 3, 1, 5, 6, 0.";

/// Production test station for GNC modules. Without a command and without --auto it opens the operator's screen.
#[derive(Debug, Parser)]
#[command(name = "gnc-station", version = version::SHOWN, args_conflicts_with_subcommands = true, after_help = EXIT_CODES)]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    run: RunArgs,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Lists the serial ports of this computer.
    Ports,
    /// Checks ports, rights, buses, disk and clock, asks the board who it is unless another program works with it, and names
    /// the command that mends each fault; changes nothing itself.
    Doctor {
        /// The bench file; by default `bench.toml`, if it exists.
        #[arg(long, value_name = "FILE")]
        bench: Option<PathBuf>,
        /// The records folder; by default the one that the bench file names.
        #[arg(long, value_name = "DIR")]
        records: Option<PathBuf>,
    },
    /// Checks a slave board against the interface document.
    Board {
        #[command(subcommand)]
        what: crate::board::BoardCommand,
    },
    /// Computes calibrations, deviations and spectra from a record.
    Compute(crate::compute::Args),
    /// Checks plans without running them.
    Plan {
        #[command(subcommand)]
        what: PlanCommand,
    },
    /// Recomputes all figures and verdicts of a run from its raw record and its plan.
    #[command(after_help = crate::recompute::EXIT_CODES)]
    Recompute {
        /// The run's folder: a path from here, or a path below the records folder.
        run: PathBuf,
        /// Judges the run by this plan instead, and writes the result to a new folder beside the run.
        #[arg(long, value_name = "FILE")]
        plan: Option<PathBuf>,
        /// Reads also the includes that lie outside of the plan's folder.
        #[arg(long, requires = "plan")]
        allow_outside: bool,
        /// The private key that signs what is written beside the run; by default the one of the bench file. A run that this key did
        /// not sign gets no signature by it.
        #[arg(long, value_name = "FILE", requires = "plan")]
        key: Option<PathBuf>,
        #[command(flatten)]
        records: RecordsArgs,
    },
    /// Writes the raw samples of a run as tables, for programs that do not read MCAP.
    #[command(after_help = crate::export::EXIT_CODES)]
    Export {
        /// The run's folder: a path from here, or a path below the records folder.
        run: PathBuf,
        /// The format of the tables.
        #[arg(long, value_enum, default_value = "csv")]
        format: crate::export::Format,
        /// The folder to create for the tables; by default RUN-export in the current folder.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        #[command(flatten)]
        records: RecordsArgs,
    },
    /// Lists, shows and verifies the records of runs.
    Records {
        #[command(subcommand)]
        what: RecordsCommand,
        #[command(flatten)]
        records: RecordsArgs,
    },
    /// Writes the completion of commands and options for a shell to standard output.
    Completions {
        /// The shell.
        shell: Shell,
    },
    /// Writes the manual page to standard output.
    Man {
        /// Writes the pages of all commands as files into this folder instead.
        #[arg(long, value_name = "DIR")]
        dir: Option<PathBuf>,
    },
}

/// What to do with plans.
#[derive(Debug, Subcommand)]
pub(crate) enum PlanCommand {
    /// Reports all mistakes in plans at once, each with line and column, and what the bench lacks for the plans.
    Check {
        /// The plan files.
        #[arg(required = true, value_name = "FILE")]
        plans: Vec<PathBuf>,
        /// The bench file to check the plans against; by default `bench.toml`, if it exists.
        #[arg(long, value_name = "FILE", conflicts_with = "sim")]
        bench: Option<PathBuf>,
        /// Checks the plans against the simulated bench.
        #[arg(long)]
        sim: bool,
        /// Shows the limits by which the plans judge a module with this part number.
        #[arg(long, value_name = "PART")]
        part: Option<String>,
        /// The hardware revision of that module; `-` for none.
        #[arg(long, value_name = "REV", requires = "part", allow_hyphen_values = true)]
        revision: Option<String>,
        /// Reads also the includes and pictures that lie outside of the plan's folder.
        #[arg(long)]
        allow_outside: bool,
    },
}

/// The option that names the report for a CI server.
const JUNIT: &str = "--junit";

/// Says in each file that the refused command line names as its report that nothing was run: the report of an earlier run that
/// passed must not stay.
fn report_refusal(error: &clap::Error) {
    let words: Vec<OsString> = std::env::args_os().skip(1).collect();
    let said = error.to_string();
    let what = said.lines().next().unwrap_or_default().trim_start_matches("error: ");
    for file in reports(&words, Cli::command().get_subcommands().map(clap::Command::get_name)) {
        if let Err(refusal) = JunitFile::refuse(&file, what) {
            complain(refusal.what, &refusal.try_this);
        }
    }
}

/// The files that a command line of runs names with `--junit FILE` or `--junit=FILE`.
fn reports<'a>(words: &[OsString], commands: impl IntoIterator<Item = &'a str>) -> Vec<PathBuf> {
    let is_command = |word: &OsString| commands.into_iter().any(|command| word == command);
    if words.first().is_some_and(is_command) {
        return Vec::new();
    }
    let mut files = Vec::new();
    let mut words = words.iter().take_while(|word| *word != "--").peekable();
    while let Some(word) = words.next() {
        let behind = word.as_bytes().strip_prefix(JUNIT.as_bytes());
        match behind {
            Some(b"") => files.extend(words.next_if(|next| !next.as_bytes().starts_with(b"-")).map(PathBuf::from)),
            Some([b'=', file @ ..]) if !file.is_empty() => files.push(PathBuf::from(OsStr::from_bytes(file))),
            _ => {}
        }
    }
    files
}

/// Runs the program.
pub fn main() -> ExitCode {
    // Behind a limit on the size of files (`ulimit -f`) the system ends a program without a word. With this the write fails, and
    // that is told.
    let _ = signal_hook::flag::register(SIGXFSZ, Arc::default());
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let _ = error.print();
            if error.use_stderr() {
                report_refusal(&error);
            }
            return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(USAGE));
        }
    };
    match cli.command {
        Some(Command::Compute(args)) => crate::compute::run(&args),
        Some(Command::Board { what }) => crate::board::run(&what),
        Some(Command::Ports) => crate::ports::run(),
        Some(Command::Doctor { bench, records }) => crate::doctor::run(bench.as_deref(), records.as_deref()),
        Some(Command::Plan { what: PlanCommand::Check { plans, bench, sim, part, revision, allow_outside } }) => {
            match crate::args::asked_part(part.as_deref(), revision.as_deref()) {
                Ok(part) => {
                    let reach = crate::args::reach(allow_outside);
                    crate::check::run(&plans, (bench.as_deref(), sim), part.as_ref(), reach)
                }
                Err(refusal) => crate::refusal::refuse(refusal.what, &refusal.try_this),
            }
        }
        Some(Command::Recompute { run, plan, allow_outside, key, records }) => {
            let plan = plan.as_deref().map(|plan| (plan, crate::args::reach(allow_outside)));
            crate::recompute::run(&run, &records, plan, key.as_deref())
        }
        Some(Command::Export { run, format, out, records }) => {
            crate::export::run(&run, &records, format, out.as_deref())
        }
        Some(Command::Records { what, records }) => crate::records::run(&what, &records),
        Some(Command::Completions { shell }) => help_files::completions(shell, Cli::command()),
        Some(Command::Man { dir }) => help_files::man(Cli::command(), dir.as_deref()),
        None if cli.run.auto.is_some() => crate::auto::run(&cli.run),
        None => crate::tui::run(&cli.run),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reports_are_named_by_their_option() {
        let check = |line: &str, files: &[&str]| {
            let words: Vec<OsString> = line.split(' ').map(OsString::from).collect();
            let expected: Vec<PathBuf> = files.iter().map(PathBuf::from).collect();
            assert_eq!(reports(&words, ["ports", "records"]), expected, "{line}");
        };
        check("--auto p.toml --junit r.xml --loops x", &["r.xml"]);
        check("--junit=a/r.xml --junit b.xml --loops x", &["a/r.xml", "b.xml"]);
        check("--junit --loops x", &[]);
        check("--junit= --junitx r.xml", &[]);
        check("--auto p.toml -- --junit r.xml", &[]);
        check("records list --junit r.xml", &[]);
    }
}
