//! The events of a run, as a closed list.
//!
//! The runner emits the events. Every observer (store, screen, text output, replay of a stored journal) folds the same
//! sequence with [`RunState::apply`](crate::state::RunState::apply), so that all of them agree.

mod captured;
mod schema;

use std::fmt;

use chrono::{DateTime, FixedOffset};
use serde::{Deserialize, Serialize};

use crate::bench::BenchSite;
use crate::catalogue::ItemId;
use crate::details::Details;
use crate::measurement::Measurement;
use crate::numbers::GivenNumber;
use crate::outcome::{Cause, Outcome};
use crate::part::{LimitsChosen, PartName};
use crate::plan::Phase;
use crate::verdict::Verdict;

pub use captured::CapturedSamples;
pub use schema::events_schema;

/// Version of the events' form for a run of a whole plan. A program that reads a journal compares it first, with
/// [`crate::journal::fold`]. A later form has a higher number.
pub const EVENTS_SCHEMA: &str = "gnc-events/1";

/// Version of the events' form for a run of chosen items: its `run_ended` has no `outcome`, but a `selection_outcome`.
/// Runs of a whole plan keep the form that earlier versions of the station read.
pub const SELECTION_SCHEMA: &str = "gnc-events/2";

/// The version of the events' form that a run needs, by its chosen items.
pub fn events_form(selection: Option<&[String]>) -> &'static str {
    if selection.is_some() { SELECTION_SCHEMA } else { EVENTS_SCHEMA }
}

/// One event, one line of a journal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// Position in the run, from 0, without gaps.
    pub seq: u64,
    /// Time of day with offset. It may jump when a person sets the clock; durations come from `elapsed_us`.
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
/// 2. for each item that is run: for each attempt `item_started`, then any number of `measured`, `found`, `captured` and
///    `error_record`, then `attempt_ended`; after the last attempt `item_ended`. Attempts count from 1. Items may overlap: events of
///    one item keep their order, those of different items interleave;
/// 3. for each skipped item `item_ended` alone, with its cause;
/// 4. `run_ended`, once and last. An item without `item_ended` was not run.
///
/// `board_found`, `board_rebooted`, `board_breach`, `other_module`, `limits_chosen`, `power`, `prompted`, `answered`, `note` and `stop_requested` come anywhere between
/// the first event and the last. A journal that was cut off has no `run_ended`: the run was interrupted.
///
/// Progress is not an event: progress may be skipped, and events never are.
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
    BoardFound(BoardInfo),
    /// The slave board answers with another boot id: it has restarted.
    BoardRebooted {
        /// The item whose request caused it, if that is known.
        item: Option<String>,
        /// The new boot id.
        boot_id: String,
    },
    /// The slave board broke a rule of the interface document: once when the run notices it, and again with the last
    /// count and the worst value at the end of the run.
    BoardBreach(BoardBreach),
    /// The module in the socket is not the one that was scanned. Nothing is said of either.
    OtherModule(OtherModule),
    /// The plan has limits by part number, and the station has chosen those for the module: at most once, before the first item.
    LimitsChosen(LimitsChosen),
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
    /// Results of an analysis beside the measurements: equations, covariances, residuals, data for the report's plots.
    Found {
        /// Name of the item.
        item: String,
        /// Attempt, from 1.
        attempt: u32,
        /// The details as the analysis gives them; once for each round within the attempt.
        details: Details,
    },
    /// Raw samples of an attempt are on disk.
    Captured(CapturedSamples),
    /// The slave board made an error record for fault analysis.
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
        /// Why the station could not tell, or who stopped the attempt; `None` if the measurements say it all.
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
    /// The station asked a person to do something.
    Prompted {
        /// Name of the item that needs it.
        item: Option<String>,
        /// What to do.
        text: String,
        /// Name of the plan's question, if it is one; of the last one if all answers are looked over.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        question: Option<String>,
        /// SHA-256 of the picture that the question shows, as it was when the plan was checked.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        picture_sha256: Option<String>,
    },
    /// The prompt was answered.
    Answered {
        /// Name of the item that needed the prompt.
        item: Option<String>,
        /// The answer; empty for a simple "done".
        answer: String,
        /// Name of the plan's question, if it is one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        question: Option<String>,
    },
    /// Useful information that is not a verdict.
    Note {
        /// How much it matters.
        level: NoteLevel,
        /// One sentence.
        text: String,
        /// Name of the item to which the note belongs.
        item: Option<String>,
    },
    /// A person or a signal asks the run to end.
    StopRequested {
        /// In order or at once.
        how: StopHow,
        /// What requested it: "ctrl-C", "SIGTERM".
        by: String,
    },
    /// The run ended.
    RunEnded(Verdict),
}

/// Who tests what, where, with what.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunHeader {
    /// [`EVENTS_SCHEMA`] or [`SELECTION_SCHEMA`].
    pub schema: String,
    /// The scanned serial number, as scanned: it may hold anything.
    pub serial_number: String,
    /// The part number that was asked for, with its revision if one was; absent if none was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<PartName>,
    /// Numbers of orders, sub-units and others, as plan or bench asked for them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub numbers: Vec<GivenNumber>,
    /// Who tests.
    pub operator: Option<String>,
    /// Which station.
    pub station: String,
    /// The program that runs the test.
    pub program: ProgramVersion,
    /// The bench that it runs on.
    pub bench: BenchInfo,
    /// Where the bench stands, as its file said: figures depend on gravity and latitude.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub site: Option<BenchSite>,
    /// The plan that it follows.
    pub plan: PlanInfo,
    /// The run whose raw record was judged again; absent if this run captured samples.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recomputed: Option<EarlierRun>,
    /// The interrupted run whose captures this run took over.
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
pub struct ProgramVersion {
    /// Name of the program.
    pub name: String,
    /// Its version.
    pub version: String,
    /// The sources that it was built from; absent if they are not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub build: Option<BuildInfo>,
}

/// The sources of a program.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BuildInfo {
    /// The commit, as hexadecimal digits.
    pub commit: String,
    /// When it was made.
    pub committed: DateTime<FixedOffset>,
    /// Whether the sources had changes that were not committed.
    pub modified: bool,
}

/// Digits of a commit in a text for people.
const SHOWN_DIGITS: usize = 12;

impl fmt::Display for ProgramVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.name, self.version)?;
        let Some(BuildInfo { commit, committed, modified }) = &self.build else { return Ok(()) };
        let commit: String = commit.chars().take(SHOWN_DIGITS).collect();
        let changed = if *modified { ", and changes that are not committed" } else { "" };
        write!(f, " (commit {commit} of {}{changed})", committed.format("%F"))
    }
}

/// The bench of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BenchInfo {
    /// Simulated, unproven or real; only a real one is evidence.
    pub kind: BenchKind,
    /// Why an unproven bench does not prove that it has a board.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unproven: Option<String>,
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

impl BenchInfo {
    /// A real bench without any other data.
    pub fn real() -> Self {
        Self {
            kind: BenchKind::Real,
            unproven: None,
            personality: None,
            speed: None,
            seed: None,
            port: None,
            rate_bps: None,
            site: None,
        }
    }

    /// The same bench, of which something does not prove that it has a board. A simulated bench stays simulated: that says more.
    #[must_use]
    pub fn in_doubt(self, why: Option<String>) -> Self {
        match self.kind {
            BenchKind::Real if why.is_some() => Self { kind: BenchKind::Unproven, unproven: why, ..self },
            BenchKind::Real | BenchKind::Unproven | BenchKind::Simulated => self,
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
///
/// A program can play a board on a pseudo-terminal or on a virtual CAN interface. Such a bench looks like a real one but for its
/// link, and is called unproven: what it measures says nothing about a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BenchKind {
    /// A program plays the board and the module.
    Simulated,
    /// A program may play the board: its link does not prove that it has one.
    Unproven,
    /// A real board and a real module.
    Real,
}

impl BenchKind {
    /// The kind in a word.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Simulated => "simulated",
            Self::Unproven => "unproven",
            Self::Real => "real",
        }
    }
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

/// An earlier run that this one uses.
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
    /// How many rounds; `None` if another condition ends the loop.
    pub count: Option<u32>,
}

/// One item of the plan, with the data that its row needs.
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
    /// Whether this run includes it.
    pub selected: bool,
}

/// The slave board that answered.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BoardInfo {
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

/// A rule of the interface document that the slave board broke. It says nothing of the module.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BoardBreach {
    /// Section of the interface document.
    pub section: u8,
    /// What the board does against it.
    pub what: String,
    /// How often it did so up to now.
    pub count: u32,
    /// The worst value, or the first case in words; every text is from outside.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worst: Option<String>,
    /// Whether people or the module are in danger.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub safety: bool,
}

/// Two serial numbers that must be the same.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct OtherModule {
    /// The number that was scanned.
    pub scanned: String,
    /// The number that the module in the socket says; text from outside.
    pub found: String,
    /// Whether the scanned module was in the socket before, so that it was exchanged during the run.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub exchanged: bool,
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
    /// The calibration that the module keeps, at power-on: its checksum, "none" or "damaged"; absent if the board
    /// supports none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<String>,
}

/// The slave board's record of a fault; every text is from outside.
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
    /// Whether the trouble of another item ended the attempt, so that it does not count as an attempt of this item.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub again: bool,
}

/// How much a note matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoteLevel {
    /// Useful information.
    Info,
    /// Something that needs attention.
    Warning,
    /// Something went wrong beside the items.
    Error,
}

/// How a run is to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopHow {
    /// Items in flight end, then teardown runs.
    InOrder,
    /// The station only makes the board safe.
    AtOnce,
}

impl EventKind {
    /// The names of all kinds in journals.
    pub(crate) const NAMES: [&str; 19] = [
        "run_started",
        "board_found",
        "board_rebooted",
        "board_breach",
        "other_module",
        "limits_chosen",
        "power",
        "item_started",
        "measured",
        "found",
        "captured",
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
            EventKind::BoardBreach(_) => "board_breach",
            EventKind::OtherModule(_) => "other_module",
            EventKind::LimitsChosen(_) => "limits_chosen",
            EventKind::Power(_) => "power",
            EventKind::ItemStarted { .. } => "item_started",
            EventKind::Measured { .. } => "measured",
            EventKind::Found { .. } => "found",
            EventKind::Captured(_) => "captured",
            EventKind::ErrorRecord { .. } => "error_record",
            EventKind::AttemptEnded { .. } => "attempt_ended",
            EventKind::ItemEnded { .. } => "item_ended",
            EventKind::Prompted { .. } => "prompted",
            EventKind::Answered { .. } => "answered",
            EventKind::Note { .. } => "note",
            EventKind::StopRequested { .. } => "stop_requested",
            EventKind::RunEnded(_) => "run_ended",
        }
    }
}
