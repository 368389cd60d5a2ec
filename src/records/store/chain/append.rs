//! Appends runs to the chain, under the lock of the whole folder.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::Path;
use std::time::{Duration, Instant};

use nix::errno::Errno;
use nix::fcntl::{Flock, FlockArg};

use super::entry::{ChainEntry, Kind, Place, Scribe};
use super::read::{chain_of, chains, counter, name_in};
use super::{CHAIN, COUNTER, NOTHING, begin};
use crate::store::folder::sync_dir;
use crate::store::{DIGESTS, StoreError, digest, on, reader};

/// Longest wait for another station that closes a run: that station writes two short files and waits for the disk.
const LOCKED_FOR: Duration = Duration::from_secs(10);

/// Number of newest days that are searched for the last line: a run that went on past midnight is closed in the day
/// before.
const NEWEST_DAYS: usize = 3;

/// Time between two looks at the lock.
const LOOK_EVERY: Duration = Duration::from_millis(5);

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
    _lock: Flock<File>,
}

impl<'a> Book<'a> {
    pub(super) fn open(records: &'a Path) -> Result<Self, StoreError> {
        Ok(Self { records, _lock: lock(records)? })
    }

    /// Writes the next line into the chain of a day.
    pub(super) fn write(self, day: &Path, line: impl FnOnce(&Place) -> ChainEntry) -> Result<Place, StoreError> {
        let line = line(&last(self.records)?);
        let path = day.join(CHAIN);
        let mut file = on(OpenOptions::new().create(true).append(true).open(&path), "write", &path)?;
        let whole = on(whole_lines(&path), "read", &path)?;
        on(file.set_len(whole), "write", &path)?;
        let written = file.write_all(line.line().as_bytes()).and_then(|()| file.sync_all());
        if written.is_err() {
            // Ignore the error: half a line is taken away before the next one.
            let _ = file.set_len(whole);
        }
        on(written, "write", &path)?;
        sync_dir(day)?;
        count(self.records, line.number, &line.link)?;
        Ok(line.place())
    }
}

/// Bytes of a chain up to the end of its last whole line. A power cut or a full disk may leave half a line, which would
/// swallow the next one.
fn whole_lines(path: &Path) -> io::Result<u64> {
    let text = fs::read(path)?;
    Ok(text.iter().rposition(|byte| *byte == b'\n').map_or(0, |last| last as u64 + 1))
}

/// Takes the lock of the whole folder: only one station at a time.
#[expect(clippy::disallowed_methods, reason = "flock has no wait with a deadline; this thread writes records alone")]
fn lock(records: &Path) -> Result<Flock<File>, StoreError> {
    let began = Instant::now();
    let mut folder = on(File::open(records), "read", records)?;
    loop {
        match Flock::lock(folder, FlockArg::LockExclusiveNonblock) {
            Ok(lock) => return Ok(lock),
            Err((back, Errno::EAGAIN)) if began.elapsed() < LOCKED_FOR => folder = back,
            Err((_, error)) => return on(Err(error.into()), "lock", records),
        }
        std::thread::sleep(LOOK_EVERY);
    }
}

fn count(records: &Path, number: u64, link: &str) -> Result<(), StoreError> {
    let (path, part) = (records.join(COUNTER), records.join(format!("{COUNTER}.part")));
    let mut file = on(File::create(&part), "write", &part)?;
    on(writeln!(file, "{number} {link}").and_then(|()| file.sync_all()), "write", &part)?;
    on(fs::rename(&part, &path), "write", &path)?;
    sync_dir(records)
}

/// Number and link of the last line. If the power failed between a line and the counter, the line counts.
fn last(records: &Path) -> Result<Place, StoreError> {
    let counted = counter(records)?.unwrap_or_else(|| Place { number: 0, link: NOTHING.to_owned() });
    let newest = chains(records, NEWEST_DAYS)?.into_iter().flat_map(|day| day.lines).max_by_key(|link| link.number);
    Ok(match newest {
        Some(link) if link.number > counted.number => link.place(),
        _ => counted,
    })
}
