//! Folders of runs that were never begun: the station made the folder and ended, or could not write, before the first event.
//! Nothing was tested, so such a folder is neither a run nor a sign of a change.

use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use super::folder::PART;
use super::{DIGESTS, JOURNAL, PLAN, digest};

/// Longest first event: it names all items of a plan, at most 20,000. A power cut may leave as many zeros in its place.
pub(crate) const MAX_FIRST_EVENT_BYTES: u64 = 16 << 20;

/// Whether a run's folder holds no more than its plan and a journal without a whole event. While a station holds the folder
/// this is how each run begins.
#[must_use]
pub fn was_never_begun(run: &Path) -> bool {
    let is_before = |file: &PathBuf| {
        let is_part = file.parent() == Some(Path::new("")) && file.extension().is_some_and(|end| end == PART);
        file.starts_with(PLAN)
            || is_part
            || file == Path::new(JOURNAL) && has_no_event(&run.join(file)).unwrap_or(false)
    };
    run.join(DIGESTS).symlink_metadata().is_err()
        && digest::files_below(run).is_ok_and(|files| files.iter().all(is_before))
}

/// Whether a journal is empty, or cut off in its first event. A line that lacks only its end is a whole event.
fn has_no_event(journal: &Path) -> io::Result<bool> {
    let mut bytes = Vec::new();
    gnc_files::own(journal)?.take(MAX_FIRST_EVENT_BYTES + 1).read_to_end(&mut bytes)?;
    let is_long = bytes.len() as u64 > MAX_FIRST_EVENT_BYTES;
    let written = bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    let is_whole = || serde_json::from_slice::<serde::de::IgnoredAny>(&bytes[..written]).is_ok();
    Ok(!is_long && !bytes.contains(&b'\n') && !is_whole())
}
