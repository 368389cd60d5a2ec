//! The command line.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};
use gnc_executive::quantity::{Dimension, Quantity, Unit};

/// Exit code for a mistake on the command line or in a plan.
pub const USAGE: u8 = 2;

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
pub struct Cli {
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
pub enum PlanCommand {
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

/// What to do with records.
#[derive(Debug, Subcommand)]
pub enum RecordsCommand {
    /// Lists all runs, oldest first.
    List,
    /// Shows a run.
    Show {
        /// Its folder, whole or below the records folder; or a serial number, for its newest run.
        run: PathBuf,
    },
    /// Compares runs with their digests and their journals.
    Verify {
        /// Their folders or serial numbers; all runs if none is named.
        runs: Vec<PathBuf>,
        /// The station's public key: each run must be signed with its other half.
        #[arg(long, value_name = "FILE.pub")]
        key: Option<PathBuf>,
    },
    /// Makes a key with which a station signs its runs: FILE for `key` under `[station]` in its bench file, FILE.pub to verify.
    Key {
        /// The file to write.
        file: PathBuf,
    },
}

/// How the station reaches the simulated board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum SimLink {
    /// RS-422 for the conversation, CAN beside it for the item `can`.
    Rs422,
    /// CAN alone.
    Can,
}

/// How to run a plan.
#[derive(Debug, Clone, Args)]
pub struct RunArgs {
    /// Runs a plan without the screen.
    #[arg(long, value_name = "PLAN")]
    pub auto: Option<PathBuf>,
    /// The plan that the screen opens with.
    #[arg(long, value_name = "PLAN", conflicts_with = "auto")]
    pub plan: Option<PathBuf>,
    /// Language of the screen; the locale's, if not given.
    #[arg(long, value_name = "LANG", value_enum, conflicts_with = "auto")]
    pub lang: Option<crate::tui::Lang>,
    /// Tests a simulated module: a good one, or the one that FILE (or a built-in name) describes.
    #[arg(long, value_name = "FILE", num_args = 0..=1, require_equals = true, default_missing_value = "good", conflicts_with = "bench")]
    pub sim: Option<PathBuf>,
    /// How fast simulated time passes: a factor, or `max`.
    #[arg(long, value_name = "N|max", default_value = "1", requires = "sim")]
    pub sim_speed: String,
    /// Seed of the simulated noise.
    #[arg(long, value_name = "N", default_value_t = 1, requires = "sim")]
    pub seed: u64,
    /// The link to the simulated board.
    #[arg(long, value_name = "LINK", value_enum, default_value_t = SimLink::Rs422, requires = "sim")]
    pub sim_link: SimLink,
    /// Puts the simulated CAN bus on interfaces of the kernel: the station's, and the board's if that is another one.
    #[arg(long, value_name = "HOST[,BOARD]", requires = "sim")]
    pub sim_can: Option<String>,
    /// The bench file; `bench.toml` if that is there.
    #[arg(long, value_name = "FILE")]
    pub bench: Option<PathBuf>,
    /// Serial number of the module.
    #[arg(long, value_name = "SN")]
    pub serial_number: Option<String>,
    /// Who tests.
    #[arg(long, value_name = "NAME")]
    pub operator: Option<String>,
    /// Which station this is; the bench file's, if not given.
    #[arg(long, value_name = "ID")]
    pub station: Option<String>,
    /// Where records go; the bench file's folder or `records`, if not given.
    #[arg(long, value_name = "DIR")]
    pub records: Option<PathBuf>,
    /// Runs only these items of the plan: never a module's pass.
    #[arg(long, value_name = "A,B", value_delimiter = ',')]
    pub only: Option<Vec<String>>,
    /// Runs the plan so many times, each with a record of its own.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub loops: u32,
    /// Runs the plan again and again until this time is over ("2 h", "30 min"); a round under way is finished.
    #[arg(long, value_name = "TIME", conflicts_with = "loops", value_parser = parse_time)]
    pub until: Option<std::time::Duration>,
    /// Whether a bad item ends the run and its loop, whatever the plan says.
    #[arg(long, value_name = "stop|continue")]
    pub on_fail: Option<OnFailArg>,
    /// Takes up a run that broke off: what it captured whole is taken over, if plan, module and bench are the same.
    #[arg(long, value_name = "RUN", conflicts_with_all = ["loops", "until"])]
    pub resume: Option<PathBuf>,
    /// Runs one item after the other, also where the plan's items could run at once.
    #[arg(long)]
    pub one_by_one: bool,
    /// Writes the events as JSON lines to standard output; everything for people goes to standard error.
    #[arg(long, requires = "auto")]
    pub events: bool,
}

/// What a bad item means for the rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum OnFailArg {
    /// The rest is skipped.
    Stop,
    /// The rest is run.
    Continue,
}

fn parse_time(text: &str) -> Result<std::time::Duration, String> {
    let time = Quantity::parse(text).map_err(|error| format!("{error}; {}", error.hint(Dimension::Time)))?;
    let seconds = time.in_unit(Unit::Second).ok_or_else(|| "it is no time; write 2 h, 30 min or 90 s".to_owned())?;
    std::time::Duration::try_from_secs_f64(seconds).map_err(|_| "it is no time that can pass".to_owned())
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

/// Says why nothing was done.
pub(crate) fn refuse(what: impl std::fmt::Display, try_this: &str) -> ExitCode {
    complain(what, try_this);
    ExitCode::from(USAGE)
}

/// An error for people, on standard error: what went wrong, and what can be tried.
pub(crate) fn complain(what: impl std::fmt::Display, try_this: &str) {
    use std::io::Write as _;
    // Where nobody can read it there is nobody to tell.
    let _ = writeln!(std::io::stderr(), "gnc-station: {what}");
    if !try_this.is_empty() {
        let _ = writeln!(std::io::stderr(), "  try: {try_this}");
    }
}
