//! What the folder of a run holds when it is closed: files that the station writes for such a run, as it wrote them. The files of items
//! are made from the state of the run, and those of the plan are known by their digest, so what was exchanged meanwhile is made
//! anew. Whatever else lies in the folder is not covered, and each check names it as added.

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use gnc_executive::plan::MAX_PLAN_BYTES;
use gnc_executive::record::{ItemFile, RunRecord};
use gnc_executive::state::{Row, RunState};

use super::cut_off::{CUT_OFF, CutOffFile};
use super::digest::{self, FileDigests};
use super::{ITEM, JOURNAL, PLAN, RunFolder, StoreError, closing, item_folder, name, on, raw_file};

/// Most rounds within an attempt that a plan may ask for: each has a raw file.
const MAX_REPEATS: u32 = 1000;

/// Bytes of the number before the name of a plan's file, with the mark behind it.
const NUMBER_BYTES: usize = 3;

/// The files of a run's plan.
pub(super) enum PlanFiles {
    /// Their paths below the run's folder and what they hold, from the station that runs the plan.
    Written(Vec<(String, Vec<u8>)>),
    /// Those that were found below the folder of a run that another start left, and that have the digest of the journal.
    Found(Vec<PathBuf>),
}

impl PlanFiles {
    /// Number of files in which the folder of a run has the plan that its journal names. `None` if a name does not tell what it was:
    /// it was cut, or an earlier version named it, and the digest of the plan cannot be made again.
    pub(super) fn count_of(run: &Path, state: &RunState) -> Option<usize> {
        let all = digest::files_below(&run.join(PLAN)).unwrap_or_default();
        let mut names = all.iter().filter_map(|file| file.to_str()?.get(NUMBER_BYTES..));
        if names.any(|name| name::part_of(name).is_none()) {
            return None;
        }
        // A file that cannot be read is a finding of its own.
        match Self::found(run, state).ok()? {
            Self::Found(files) => Some(files.len()),
            Self::Written(_) => None,
        }
    }

    /// The files that were found for a run that another start left, in the order of their numbers. Without those that its journal
    /// names, none: a person had time to exchange them, and chose their names.
    ///
    /// # Errors
    /// A file could not be read just then. A run that is closed without its plan would be one that was changed for ever.
    pub(super) fn found(run: &Path, state: &RunState) -> Result<Self, StoreError> {
        let all = match digest::files_below(&run.join(PLAN)) {
            Err(StoreError::File { source, .. }) if is_of_a_person(&source) => Vec::new(),
            found => found?,
        };
        let mut files = Vec::new();
        while let Some(file) = numbered(&all, files.len() + 1) {
            let path = Path::new(PLAN).join(file);
            let text = match gnc_files::read_below(run, &path, MAX_PLAN_BYTES as u64) {
                Err(error) if is_of_a_person(&error) => break,
                read => on(read, "read", &run.join(&path))?,
            };
            files.push((path, name::part_of(&file[NUMBER_BYTES..]), text));
        }
        let is_plan = |count: &usize| {
            let named = files.iter().take(*count);
            let named = named.map(|(_, name, text)| (name.as_deref().unwrap_or_default(), text.as_slice()));
            state.header().is_some_and(|header| digest::of_plan(named) == header.plan.sha256)
        };
        let count = (1..=files.len()).rev().find(is_plan).unwrap_or(0);
        Ok(Self::Found(files.into_iter().take(count).map(|(path, ..)| path).collect()))
    }

    fn has(&self, file: &Path) -> bool {
        match self {
            Self::Written(files) => files.iter().any(|(name, _)| file == Path::new(name)),
            Self::Found(files) => files.iter().any(|own| own == file),
        }
    }
}

/// Whether a file is gone, or is none that a station writes: a later look finds the same.
fn is_of_a_person(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory)
        || gnc_files::is_refused(error).is_some()
}

/// The one file of a plan with this number.
fn numbered(all: &[PathBuf], number: usize) -> Option<&str> {
    let begin = format!("{number:02}-");
    let mut with = all.iter().filter_map(|file| file.to_str()).filter(|file| file.starts_with(&begin));
    with.next().filter(|file| !file.contains('/') && begin.len() == NUMBER_BYTES && with.next().is_none())
}

/// What a run is closed with.
pub(super) struct Contents<'a> {
    /// What its journal says.
    pub(super) state: &'a Mutex<RunState>,
    /// Its plan.
    pub(super) plan: &'a PlanFiles,
    /// The raw files that had no end.
    pub(super) cut_off: &'a [CutOffFile],
    /// Other files at the top of the folder that a start has made.
    pub(super) made: &'a [&'a str],
}

impl Contents<'_> {
    /// The record of the run, as far as its journal goes.
    pub(super) fn record(&self) -> Option<RunRecord> {
        RunRecord::from_state(&self.state())
    }

    fn state(&self) -> MutexGuard<'_, RunState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds the digests of all files that the run has before its record is made.
    pub(super) fn add_to(&self, sums: &mut FileDigests, folder: &RunFolder) -> Result<(), StoreError> {
        if let PlanFiles::Written(files) = &self.plan {
            for (name, text) in files {
                put_anew(folder, sums, name, text)?;
            }
        }
        let rows = self.state().rows().len();
        for position in 0..rows {
            // The state is held no longer than it takes to look at an item: others may want it.
            let Some((name, file)) = item_file(&self.state(), position) else { continue };
            let mut bytes = Vec::new();
            closing::pretty(&mut bytes, &file).map_err(serde_json::Error::io)?;
            put_anew(folder, sums, &name, &bytes)?;
        }
        // Raw samples are large: the state is not held while they are read.
        let raw = RawNames::of(&self.state());
        sums.add_those(folder.path(), |file| self.has(&raw, file))
    }

    fn has(&self, raw: &RawNames, file: &Path) -> bool {
        let is = |own: &str| file == Path::new(own);
        is(JOURNAL)
            || self.plan.has(file)
            || raw.have(file)
            || self.made.iter().any(|own| is(own))
            || !self.cut_off.is_empty() && is(CUT_OFF)
            || self.cut_off.iter().any(|cut_off| cut_off.torn().is_some_and(is))
    }
}

/// The file of an item that is over, and its name.
fn item_file(state: &RunState, position: usize) -> Option<(String, ItemFile)> {
    let row = state.rows().get(position).filter(|row| row.is_over())?;
    let file = ItemFile::from_state(state, position)?;
    Some((format!("{}/{ITEM}", item_folder(position, &row.planned.name)), file))
}

/// Writes a file if it is not there as it should be, and adds its digest.
fn put_anew(folder: &RunFolder, sums: &mut FileDigests, name: &str, bytes: &[u8]) -> Result<(), StoreError> {
    let digest = digest::of_bytes(bytes);
    if digest::of_file(&folder.path().join(name)).ok().as_ref() != Some(&digest) {
        folder.put(name, |out| out.write_all(bytes))?;
    }
    sums.insert(name, digest);
    Ok(())
}

/// The folders of the items that a journal names, each with the number of its attempts.
struct RawNames(HashMap<String, usize>);

impl RawNames {
    fn of(state: &RunState) -> Self {
        // A power cut may take the last lines of a journal and leave the file of the attempt that they began.
        let more = |row: &Row| usize::from(state.is_interrupted() && !row.is_over());
        let rows = state.rows().iter().enumerate();
        let named = rows.map(|(at, row)| (item_folder(at, &row.planned.name), row.attempts.len() + more(row)));
        Self(named.collect())
    }

    /// Whether a file has the name of raw samples of one of these attempts.
    fn have(&self, file: &Path) -> bool {
        let mut parts = file.iter().map(|part| part.to_str().unwrap_or_default());
        let (Some(folder), Some(name), None) = (parts.next(), parts.next(), parts.next()) else { return false };
        let Some(attempts) = self.0.get(folder) else { return false };
        let number = name.strip_prefix("attempt-").and_then(|rest| rest.strip_suffix(".mcap"));
        let number = number.map(|number| number.split_once('-').unwrap_or((number, "1")));
        let number = number.and_then(|(attempt, repeat)| Some((attempt.parse().ok()?, repeat.parse().ok()?)));
        number.is_some_and(|(attempt, repeat): (u32, u32)| {
            (1..=*attempts).contains(&(attempt as usize))
                && (1..=MAX_REPEATS).contains(&repeat)
                && raw_file(attempt, repeat) == name
        })
    }
}

#[cfg(test)]
mod tests;
