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
    let what = match inside_records(path) {
        None => return Ok(()),
        Some(Inside::Run(run)) => format!(
            "{} lies in the folder of the run {} and would be a finding of its verification for ever",
            shown_path(path),
            shown_path(&run)
        ),
        Some(Inside::Day(day)) => format!(
            "{} lies among the runs of {} and would be a finding of their verification for ever",
            shown_path(path),
            shown_path(&day)
        ),
        Some(Inside::Counter) => format!("{} would stand for the counter of the records", shown_path(path)),
    };
    Err(CommandRefusal::new(what, &format!("name a place outside of the records folder with {option}")))
}
