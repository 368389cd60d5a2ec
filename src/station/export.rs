//! `gnc-station export RUN`: raw samples of a run as tables, for programs that do not read MCAP.

mod csv;
mod parquet;
mod place;
mod table;

use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::ValueEnum;
use gnc_analysis::capture::Capture;
use gnc_records::raw::{RawRecord, Unfinished};
use gnc_records::store::captures::{self, CapturesError};
use gnc_records::store::reader::{self, ReadError};
use gnc_records::store::{Promises, StoreError, on};
use gnc_text::{printable, with_causes};

use self::place::{Stop, Tables};
use self::table::{SampleTable, TableKind};
use crate::exit_code::ABORTED;
use crate::outputs::may_write;
use crate::progress::Progress;
use crate::records::{self, RecordsArgs};
use crate::refusal::{complain, refuse};
use crate::wording::Lines;

/// Exit code of an export without all that was asked for.
const INCOMPLETE: u8 = 3;

/// The part of `--help` about exit codes.
pub(crate) const EXIT_CODES: &str = "\
Exit codes:
  0  all raw samples of the run are exported
  2  nothing is exported
  3  raw samples are left out, and each file with its reason is named
  4  a signal ended the export, and nothing of it is left";

/// The form of an export.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// Text with commas, a row for each sample.
    Csv,
    /// Apache Parquet: the same columns with their types, less than half the size.
    Parquet,
}

impl Format {
    fn extension(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Parquet => "parquet",
        }
    }
}

/// Why nothing was exported.
#[derive(Debug, thiserror::Error)]
enum ExportError {
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("{} holds no raw samples", gnc_text::shown_path(folder))]
    Nothing { folder: PathBuf },
    #[error("{} holds no raw samples that can be exported", gnc_text::shown_path(folder))]
    NothingGood { folder: PathBuf, left_out: Vec<Doubt> },
    #[error("{} already exists", gnc_text::shown_path(path))]
    Exists { path: PathBuf },
    #[error("{} is there: an export was killed, or another one goes on", gnc_text::shown_path(path))]
    GoesOn { path: PathBuf },
    #[error("{} cannot be written", gnc_text::shown_path(path))]
    Parquet { path: PathBuf, source: ::parquet::errors::ParquetError },
    #[error("the export was interrupted, and nothing of it is left")]
    Interrupted,
}

impl ExportError {
    fn try_this(&self) -> &'static str {
        match self {
            // What is read lies in the records, what is written in the folder of --out.
            Self::Store(StoreError::File { what: "create" | "write", source, .. }) => match source.kind() {
                io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                    "free some space on the disk, or name another folder with --out"
                }
                _ => "name another folder with --out",
            },
            Self::Store(error) => error.try_this(),
            Self::Nothing { .. } => {
                "choose another run with `gnc-station records list`; only items that capture write raw samples"
            }
            Self::NothingGood { .. } => {
                "restore the run's folder from a backup; `gnc-station records verify` says what was changed"
            }
            Self::Exists { .. } => "name another folder with --out",
            Self::GoesOn { .. } => "remove that folder if no export goes on, or name another one with --out",
            Self::Parquet { .. } => "free some space on the disk, or name another folder with --out",
            Self::Interrupted => "run the same command again",
        }
    }
}

/// Writes the raw samples of a run into a folder of their own; the record itself is not touched.
pub(crate) fn run(run: &Path, within: &RecordsArgs, format: Format, out: Option<&Path>) -> ExitCode {
    let folder = match records::one(within, run) {
        Ok(folder) => folder,
        Err(refused) => return refused,
    };
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let out = out.map_or_else(|| PathBuf::from(format!("{name}-export")), Path::to_owned);
    if let Err(refused) = may_write(&out, "--out") {
        return refuse(refused.what, &refused.try_this);
    }
    let stop = Stop::watch();
    match all(&folder, &out, format, &stop) {
        Ok(Exported { doubts, left_out, lines }) => {
            let mut told = Lines::to_stdout();
            for line in lines {
                told.say(line);
            }
            doubts.into_iter().for_each(Doubt::complain);
            if left_out.is_empty() {
                return ExitCode::SUCCESS;
            }
            left_out.into_iter().for_each(Doubt::complain);
            ExitCode::from(INCOMPLETE)
        }
        Err(_) if stop.is_asked() => {
            let error = ExportError::Interrupted;
            complain(&error, error.try_this());
            ExitCode::from(ABORTED)
        }
        Err(ExportError::NothingGood { folder, left_out }) => {
            left_out.into_iter().for_each(Doubt::complain);
            let error = ExportError::NothingGood { folder, left_out: Vec::new() };
            refuse(&error, error.try_this())
        }
        Err(error) => refuse(with_causes(&error), error.try_this()),
    }
}

/// What was exported.
#[derive(Default)]
struct Exported {
    /// What the exported files lack.
    doubts: Vec<Doubt>,
    /// What was asked for and is not exported.
    left_out: Vec<Doubt>,
    /// A line for each exported file.
    lines: Vec<String>,
}

/// A warning about a file, for the user.
#[derive(Debug)]
struct Doubt {
    what: String,
    try_this: &'static str,
}

impl Doubt {
    fn complain(self) {
        complain(self.what, self.try_this);
    }

    /// A file whose end is not there: what it held behind the cut is in no table.
    fn cut_off(file: &Path, record: &RawRecord) -> Option<Self> {
        record.cut_off.then(|| Self {
            what: format!("{} was cut off; the samples before the cut are exported", gnc_text::shown_path(file)),
            try_this: "check whether these samples are enough, or run the item again",
        })
    }

    /// Samples whose file is in order as far as it goes, and that are no whole capture.
    fn unfinished(file: &Path, record: &RawRecord) -> Option<Self> {
        let Unfinished { about, samples } = record.unfinished.as_ref()?;
        Some(Self {
            what: format!(
                "{}: capture `{}` has no end, and its {samples} samples are left out",
                gnc_text::shown_path(file),
                printable(&about.label)
            ),
            try_this: "take them from the MCAP file, or run the item again",
        })
    }

    /// A run without an end by an earlier version.
    fn unproved(folder: &Path) -> Self {
        Self {
            what: format!(
                "nothing shows that the raw samples in {} are those that were captured",
                gnc_text::shown_path(folder)
            ),
            try_this: "use them only if no other person could write into that folder",
        }
    }

    fn refused(error: &CapturesError) -> Self {
        Self { what: format!("{}; they are left out", with_causes(error)), try_this: error.source.try_this() }
    }

    fn missing(file: &Path) -> Self {
        Self {
            what: format!("{} is missing, so its samples are left out", gnc_text::shown_path(file)),
            try_this: "restore the run's folder from a backup; `gnc-station records verify` says what was changed",
        }
    }
}

/// Returns what the captures of a file lack.
fn doubts(file: &Path, record: &RawRecord) -> Vec<Doubt> {
    let lossy = record.captures.iter().filter(|capture| capture.losses.any()).map(|capture| {
        let lost = u64::from(capture.losses.on_board) + u64::from(capture.losses.on_line);
        let label = printable(&capture.about.label);
        Doubt {
            what: format!(
                "{}: capture `{label}` lost {lost} samples, and the columns `number` and `t_s` do not count them",
                gnc_text::shown_path(file)
            ),
            try_this: "take the number and the time of each sample from the MCAP file, or leave the capture out",
        }
    });
    lossy.collect()
}

/// Warns of a run that a later version wrote. Raw samples have a format of their own, so they are exported as far as
/// this version can read them.
fn newer(folder: &Path) -> Option<Doubt> {
    let error = reader::fold(folder).err().filter(ReadError::is_newer)?;
    let what =
        format!("{}: {error}; its raw samples are exported as this version reads them", gnc_text::shown_path(folder));
    Some(Doubt { what, try_this: error.try_this() })
}

/// Exports every raw file that can be read.
fn all(folder: &Path, out: &Path, format: Format, stop: &Stop) -> Result<Exported, ExportError> {
    let progress = Progress::begin("raw samples are exported");
    let files = captures::files(folder)?;
    let promises = Promises::of(folder)?;
    let missing = captures::missing(folder, &promises)?;
    if files.is_empty() && missing.is_empty() {
        return Err(ExportError::Nothing { folder: folder.to_owned() });
    }
    if out.symlink_metadata().is_ok() {
        return Err(ExportError::Exists { path: out.to_owned() });
    }
    let bytes_of = |file: &PathBuf| file.metadata().map_or(0, |meta| meta.len() as usize);
    progress.total(files.iter().map(bytes_of).sum());
    let tables = Tables::create(out).map_err(|error| match Tables::part_of(out) {
        path if error.kind() == io::ErrorKind::AlreadyExists => ExportError::GoesOn { path },
        _ => StoreError::File { what: "create", path: out.to_owned(), source: error }.into(),
    })?;
    let mut done = Exported::default();
    done.left_out.extend(missing.iter().map(|file| Doubt::missing(file)));
    for file in files {
        let record = captures::read_promised(&file, &promises, |bytes| {
            progress.step(bytes);
            stop.check()
        });
        if stop.is_asked() {
            return Err(ExportError::Interrupted);
        }
        match record {
            Ok(record) => {
                done.lines.extend(tables_of(&file, &record, &tables, format, stop)?);
                done.doubts.extend(doubts(&file, &record));
                done.left_out.extend(Doubt::cut_off(&file, &record));
                done.left_out.extend(Doubt::unfinished(&file, &record));
            }
            Err(error) => done.left_out.push(Doubt::refused(&error)),
        }
    }
    if done.lines.is_empty() {
        return Err(ExportError::NothingGood { folder: folder.to_owned(), left_out: done.left_out });
    }
    done.doubts.extend(promises.are_none().then(|| Doubt::unproved(folder)));
    done.doubts.extend(newer(folder));
    on(tables.place(), "create", out)?;
    Ok(done)
}

/// Writes the tables of a raw file, and returns a line for each.
fn tables_of(
    file: &Path,
    record: &RawRecord,
    tables: &Tables,
    format: Format,
    stop: &Stop,
) -> Result<Vec<String>, ExportError> {
    let item = file.parent().and_then(Path::file_name).unwrap_or_default().to_string_lossy();
    let attempt = file.file_stem().unwrap_or_default().to_string_lossy();
    let (compensated, raw): (Vec<&Capture>, Vec<&Capture>) =
        record.captures.iter().partition(|capture| !capture.compensated.is_empty());
    let mut lines = Vec::new();
    for (captures, kind) in [(raw, TableKind::Raw), (compensated, TableKind::Compensated)] {
        if captures.is_empty() && (kind == TableKind::Compensated || !record.captures.is_empty()) {
            continue;
        }
        let name = format!("{item}-{attempt}{}.{}", kind.suffix(), format.extension());
        let path = tables.path(&name);
        let mut table = on(tables.file(&name, stop), "create", &path)?;
        let samples_of = captures.iter().map(|capture| SampleTable::of(capture, kind));
        match format {
            Format::Csv => on(csv::write(&mut table, kind, samples_of), "write", &path)?,
            Format::Parquet => parquet::write(&mut table, kind, samples_of)
                .map_err(|source| ExportError::Parquet { path: path.clone(), source })?,
        }
        on(table.sync(), "write", &path)?;
        let samples: usize = captures.iter().map(|capture| kind.samples(capture)).sum();
        lines.push(format!("{}: {} captures, {samples} samples", gnc_text::shown_path(&path), captures.len()));
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The folder of an export is named with --out, and that of the records with --records.
    #[test]
    fn a_hint_names_the_option_of_its_folder() {
        let hint = |what: &'static str, kind: io::ErrorKind| {
            ExportError::from(StoreError::File { what, path: "there".into(), source: kind.into() }).try_this()
        };
        for kind in [io::ErrorKind::PermissionDenied, io::ErrorKind::ReadOnlyFilesystem, io::ErrorKind::StorageFull] {
            for what in ["create", "write"] {
                assert!(hint(what, kind).ends_with("name another folder with --out"), "{what} {kind}");
            }
        }
        assert!(hint("write", io::ErrorKind::StorageFull).starts_with("free some space"));
        assert!(hint("read", io::ErrorKind::PermissionDenied).ends_with("--records"));
    }
}
