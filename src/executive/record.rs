//! The record of a run, as in `run.json`: all data to show the run again.
//!
//! `docs/run.schema.json` describes the form; new versions only add fields.

use chrono::{DateTime, FixedOffset};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::bench::BenchSite;
use crate::catalogue::ItemId;
use crate::details::Details;
use crate::event::{
    AttemptError, BenchInfo, BenchKind, BoardInfo, EarlierRun, ErrorRecord, Loop, NoteLevel, OtherModule, PlanInfo,
    PlannedItem, ProgramVersion, StopHow,
};
use crate::measurement::Measurement;
use crate::numbers::GivenNumber;
use crate::outcome::{Cause, Outcome};
use crate::part::{LimitsChosen, PartName};
use crate::plan::Phase;
use crate::state::{Attempt, Breach, Note, Row, RunState};
use crate::verdict::Verdict;

/// Version of the record's form.
pub const RUN_SCHEMA: &str = "gnc-run/1";

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(remote = "Self")]
pub struct RunRecord {
    /// [`RUN_SCHEMA`].
    pub schema: String,
    /// How the run ended, in `outcome` or `selection_outcome`; aborted if it is interrupted.
    #[serde(flatten)]
    pub verdict: Verdict,
    /// Whether the run has no end: the station lost its power, or was killed.
    pub interrupted: bool,
    /// The scanned serial number.
    pub serial_number: String,
    /// The part number that was asked for, with its revision if one was; absent if none was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<PartName>,
    /// Numbers of orders, sub-units and others, as plan or bench asked for them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub numbers: Vec<GivenNumber>,
    /// The plan that was followed.
    pub plan: PlanInfo,
    /// The limits that were chosen by the module's part number; absent if the plan has no such limits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<LimitsChosen>,
    /// Where the bench stands, as its file states.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub site: Option<BenchSite>,
    /// The run whose raw record was judged again; absent if this run captured samples.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recomputed: Option<EarlierRun>,
    /// The interrupted run whose captures this run took over.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resumed: Option<EarlierRun>,
    /// Which station.
    pub station: String,
    /// Who tested.
    pub operator: Option<String>,
    /// The program that ran the test.
    pub program: ProgramVersion,
    /// The bench; a simulated one is never evidence.
    pub bench: BenchInfo,
    /// The slave board, if one answered.
    pub board: Option<BoardInfo>,
    /// The rules of the interface document that the slave board broke; absent if it broke none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub board_breaches: Vec<BreachRecord>,
    /// The scanned number and that of the module in the socket, if they are not the same: the run is of neither.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other_module: Option<OtherModule>,
    /// When the run was closed late, as RFC 3339 writes it: its station ended before it closed the run, so a pass of its items is errored
    /// here. Absent if the station that carried it out closed it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub closed_late: Option<String>,
    /// Names of the chosen items; null for the whole plan. A selection is never a module's pass.
    pub selection: Option<Vec<String>>,
    /// Which round of a loop.
    #[serde(rename = "loop")]
    pub looped: Option<Loop>,
    /// Start, with the offset of the place.
    pub started: DateTime<FixedOffset>,
    /// End; null if the run is interrupted.
    pub finished: Option<DateTime<FixedOffset>>,
    /// Seconds from the start to the last event, by a clock that never jumps.
    pub elapsed_s: f64,
    /// What stopped the run, and how.
    pub stop: Option<StopRecord>,
    /// Every planned item, in the order of the plan.
    pub items: Vec<ItemRecord>,
    /// Useful information beside the measurements.
    pub notes: Vec<NoteRecord>,
}

/// A rule of the interface document that the slave board broke. It says nothing of the module.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BreachRecord {
    /// Section of the interface document.
    pub section: u8,
    /// What the board does against it.
    pub what: String,
    /// How often.
    pub count: u32,
    /// The worst value, or the first case in words; null if there is neither.
    pub worst: Option<String>,
    /// When the run noticed it first.
    pub first_at: DateTime<FixedOffset>,
    /// Whether people or the module are in danger.
    pub safety: bool,
}

/// A stop that was requested.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StopRecord {
    /// In order or at once.
    pub how: StopHow,
    /// What requested it.
    pub by: String,
}

/// One planned item.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ItemRecord {
    /// Unique name in the plan.
    pub name: String,
    /// Which item of the catalogue.
    pub id: ItemId,
    /// For people.
    pub title: String,
    /// Setup, test or teardown.
    pub phase: Phase,
    /// Whether the run is complete without it.
    pub optional: bool,
    /// Whether this run included it.
    pub selected: bool,
    /// How it ended.
    pub outcome: Outcome,
    /// Why it was skipped or not run.
    pub cause: Option<Cause>,
    /// When its first attempt began.
    pub started: Option<DateTime<FixedOffset>>,
    /// Seconds from the start of the run to the start of its first attempt.
    pub started_s: Option<f64>,
    /// Seconds from the start of its first attempt to its end.
    pub elapsed_s: Option<f64>,
    /// Every attempt.
    pub attempts: Vec<AttemptRecord>,
}

/// One attempt of an item.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AttemptRecord {
    /// How it ended; aborted if the run was interrupted in it.
    pub outcome: Outcome,
    /// When it began.
    pub started: DateTime<FixedOffset>,
    /// Seconds that it took; null if it has no end.
    pub elapsed_s: Option<f64>,
    /// Measurements, in the order of measuring.
    pub measurements: Vec<Measurement>,
    /// Results of an analysis beside the measurements, once for each round. Their form depends on the item.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub details: Vec<Details>,
    /// Why the station could not tell.
    pub error: Option<AttemptError>,
    /// The slave board's records for fault analysis.
    pub error_records: Vec<ErrorRecord>,
}

/// A note for people.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NoteRecord {
    /// When it was made.
    pub at: DateTime<FixedOffset>,
    /// Seconds since the start of the run.
    pub elapsed_s: f64,
    /// How much it matters.
    pub level: NoteLevel,
    /// One sentence.
    pub text: String,
    /// Name of the item to which the note belongs.
    pub item: Option<String>,
}

/// One item as a file of its own, in the folder of the item.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ItemFile {
    /// [`RUN_SCHEMA`].
    pub schema: String,
    /// The scanned serial number.
    pub serial_number: String,
    /// Whether the bench is real.
    pub bench: BenchKind,
    /// Start of the run.
    pub run_started: DateTime<FixedOffset>,
    /// The item as in the record of the run.
    #[serde(flatten)]
    pub item: ItemRecord,
}

impl ItemFile {
    /// The file of the item at a position of the plan; `None` before the first attempt.
    pub fn from_state(state: &RunState, position: usize) -> Option<Self> {
        let (header, row) = (state.header()?, state.rows().get(position)?);
        let file = |run_started| Self {
            schema: RUN_SCHEMA.to_owned(),
            serial_number: header.serial_number.clone(),
            bench: header.bench.kind,
            run_started,
            item: ItemRecord::from(row),
        };
        state.started().filter(|_| !row.attempts.is_empty()).map(file)
    }
}

impl RunRecord {
    /// The record of a run as far as it is known; `None` before it has started.
    pub fn from_state(state: &RunState) -> Option<Self> {
        let header = state.header()?.clone();
        let started = state.started()?;
        let last = state.last()?;
        let interrupted = state.is_interrupted();
        Some(Self {
            schema: RUN_SCHEMA.to_owned(),
            verdict: state.verdict().unwrap_or(Verdict::new(Outcome::Aborted, state.is_selection())),
            interrupted,
            serial_number: header.serial_number,
            part: header.part,
            numbers: header.numbers,
            plan: header.plan,
            limits: state.limits().cloned(),
            site: header.site,
            recomputed: header.recomputed,
            resumed: header.resumed,
            station: header.station,
            operator: header.operator,
            program: header.program,
            bench: header.bench,
            board: state.board().cloned(),
            board_breaches: state.breaches().iter().map(BreachRecord::from).collect(),
            other_module: state.other_module().cloned(),
            closed_late: None,
            selection: header.selection,
            looped: header.looped,
            started,
            finished: (!interrupted).then_some(last.at),
            elapsed_s: seconds(last.elapsed_us),
            stop: state.stop().map(|(how, by)| StopRecord { how, by: by.to_owned() }),
            items: state.rows().iter().map(ItemRecord::from).collect(),
            notes: state.notes().iter().map(NoteRecord::from).collect(),
        })
    }

    /// As [`Self::from_state`], without a second copy of the measurements, which may take hundreds of megabytes.
    pub fn of_folded(mut state: RunState) -> Option<Self> {
        let measured =
            |attempt: &mut Attempt| (std::mem::take(&mut attempt.measurements), std::mem::take(&mut attempt.details));
        let measured: Vec<_> = state.attempts_mut().map(measured).collect();
        let mut record = Self::from_state(&state)?;
        let attempts = record.items.iter_mut().flat_map(|item| &mut item.attempts);
        for (attempt, (measurements, details)) in attempts.zip(measured) {
            (attempt.measurements, attempt.details) = (measurements, details);
        }
        Some(record)
    }

    /// The record of a run that is closed late: what its station did not live to close is no pass, whatever its items said.
    #[must_use]
    pub fn closed_late(mut self, at: &str) -> Self {
        self.closed_late = Some(at.to_owned());
        self.not_closed()
    }

    /// The record of a run that its station did not close: a pass of its items is errored.
    #[must_use]
    pub fn not_closed(mut self) -> Self {
        if self.verdict.of_items().is_good() {
            self.verdict = self.verdict.at_least(Outcome::Errored);
        }
        self
    }

    /// The record as a journal gives it, closed late if the other one is. The journal ends before that.
    #[must_use]
    pub fn closed_like(self, other: &Self) -> Self {
        match &other.closed_late {
            Some(at) => self.closed_late(at),
            None => self,
        }
    }

    /// Whether the record may speak for the module: the bench is real, the plan is whole, the run has an end, its
    /// verdict is the one that was given when the module was measured, and the module is the one that was scanned.
    pub fn is_evidence(&self) -> bool {
        let whole = self.selection.is_none() && self.recomputed.is_none() && !self.interrupted;
        self.bench.kind == BenchKind::Real && whole && self.other_module.is_none()
    }
}

// Earlier versions filed the outcome of a selection as that of a module. The derived code reads the fields, and this
// code puts the outcome where it belongs.
impl<'de> Deserialize<'de> for RunRecord {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut record = Self::deserialize(deserializer)?;
        record.verdict = record.verdict.of_selection_if(record.selection.is_some());
        Ok(record)
    }
}

impl Serialize for RunRecord {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Self::serialize(self, serializer)
    }
}

impl ItemRecord {
    /// The attempt that counts.
    pub fn last_attempt(&self) -> Option<&AttemptRecord> {
        self.attempts.last()
    }
}

impl From<&Row> for ItemRecord {
    fn from(row: &Row) -> Self {
        let PlannedItem { name, id, title, phase, optional, selected } = row.planned.clone();
        // An attempt without an end was cut off together with the run.
        let outcome = if row.running().is_some() { Outcome::Aborted } else { row.outcome };
        Self {
            name,
            id,
            title,
            phase,
            optional,
            selected,
            outcome,
            cause: row.cause.clone(),
            started: row.started.map(|stamp| stamp.at),
            started_s: row.started.map(|stamp| seconds(stamp.elapsed_us)),
            elapsed_s: row.elapsed_us().map(seconds),
            attempts: row.attempts.iter().map(AttemptRecord::from).collect(),
        }
    }
}

impl From<&Attempt> for AttemptRecord {
    fn from(attempt: &Attempt) -> Self {
        let took = |end: u64| seconds(end.saturating_sub(attempt.started.elapsed_us));
        Self {
            outcome: attempt.outcome.unwrap_or(Outcome::Aborted),
            started: attempt.started.at,
            elapsed_s: attempt.ended.map(|stamp| took(stamp.elapsed_us)),
            measurements: attempt.measurements.clone(),
            details: attempt.details.clone(),
            error: attempt.error.clone(),
            error_records: attempt.error_records.clone(),
        }
    }
}

impl From<&Breach> for BreachRecord {
    fn from(breach: &Breach) -> Self {
        let crate::event::BoardBreach { section, what, count, worst, safety } = breach.breach.clone();
        Self { section, what, count, worst, first_at: breach.first.at, safety }
    }
}

impl From<&Note> for NoteRecord {
    fn from(note: &Note) -> Self {
        Self {
            at: note.stamp.at,
            elapsed_s: seconds(note.stamp.elapsed_us),
            level: note.level,
            text: note.text.clone(),
            item: note.item.clone(),
        }
    }
}

/// Microseconds as seconds; exact to the microsecond for 285 years.
fn seconds(us: u64) -> f64 {
    us as f64 / 1e6
}

#[cfg(test)]
pub(crate) mod tests;
