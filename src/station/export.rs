//! `gnc-station export RUN`: raw samples of a run as text, for programs that read nothing else.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::ValueEnum;
use gnc_protocol::calibration::{FIELD_PER_GAUSS, FORCE_PER_MPS2, RATE_PER_RPS, ROLL_PER_RAD};

use crate::capture::{Capture, Pose};
use crate::cli::{complain, refuse};
use crate::records;
use crate::runner::chain;
use crate::store::captures::{self, CapturesError};
use crate::store::{StoreError, on};

/// The form of an export.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// One file for each raw file: a row for each sample, raw counts.
    Csv,
}

/// Columns that say which sample a row is.
const PLACE: &str = "capture,series,position,run,number,t_s";
/// Columns of a raw sample: counts.
const RAW: &str =
    "gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z,mag_x,mag_y,mag_z,gyro_temperature_degc,accel_temperature_degc";
/// Columns of a sample that the board compensated.
const COMPENSATED: &str = "rate_x_rps,rate_y_rps,rate_z_rps,force_x_mps2,force_y_mps2,force_z_mps2,\
                           field_x_gauss,field_y_gauss,field_z_gauss,roll_rad,saturated,\
                           gyro_temperature_degc,accel_temperature_degc";

/// Why nothing was exported.
#[derive(Debug, thiserror::Error)]
enum ExportError {
    #[error(transparent)]
    Captures(#[from] CapturesError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("{} holds no raw samples", folder.display())]
    Nothing { folder: PathBuf },
    #[error("{} is there already", path.display())]
    Exists { path: PathBuf },
}

impl ExportError {
    fn try_this(&self) -> &'static str {
        match self {
            Self::Captures(error) => error.source.try_this(),
            Self::Store(error) => error.try_this(),
            Self::Nothing { .. } => {
                "`gnc-station records list` shows the runs; only items that capture leave raw samples"
            }
            Self::Exists { .. } => "name another folder with --out",
        }
    }
}

/// Writes the raw samples of a run into a folder of their own; the record itself is not touched.
pub(crate) fn run(run: &Path, folder: &Path, format: Format, out: Option<&Path>) -> ExitCode {
    let folder = match records::one(folder, run) {
        Ok(folder) => folder,
        Err(refused) => return refused,
    };
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let out = out.map_or_else(|| PathBuf::from(format!("{name}-export")), Path::to_owned);
    match format {
        Format::Csv => match all(&folder, &out) {
            Ok(cut_off) => {
                for path in cut_off {
                    let try_this = "what stands before the end is exported";
                    complain(format_args!("{} was cut off", path.display()), try_this);
                }
                ExitCode::SUCCESS
            }
            Err(error) => refuse(chain(&error), error.try_this()),
        },
    }
}

/// Exports every raw file; gives those that have no end.
fn all(folder: &Path, out: &Path) -> Result<Vec<PathBuf>, ExportError> {
    let files = captures::files(folder)?;
    if files.is_empty() {
        return Err(ExportError::Nothing { folder: folder.to_owned() });
    }
    if out.exists() {
        return Err(ExportError::Exists { path: out.to_owned() });
    }
    on(fs::create_dir_all(out), "create", out)?;
    let mut cut_off = Vec::new();
    let mut told = io::stdout().lock();
    for file in files {
        let record = captures::read(&file)?;
        let item = file.parent().and_then(Path::file_name).unwrap_or_default().to_string_lossy();
        let attempt = file.file_stem().unwrap_or_default().to_string_lossy();
        let (compensated, raw): (Vec<&Capture>, Vec<&Capture>) =
            record.captures.iter().partition(|capture| !capture.compensated.is_empty());
        for (captures, kind) in [(raw, Kind::Raw), (compensated, Kind::Compensated)] {
            if captures.is_empty() && (kind == Kind::Compensated || !record.captures.is_empty()) {
                continue;
            }
            let path = out.join(format!("{item}-{attempt}{}.csv", kind.suffix()));
            let mut csv = BufWriter::new(on(File::create(&path), "create", &path)?);
            on(kind.write(&mut csv, &captures).and_then(|()| csv.flush()), "write", &path)?;
            let samples: usize = captures.iter().map(|capture| capture.samples.len() + capture.compensated.len()).sum();
            let _ = writeln!(told, "{}: {} captures, {samples} samples", path.display(), captures.len());
        }
        if record.cut_off {
            cut_off.push(file);
        }
    }
    Ok(cut_off)
}

/// What a table holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Raw,
    Compensated,
}

impl Kind {
    fn suffix(self) -> &'static str {
        match self {
            Self::Raw => "",
            Self::Compensated => "-compensated",
        }
    }

    fn write(self, out: &mut impl Write, captures: &[&Capture]) -> io::Result<()> {
        writeln!(out, "{PLACE},{}", if self == Self::Raw { RAW } else { COMPENSATED })?;
        for capture in captures {
            let (position, run) = labels(capture);
            let about = &capture.about;
            let place = Place {
                capture: format!("{},{},{position},{run}", quoted(&about.label), about.series),
                rate_hz: about.rate_hz,
            };
            match self {
                Self::Raw => {
                    for (number, sample) in (0u64..).zip(&capture.samples) {
                        place.write(out, number)?;
                        for count in sample.gyro.iter().chain(&sample.accel).chain(&sample.mag) {
                            write!(out, ",{count}")?;
                        }
                        temperatures(out, sample.gyro_temperature, sample.accel_temperature)?;
                    }
                }
                Self::Compensated => {
                    for (number, sample) in (0u64..).zip(&capture.compensated) {
                        place.write(out, number)?;
                        let scaled = [
                            (&sample.rate[..], RATE_PER_RPS),
                            (&sample.force, FORCE_PER_MPS2),
                            (&sample.field, FIELD_PER_GAUSS),
                            (&[sample.roll], ROLL_PER_RAD),
                        ];
                        for (count, scale) in scaled.iter().flat_map(|(counts, scale)| counts.iter().zip([scale; 3])) {
                            write!(out, ",{}", f64::from(*count) / scale)?;
                        }
                        write!(out, ",{}", sample.saturated)?;
                        temperatures(out, sample.gyro_temperature, sample.accel_temperature)?;
                    }
                }
            }
        }
        Ok(())
    }
}

/// Which sample a row is.
struct Place {
    /// The columns that all samples of a capture share.
    capture: String,
    rate_hz: u16,
}

impl Place {
    fn write(&self, out: &mut impl Write, number: u64) -> io::Result<()> {
        // As exact as the board's own microseconds.
        let us = number * 1_000_000 / u64::from(self.rate_hz.max(1));
        write!(out, "{},{number},{}.{:06}", self.capture, us / 1_000_000, us % 1_000_000)
    }
}

fn temperatures(out: &mut impl Write, gyro: i16, accel: i16) -> io::Result<()> {
    let [gyro, accel] = [gyro, accel].map(|value| f64::from(value) / 100.0);
    writeln!(out, ",{gyro},{accel}")
}

/// `position` (the axis that is up) and `run` (axis and sense of a turn), as `compute` calls them; empty where the
/// capture is none of the two.
pub(crate) fn labels(capture: &Capture) -> (String, String) {
    let name =
        |axis: usize, positive: bool| format!("{}{}", ["x", "y", "z"][axis % 3], if positive { '+' } else { '-' });
    match &capture.about.pose {
        Pose::Still { up, .. } => {
            let axis = up.iter().position(|part| part.abs() == 1.0);
            (axis.map(|axis| name(axis, up[axis] > 0.0)).unwrap_or_default(), String::new())
        }
        Pose::Rotating { axis, angle_deg, .. } => (String::new(), name(usize::from(*axis), *angle_deg > 0.0)),
        Pose::Spinning { .. } => (String::new(), String::new()),
    }
}

/// A text from outside as a field.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\"").replace(char::is_control, " "))
}
