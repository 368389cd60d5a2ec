//! The modules of a shift: how many are done, how many passed at their first try, and which were the last.
//!
//! The records are the only source, so a station that is started again in the middle of a shift counts on. Only runs of
//! a whole plan count: a selection and a run that was judged again say nothing about a module's way over the line.

use std::collections::HashMap;
use std::path::PathBuf;

use chrono::{DateTime, FixedOffset, NaiveDateTime, NaiveTime, TimeDelta};
use gnc_executive::event::BenchKind;
use gnc_executive::outcome::Outcome;

use crate::standing::{Face, Seals};
use crate::store::reader::{self, FoundRun};
use crate::store::{StoreError, chain};

/// Largest number of runs of one day that are read: more than a socket can test.
const MAX_RUNS_OF_DAY: usize = 5000;
/// Largest number of earlier runs of a module that are read to find out whether it was judged before.
const MAX_EARLIER: usize = 100;
/// Days between the date of a run's folder and that of the shift: the offset of the clock may have changed.
const DATE_SLACK: TimeDelta = TimeDelta::days(1);

/// When the shift began to which a local time belongs. `begins` are the times of day at which shifts begin, in their
/// order; if there are none, a shift begins at midnight. `to_time` gives the time of a local date and time of day;
/// `None` if a clock that is put forward jumps over it.
#[must_use]
pub fn begin_of(
    now: DateTime<FixedOffset>,
    begins: &[NaiveTime],
    to_time: impl Fn(NaiveDateTime) -> Option<DateTime<FixedOffset>>,
) -> DateTime<FixedOffset> {
    let midnight = [NaiveTime::MIN];
    let begins = if begins.is_empty() { &midnight } else { begins };
    let (day, time) = (now.date_naive(), now.time());
    let local = match begins.iter().rev().find(|begin| **begin <= time) {
        Some(begin) => day.and_time(*begin),
        // The last shift of yesterday goes on over midnight.
        None => day.pred_opt().unwrap_or(day).and_time(begins.last().copied().unwrap_or_default()),
    };
    // A shift whose beginning is jumped over begins when the clock goes on, at most a few hours later.
    (0..=3).find_map(|hours| to_time(local + TimeDelta::hours(hours))).unwrap_or(now)
}

/// Whose runs count.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShiftOf {
    /// The folder of all records.
    pub records: PathBuf,
    /// The station.
    pub station: String,
    /// Runs of a real bench and of a simulated one never count together. Those of an unproven bench do not count at all.
    pub kind: BenchKind,
}

/// A run of a whole plan.
#[derive(Debug, Clone, PartialEq, Eq)]
struct WholeRun {
    serial_number: String,
    plan: String,
    started: DateTime<FixedOffset>,
    outcome: Outcome,
}

impl WholeRun {
    /// The run, if it is one of this station and of a whole plan. A run whose record was not closed, or was closed late, is
    /// errored, whatever it says; so is one whose record was changed, one that the chain does not name, and one of which the chain cannot be
    /// read.
    fn of(found: &FoundRun, of: &ShiftOf, face: &Result<Face, StoreError>) -> Option<Self> {
        let run = found.run.as_ref().ok()?;
        let outcome = run.verdict.of_module()?;
        let counts = run.station == of.station && run.bench.kind == of.kind && run.recomputed.is_none();
        // A run of another module than was scanned is of neither.
        let counts = counts && run.other_module.is_none() && run.bench.kind != BenchKind::Unproven;
        let is_proved = match face {
            Ok(Face::Ended(_)) => true,
            Ok(Face::Late(_) | Face::NotInChain(_) | Face::Interrupted) | Err(_) => found.sealed && !outcome.is_good(),
            Ok(_) => false,
        };
        let outcome = if is_proved { outcome } else { Outcome::Errored };
        counts.then(|| Self {
            serial_number: run.serial_number.clone(),
            plan: run.plan.name.clone(),
            started: run.started,
            outcome,
        })
    }

    /// Whether the run says whether the module is good.
    fn is_judged(&self) -> bool {
        self.outcome.is_good() || self.outcome == Outcome::Failed
    }
}

/// A module of a shift.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ModuleOfShift {
    /// Its serial number.
    pub serial_number: String,
    /// When its last run began.
    pub at: DateTime<FixedOffset>,
    /// How its last run ended.
    pub outcome: Outcome,
    /// Whether the module passed at its first try, each plan counted by itself; `None` if no run judged it, or if it
    /// was judged before this shift.
    pub first_pass: Option<bool>,
}

/// A shift so far.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shift {
    /// When it began.
    pub since: DateTime<FixedOffset>,
    /// Its modules, in the order of their last runs.
    pub modules: Vec<ModuleOfShift>,
}

impl Shift {
    /// The modules whose last run ended in one of these ways.
    #[must_use]
    pub fn count(&self, wanted: impl Fn(Outcome) -> bool) -> usize {
        self.modules.iter().filter(|module| wanted(module.outcome)).count()
    }

    /// First-pass yield: the modules that passed at their first try, and those that were tried the first time.
    #[must_use]
    pub fn first_pass(&self) -> (usize, usize) {
        let tried = self.modules.iter().filter_map(|module| module.first_pass);
        tried.fold((0, 0), |(passed, all), pass| (passed + usize::from(pass), all + 1))
    }

    /// Counts runs in the order in which they were closed. `judged_before` tells whether a module was judged by a plan before the shift.
    fn of(since: DateTime<FixedOffset>, runs: &[WholeRun], mut judged_before: impl FnMut(&str, &str) -> bool) -> Self {
        let mut modules: Vec<ModuleOfShift> = Vec::new();
        let mut firsts: HashMap<(&str, &str), bool> = HashMap::new();
        for run in runs.iter().filter(|run| run.is_judged()) {
            firsts.entry((&run.serial_number, &run.plan)).or_insert(run.outcome.is_good());
        }
        let mut first_pass: HashMap<&str, Option<bool>> = HashMap::new();
        for ((serial_number, plan), good) in &firsts {
            let tried = (!judged_before(serial_number, plan)).then_some(*good);
            let so_far = first_pass.entry(serial_number).or_insert(Some(true));
            *so_far = so_far.zip(tried).map(|(so_far, tried)| so_far && tried);
        }
        for run in runs {
            modules.retain(|module| module.serial_number != run.serial_number);
            modules.push(ModuleOfShift {
                serial_number: run.serial_number.clone(),
                at: run.started,
                outcome: run.outcome,
                first_pass: first_pass.get(run.serial_number.as_str()).copied().flatten(),
            });
        }
        Self { since, modules }
    }
}

/// Reads shifts, and remembers runs that it has read.
#[derive(Debug)]
pub struct ShiftBook {
    of: ShiftOf,
    read: HashMap<PathBuf, Option<WholeRun>>,
    judged_before: HashMap<(String, String), bool>,
    since: Option<DateTime<FixedOffset>>,
}

impl ShiftBook {
    /// A book that has read nothing yet.
    #[must_use]
    pub fn new(of: ShiftOf) -> Self {
        Self { of, read: HashMap::new(), judged_before: HashMap::new(), since: None }
    }

    /// Whose runs it counts.
    #[must_use]
    pub fn of(&self) -> &ShiftOf {
        &self.of
    }

    /// The shift from `since` to `now`. Runs that still go on and runs of the future do not count.
    pub fn shift(&mut self, since: DateTime<FixedOffset>, now: DateTime<FixedOffset>) -> Shift {
        if self.since.replace(since) != Some(since) {
            (self.read, self.judged_before) = Default::default();
        }
        let mut day = since.date_naive();
        let mut paths = Vec::new();
        // A run lies in the folder of its local day; a shift covers two days at most, and a clock that changes its
        // offset may add one.
        while day <= now.date_naive() && paths.len() < MAX_RUNS_OF_DAY {
            paths.extend(reader::paths_of_day(&self.of.records, &day.format("%F").to_string()).unwrap_or_default());
            let Some(next) = day.succ_opt() else { break };
            day = next;
        }
        let mut seals = Seals::new(&self.of.records);
        for path in &paths {
            if !self.read.contains_key(path) && !crate::store::goes_on(path) {
                let found = reader::found(path.clone());
                let face = seals.face(&found);
                // Its station closes it at this moment, so the next look tells.
                if !matches!(face, Ok(Face::Running)) {
                    self.read.insert(path.clone(), WholeRun::of(&found, &self.of, &face));
                }
            }
        }
        let paths = chain::by_close(&self.of.records, paths);
        let runs = paths.iter().filter_map(|path| self.read.get(path)?.clone());
        let runs: Vec<WholeRun> = runs.filter(|run| (since..=now).contains(&run.started)).collect();
        let (of, known) = (&self.of, &mut self.judged_before);
        Shift::of(since, &runs, |serial_number, plan| {
            let key = (serial_number.to_owned(), plan.to_owned());
            *known.entry(key).or_insert_with(|| was_judged(of, serial_number, plan, since))
        })
    }
}

/// Whether a module was judged by a plan before a time.
fn was_judged(of: &ShiftOf, serial_number: &str, plan: &str, before: DateTime<FixedOffset>) -> bool {
    let earlier = reader::newest_of_module(&of.records, serial_number).take(MAX_EARLIER);
    let mut seals = Seals::new(&of.records);
    let runs = earlier.filter_map(|path: PathBuf| {
        let found = reader::found(path);
        let face = seals.face(&found);
        WholeRun::of(&found, of, &face)
    });
    runs.into_iter()
        .any(|run| run.serial_number == serial_number && run.plan == plan && run.started < before && run.is_judged())
}

/// The operator of the newest run of a station since a time; `None` if that run names none, or if there is no run.
#[must_use]
pub fn last_operator(of: &ShiftOf, since: DateTime<FixedOffset>) -> Option<String> {
    // A folder has the local date of its run. No older journal is read for the answer: the screen waits for it.
    let first = since.date_naive() - DATE_SLACK;
    let newest = reader::newest(&of.records, MAX_EARLIER);
    let in_time = newest.take_while(|run| reader::day_of_run(run).is_none_or(|day| day >= first));
    let ours = in_time
        .filter_map(|path| reader::read(&path).ok())
        .take_while(|run| run.started >= since)
        .find(|run| run.station == of.station && run.bench.kind == of.kind);
    ours.and_then(|run| run.operator)
}

#[cfg(test)]
mod tests;
