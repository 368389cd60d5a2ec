//! A record to compute with: a table (text, Parquet, numpy), or raw captures of this station. `FILE.mcap` stands for
//! all captures of a file, `FILE.mcap#LABEL` for one of them, as `FILE.csv#LABEL` does for an export.
//!
//! Raw captures have the columns `gyro_x` to `mag_z` in counts, and `x`, `y`, `z` of the triad that the method is
//! about. `position` and `run` come from how the module lay or turned, `ux`, `uy`, `uz` from the direction that pointed
//! up.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use gnc_analysis::capture::{Capture, Pose};
use gnc_records::store::captures::{self, CapturesError};
use thiserror::Error;

use super::ComputeError;
use super::table::{About, Columns, ReadingOptions, RecordClock, RecordTable, Wanted};

/// Three sensors of one kind, whose outputs are `x`, `y`, `z`.
#[derive(Debug, Clone, Copy)]
pub(super) enum OutputTriad {
    Gyro,
    Accel,
    Mag,
}

/// Why captures are unfit for a method.
#[derive(Debug, Error)]
pub(super) enum RecordError {
    #[error(transparent)]
    Captures(#[from] CapturesError),
    #[error("{path}: {what}")]
    Unfit { path: PathBuf, what: String },
}

/// A record that was opened.
pub(super) enum Record {
    Table(RecordTable, OutputTriad),
    Raw(Raw),
}

/// Captures as a table.
pub(super) struct Raw {
    path: PathBuf,
    triad: OutputTriad,
    captures: Vec<Capture>,
}

impl Record {
    /// Opens a file; `triad` is what the method is about.
    pub(super) fn open(path: &Path, triad: OutputTriad, reading: &ReadingOptions) -> Result<Self, ComputeError> {
        let text = path.to_string_lossy();
        let split = |ending: &str| {
            let (file, label) = text.split_once(&format!("{ending}#"))?;
            Some((PathBuf::from(format!("{file}{ending}")), Some(label)))
        };
        let labelled = [".mcap", ".csv", ".parquet"].into_iter().find_map(split).filter(|_| !path.exists());
        let (file, label) = labelled.unwrap_or_else(|| (path.to_owned(), None));
        if file.extension().is_none_or(|extension| extension != "mcap") {
            let reading = ReadingOptions { capture: label.map(str::to_owned), ..reading.clone() };
            return Ok(Self::Table(RecordTable::open(&file, &reading)?, triad));
        }
        let mut captures = captures::read_proved(&file).map_err(RecordError::from)?.captures;
        if let Some(label) = label {
            captures.retain(|capture| capture.about.label == label);
        }
        let raw = Raw { path: path.to_owned(), triad, captures };
        if raw.captures.is_empty() {
            let which = label.map_or_else(String::new, |label| format!(" `{label}`"));
            return Err(raw.unfit(format!("it has no complete capture{which}")).into());
        }
        Ok(Self::Raw(raw))
    }

    /// Whether the record has a column.
    pub(super) fn has(&self, name: &str) -> bool {
        match self {
            Self::Table(table, _) => table.has(name),
            Self::Raw(raw) => match name {
                "position" => raw.has_positions(),
                "ux" => !raw.has_positions(),
                _ => raw.column(name).is_some(),
            },
        }
    }

    /// Reads the wanted columns.
    pub(super) fn read(self, wanted: &Wanted) -> Result<Columns, ComputeError> {
        match self {
            Self::Table(table, triad) => Ok(table.read(wanted, Some(triad.name()))?),
            Self::Raw(raw) => Ok(raw.read(wanted)?),
        }
    }
}

type Column = fn(&Capture, usize, usize) -> f64;

impl Raw {
    /// Whether every still capture has an axis up and all these axes differ. Then their names are labels.
    fn has_positions(&self) -> bool {
        let still = self.captures.iter().filter(|capture| matches!(capture.about.pose, Pose::Still { .. }));
        let mut names: Vec<String> = still.map(|capture| capture.about.position_and_run().0).collect();
        let count = names.len();
        names.sort();
        names.dedup();
        count > 0 && names.len() == count && names.iter().all(|name| !name.is_empty())
    }

    /// How to take a column from a sample, and its axis.
    fn column(&self, name: &str) -> Option<(Column, usize)> {
        let (sensor, axis) = match name.rsplit_once('_') {
            Some((sensor, axis)) => (sensor, axis),
            None => match name {
                "ux" | "uy" | "uz" => ("u", &name[1..]),
                axis => (self.triad.name(), axis),
            },
        };
        let axis = gnc_metrology::AXES.iter().position(|known| *known == axis)?;
        let column: Column = match sensor {
            "gyro" => |capture, row, axis| f64::from(capture.samples[row].gyro[axis]),
            "accel" => |capture, row, axis| f64::from(capture.samples[row].accel[axis]),
            "mag" => |capture, row, axis| f64::from(capture.samples[row].mag[axis]),
            "u" => |capture, _, axis| match capture.about.pose {
                Pose::Still { up, .. } => up[axis],
                _ => f64::NAN,
            },
            _ => return None,
        };
        Some((column, axis))
    }

    fn read(&self, wanted: &Wanted) -> Result<Columns, RecordError> {
        let mut numbers = vec![Vec::new(); wanted.numbers.len()];
        let mut codes = Vec::new();
        let of_positions = wanted.numbers.contains(&"ux");
        let mut used: Vec<&Capture> = Vec::new();
        for capture in &self.captures {
            let (position, run) = capture.about.position_and_run();
            let label = match wanted.label {
                Some(("position", allowed)) => Some((position, allowed)),
                Some((_, allowed)) => Some((run, allowed)),
                None => None,
            };
            if of_positions && !matches!(capture.about.pose, Pose::Still { .. }) {
                continue;
            }
            if let Some((label, allowed)) = label {
                let Some(code) = allowed.iter().position(|known| *known == label) else { continue };
                codes.extend(std::iter::repeat_n(code as u8, capture.samples.len()));
            }
            used.push(capture);
        }
        self.check(&used, wanted, of_positions)?;
        for (values, name) in numbers.iter_mut().zip(wanted.numbers) {
            let Some((column, axis)) = self.column(name) else {
                return Err(self.unfit(format!("there is no column `{name}`; raw captures have gyro_x to mag_z")));
            };
            for capture in &used {
                values.extend((0..capture.samples.len()).map(|row| column(capture, row, axis)));
            }
        }
        let clock = RecordClock::OnGrid;
        let units = vec![None; numbers.len()];
        let names = wanted.numbers.iter().map(|name| (*name).to_owned()).collect();
        Ok(Columns {
            numbers,
            labels: codes,
            units,
            names,
            rate: rate(&used),
            about: About { clock, ..About::default() },
        })
    }

    fn check(&self, used: &[&Capture], wanted: &Wanted, of_positions: bool) -> Result<(), RecordError> {
        if used.is_empty() {
            return Err(self.unfit("it has no capture that this method can use".into()));
        }
        if used.len() > 1 && wanted.label.is_none() && !of_positions {
            let labels: Vec<String> = used.iter().take(20).map(|capture| format!("#{}", capture.about.label)).collect();
            return Err(self.unfit(format!(
                "it holds {} captures; add the name of one to the path: {}",
                used.len(),
                labels.join(" ")
            )));
        }
        for capture in used {
            let about = &capture.about;
            if capture.losses.any() {
                return Err(self.unfit(format!("capture `{}` has a gap", about.label)));
            }
            if let Err(fault) = capture.check_clock() {
                return Err(self.unfit(format!("capture `{}`: {fault}", about.label)));
            }
            if let Some(rate_hz) = wanted.rate_hz.filter(|rate_hz| *rate_hz != f64::from(about.rate_hz)) {
                return Err(self.unfit(format!("capture `{}` has {} Hz, not {rate_hz}", about.label, about.rate_hz)));
            }
        }
        Ok(())
    }

    fn unfit(&self, what: String) -> RecordError {
        RecordError::Unfit { path: self.path.clone(), what }
    }
}

/// The rate that all captures have, Hz; or why they have no common rate.
fn rate(captures: &[&Capture]) -> Result<f64, String> {
    let rates_hz: BTreeSet<u16> = captures.iter().map(|capture| capture.about.rate_hz).collect();
    match rates_hz.iter().copied().collect::<Vec<_>>().as_slice() {
        [rate_hz] => Ok(f64::from(*rate_hz)),
        several => Err(format!("the captures have different rates, {several:?} Hz")),
    }
}

impl OutputTriad {
    fn name(self) -> &'static str {
        match self {
            Self::Gyro => "gyro",
            Self::Accel => "accel",
            Self::Mag => "mag",
        }
    }
}
