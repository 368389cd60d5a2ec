//! `gnc-station compute METHOD FILE`: the mathematics of the station for any record.
//!
//! A result goes to standard output, as a table or with `--json` as one JSON object. Exit code 0; 1 when the method
//! refuses the record, with the reason; 2 when the command line or the file cannot be read, with line and column.

mod allan;
#[cfg(fuzzing)]
pub mod fuzzing;
mod gate;
mod magnetometer;
mod record;
mod repeatability;
mod report;
mod scale_factor;
mod spectrum;
mod table;
#[cfg(test)]
mod tests;
mod tilt;
mod triad;
mod zero_bias;

use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args as ClapArgs, Subcommand};
use gnc_metrology::Refusal;
use gnc_plot::Panel;
use gnc_text::{printable, printable_lines};
use thiserror::Error;

use crate::exit_code::USAGE;
use crate::locale::Environment;
use crate::outputs::may_write;
use crate::phrases::in_language;
use crate::progress::Progress;
use crate::refusal::refuse;
use crate::wording::Lines;
use report::FigureReport;
use table::{ReadingOptions, TableError};

/// Arguments of `compute`.
#[derive(Debug, ClapArgs)]
pub(crate) struct Args {
    #[command(subcommand)]
    method: Method,
    /// Print one JSON object instead of a table
    #[arg(long, global = true)]
    json: bool,
    #[command(flatten)]
    reading: ReadingOptions,
    /// Also draw the result into this SVG file
    #[arg(long, global = true, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

/// What to compute.
#[derive(Debug, Subcommand)]
enum Method {
    /// Accelerometer calibration from six positions or any known attitudes
    SixPosition(triad::SixPosition),
    /// Gyroscope bias and g-sensitivity from still positions
    GyroStill(triad::GyroStillArgs),
    /// Gyroscope scale factor from rotations by a known angle
    Rotation(triad::Rotation),
    /// Two-axis magnetometer turned in its plane: ellipse and correction
    Ellipse(magnetometer::EllipseArgs),
    /// Three-axis magnetometer over many attitudes: hard and soft iron
    Ellipsoid(magnetometer::EllipsoidArgs),
    /// Allan deviation family with intervals and noise coefficients
    Allan(allan::AllanArgs),
    /// Power spectral density after Welch
    Psd(spectrum::PsdArgs),
    /// Spread of the means of disjoint blocks
    Stability(spectrum::StabilityArgs),
    /// Scale factor, nonlinearity and asymmetry from the output at many rates of both senses
    ScaleFactor(scale_factor::ScaleFactorArgs),
    /// Spread of a figure over repeated runs
    Repeatability(repeatability::RepeatabilityArgs),
    /// Accelerometer offset and gain from a flip between +1 g and -1 g
    Flip(tilt::FlipArgs),
    /// Accelerometer offset over temperature from three points
    TiltTemperature(tilt::TiltTemperature),
    /// Tilt accuracy from a budget of contributions
    TiltBudget(tilt::TiltBudget),
    /// Elimination of a gyroscope's bias over power cycles, before and after
    ZeroBias(zero_bias::ZeroBias),
}

/// A result and its picture.
struct ComputeOutcome {
    report: FigureReport,
    panels: Vec<Panel>,
}

#[derive(Debug, Error)]
enum ComputeError {
    #[error(transparent)]
    Refused(#[from] Refusal),
    #[error(transparent)]
    Unreadable(TableError),
    #[error(transparent)]
    Record(#[from] record::RecordError),
    #[error("{0}")]
    Usage(String),
    #[error(transparent)]
    File(#[from] gnc_config::Mistakes),
    #[error("{path}: cannot be written")]
    Write { path: PathBuf, source: std::io::Error },
}

impl ComputeError {
    /// What the user can try, if the error itself does not show it.
    fn try_this(&self) -> Option<&'static str> {
        match self {
            Self::Unreadable(error) => error.try_this(),
            Self::Record(record::RecordError::Captures(error)) => Some(error.source.try_this()),
            Self::Write { source, .. } => Some(match source.kind() {
                ErrorKind::StorageFull | ErrorKind::QuotaExceeded => "make room on the disk and run again",
                _ => "name a file in a folder that exists and that this user may write to",
            }),
            _ => None,
        }
    }
}

impl From<TableError> for ComputeError {
    fn from(error: TableError) -> Self {
        match error {
            TableError::Refused(refusal) => Self::Refused(refusal),
            other => Self::Unreadable(other),
        }
    }
}

impl Args {
    /// Runs the method, and returns its name and its outcome.
    fn outcome(&self) -> (&'static str, Result<ComputeOutcome, ComputeError>) {
        match &self.method {
            Method::SixPosition(m) => ("six-position", m.compute(&self.reading)),
            Method::GyroStill(m) => ("gyro-still", m.compute(&self.reading)),
            Method::Rotation(m) => ("rotation", m.compute(&self.reading)),
            Method::Ellipse(m) => ("ellipse", m.compute(&self.reading)),
            Method::Ellipsoid(m) => ("ellipsoid", m.compute(&self.reading)),
            Method::Allan(m) => ("allan", m.compute(&self.reading)),
            Method::Psd(m) => ("psd", m.compute(&self.reading)),
            Method::Stability(m) => ("stability", m.compute(&self.reading)),
            Method::ScaleFactor(m) => ("scale-factor", m.compute(&self.reading)),
            Method::Repeatability(m) => ("repeatability", m.compute(&self.reading)),
            Method::Flip(m) => ("flip", m.compute(&self.reading)),
            Method::TiltTemperature(m) => ("tilt-temperature", m.compute(&self.reading)),
            Method::TiltBudget(m) => ("tilt-budget", m.compute()),
            Method::ZeroBias(m) => ("zero-bias", m.compute(&self.reading)),
        }
    }
}

/// Computes, prints and returns the exit code of the process.
#[must_use]
pub(crate) fn run(args: &Args) -> ExitCode {
    if let Some(Err(refused)) = args.plot.as_deref().map(|path| may_write(path, "--plot")) {
        return refuse(refused.what, &refused.try_this);
    }
    let progress = Progress::begin("the record is read and worked out");
    let (name, outcome) = args.outcome();
    drop(progress);
    let outcome = outcome.and_then(|mut outcome| {
        if let Some(path) = &args.plot {
            write(path, &gnc_plot::svg(&with_printable_texts(std::mem::take(&mut outcome.panels))))?;
        }
        Ok(outcome)
    });
    match outcome {
        Ok(outcome) if args.json => {
            print_json(&outcome.report.json());
            ExitCode::SUCCESS
        }
        Ok(outcome) => {
            let mut out = Lines::to_stdout();
            let lang = out.wording.lang();
            // A reader that has seen enough is no error.
            let _ = out.write_as_it_is(&harmless(&outcome.report.table(lang)));
            ExitCode::SUCCESS
        }
        Err(ComputeError::Refused(refusal)) => {
            if args.json {
                print_json(&report::refusal_json(name, &refusal));
            }
            let (what, hint) = (refusal.to_string(), refusal.hint());
            complain(&format!("{name} refused: {}\n  try: {}\n", printable(&what), printable(hint)));
            ExitCode::from(1)
        }
        Err(error) => {
            let hint = error.try_this().map(|hint| format!("  try: {hint}\n")).unwrap_or_default();
            let what = gnc_text::with_causes(&error);
            // Mistakes of a file that a person wrote have lines of their own. All else is one line, whatever a column is called.
            let what = if matches!(error, ComputeError::File(_)) { what } else { printable(&what).into_owned() };
            complain(&format!("{what}\n{hint}"));
            ExitCode::from(USAGE)
        }
    }
}

fn write(path: &Path, text: &str) -> Result<(), ComputeError> {
    gnc_files::put(path, text.as_bytes()).map_err(|source| ComputeError::Write { path: path.to_owned(), source })
}

/// Prints for programs. A reader that closed the pipe (`| head`) is not an error.
fn print_json(text: &str) {
    let _ = std::io::stdout().lock().write_all(text.as_bytes());
}

/// Escapes what a line must not hold, because names of columns come from the file. Line ends in such a name are escaped where
/// it is put into its line.
fn harmless(text: &str) -> String {
    printable_lines(text).into_owned()
}

/// Names of columns stand in pictures too.
fn with_printable_texts(panels: Vec<Panel>) -> Vec<Panel> {
    panels.into_iter().map(|panel| panel.with_texts(|text| printable(text).into_owned())).collect()
}

/// An error for people, on standard error, in the language of the locale.
fn complain(text: &str) {
    let lang = Environment::read().language(None);
    let mut out = std::io::stderr().lock();
    for line in harmless(text).lines() {
        // Without standard error there is no other place for the message.
        let _ = writeln!(out, "{}", in_language(line, lang));
    }
}
