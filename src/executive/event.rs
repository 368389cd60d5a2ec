//! What happens in a run, as a closed list of events.
//!
//! The runner emits them, and every observer (store, screen, text output, replay of a stored journal) folds the same
//! sequence with [`RunState::apply`](crate::state::RunState::apply), so that no two of them can disagree.

use chrono::{DateTime, FixedOffset};
use serde::{Deserialize, Serialize};

use crate::bench::Site;
use crate::catalogue::ItemId;
use crate::measurement::Measurement;
use crate::outcome::{Cause, Outcome};
use crate::plan::Phase;

/// Version of the events' form. A program that reads a journal compares it first, with [`crate::journal::fold`]; a later
/// form counts it up.
pub const EVENTS_SCHEMA: &str = "gnc-events/1";

/// One event, one line of a journal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// Position in the run, from 0, without gaps.
    pub seq: u64,
    /// Time of day with offset. It may jump when somebody sets the clock; durations come from `elapsed_us`.
    pub at: DateTime<FixedOffset>,
    /// Microseconds since the start of the run by a clock that never jumps.
    pub elapsed_us: u64,
    /// What happened.
    #[serde(flatten)]
    pub kind: EventKind,
}

/// What happened.
///
/// Events of a run come in this order:
///
/// 1. `run_started`, once and first;
/// 2. for each item that is run: for each attempt `item_started`, then any number of `measured`, `found` and
///    `error_record`, then `attempt_ended`; after the last attempt `item_ended`. Attempts count from 1. Items may overlap: events of
///    one item keep their order, those of different items interleave;
/// 3. for each skipped item `item_ended` alone, with its cause;
/// 4. `run_ended`, once and last. An item without `item_ended` was not run.
///
/// `board_found`, `board_rebooted`, `power`, `prompted`, `answered`, `note` and `stop_requested` come anywhere
/// between the first and the last. A journal that was cut off has no `run_ended`: the run was interrupted.
///
/// Progress is no event: it may be skipped, and events never are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum EventKind {
    /// The run begins. Every planned item has a row from here on.
    RunStarted {
        /// Who, what, where.
        header: Box<RunHeader>,
        /// The items in the order of the plan, those that are not selected included.
        items: Vec<PlannedItem>,
    },
    /// The slave board answered.
    BoardFound(Board),
    /// The slave board answers with another boot id: it restarted.
    BoardRebooted {
        /// The item whose request caused it, if that is known.
        item: Option<String>,
        /// The new boot id.
        boot_id: String,
    },
    /// The module's supply was switched.
    Power(Power),
    /// An attempt of an item begins.
    ItemStarted {
        /// Name of the item.
        item: String,
        /// Attempt, from 1.
        attempt: u32,
    },
    /// A value was measured and judged.
    Measured {
        /// Name of the item.
        item: String,
        /// Attempt, from 1.
        attempt: u32,
        /// The value with its judgement.
        measurement: Measurement,
    },
    /// What an analysis found beside the measurements: equations, covariances, residuals, what a report draws.
    Found {
        /// Name of the item.
        item: String,
        /// Attempt, from 1.
        attempt: u32,
        /// As the analysis gives it; once for each round within the attempt.
        details: serde_json::Value,
    },
    /// The slave made an error record for fault analysis.
    ErrorRecord {
        /// Name of the item.
        item: String,
        /// Attempt, from 1.
        attempt: u32,
        /// The record.
        record: ErrorRecord,
    },
    /// An attempt ended.
    AttemptEnded {
        /// Name of the item.
        item: String,
        /// Attempt, from 1.
        attempt: u32,
        /// How it ended.
        outcome: Outcome,
        /// Why the station could not tell, or who stopped it; `None` if the measurements say it all.
        error: Option<AttemptError>,
    },
    /// An item ended; no attempt of it follows.
    ItemEnded {
        /// Name of the item.
        item: String,
        /// The outcome of the last attempt, or skipped.
        outcome: Outcome,
        /// Why it was skipped.
        cause: Option<Cause>,
    },
    /// Somebody was asked to do something.
    Prompted {
        /// Name of the item that needs it.
        item: Option<String>,
        /// What to do.
        text: String,
    },
    /// The prompt was answered.
    Answered {
        /// Name of the item that needed it.
        item: Option<String>,
        /// The answer; empty for a mere "done".
        answer: String,
    },
    /// Something worth knowing that is no verdict.
    Note {
        /// How much it matters.
        level: Level,
        /// One sentence.
        text: String,
        /// Name of the item to which it belongs.
        item: Option<String>,
    },
    /// Somebody wants the run to end.
    StopRequested {
        /// In order or at once.
        how: StopHow,
        /// What wanted it: "ctrl-C", "SIGTERM".
        by: String,
    },
    /// The run ended.
    RunEnded {
        /// How it ended.
        outcome: Outcome,
    },
}

/// Who tests what, where, with what.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunHeader {
    /// [`EVENTS_SCHEMA`].
    pub schema: String,
    /// The scanned serial number, as scanned: it may hold anything.
    pub serial_number: String,
    /// Who tests.
    pub operator: Option<String>,
    /// Which station.
    pub station: String,
    /// The program that runs the test.
    pub program: Program,
    /// The bench that it runs on.
    pub bench: Bench,
    /// Where the bench stands, as its file said: figures depend on gravity and latitude.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub site: Option<Site>,
    /// The plan that it follows.
    pub plan: PlanInfo,
    /// The run whose raw record was judged again; absent where something was captured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recomputed: Option<EarlierRun>,
    /// The run that broke off and whose captures were taken over.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resumed: Option<EarlierRun>,
    /// Names of the chosen items; `None` for the whole plan. A selection is never a module's pass.
    pub selection: Option<Vec<String>>,
    /// Which round of a loop this run is; `None` outside of loops.
    #[serde(rename = "loop")]
    pub looped: Option<Loop>,
}

/// A program and its version.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Program {
    /// Name of the program.
    pub name: String,
    /// Its version.
    pub version: String,
}

/// The bench of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Bench {
    /// Simulated or real; a simulated one is never evidence.
    pub kind: BenchKind,
    /// Name or file of the simulated module.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub personality: Option<String>,
    /// Simulated seconds per second, or "max".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed: Option<String>,
    /// Seed of the simulated noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Port to the slave board.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub port: Option<String>,
    /// Rate of the port in bit/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_bps: Option<u32>,
    /// Name of the site.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub site: Option<String>,
}

impl Bench {
    /// A real bench of which nothing else is known.
    pub fn real() -> Self {
        Self {
            kind: BenchKind::Real,
            personality: None,
            speed: None,
            seed: None,
            port: None,
            rate_bps: None,
            site: None,
        }
    }

    /// A simulated bench.
    pub fn simulated(personality: impl Into<String>, speed: impl Into<String>, seed: u64) -> Self {
        Self {
            kind: BenchKind::Simulated,
            personality: Some(personality.into()),
            speed: Some(speed.into()),
            seed: Some(seed),
            ..Self::real()
        }
    }
}

/// Whether a bench is real.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BenchKind {
    /// A program plays the board and the module.
    Simulated,
    /// A board and a module.
    Real,
}

/// The plan of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlanInfo {
    /// Name of the plan.
    pub name: String,
    /// Its version.
    pub version: String,
    /// SHA-256 over the texts of the plan and all that it includes, as hexadecimal digits.
    pub sha256: String,
}

/// A run to which this one goes back.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct EarlierRun {
    /// Name of its folder.
    pub run: String,
    /// SHA-256 of its journal.
    pub journal_sha256: String,
}

/// A round of a loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Loop {
    /// Which round, from 1.
    pub index: u32,
    /// How many rounds; `None` if the loop ends otherwise.
    pub count: Option<u32>,
}

/// One item of the plan, as far as its row needs it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlannedItem {
    /// The unique name in the plan.
    pub name: String,
    /// Which item of the catalogue.
    pub id: ItemId,
    /// For people.
    pub title: String,
    /// Setup, test or teardown.
    #[serde(default)]
    pub phase: Phase,
    /// Whether the run is complete without it.
    pub optional: bool,
    /// Whether this run is to run it.
    pub selected: bool,
}

/// The slave board that answered.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Board {
    /// Serial number of the board, not of the module.
    pub board_serial: String,
    /// Version of its firmware.
    pub firmware: String,
    /// Version of the protocol that both speak.
    pub protocol: u16,
    /// Random number of this boot, as text.
    pub boot_id: String,
    /// The link: "/dev/ttyUSB0 at 921600 bit/s".
    pub link: String,
}

/// State of the module's supply.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Power {
    /// Whether the module is powered.
    pub on: bool,
    /// What switches it: "slave board", "supply at 192.168.0.7".
    pub supply: String,
    /// Measured voltage, if the supply tells.
    pub voltage_v: Option<f64>,
    /// Measured current, if the supply tells.
    pub current_a: Option<f64>,
    /// The calibration that the module keeps, at power-on: its checksum, "none" or "damaged"; absent where the board knows
    /// of none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<String>,
}

/// What the slave says about a fault; every text is from outside.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ErrorRecord {
    /// What went wrong.
    pub what: String,
    /// Address, line, channel.
    #[serde(rename = "where")]
    pub location: String,
    /// What the slave expected.
    pub expected: String,
    /// What it got.
    pub got: String,
    /// Board time in microseconds.
    pub board_time_us: u64,
}

/// Why an attempt has no verdict of its own.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AttemptError {
    /// What went wrong, causes included.
    pub text: String,
    /// What the operator can try; may be empty.
    pub hint: String,
    /// The trouble of another item ended it, so that it does not count as an attempt of this one.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub again: bool,
}

/// How much a note matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// Good to know.
    Info,
    /// Something to look after.
    Warning,
    /// Something went wrong beside the items.
    Error,
}

/// How a run is to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopHow {
    /// What is in flight is ended, teardown runs.
    InOrder,
    /// Nothing more is done than making the board safe.
    AtOnce,
}

impl EventKind {
    /// The names of all kinds in journals.
    pub(crate) const NAMES: [&str; 15] = [
        "run_started",
        "board_found",
        "board_rebooted",
        "power",
        "item_started",
        "measured",
        "found",
        "error_record",
        "attempt_ended",
        "item_ended",
        "prompted",
        "answered",
        "note",
        "stop_requested",
        "run_ended",
    ];

    /// Its name in journals.
    pub(crate) fn name(&self) -> &'static str {
        match self {
            EventKind::RunStarted { .. } => "run_started",
            EventKind::BoardFound(_) => "board_found",
            EventKind::BoardRebooted { .. } => "board_rebooted",
            EventKind::Power(_) => "power",
            EventKind::ItemStarted { .. } => "item_started",
            EventKind::Measured { .. } => "measured",
            EventKind::Found { .. } => "found",
            EventKind::ErrorRecord { .. } => "error_record",
            EventKind::AttemptEnded { .. } => "attempt_ended",
            EventKind::ItemEnded { .. } => "item_ended",
            EventKind::Prompted { .. } => "prompted",
            EventKind::Answered { .. } => "answered",
            EventKind::Note { .. } => "note",
            EventKind::StopRequested { .. } => "stop_requested",
            EventKind::RunEnded { .. } => "run_ended",
        }
    }
}
