//! Whether a run that is to be taken up is one of this station, and as it was written: a folder that was put there, or whose
//! files were exchanged, holds captures of any module.
//!
//! With a key nothing counts that it did not sign: the run lies in the records folder of the station, whose chain says that it began
//! and, if it was closed, that it was. Without a key a run from elsewhere is taken, and the log says that nothing shows whose it is.

use std::path::Path;

use gnc_executive::state::RunState;

use super::{Like, ResumeError};
use crate::store::captured::CapturedFiles;
use crate::store::chain::{self, Beginning, Beginnings, ChainStanding, SignedBy};
use crate::store::{DIGESTS, PublicKey, StationKey, StoreError, as_written};

/// Folders from a run up to that of all records: module, day, records.
const UP_TO_RECORDS: usize = 3;
/// What is said of a run from elsewhere.
const OUTSIDE: &str = "the run is not in the records folder of this station";
/// What is said of a run without a line in the chain.
const NOT_BEGUN: &str = "no line of the chain says that it began";

fn changed<T>(what: String) -> Result<T, ResumeError> {
    Err(ResumeError::Changed { what })
}

fn unreadable(error: &StoreError) -> ResumeError {
    ResumeError::Changed { what: gnc_text::with_causes(error) }
}

/// Whether the run is a run of these records, by the paths without links and `..`.
fn lies_in(run: &Path, records: &Path) -> bool {
    records.canonicalize().is_ok_and(|records| run.ancestors().nth(UP_TO_RECORDS) == Some(records.as_path()))
}

/// Checks a run, by its path without links and `..`. Where nothing shows whose it is, says why: chains of earlier versions name no
/// run that began.
pub(super) fn check(
    run: &Path,
    state: &RunState,
    captured: &CapturedFiles,
    like: &Like<'_>,
) -> Result<Option<&'static str>, ResumeError> {
    let is_inside = lies_in(run, like.records);
    if like.key.is_some() && !is_inside {
        return Err(ResumeError::Outside { records: like.records.to_owned() });
    }
    let Some(records) = run.ancestors().nth(UP_TO_RECORDS) else { return Ok(Some(OUTSIDE)) };
    let all = Beginnings::read(records).map_err(|error| unreadable(&error))?;
    // Versions that sign what they captured write the line of the beginning too. So its chain was taken away.
    let must_be_named = like.key.is_some() && (all.are_signed() || !captured.is_empty());
    let unproven = match all.of(records, run).map_err(|error| unreadable(&error))? {
        Beginning::NeverWritten if must_be_named => return changed(NOT_BEGUN.to_owned()),
        Beginning::Missing => return changed(NOT_BEGUN.to_owned()),
        Beginning::Written(begun) if like.key.is_some() && begun.signed_by(like.key) != SignedBy::This => {
            return changed("the line of its beginning is not signed with the key of this station".to_owned());
        }
        Beginning::Written(_) | Beginning::NeverWritten if !is_inside => Some(OUTSIDE),
        Beginning::NeverWritten => Some(NOT_BEGUN),
        Beginning::Written(_) => None,
    };
    unchanged(run, state, like.key, must_be_named)?;
    Ok(unproven)
}

/// Checks a closed run against its digests, and those against the chain. A run that was cut off has neither.
fn unchanged(run: &Path, state: &RunState, key: Option<&StationKey>, must_be_named: bool) -> Result<(), ResumeError> {
    if !run.join(DIGESTS).exists() {
        return Ok(());
    }
    let keys: Vec<PublicKey> = key.map(StationKey::public).into_iter().collect();
    let added = as_written::strangers(run);
    let added = added.iter().map(|file| as_written::was_added(file));
    let changes = as_written::changes(run).into_iter().chain(added);
    if let Some(what) = changes.chain(as_written::verify_signature(run, &keys)).next() {
        return changed(what);
    }
    match chain::standing(run).map_err(|error| unreadable(&error))? {
        ChainStanding::Held
            if keys.is_empty() || chain::is_close_signed_by(run, &keys).map_err(|error| unreadable(&error))? =>
        {
            Ok(())
        }
        ChainStanding::Held => changed("the line of its end is not signed with the key of this station".to_owned()),
        ChainStanding::NoChain if !must_be_named => Ok(()),
        ChainStanding::Late => Err(ResumeError::ClosedLate),
        // A power cut came between the digests and the chain; the start of the next run repairs that.
        ChainStanding::Missing if state.is_interrupted() => Ok(()),
        ChainStanding::Missing | ChainStanding::NoChain => {
            changed("the chain of closed runs does not have it".to_owned())
        }
        ChainStanding::Other => changed(format!(
            "{DIGESTS} was changed after the run was closed: the chain of closed runs has another digest"
        )),
    }
}
