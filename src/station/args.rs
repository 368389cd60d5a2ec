//! Command line arguments for runs and records.

mod list;

use std::path::PathBuf;

use clap::{Args, Subcommand};
use gnc_executive::part::{PartName, unfit};
use gnc_executive::plan::OnFail;
use gnc_executive::quantity::{Dimension, Quantity, Unit};
use gnc_files::Reach;
use gnc_text::quoted;

use crate::exit_code::Strictness;
use crate::locale::Lang;
use crate::refusal::CommandRefusal;
use crate::serial_number::is_invisible;

pub(crate) use list::ListArgs;

/// What to do with records.
#[derive(Debug, Subcommand)]
pub(crate) enum RecordsCommand {
    /// Lists runs, oldest first; by default all.
    List(ListArgs),
    /// Shows a run.
    Show {
        /// The run's folder (a path from here, or below the records folder), or a serial number for its newest run.
        run: PathBuf,
    },
    /// Compares runs with their digests and their journals. Exit code 1: a record is not as written. Exit code 2: a record
    /// cannot be checked: it cannot be read, a newer version of the station wrote it, or nothing shows that a station did. Exit code
    /// 3: a station ended, or could not write, before a record was closed.
    Verify {
        /// Folders or serial numbers of runs; by default all runs.
        runs: Vec<PathBuf>,
        /// The station's public key: each run, and its lines in the chain, must have a signature by the private key that belongs
        /// to it. May be given several times, for a folder of several stations.
        #[arg(long, value_name = "FILE.pub")]
        key: Vec<PathBuf>,
        /// A copy of COUNTER that was kept in another place: the chain must hold that line. May be given several times.
        #[arg(long, value_name = "FILE")]
        counter: Vec<PathBuf>,
        /// Number and link of a line, as a report or a passport names them: the chain must hold that line. May be given several
        /// times.
        #[arg(long, value_name = "N LINK")]
        head: Vec<String>,
    },
    /// Makes a pair of keys: the station signs its runs with FILE (`key` under `[station]` in its bench file), and FILE.pub
    /// verifies them.
    Key {
        /// The file for the private key.
        file: PathBuf,
    },
}

/// How the station reaches the simulated board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum SimLink {
    /// The station talks to the board over RS-422; the CAN bus is there for the item `can`.
    Rs422,
    /// The station talks to the board over CAN; there is no RS-422 line.
    Can,
}

/// How to run a plan.
#[derive(Debug, Clone, Args)]
pub(crate) struct RunArgs {
    /// Runs a plan without the screen.
    #[arg(long, value_name = "PLAN")]
    pub auto: Option<PathBuf>,
    /// The plan that the screen opens with.
    #[arg(long, value_name = "PLAN", conflicts_with = "auto")]
    pub plan: Option<PathBuf>,
    /// Language of the screen; by default that of the locale.
    #[arg(long, value_name = "LANG", value_enum, conflicts_with = "auto")]
    pub lang: Option<Lang>,
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
    /// Puts the simulated CAN bus on kernel interfaces: HOST for the station, BOARD for the board; without BOARD both use HOST.
    #[arg(long, value_name = "HOST[,BOARD]", requires = "sim")]
    pub sim_can: Option<String>,
    /// The bench file; by default `bench.toml`, if it exists.
    #[arg(long, value_name = "FILE")]
    pub bench: Option<PathBuf>,
    /// Serial number of the module.
    #[arg(long, value_name = "SN")]
    pub serial_number: Option<String>,
    /// Part number that the module must have. The station compares it with what the module says.
    #[arg(long, value_name = "PART")]
    pub part: Option<String>,
    /// Hardware revision that the module must have; `-` for none.
    #[arg(long, value_name = "REV", requires = "part", allow_hyphen_values = true)]
    pub revision: Option<String>,
    /// A number that plan or bench file ask for beside the serial number, by its key: order=PO-1234.
    #[arg(long = "number", value_name = "KEY=NUMBER", value_parser = parse_number)]
    pub numbers: Vec<(String, String)>,
    /// Name of the operator.
    #[arg(long, value_name = "NAME")]
    pub operator: Option<String>,
    /// The answer to a question of the plan, by the question's name; may be given several times. Questions without an answer are
    /// asked on the terminal.
    #[arg(long = "answer", value_name = "NAME=VALUE", value_parser = parse_answer, requires = "auto")]
    pub answers: Vec<(String, String)>,
    /// Name of the station; by default the one in the bench file.
    #[arg(long, value_name = "ID")]
    pub station: Option<String>,
    /// The records folder; by default the one that the bench file names, else `records`.
    #[arg(long, value_name = "DIR")]
    pub records: Option<PathBuf>,
    /// Runs only these items of the plan. Such a run never passes the module: it ends with exit code 5 if the items are good.
    #[arg(long, value_name = "A,B", value_delimiter = ',')]
    pub only: Option<Vec<String>>,
    /// Runs the plan N times and writes a record of each run.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub loops: u32,
    /// Repeats the plan until this time is over ("2 h", "30 min"); the last round is finished.
    #[arg(long, value_name = "TIME", conflicts_with = "loops", value_parser = parse_time)]
    pub until: Option<std::time::Duration>,
    /// Whether a bad item ends the run and its rounds, instead of what the plan says.
    #[arg(long, value_name = "stop|continue")]
    pub on_fail: Option<OnFailArg>,
    /// Resumes an interrupted run: reuses its complete captures, if plan, module and bench are the same. The screen asks
    /// first, and offers an interrupted run of the scanned module by itself.
    #[arg(long, value_name = "RUN", conflicts_with_all = ["loops", "until"])]
    pub resume: Option<PathBuf>,
    /// Ends with exit code 6 instead of 0 if the module is marginal.
    #[arg(long)]
    pub strict: bool,
    /// Reads also the includes, pictures and playbacks that lie outside of the folder of the plan, or of the board, that names
    /// them.
    #[arg(long)]
    pub allow_outside: bool,
    /// Runs even if the clock is before the date of this program or of the newest record.
    #[arg(long)]
    pub clock_is_right: bool,
    /// Runs one item after the other, even where the plan lets items run at the same time.
    #[arg(long)]
    pub one_by_one: bool,
    /// Writes the events as JSON lines to standard output, and all text for people to standard error.
    #[arg(long, requires = "auto")]
    pub events: bool,
    /// Writes the runs as JUnit XML for a CI server: a suite for each run, a case for each item.
    #[arg(long, value_name = "FILE", requires = "auto")]
    pub junit: Option<PathBuf>,
}

impl RunArgs {
    /// The part that the module must be.
    pub(crate) fn part(&self) -> Result<Option<PartName>, CommandRefusal> {
        asked_part(self.part.as_deref(), self.revision.as_deref())
    }

    /// How far files may lie that a plan or a simulated module names.
    pub(crate) fn reach(&self) -> Reach {
        reach(self.allow_outside)
    }

    /// Whether a marginal module has an exit code of its own.
    pub(crate) fn strictness(&self) -> Strictness {
        if self.strict { Strictness::Strict } else { Strictness::Lenient }
    }
}

/// How far files may lie that another file names.
pub(crate) fn reach(allow_outside: bool) -> Reach {
    if allow_outside { Reach::Anywhere } else { Reach::Folder }
}

/// A part number and a revision as people give them, without the white space around them that some scanners add.
pub(crate) fn asked_part(number: Option<&str>, revision: Option<&str>) -> Result<Option<PartName>, CommandRefusal> {
    let Some(number) = number else {
        let Some(revision) = revision else { return Ok(None) };
        let what = format!("the revision {} has no part number", quoted(revision));
        return Err(CommandRefusal::new(what, "give the part number too"));
    };
    for (what, text) in [("part number", Some(number)), ("revision", revision)] {
        let Some(text) = text else { continue };
        let problem = match unfit(text) {
            _ if what == "part number" && text.trim().is_empty() => Some(("is empty", "scan the label again")),
            None if text.chars().any(is_invisible) => {
                Some(("has an invisible character", "type it again as it stands on the label"))
            }
            problem => problem,
        };
        if let Some((why, hint)) = problem {
            return Err(CommandRefusal::new(format!("the {what} {} {why}", quoted(text)), hint));
        }
    }
    Ok(Some(PartName::new(number.trim(), revision.map(str::trim))))
}

/// What a bad item means for the rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum OnFailArg {
    /// The remaining items are skipped.
    Stop,
    /// The remaining items run.
    Continue,
}

impl From<OnFailArg> for OnFail {
    fn from(asked: OnFailArg) -> Self {
        match asked {
            OnFailArg::Stop => Self::Stop,
            OnFailArg::Continue => Self::Continue,
        }
    }
}

fn parse_number(text: &str) -> Result<(String, String), String> {
    let (key, number) = text.split_once('=').ok_or_else(|| "write KEY=NUMBER, like order=PO-1234".to_owned())?;
    Ok((key.trim().to_owned(), number.trim().to_owned()))
}

fn parse_answer(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("write the name of the question, =, and the answer: tp4=3.3")?;
    Ok((name.trim().to_owned(), value.to_owned()))
}

fn parse_time(text: &str) -> Result<std::time::Duration, String> {
    let time = Quantity::parse(text).map_err(|error| format!("{error}; {}", error.hint(Dimension::Time)))?;
    let seconds =
        time.in_unit(Unit::Second).ok_or_else(|| "this is not a time; write 2 h, 30 min or 90 s".to_owned())?;
    std::time::Duration::try_from_secs_f64(seconds)
        .map_err(|_| "the time is negative or too long; write 2 h, 30 min or 90 s".to_owned())
}
