//! Compares the signatures of the lines with the keys of the stations.

use std::path::Path;

use super::begin;
use super::check::{Against, ChainBook, ChainCheck};
use super::entry::ChainEntry;
use super::read::name_in;
use crate::store::PublicKey;

/// Number of the first line with a signature. It covers the link before it, and so all lines before.
fn since(book: &ChainBook) -> Option<u64> {
    book.lines.iter().find(|line| line.signature.is_some()).map(|line| line.number)
}

pub(super) fn check(book: &ChainBook, against: &Against<'_>, checked: &mut ChainCheck) {
    let keys = against.keys;
    if keys.is_empty() || book.lines.is_empty() {
        return;
    }
    let all: Vec<&ChainEntry> = book.lines.iter().collect();
    let Some(since) = since(book) else {
        // Lines of earlier versions have no signature. Whether they are those that were written, what was kept elsewhere tells.
        let is_older = book.lines.iter().all(|line| line.stamp.is_none());
        let told = if is_older && !against.heads.is_empty() { &mut checked.notes } else { &mut checked.problems };
        told.push(NONE_IS_SIGNED.to_owned());
        return;
    };
    if let (Some(first), true) = (all.first(), all.first().is_some_and(|first| first.number < since)) {
        checked.notes.push(format!(
            "lines {} to {} of the chain are not signed: there was no key yet, or the signatures were taken away",
            first.number,
            since.saturating_sub(1)
        ));
    }
    let simulated = check_lines(book, &all, keys, &mut checked.problems);
    if simulated > 0 {
        checked.notes.push(format!(
            "{simulated} lines of the chain are of simulated runs and not signed: a simulated bench has no key"
        ));
    }
}

/// What is said if there is no signature at all.
const NONE_IS_SIGNED: &str = "no line of the chain is signed: a version before that wrote them all, there was no key, or the chain was made anew";

/// Checks some of the lines, and returns the number of those that have no signature since their bench is simulated.
pub(super) fn check_lines(
    book: &ChainBook,
    lines: &[&ChainEntry],
    keys: &[PublicKey],
    problems: &mut Vec<String>,
) -> usize {
    let mut simulated = 0;
    if keys.is_empty() {
        return simulated;
    }
    let Some(since) = since(book) else {
        problems.push(NONE_IS_SIGNED.to_owned());
        return simulated;
    };
    for line in lines {
        match line.is_signed_by(keys) {
            Some(true) => {}
            Some(false) => problems.push(format!(
                "run {} ({}): the signature of its line in the chain is not by this key",
                line.number, line.run
            )),
            None if line.number < since => {}
            None if is_simulated(book, line) => simulated += 1,
            None => problems.push(format!(
                "run {} ({}): its line in the chain is not signed, and earlier ones are",
                line.number, line.run
            )),
        }
    }
    simulated
}

/// Why a closed run has no signature, if that is no change.
pub(super) fn why_unsigned(book: &ChainBook, run: &str) -> Option<&'static str> {
    let line = book.close_of(run).filter(|line| line.signature.is_none())?;
    match since(book) {
        Some(since) if line.number < since => Some("not signed: there was no key yet, or the signature was taken away"),
        Some(_) if is_simulated(book, line) => Some("not signed: a simulated bench has no key"),
        _ => None,
    }
}

impl ChainBook {
    /// Whether the line of a run's beginning is signed: then its station had the key while it captured.
    #[must_use]
    pub fn began_signed(&self, run: &Path) -> bool {
        let name = name_in(&self.records, run);
        let began = self.close_of(&name).map_or(name.as_str(), ChainEntry::began_as);
        let begin = self.begins.get(began).and_then(|at| self.lines.get(*at));
        begin.is_some_and(|begin| begin.signature.is_some())
    }
}

/// Whether the journal of a line's run says that its bench is simulated. Such a run proves nothing, and the next signed line
/// keeps its own line in its place.
fn is_simulated(book: &ChainBook, line: &ChainEntry) -> bool {
    let moved = book.close_of_begun(&line.run);
    let run = moved.map_or(&line.run, |close| &close.run);
    let first = begin::first_line(&book.records, &book.records.join(Path::new(run)));
    let event = first.ok().and_then(|line| serde_json::from_slice::<serde_json::Value>(&line).ok());
    event.is_some_and(|event| event["header"]["bench"]["kind"] == "simulated")
}
