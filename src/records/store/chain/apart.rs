//! What the chain says of the runs that stand apart from all modules.

use std::collections::HashMap;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

use super::CHAIN;
use super::entry::ChainEntry;
use super::read::{DayChain, chain_of};
use crate::store::{StoreError, reader};

/// Bytes at the end of a chain that hold its last line: a name of a run has less than 300 bytes, and four digests 300 more.
const LAST_BYTES: i64 = 8192;

/// Number of the run that was closed last in the folder of a day, read from the end of its chain; `None` without a chain, and
/// if it cannot be read.
pub(crate) fn last_number(records: &Path, day: &str) -> Option<u64> {
    last_where(records, day, ChainEntry::is_close)
}

/// Number of the last line in the folder of a day, as [`last_number`].
pub(super) fn last_of_lines(records: &Path, day: &str) -> Option<u64> {
    last_where(records, day, |_| true)
}

fn last_where(records: &Path, day: &str, is_meant: impl Fn(&ChainEntry) -> bool) -> Option<u64> {
    let end = end_of(records, &Path::new(day).join(CHAIN)).ok()?;
    let lines = String::from_utf8_lossy(&end);
    let whole = lines.split_inclusive('\n').filter_map(|line| line.strip_suffix('\n'));
    let at_end = whole.filter_map(ChainEntry::parse).filter(&is_meant).map(|link| link.number).max();
    // A power cut may have left anything at the end.
    at_end.or_else(|| chain_of(records, day).ok()??.lines.into_iter().filter(is_meant).map(|link| link.number).max())
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
