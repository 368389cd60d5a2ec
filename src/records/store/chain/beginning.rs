//! What the chain says of the beginning of a run that has no end: whether a later start may go on with it.
//!
//! A station writes the line of a beginning before anything is powered. So a run with tests and without such a line was put
//! there, and a start that wrote the line itself would make it a run of the station.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use super::begin::of_first_line;
use super::entry::{ChainEntry, Kind};
use super::read::{chains, name_in};
use crate::store::{StationKey, StoreError, reader};

/// What the chain says of the beginning of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Beginning {
    /// No run of this chain has such a line: an earlier version wrote it.
    NeverWritten,
    /// Other runs have such a line, and this one has none that its journal fits.
    Missing,
    /// It has its line.
    Written(Box<Begun>),
}

/// The line of a run's beginning.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Begun {
    line: ChainEntry,
    /// Whether its station signed an earlier line.
    is_behind_signed: bool,
}

/// Whose key signed a beginning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SignedBy {
    /// The key in question; or no key signed the line, as it was when the run began.
    This,
    /// Another one, or one where there is no key now.
    Other,
    /// None, and earlier lines of its station are signed.
    None,
}

impl Begun {
    pub(crate) fn is_signed(&self) -> bool {
        self.line.signature.is_some()
    }

    pub(crate) fn signed_by(&self, key: Option<&StationKey>) -> SignedBy {
        let keys: Vec<_> = key.map(StationKey::public).into_iter().collect();
        match self.line.is_signed_by(&keys) {
            Some(true) => SignedBy::This,
            Some(false) => SignedBy::Other,
            None if key.is_some() && self.is_behind_signed => SignedBy::None,
            None => SignedBy::This,
        }
    }
}

/// The lines of all beginnings.
#[derive(Debug, Default)]
pub(crate) struct Beginnings {
    begins: HashMap<String, Vec<ChainEntry>>,
    /// The names under which closed runs began.
    closed: HashSet<String>,
    /// Number of the first line with a signature of each station. Others beside it may have had a key before it.
    signed_since: HashMap<String, u64>,
    /// Number of the first one of all.
    first_signed: Option<u64>,
}

impl Beginnings {
    /// # Errors
    /// [`StoreError`]: a chain cannot be read.
    pub(crate) fn read(records: &Path) -> Result<Self, StoreError> {
        let lines: Vec<ChainEntry> = chains(records, usize::MAX)?.into_iter().flat_map(|day| day.lines).collect();
        Ok(Self::among(&lines))
    }

    pub(super) fn among(lines: &[ChainEntry]) -> Self {
        let mut all = Self::default();
        for line in lines {
            match line.kind {
                Kind::Begin => all.begins.entry(line.run.clone()).or_default().push(line.clone()),
                Kind::Close => drop(all.closed.insert(line.began_as().to_owned())),
            }
        }
        for line in lines.iter().filter(|line| line.signature.is_some()) {
            all.first_signed = Some(all.first_signed.map_or(line.number, |first| first.min(line.number)));
            let Some(station) = line.station() else { continue };
            let since = all.signed_since.entry(station.to_owned()).or_insert(line.number);
            *since = (*since).min(line.number);
        }
        all
    }

    /// Whether any line of the chain is signed.
    pub(crate) fn are_signed(&self) -> bool {
        self.first_signed.is_some()
    }

    /// What they say of a run, by its name and the first line of its journal.
    ///
    /// # Errors
    /// The journal cannot be read.
    pub(crate) fn of(&self, records: &Path, run: &Path) -> Result<Beginning, StoreError> {
        if self.begins.is_empty() {
            return Ok(Beginning::NeverWritten);
        }
        let digest = of_first_line(records, run)?;
        let name = name_in(records, run);
        let day = name.split('/').next().unwrap_or_default();
        let is_its_own = |line: &&ChainEntry| line.digest == digest && line.is_true();
        let own = self.begins.get(&name).into_iter().flatten().find(is_its_own);
        // Its module was not the one that was scanned, so it was moved since.
        let moved = || {
            let free = self.begins.iter().filter(|(began, _)| !self.closed.contains(*began));
            let of_day = free.flat_map(|(_, lines)| lines).filter(|line| line.day() == day);
            of_day.filter(|_| reader::is_unassigned(run)).find(is_its_own)
        };
        let Some(line) = own.or_else(moved) else { return Ok(Beginning::Missing) };
        let since = line.station().map_or(self.first_signed, |station| self.signed_since.get(station).copied());
        let is_behind_signed = since.is_some_and(|since| since < line.number);
        Ok(Beginning::Written(Box::new(Begun { line: line.clone(), is_behind_signed })))
    }
}
