//! Reads the chains of the days and the counter.

use std::io;
use std::path::{Path, PathBuf};

use super::entry::{ChainEntry, Place};
use super::{CHAIN, COUNTER};
use crate::store::{StoreError, on, reader};

/// Longest chain of a day that is read: a hundred thousand lines of a kilobyte.
pub(super) const MAX_CHAIN_BYTES: u64 = 100 << 20;
/// Longest counter that is read: a number and a link, and whatever a person who copies it leaves behind them.
pub(super) const MAX_COUNTER_BYTES: u64 = 4096;

/// Number and link of the last line, as the counter has them; `None` without a counter.
pub(super) fn counter(records: &Path) -> Result<Option<Place>, StoreError> {
    let path = records.join(COUNTER);
    let bytes = match gnc_files::read_below(records, Path::new(COUNTER), MAX_COUNTER_BYTES) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        read => on(read, "read", &path)?,
    };
    match std::str::from_utf8(&bytes).ok().and_then(Place::parse) {
        Some(counted) => Ok(Some(counted)),
        None => on(Err(io::Error::new(io::ErrorKind::InvalidData, "it holds no number and link")), "read", &path),
    }
}

/// The chain of a day.
pub(super) struct DayChain {
    pub(super) path: PathBuf,
    /// All of its lines, in the order of the file.
    pub(super) lines: Vec<ChainEntry>,
    /// Lines that are as they were written but for their ends, or what stands before the first one: an editor saved the file.
    pub(super) edited: Vec<ChainEntry>,
    /// Number of other broken lines, without half a line at the end.
    pub(super) broken: usize,
    /// Whether half a line stands at the end, as after a power cut.
    pub(super) is_torn: bool,
}

impl DayChain {
    /// The lines of closed runs.
    pub(super) fn closes(&self) -> impl Iterator<Item = &ChainEntry> {
        self.lines.iter().filter(|line| line.is_close())
    }

    /// The lines of closed runs, taken over.
    pub(super) fn into_closes(self) -> impl Iterator<Item = ChainEntry> {
        self.lines.into_iter().filter(ChainEntry::is_close)
    }
}

/// The chains of so many days, newest day first.
pub(super) fn chains(records: &Path, days: usize) -> Result<Vec<DayChain>, StoreError> {
    let mut chains = Vec::new();
    for day in reader::day_names(records)?.into_iter().rev().take(days) {
        chains.extend(chain_of(records, &day)?);
    }
    Ok(chains)
}

/// The chain of a day, if it has one.
pub(super) fn chain_of(records: &Path, day: &str) -> Result<Option<DayChain>, StoreError> {
    chain_up_to(records, day, MAX_CHAIN_BYTES)
}

/// The chain of a day as it was when it had so many bytes.
pub(super) fn chain_up_to(records: &Path, day: &str, length: u64) -> Result<Option<DayChain>, StoreError> {
    let path = records.join(day).join(CHAIN);
    let within = Path::new(day).join(CHAIN);
    let mut bytes = match gnc_files::read_below(records, &within, MAX_CHAIN_BYTES) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        read => on(read, "read", &path)?,
    };
    bytes.truncate(usize::try_from(length).unwrap_or(usize::MAX));
    // Half a line may look like a whole one with a shorter name, so a line counts with its end only. After a power cut
    // anything may stand behind the last whole line.
    let lines = || bytes.split_inclusive(|byte| *byte == b'\n');
    let whole = lines().filter_map(|line| line.strip_suffix(b"\n"));
    let (mut as_written, mut edited, mut broken) = (Vec::new(), Vec::new(), 0);
    for line in whole {
        match (parse(line), parse(without_marks(line))) {
            (Some(line), _) => as_written.push(line),
            (None, Some(line)) => edited.push(line),
            (None, None) => broken += 1,
        }
    }
    let is_torn = bytes.last().is_some_and(|last| *last != b'\n');
    Ok(Some(DayChain { path, lines: as_written, edited, broken, is_torn }))
}

fn parse(line: &[u8]) -> Option<ChainEntry> {
    std::str::from_utf8(line).ok().and_then(ChainEntry::parse)
}

/// A line without what an editor of Windows writes: a carriage return at its end, and the mark of the encoding at the beginning of the file.
fn without_marks(line: &[u8]) -> &[u8] {
    let line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line);
    line.strip_suffix(b"\r").unwrap_or(line)
}

/// `DATE/SERIAL/TIME-PLAN` of a run.
pub(crate) fn name_in(records: &Path, run: &Path) -> String {
    run.strip_prefix(records).unwrap_or(run).to_string_lossy().into_owned()
}
