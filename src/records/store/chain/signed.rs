//! Compares the signatures of the lines with the keys of the stations.

use std::collections::HashMap;
use std::path::Path;

use super::begin;
use super::check::{Against, ChainBook, ChainCheck};
use super::entry::ChainEntry;
use super::read::name_in;
use crate::store::{PublicKey, StoreError};

/// Number of the first line with a signature. It covers the link before it, and so all lines before.
fn since(book: &ChainBook) -> Option<u64> {
    book.lines.iter().find(|line| line.signature.is_some()).map(|line| line.number)
}

/// The first line with a signature of each station. What a station wrote before it got its key has none.
pub(super) fn since_of_stations(book: &ChainBook) -> HashMap<&str, u64> {
    let mut since = HashMap::new();
    for line in book.lines.iter().filter(|line| line.signature.is_some()) {
        if let Some(station) = line.station() {
            since.entry(station).or_insert(line.number);
        }
    }
    since
}

pub(super) fn check(book: &ChainBook, against: &Against<'_>, checked: &mut ChainCheck) {
    let keys = against.keys;
    checked.signed = book.lines.iter().filter(|line| line.signature.is_some()).count();
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
        let (first, last) = (first.number, since.saturating_sub(1));
        checked.notes.push(if first == last {
            format!("line {first} of the chain is not signed: there was no key yet, or the signature was taken away")
        } else {
            format!(
                "lines {first} to {last} of the chain are not signed: there was no key yet, or the signatures were taken away"
            )
        });
    }
    let Unsigned { simulated, mut before_key } = check_lines(book, &all, keys, &mut checked.problems);
    if simulated > 0 {
        checked.notes.push(format!(
            "{simulated} lines of the chain are of simulated runs and not signed: a simulated bench has no key"
        ));
    }
    before_key.sort_unstable();
    for (station, lines) in before_key {
        checked.notes.push(format!(
            "{lines} lines of the station {station} are not signed, and all of its lines behind them are: it had no key yet, or the signatures were taken away"
        ));
    }
}

/// The lines from before the first signed one that it covers. A person who takes signatures away from lines behind it cannot change
/// these lines: the first one that is left is signed, and its link covers them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Witnessed {
    /// No line of the chain is signed.
    NoneIsSigned,
    /// The first signed line is not by one of the keys, or is not as it was written.
    ByNoKey,
    /// From this line on up to the first signed one no link is broken.
    Lines {
        /// The first line that is covered.
        first: u64,
        /// The first signed line.
        signed: u64,
    },
}

impl Witnessed {
    /// # Errors
    /// The records folder cannot be read.
    pub(crate) fn read(records: &Path, keys: &[PublicKey]) -> Result<Self, StoreError> {
        let book = ChainBook::read(records)?;
        let Some(at) = book.lines.iter().position(|line| line.signature.is_some()) else {
            return Ok(Self::NoneIsSigned);
        };
        let (before, rest) = book.lines.split_at(at);
        let Some(signed) = rest.first().filter(|line| line.is_true() && line.is_signed_by(keys) == Some(true)) else {
            return Ok(Self::ByNoKey);
        };
        let mut first = signed;
        for line in before.iter().rev() {
            if Some(first.number) != line.number.checked_add(1) || first.before != line.link || !line.is_true() {
                break;
            }
            first = line;
        }
        Ok(Self::Lines { first: first.number, signed: signed.number })
    }

    /// Whether a line is one of these.
    pub(crate) fn covers(self, number: u64) -> bool {
        matches!(self, Self::Lines { first, signed } if (first..signed).contains(&number))
    }
}

/// What is said if there is no signature at all.
pub const NONE_IS_SIGNED: &str = "no line of the chain is signed: a version before that wrote them all, there was no key, or the chain was made anew";

/// Lines behind the first signed one that have no signature, and are no finding.
#[derive(Debug, Default)]
pub(super) struct Unsigned {
    /// Those of a simulated bench.
    simulated: usize,
    /// Those of stations that got a key later, by the station.
    before_key: Vec<(String, usize)>,
}

/// Checks some of the lines.
pub(super) fn check_lines(
    book: &ChainBook,
    lines: &[&ChainEntry],
    keys: &[PublicKey],
    problems: &mut Vec<String>,
) -> Unsigned {
    let mut unsigned = Unsigned::default();
    let Some(since) = since(book) else {
        problems.push(NONE_IS_SIGNED.to_owned());
        return unsigned;
    };
    let of_stations = since_of_stations(book);
    let mut before_key: HashMap<&str, usize> = HashMap::new();
    for line in lines {
        match line.is_signed_by(keys) {
            Some(true) => {}
            Some(false) => problems
                .push(format!("line {} of the chain ({}): its signature is not by this key", line.number, line.run)),
            None if line.number < since => {}
            None if is_simulated(book, line) => unsigned.simulated += 1,
            None => match line.station().filter(|station| is_before_key(line, &of_stations, station)) {
                Some(station) => *before_key.entry(station).or_default() += 1,
                None => problems.push(format!(
                    "line {} of the chain ({}): it is not signed, and earlier ones are",
                    line.number, line.run
                )),
            },
        }
    }
    unsigned.before_key = before_key.into_iter().map(|(station, lines)| (station.to_owned(), lines)).collect();
    unsigned
}

/// Whether a station signed lines behind this one, and none before it: they cover it, so nothing is hidden there.
fn is_before_key(line: &ChainEntry, of_stations: &HashMap<&str, u64>, station: &str) -> bool {
    of_stations.get(station).is_some_and(|since| line.number < *since)
}

/// Why a closed run has no signature, if that is no change.
pub(super) fn why_unsigned(book: &ChainBook, run: &str) -> Option<&'static str> {
    let line = book.close_of(run).filter(|line| line.signature.is_none())?;
    let is_before = |since: u64| {
        line.number < since
            || line.station().is_some_and(|station| is_before_key(line, &since_of_stations(book), station))
    };
    match since(book) {
        Some(since) if is_before(since) => Some("not signed: there was no key yet, or the signature was taken away"),
        Some(_) if is_simulated(book, line) => Some("not signed: a simulated bench has no key"),
        _ => None,
    }
}

impl ChainBook {
    /// Whether there are lines, and none of them is signed.
    #[must_use]
    pub fn signs_nothing(&self) -> bool {
        !self.lines.is_empty() && since(self).is_none()
    }

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
pub(super) fn is_simulated(book: &ChainBook, line: &ChainEntry) -> bool {
    let moved = book.close_of_begun(&line.run);
    let run = moved.map_or(&line.run, |close| &close.run);
    let first = begin::first_line(&book.records, &book.records.join(Path::new(run)));
    let event = first.ok().and_then(|line| serde_json::from_slice::<serde_json::Value>(&line).ok());
    event.is_some_and(|event| event["header"]["bench"]["kind"] == "simulated")
}
