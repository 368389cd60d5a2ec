//! Command line arguments for runs and records.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use gnc_executive::plan::OnFail;
use gnc_executive::quantity::{Dimension, Quantity, Unit};

/// What to do with records.
#[derive(Debug, Subcommand)]
pub(crate) enum RecordsCommand {
    /// Lists all runs, oldest first.
    List,
    /// Shows a run.
    Show {
        /// Its folder, whole or below the records folder; or a serial number, for its newest run.
        run: PathBuf,
    },
    /// Compares runs with their digests and their journals: exit code 1 if something was changed, 2 if all that can be said
    /// of a run is that a newer version of the station wrote it.
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

/// A language of the screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, clap::ValueEnum)]
pub enum Lang {
    /// English.
    En,
    /// Chinese, simplified.
    Zh,
    /// Russian.
    Ru,
}

/// How the station reaches the simulated board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum SimLink {
    /// RS-422 for the conversation, CAN beside it for the item `can`.
    Rs422,
    /// CAN alone.
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
    /// Language of the screen; the locale's, if not given.
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
    /// Takes up a run that broke off: what it captured whole is taken over, if plan, module and bench are the same. The
    /// screen asks first, and offers such a run of a scanned module by itself.
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
pub(crate) enum OnFailArg {
    /// The rest is skipped.
    Stop,
    /// The rest is run.
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

fn parse_time(text: &str) -> Result<std::time::Duration, String> {
    let time = Quantity::parse(text).map_err(|error| format!("{error}; {}", error.hint(Dimension::Time)))?;
    let seconds = time.in_unit(Unit::Second).ok_or_else(|| "it is no time; write 2 h, 30 min or 90 s".to_owned())?;
    std::time::Duration::try_from_secs_f64(seconds).map_err(|_| "it is no time that can pass".to_owned())
}
