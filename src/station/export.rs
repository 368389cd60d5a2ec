//! `gnc-station export RUN`: raw samples of a run as tables, for programs that do not read MCAP.

mod csv;
mod parquet;
mod table;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::ValueEnum;
use gnc_analysis::capture::Capture;
use gnc_records::raw::RawRecord;
use gnc_records::store::captures::{self, CapturesError};
use gnc_records::store::reader::{self, ReadError};
use gnc_records::store::{StoreError, on};
use gnc_text::{printable, with_causes};

use self::table::{SampleTable, TableKind};
use crate::records::{self, RecordsArgs};
use crate::refusal::{complain, refuse};
use crate::wording::Lines;

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
    Captures(#[from] CapturesError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("{} holds no raw samples", gnc_text::shown_path(folder))]
    Nothing { folder: PathBuf },
    #[error("{} already exists", gnc_text::shown_path(path))]
    Exists { path: PathBuf },
    #[error("{} cannot be written", gnc_text::shown_path(path))]
    Parquet { path: PathBuf, source: ::parquet::errors::ParquetError },
}

impl ExportError {
    fn try_this(&self) -> &'static str {
        match self {
            Self::Captures(error) => error.source.try_this(),
            Self::Store(error) => error.try_this(),
            Self::Nothing { .. } => {
                "choose another run with `gnc-station records list`; only items that capture write raw samples"
            }
            Self::Exists { .. } => "name another folder with --out",
            Self::Parquet { .. } => "free some space on the disk, or name another folder with --out",
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
    match all(&folder, &out, format) {
        Ok(doubts) => {
            for Doubt { what, try_this } in doubts {
                complain(what, try_this);
            }
            ExitCode::SUCCESS
        }
        Err(error) => refuse(with_causes(&error), error.try_this()),
    }
}

/// A warning about an exported file, for the user.
struct Doubt {
    what: String,
    try_this: &'static str,
}

/// Returns what a file and its captures lack.
fn doubts(file: &Path, record: &RawRecord) -> Vec<Doubt> {
    let cut_off = record.cut_off.then(|| Doubt {
        what: format!("{} was cut off; the samples before the cut are exported", gnc_text::shown_path(file)),
        try_this: "check whether these samples are enough, or run the item again",
    });
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
    cut_off.into_iter().chain(lossy).collect()
}

/// Warns of a run that a later version wrote. Raw samples have a format of their own, so they are exported as far as
/// this version can read them.
fn newer(folder: &Path) -> Option<Doubt> {
    let error = reader::fold(folder).err().filter(ReadError::is_newer)?;
    let what =
        format!("{}: {error}; its raw samples are exported as this version reads them", gnc_text::shown_path(folder));
    Some(Doubt { what, try_this: error.try_this() })
}

/// Exports every raw file, and returns the warnings about them.
fn all(folder: &Path, out: &Path, format: Format) -> Result<Vec<Doubt>, ExportError> {
    let files = captures::files(folder)?;
    if files.is_empty() {
        return Err(ExportError::Nothing { folder: folder.to_owned() });
    }
    if out.exists() {
        return Err(ExportError::Exists { path: out.to_owned() });
    }
    on(fs::create_dir_all(out), "create", out)?;
    let mut found: Vec<Doubt> = newer(folder).into_iter().collect();
    let mut told = Lines::to_stdout();
    for file in files {
        let record = captures::read(&file)?;
        let item = file.parent().and_then(Path::file_name).unwrap_or_default().to_string_lossy();
        let attempt = file.file_stem().unwrap_or_default().to_string_lossy();
        let (compensated, raw): (Vec<&Capture>, Vec<&Capture>) =
            record.captures.iter().partition(|capture| !capture.compensated.is_empty());
        for (captures, kind) in [(raw, TableKind::Raw), (compensated, TableKind::Compensated)] {
            if captures.is_empty() && (kind == TableKind::Compensated || !record.captures.is_empty()) {
                continue;
            }
            let path = out.join(format!("{item}-{attempt}{}.{}", kind.suffix(), format.extension()));
            let file = on(gnc_files::create_new(&path), "create", &path)?;
            let tables = captures.iter().map(|capture| SampleTable::of(capture, kind));
            match format {
                Format::Csv => on(csv::write(file, kind, tables), "write", &path)?,
                Format::Parquet => parquet::write(file, kind, tables)
                    .map_err(|source| ExportError::Parquet { path: path.clone(), source })?,
            }
            let samples: usize = captures.iter().map(|capture| kind.samples(capture)).sum();
            told.say(format_args!("{}: {} captures, {samples} samples", gnc_text::shown_path(&path), captures.len()));
        }
        found.extend(doubts(&file, &record));
    }
    Ok(found)
}
