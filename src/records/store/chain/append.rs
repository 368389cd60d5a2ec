//! Appends runs to the chain, under the lock of the whole folder.
//!
//! The line closes a run: as soon as it is on disk the run is closed, and before that it is not. If the line cannot be
//! written, it is taken back, and the caller takes the seal of the run back. `COUNTER` follows the chain and decides nothing: if
//! it cannot be written, the run is closed all the same, `records verify` names the difference, and the next run or the next
//! start mends it. So no error can leave a run that one face calls closed and another one not.

use std::fs::{File, TryLockError};
use std::io::{self, Write as _};
use std::path::Path;
use std::time::Duration;

use gnc_files::{PART, Part};

use super::apart::last_entry;
use super::entry::{ChainEntry, Kind, Place, Scribe};
use super::read::{chain_of, counter, name_in};
use super::{CHAIN, COUNTER, NOTHING, begin, tail};
use crate::store::folder::sync_dir;
use crate::store::lock;
use crate::store::{DIGESTS, StoreError, digest, on, reader};

/// Number of newest days that are searched for the last line: a run that went on past midnight is closed in the day
/// before.
pub(super) const NEWEST_DAYS: usize = 3;

/// Appends a closed run to the chain, without a station and a key.
///
/// # Errors
/// As [`append_as`].
#[cfg(test)]
pub(crate) fn append(run: &Path) -> Result<(), StoreError> {
    let at = chrono::DateTime::UNIX_EPOCH.fixed_offset();
    append_as(run, &Scribe { station: "test", at, key: None, late: None })
}

/// Appends a closed run to the chain. Its `SHA256SUMS` must be on disk.
///
/// # Errors
/// [`StoreError`]: the disk failed, or another station does not release the lock.
pub(crate) fn append_as(run: &Path, by: &Scribe<'_>) -> Result<(), StoreError> {
    let (day, records) = above(run)?;
    let book = Book::open(records)?;
    let digest = digest::of_file(&run.join(DIGESTS))?;
    let name = name_in(records, run);
    let from = match chain_of(records, &name_in(records, day))? {
        // It was moved since it began.
        Some(chain) if reader::is_unassigned(run) => {
            let began = begin::of_first_line(records, run).ok();
            began.and_then(|began| begin::of(&chain, run, &name, &began).map(|line| line.run.clone()))
        }
        _ => None,
    };
    let from = from.as_deref().filter(|from| *from != name);
    book.write(day, |last| ChainEntry::new(last, Kind::Close, &digest, &name, from, by)).map(drop)
}

/// The folder of a run's day, and the records folder.
pub(super) fn above(run: &Path) -> Result<(&Path, &Path), StoreError> {
    let mut above = run.ancestors().skip(2);
    match (above.next(), above.next()) {
        (Some(day), Some(records)) => Ok((day, records)),
        _ => on(Err(io::ErrorKind::NotFound.into()), "find the records folder of", run),
    }
}

/// The chain of a records folder, held alone.
pub(super) struct Book<'a> {
    records: &'a Path,
    _lock: File,
}

impl<'a> Book<'a> {
    pub(super) fn open(records: &'a Path) -> Result<Self, StoreError> {
        Ok(Self { records, _lock: lock(records)? })
    }

    /// Writes the next line into the chain of a day. Behind an error the chain is as it was before, but for
    /// [`StoreError::MayStand`].
    pub(super) fn write(self, day: &Path, line: impl FnOnce(&Place) -> ChainEntry) -> Result<Place, StoreError> {
        tail::mend(self.records, &name_in(self.records, day))?;
        let before = last(self.records)?;
        let path = day.join(CHAIN);
        on(is_not_the_last(before.number), "write", &path)?;
        let line = line(&before);
        let mut file = on(gnc_files::append(&path), "write", &path)?;
        let whole = on(file.metadata(), "read", &path)?.len();
        let written = on(file.write_all(line.line().as_bytes()).and_then(|()| file.sync_all()), "write", &path);
        let written = written.and_then(|()| sync_dir(day)).and_then(|()| match count(self.records, &line.place()) {
            // Nothing has power yet: a run begins only where it can be counted.
            Err(error) if !line.is_close() => Err(error),
            // The line has closed the run. A counter that is behind is named by each check and mended by the next start.
            _ => Ok(()),
        });
        // The reported error is that of the line.
        written.map_err(|error| taken_back(error, &file.set_len(whole).and_then(|()| file.sync_all())))?;
        Ok(line.place())
    }
}

/// The error of a line that could not be written, and was taken back or not.
pub(super) fn taken_back(error: StoreError, taken: &io::Result<()>) -> StoreError {
    if taken.is_ok() { error } else { StoreError::MayStand(Box::new(error)) }
}

/// Numbers go on for ever, but not in a file that was changed.
fn is_not_the_last(number: u64) -> io::Result<()> {
    let why = "the chain or COUNTER says the highest number that there is, so it was changed";
    if number < u64::MAX { Ok(()) } else { Err(io::Error::new(io::ErrorKind::InvalidData, why)) }
}

/// Takes the lock of the whole folder: only one station at a time. It is released when the descriptor is closed, which cannot fail.
pub(super) fn lock(records: &Path) -> Result<File, StoreError> {
    lock_within(records, lock::LOCKED_FOR)
}

/// Takes the lock for readers: any number of them at a time, and no station writes meanwhile. Who holds it keeps stations from beginning
/// and closing runs, so it is for moments alone.
pub(super) fn lock_shared(records: &Path) -> Result<File, StoreError> {
    wait_for(records, lock::LOCKED_FOR, File::try_lock_shared)
}

pub(super) fn lock_within(records: &Path, wait: Duration) -> Result<File, StoreError> {
    wait_for(records, wait, File::try_lock)
}

fn wait_for(
    records: &Path,
    wait: Duration,
    try_lock: fn(&File) -> Result<(), TryLockError>,
) -> Result<File, StoreError> {
    let folder = on(File::open(records), "read", records)?;
    if on(lock::within(&folder, wait, try_lock), "lock", records)? {
        return Ok(folder);
    }
    lock::busy(format!("another program holds it for more than {} s", wait.as_secs()), records)
}

/// Tries whether a run could be closed here, and leaves everything as it was: whether the counter can be written, the newest
/// chain too, and no program holds the lock.
///
/// # Errors
/// [`StoreError`]: what a run would meet when it begins.
pub fn try_out(records: &Path) -> Result<(), StoreError> {
    let _lock = lock(records)?;
    last(records)?;
    let counter = records.join(COUNTER);
    if counter.is_dir() {
        return on(Err(io::ErrorKind::IsADirectory.into()), "write", &counter);
    }
    drop(on(Part::create(&counter), "write", &counter.with_extension(PART))?);
    for day in reader::day_names(records)?.iter().rev().take(1) {
        let chain = records.join(day).join(CHAIN);
        if chain.symlink_metadata().is_ok() {
            drop(on(gnc_files::append(&chain), "write", &chain)?);
        }
    }
    Ok(())
}

/// Writes number and link of the last run, in one step.
pub(super) fn count(records: &Path, place: &Place) -> Result<(), StoreError> {
    let path = records.join(COUNTER);
    let named = path.with_extension(PART);
    let mut part = on(Part::create(&path), "write", &named)?;
    on(writeln!(part, "{place}").and_then(|()| part.sync()), "write", &named)?;
    on(part.place(), "write", &path)?;
    // It counts from here on: if this were an error, the line would be taken back and the counter stand ahead of the chain for
    // ever. A power cut may bring the counter of before back, which is behind the chain, and the next start mends that.
    let _ = sync_dir(records);
    Ok(())
}

/// Number and link of the last line, from the ends of the newest chains. A line that is not counted yet counts, and the chain alone counts if the counter cannot be
/// read.
fn last(records: &Path) -> Result<Place, StoreError> {
    let counted = match counted(records)? {
        Counted::As(place) => place,
        Counted::Never | Counted::Unreadable => Place { number: 0, link: NOTHING.to_owned() },
    };
    let mut newest = None;
    for day in reader::day_names(records)?.iter().rev().take(NEWEST_DAYS) {
        newest = newest.into_iter().chain(last_entry(records, day)?).max_by_key(|line| line.number);
    }
    Ok(match newest {
        Some(link) if link.number > counted.number => link.place(),
        _ => counted,
    })
}

/// What `COUNTER` says.
pub(super) enum Counted {
    /// There is none.
    Never,
    /// Number and link.
    As(Place),
    /// It is empty, or holds something else.
    Unreadable,
}

/// Reads the counter as far as it can be read.
pub(super) fn counted(records: &Path) -> Result<Counted, StoreError> {
    Ok(match counter(records) {
        Ok(None) => Counted::Never,
        Ok(Some(place)) => Counted::As(place),
        Err(StoreError::File { source, .. }) if source.kind() == io::ErrorKind::InvalidData => Counted::Unreadable,
        Err(error) => return Err(error),
    })
}
