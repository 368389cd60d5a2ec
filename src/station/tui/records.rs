//! The records page: days, runs, one run.

use std::path::PathBuf;

use chrono::{DateTime, FixedOffset};
use gnc_executive::outcome::Outcome;
use gnc_executive::state::RunState;
use gnc_executive::verdict::Verdict;
use gnc_records::standing::Face;

use super::field::InputField;
use super::lang::Texts;

/// Largest number of runs of one day that are shown: more than one socket can test in a day.
pub(crate) const MAX_RUNS: usize = 5000;

/// A day with runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Day {
    /// "2026-11-22".
    pub name: String,
    /// Serial numbers that were tested on it.
    pub serial_numbers: usize,
}

/// What a run is called in a list, in a word.
pub(crate) fn word(face: Face, texts: &Texts) -> &'static str {
    match face {
        // A run that was closed late is no pass, so a list does not call it passed.
        Face::Late(verdict) if verdict.of_items().is_good() => texts.closed_late,
        Face::Ended(verdict) | Face::Late(verdict) => texts.word_of(verdict),
        Face::Interrupted => texts.interrupted,
        Face::NotInChain(_) => texts.not_in_chain,
        Face::Running => texts.running_record,
        Face::Changed => texts.changed_record,
        Face::Unsealed => texts.unsealed,
        Face::Unreadable => texts.unreadable,
        Face::Newer => texts.newer,
    }
}

/// A run in a list.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RunLine {
    pub path: PathBuf,
    pub at: Option<DateTime<FixedOffset>>,
    pub serial_number: String,
    pub plan: String,
    pub face: Face,
    pub simulated: bool,
    pub unproven: bool,
    pub selection: bool,
    pub rejudged: bool,
    pub elapsed_s: f64,
}

/// The runs of a day.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Runs {
    pub day: String,
    /// Sorted by serial number, and by time within one.
    pub lines: Vec<RunLine>,
    /// There are more than [`MAX_RUNS`].
    pub cut: bool,
}

/// A run that was opened.
#[derive(Debug)]
pub(crate) struct OpenRun {
    pub path: PathBuf,
    pub state: RunState,
    pub face: Face,
    pub cursor: usize,
    pub check: Check,
}

/// Whether a run is as it was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Check {
    NotAsked,
    Running,
    Done(Checked),
}

/// How a run compares with its digests and its journal.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Checked {
    /// What is wrong; empty if all is as written.
    pub problems: Vec<String>,
    /// Why it is not known to be as written, though no change was found: it cannot be read, goes on, or was not closed.
    pub open: Vec<String>,
    /// What this version does not know in the journal of a later version. Then only the digests were compared.
    pub newer: Option<String>,
}

/// Why a run is not shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Unopened {
    /// A later version of the station wrote it. The text names what this version does not know.
    Newer(String),
    /// Why it cannot be read.
    Unreadable(String),
}

/// The state of the records page.
#[derive(Debug, Default)]
pub(crate) struct Records {
    /// Newest first; `None` until read.
    pub days: Option<Vec<Day>>,
    pub day_cursor: usize,
    pub runs: Option<Runs>,
    pub run_cursor: usize,
    /// Something is being read.
    pub reading: bool,
    pub filter: Option<Verdict>,
    pub search: InputField,
    pub open: Option<OpenRun>,
    pub error: Option<String>,
}

impl Records {
    /// The runs that filter and search let through.
    pub(crate) fn shown(&self) -> Vec<&RunLine> {
        let wanted = self.search.text().to_lowercase();
        let lines = self.runs.iter().flat_map(|runs| &runs.lines);
        lines
            .filter(|line| match (self.filter, line.face) {
                (None, _) => true,
                (Some(wanted), Face::Ended(verdict) | Face::Late(verdict)) => wanted.to_show() == verdict.to_show(),
                // A run without an end or a seal does not pass; the filter for aborted runs shows it.
                (Some(wanted), _) => wanted.to_show() == Some(Outcome::Aborted),
            })
            .filter(|line| wanted.is_empty() || line.serial_number.to_lowercase().contains(&wanted))
            .collect()
    }

    /// Chooses the next filter.
    pub(crate) fn turn_filter(&mut self) {
        const TURN: [Option<Verdict>; 7] = [
            None,
            Some(Verdict::Module(Outcome::Failed)),
            Some(Verdict::Module(Outcome::Errored)),
            Some(Verdict::Module(Outcome::Aborted)),
            Some(Verdict::Module(Outcome::Marginal)),
            Some(Verdict::Module(Outcome::Passed)),
            Some(Verdict::Selection(Outcome::Passed)),
        ];
        let at = TURN.iter().position(|filter| *filter == self.filter).unwrap_or(0);
        self.filter = TURN[(at + 1) % TURN.len()];
        self.run_cursor = 0;
    }
}
