//! Mends what a sudden end or a disk error left of the chain, before a start writes into it. Only what such an end can leave is
//! mended: half a line, a counter that is behind the chain or in pieces. A counter that is ahead of the chain remembers runs that
//! are gone, and stays.

use std::fs;
use std::path::{Path, PathBuf};

use super::apart::last_line;
use super::append::{Counted, NEWEST_DAYS, count, counted, lock};
use super::entry::{ChainEntry, Place};
use super::read::chains;
use super::tail::{self, TORN, Tail, ends_in_a_line};
use super::{CHAIN, COUNTER};
use crate::store::folder::PART;
use crate::store::{StoreError, on, reader};

/// Mends the chain of a records folder under its lock, and returns a sentence about each thing.
///
/// # Errors
/// [`StoreError`]: the disk failed, or another station does not release the lock.
pub(in crate::store) fn mend(records: &Path) -> Result<Vec<String>, StoreError> {
    if look(records)?.is_empty() {
        return Ok(Vec::new());
    }
    let _lock = lock(records)?;
    // What another station left half done a moment ago may be whole now. A line that has its end again is counted.
    let mut said = Vec::new();
    for is_half_line in [true, false] {
        for fault in look(records)?.into_iter().filter(|fault| matches!(fault, Fault::HalfLine(_)) == is_half_line) {
            said.extend(fault.mend(records)?);
        }
    }
    Ok(said)
}

/// What is not as a station leaves it.
enum Fault {
    /// A chain ends with half a line.
    HalfLine(String),
    /// A counter that was not completely written.
    CounterPart(PathBuf),
    /// The counter is not what the chain says.
    Counter { was: Counted, last: Option<Place> },
    /// The counter remembers more runs than the chain has.
    Ahead { counted: u64, last: u64 },
}

fn look(records: &Path) -> Result<Vec<Fault>, StoreError> {
    let mut faults = Vec::new();
    for day in reader::day_names(records)? {
        let chain = records.join(&day).join(CHAIN);
        if on(ends_in_a_line(&chain), "read", &chain)? == Some(false) {
            faults.push(Fault::HalfLine(day));
        }
    }
    let part = records.join(format!("{COUNTER}.{PART}"));
    if part.symlink_metadata().is_ok() {
        faults.push(Fault::CounterPart(part));
    }
    let counted = counted(records)?;
    let newest_of = |days| -> Result<_, StoreError> {
        Ok(chains(records, days)?.into_iter().flat_map(|day| day.lines).max_by_key(|link| link.number))
    };
    let mut newest = newest_of(NEWEST_DAYS)?;
    let number = |newest: &Option<ChainEntry>| newest.as_ref().map_or(0, |link| link.number);
    // A clock that was set back leaves the last line in an older day, whatever the counter says: it follows the line.
    let days = reader::day_names(records)?;
    let ends = days.iter().filter_map(|day| last_line(records, day)).max().unwrap_or(0);
    if ends > number(&newest) || !matches!(&counted, Counted::As(counted) if counted.number <= number(&newest)) {
        newest = newest_of(usize::MAX)?;
    }
    let last = number(&newest);
    match (counted, newest) {
        (Counted::As(counted), _) if counted.number > last => {
            faults.push(Fault::Ahead { counted: counted.number, last });
        }
        (Counted::As(counted), Some(_)) if counted.number == last => {}
        (Counted::As(_) | Counted::Never, None) => {}
        (was, newest) => faults.push(Fault::Counter { was, last: newest.map(|line| line.place()) }),
    }
    Ok(faults)
}

impl Fault {
    fn mend(self, records: &Path) -> Result<Option<String>, StoreError> {
        Ok(Some(match self {
            Self::HalfLine(day) => match tail::mend(records, &day)? {
                Tail::Whole => return Ok(None),
                Tail::Completed => {
                    format!(
                        "the last line of the chain of {day} lacked its end, and fits all others; it has its end again"
                    )
                }
                Tail::Kept => format!(
                    "the chain of {day} ended with half a line, as a sudden end leaves it; it is moved to {TORN} beside it"
                ),
                Tail::Removed => {
                    format!("the chain of {day} ended with half a line, as a sudden end leaves it; it is removed")
                }
            },
            Self::CounterPart(part) => {
                let is_folder = part.symlink_metadata().is_ok_and(|meta| meta.is_dir());
                let removed = if is_folder { fs::remove_dir(&part) } else { fs::remove_file(&part) };
                on(removed, "remove", &part)?;
                // What every write of the counter makes and takes away is not worth a word.
                return Ok(is_folder.then(|| format!("an empty folder {COUNTER}.{PART} was in the way; it is removed")));
            }
            Self::Counter { last: None, .. } => {
                let path = records.join(COUNTER);
                on(fs::remove_file(&path), "remove", &path)?;
                format!("{COUNTER} held no number and link, and there is no chain; it is removed")
            }
            Self::Counter { was, last: Some(last) } => {
                count(records, &last)?;
                let number = last.number;
                match was {
                    Counted::As(was) => format!(
                        "{COUNTER} stood at line {} and the chain ends at line {number}, as a sudden end leaves it; it is mended",
                        was.number
                    ),
                    Counted::Never => {
                        format!("{COUNTER} was missing; it is made again from the chain, which ends at line {number}")
                    }
                    Counted::Unreadable => format!(
                        "{COUNTER} held no number and link; it is made again from the chain, which ends at line {number}"
                    ),
                }
            }
            Self::Ahead { counted, last } => format!(
                "{COUNTER} stands at line {counted}, but the chain ends at line {last}: the newest lines are missing; `gnc-station records verify` tells more"
            ),
        }))
    }
}

#[cfg(test)]
mod tests;
