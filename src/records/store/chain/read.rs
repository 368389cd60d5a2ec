//! Reads the chains of the days and the counter.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::entry::ChainEntry;
use super::{CHAIN, COUNTER};
use crate::store::{StoreError, on, reader};

pub(super) fn counter(records: &Path) -> Result<Option<(u64, String)>, StoreError> {
    let path = records.join(COUNTER);
    let text = match fs::read_to_string(&path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        read => on(read, "read", &path)?,
    };
    let read = text.trim_end().split_once(' ').and_then(|(number, link)| Some((number.parse().ok()?, link.to_owned())));
    match read {
        Some(counted) => Ok(Some(counted)),
        None => on(Err(io::Error::new(io::ErrorKind::InvalidData, "it holds no number and link")), "read", &path),
    }
}

/// The chain of a day.
pub(super) struct DayChain {
    pub(super) path: PathBuf,
    pub(super) links: Vec<ChainEntry>,
    /// Number of broken lines; the last one may be half a line after a power cut.
    pub(super) broken: usize,
}

/// The chains of so many days, newest day first.
pub(super) fn chains(records: &Path, days: usize) -> Result<Vec<DayChain>, StoreError> {
    let mut chains = Vec::new();
    for (day, _) in reader::days(records)?.into_iter().rev().take(days) {
        chains.extend(chain_of(records, &day)?);
    }
    Ok(chains)
}

/// The chain of a day, if it has one.
pub(super) fn chain_of(records: &Path, day: &str) -> Result<Option<DayChain>, StoreError> {
    let path = records.join(day).join(CHAIN);
    // After a power cut anything may stand behind the last whole line.
    let text = match fs::read(&path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        read => String::from_utf8_lossy(&on(read, "read", &path)?).into_owned(),
    };
    // Half a line may look like a whole one with a shorter name, so a line counts with its end only.
    let lines = || text.split_inclusive('\n');
    let whole = lines().filter_map(|line| line.strip_suffix('\n'));
    let links: Vec<ChainEntry> = whole.filter_map(ChainEntry::parse).collect();
    let broken = lines().count() - links.len();
    Ok(Some(DayChain { path, links, broken }))
}

/// `DATE/SERIAL/TIME-PLAN` of a run.
pub(super) fn name_in(records: &Path, run: &Path) -> String {
    run.strip_prefix(records).unwrap_or(run).to_string_lossy().into_owned()
}
