//! Where commands may write what a person asks for: nowhere that only a station writes.

use std::path::Path;

use gnc_records::store::inside::{Inside, inside_records};
use gnc_text::shown_path;

use crate::refusal::CommandRefusal;

/// Refuses a place for a file or a folder that a person names, before anything is written. `option` names it on the command line.
///
/// # Errors
/// The place lies in the folder of a run or among the runs of a day, where such a file would be a finding for ever.
pub(crate) fn may_write(path: &Path, option: &str) -> Result<(), CommandRefusal> {
    match among_runs(path) {
        None => Ok(()),
        Some(what) => {
            Err(CommandRefusal::new(what, &format!("name a place outside of the records folder with {option}")))
        }
    }
}

/// Refuses a folder for records that lies among the runs of others.
///
/// # Errors
/// As [`may_write`].
pub(crate) fn may_hold_records(folder: &Path) -> Result<(), CommandRefusal> {
    match among_runs(folder) {
        None => Ok(()),
        Some(what) => Err(CommandRefusal::new(
            what,
            "choose another folder with records = under [station] of the bench file or with --records",
        )),
    }
}

/// What is wrong with a place that lies among runs.
fn among_runs(path: &Path) -> Option<String> {
    Some(match inside_records(path)? {
        Inside::Run(run) => format!(
            "{} lies in the folder of the run {} and would be a finding of its verification for ever",
            shown_path(path),
            shown_path(&run)
        ),
        Inside::Day(day) => format!(
            "{} lies among the runs of {} and would be a finding of their verification for ever",
            shown_path(path),
            shown_path(&day)
        ),
        Inside::Counter => format!("{} would stand for the counter of the records", shown_path(path)),
    })
}
