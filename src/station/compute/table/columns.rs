//! Columns as they were read from any kind of file: which are wanted, what their units are, and what their clock says.

use std::path::{Path, PathBuf};

use gnc_metrology::Refusal;
use gnc_metrology::clock::{self, ClockRate, Stated};

use super::gathered::Gathered;
use super::names::Header;
use super::number::Form;
use super::rows::Role;
use super::time::{self, Stamps, TimeColumn};
use super::{ReadingOptions, TableError};

/// What time means for a method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(in crate::compute) enum TimeUse {
    /// Nothing: rows are points.
    Free,
    /// Rows follow each other without a gap.
    #[default]
    Unbroken,
    /// A rate is stated or comes from the record, and the figures change with its square root or less.
    Rate,
    /// The same, but a scale factor changes in proportion to the rate.
    Scale,
}

impl TimeUse {
    /// Largest relative difference between the stamps and the stated rate, unless the user says otherwise. A scale
    /// factor has the full error of its rate, a density half of it.
    fn tolerance(self) -> f64 {
        if self == Self::Scale { 10e-6 } else { 1e-3 }
    }

    fn needs_rate(self) -> bool {
        matches!(self, Self::Rate | Self::Scale)
    }
}

/// What to read of a table.
#[derive(Default)]
pub(in crate::compute) struct Wanted<'a> {
    /// Columns of numbers.
    pub(in crate::compute) numbers: &'a [&'a str],
    /// Column of labels and the labels allowed there.
    pub(in crate::compute) label: Option<(&'a str, &'a [&'a str])>,
    /// The stated rate, against which a time column is checked.
    pub(in crate::compute) rate_hz: Option<f64>,
    /// What time means for the method.
    pub(in crate::compute) time: TimeUse,
    /// Index of the column of numbers that starts time anew when its value changes.
    pub(in crate::compute) anew: Option<usize>,
}

/// Columns of a table.
#[derive(Debug)]
pub(in crate::compute) struct Columns {
    /// One vector for each wanted column of numbers.
    pub(in crate::compute) numbers: Vec<Vec<f64>>,
    /// For each row the index of its label among the allowed labels.
    pub(in crate::compute) labels: Vec<u8>,
    /// Units of the columns of numbers, as the file writes them.
    pub(in crate::compute) units: Vec<Option<String>>,
    /// Names of the columns of numbers, as they were wanted.
    pub(in crate::compute) names: Vec<String>,
    /// The sample rate in Hz: as stated, else from the record; or why the record does not give one.
    pub(in crate::compute) rate: Result<f64, String>,
    pub(in crate::compute) about: About,
}

impl Columns {
    /// The sample rate, Hz, for a method that needs one.
    pub(in crate::compute) fn rate_hz(&self) -> Result<f64, TableError> {
        self.rate.clone().map_err(|why| TableError::NoRate { why })
    }
}

/// Facts about a record beside its values.
#[derive(Debug, Default)]
pub(in crate::compute) struct About {
    /// What the reader understood of the form of the file.
    pub(in crate::compute) understood: Vec<String>,
    pub(in crate::compute) clock: RecordClock,
    /// The file is an export of this station.
    pub(in crate::compute) export: bool,
}

/// The result of the check of a record's clock.
#[derive(Debug)]
pub(in crate::compute) enum RecordClock {
    Checked {
        rate: ClockRate,
        column: String,
        tolerance: Option<f64>,
    },
    /// The times of a raw capture's frames fit the grid of its rate to a microsecond.
    OnGrid,
    NotChecked(String),
}

impl RecordClock {
    /// Whether a clock measured the steps between the rows.
    pub(in crate::compute) fn is_checked(&self) -> bool {
        !matches!(self, Self::NotChecked(_))
    }
}

impl Default for RecordClock {
    fn default() -> Self {
        Self::NotChecked("no time column".to_owned())
    }
}

/// Relative error of a rate that comes from arithmetic.
const ARITHMETIC: f64 = 1e-9;

/// Columns of a header by their purpose.
pub(super) struct ColumnPlan<'a> {
    path: PathBuf,
    wanted: &'a Wanted<'a>,
    rate_tolerance: Option<f64>,
    pub(super) roles: Vec<(usize, Role)>,
    /// Labels that are allowed.
    pub(super) allowed: &'a [&'a str],
    /// The capture that is wanted.
    pub(super) capture: Option<String>,
    /// The table is an export of this station: rows outside a position or run have no label.
    pub(super) export: bool,
    time: Result<TimeColumn, String>,
    units: Vec<Option<String>>,
    understood: Vec<String>,
}

/// The columns that an export of this station begins with.
const EXPORT: [&str; 6] = ["capture", "series", "position", "run", "number", "t_s"];

impl<'a> ColumnPlan<'a> {
    /// `sensor` is what `x`, `y` and `z` are called in a table of several sensors: `gyro_x`.
    pub(super) fn new(
        path: &Path,
        header: &Header,
        (first_row, form): (&[String], Form),
        wanted: &'a Wanted<'a>,
        reading: &ReadingOptions,
        sensor: Option<&str>,
    ) -> Result<Self, TableError> {
        let export = EXPORT.iter().all(|name| header.names.iter().any(|n| n.text == *name));
        let mut understood = Vec::new();
        let mut roles = Vec::new();
        if export {
            roles.push((header.column("capture")?, Role::Capture));
        } else if let Some(capture) = &reading.capture {
            let what = format!("it has no column `capture`, so capture `{capture}` cannot be selected");
            return Err(TableError::Damaged { path: path.to_owned(), what });
        }
        if let Some((name, _)) = wanted.label {
            roles.push((header.column(name)?, Role::Label));
        }
        let mut units = Vec::new();
        for (k, name) in wanted.numbers.iter().enumerate() {
            let of_sensor = sensor.filter(|_| name.len() == 1).map(|sensor| format!("{sensor}_{name}"));
            let place = match (header.find(name)?, of_sensor) {
                (None, Some(of_sensor)) if header.find(&of_sensor)?.is_some() => {
                    understood.push(format!("{of_sensor} for {name}"));
                    header.column(&of_sensor)?
                }
                _ => header.column(name)?,
            };
            roles.push((place, Role::Number(k)));
            units.push(header.names[place].unit.clone());
        }
        let time = match wanted.time {
            TimeUse::Free => Err("the method does not use time".to_owned()),
            _ => time::column(header, first_row, form),
        };
        if let Ok(column) = &time {
            roles.push((column.place, Role::Time { dates: column.stamps == Stamps::Dates }));
        }
        Ok(Self {
            path: path.to_owned(),
            wanted,
            rate_tolerance: reading.rate_tolerance.map(|ppm| ppm * 1e-6),
            roles,
            allowed: wanted.label.map_or(&[], |(_, allowed)| allowed),
            capture: reading.capture.clone(),
            export,
            time,
            units,
            understood,
        })
    }

    /// Checks the gathered rows, and returns them as columns.
    pub(super) fn finish(mut self, gathered: Gathered, understood: &[String]) -> Result<Columns, TableError> {
        if gathered.rows == 0 {
            return Err(self.no_rows(&gathered));
        }
        if self.export && self.wanted.label.is_none() && gathered.captures.len() > 1 {
            let names = gathered.captures.iter().take(20).map(|(_, name)| format!("#{name}"));
            let (path, count) = (self.path.clone(), gathered.captures.len());
            return Err(TableError::ManyCaptures { path, count, captures: names.collect::<Vec<_>>().join(" ") });
        }
        let clock = self.clock(&gathered)?;
        let rate = self.rate(&clock, &gathered);
        for (k, name) in self.wanted.numbers.iter().enumerate() {
            let cells = gathered.missing.iter().filter(|(column, _)| *column == k).count();
            if let Some((_, line)) = gathered.missing.iter().find(|(column, _)| *column == k) {
                let (column, rows, line) = ((*name).to_owned(), gathered.rows, *line);
                return Err(Refusal::EmptyCells { column, cells, rows, line }.into());
            }
        }
        let understood = understood.iter().cloned().chain(std::mem::take(&mut self.understood)).collect();
        let Gathered { numbers, labels, .. } = gathered;
        let names = self.wanted.numbers.iter().map(|name| (*name).to_owned()).collect();
        Ok(Columns {
            numbers,
            labels,
            units: self.units,
            names,
            rate,
            about: About { understood, clock, export: self.export },
        })
    }

    /// The stated rate, else the rate of the clock.
    fn rate(&mut self, clock: &RecordClock, gathered: &Gathered) -> Result<f64, String> {
        if let Some(rate_hz) = self.wanted.rate_hz {
            return Ok(rate_hz);
        }
        let (rate, column) = match clock {
            RecordClock::Checked { rate, column, .. } => (rate, column),
            RecordClock::NotChecked(why) => return Err(why.clone()),
            RecordClock::OnGrid => return Err("no time column".to_owned()),
        };
        let step = gathered.times.first_chunk().map_or(0.0, |[first, second]| second - first);
        if matches!(&self.time, Ok(column) if column.stamps == Stamps::Seconds) && step >= 1.0 {
            return Err(format!(
                "column `{column}` names no unit, and steps of {step} may be s, ms or numbers of samples"
            ));
        }
        let tolerance = self.rate_tolerance.unwrap_or_else(|| self.wanted.time.tolerance());
        let (expanded, ppm) = (1.96 * rate.rate_u_hz / rate.rate_hz, 1e6);
        if expanded > tolerance && !self.export {
            let (expanded, tolerance) = (expanded * ppm, tolerance * ppm);
            return Err(format!(
                "column `{column}` gives {:.4} Hz to +- {expanded:.3} ppm, but the method needs +- {tolerance} ppm",
                rate.rate_hz
            ));
        }
        // An export counts its times by the whole rate of its captures, so the rate is known better than stamps in
        // whole ms show. In other files, remove the digits that arithmetic added.
        let whole_hz = rate.rate_hz.round();
        let is_whole = self.export || (rate.rate_hz / whole_hz - 1.0).abs() < ARITHMETIC;
        let rate_hz = if is_whole { whole_hz } else { rate.rate_hz };
        if self.wanted.time.needs_rate() {
            // As many digits as the stamps can give.
            let decimals = (1.0 - rate.rate_u_hz.max(1e-9).log10().floor()).clamp(0.0, 9.0) as usize;
            let known = format!("{rate_hz:.decimals$}");
            let known = if known.contains('.') { known.trim_end_matches('0').trim_end_matches('.') } else { &known };
            self.understood.push(format!("{known} Hz of column {column}"));
        }
        Ok(rate_hz)
    }

    fn no_rows(&self, gathered: &Gathered) -> TableError {
        match &self.capture {
            Some(capture) if !gathered.others.is_empty() => TableError::NoCapture {
                path: self.path.clone(),
                capture: capture.clone(),
                captures: gathered.others.iter().take(20).map(|name| format!("#{name}")).collect::<Vec<_>>().join(" "),
            },
            _ => TableError::NoRows { path: self.path.clone() },
        }
    }

    /// Checks the clock of the rows so far.
    pub(super) fn clock(&mut self, gathered: &Gathered) -> Result<RecordClock, TableError> {
        let column = match &self.time {
            Ok(column) => column.clone(),
            Err(why) => return Ok(RecordClock::NotChecked(why.clone())),
        };
        let blocks = gathered.blocks(self.wanted.anew);
        let step = || {
            let longest = blocks.iter().max_by_key(|block| block.len())?;
            clock::usual_step(gathered.times.get(longest.clone())?)
        };
        let stated_hz = self.wanted.rate_hz;
        let fitting = || step().zip(stated_hz).and_then(|(step, hz)| time::unit_for_rate(step, hz));
        let unit_s = match column.stamps {
            Stamps::Numbers(unit_s) => Some(unit_s),
            Stamps::Dates => Some(1.0),
            Stamps::Seconds => Some(fitting().unwrap_or(1.0)),
            Stamps::Unknown => fitting(),
        };
        if matches!(column.stamps, Stamps::Seconds | Stamps::Unknown)
            && let Some((_, unit)) = [(1e-3, "ms"), (1e-6, "us"), (1e-9, "ns"), (1.0, "s")]
                .iter()
                .find(|(s, unit)| Some(*s) == unit_s && (*unit != "s" || column.stamps == Stamps::Unknown))
        {
            self.understood.push(format!("{} in {unit}, as --rate shows", column.name));
        }
        let tolerance = self.rate_tolerance.unwrap_or_else(|| self.wanted.time.tolerance());
        let (Some(unit_s), times) = (unit_s, &gathered.times) else {
            if let Some((step, stated_hz)) = step().zip(stated_hz) {
                return Err(Refusal::UnknownTimeUnit { column: column.name, step, stated_hz }.into());
            }
            clock::check(&gathered.times, &blocks, None)?;
            let why = format!("the header names no unit of `{}`; its times have no gap", column.name);
            return Ok(RecordClock::NotChecked(why));
        };
        let stated = stated_hz.map(|rate_hz| Stated { rate_hz, tolerance });
        let rate = if unit_s == 1.0 {
            clock::check(times, &blocks, stated)?
        } else {
            let scaled: Vec<f64> = times.iter().map(|t| t * unit_s).collect();
            clock::check(&scaled, &blocks, stated)?
        };
        Ok(match rate {
            Some(rate) => RecordClock::Checked { rate, column: column.name, tolerance: stated.map(|s| s.tolerance) },
            None => RecordClock::NotChecked(format!("too few stamps in column `{}`", column.name)),
        })
    }
}
