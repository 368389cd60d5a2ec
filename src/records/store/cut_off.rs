//! Completes raw files that a kill left without an end. The end is written before the run is sealed, so that every
//! program can read them and the digests cover what it reads.
//!
//! No filed data is lost. The content before the end is the original byte for byte, a torn record behind it is kept in
//! a separate file, and `cut-off.json` has length and digest of the original file. `cut-off.json` is on disk before the
//! first file is changed, and each file is changed in one step. So after a kill at any moment, the next start comes to
//! the same result.

use std::fs::{self, File};
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::Path;

use gnc_text::{printable, with_causes};
use serde::{Deserialize, Serialize};

use super::{RunFolder, StoreError, captures, closing, digest, on};
use crate::raw::{self, RawError, Survey};

/// The file in the run's folder that says what was done.
pub(super) const CUT_OFF: &str = "cut-off.json";
/// Name ending of a file that holds a torn record.
const TORN: &str = "torn";
/// Longest report: a line for each raw file of a run.
const MAX_REPORT_BYTES: u64 = 64 << 20;
const SCHEMA: &str = "gnc-station/cut-off/1";

/// The raw files of a run that had no end when the run was sealed.
#[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct CutOffReport {
    schema: String,
    pub(super) files: Vec<CutOffFile>,
}

/// A raw file that had no end.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct CutOffFile {
    /// Path relative to the run's folder.
    pub(super) file: String,
    /// Its length as the station left it.
    pub(super) original_bytes: u64,
    /// Its SHA-256 as the station left it.
    pub(super) original_sha256: String,
    /// Number of bytes from the beginning that stay before the new end.
    kept_bytes: u64,
    /// File with the other bytes, relative to the run's folder.
    torn: Option<String>,
    /// Why the file was left as it is: it is damaged and not only cut off.
    damaged: Option<String>,
}

impl CutOffFile {
    /// The file with what stood behind its last whole record, relative to the run's folder.
    pub(super) fn torn(&self) -> Option<&str> {
        self.torn.as_deref()
    }

    /// The short text that the next start prints.
    pub(super) fn in_short(&self) -> String {
        let now = if self.damaged.is_some() { "is damaged and stays as it was" } else { "has its end now" };
        format!("{} was cut off and {now}", printable(&self.file))
    }

    /// A sentence for people.
    pub(super) fn in_words(&self) -> String {
        let Self { file, original_bytes, original_sha256, kept_bytes, torn, damaged } = self;
        let was = format!("{} was cut off after {original_bytes} bytes (SHA-256 {original_sha256})", printable(file));
        match (damaged, torn) {
            (Some(damaged), _) => format!("{was} and is left as it was: {}", printable(damaged)),
            (None, Some(torn)) => format!(
                "{was}; its end was written when the run was sealed, behind byte {kept_bytes}; what stood there, a record \
                 in pieces, is in {}",
                printable(torn)
            ),
            (None, None) => format!("{was}; its end was written when the run was sealed"),
        }
    }
}

/// Writes the missing ends. No other program writes in the folder.
///
/// # Errors
/// [`StoreError::File`].
pub(super) fn complete(folder: &RunFolder) -> Result<CutOffReport, StoreError> {
    let path = folder.path();
    let report = match told(path)? {
        Some(report) => report,
        None => look(folder)?,
    };
    for found in report.files.iter().filter(|found| found.damaged.is_none()) {
        end(folder, found)?;
    }
    Ok(report)
}

/// The report that an earlier start filed.
fn told(run: &Path) -> Result<Option<CutOffReport>, StoreError> {
    let path = run.join(CUT_OFF);
    match gnc_files::read_below(run, Path::new(CUT_OFF), MAX_REPORT_BYTES) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        read => {
            let bytes = on(read, "read", &path)?;
            on(serde_json::from_slice(&bytes).map_err(io::Error::from), "read", &path).map(Some)
        }
    }
}

/// Surveys the files, saves what will be cut off, and files what will be done.
fn look(folder: &RunFolder) -> Result<CutOffReport, StoreError> {
    let mut report = CutOffReport { schema: SCHEMA.to_owned(), files: Vec::new() };
    for path in captures::files(folder.path())? {
        let file = path.strip_prefix(folder.path()).unwrap_or(&path).to_string_lossy().into_owned();
        let survey = match survey(&path) {
            Ok(None) => continue,
            Err(RawError::Io(source)) => return on(Err(source), "read", &path),
            found => found,
        };
        // The data behind the promise must survive a power cut.
        on(gnc_files::own(&path).and_then(|file| file.sync_all()), "write", &path)?;
        let original_bytes = on(fs::metadata(&path), "read", &path)?.len();
        let original_sha256 = digest::of_file(&path)?;
        let (kept_bytes, damaged) = match survey {
            Ok(survey) => (survey.map_or(0, |survey| survey.kept_bytes()), None),
            Err(error) => (original_bytes, Some(with_causes(&error))),
        };
        let torn = (kept_bytes < original_bytes).then(|| format!("{file}.{TORN}"));
        if let Some(torn) = &torn {
            let mut source = on(gnc_files::own(&path), "read", &path)?;
            on(source.seek(SeekFrom::Start(kept_bytes)), "read", &path)?;
            folder.put_synced(torn, |out| io::copy(&mut source, out).map(drop))?;
        }
        report.files.push(CutOffFile { file, original_bytes, original_sha256, kept_bytes, torn, damaged });
    }
    if !report.files.is_empty() {
        folder.put_synced(CUT_OFF, |out| closing::pretty(out, &report))?;
    }
    Ok(report)
}

/// Puts the end behind the bytes that stay, unless it is already there.
fn end(folder: &RunFolder, found: &CutOffFile) -> Result<(), StoreError> {
    let path = folder.path().join(&found.file);
    let other = || on(Err(io::Error::other("it is not the file that was looked at")), "end", &path);
    // The report of an earlier start may have been changed since.
    if !captures::files(folder.path())?.contains(&path) {
        return other();
    }
    let survey = match survey(&path) {
        Ok(None) => return Ok(()),
        Ok(Some(survey)) => survey,
        Err(error) => return on(Err(io::Error::other(error)), "end", &path),
    };
    if survey.kept_bytes() != found.kept_bytes || digest::of_file(&path)? != found.original_sha256 {
        return other();
    }
    let was = raw::CutOff { original_bytes: found.original_bytes, original_sha256: found.original_sha256.clone() };
    let end = on(survey.end(&was).map_err(io::Error::other), "end", &path)?;
    let mut source = on(gnc_files::own(&path), "read", &path)?.take(found.kept_bytes);
    folder.put_synced(&found.file, |out| {
        io::copy(&mut source, out)?;
        out.write_all(&end)
    })
}

/// Surveys a file; `None` if the file has an end. After a power failure a file may be longer than what was written:
/// zeros at the end do not belong to it.
fn survey(path: &Path) -> Result<Option<Survey>, RawError> {
    let found = Survey::of(gnc_files::own(path)?);
    let Err(RawError::Damaged { .. }) = found else { return found };
    let mut file = gnc_files::own(path)?;
    let written = without_zeros(&mut file)?;
    if written == file.metadata()?.len() {
        return found;
    }
    file.rewind()?;
    Survey::of(file.take(written))
}

/// The length without zeros at the end.
fn without_zeros(file: &mut File) -> io::Result<u64> {
    let mut end = file.metadata()?.len();
    let mut piece = [0; 1 << 16];
    while end > 0 {
        let begin = end.saturating_sub(piece.len() as u64);
        let length = usize::try_from(end - begin).unwrap_or(piece.len());
        file.seek(SeekFrom::Start(begin))?;
        file.read_exact(&mut piece[..length])?;
        if let Some(last) = piece[..length].iter().rposition(|byte| *byte != 0) {
            return Ok(begin + last as u64 + 1);
        }
        end = begin;
    }
    Ok(0)
}

#[cfg(test)]
mod tests;
