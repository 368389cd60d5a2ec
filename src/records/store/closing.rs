//! Closes a run's folder: it makes the files for people and programs from the journal, then the digests of all files,
//! then the entry in the chain. If the program or the computer died before that, the next start does it.

use std::fs::{self, File};
use std::io;
use std::path::Path;

use chrono::{DateTime, FixedOffset};
use gnc_executive::event::ProgramVersion;
use gnc_executive::record::RunRecord;
use gnc_executive::state::RunState;
use gnc_executive::text;
use nix::errno::Errno;
use nix::fcntl::{Flock, FlockArg};

use super::chain::{Before, LateClose};
use super::cut_off::CutOffFile;
use super::digest::{self, FileDigests};
use super::folder::PART;
use super::{
    DIGESTS, JOURNAL, LOG, PAPERS, RECORD, RunFolder, SIGNATURE, StationKey, StoreError, chain, cut_off, late, on,
    reader,
};
use crate::passport::{self, NoPassport, PASSPORT, PASSPORT_XML};
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

/// Closes the folder of a run with the content of its journal. `cut_off` are the raw files without an end. `late` marks a
/// run that is not closed by the station that carried it out, and such a run gets no passport.
pub(super) fn close(
    folder: &RunFolder,
    record: Option<&RunRecord>,
    cut_off: &[CutOffFile],
    late: Option<&LateClose>,
) -> Result<(), StoreError> {
    let mut sums = FileDigests::default();
    if record.is_some_and(|record| record.other_module.is_some()) {
        folder.unassign()?;
    }
    if let Some(record) = record {
        folder.put(LOG, |out| out.write_all(log(record, cut_off, late).as_bytes()))?;
        folder.put(RECORD, |out| pretty(out, record))?;
        sums.add_new(folder.path())?;
        file_papers(folder, record, cut_off, late, &mut sums)?;
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
    chain::append_as(folder.path(), late)
}

/// The run as lines for people. It also lists what the journal cannot tell: that the run is closed late, and raw files that
/// got their end later.
fn log(record: &RunRecord, cut_off: &[CutOffFile], late: Option<&LateClose>) -> String {
    let mut log = text::log_txt(record);
    if let Some(late) = late {
        log.push_str(&format!("\nCLOSED LATE: {}\n", late.in_words()));
    }
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
    late: Option<&LateClose>,
    sums: &mut FileDigests,
) -> Result<(), StoreError> {
    let record_sha256 = sums.of_record();
    let passport = passport::of_run(record, &record_sha256);
    let passport =
        passport.and_then(|passport| if late.is_some() { Err(NoPassport::ClosedLate) } else { Ok(passport) });
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
    let late = late.map(LateClose::in_words);
    folder.put(REPORT, |out| report::html(out, record, &passport, &digests, late.as_deref()))
}

/// Who closes what an earlier start left behind, and when.
#[derive(Debug, Clone, Copy)]
pub struct Sealer<'a> {
    /// The station. It closes late only what a station of this name left.
    pub station: &'a str,
    /// The program.
    pub program: &'a ProgramVersion,
    /// The time by the clock of the computer.
    pub at: DateTime<FixedOffset>,
    /// Signs what is closed.
    pub key: Option<&'a StationKey>,
}

/// Seals the interrupted runs, and closes late the runs of this station that ended and missed the chain. Returns a line
/// about each.
#[must_use]
pub fn seal_interrupted(records: &Path, sealer: &Sealer<'_>) -> Vec<String> {
    // The first run of a station creates the folder.
    if !records.exists() {
        return Vec::new();
    }
    let mut runs: Vec<_> = reader::newest(records, LOOKED_AT).filter(|run| run.join(JOURNAL).is_file()).collect();
    runs.reverse();
    let (closed, open): (Vec<_>, Vec<_>) = runs.into_iter().partition(|run| run.join(DIGESTS).exists());
    let name = |run: &Path| gnc_text::shown_path(run.strip_prefix(records).unwrap_or(run));
    let cannot =
        |error: &StoreError| format!("cannot be sealed: {}; {}", gnc_text::with_causes(error), error.try_this());
    let sealed_before = closed.len();
    // The chain as it is before this start writes into it.
    let known = chain::unknown(records, closed).and_then(|unknown| {
        let is_any = !unknown.is_empty() || !open.is_empty();
        Ok((unknown, if is_any { Some(Before::read(records)?) } else { None }))
    });
    let (unknown, before) = match known {
        Ok((unknown, Some(before))) => (unknown, before),
        Ok((_, None)) => return Vec::new(),
        Err(error) => return vec![format!("the interrupted runs {}", cannot(&error))],
    };
    let mut lines = Vec::new();
    let mut ended = Vec::new();
    for run in unknown {
        match put_into_chain(records, &run) {
            Ok(Left::Sealed(())) => lines.push(format!(
                "{} was interrupted while the station sealed it; the sealing is complete now",
                name(&run)
            )),
            Ok(Left::Ended) => ended.push(run),
            Ok(Left::Alone) => {}
            Err(error) => {
                lines.push(format!(
                    "{} was interrupted while the station sealed it and {}",
                    name(&run),
                    cannot(&error)
                ));
            }
        }
    }
    for run in open {
        match seal(&run, sealer.key) {
            Ok(Left::Sealed(what)) => lines.push(format!("{} {what}", name(&run))),
            Ok(Left::Ended) => ended.push(run),
            Ok(Left::Alone) => {}
            Err(error) => lines.push(format!("{} was interrupted and {}", name(&run), cannot(&error))),
        }
    }
    let others = sealed_before + ended.iter().filter(|run| !reader::is_sealed(run)).count();
    for (run, closed) in late::close(records, ended, &before, others, sealer) {
        match closed {
            Ok(what) => lines.push(format!("{} {what}", name(&run))),
            Err(error) => lines.push(format!("{} ended, was not closed and {}", name(&run), cannot(&error))),
        }
    }
    lines
}

/// What a start does about a run that an earlier one left.
enum Left<T> {
    /// It has sealed the run.
    Sealed(T),
    /// The run has an end, so it can only be closed late.
    Ended,
    /// The run goes on, is sealed by another station, or cannot be read.
    Alone,
}

/// Appends a sealed run to the chain if a kill came between its digests and the chain. A run that ended is not appended
/// here: it may have been inserted later.
fn put_into_chain(records: &Path, run: &Path) -> Result<Left<()>, StoreError> {
    let path = run.join(JOURNAL);
    let Ok(_held) = hold(on(File::open(&path), "read", &path)?, &path) else { return Ok(Left::Alone) };
    let Some(state) = reader::fold(run).ok().filter(|state| state.header().is_some()) else { return Ok(Left::Alone) };
    if !state.is_interrupted() {
        return Ok(Left::Ended);
    }
    // Another station may have appended it meanwhile.
    let is_unknown = !chain::unknown(records, vec![run.to_owned()])?.is_empty();
    if !is_unknown || !reader::verify(run).is_empty() {
        return Ok(Left::Alone);
    }
    chain::append(run)?;
    Ok(Left::Sealed(()))
}

/// Seals a run without an end.
fn seal(run: &Path, key: Option<&StationKey>) -> Result<Left<String>, StoreError> {
    let path = run.join(JOURNAL);
    let Ok(_held) = hold(on(File::open(&path), "read", &path)?, &path) else { return Ok(Left::Alone) };
    // Another station may have sealed it meanwhile.
    let Some(state) = reader::fold(run).ok().filter(|_| !run.join(DIGESTS).exists()) else { return Ok(Left::Alone) };
    let Some(record) = RunRecord::from_state(&state) else { return Ok(Left::Alone) };
    if !record.interrupted {
        return Ok(Left::Ended);
    }
    clear_away(run)?;
    let folder = RunFolder::existing(run).signed_with(key.cloned());
    let cut_off = cut_off::complete(&folder)?.files;
    close(&folder, Some(&record), &cut_off, None)?;
    Ok(Left::Sealed(in_words(&state, &record, &cut_off)))
}

/// Removes what an earlier sealing left when it was killed: unfinished part files, and the papers, which are made after
/// all files that they name.
pub(super) fn clear_away(run: &Path) -> Result<(), StoreError> {
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
