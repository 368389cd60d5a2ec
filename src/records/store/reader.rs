//! Reads records back. The journal is the truth; what was made from it is compared with it.

use std::fs;
use std::path::{Path, PathBuf};

use gnc_executive::event::Event;
use gnc_executive::journal;
use gnc_executive::plan::MAX_PLAN_FILES;
use gnc_executive::record::RunRecord;
use gnc_executive::state::RunState;

use super::digest::Sums;
use super::folder::folder_name;
use super::{DIGESTS, JOURNAL, PLAN, PublicKey, RECORD, SIGNATURE, StoreError, digest, on};

/// Longest journal that is read: a thousand hours of a babbling bench; a longer file is no journal of ours.
const MAX_JOURNAL_BYTES: u64 = 1 << 30;

/// A run found in the records folder.
#[derive(Debug)]
pub struct FoundRun {
    /// Its folder.
    pub path: PathBuf,
    /// What it holds, or why that cannot be read.
    pub run: Result<RunRecord, String>,
    /// Whether its folder was closed with its digests; a run without them is no evidence, whatever it says.
    pub sealed: bool,
}

/// All runs below a records folder, oldest first.
///
/// # Errors
/// The folder itself cannot be read.
pub fn list(records: &Path) -> Result<Vec<FoundRun>, StoreError> {
    let mut runs = Vec::new();
    for day in folders(records)?.into_iter().filter(|day| is_day(day)) {
        // A folder that cannot be read is no reason to hide the others.
        for serial in folders(&day).unwrap_or_default() {
            runs.extend(folders(&serial).unwrap_or_default().into_iter().map(found));
        }
    }
    runs.sort_by(|a, b| {
        let started = |found: &FoundRun| found.run.as_ref().ok().map(|run| run.started);
        started(a).cmp(&started(b)).then_with(|| a.path.cmp(&b.path))
    });
    Ok(runs)
}

/// The days that have records, oldest first, each with its number of serial numbers.
///
/// # Errors
/// The folder itself cannot be read.
pub fn days(records: &Path) -> Result<Vec<(String, usize)>, StoreError> {
    let days = folders(records)?.into_iter().filter(|day| is_day(day));
    Ok(days.map(|day| (name_of(&day), folders(&day).unwrap_or_default().len())).collect())
}

/// At most `limit` runs of a day, and whether there are more.
///
/// # Errors
/// The day's folder cannot be read.
pub fn of_day(records: &Path, day: &str, limit: usize) -> Result<(Vec<FoundRun>, bool), StoreError> {
    let serials = folders(&records.join(day))?;
    let mut paths: Vec<PathBuf> = serials.iter().flat_map(|serial| folders(serial).unwrap_or_default()).collect();
    let cut = paths.len() > limit;
    // Names of runs begin with their time of day.
    paths.sort_by(|a, b| b.file_name().cmp(&a.file_name()));
    paths.truncate(limit);
    Ok((paths.into_iter().map(found).collect(), cut))
}

/// The runs of one module on a day; none where nothing can be read.
#[must_use]
pub fn of_module(records: &Path, day: &str, serial_number: &str) -> Vec<FoundRun> {
    let folder = records.join(day).join(folder_name(serial_number));
    let runs = folders(&folder).unwrap_or_default().into_iter().map(found);
    runs.filter(|found| found.run.as_ref().is_ok_and(|run| run.serial_number == serial_number)).collect()
}

/// Folders of the newest runs, newest first.
pub fn newest(records: &Path, limit: usize) -> impl Iterator<Item = PathBuf> {
    let days = folders(records).unwrap_or_default().into_iter().filter(|day| is_day(day)).rev();
    let of_day = |day: PathBuf| {
        let serials = folders(&day).unwrap_or_default();
        let mut runs: Vec<PathBuf> = serials.iter().flat_map(|serial| folders(serial).unwrap_or_default()).collect();
        runs.sort_by(|a, b| b.file_name().cmp(&a.file_name()));
        runs
    };
    days.flat_map(of_day).take(limit)
}

fn found(path: PathBuf) -> FoundRun {
    FoundRun { run: read(&path), sealed: is_sealed(&path), path }
}

/// Whether a folder holds a run, be it only a part of one: a run whose journal was taken away is to be found out.
#[must_use]
pub fn is_run(folder: &Path) -> bool {
    [JOURNAL, RECORD, DIGESTS].iter().any(|file| folder.join(file).exists())
}

/// Whether a run's folder was closed with its digests.
#[must_use]
pub fn is_sealed(folder: &Path) -> bool {
    folder.join(DIGESTS).is_file()
}

fn name_of(folder: &Path) -> String {
    folder.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Whether a folder is named by a date; a disk of its own has others too.
fn is_day(folder: &Path) -> bool {
    chrono::NaiveDate::parse_from_str(&name_of(folder), "%Y-%m-%d").is_ok()
}

/// Reads a run from its journal.
///
/// # Errors
/// A sentence for people.
pub fn read(folder: &Path) -> Result<RunRecord, String> {
    let state = fold(folder)?;
    RunRecord::from_state(&state)
        .ok_or_else(|| "the journal holds no whole event: the run was cut off at its start".into())
}

/// Folds a run's journal.
///
/// # Errors
/// A sentence for people.
pub fn fold(folder: &Path) -> Result<RunState, String> {
    let bytes = journal_of(folder)?;
    journal::fold(&bytes).map(|journal| journal.state).map_err(|error| format!("the journal is damaged: {error}"))
}

/// The events of a run whose journal [`fold`] found good, in their order.
///
/// # Errors
/// A sentence for people.
pub fn events(folder: &Path) -> Result<Vec<Event>, String> {
    let bytes = journal_of(folder)?;
    // Of an interrupted run the last line may be cut off; the fold found all others good.
    Ok(bytes.split_inclusive(|byte| *byte == b'\n').map_while(|line| serde_json::from_slice(line).ok()).collect())
}

/// The files of a run's plan, each with its name and content, in the order in which the plan included them.
///
/// # Errors
/// A sentence for people.
pub fn plan(folder: &Path) -> Result<Vec<(String, Vec<u8>)>, String> {
    let in_words = |error: std::io::Error| format!("{PLAN}/: {error}");
    let mut files = Vec::new();
    for entry in fs::read_dir(folder.join(PLAN)).map_err(in_words)?.take(MAX_PLAN_FILES + 1) {
        files.push(entry.map_err(in_words)?.path());
    }
    // Their names begin with a number of two digits and a mark.
    files.sort();
    if files.is_empty() {
        return Err(format!("{PLAN}/ is empty"));
    }
    let named = |path: &PathBuf| name_of(path).get(3..).unwrap_or_default().to_owned();
    files.iter().map(|path| Ok((named(path), fs::read(path).map_err(in_words)?))).collect()
}

/// A paper as it was filed.
///
/// # Errors
/// What the system says.
pub fn paper(folder: &Path, name: &str) -> std::io::Result<Vec<u8>> {
    fs::read(folder.join(name))
}

fn journal_of(folder: &Path) -> Result<Vec<u8>, String> {
    let path = folder.join(JOURNAL);
    let in_words = |error: std::io::Error| format!("cannot read {}: {error}", path.display());
    if fs::metadata(&path).map_err(in_words)?.len() > MAX_JOURNAL_BYTES {
        return Err(format!("{} is longer than any journal", path.display()));
    }
    fs::read(&path).map_err(in_words)
}

/// What is wrong with a run's folder; nothing if all is as it was written.
#[must_use]
pub fn verify(folder: &Path) -> Vec<String> {
    compare(folder).unwrap_or_else(|error| vec![gnc_text::with_causes(&error)])
}

/// What is wrong with the signature of a run's digests.
#[must_use]
pub fn verify_signature(folder: &Path, key: &PublicKey) -> Option<String> {
    let read = |name| fs::read(folder.join(name));
    match (read(DIGESTS), read(SIGNATURE)) {
        (Ok(digests), Ok(signature)) if key.signed(&digests, &signature) => None,
        (Ok(_), Ok(_)) => Some(format!("{SIGNATURE} is not the signature of {DIGESTS} with this key")),
        (Ok(_), Err(_)) => Some(format!("{SIGNATURE} is missing: the run is not signed")),
        // That they are missing is said by `verify`.
        (Err(_), _) => None,
    }
}

fn compare(folder: &Path) -> Result<Vec<String>, StoreError> {
    let state = match fold(folder) {
        Ok(state) => state,
        Err(why) => return Ok(vec![why]),
    };
    let path = folder.join(DIGESTS);
    // The next start of a run seals it.
    if state.header().is_none() || state.is_interrupted() && !path.exists() {
        return Ok(vec!["interrupted: the run has no end, so nothing vouches for it".into()]);
    }
    if !path.exists() {
        return Ok(vec![format!("{DIGESTS} is missing: nothing vouches for this run")]);
    }
    let (sums, bad) = Sums::read(folder)?;
    let mut problems = vec![format!("{DIGESTS} holds a line that is no digest"); bad];
    let mut promised = sums.into_map();
    for file in digest::files_below(folder)? {
        match promised.remove(&file) {
            None => problems.push(format!("{} was added", file.display())),
            // A link or a device in its place is no file of the record, wherever it leads.
            Some(_) if !folder.join(&file).symlink_metadata().is_ok_and(|meta| meta.is_file()) => {
                problems.push(format!("{} was replaced by something that is no file", file.display()));
            }
            Some(digest) => match digest::of_file(&folder.join(&file)) {
                Ok(found) if found == digest => {}
                Ok(_) => problems.push(format!("{} was changed", file.display())),
                Err(error) => problems.push(gnc_text::with_causes(&error)),
            },
        }
    }
    problems.extend(promised.keys().map(|file| format!("{} is missing", file.display())));
    let stored = fs::read(folder.join(RECORD)).ok().and_then(|bytes| serde_json::from_slice::<RunRecord>(&bytes).ok());
    match (stored, RunRecord::from_state(&state)) {
        (Some(stored), Some(folded)) if stored == folded => {}
        _ => problems.push(format!("{RECORD} does not say what {JOURNAL} says")),
    }
    Ok(problems)
}

fn folders(dir: &Path) -> Result<Vec<PathBuf>, StoreError> {
    let mut found = Vec::new();
    for entry in on(fs::read_dir(dir), "read", dir)? {
        let path = on(entry, "read", dir)?.path();
        if path.is_dir() {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}
