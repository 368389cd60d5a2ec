//! What the lines and folders themselves tell of signatures that were taken away, without any key. A key signs the digests of a run and
//! both of its lines, or none of them.

use std::collections::HashMap;

use super::check::ChainBook;
use super::entry::ChainEntry;
use super::signed::{is_simulated, since_of_stations};
use crate::store::{DIGESTS, SIGNATURE};

/// Length of an Ed25519 signature.
const SIGNATURE_BYTES: u64 = 64;

/// Compares the lines of each closed run with one another, and with its folder. All lines of a run must be among them.
pub(super) fn check(book: &ChainBook, lines: &[&ChainEntry], problems: &mut Vec<String>) {
    let first_signed = book.lines.iter().find(|line| line.signature.is_some()).map(|line| line.number);
    let of_stations = since_of_stations(book);
    let begins: HashMap<&str, &ChainEntry> =
        lines.iter().filter(|line| !line.is_close()).map(|line| (line.run.as_str(), *line)).collect();
    // Earlier versions signed the digests alone.
    for line in lines.iter().filter(|line| line.is_close() && line.stamp.is_some()) {
        let (number, run) = (line.number, &line.run);
        let folder = book.records.join(run);
        // What is missing besides is told elsewhere.
        let file = folder.join(DIGESTS).is_file().then(|| folder.join(SIGNATURE).symlink_metadata());
        let is_line_signed = line.signature.is_some();
        match file {
            Some(Err(error)) if is_line_signed && error.kind() == std::io::ErrorKind::NotFound => {
                problems.push(format!(
                    "line {number} of the chain ({run}): it is signed, and {SIGNATURE} of the run is missing"
                ));
            }
            Some(Ok(_)) if !is_line_signed => {
                problems.push(format!(
                    "line {number} of the chain ({run}): the run has {SIGNATURE}, and the line is not signed"
                ));
            }
            Some(Ok(meta)) if meta.len() != SIGNATURE_BYTES => {
                problems.push(format!("line {number} of the chain ({run}): {SIGNATURE} of the run holds no signature"));
            }
            _ => {}
        }
        let Some(begin) = begins.get(line.began_as()) else { continue };
        // A start with the key closes no run that began without it, unless its station had signed nothing before.
        let first = begin.station().map_or(first_signed, |station| of_stations.get(station).copied());
        let is_behind_signed = first.is_some_and(|first| first < begin.number);
        if begin.signature.is_some() != is_line_signed && (is_behind_signed || !is_line_signed) {
            problems.push(format!(
                "line {number} of the chain ({run}): of the lines {} and {number} of the run one is signed and one is not",
                begin.number
            ));
        }
    }
}

/// Lines without a signature between signed ones of the same station. Its key may have been away for a while, so that is no finding
/// without a key.
pub(super) fn between_signed(book: &ChainBook) -> Option<String> {
    let signed = || book.lines.iter().filter(|line| line.signature.is_some());
    let mut spans: HashMap<&str, (u64, u64)> = HashMap::new();
    for line in signed() {
        let Some(station) = line.station() else { continue };
        spans.entry(station).or_insert((line.number, line.number)).1 = line.number;
    }
    let is_between = |line: &&ChainEntry| {
        let span = line.station().and_then(|station| spans.get(station));
        line.signature.is_none() && span.is_some_and(|(first, last)| (*first..*last).contains(&line.number))
    };
    let unsigned: Vec<&ChainEntry> =
        book.lines.iter().filter(is_between).filter(|line| !is_simulated(book, line)).collect();
    let first = unsigned.first()?;
    Some(format!(
        "{} lines of the chain are not signed, and lines of the same station before and behind them are, the first is line {} ({}): the station had no key for a while, or the signatures were taken away; with --key each of them is a finding",
        unsigned.len(),
        first.number,
        first.run
    ))
}
