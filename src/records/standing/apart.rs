//! Runs that stand apart from all modules, because another module was in the socket than was scanned.
//!
//! Such a run concerns the scanned module if it was in the socket before: what became of it there is not known. Neither the
//! folder nor the chain has the number of that module, so the record tells, or the journal if the record cannot be believed:
//! both hold the number that was scanned. A damaged run concerns its module unless its journal, proved by its digest, says
//! otherwise. Of a run whose folder is gone, or of which neither record nor journal can be read, nothing tells the module.
//! `records verify` reports it, and it concerns none here: else one damaged folder would close the way of every module of the
//! station, also of those that are tested again, and an operator could do nothing about it.

use std::path::{Path, PathBuf};

use chrono::NaiveDate;
use gnc_executive::event::BenchKind;
use gnc_executive::standing::{Flaw, PastRun, Question, RunFacts, Seal};

use super::{Seals, after_name, begun, days_of_passes, facts, nameless, plan_folder};
use crate::store::{StoreError, chain, reader};

/// Most runs that are opened for a module of which nothing counts, where they only tell what to call it. Those after a run that
/// counts are judged, and have no bound.
const MAX_NAMED: usize = 1000;

/// A run in which the scanned module was exchanged for another one, or may have been.
pub(super) struct Apart {
    /// Its place in the order in which runs were closed; `None` if no chain that can be read names it.
    pub(super) number: Option<u64>,
    pub(super) folder: PathBuf,
    pub(super) run: PastRun,
}

/// The runs apart that concern the module and came after the run that counts, given with its number; if none counts, those of
/// the time in which one could. They are in no order.
pub(super) fn after(
    records: &Path,
    question: &Question<'_>,
    counted: Option<(u64, &Path)>,
    seals: &mut Seals<'_>,
) -> Result<Vec<Apart>, StoreError> {
    let places = places(records, question, counted)?.into_iter();
    let look = |(number, folder): (Option<u64>, PathBuf)| {
        concerning(&folder, question, seals).map(|run| Apart { number, folder, run })
    };
    Ok(places.filter_map(look).collect())
}

/// Where these runs may be, of whatever module. A run that no chain names has the time of its folder.
pub(super) fn places(
    records: &Path,
    question: &Question<'_>,
    counted: Option<(u64, &Path)>,
) -> Result<Vec<(Option<u64>, PathBuf)>, StoreError> {
    let counted = counted.map(|(number, folder)| (number, reader::when(folder)));
    let days = days_of_passes(question);
    let mut found = Vec::new();
    for day in reader::day_names(records)?.into_iter().rev() {
        // The clock may have been wrong, so a day before that of the pass may have later runs. The end of its chain tells: all
        // its lines are read only then. A chain that cannot be read leaves the times of the folders, which are earlier.
        let is_wanted = match &counted {
            Some((number, (of_pass, _))) => {
                day >= *of_pass || chain::last_number(records, &day).is_some_and(|last| last > *number)
            }
            None => {
                let date = NaiveDate::parse_from_str(&day, "%Y-%m-%d");
                found.len() < MAX_NAMED && date.is_ok_and(|date| days.contains(&date))
            }
        };
        let folders = if is_wanted { reader::unassigned(records, &day) } else { Vec::new() };
        if folders.is_empty() {
            continue;
        }
        let numbers = chain::apart(records, &day).unwrap_or_default();
        let is_later = |(number, folder): &(Option<u64>, PathBuf)| match (&counted, number) {
            (None, _) => true,
            (Some((counted, _)), Some(number)) => number > counted,
            (Some((_, counted)), None) => reader::when(folder) > *counted,
        };
        let of_day = folders.into_iter().rev().map(|folder| (numbers.get(&folder).copied(), folder));
        found.extend(of_day.filter(is_later));
    }
    if counted.is_none() {
        found.truncate(MAX_NAMED);
    }
    Ok(found)
}

/// What a run says of the module, if it concerns it.
fn concerning(folder: &Path, question: &Question<'_>, seals: &mut Seals<'_>) -> Option<PastRun> {
    // A chain that cannot be read says as much as one that does not name the run.
    let seal = seals.seal(folder).unwrap_or(Seal::Flawed(Flaw::NotInChain));
    let is_broken = seals.is_broken(folder, seal).unwrap_or(false);
    let kept = match seal {
        Seal::Chained => None,
        Seal::Flawed(flaw) => Some(flaw),
    };
    let of_module = |facts: &RunFacts| facts.exchanged && facts.serial_number == question.serial_number;
    let of_world = |facts: &RunFacts| question.bench == BenchKind::Simulated || facts.bench == BenchKind::Real;
    let record = facts(folder);
    let is_as_closed = matches!(kept, None | Some(Flaw::ClosedLate));
    let (told, is_proved) = match record {
        Some(record) if is_as_closed => (Some(record), true),
        record => {
            let is_proved = seals.has_journal_as_closed(folder);
            let written = journal(folder, is_broken && !is_proved);
            // Each edit takes the module out of one of the two, unless the journal is proved.
            let record = record.filter(|_| !is_proved || written.is_none());
            ([written, record].into_iter().flatten().find(of_module), is_proved || !is_broken)
        }
    };
    let told = told.filter(of_module).filter(|told| !is_proved || of_world(told))?;
    if let Some(flaw) = kept.filter(|_| !is_proved && after_name(&plan_folder(folder), &told.plan.name).is_none()) {
        // The name of the folder stands in the chain.
        return Some(PastRun { is_broken, ..nameless(folder, question, flaw) });
    }
    let mut flaws = told.flaws(question);
    if let Some(flaw) = kept {
        flaws.retain(|flaw| *flaw != Flaw::NoVerdict);
        flaws.insert(0, flaw);
    }
    Some(PastRun { is_broken, ..PastRun::new(&told, flaws) })
}

/// What the journal of a run says, which is exchanged unless the journal tells that the scanned module never was in the socket.
/// `is_doubtful` is a journal of which that cannot be believed.
fn journal(folder: &Path, is_doubtful: bool) -> Option<RunFacts> {
    let Ok(record) = reader::read(folder) else {
        return begun(folder).map(|facts| RunFacts { exchanged: true, ..facts });
    };
    let facts = RunFacts::from(&record);
    Some(RunFacts { exchanged: facts.exchanged || is_doubtful || record.other_module.is_none(), ..facts })
}
