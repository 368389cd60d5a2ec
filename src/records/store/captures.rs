//! Captures of a run, read back from its folder.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use super::captured::{Digested, HeldBytes};
use super::unread::says_nothing;
use super::{JOURNAL, Promises, StoreError, Unread, chain, digest, item_folder, raw_file};
use crate::raw::{self, RawError, RawOrigin, RawRecord};

/// Why captures cannot be read back.
#[derive(Debug, thiserror::Error)]
#[error("the raw samples in {} cannot be used", gnc_text::shown_path(path))]
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

/// The raw files that the digests of a run promise, or its journal, and that are not among its files, in the order of its items.
///
/// # Errors
/// The folder cannot be read.
pub fn missing(folder: &Path, promises: &Promises) -> Result<Vec<PathBuf>, StoreError> {
    let there: BTreeSet<PathBuf> = digest::files_below(folder)?.into_iter().collect();
    let gone = promises.names().into_iter().filter(|file| !there.contains(file));
    Ok(gone.map(|file| folder.join(file)).collect())
}

/// Reads a raw file. One in the folder of a run must be of that run. Whether it is the one that was captured is not compared: see
/// [`read_promised`].
///
/// # Errors
/// [`CapturesError`].
pub fn read(path: &Path) -> Result<RawRecord, CapturesError> {
    let in_words = |source| CapturesError { path: path.to_owned(), source };
    let file = gnc_files::own(path).map_err(|error| in_words(error.into()))?;
    of_its_run(path, raw::read(file).map_err(in_words)?)
}

/// Reads a raw file that may lie in the folder of a run, and is then the one that was captured in it.
///
/// # Errors
/// [`CapturesError`].
pub fn read_proved(path: &Path) -> Result<RawRecord, CapturesError> {
    let Some(run) = run_of(path) else { return read(path) };
    let promises = Promises::of(run).map_err(|error| CapturesError {
        path: path.to_owned(),
        source: RawError::Io(io::Error::other(gnc_text::with_causes(&error))),
    })?;
    read_promised(path, &promises, |_| Ok(()))
}

/// Reads a raw file of a run, if it is the one that the run promises. Of one whose run is not closed nothing behind the last whole capture
/// is read. `watch` learns of each piece how many bytes it has, and ends the reading by an error.
///
/// # Errors
/// [`CapturesError`], with the error of `watch` too.
pub fn read_promised(
    path: &Path,
    promises: &Promises,
    watch: impl FnMut(usize) -> io::Result<()>,
) -> Result<RawRecord, CapturesError> {
    let in_words = |source| CapturesError { path: path.to_owned(), source };
    let file = gnc_files::own(path).map_err(|error| in_words(error.into()))?;
    let named = promises.named_bytes(path);
    let limit = named.filter(|_| !promises.covers_whole_files()).unwrap_or(u64::MAX);
    let mut source = Digested::with_first(Watched { file: file.take(limit), watch }, named);
    let record = of_its_run(path, raw::read(&mut source).map_err(in_words)?)?;
    // It may have stopped at the end of the record.
    io::copy(&mut source, &mut io::sink()).map_err(|error| in_words(error.into()))?;
    let (whole, first) = source.both();
    match promises.broken_by(path, &whole, first.as_ref()) {
        // A kill before the first whole capture leaves a file that the journal does not name.
        Some(RawError::Unnamed) if record.captures.is_empty() => Ok(record),
        Some(error) => Err(in_words(error)),
        None => Ok(record),
    }
}

/// The record of a file, unless the file is in the folder of a run of which it is not.
fn of_its_run(path: &Path, record: RawRecord) -> Result<RawRecord, CapturesError> {
    let holds_some = !record.captures.is_empty() || record.unfinished.is_some();
    match run_of(path).and_then(|run| not_of(run, record.origin.as_ref(), holds_some)) {
        None => Ok(record),
        Some(source) => Err(CapturesError { path: path.to_owned(), source }),
    }
}

/// Reads the first bytes of a raw file: its captures, and what these bytes are.
///
/// # Errors
/// The file cannot be read at all.
pub(crate) fn read_first(path: &Path, bytes: u64) -> io::Result<(Result<RawRecord, CapturesError>, HeldBytes)> {
    let mut source = Digested::new(gnc_files::own(path)?.take(bytes));
    let record = raw::read(&mut source).map_err(|source| CapturesError { path: path.to_owned(), source });
    // It may have stopped at the end of the record.
    io::copy(&mut source, &mut io::sink())?;
    Ok((record, source.held()))
}

/// A file whose reading is watched.
struct Watched<F> {
    file: io::Take<File>,
    watch: F,
}

impl<F: FnMut(usize) -> io::Result<()>> Read for Watched<F> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let bytes = self.file.read(buffer)?;
        (self.watch)(bytes)?;
        Ok(bytes)
    }
}

/// What is wrong with the raw files among these of a run, a sentence each: they are of another run.
pub(super) fn of_other_runs(run: &Path, files: &[PathBuf], unread: &mut Vec<Unread>) -> Vec<String> {
    let mut problems = Vec::new();
    let raw = files.iter().filter(|file| file.extension().is_some_and(|extension| extension == "mcap"));
    for file in raw.map(|file| run.join(file)) {
        let begin = gnc_files::own(&file).map_err(RawError::from).and_then(raw::origin);
        let error = match begin {
            Ok((origin, holds_some)) => not_of(run, origin.as_ref(), holds_some),
            Err(RawError::Io(source)) if says_nothing(&source) => {
                unread.push(Unread::new(&file, source));
                None
            }
            Err(error) => Some(error),
        };
        let name = file.strip_prefix(run).unwrap_or(&file).to_string_lossy().into_owned();
        problems.extend(error.map(|error| format!("{name}: {}", gnc_text::with_causes(&error))));
    }
    problems
}

/// The folder of the run in which a raw file is; `None` if it is elsewhere.
fn run_of(raw: &Path) -> Option<&Path> {
    let run = raw.parent()?.parent()?;
    run.join(JOURNAL).symlink_metadata().is_ok().then_some(run)
}

/// Why a raw file is not one of a run. A run whose beginning the chain does not have is from a version whose files do not say it.
fn not_of(run: &Path, origin: Option<&RawOrigin>, holds_some: bool) -> Option<RawError> {
    match origin {
        Some(origin) => {
            let digest = chain::digest_of_first_line(run).ok()?;
            let RawOrigin { plan, serial_number, started, journal_sha256, .. } = origin;
            let [plan, serial_number, started] =
                [plan, serial_number, started].map(|text| gnc_text::printable(text).into_owned());
            (*journal_sha256 != digest).then(|| RawError::OtherRun { plan, serial_number, started })
        }
        None if holds_some && chain::place_of(run).is_ok_and(|place| place.is_some()) => Some(RawError::NoRun),
        None => None,
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::io::Cursor;

    use gnc_analysis::capture::{CaptureHead, HostView, Pose};
    use gnc_protocol::stream::Losses;

    use super::*;
    use crate::raw::{Piece, RawWriter};
    use crate::store::chain::{Scribe, begin};

    fn of_other_runs(run: &Path) -> Vec<String> {
        super::of_other_runs(run, &digest::files_below(run).unwrap(), &mut Vec::new())
    }

    /// A file with one empty capture.
    fn file(origin: Option<&RawOrigin>) -> Vec<u8> {
        let mut out = RawWriter::new(Cursor::new(Vec::new()), origin).unwrap();
        let pose = Pose::Still { up: [0.0, 0.0, 1.0], heading_deg: 0.0 };
        let about = CaptureHead { label: "Z up".into(), series: 0, pose, rate_hz: 100 };
        out.write(Piece::Begin { about, board_time_us: 0 }).unwrap();
        let (losses, host) = (Losses::default(), HostView::Nothing("short".into()));
        out.write(Piece::End { losses, host, board_time_us: 9 }).unwrap();
        out.finish().unwrap().into_inner()
    }

    /// A folder of a good module's run whose name is replaced everywhere by that of a bad one.
    #[test]
    fn a_capture_is_of_its_run_alone() {
        let records = tempfile::tempdir().unwrap();
        let run = records.path().join("2026-11-28/GOOD/120000-calibration");
        let raw = path(&run, 0, "imu", 1, 1);
        fs::create_dir_all(raw.parent().unwrap()).unwrap();
        let journal =
            |module: &str| fs::write(run.join(JOURNAL), format!("{{\"module\":\"{module}\"}}\nmore\n")).unwrap();
        journal("GOOD");
        let sha256 = digest::of_bytes(b"{\"module\":\"GOOD\"}\n");
        let origin = RawOrigin {
            serial_number: "GOOD".into(),
            plan: "calibration".into(),
            journal_sha256: sha256,
            ..RawOrigin::default()
        };
        fs::write(&raw, file(Some(&origin))).unwrap();
        assert_eq!(read(&raw).unwrap().origin.as_ref(), Some(&origin));
        assert_eq!(of_other_runs(&run), Vec::<String>::new());

        journal("EVIL");
        let named = RawOrigin { serial_number: "EVIL".into(), ..origin.clone() };
        for origin in [&origin, &named] {
            fs::write(&raw, file(Some(origin))).unwrap();
            assert!(matches!(read(&raw).unwrap_err().source, RawError::OtherRun { .. }));
            let said = format!(
                "01-imu/attempt-1.mcap: it is of another run: calibration of {}, begun at ",
                origin.serial_number
            );
            assert_eq!(of_other_runs(&run), [said]);
        }
        // On its own the same file can be read: no run contradicts it.
        let alone = records.path().join("alone.mcap");
        fs::copy(&raw, &alone).unwrap();
        assert!(read(&alone).is_ok());

        // Without the name it may be of an earlier version, unless the chain knows when the run began.
        fs::write(&raw, file(None)).unwrap();
        assert!(read(&raw).is_ok() && of_other_runs(&run).is_empty());
        let at = chrono::DateTime::UNIX_EPOCH.fixed_offset();
        begin(&run, &Scribe { station: "bench", at, key: None, late: None }).unwrap();
        assert!(matches!(read(&raw).unwrap_err().source, RawError::NoRun));
        assert_eq!(of_other_runs(&run).len(), 1);
        // A kill within the head of the file leaves nothing to name.
        let head = RawWriter::new(Cursor::new(Vec::new()), None).unwrap().finish().unwrap().into_inner();
        fs::write(&raw, head).unwrap();
        assert!(read(&raw).is_ok() && of_other_runs(&run).is_empty());
    }
}
