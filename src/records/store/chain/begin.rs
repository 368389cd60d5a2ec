//! The line of a run's beginning: a run that is taken away before its end leaves a hole.

use std::io::{self, BufRead as _, Read as _};
use std::path::Path;

use super::append::{Book, above};
use super::entry::{ChainEntry, Kind, Place, Scribe};
use super::links::OpenRun;
use super::read::{DayChain, chain_of, name_in};
use crate::store::begun::MAX_FIRST_EVENT_BYTES;
use crate::store::located::located;
use crate::store::{JOURNAL, StoreError, digest, on, reader};

/// Writes that a run begins. The first line of its journal must be on disk. A run that has such a line keeps it.
///
/// # Errors
/// [`StoreError`]: the disk failed, or another station does not release the lock.
pub(crate) fn begin(run: &Path, by: &Scribe<'_>) -> Result<Place, StoreError> {
    let (day, records) = above(run)?;
    let book = Book::open(records)?;
    let digest = of_first_line(records, run)?;
    let name = name_in(records, run);
    let chain = chain_of(records, &name_in(records, day))?;
    if let Some(line) = chain.as_ref().and_then(|chain| of(chain, run, &name, &digest)) {
        return Ok(line.place());
    }
    book.write(day, |last| ChainEntry::new(last, Kind::Begin, &digest, &name, None, by))
}

/// The line of a run's beginning among those of its day. The folder of a run that turned out to be of another module was moved,
/// so its journal tells which one it is.
pub(super) fn of<'a>(chain: &'a DayChain, run: &Path, name: &str, digest: &str) -> Option<&'a ChainEntry> {
    let begins = || chain.lines.iter().filter(|line| line.kind == Kind::Begin && line.digest == digest);
    let is_free = |line: &ChainEntry| !chain.closes().any(|close| close.began_as() == line.run);
    let moved = || begins().find(|line| reader::is_unassigned(run) && is_free(line));
    begins().find(|line| line.run == name).or_else(moved)
}

/// Number and link of the line of a run's beginning; `None` if it has none.
///
/// # Errors
/// The chain of its day cannot be read.
pub fn place_of(run: &Path) -> Result<Option<Place>, StoreError> {
    let run = &on(located(run), "find", run)?;
    let Ok((day, records)) = above(run) else { return Ok(None) };
    let Some(chain) = chain_of(records, &name_in(records, day))? else { return Ok(None) };
    let name = name_in(records, run);
    let began = chain.closes().find(|line| line.run == name).map_or(name.as_str(), ChainEntry::began_as);
    Ok(chain.lines.iter().find(|line| line.kind == Kind::Begin && line.run == began).map(ChainEntry::place))
}

/// Whether a run that began is among the runs of its day whose module was not the scanned one, where its station moves it.
pub(crate) fn was_moved(records: &Path, day: &str, open: &OpenRun) -> bool {
    let moved = reader::unassigned(records, day);
    moved.iter().any(|moved| of_first_line(records, moved).is_ok_and(|digest| digest == open.digest))
}

/// Whether a line of its day names a run, when it began or when it was closed.
///
/// # Errors
/// The chain of its day cannot be read.
pub(crate) fn is_named(run: &Path) -> Result<bool, StoreError> {
    let run = &on(located(run), "find", run)?;
    let Ok((day, records)) = above(run) else { return Ok(false) };
    let Some(chain) = chain_of(records, &name_in(records, day))? else { return Ok(false) };
    let name = name_in(records, run);
    Ok(chain.lines.iter().any(|line| line.run == name || line.began_as() == name))
}

/// Whether a line of its day closes a run.
///
/// # Errors
/// The chain of its day cannot be read.
pub(crate) fn is_closed(run: &Path) -> Result<bool, StoreError> {
    let run = &on(located(run), "find", run)?;
    let Ok((day, records)) = above(run) else { return Ok(false) };
    let Some(chain) = chain_of(records, &name_in(records, day))? else { return Ok(false) };
    let name = name_in(records, run);
    Ok(chain.closes().any(|line| line.run == name))
}

/// Digest of the first line of a run's journal, with its end.
///
/// # Errors
/// The journal cannot be read.
pub(crate) fn digest_of_first_line(run: &Path) -> Result<String, StoreError> {
    of_first_line(run, run)
}

/// Digest of the first line of a run's journal, with its end.
pub(super) fn of_first_line(records: &Path, run: &Path) -> Result<String, StoreError> {
    first_line(records, run).map(|line| digest::of_bytes(&line))
}

/// Whether the journal of a run ends with its first line: the run was cut off before it tested anything.
///
/// # Errors
/// The journal cannot be read.
pub(crate) fn has_one_event(run: &Path) -> Result<bool, StoreError> {
    let path = run.join(JOURNAL);
    let length = on(gnc_files::own(&path).and_then(|file| file.metadata()), "read", &path)?.len();
    Ok(length == first_line(run, run)?.len() as u64)
}

/// The first line of a run's journal, with its end.
pub(super) fn first_line(records: &Path, run: &Path) -> Result<Vec<u8>, StoreError> {
    let path = run.join(JOURNAL);
    let within = path.strip_prefix(records).unwrap_or(&path);
    let journal = on(gnc_files::below(records, within), "read", &path)?;
    let mut line = Vec::new();
    let mut journal = io::BufReader::new(journal.take(MAX_FIRST_EVENT_BYTES));
    on(journal.read_until(b'\n', &mut line), "read", &path)?;
    Ok(line)
}
