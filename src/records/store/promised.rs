//! What a record promises of its raw files, so that a whole file that was exchanged for another one is found before its samples are used:
//! the digests of a run that was closed, and what the journal says of the captures of any run.

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};

use super::captured::{CapturedFiles, HeldBytes};
use super::digest::FileDigests;
use super::{StoreError, chain};
use crate::raw::RawError;

/// What is promised of the raw files of a run.
#[derive(Debug)]
pub struct Promises {
    run: PathBuf,
    /// Those with which the run was closed.
    digests: Option<FileDigests>,
    /// Whether the chain says that the run was closed with other digests than these.
    are_others: bool,
    /// `None` if the journal cannot be read.
    captured: Option<CapturedFiles>,
}

impl Promises {
    /// Reads what is promised of the files of a run.
    ///
    /// # Errors
    /// The digests are there and cannot be read, or the chain of the run's day cannot be read.
    pub fn of(run: &Path) -> Result<Self, StoreError> {
        let digests = match FileDigests::read(run) {
            Ok((digests, _)) => Some(digests),
            Err(StoreError::File { source, .. }) if source.kind() == io::ErrorKind::NotFound => None,
            Err(error) => return Err(error),
        };
        let are_others = chain::was_closed_otherwise(run)?;
        Ok(Self { run: run.to_owned(), digests, are_others, captured: CapturedFiles::read(run).ok() })
    }

    /// Whether nothing is promised of any file: an earlier version wrote the run, and it is not closed.
    #[must_use]
    pub fn are_none(&self) -> bool {
        self.digests.is_none() && self.captured.as_ref().is_none_or(CapturedFiles::is_empty)
    }

    /// The raw files that are promised, by their paths relative to the folder of the run.
    pub(super) fn names(&self) -> BTreeSet<PathBuf> {
        let is_raw = |file: &PathBuf| file.extension().is_some_and(|extension| extension == "mcap");
        let covered = self.digests.clone().into_iter().flat_map(|digests| digests.into_map().into_keys());
        let captured = self.captured.iter().flat_map(CapturedFiles::names).map(PathBuf::from);
        covered.chain(captured).filter(is_raw).collect()
    }

    /// How many bytes of a file the journal names: what stands behind them in a run that is not closed is promised by nothing.
    pub(super) fn named_bytes(&self, file: &Path) -> Option<u64> {
        Some(self.captured.as_ref()?.of(&self.name(file))?.bytes())
    }

    /// Whether the run was closed, so that its digests cover whole files.
    pub(super) fn covers_whole_files(&self) -> bool {
        self.digests.is_some()
    }

    /// Why the samples of a file may not be used: it is not the one that was captured. `whole` is what was read of it, `first` what its
    /// first bytes are, as many as the journal names.
    pub(super) fn broken_by(&self, file: &Path, whole: &HeldBytes, first: Option<&HeldBytes>) -> Option<RawError> {
        let name = self.name(file);
        if self.are_others {
            return Some(RawError::OtherDigests);
        }
        if let Some(digests) = &self.digests {
            match digests.get(&name) {
                None => return Some(RawError::Added),
                Some(digest) if digest != whole.sha256 => return Some(RawError::Exchanged),
                Some(_) => {}
            }
        }
        let captured = self.captured.as_ref().filter(|captured| !captured.is_empty())?;
        match captured.of(&name) {
            Some(said) if first.is_none_or(|first| said.differs_from(first)) => Some(RawError::NotCaptured),
            // In a run that is not closed nothing covers the journal but these lines.
            _ if self.digests.is_none() && captured.has_edited_lines() => Some(RawError::EditedJournal),
            None if self.digests.is_none() => Some(RawError::Unnamed),
            Some(_) | None => None,
        }
    }

    fn name(&self, file: &Path) -> String {
        file.strip_prefix(&self.run).unwrap_or(file).to_string_lossy().into_owned()
    }
}
