//! Mends what a sudden end or a disk error left of the chain, before a start writes into it. Only what such an end can leave is
//! mended: half a line, a counter that is behind the chain or in pieces. A counter that is ahead of the chain remembers runs that
//! are gone, and stays.

use std::fs;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

use super::append::{Counted, NEWEST_DAYS, count, counted, lock, whole_lines};
use super::entry::{ChainEntry, Place};
use super::read::chains;
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
    // What another station left half done a moment ago may be whole now.
    look(records)?.into_iter().filter_map(|fault| fault.mend(records).transpose()).collect()
}

/// What is not as a station leaves it.
enum Fault {
    /// A chain ends with half a line.
    HalfLine { chain: PathBuf, day: String },
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
            faults.push(Fault::HalfLine { chain, day });
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
    // A clock that was set back leaves the last line in an older day.
    if !matches!(&counted, Counted::As(counted) if counted.number <= number(&newest)) {
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

/// Whether a chain ends with a whole line; `None` if there is none, or an empty one.
fn ends_in_a_line(chain: &Path) -> io::Result<Option<bool>> {
    let mut file = match gnc_files::own(chain) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        opened => opened?,
    };
    if file.metadata()?.len() == 0 {
        return Ok(None);
    }
    let mut last = [0];
    file.seek(SeekFrom::End(-1))?;
    file.read_exact(&mut last)?;
    Ok(Some(last == *b"\n"))
}

impl Fault {
    fn mend(self, records: &Path) -> Result<Option<String>, StoreError> {
        Ok(Some(match self {
            Self::HalfLine { chain, day } => {
                let mut file = on(gnc_files::append(&chain), "write", &chain)?;
                let whole = on(whole_lines(&mut file), "read", &chain)?;
                on(file.set_len(whole).and_then(|()| file.sync_all()), "write", &chain)?;
                format!("the chain of {day} ended with half a line, as a sudden end leaves it; it is removed")
            }
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
