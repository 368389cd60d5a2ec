//! Closes a run's folder: it makes the files for people and programs from the journal, then the digests of all files of the run,
//! then the entry in the chain, and only then gives the files that say how the run ended their names. If the program or the computer
//! died before that, the next start does it ([`super::recovery`]).

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::Path;

use gnc_executive::record::RunRecord;
use gnc_executive::text;

use super::captured;
use super::chain::{LateClose, Place, Scribe};
use super::contents::Contents;
use super::cut_off::CutOffFile;
use super::digest::{self, FileDigests};
use super::folder::{PART, sync_dir};
use super::pending::TELLING;
use super::{DIGESTS, JOURNAL, LOG, PAPERS, RECORD, RunFolder, SIGNATURE, StoreError, chain, on, pending};
use crate::passport::{self, NoPassport, PASSPORT, PASSPORT_XML};
use crate::report::{self, REPORT};

/// Locks a journal, so that a search for interrupted runs sees that this run goes on. The kernel releases the lock when
/// the program dies.
pub(super) fn hold(journal: File, path: &Path) -> Result<File, StoreError> {
    on(journal.try_lock().map_err(io::Error::from), "lock", path)?;
    Ok(journal)
}

/// Whether a station is writing a run now: it holds the run's folder, and soon its journal.
#[must_use]
pub fn goes_on(run: &Path) -> bool {
    // A journal without a byte may be one that its station is about to lock: this look must not take the lock from it.
    let journal = gnc_files::own(&run.join(JOURNAL)).ok();
    let journal = journal.filter(|journal| journal.metadata().is_ok_and(|meta| meta.len() > 0));
    [File::open(run).ok(), journal].into_iter().flatten().any(|file| is_held(&file))
}

/// Whether a program holds the lock of a file or a folder. On a disk without locks this is unknown, and the answer is no.
fn is_held(file: &File) -> bool {
    matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock))
}

/// Closes the folder of a run with what its journal says. The mark of a late close is for a run that is not closed by the station
/// that carried it out, and such a run gets no passport. `by` writes the line, and `began` is the place of that of the run's beginning.
/// Nothing in the folder says how the run ended before its line is in the chain.
pub(super) fn close(
    folder: &RunFolder,
    contents: &Contents<'_>,
    by: &Scribe<'_>,
    began: Option<&Place>,
) -> Result<(), StoreError> {
    let closed = seal_files(folder, contents, by, began).and_then(|()| chain::append_as(folder.path(), by));
    match &closed {
        Ok(()) => pending::name_all(folder.path()),
        // The chain may have the run: without its digests it would be one that was changed. The error says so.
        Err(StoreError::MayStand(_)) => {}
        Err(_) => withdraw(folder.path()),
    }
    closed
}

/// Takes the digests back, so that no face takes the run for one that was closed, and then what waited for its name. The journal
/// stays, and the next start closes the run late. Digests that cannot be removed keep their files: without them the run would be one
/// that was changed, and with them it is one that was cut off before its line.
fn withdraw(run: &Path) {
    // The reported error is that of the closing. What stays has no line in the chain.
    if remove(&run.join(DIGESTS)).is_ok() {
        let waiting = TELLING.map(pending::waiting_name);
        for name in [SIGNATURE].into_iter().chain(waiting.iter().map(String::as_str)) {
            let _ = fs::remove_file(run.join(name));
        }
    }
    let _ = sync_dir(run);
}

fn seal_files(
    folder: &RunFolder,
    contents: &Contents<'_>,
    by: &Scribe<'_>,
    began: Option<&Place>,
) -> Result<(), StoreError> {
    let late = by.late;
    let record = contents.record();
    let record = record.map(|record| match late {
        Some(late) => record.closed_late(&late.at),
        None => record,
    });
    if record.as_ref().is_some_and(|record| record.other_module.is_some()) {
        folder.unassign()?;
    }
    // What has the name of a paper was put there: no paper is made before this.
    for name in TELLING {
        remove(&folder.path().join(name))?;
        remove(&folder.path().join(pending::waiting_name(name)))?;
    }
    let mut sums = FileDigests::default();
    contents.add_to(&mut sums, folder)?;
    // A sudden end may come between the folder of an item and its first file.
    digest::remove_empty(folder.path())?;
    if let Some(record) = &record {
        // A person had time to exchange files only where the station did not close the run itself.
        let unlike = if record.interrupted || late.is_some() { captured::unlike(folder.path())? } else { Vec::new() };
        let log = log(record, contents.cut_off, &unlike, late);
        sums.insert(LOG, folder.put_waiting(LOG, |out| out.write_all(log.as_bytes()))?);
        sums.insert(RECORD, folder.put_waiting(RECORD, |out| pretty(out, record))?);
        file_papers(folder, record, contents.cut_off, late, began, &mut sums)?;
    }
    // One wait for all files of the run, before the digests that cover them.
    folder.sync()?;
    let digests = sums.text();
    if let Some(key) = folder.key() {
        // Sign before the digests are written, since they close the folder.
        let signature = key.sign(digests.as_bytes());
        folder.put_synced(SIGNATURE, |out| out.write_all(&signature))?;
    }
    folder.put_synced(DIGESTS, |out| out.write_all(digests.as_bytes()))
}

/// The run as lines for people. It also lists what the journal cannot tell: that the run is closed late, raw files that
/// got their end later, and those that are not the ones that were captured.
fn log(record: &RunRecord, cut_off: &[CutOffFile], unlike: &[String], late: Option<&LateClose>) -> String {
    // Who reads the items below must know it, and who reads only the end too.
    let late = late.map(|late| format!("CLOSED LATE: {}\n", late.in_words()));
    let mut log = late.as_ref().map_or_else(String::new, |late| format!("{late}\n"));
    log.push_str(&text::log_txt(record));
    if let Some(late) = late {
        log.push_str(&format!("\n{late}"));
    }
    if !cut_off.is_empty() {
        log.push_str("\nFiles of raw samples without an end\n");
        log.extend(cut_off.iter().map(|file| format!("  {}\n", file.in_words())));
    }
    if !unlike.is_empty() {
        log.push_str("\nRaw samples that are not as the journal says\n");
        log.extend(unlike.iter().map(|what| format!("  {what}\n")));
    }
    log
}

/// Passport and report name the digest of all files that existed before them.
fn file_papers(
    folder: &RunFolder,
    record: &RunRecord,
    cut_off: &[CutOffFile],
    late: Option<&LateClose>,
    began: Option<&Place>,
    sums: &mut FileDigests,
) -> Result<(), StoreError> {
    let record_sha256 = sums.of_record();
    let chain = began.map(ToString::to_string);
    let passport = passport::of_run(record, &record_sha256, chain.as_deref());
    let passport =
        passport.and_then(|passport| if late.is_some() { Err(NoPassport::ClosedLate) } else { Ok(passport) });
    if let Ok(passport) = &passport {
        let xml = passport::xml(passport)?;
        sums.insert(PASSPORT, folder.put_waiting(PASSPORT, |out| pretty(out, passport))?);
        sums.insert(PASSPORT_XML, folder.put_waiting(PASSPORT_XML, |out| out.write_all(&xml))?);
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
    let report =
        |out: &mut dyn io::Write| report::html(out, record, &passport, &digests, late.as_deref(), chain.as_deref());
    sums.insert(REPORT, folder.put_waiting(REPORT, report)?);
    Ok(())
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
    // Without digests it is the signature of digests that are lost.
    remove(&run.join(SIGNATURE))
}

/// Files with names that a run's files get only when its line is in the chain. In a run without a line no station of this version wrote
/// them.
pub(super) fn named_early(run: &Path) -> Vec<&'static str> {
    TELLING.into_iter().filter(|name| run.join(name).symlink_metadata().is_ok()).collect()
}

/// Removes a file that may be there.
pub(super) fn remove(path: &Path) -> Result<(), StoreError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => on(Err(error), "remove", path),
        _ => Ok(()),
    }
}

/// Writes JSON in the form of the record's files.
///
/// # Errors
/// `out` could not be written.
pub fn pretty(out: &mut dyn io::Write, value: &impl serde::Serialize) -> io::Result<()> {
    serde_json::to_writer_pretty(&mut *out, value)?;
    out.write_all(b"\n")
}
