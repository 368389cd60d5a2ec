//! Closes runs late: a power cut may come between the end of a run and its line in the chain. Then the run is whole, and
//! nothing in its folder proves that nobody changed it meanwhile. So it gets a line with a mark that stays, and never
//! counts as a pass.
//!
//! Only the next start of the same station does so, and only for a run that a power cut can have left. A run that the
//! chain names, that another station wrote, or whose files contradict its journal stays as it is.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use gnc_executive::record::RunRecord;

use super::chain::{self, Before, LateClose, Scribe};
use super::closing;
use super::contents::{Contents, PlanFiles};
use super::folder::sync_dir;
use super::lock::Holder;
use super::reader::MAX_RECORD_BYTES;
use super::recovery::{Sealer, Until, held, may_close, unlike_signature};
use super::staying::Stays;
use super::{DIGESTS, RECORD, RunFolder, SIGNATURE, StationKey, StoreError, as_written, cut_off, on, reader};

/// The digests that a run had before it was closed late.
const DIGESTS_BEFORE: &str = "SHA256SUMS.before";
/// Their signature.
const SIGNATURE_BEFORE: &str = "SHA256SUMS.before.sig";

/// What a start does about a run that ended.
pub(super) enum Closed {
    /// It has closed the run late.
    Late(ClosedLate),
    /// The run stays as it is; says why.
    Open(Stays),
}

/// A run that was closed late.
pub(super) struct ClosedLate {
    /// What to say.
    pub(super) what: String,
    /// Where its folder is now.
    pub(super) now: PathBuf,
    /// Files without digests that had the names of those that a closing makes.
    pub(super) early: Vec<&'static str>,
}

/// Closes those of the ended runs that a sudden end of this station left, and returns what was done with each. `before` is
/// the chain before this start wrote into it, and `others` the number of all runs that are closed or ended.
pub(super) fn close(
    records: &Path,
    ended: Vec<PathBuf>,
    before: &Before,
    others: usize,
    sealer: &Sealer<'_>,
    until: &mut Until,
) -> Vec<(PathBuf, Result<Closed, StoreError>)> {
    // Only the first run of a folder can miss a chain without any line. If there are more, the chain was lost.
    if before.is_new() && others > 1 {
        return Vec::new();
    }
    let left = ended.into_iter().filter(|run| before.may_lack(records, run)).filter(|_| until.has_time());
    let done = left.filter_map(|run| match close_one(records, &run, before, sealer) {
        Ok(what) => what.map(|what| (run, Ok(what))),
        Err(error) => Some((run, Err(error))),
    });
    done.collect()
}

/// Takes the runs with digests out of those that ended, where there is no chain and no counter, and says that they stay as they
/// are. A station writes the first line and the counter before it tests anything, so no sudden end leaves this: a version before
/// the chain closed these runs, or the chain was taken away.
pub(super) fn without_chain<T: std::fmt::Display>(
    ended: &mut Vec<PathBuf>,
    before: &Before,
    name: impl Fn(&Path) -> T,
) -> Option<String> {
    if !before.is_new() {
        return None;
    }
    let closed: Vec<PathBuf> = ended.extract_if(.., |run| reader::is_sealed(run)).collect();
    match closed.as_slice() {
        [] => None,
        [run] => Some(format!(
            "{} is closed and its folder of records has no chain; it is left as it is and counts for nothing: a version before the chain wrote it unless the chain was lost; if there is a backup of the chain restore it",
            name(run)
        )),
        runs => Some(format!(
            "{} runs are closed and their folder of records has no chain; they are left as they are and count for nothing: a version before the chain wrote them unless the chain was lost; if there is a backup of the chain restore it",
            runs.len()
        )),
    }
}

/// Closes a run. `None`: the run goes on, or another start has just closed it.
fn close_one(records: &Path, run: &Path, before: &Before, sealer: &Sealer<'_>) -> Result<Option<Closed>, StoreError> {
    let _held = match held(run)? {
        Holder::Own(held) => held,
        Holder::Station => return Ok(None),
        Holder::Readers => return Ok(Some(Closed::Open(Stays::is_read()))),
    };
    // Another station may have closed it meanwhile.
    if chain::unknown(records, vec![run.to_owned()])?.is_empty() {
        return Ok(None);
    }
    let state = match reader::fold(run) {
        Ok(state) => state,
        Err(error) => return Ok(Some(Closed::Open(Stays::is_unreadable(run, &error)))),
    };
    let record = RunRecord::from_state(&state).filter(|record| !record.interrupted);
    let Some(record) = record else { return Ok(None) };
    let is_signed = match may_close(records, run, &state, before, sealer)? {
        Ok(began) => began.is_some_and(|began| began.is_signed()),
        Err(stays) => return Ok(Some(Closed::Open(stays))),
    };
    let late = LateClose::new(sealer.at, &format!("{}-{}", sealer.program.name, sealer.program.version));
    let by = Scribe { late: Some(&late), ..sealer.scribe() };
    let digests = run.join(DIGESTS);
    let plan = PlanFiles::found(run, &state)?;
    let early = if digests.exists() { Vec::new() } else { closing::named_early(run) };
    if digests.exists() {
        if let Some(stays) = Stays::is_changed(&as_written::changes(run)) {
            return Ok(Some(Closed::Open(stays)));
        }
        if let Some(why) = unlike_signature(run, is_signed, sealer.key) {
            return Ok(Some(Closed::Open(Stays::Because(why))));
        }
        // The papers say that the run was closed in time. All but the journal and the samples is made again.
        set_aside(run)?;
    } else if contradicts(run, &record)? {
        let why = format!(
            "is left as it is because its {RECORD} says something else than its journal; restore it from a backup"
        );
        return Ok(Some(Closed::Open(Stays::Because(why))));
    }
    set_signature_aside(run, sealer.key)?;
    closing::clear_away(run)?;
    let folder = RunFolder::existing(run).signed_with(sealer.key.cloned());
    let cut_off = cut_off::complete(&folder)?.files;
    let began = chain::begin(run, &by)?;
    let made = [DIGESTS_BEFORE, SIGNATURE_BEFORE];
    let contents = Contents { state: &Mutex::new(state), plan: &plan, cut_off: &cut_off, made: &made };
    closing::close(&folder, &contents, &by, Some(&began))?;
    let ended = record.finished.map_or_else(String::new, |at| format!(" at {}", at.format("%F %T")));
    let serial_number = gnc_text::printable(&record.serial_number);
    let said = format!(
        "ended{ended}, and its station ended, or could not write, before the run was in the chain; it is closed late now and never counts as a pass; \
         test {serial_number} again"
    );
    Ok(Some(Closed::Late(ClosedLate { what: said, now: folder.path().to_owned(), early })))
}

/// Keeps the digests that a run had, which the new ones cover then: they prove what the run was when its station ended. Those
/// of an earlier late closing prove less than the first, and go.
fn set_aside(run: &Path) -> Result<(), StoreError> {
    let (digests, kept) = (run.join(DIGESTS), run.join(DIGESTS_BEFORE));
    if kept.symlink_metadata().is_ok() {
        return closing::remove(&digests);
    }
    on(fs::rename(&digests, &kept), "move", &digests)?;
    sync_dir(run)
}

/// Keeps the signature of digests that were set aside, if it is theirs: a later one may be of digests that a kill prevented.
fn set_signature_aside(run: &Path, key: Option<&StationKey>) -> Result<(), StoreError> {
    let (signature, kept) = (run.join(SIGNATURE), run.join(SIGNATURE_BEFORE));
    let read = |name: &str| match gnc_files::read_below(run, Path::new(name), MAX_RECORD_BYTES) {
        Err(error) if error.kind() == io::ErrorKind::NotFound || gnc_files::is_refused(&error).is_some() => Ok(None),
        // The signature would be lost.
        read => on(read, "read", &run.join(name)).map(Some),
    };
    let (Some(digests), Some(signed), Some(key)) = (read(DIGESTS_BEFORE)?, read(SIGNATURE)?, key) else {
        return Ok(());
    };
    if kept.symlink_metadata().is_ok() || !key.public().signed(&digests, &signed) {
        return Ok(());
    }
    on(fs::rename(&signature, &kept), "move", &signature)?;
    sync_dir(run)
}

/// Whether the record for programs is whole and says something else than the journal: no power cut does that.
fn contradicts(run: &Path, record: &RunRecord) -> Result<bool, StoreError> {
    let path = run.join(RECORD);
    let bytes = match gnc_files::read_below(run, Path::new(RECORD), MAX_RECORD_BYTES) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
        read => on(read, "read", &path)?,
    };
    // A power cut may leave half of the file, or zeros: it is made again.
    if !is_whole(&bytes) {
        return Ok(false);
    }
    let stored = serde_json::from_slice::<RunRecord>(&bytes);
    Ok(stored.map_or(true, |stored| stored != record.clone().closed_like(&stored)))
}

/// Whether a file is JSON to its end. Nothing of it is kept: as values it would take many times its length.
fn is_whole(bytes: &[u8]) -> bool {
    serde_json::from_slice::<serde::de::IgnoredAny>(bytes).is_ok()
}

#[cfg(test)]
mod tests;
