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
    /// Number of lines that are not as they were written, by their days.
    unreadable: HashMap<String, usize>,
    holes: Vec<Hole>,
    /// Numbers of the lines of beginnings, by their runs.
    begins: HashMap<String, u64>,
}

/// Two lines next to each other between whose numbers others are missing.
struct Hole {
    numbers: (u64, u64),
    /// Day and time of their runs.
    times: [(String, String); 2],
}

impl Hole {
    fn all(links: &[ChainEntry]) -> Vec<Self> {
        let mut links: Vec<&ChainEntry> = links.iter().collect();
        links.sort_by_key(|link| link.number);
        let pairs = links.windows(2).map(|pair| (pair[0], pair[1]));
        let apart = pairs.filter(|(before, after)| after.number > before.number.saturating_add(1));
        let owned = |link: &ChainEntry| {
            let (day, time) = day_and_time(&link.run);
            (day.to_owned(), time.to_owned())
        };
        apart
            .map(|(before, after)| Self {
                numbers: (before.number, after.number),
                times: [owned(before), owned(after)],
            })
            .collect()
    }

    /// Whether the line that closed a run may be missing here. It stands behind that of its beginning, so days that were
    /// moved away before the run began hold none. Of a run without a line of its beginning only the time tells.
    fn may_hold(&self, name: &str, began: Option<u64>) -> bool {
        if let Some(began) = began {
            return began < self.numbers.1;
        }
        let (day, time) = day_and_time(name);
        let at = (day.to_owned(), time.to_owned());
        self.times[0] <= at && at <= self.times[1]
    }
}

impl Before {
    /// # Errors
    /// [`StoreError`]: a chain or the counter cannot be read.
    pub(in crate::store) fn read(records: &Path) -> Result<Self, StoreError> {
        let mut unreadable = HashMap::new();
        let mut links = Vec::new();
        // Lines that an editor saved say nothing for sure but which numbers there are.
        let mut all = Vec::new();
        for chain in chains(records, usize::MAX)? {
            let count = chain.edited.len() + chain.broken;
            if let Some(day) = chain.path.parent().filter(|_| count > 0) {
                unreadable.insert(name_in(records, day), count);
            }
            all.extend(chain.lines.iter().cloned().chain(chain.edited));
            links.extend(chain.lines);
        }
        let holes = Hole::all(&all);
        let begins = all.into_iter().filter(|link| !link.is_close()).map(|link| (link.run, link.number)).collect();
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
            unreadable,
            holes,
            begins,
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

    /// Why a run without a closing line may have been closed: a line of its day was damaged, or lines are missing where its own would
    /// stand. The start writes nothing for such a run, since a backup of the chain may bring its line back.
    pub(in crate::store) fn unsure_of(&self, records: &Path, run: &Path) -> Option<String> {
        let name = name_in(records, run);
        let (day, _) = day_and_time(&name);
        if let Some(count) = self.unreadable.get(day) {
            return Some(match count {
                1 => format!(
                    "the chain of {day} holds 1 line that cannot be read: runs of this day without a line are left as they are; restore it from a backup, then start again"
                ),
                count => format!(
                    "the chain of {day} holds {count} lines that cannot be read: runs of this day without a line are left as they are; restore it from a backup, then start again"
                ),
            });
        }
        let began = self.begins.get(&name).copied();
        let hole = self.holes.iter().find(|hole| hole.may_hold(&name, began))?;
        let (before, after) = hole.numbers;
        Some(format!(
            "the chain lacks the lines between line {before} and line {after}: runs whose line may be missing there are left as they are; restore the chain from a backup, then start again"
        ))
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
