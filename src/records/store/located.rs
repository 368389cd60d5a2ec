//! Where the folder of a run lies, however a person names it: its day, its records folder and its name in the chain come from this path.

use std::io;
use std::path::{Component, Path, PathBuf};

use super::chain::{CHAIN, COUNTER};
use super::reader;

/// The path of a run below its records folder, without links and `..` on the way there. A link that stands among records in the place of
/// a day, a module or a run stays in the path: no station writes one, and the chain does not name what it leads to. Of a run that is not
/// there the names count, and who reads it gets the error.
///
/// # Errors
/// The path is empty, or the current folder is gone.
pub fn located(run: &Path) -> io::Result<PathBuf> {
    let named = without_parents(&std::path::absolute(run)?);
    let mut above = named.ancestors().skip(2);
    if let (Some(day), Some(records)) = (above.next(), above.next())
        && let Ok(below) = named.strip_prefix(records)
    {
        let records = real(records);
        if reader::is_day(day) && are_records(&records) {
            return Ok(records.join(below));
        }
    }
    Ok(real(&named))
}

/// The path without links; itself, if it leads nowhere.
fn real(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

/// The path without `..`, and without links before the last of them.
fn without_parents(whole: &Path) -> PathBuf {
    let parts: Vec<Component<'_>> = whole.components().collect();
    let Some(last) = parts.iter().rposition(|part| *part == Component::ParentDir) else { return whole.to_owned() };
    let (before, behind) = parts.split_at(last + 1);
    let mut named = real(&before.iter().collect::<PathBuf>());
    named.extend(behind);
    named
}

/// Whether a station files runs with a chain below a folder. A link to a day makes it no records folder.
pub(super) fn are_records(folder: &Path) -> bool {
    if folder.join(COUNTER).symlink_metadata().is_ok() {
        return true;
    }
    let entries = folder.read_dir().into_iter().flatten().flatten();
    let days = entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()));
    days.map(|entry| entry.path()).any(|day| reader::is_day(&day) && has_chain(&day))
}

pub(super) fn has_chain(day: &Path) -> bool {
    day.join(CHAIN).symlink_metadata().is_ok()
}
