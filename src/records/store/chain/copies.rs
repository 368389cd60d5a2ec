//! Looks for copies of runs in a folder of the records folder that no station makes: a backup, an archive, a run that was saved aside.

use std::collections::VecDeque;
use std::fs;
use std::path::{Path, PathBuf};

use crate::store::{DIGESTS, JOURNAL, RECORD, reader};

/// Most files and folders that are looked at below one folder. A disk may hold anything beside the records; the copy of a shift has some
/// thousands of files, and its first run stands near the top.
pub(super) const MAX_LOOKED: usize = 20_000;

/// Levels below the folder of a day to those of its runs.
const LEVELS_OF_A_DAY: usize = 2;

/// What a folder holds.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Copies {
    /// No run.
    None,
    /// It is a run.
    Itself,
    /// Runs where those of a day stand.
    AsInADay,
    /// Runs in folders below that, and the one that was found first.
    Deeper(PathBuf),
    /// More than is looked at, and no run among what was.
    TooMany,
}

/// Looks through a folder level by level. Links are not followed, and what cannot be read holds nothing.
pub(super) fn below(folder: &Path) -> Copies {
    if is_run(folder) {
        return Copies::Itself;
    }
    let (mut looked, mut folders) = (0, VecDeque::from([(1, folder.to_owned())]));
    while let Some((level, folder)) = folders.pop_front() {
        let mut found: Vec<PathBuf> = Vec::new();
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            looked += 1;
            if looked > MAX_LOOKED {
                return Copies::TooMany;
            }
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                found.push(entry.path());
            }
        }
        found.sort();
        if level <= LEVELS_OF_A_DAY {
            if found.iter().any(|folder| reader::is_run(folder)) {
                return Copies::AsInADay;
            }
        } else if let Some(run) = found.iter().find(|folder| is_run(folder)) {
            return Copies::Deeper(run.clone());
        }
        folders.extend(found.into_iter().map(|folder| (level + 1, folder)));
    }
    Copies::None
}

/// Whether a folder holds what each run has. A list of digests alone is found in many folders.
fn is_run(folder: &Path) -> bool {
    let has = |file: &str| folder.join(file).is_file();
    has(JOURNAL) || has(RECORD) && has(DIGESTS)
}
