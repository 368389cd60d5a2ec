//! The chain as far as it tells which runs it lacks, and whether a run may be closed late.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use super::beginning::Beginnings;
use super::entry::ChainEntry;
use super::read::{DayChain, chain_of, chains, counter, name_in};
use crate::store::StoreError;

/// The closed runs among `runs` that are missing in the chains of their days.
///
/// # Errors
/// [`StoreError`]: a chain cannot be read.
pub(in crate::store) fn unknown(records: &Path, runs: Vec<PathBuf>) -> Result<Vec<PathBuf>, StoreError> {
    let mut days: HashMap<String, HashSet<String>> = HashMap::new();
    let mut missing = Vec::new();
    for run in runs {
        let name = name_in(records, &run);
        let day = name.split('/').next().unwrap_or_default();
        if !days.contains_key(day) {
            let closes = chain_of(records, day)?.map(DayChain::into_closes).into_iter().flatten();
            days.insert(day.to_owned(), closes.map(|line| line.run).collect());
        }
        if !days.get(day).is_some_and(|known| known.contains(&name)) {
            missing.push(run);
        }
    }
    Ok(missing)
}

/// The chain, as far as it tells whether a run may be closed late.
pub(in crate::store) struct Before {
    known: HashSet<String>,
    /// Day and time of the first line; `None` if there is no line.
    first: Option<(String, String)>,
    /// Whether the last line is at least the one that the counter remembers. If it is not, lines were lost, and each of
    /// them may be that of a run which looks as if it had none.
    is_whole: bool,
    /// Whether nothing was ever counted in this folder.
    is_new: bool,
    beginnings: Beginnings,
}

impl Before {
    /// # Errors
    /// [`StoreError`]: a chain or the counter cannot be read.
    pub(in crate::store) fn read(records: &Path) -> Result<Self, StoreError> {
        let links: Vec<ChainEntry> = chains(records, usize::MAX)?.into_iter().flat_map(|day| day.lines).collect();
        let counted = counter(records)?;
        let last = links.iter().map(|link| link.number).max().unwrap_or(0);
        let first = links.iter().min_by_key(|link| link.number).map(|link| day_and_time(&link.run));
        let first = first.map(|(day, time)| (day.to_owned(), time.to_owned()));
        let is_whole = counted.as_ref().is_none_or(|counted| last >= counted.number);
        let is_new = counted.is_none() && links.is_empty();
        let beginnings = Beginnings::among(&links);
        Ok(Self {
            known: links.into_iter().filter(ChainEntry::is_close).map(|link| link.run).collect(),
            first,
            is_whole,
            is_new,
            beginnings,
        })
    }

    /// The lines of all beginnings.
    pub(in crate::store) fn beginnings(&self) -> &Beginnings {
        &self.beginnings
    }

    /// Whether nothing was ever counted in this folder: the run that ended is its first one, or the whole chain was lost.
    pub(in crate::store) fn is_new(&self) -> bool {
        self.is_new
    }

    /// Whether a run that ended may have missed its line by a sudden end of its station. A run from before the first line
    /// may have lost its line with others, or is from before there was a chain.
    pub(in crate::store) fn may_lack(&self, records: &Path, run: &Path) -> bool {
        let name = name_in(records, run);
        let is_later =
            self.first.as_ref().is_none_or(|(day, time)| day_and_time(&name) >= (day.as_str(), time.as_str()));
        self.is_whole && is_later && !self.known.contains(&name)
    }
}

/// Day and time of a run by its name.
pub(super) fn day_and_time(run: &str) -> (&str, &str) {
    let folder = run.rsplit('/').next().unwrap_or_default();
    (run.split('/').next().unwrap_or_default(), folder.split('-').next().unwrap_or_default())
}
