//! Captures of a run, read back from its folder.

use std::path::{Path, PathBuf};

use super::{StoreError, digest, item_folder, raw_file};
use crate::raw::{self, RawError, RawRecord};

/// Why captures cannot be read back.
#[derive(Debug, thiserror::Error)]
#[error("the raw samples in {} cannot be used", path.display())]
pub struct CapturesError {
    /// The file.
    pub path: PathBuf,
    /// The cause.
    pub source: RawError,
}

/// Path of the raw samples of a round of an attempt; `position` is that of the item in the plan, from 0.
#[must_use]
pub fn path(folder: &Path, position: usize, item: &str, attempt: u32, repeat: u32) -> PathBuf {
    folder.join(item_folder(position, item)).join(raw_file(attempt, repeat))
}

/// All raw files of a run, in the order of its items.
///
/// # Errors
/// The folder cannot be read.
pub fn files(folder: &Path) -> Result<Vec<PathBuf>, StoreError> {
    let files = digest::files_below(folder)?;
    let raw = files.into_iter().filter(|file| file.extension().is_some_and(|extension| extension == "mcap"));
    Ok(raw.map(|file| folder.join(file)).collect())
}

/// Reads a raw file.
///
/// # Errors
/// [`CapturesError`].
pub fn read(path: &Path) -> Result<RawRecord, CapturesError> {
    let in_words = |source| CapturesError { path: path.to_owned(), source };
    let file = gnc_files::own(path).map_err(|error| in_words(error.into()))?;
    raw::read(file).map_err(in_words)
}
