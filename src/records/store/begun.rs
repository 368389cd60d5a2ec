//! Folders of runs that were never begun: the station made the folder and ended, or could not write, before the first event.
//! Nothing was tested, so such a folder is neither a run nor a sign of a change.

use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use super::chain::has_one_event;
use super::folder::PART;
use super::{DIGESTS, JOURNAL, LOG, PAPERS, PLAN, RECORD, SIGNATURE, StoreError, digest};

/// Longest first event: it names all items of a plan, at most 20,000. A power cut may leave as many zeros in its place.
pub(crate) const MAX_FIRST_EVENT_BYTES: u64 = 16 << 20;

/// Whether a run's folder holds no more than its plan and a journal without a whole event. While a station holds the folder
/// this is how each run begins.
#[must_use]
pub fn was_never_begun(run: &Path) -> bool {
    let has_no_event = |journal: &Path| has_no_event(journal).unwrap_or(false);
    run.join(DIGESTS).symlink_metadata().is_err() && others(run, has_no_event).is_ok_and(|others| others.is_empty())
}

/// Whether a run's folder holds no more than a station writes before the line of the run's beginning is in the chain: the plan, and a
/// journal with its first event.
#[must_use]
pub fn may_begin(run: &Path) -> bool {
    let may_have_one = |journal: &Path| {
        has_no_event(journal).unwrap_or(false)
            || journal.parent().is_some_and(|run| has_one_event(run).unwrap_or(false))
    };
    run.join(DIGESTS).symlink_metadata().is_err() && others(run, may_have_one).is_ok_and(|others| others.is_empty())
}

/// What to say of a folder without an event, record and digests that has other files: `None` of every other folder.
pub(super) fn strangers(run: &Path) -> Option<String> {
    let is_missing = |file: &str| {
        let found = run.join(file).symlink_metadata();
        found.is_err_and(|error| error.kind() == io::ErrorKind::NotFound)
    };
    let is_without_event = || is_missing(JOURNAL) || has_no_event(&run.join(JOURNAL)).unwrap_or(false);
    if !is_missing(RECORD) || !is_missing(DIGESTS) || !is_without_event() {
        return None;
    }
    let others = others(run, |_| true).ok()?;
    let first = others.first()?;
    let first = gnc_text::shown_path(first);
    Some(match others.len() {
        1 => format!("no run began here, and 1 other file is in its folder, {first}: no station writes it there"),
        others => format!(
            "no run began here, and {others} other files are in its folder, the first is {first}: no station writes them there"
        ),
    })
}

/// All files but those that a station writes before a run begins.
fn others(run: &Path, is_journal_of_beginning: impl Fn(&Path) -> bool) -> Result<Vec<PathBuf>, StoreError> {
    let is_before = |file: &PathBuf| {
        let is_file = || run.join(file).symlink_metadata().is_ok_and(|meta| meta.is_file());
        let is_own = is_of_plan(file) || is_part(file) || file == Path::new(JOURNAL);
        is_own && is_file() && (file != Path::new(JOURNAL) || is_journal_of_beginning(&run.join(file)))
    };
    Ok(digest::files_below(run)?.into_iter().filter(|file| !is_before(file)).collect())
}

/// Whether a file is one of the plan: `plan/01-functional.toml`, or the part of one.
fn is_of_plan(file: &Path) -> bool {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let number = name.split_once('-').map(|(number, _)| number);
    let is_numbered =
        number.is_some_and(|number| number.len() >= 2 && number.bytes().all(|byte| byte.is_ascii_digit()));
    file.parent() == Some(Path::new(PLAN)) && is_numbered
}

/// Whether a file is the part of one that stands in each run.
fn is_part(file: &Path) -> bool {
    let written = [JOURNAL, RECORD, LOG, DIGESTS, SIGNATURE].into_iter().chain(PAPERS);
    let parts = written.map(|name| PathBuf::from(format!("{name}.{PART}")));
    parts.into_iter().any(|part| part == *file)
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
