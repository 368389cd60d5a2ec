//! The only fold over the events of a run.

use chrono::{DateTime, FixedOffset};

use crate::details::Details;
use crate::event::{
    AttemptError, BoardBreach, BoardInfo, ErrorRecord, Event, EventKind, NoteLevel, OtherModule, PlannedItem, Power,
    RunHeader, StopHow,
};
use crate::measurement::Measurement;
use crate::outcome::{Cause, ItemEnd, Outcome, run_outcome};
use crate::part::LimitsChosen;
use crate::plan::Phase;
use crate::verdict::Verdict;

/// Most notes that the state keeps. A board that sends too many must not fill the memory, and the journal has all
/// notes.
pub(crate) const MAX_NOTES: usize = 1000;

/// Most breaches that the state keeps: more than the station has rules.
const MAX_BREACHES: usize = 100;

/// The state of a run after some of its events.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunState {
    header: Option<Box<RunHeader>>,
    started: Option<DateTime<FixedOffset>>,
    rows: Vec<Row>,
    /// Row numbers in the order of their names, to find a row without a second copy of its name.
    by_name: Vec<u32>,
    /// Rows before this one have ended or are not selected, so the search for the next item skips them.
    first_open: usize,
    /// Rows that have begun and not ended, in the order of their beginning. There are only as many as run at once.
    begun: Vec<u32>,
    /// Rows that have ended and have details, in the order of the plan.
    found: Vec<u32>,
    /// The first setup item that ended badly; it skips all tests.
    bad_setup: Option<u32>,
    /// The first test that ended badly; a plan may stop after it.
    bad_test: Option<u32>,
    in_flight: usize,
    board: Option<BoardInfo>,
    breaches: Vec<Breach>,
    other_module: Option<OtherModule>,
    limits: Option<LimitsChosen>,
    power: Option<Power>,
    notes: Vec<Note>,
    stop: Option<(StopHow, String)>,
    next_seq: u64,
    last: Option<Stamp>,
    ended: Option<Verdict>,
}

/// When something happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// Time of day.
    pub at: DateTime<FixedOffset>,
    /// Microseconds since the start of the run.
    pub elapsed_us: u64,
}

/// One planned item.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The item as planned.
    pub planned: PlannedItem,
    /// How it ended; not run as long as it has no end.
    pub outcome: Outcome,
    /// Why it was skipped or not run.
    pub cause: Option<Cause>,
    /// All its attempts.
    pub attempts: Vec<Attempt>,
    /// When its first attempt began.
    pub started: Option<Stamp>,
    /// When it ended.
    pub ended: Option<Stamp>,
}

impl Row {
    /// Whether no event of this item can follow.
    pub fn is_over(&self) -> bool {
        self.ended.is_some()
    }

    /// The attempt that is being run.
    pub fn running(&self) -> Option<&Attempt> {
        self.attempts.last().filter(|attempt| attempt.outcome.is_none())
    }

    /// Time from the first attempt's start to the end, if both are known.
    pub fn elapsed_us(&self) -> Option<u64> {
        Some(self.ended?.elapsed_us.saturating_sub(self.started?.elapsed_us))
    }
}

/// One attempt of an item.
#[derive(Clone, Debug, PartialEq)]
pub struct Attempt {
    /// When it began.
    pub started: Stamp,
    /// When it ended.
    pub ended: Option<Stamp>,
    /// How it ended; `None` while it runs, or if the journal was cut off.
    pub outcome: Option<Outcome>,
    /// Measurements, in the order of measuring.
    pub measurements: Vec<Measurement>,
    /// Results of an analysis beside the measurements, once for each round.
    pub details: Vec<Details>,
    /// The slave board's records.
    pub error_records: Vec<ErrorRecord>,
    /// Why there is no verdict.
    pub error: Option<AttemptError>,
}

/// A rule of the interface document that the slave board broke.
#[derive(Clone, Debug, PartialEq)]
pub struct Breach {
    /// When the run noticed it.
    pub first: Stamp,
    /// The rule, with the last count and the worst value.
    pub breach: BoardBreach,
}

/// A note for people.
#[derive(Clone, Debug, PartialEq)]
pub struct Note {
    /// When it was made.
    pub stamp: Stamp,
    /// How much it matters.
    pub level: NoteLevel,
    /// One sentence.
    pub text: String,
    /// The item to which the note belongs.
    pub item: Option<String>,
}

/// An event that cannot follow those before it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OutOfOrder {
    /// A number is missing or comes twice.
    #[error("event {expected} is due, but event {seq} comes")]
    Sequence {
        /// Number of the event.
        seq: u64,
        /// Number that is due.
        expected: u64,
    },
    /// The first event is not `run_started`.
    #[error("event {seq} is {kind} before run_started")]
    NotStarted {
        /// Number of the event.
        seq: u64,
        /// Its name.
        kind: &'static str,
    },
    /// The run has started already.
    #[error("event {seq} is a second run_started")]
    StartedTwice {
        /// Number of the event.
        seq: u64,
    },
    /// The run has ended already.
    #[error("event {seq} is {kind} after run_ended")]
    AfterEnd {
        /// Number of the event.
        seq: u64,
        /// Its name.
        kind: &'static str,
    },
    /// Two rows would have the same name.
    #[error("item {} is planned twice", gnc_text::quoted(item))]
    PlannedTwice {
        /// Name of the item.
        item: String,
    },
    /// No row has this name.
    #[error("event {seq} is {kind} of the item {}, which is not planned", gnc_text::quoted(item))]
    UnknownItem {
        /// Number of the event.
        seq: u64,
        /// Its name.
        kind: &'static str,
        /// Name of the item.
        item: String,
    },
    /// The item is not in a state in which this event can happen.
    #[error("event {seq} is {kind} of {}, which {state}", gnc_text::quoted(item))]
    Item {
        /// Number of the event.
        seq: u64,
        /// Its name.
        kind: &'static str,
        /// Name of the item.
        item: String,
        /// The reason: "has ended already".
        state: &'static str,
    },
}

impl RunState {
    /// A run before its first event.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes the next event. A refused event changes nothing.
    ///
    /// # Errors
    /// The event cannot follow those before it: see the order at [`EventKind`].
    pub fn apply(&mut self, event: &Event) -> Result<(), OutOfOrder> {
        let (seq, kind) = (event.seq, event.kind.name());
        if seq != self.next_seq {
            return Err(OutOfOrder::Sequence { seq, expected: self.next_seq });
        }
        if self.ended.is_some() {
            return Err(OutOfOrder::AfterEnd { seq, kind });
        }
        let stamp = Stamp { at: event.at, elapsed_us: event.elapsed_us };
        match (&event.kind, &self.header) {
            (EventKind::RunStarted { header, items }, None) => self.start(stamp, header, items)?,
            (EventKind::RunStarted { .. }, Some(_)) => return Err(OutOfOrder::StartedTwice { seq }),
            (_, None) => return Err(OutOfOrder::NotStarted { seq, kind }),
            (event_kind, Some(_)) => self.follow(seq, stamp, event_kind)?,
        }
        self.next_seq = seq + 1;
        self.last = Some(stamp);
        Ok(())
    }

    /// Who, what, where; `None` before `run_started`.
    pub fn header(&self) -> Option<&RunHeader> {
        self.header.as_deref()
    }

    /// When the run started.
    pub fn started(&self) -> Option<DateTime<FixedOffset>> {
        self.started
    }

    /// A row for every planned item, in the order of the plan.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// All attempts, to move out what takes the memory of a run that nothing follows.
    pub(crate) fn attempts_mut(&mut self) -> impl Iterator<Item = &mut Attempt> {
        self.rows.iter_mut().flat_map(|row| &mut row.attempts)
    }

    /// The row of an item.
    pub fn row(&self, name: &str) -> Option<&Row> {
        self.rows.get(self.index(name)?)
    }

    /// The position of an item in [`RunState::rows`].
    pub fn position(&self, name: &str) -> Option<usize> {
        self.index(name)
    }

    /// The slave board that answered last.
    pub fn board(&self) -> Option<&BoardInfo> {
        self.board.as_ref()
    }

    /// The rules of the interface document that the board broke, in the order in which the run noticed them.
    pub fn breaches(&self) -> &[Breach] {
        &self.breaches
    }

    /// The scanned number and that of the module in the socket, if they are not the same.
    pub fn other_module(&self) -> Option<&OtherModule> {
        self.other_module.as_ref()
    }

    /// The limits that were chosen by the part number of the module.
    pub fn limits(&self) -> Option<&LimitsChosen> {
        self.limits.as_ref()
    }

    /// The module's supply, as last switched.
    pub fn power(&self) -> Option<&Power> {
        self.power.as_ref()
    }

    /// Notes for people, at most a thousand; the journal holds all.
    pub fn notes(&self) -> &[Note] {
        &self.notes
    }

    /// Whether notes that follow are in the journal alone.
    pub(crate) fn has_all_notes(&self) -> bool {
        self.notes.len() >= MAX_NOTES
    }

    /// How a stop was requested, and by what; the strongest request counts.
    pub fn stop(&self) -> Option<(StopHow, &str)> {
        self.stop.as_ref().map(|(how, by)| (*how, by.as_str()))
    }

    /// The number that the next event must have.
    pub fn next_seq(&self) -> u64 {
        self.next_seq
    }

    /// When the last event happened: the end of a run that ended, or the last known event of an interrupted one.
    pub fn last(&self) -> Option<Stamp> {
        self.last
    }

    /// How the run ended; `None` before `run_ended`. A selection is one whatever its last event says: earlier versions
    /// of the station filed an outcome as for a whole plan.
    pub fn verdict(&self) -> Option<Verdict> {
        self.ended
    }

    /// Whether the run has started and has no end: it still runs, or its journal was cut off.
    pub fn is_interrupted(&self) -> bool {
        self.header.is_some() && self.ended.is_none()
    }

    /// Whether only chosen items are to run.
    pub fn is_selection(&self) -> bool {
        self.header.as_ref().is_some_and(|header| header.selection.is_some())
    }

    /// The verdict that follows from the rows so far, by the rule of [`crate::outcome`].
    pub fn verdict_so_far(&self) -> Verdict {
        let ends = self
            .rows
            .iter()
            .map(|row| ItemEnd { outcome: row.outcome, dispensable: row.planned.optional || !row.planned.selected });
        Verdict::new(run_outcome(ends, self.stop.is_some()), self.is_selection())
    }

    /// Number of attempts that have begun and not ended.
    pub fn in_flight(&self) -> usize {
        self.in_flight
    }

    /// The item whose end skips the tests after it: a bad setup item, or a bad test if the plan stops at a bad test.
    pub(crate) fn stopper(&self, stop_at_tests: bool) -> Option<&Row> {
        let test = self.bad_test.filter(|_| stop_at_tests);
        self.rows.get(self.bad_setup.or(test)? as usize)
    }

    /// Positions and rows of items that have begun and not ended.
    pub(crate) fn begun(&self) -> impl Iterator<Item = (usize, &Row)> {
        self.begun.iter().filter_map(|index| Some((*index as usize, self.rows.get(*index as usize)?)))
    }

    /// Items that have ended and found details, in the order of the plan.
    pub fn found(&self) -> impl Iterator<Item = &Row> {
        self.found.iter().filter_map(|index| self.rows.get(*index as usize))
    }

    /// Rows before this one have ended or are not selected.
    pub(crate) fn first_open(&self) -> usize {
        self.first_open
    }

    fn index(&self, name: &str) -> Option<usize> {
        let name_of = |row: &u32| self.rows[*row as usize].planned.name.as_str();
        let at = self.by_name.binary_search_by(|row| name_of(row).cmp(name)).ok()?;
        Some(self.by_name[at] as usize)
    }

    fn start(&mut self, stamp: Stamp, header: &RunHeader, items: &[PlannedItem]) -> Result<(), OutOfOrder> {
        let mut by_name: Vec<u32> = (0u32..).take(items.len()).collect();
        by_name.sort_by_key(|row| items[*row as usize].name.as_str());
        let twice = by_name.windows(2).find(|pair| items[pair[0] as usize].name == items[pair[1] as usize].name);
        if let Some(pair) = twice {
            return Err(OutOfOrder::PlannedTwice { item: items[pair[0] as usize].name.clone() });
        }
        self.by_name = by_name;
        self.rows = items
            .iter()
            .map(|planned| Row {
                planned: planned.clone(),
                outcome: Outcome::NotRun,
                cause: (!planned.selected).then_some(Cause::NotSelected),
                attempts: Vec::new(),
                started: None,
                ended: None,
            })
            .collect();
        self.header = Some(Box::new(header.clone()));
        self.started = Some(stamp.at);
        self.pass_closed();
        Ok(())
    }

    fn follow(&mut self, seq: u64, stamp: Stamp, kind: &EventKind) -> Result<(), OutOfOrder> {
        match kind {
            EventKind::RunStarted { .. } => return Err(OutOfOrder::StartedTwice { seq }),
            EventKind::BoardFound(board) => self.board = Some(board.clone()),
            EventKind::BoardRebooted { item, boot_id } => {
                if let Some(board) = &mut self.board {
                    board.boot_id.clone_from(boot_id);
                }
                let text = "the slave board restarted".to_owned();
                self.note(Note { stamp, level: NoteLevel::Error, text, item: item.clone() });
            }
            EventKind::BoardBreach(breach) => self.breach(stamp, breach),
            EventKind::OtherModule(other) => self.other_module = Some(other.clone()),
            EventKind::LimitsChosen(chosen) => self.limits = Some(chosen.clone()),
            EventKind::Power(power) => self.power = Some(power.clone()),
            EventKind::ItemStarted { item, attempt } => {
                let index = self.open_index(seq, kind, item)?;
                let row = &mut self.rows[index];
                let due = row.attempts.len() + 1;
                if row.running().is_some() {
                    return Err(wrong(seq, kind, item, "has an attempt that runs"));
                }
                if usize::try_from(*attempt) != Ok(due) {
                    return Err(wrong(seq, kind, item, "is due for another attempt"));
                }
                row.started.get_or_insert(stamp);
                let first = row.attempts.is_empty();
                row.attempts.push(Attempt {
                    started: stamp,
                    ended: None,
                    outcome: None,
                    measurements: Vec::new(),
                    details: Vec::new(),
                    error_records: Vec::new(),
                    error: None,
                });
                self.in_flight += 1;
                if first && let Ok(index) = u32::try_from(index) {
                    self.begun.push(index);
                }
            }
            EventKind::Measured { item, attempt, measurement } => {
                self.running(seq, kind, item, *attempt)?.measurements.push(measurement.clone());
            }
            EventKind::Found { item, attempt, details } => {
                self.running(seq, kind, item, *attempt)?.details.push(details.clone());
            }
            // What the files hold, the folder shows; here only the order counts.
            EventKind::Captured(captured) => {
                self.running(seq, kind, &captured.item, captured.attempt)?;
            }
            EventKind::ErrorRecord { item, attempt, record } => {
                self.running(seq, kind, item, *attempt)?.error_records.push(record.clone());
            }
            EventKind::AttemptEnded { item, attempt, outcome, error } => {
                let running = self.running(seq, kind, item, *attempt)?;
                running.outcome = Some(*outcome);
                running.ended = Some(stamp);
                running.error.clone_from(error);
                // No more values follow, and a run may have 20,000 items: keep no spare room.
                running.measurements.shrink_to_fit();
                running.error_records.shrink_to_fit();
                self.in_flight -= 1;
            }
            EventKind::ItemEnded { item, outcome, cause } => {
                let index = self.open_index(seq, kind, item)?;
                let row = &mut self.rows[index];
                if row.running().is_some() {
                    return Err(wrong(seq, kind, item, "has an attempt that runs"));
                }
                row.outcome = *outcome;
                row.cause.clone_from(cause);
                row.ended = Some(stamp);
                row.attempts.shrink_to_fit();
                let bad = match row.planned.phase {
                    _ if outcome.is_good() || *outcome == Outcome::Skipped => None,
                    Phase::Setup => Some(&mut self.bad_setup),
                    Phase::Test => Some(&mut self.bad_test),
                    Phase::Teardown => None,
                };
                if let (Some(bad), Ok(index)) = (bad, u32::try_from(index)) {
                    bad.get_or_insert(index);
                }
                self.begun.retain(|begun| *begun as usize != index);
                if let Ok(row) = u32::try_from(index)
                    && self.rows[index].attempts.iter().any(|attempt| !attempt.details.is_empty())
                    && let Err(place) = self.found.binary_search(&row)
                {
                    self.found.insert(place, row);
                }
                self.pass_closed();
            }
            EventKind::Prompted { item, text, .. } => {
                let text = format!("asked: {text}");
                self.note(Note { stamp, level: NoteLevel::Info, text, item: item.clone() });
            }
            EventKind::Answered { item, answer, .. } => {
                let text = if answer.is_empty() { "answered".to_owned() } else { format!("answered: {answer}") };
                self.note(Note { stamp, level: NoteLevel::Info, text, item: item.clone() });
            }
            EventKind::Note { level, text, item } => {
                self.note(Note { stamp, level: *level, text: text.clone(), item: item.clone() });
            }
            EventKind::StopRequested { how, by } => {
                if !matches!(self.stop, Some((StopHow::AtOnce, _))) {
                    self.stop = Some((*how, by.clone()));
                }
                let text = match how {
                    StopHow::InOrder => format!("stop requested by {by}"),
                    StopHow::AtOnce => format!("stop at once requested by {by}"),
                };
                self.note(Note { stamp, level: NoteLevel::Warning, text, item: None });
            }
            EventKind::RunEnded(verdict) => self.ended = Some(verdict.of_selection_if(self.is_selection())),
        }
        Ok(())
    }

    fn pass_closed(&mut self) {
        while self.rows.get(self.first_open).is_some_and(|row| row.is_over() || !row.planned.selected) {
            self.first_open += 1;
        }
    }

    fn breach(&mut self, stamp: Stamp, breach: &BoardBreach) {
        let same = |seen: &Breach| seen.breach.section == breach.section && seen.breach.what == breach.what;
        match self.breaches.iter().position(same) {
            Some(index) => self.breaches[index].breach.clone_from(breach),
            None if self.breaches.len() < MAX_BREACHES => {
                self.breaches.push(Breach { first: stamp, breach: breach.clone() });
            }
            None => {}
        }
    }

    fn note(&mut self, note: Note) {
        if self.notes.len() < MAX_NOTES {
            self.notes.push(note);
        }
    }

    fn open_index(&self, seq: u64, kind: &EventKind, item: &str) -> Result<usize, OutOfOrder> {
        let unknown = || OutOfOrder::UnknownItem { seq, kind: kind.name(), item: item.to_owned() };
        let index = self.index(item).ok_or_else(unknown)?;
        if self.rows[index].is_over() { Err(wrong(seq, kind, item, "has ended already")) } else { Ok(index) }
    }

    fn open_row(&mut self, seq: u64, kind: &EventKind, item: &str) -> Result<&mut Row, OutOfOrder> {
        let index = self.open_index(seq, kind, item)?;
        Ok(&mut self.rows[index])
    }

    fn running(&mut self, seq: u64, kind: &EventKind, item: &str, attempt: u32) -> Result<&mut Attempt, OutOfOrder> {
        let row = self.open_row(seq, kind, item)?;
        let count = row.attempts.len();
        match row.attempts.last_mut() {
            Some(last) if last.outcome.is_none() && usize::try_from(attempt) == Ok(count) => Ok(last),
            Some(last) if last.outcome.is_none() => Err(wrong(seq, kind, item, "runs another attempt")),
            _ => Err(wrong(seq, kind, item, "has no attempt that runs")),
        }
    }
}

fn wrong(seq: u64, kind: &EventKind, item: &str, state: &'static str) -> OutOfOrder {
    OutOfOrder::Item { seq, kind: kind.name(), item: item.to_owned(), state }
}
