//! Checks the chain from the first run to the last.

use std::collections::HashSet;
use std::path::Path;

use super::COUNTER;
use super::entry::{ChainEntry, Place};
use super::read::{chains, counter, name_in};
use crate::store::{DIGESTS, StoreError, digest, goes_on, reader};

/// The result of a check of the chain.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct ChainCheck {
    /// Runs in the chain.
    pub runs: usize,
    /// Number of the first run in the chain. If it is not 1, earlier days were moved elsewhere.
    pub first: u64,
    /// What was changed, a sentence each.
    pub problems: Vec<String>,
    /// Runs in the chain that were closed late.
    pub late: usize,
}

/// Checks the chain from the first run to the last.
///
/// # Errors
/// The folder cannot be read.
pub fn verify(records: &Path) -> Result<ChainCheck, StoreError> {
    let mut checked = ChainCheck::default();
    // Before the chain is read: a run that is closed meanwhile stands in the chain and not here.
    let closed = closed(records)?;
    let chains = chains(records, usize::MAX)?;
    for day in chains.iter().filter(|day| day.broken > 0) {
        checked.problems.push(format!("{}: {} lines do not belong to a chain", day.path.display(), day.broken));
    }
    let mut links: Vec<ChainEntry> = chains.into_iter().flat_map(|day| day.lines).collect();
    links.sort_by_key(|link| link.number);
    checked.runs = links.iter().filter(|link| link.is_close()).count();
    checked.late = links.iter().filter(|link| link.late.is_some()).count();
    checked.first = links.first().map_or(0, |link| link.number);
    for pair in links.windows(2) {
        if pair[1].number != pair[0].number + 1 || pair[1].before != pair[0].link {
            let (before, after) = (&pair[0], &pair[1]);
            checked.problems.push(format!(
                "the chain is broken between run {} ({}) and run {} ({})",
                before.number, before.run, after.number, after.run
            ));
        }
    }
    for link in links.iter().filter(|link| link.is_close()) {
        look_at(records, link, &mut checked.problems);
    }
    slipped_in(&closed, &links, &mut checked.problems);
    match (counter(records)?, links.last()) {
        (None, Some(_)) => {
            checked.problems.push(format!("{COUNTER} is missing, so the number of runs is not known"));
        }
        (Some(Place { number, .. }), last) if last.map_or(0, |last| last.number) < number => {
            let last = last.map_or(0, |last| last.number);
            checked.problems.push(format!(
                "{number} runs were closed, but the chain ends at run {last}: the newest runs are missing"
            ));
        }
        (Some(Place { number, link }), _) if links.iter().any(|one| one.number == number && one.link != link) => {
            checked.problems.push(format!("run {number} is not the run that {COUNTER} remembers"));
        }
        _ => {}
    }
    Ok(checked)
}

fn look_at(records: &Path, link: &ChainEntry, problems: &mut Vec<String>) {
    if !link.is_true() {
        problems.push(format!("run {} ({}): its line in the chain was changed", link.number, link.run));
    }
    let sums = records.join(&link.run).join(DIGESTS);
    match digest::of_file(&sums) {
        Ok(digest) if digest == link.digest => {}
        Ok(_) => {
            problems
                .push(format!("run {} ({}): {DIGESTS} was changed after the run was closed", link.number, link.run));
        }
        Err(_) => problems.push(format!("run {} ({}) was closed, and its folder is missing", link.number, link.run)),
    }
}

/// `DATE/SERIAL/TIME-PLAN` of all closed runs; of those that a station is closing now, none.
fn closed(records: &Path) -> Result<Vec<String>, StoreError> {
    let closed = reader::paths(records)?.into_iter().filter(|run| reader::is_sealed(run) && !goes_on(run));
    Ok(closed.map(|run| name_in(records, &run)).collect())
}

/// Reports closed runs that the chain of their day does not contain. Days from before the chain existed have no chain.
fn slipped_in(closed: &[String], links: &[ChainEntry], problems: &mut Vec<String>) {
    let known: HashSet<&str> = links.iter().map(|link| link.run.as_str()).collect();
    let Some(first_day) = links.iter().filter_map(|link| link.run.split('/').next()).min() else { return };
    for name in closed.iter().filter(|name| name.as_str() > first_day && !known.contains(name.as_str())) {
        problems.push(format!(
            "{name} is not in the chain: its station ended before that and closes it late at its next start, or it was slipped in"
        ));
    }
}
