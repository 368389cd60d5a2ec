//! The columns of an export, the same in every format.

use gnc_analysis::capture::Capture;
use gnc_protocol::calibration::{FIELD_PER_GAUSS, FORCE_PER_MPS2, RATE_PER_RPS, ROLL_PER_RAD};
use gnc_protocol::stream::{ACCEL_LSB_PER_G, GYRO_LSB_PER_DPS, MAG_LSB_PER_GAUSS};

/// What a table holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TableKind {
    /// Raw samples, in counts.
    Raw,
    /// Samples that the board compensated, in their units.
    Compensated,
}

impl TableKind {
    /// Names of the counts of a sample: whole numbers as they arrived.
    pub(super) fn counts(self) -> &'static [&'static str] {
        match self {
            Self::Raw => &["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z", "mag_x", "mag_y", "mag_z"],
            Self::Compensated => &[],
        }
    }

    /// Names of the values of a sample that have units: counts at the nominal scale, or values that the board
    /// compensated.
    pub(super) fn values(self) -> &'static [&'static str] {
        match self {
            Self::Raw => &[
                "gyro_x_dps",
                "gyro_y_dps",
                "gyro_z_dps",
                "accel_x_g",
                "accel_y_g",
                "accel_z_g",
                "mag_x_gauss",
                "mag_y_gauss",
                "mag_z_gauss",
            ],
            Self::Compensated => &[
                "rate_x_rps",
                "rate_y_rps",
                "rate_z_rps",
                "force_x_mps2",
                "force_y_mps2",
                "force_z_mps2",
                "field_x_gauss",
                "field_y_gauss",
                "field_z_gauss",
                "roll_rad",
            ],
        }
    }

    /// Names of the masks of a sample: whole numbers with one bit for each flag.
    pub(super) fn masks(self) -> &'static [&'static str] {
        match self {
            Self::Raw => &[],
            Self::Compensated => &["saturated"],
        }
    }

    /// The unit of each column of counts, values and temperatures, and for a value the number of counts in its unit: a
    /// value is its count divided by that.
    pub(super) fn units(self) -> Vec<(&'static str, &'static str, Option<f64>)> {
        let counts = self.counts().iter().map(|name| (*name, "count", None));
        let triads: &[(&str, f64)] = match self {
            Self::Raw => &[("deg/s", GYRO_LSB_PER_DPS), ("g", ACCEL_LSB_PER_G), ("gauss", MAG_LSB_PER_GAUSS)],
            Self::Compensated => {
                &[("rad/s", RATE_PER_RPS), ("m/s^2", FORCE_PER_MPS2), ("gauss", FIELD_PER_GAUSS), ("rad", ROLL_PER_RAD)]
            }
        };
        let values = self.values().iter().enumerate().filter_map(|(value, name)| {
            let (unit, counts) = triads.get(value / 3)?;
            Some((*name, *unit, Some(*counts)))
        });
        let temperatures = TEMPERATURES.iter().map(|name| (*name, "degC", Some(TEMPERATURE_PER_DEGC)));
        counts.chain(values).chain([("t_s", "s", None)]).chain(temperatures).collect()
    }

    /// The end of the file's name.
    pub(super) fn suffix(self) -> &'static str {
        match self {
            Self::Raw => "",
            Self::Compensated => "-compensated",
        }
    }

    pub(super) fn samples(self, capture: &Capture) -> usize {
        match self {
            Self::Raw => capture.samples.len(),
            Self::Compensated => capture.compensated.len(),
        }
    }
}

/// Names of the columns that identify the sample of a row.
pub(super) const PLACE: [&str; 6] = ["capture", "series", "position", "run", "number", "t_s"];
/// Names of the last columns: temperatures of gyroscopes and accelerometers.
pub(super) const TEMPERATURES: [&str; 2] = ["gyro_temperature_degc", "accel_temperature_degc"];

/// Counts of a temperature in a degree Celsius.
const TEMPERATURE_PER_DEGC: f64 = 100.0;

/// The samples of a capture as rows. The columns: [`PLACE`], counts, values and masks of the kind, [`TEMPERATURES`].
pub(super) struct SampleTable<'a> {
    capture: &'a Capture,
    kind: TableKind,
    /// The axis that is up; empty if there is none.
    pub(super) position: String,
    /// The axis and the sense of a turn; empty if there is none.
    pub(super) run: String,
}

impl<'a> SampleTable<'a> {
    pub(super) fn of(capture: &'a Capture, kind: TableKind) -> Self {
        let (position, run) = capture.about.position_and_run();
        Self { capture, kind, position, run }
    }

    pub(super) fn label(&self) -> &'a str {
        &self.capture.about.label
    }

    pub(super) fn series(&self) -> u32 {
        self.capture.about.series
    }

    pub(super) fn len(&self) -> usize {
        self.kind.samples(self.capture)
    }

    /// Time of a sample since the first one, as exact as the board's own microseconds.
    pub(super) fn at_us(&self, row: usize) -> u64 {
        row as u64 * 1_000_000 / u64::from(self.capture.about.rate_hz.max(1))
    }

    /// A value of a sample, in the order of [`TableKind::values`]. Scales are whole numbers, so that the quotient is
    /// the number nearest to its decimal fraction.
    pub(super) fn value(&self, row: usize, value: usize) -> f64 {
        let (count, scale) = match self.kind {
            TableKind::Raw => {
                let scale = [GYRO_LSB_PER_DPS, ACCEL_LSB_PER_G, MAG_LSB_PER_GAUSS][value / 3 % 3];
                (self.count(row, value), scale)
            }
            TableKind::Compensated => {
                let sample = &self.capture.compensated[row];
                match value {
                    0..3 => (sample.rate[value], RATE_PER_RPS),
                    3..6 => (sample.force[value - 3], FORCE_PER_MPS2),
                    6..9 => (sample.field[value - 6], FIELD_PER_GAUSS),
                    _ => (sample.roll, ROLL_PER_RAD),
                }
            }
        };
        f64::from(count) / scale
    }

    /// A count of a raw sample, in the order of [`TableKind::counts`].
    pub(super) fn count(&self, row: usize, value: usize) -> i32 {
        let sample = &self.capture.samples[row];
        match value {
            0..3 => sample.gyro[value],
            3..6 => sample.accel[value - 3],
            _ => sample.mag[value - 6],
        }
    }

    /// The mask of a compensated sample: the raw channels that were saturated.
    pub(super) fn mask(&self, row: usize) -> u16 {
        self.capture.compensated[row].saturated
    }

    /// Temperatures of gyroscopes and accelerometers, degC.
    pub(super) fn temperatures(&self, row: usize) -> [f64; 2] {
        let raw = match self.kind {
            TableKind::Raw => {
                let sample = &self.capture.samples[row];
                [sample.gyro_temperature, sample.accel_temperature]
            }
            TableKind::Compensated => {
                let sample = &self.capture.compensated[row];
                [sample.gyro_temperature, sample.accel_temperature]
            }
        };
        raw.map(|value| f64::from(value) / TEMPERATURE_PER_DEGC)
    }
}
