//! Closes a run's folder: it makes the files for people and programs from the journal, then the digests of all files,
//! then the entry in the chain. If the program or the computer died before that, the next start does it.

use std::fs::{self, File};
use std::io;
use std::path::Path;

use gnc_executive::record::RunRecord;
use gnc_executive::state::RunState;
use gnc_executive::text;
use nix::errno::Errno;
use nix::fcntl::{Flock, FlockArg};

use super::cut_off::CutOffFile;
use super::digest::{self, FileDigests};
use super::folder::PART;
use super::{
    DIGESTS, JOURNAL, LOG, PAPERS, RECORD, RunFolder, SIGNATURE, StationKey, StoreError, chain, cut_off, on, reader,
};
use crate::passport::{self, PASSPORT, PASSPORT_XML};
use crate::report::{self, REPORT};

/// Number of newest runs that are searched for interrupted ones: a station that died starts again before a thousand
/// other runs.
const LOOKED_AT: usize = 1000;

/// Locks a journal, so that a search for interrupted runs sees that this run goes on. The kernel releases the lock when
/// the program dies.
pub(super) fn hold(journal: File, path: &Path) -> Result<Flock<File>, StoreError> {
    on(Flock::lock(journal, FlockArg::LockExclusiveNonblock).map_err(|(_, error)| error.into()), "lock", path)
}

/// Whether a station is writing a run now: it holds the run's folder, and soon its journal.
#[must_use]
pub fn goes_on(run: &Path) -> bool {
    // A journal without a byte may be one that its station is about to lock: this look must not take the lock from it.
    let journal = File::open(run.join(JOURNAL)).ok();
    let journal = journal.filter(|journal| journal.metadata().is_ok_and(|meta| meta.len() > 0));
    [File::open(run).ok(), journal].into_iter().flatten().any(is_held)
}

/// Whether a program holds the lock of a file or a folder. On a disk without locks this is unknown, and the answer is no.
fn is_held(file: File) -> bool {
    matches!(Flock::lock(file, FlockArg::LockSharedNonblock), Err((_, Errno::EAGAIN)))
}

/// Closes the folder of a run with the content of its journal. `cut_off` are the raw files without an end.
pub(super) fn close(folder: &RunFolder, record: Option<&RunRecord>, cut_off: &[CutOffFile]) -> Result<(), StoreError> {
    let mut sums = FileDigests::default();
    if record.is_some_and(|record| record.other_module.is_some()) {
        folder.unassign()?;
    }
    if let Some(record) = record {
        folder.put(LOG, |out| out.write_all(log(record, cut_off).as_bytes()))?;
        folder.put(RECORD, |out| pretty(out, record))?;
        sums.add_new(folder.path())?;
        file_papers(folder, record, cut_off, &mut sums)?;
    }
    // One wait for all files of the run, then the digests that cover them.
    folder.sync()?;
    sums.add_new(folder.path())?;
    let digests = sums.text();
    if let Some(key) = folder.key() {
        // Sign before the digests are written, since they close the folder.
        let signature = key.sign(digests.as_bytes());
        folder.put_synced(SIGNATURE, |out| out.write_all(&signature))?;
    }
    folder.put_synced(DIGESTS, |out| out.write_all(digests.as_bytes()))?;
    chain::append(folder.path())
}

/// The run as lines for people. It also lists what the journal cannot tell: raw files that got their end later.
fn log(record: &RunRecord, cut_off: &[CutOffFile]) -> String {
    let mut log = text::log_txt(record);
    if !cut_off.is_empty() {
        log.push_str("\nFiles of raw samples without an end\n");
        log.extend(cut_off.iter().map(|file| format!("  {}\n", file.in_words())));
    }
    log
}

/// Passport and report name the digest of all files that existed before them.
fn file_papers(
    folder: &RunFolder,
    record: &RunRecord,
    cut_off: &[CutOffFile],
    sums: &mut FileDigests,
) -> Result<(), StoreError> {
    let record_sha256 = sums.of_record();
    let passport = passport::of_run(record, &record_sha256);
    if let Ok(passport) = &passport {
        let xml = passport::xml(passport)?;
        folder.put(PASSPORT, |out| pretty(out, passport))?;
        folder.put(PASSPORT_XML, |out| out.write_all(&xml))?;
        sums.add_new(folder.path())?;
    }
    let digest = |name: &str| sums.get(name).map(|digest| (name.to_owned(), digest.to_owned()));
    let files = [JOURNAL, RECORD, PASSPORT, PASSPORT_XML].into_iter().filter_map(digest);
    let all = ("the whole record, as the passport names it".to_owned(), record_sha256);
    let originals = cut_off.iter().map(|file| {
        let name = format!("{} as the station left it, {} bytes without an end", file.file, file.original_bytes);
        (name, file.original_sha256.clone())
    });
    let digests: Vec<_> = files.chain([all]).chain(originals).collect();
    folder.put(REPORT, |out| report::html(out, record, &passport, &digests))
}

/// Seals the interrupted runs and returns a line about each. A run that ended but was not closed stays as it is:
/// without digests from its end it must not become a pass later.
#[must_use]
pub fn seal_interrupted(records: &Path, key: Option<&StationKey>) -> Vec<String> {
    // The first run of a station creates the folder.
    if !records.exists() {
        return Vec::new();
    }
    let mut runs: Vec<_> = reader::newest(records, LOOKED_AT).filter(|run| run.join(JOURNAL).is_file()).collect();
    runs.reverse();
    let (closed, open): (Vec<_>, Vec<_>) = runs.into_iter().partition(|run| run.join(DIGESTS).exists());
    let name = |run: &Path| run.strip_prefix(records).unwrap_or(run).display().to_string();
    let cannot =
        |error: &StoreError| format!("cannot be sealed: {}; {}", gnc_text::with_causes(error), error.try_this());
    let chained = match chain::unknown(records, closed) {
        Ok(unknown) => unknown,
        Err(error) => return vec![format!("the interrupted runs {}", cannot(&error))],
    };
    let chained = chained.iter().filter_map(|run| match put_into_chain(records, run) {
        Ok(done) => done
            .then(|| format!("{} was interrupted while the station sealed it; the sealing is complete now", name(run))),
        Err(error) => Some(format!("{} was interrupted while the station sealed it and {}", name(run), cannot(&error))),
    });
    let sealed = open.iter().filter_map(|run| match seal(run, key) {
        Ok(what) => what.map(|what| format!("{} {what}", name(run))),
        Err(error) => Some(format!("{} was interrupted and {}", name(run), cannot(&error))),
    });
    chained.chain(sealed).collect()
}

/// Appends a sealed run to the chain if a kill came between its digests and the chain. Returns whether it did so. A run
/// that ended is not appended: it may have been inserted later.
fn put_into_chain(records: &Path, run: &Path) -> Result<bool, StoreError> {
    let path = run.join(JOURNAL);
    let Ok(_held) = hold(on(File::open(&path), "read", &path)?, &path) else { return Ok(false) };
    // Another station may have appended it meanwhile.
    let is_unknown = !chain::unknown(records, vec![run.to_owned()])?.is_empty();
    let is_interrupted = reader::fold(run).is_ok_and(|state| state.header().is_some() && state.is_interrupted());
    if !is_unknown || !is_interrupted || !reader::verify(run).is_empty() {
        return Ok(false);
    }
    chain::append(run)?;
    Ok(true)
}

/// Seals a run. `None`: the run goes on, has an end, or is empty.
fn seal(run: &Path, key: Option<&StationKey>) -> Result<Option<String>, StoreError> {
    let path = run.join(JOURNAL);
    let Ok(_held) = hold(on(File::open(&path), "read", &path)?, &path) else { return Ok(None) };
    // Another station may have sealed it meanwhile.
    let Some(state) = reader::fold(run).ok().filter(|_| !run.join(DIGESTS).exists()) else { return Ok(None) };
    let Some(record) = RunRecord::from_state(&state).filter(|record| record.interrupted) else { return Ok(None) };
    clear_away(run)?;
    let folder = RunFolder::existing(run).signed_with(key.cloned());
    let cut_off = cut_off::complete(&folder)?.files;
    close(&folder, Some(&record), &cut_off)?;
    Ok(Some(in_words(&state, &record, &cut_off)))
}

/// Removes what an earlier sealing left when it was killed: unfinished part files, and the papers, which are made after
/// all files that they name.
fn clear_away(run: &Path) -> Result<(), StoreError> {
    let is_left = |file: &Path| {
        file.extension().is_some_and(|extension| extension == PART)
            || PAPERS.iter().any(|paper| file == Path::new(paper))
    };
    for file in digest::files_below(run)?.into_iter().filter(|file| is_left(file)) {
        let path = run.join(file);
        on(fs::remove_file(&path), "remove", &path)?;
    }
    Ok(())
}

fn in_words(state: &RunState, record: &RunRecord, cut_off: &[CutOffFile]) -> String {
    let running = state.rows().iter().filter(|row| row.running().is_some());
    let running: Vec<&str> = running.map(|row| row.planned.name.as_str()).collect();
    let during = if running.is_empty() { String::new() } else { format!(" during {}", running.join(", ")) };
    let last = state.last().map_or_else(String::new, |last| format!(" after {}", last.at.format("%F %T")));
    let serial_number = &record.serial_number;
    let ended: String = cut_off.iter().map(|file| format!("{}; ", file.in_short())).collect();
    format!("was interrupted{during}{last}; {ended}it is sealed as interrupted; test {serial_number} again")
}

/// Writes JSON in the form of the record's files.
///
/// # Errors
/// `out` could not be written.
pub fn pretty(out: &mut dyn io::Write, value: &impl serde::Serialize) -> io::Result<()> {
    serde_json::to_writer_pretty(&mut *out, value)?;
    out.write_all(b"\n")
}
