//! Finds the runs of a module for the rule of [`gnc_executive::standing`], without reading more of them than the answer
//! needs.
//!
//! The chain tells which runs of the module were closed, and in which order, whatever the clocks said. So the newest run
//! that counts is found from the chains of the days that can count. Folders are looked at only for what to call a module
//! for which nothing counts.

mod apart;
mod face;
mod seals;

use std::io::{BufRead as _, BufReader, Read as _};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use chrono::{DateTime, FixedOffset, NaiveDate, NaiveDateTime, TimeDelta};
use gnc_executive::event::{BenchInfo, BenchKind, EarlierRun, Event, EventKind, OtherModule, PlanInfo};
use gnc_executive::outcome::Outcome;
use gnc_executive::standing::{Flaw, PastRun, Question, RunFacts, Seal, Standing};
use gnc_executive::verdict::Verdict;
use serde::Deserialize;

use apart::Apart;
pub use face::Face;
pub use seals::Seals;

use crate::store::chain::OpenRun;
use crate::store::reader::Wanted;
use crate::store::{self, JOURNAL, MAX_FIRST_EVENT_BYTES, PublicKey, RECORD, StoreError, chain, name, reader};

/// Most closed runs of a module whose records are opened to find one that counts: more than a socket can make of one
/// module in a month.
const MAX_COUNTED: usize = 10_000;

/// Most runs that are opened to find out what to call a module of which nothing counts. What came after a run that counts is
/// judged without a bound: old failures must not disappear behind many harmless runs.
const MAX_NAMED: usize = 50;

/// Days around the date of a run: its folder has the date of its place, and the question that of another.
const DATE_SLACK: TimeDelta = TimeDelta::days(1);

/// The standing of a module. With keys a verdict counts if one of them signed its run: see [`Seals::unsigned`].
///
/// # Errors
/// [`StoreError`]: the records cannot be read, so nothing can be said.
pub fn read(records: &Path, question: &Question<'_>, keys: &[PublicKey]) -> Result<Standing, StoreError> {
    let mut standing = Standing { plan: question.plan.name().to_owned(), counts: None, beside: None };
    // The first run of a station creates the folder.
    if !records.exists() {
        return Ok(standing);
    }
    // A failed run may lie in a folder that cannot be read.
    let wanted = Wanted { serial_number: Some(question.serial_number), ..Wanted::default() };
    if let Some(error) = reader::unread(records, wanted)?.pop() {
        return Err(error);
    }
    let mut seals = Seals::new(records).with_keys(keys);
    let Closed { counted, later, mut missing } = closed(records, question, &mut seals)?;
    missing.extend(gone(records, question, counted.as_ref().map(|(number, ..)| *number), &mut seals)?);
    missing.sort_by_key(|(number, _)| std::cmp::Reverse(*number));
    let plan = question.plan.name();
    let mark = counted.as_ref().map(|(number, folder, _)| (*number, folder.as_path()));
    let apart = apart::after(records, question, mark, &mut seals)?;
    // No run before one of the plan that ended with another module in the socket counts: what became of the module in it is
    // not known.
    let voids = |run: &PastRun| run.speaks_against(plan);
    let missing: Vec<PastRun> = missing.iter().map(|(_, folder)| nameless(folder, question, Flaw::Missing)).collect();
    let newest_gone = missing.first().cloned();
    if counted.is_none() && !apart.iter().any(|apart| voids(&apart.run)) {
        standing.beside = newest(records, question, &mut seals)?.or(newest_gone);
        return Ok(standing);
    }
    let after = in_order(records, question, mark, later, apart, &mut seals)?;
    if let Some(at) = after.iter().position(|after| after.apart.as_ref().is_some_and(voids)) {
        standing.beside = judged(&after[..at], question, &mut seals)?.or_else(|| after[at].apart.clone());
        return Ok(standing);
    }
    let found = doubt(&after, question, &mut seals)?;
    let against = found.clone().filter(voids).or_else(|| missing.into_iter().find(voids));
    match counted.map(|(_, _, run)| run) {
        Some(passed) if !passed.flaws.is_empty() => standing.beside = against.or(Some(passed)),
        counts => {
            standing.beside = against.or(found).or(newest_gone);
            standing.counts = counts;
        }
    }
    Ok(standing)
}

/// The days in whose folders runs that count may stand.
fn days_of_passes(question: &Question<'_>) -> RangeInclusive<NaiveDate> {
    let first = question.now - TimeDelta::days(i64::from(question.valid_days)) - DATE_SLACK;
    first.date_naive()..=(question.now + DATE_SLACK).date_naive()
}

/// What the chain says of the runs of a module.
#[derive(Default)]
struct Closed {
    /// The newest run that counts, with its number and folder. If it is a pass and the chain lacks lines behind it, it has this flaw:
    /// neither it nor an older pass counts.
    counted: Option<(u64, PathBuf, PastRun)>,
    /// The runs that were closed after that one, with their numbers.
    later: Vec<(u64, PathBuf)>,
    /// The runs after that one whose folders are gone, with their numbers.
    missing: Vec<(u64, PathBuf)>,
}

/// Looks from the newest closed run back to the first one that counts.
fn closed(records: &Path, question: &Question<'_>, seals: &mut Seals<'_>) -> Result<Closed, StoreError> {
    let days = days_of_passes(question);
    let names = reader::folders_of(question.serial_number);
    let mut closed: Vec<(u64, bool, PathBuf)> = Vec::new();
    // A run of any day may have been closed last: the clock may have been wrong then.
    for day in reader::day_names(records)? {
        let date = NaiveDate::parse_from_str(&day, "%Y-%m-%d");
        let in_time = date.is_ok_and(|date| days.contains(&date));
        for name in names.iter().filter(|name| is_own_folder(&records.join(&day).join(name))) {
            let runs = seals.day(&day)?.of_module(name);
            closed.extend(runs.map(|(number, run)| (number, in_time, records.join(run))));
        }
    }
    closed.sort_by_key(|(number, ..)| std::cmp::Reverse(*number));
    let mut found = Closed::default();
    for (number, in_time, folder) in closed.into_iter().take(MAX_COUNTED) {
        if !is_own_folder(&folder) {
            if in_time {
                found.missing.push((number, folder));
            }
            continue;
        }
        let facts = if in_time { facts(&folder) } else { None };
        if let Some(facts) = facts.filter(|facts| facts.serial_number == question.serial_number) {
            let flaws = facts.flaws(question);
            // Digests and signatures are compared only where everything else is right.
            if flaws.is_empty() && seals.seal(&folder)? == Seal::Chained && seals.unsigned(&folder)?.is_none() {
                let is_good = facts.verdict.is_some_and(|verdict| verdict.of_items().is_good());
                let lacks_lines = is_good && seals.lacks_lines_behind(&folder)?;
                let flaws = if lacks_lines { vec![Flaw::LinesMissing] } else { flaws };
                found.counted = Some((number, folder, PastRun::new(&facts, flaws)));
                break;
            }
        }
        found.later.push((number, folder));
    }
    Ok(found)
}

/// The runs after the one that counts of which only lines in the chain are left: those that were closed, where the folder of the
/// module is gone with them, and those that began. If nothing counts, a few days tell what to call the module.
fn gone(
    records: &Path,
    question: &Question<'_>,
    counted: Option<u64>,
    seals: &mut Seals<'_>,
) -> Result<Vec<(u64, PathBuf)>, StoreError> {
    let days = days_of_passes(question);
    let names = reader::folders_of(question.serial_number);
    let in_time = |day: &String| NaiveDate::parse_from_str(day, "%Y-%m-%d").is_ok_and(|date| days.contains(&date));
    // The end of a chain tells whether it has anything behind the run that counts.
    let is_later =
        |day: &String| counted.is_none_or(|counted| chain::last_line(records, day).is_some_and(|last| last > counted));
    let of_time = reader::day_names(records)?.into_iter().rev().filter(in_time).filter(is_later);
    let mut gone = Vec::new();
    for day in of_time.take(if counted.is_some() { usize::MAX } else { MAX_NAMED }) {
        // A chain that cannot be read concerns the modules of its day, whose folders are there; `verify` names it.
        let Ok(links) = seals.day(&day) else { continue };
        for name in &names {
            if !is_own_folder(&records.join(&day).join(name)) {
                let runs = links.of_module(name);
                gone.extend(runs.map(|(number, run)| (number, records.join(run))));
            }
            let is_gone = |(run, open): &(&str, &OpenRun)| {
                !is_own_folder(&records.join(run)) && !chain::was_moved(records, &day, open)
            };
            let begun = links.open_of_module(name).filter(is_gone);
            gone.extend(begun.map(|(run, open)| (open.number, records.join(run))));
        }
    }
    gone.retain(|(number, _)| counted.is_none_or(|counted| *number > counted));
    Ok(gone)
}

/// A run after the one that counts.
struct After {
    folder: PathBuf,
    /// What it says of the module, if it stands apart. One that stands with the module is opened when it is asked for.
    apart: Option<PastRun>,
}

impl After {
    fn run(&self, question: &Question<'_>, seals: &mut Seals<'_>) -> Result<Option<PastRun>, StoreError> {
        self.apart.clone().map_or_else(|| past(&self.folder, question, seals), |run| Ok(Some(run)))
    }
}

/// The runs after the one that counts, the last one first. The chain has the order of the runs that it names. Of the others
/// only their folders tell, by the clock of that time.
fn in_order(
    records: &Path,
    question: &Question<'_>,
    counted: Option<(u64, &Path)>,
    later: Vec<(u64, PathBuf)>,
    apart: Vec<Apart>,
    seals: &mut Seals<'_>,
) -> Result<Vec<After>, StoreError> {
    let own = |folder| After { folder, apart: None };
    let mut closed: Vec<(u64, After)> = later.into_iter().map(|(number, folder)| (number, own(folder))).collect();
    let mut others = Vec::new();
    let counted = counted.map(|(_, folder)| folder);
    for folder in reader::newest_of_module(records, question.serial_number) {
        if counted == Some(folder.as_path()) {
            break;
        }
        if seals.number(&folder)?.is_none() {
            others.push(own(folder));
        }
    }
    for Apart { number, folder, run } in apart {
        let run = After { folder, apart: Some(run) };
        match number {
            Some(number) => closed.push((number, run)),
            None => others.push(run),
        }
    }
    closed.sort_by_key(|(number, _)| std::cmp::Reverse(*number));
    others.sort_by_cached_key(|after| std::cmp::Reverse(reader::when(&after.folder)));
    let mut ordered: Vec<After> = closed.into_iter().map(|(_, after)| after).collect();
    for after in others {
        // Before the first of those that are older by their folders too.
        let place = ordered.iter().position(|closed| reader::when(&closed.folder) < reader::when(&after.folder));
        ordered.insert(place.unwrap_or(ordered.len()), after);
    }
    Ok(ordered)
}

/// The newest run after the one that counts that puts it in doubt: one of the same plan that speaks against it before others,
/// so that no run of another plan hides it.
fn doubt(after: &[After], question: &Question<'_>, seals: &mut Seals<'_>) -> Result<Option<PastRun>, StoreError> {
    let mut newest = None;
    for after in after {
        if let Some(run) = after.run(question, seals)?.filter(|run| run.is_doubt(question.bench)) {
            if run.speaks_against(question.plan.name()) {
                return Ok(Some(run));
            }
            newest.get_or_insert(run);
        }
    }
    Ok(newest)
}

/// The newest run of the plan that judged the module: the whole plan, or chosen items that failed. An operator must hear of it
/// before an exchange that came earlier.
fn judged(after: &[After], question: &Question<'_>, seals: &mut Seals<'_>) -> Result<Option<PastRun>, StoreError> {
    let is_judgement = |run: &PastRun| {
        let outcome = run.verdict.map(Verdict::of_items);
        let judges = outcome == Some(Outcome::Failed) || run.items.is_none() && outcome.is_some_and(Outcome::is_good);
        run.plan == question.plan.name()
            && run.is_of_world(question.bench)
            && judges
            && !run.flaws.contains(&Flaw::Rejudged)
    };
    for after in after {
        if let Some(run) = after.run(question, seals)?.filter(is_judgement) {
            return Ok(Some(run));
        }
    }
    Ok(None)
}

/// The newest run of the module by this plan; if there is none, the newest of all.
fn newest(records: &Path, question: &Question<'_>, seals: &mut Seals<'_>) -> Result<Option<PastRun>, StoreError> {
    let plan = name::of_part(question.plan.name());
    let of_plan = |folder: &PathBuf| plan_folder(folder).starts_with(&plan);
    let runs = || reader::newest_of_module(records, question.serial_number);
    for folder in runs().filter(of_plan).take(MAX_NAMED) {
        if let Some(run) = past(&folder, question, seals)?.filter(|run| run.plan == question.plan.name()) {
            return Ok(Some(run));
        }
    }
    for folder in runs().take(MAX_NAMED) {
        if let Some(run) = past(&folder, question, seals)? {
            return Ok(Some(run));
        }
    }
    Ok(None)
}

/// The name of a run's folder without its time: it begins with the name of the plan.
fn plan_folder(run: &Path) -> String {
    let name = run.file_name().unwrap_or_default().to_string_lossy();
    name.split_once('-').map_or_else(String::new, |(_, plan)| plan.to_owned())
}

/// A run of which only the name of its folder tells.
fn nameless(folder: &Path, question: &Question<'_>, flaw: Flaw) -> PastRun {
    let day = folder.ancestors().nth(2).and_then(Path::file_name).unwrap_or_default().to_string_lossy();
    let run = folder.file_name().unwrap_or_default().to_string_lossy();
    let time = format!("{day} {}", run.split('-').next().unwrap_or_default());
    let at = NaiveDateTime::parse_from_str(&time, "%Y-%m-%d %H%M%S").ok();
    // The folder is named by the time of its place, which is mostly this place.
    let at = at.and_then(|at| at.and_local_timezone(question.now.timezone()).earliest());
    PastRun::nameless(plan_of(folder, question), at, flaw)
}

/// The plan of a run by the name of its folder, with the number of the second run in a second.
fn plan_of(folder: &Path, question: &Question<'_>) -> String {
    let (plan, asked) = (plan_folder(folder), question.plan.name());
    match after_name(&plan, asked) {
        Some(number) => format!("{asked}{number}"),
        None => plan,
    }
}

/// What stands behind the name of a plan in that of a folder: nothing, or the number of the second run in a second; `None` if
/// the folder is that of another plan.
fn after_name<'a>(folder: &'a str, plan: &str) -> Option<&'a str> {
    let rest = folder.strip_prefix(&name::of_part(plan))?;
    let is_number = rest.strip_prefix('-').is_some_and(|number| number.parse::<u32>().is_ok());
    (rest.is_empty() || is_number).then_some(rest)
}

/// A run as it is; `None` if it belongs to another module, whose number gives the same name of a folder, or never began.
fn past(folder: &Path, question: &Question<'_>, seals: &mut Seals<'_>) -> Result<Option<PastRun>, StoreError> {
    if store::was_never_begun(folder) && seals.number(folder)?.is_none() && seals.open(folder)?.is_none() {
        return Ok(None);
    }
    let seal = seals.seal(folder)?;
    let mut is_broken = seals.is_broken(folder, seal)?;
    let mut kept = match seal {
        Seal::Chained => None,
        Seal::Flawed(flaw) => Some(flaw),
    };
    let facts = facts(folder).or_else(|| begun(folder));
    // A simulated bench has no key, and its runs say nothing on a bench that has one.
    if kept.is_none() && facts.as_ref().is_some_and(|facts| facts.bench != BenchKind::Simulated) {
        kept = seals.unsigned(folder)?;
        is_broken |= kept == Some(Flaw::Unsigned);
    }
    let Some(facts) = facts else {
        // Nothing tells whose run it is, but it stands among those of this module.
        return Ok(Some(PastRun { is_broken, ..nameless(folder, question, Flaw::Unreadable) }));
    };
    let is_named = facts.serial_number == question.serial_number;
    if let Some(flaw) = kept.filter(|_| is_broken)
        && !(is_named && after_name(&plan_folder(folder), &facts.plan.name).is_some())
    {
        // An altered record may name any module and plan. The name of its folder stands in the chain.
        return Ok(Some(PastRun { is_broken, ..nameless(folder, question, flaw) }));
    }
    if !is_named {
        // Two serial numbers may share one folder, and some file systems ignore the case of letters. A station files no run of any
        // other number there: such a run stands in the place of one that a person took away.
        let of = folder.parent().and_then(Path::file_name).unwrap_or_default().to_string_lossy();
        let is_of_folder = reader::folders_of(&facts.serial_number).iter().any(|name| name.eq_ignore_ascii_case(&of));
        let swapped = || PastRun { is_broken: true, ..nameless(folder, question, Flaw::Changed) };
        return Ok((!is_of_folder).then(swapped));
    }
    let mut flaws = facts.flaws(question);
    if let Some(flaw) = kept {
        // A run that is not closed has no verdict that could count, and needs no second word for that.
        flaws.retain(|flaw| *flaw != Flaw::NoVerdict);
        flaws.insert(0, flaw);
    }
    Ok(Some(PastRun { is_broken, ..PastRun::new(&facts, flaws) }))
}

/// The part of `run.json` that the standing needs.
#[derive(Deserialize)]
struct RecordHead {
    outcome: Option<Outcome>,
    #[serde(default)]
    selection_outcome: Option<Outcome>,
    interrupted: bool,
    serial_number: String,
    plan: PlanInfo,
    #[serde(default)]
    recomputed: Option<EarlierRun>,
    bench: BenchInfo,
    selection: Option<Vec<String>>,
    started: DateTime<FixedOffset>,
    finished: Option<DateTime<FixedOffset>>,
    #[serde(default)]
    other_module: Option<OtherModule>,
    #[serde(default)]
    items: Vec<ItemHead>,
}

/// The part of an item that the standing needs.
#[derive(Deserialize)]
struct ItemHead {
    outcome: Outcome,
}

/// Whether a path is a folder and no link to one: no run counts that lies elsewhere.
fn is_own_folder(path: &Path) -> bool {
    path.symlink_metadata().is_ok_and(|meta| meta.is_dir())
}

/// What the record of a run says; `None` if it has none, or a damaged one.
fn facts(folder: &Path) -> Option<RunFacts> {
    let bytes = reader::paper(folder, RECORD).ok()?;
    let head: RecordHead = serde_json::from_slice(&bytes).ok()?;
    let outcome = head.outcome.or(head.selection_outcome)?;
    Some(RunFacts {
        serial_number: head.serial_number,
        plan: head.plan,
        bench: head.bench.kind,
        rejudged: head.recomputed.is_some(),
        interrupted: head.interrupted,
        verdict: Some(Verdict::new(outcome, head.selection.is_some() || head.selection_outcome.is_some())),
        selection: head.selection,
        started: head.started,
        ended: head.finished,
        exchanged: head.other_module.is_some_and(|other| other.exchanged),
        has_failed_item: head.items.iter().any(|item| item.outcome == Outcome::Failed),
    })
}

/// What the first line of a journal says of a run that has no record, or a damaged one.
fn begun(folder: &Path) -> Option<RunFacts> {
    let mut line = Vec::new();
    let journal = BufReader::new(gnc_files::own(&folder.join(JOURNAL)).ok()?);
    journal.take(MAX_FIRST_EVENT_BYTES).read_until(b'\n', &mut line).ok()?;
    let event: Event = serde_json::from_slice(&line).ok()?;
    let EventKind::RunStarted { header, .. } = event.kind else { return None };
    Some(RunFacts {
        serial_number: header.serial_number,
        plan: header.plan,
        bench: header.bench.kind,
        selection: header.selection,
        rejudged: header.recomputed.is_some(),
        interrupted: false,
        verdict: None,
        started: event.at,
        ended: None,
        exchanged: false,
        has_failed_item: false,
    })
}

#[cfg(test)]
mod tests;
