//! What the chain says of the runs that stand apart from all modules.

use std::collections::HashMap;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

use super::CHAIN;
use super::entry::ChainEntry;
use super::read::{DayChain, chain_of};
use crate::store::{StoreError, on, reader};

/// Bytes at the end of a chain that hold its last line: a name of a run has less than 300 bytes, and four digests 300 more.
const LAST_BYTES: i64 = 8192;

/// Number of the run that was closed last in the folder of a day, read from the end of its chain; `None` without a chain, and
/// if it cannot be read.
pub(crate) fn last_number(records: &Path, day: &str) -> Option<u64> {
    last_of(records, day, ChainEntry::is_close).ok().flatten().map(|line| line.number)
}

/// Number of the last line of a day, read from the end of its chain; `None` without a chain, and if it cannot be read.
pub(crate) fn last_line(records: &Path, day: &str) -> Option<u64> {
    last_entry(records, day).ok().flatten().map(|line| line.number)
}

/// The last line of a day, read from the end of its chain; `None` without one.
///
/// # Errors
/// The chain cannot be read.
pub(super) fn last_entry(records: &Path, day: &str) -> Result<Option<ChainEntry>, StoreError> {
    last_of(records, day, |_| true)
}

fn last_of(records: &Path, day: &str, is_wanted: fn(&ChainEntry) -> bool) -> Result<Option<ChainEntry>, StoreError> {
    let within = Path::new(day).join(CHAIN);
    let end = match end_of(records, &within) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        read => on(read, "read", &records.join(within))?,
    };
    let lines = String::from_utf8_lossy(&end);
    let whole = lines.split_inclusive('\n').filter_map(|line| line.strip_suffix('\n'));
    let at_end = whole.filter_map(ChainEntry::parse).filter(is_wanted).max_by_key(|line| line.number);
    if at_end.is_some() {
        return Ok(at_end);
    }
    // A power cut may have left anything at the end.
    let lines = chain_of(records, day)?.map(|chain| chain.lines).into_iter().flatten();
    Ok(lines.filter(is_wanted).max_by_key(|line| line.number))
}

fn end_of(records: &Path, chain: &Path) -> io::Result<Vec<u8>> {
    let mut file = gnc_files::below(records, chain)?;
    if file.metadata()?.len() > LAST_BYTES.unsigned_abs() {
        file.seek(SeekFrom::End(-LAST_BYTES))?;
    }
    let mut end = Vec::new();
    file.take(LAST_BYTES.unsigned_abs()).read_to_end(&mut end)?;
    Ok(end)
}

/// The closed runs of a day that stand apart, each with its number.
///
/// # Errors
/// The chain of the day cannot be read.
pub(crate) fn apart(records: &Path, day: &str) -> Result<HashMap<PathBuf, u64>, StoreError> {
    let closes = chain_of(records, day)?.map(DayChain::into_closes).into_iter().flatten();
    let runs = closes.map(|link| (records.join(link.run), link.number));
    Ok(runs.filter(|(run, _)| reader::is_unassigned(run)).collect())
}
