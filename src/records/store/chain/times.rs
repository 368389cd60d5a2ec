//! Looks whether the times of the lines fall along the chain.

use std::collections::HashMap;

use chrono::{DateTime, FixedOffset, TimeDelta};

use super::check::ChainBook;
use super::entry::ChainEntry;

/// What a time may fall behind that of an earlier line: runs that begin or end at once wait for one another, and the end of a run
/// is a while before the line that closes it, since the digests of its samples are made between.
const MAY_FALL: TimeDelta = TimeDelta::minutes(10);

/// The name of a run that was judged again. Its events have the times of the first run.
const JUDGED_AGAIN: &str = "-recomputed";

/// A clock that is set back is no change of the records, so these are notes.
pub(super) fn check(book: &ChainBook, notes: &mut Vec<String>) {
    // Each station has its own clock.
    let mut latest: HashMap<&str, (DateTime<FixedOffset>, &ChainEntry)> = HashMap::new();
    for line in book.lines.iter().filter(|line| !line.run.contains(JUDGED_AGAIN)) {
        let Some(stamp) = &line.stamp else { continue };
        let Ok(at) = DateTime::parse_from_rfc3339(&stamp.at) else { continue };
        // Each fall is told once, at its first line.
        if let Some((before, earlier)) = latest.insert(&stamp.station, (at, line))
            && at + MAY_FALL < before
        {
            notes.push(format!(
                "the clock was set back: line {} of the chain ({}) is of {}, and line {} before it of {}",
                line.number,
                line.run,
                at.format("%F %T"),
                earlier.number,
                before.format("%F %T")
            ));
        }
    }
}
