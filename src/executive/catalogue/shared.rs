//! Parts that the items of calibration and performance share: parameters of captures and of uncertainty, units of
//! figures.

use super::{ItemId, MeasurementSpec, ParamKind, ParamSpec, When, number};
use crate::quantity::{Dimension, Unit};

/// The needs of an item whose figures are those of calibrated sensors.
pub(super) const CALIBRATED: &[(ItemId, Option<When>)] =
    &[(ItemId::SixPosition, None), (ItemId::GyroStill, None), (ItemId::Rotation, None)];

const GYRO: Option<When> = Some(When::HasText { param: "sensors", element: "gyro" });

/// The same needs for an item that judges both triads or one. The gyroscopes' g-sensitivity is removed with the force
/// that the accelerometers measure.
pub(super) const COMPENSATED: &[(ItemId, Option<When>)] =
    &[(ItemId::SixPosition, None), (ItemId::GyroStill, GYRO), (ItemId::Rotation, GYRO)];

/// A quantity as a parameter.
pub(super) const fn quantity(
    name: &'static str,
    about: &'static str,
    unit: Unit,
    (min, max): (f64, f64),
    default: f64,
) -> ParamSpec {
    ParamSpec { name, about, kind: ParamKind::Quantity { unit, min, max, default } }
}

/// Samples a second of a still capture.
pub(super) const RATE: ParamSpec = quantity("rate", "samples per second", Unit::Hertz, (1.0, 1000.0), 200.0);

/// Wait before a capture.
pub(super) const SETTLE: ParamSpec =
    quantity("settle", "wait after motion or power-on before samples count", Unit::Second, (0.0, 7200.0), 10.0);

/// Attitudes of a calibration of the accelerometers.
pub(super) const POSITIONS: ParamSpec = ParamSpec {
    name: "positions",
    about: "attitudes: 6 are each axis up and down; 12 are these at two headings, 24 at four",
    kind: ParamKind::Choice { of: &["6", "12", "24"], default: "6" },
};

/// Time in each position.
pub(super) const DWELL: ParamSpec = quantity("dwell", "time in each position", Unit::Second, (10.0, 7200.0), 300.0);

/// Probability of every expanded uncertainty.
pub(super) const COVERAGE: ParamSpec =
    quantity("coverage", "probability of the expanded uncertainty", Unit::Percent, (68.0, 99.9), 95.0);

/// How well an attitude of the fixture is known.
pub(super) const POSE_U: ParamSpec =
    quantity("pose_u", "standard uncertainty of each attitude about each axis", Unit::Degree, (0.0, 1.0), 0.003);

/// How well gravity is known.
pub(super) const GRAVITY_U: ParamSpec =
    quantity("gravity_u", "standard uncertainty of local gravity", Unit::PartsPerMillion, (0.0, 3000.0), 30.0);

/// Whether the headings are as the record states them.
pub(super) const HEADING: ParamSpec = ParamSpec {
    name: "heading",
    about: "whether the fixture's headings are true headings: if not, the horizontal earth rate stays in the figure",
    kind: ParamKind::Choice { of: &["known", "unknown"], default: "known" },
};

/// How well the headings are known.
pub(super) const HEADING_U: ParamSpec =
    quantity("heading_u", "standard uncertainty of a known heading", Unit::Degree, (0.0, 90.0), 0.5);

/// Both triads or one.
pub(super) const SENSORS: ParamSpec = ParamSpec {
    name: "sensors",
    about: "triads to judge",
    kind: ParamKind::Choices { of: &["gyro", "accel"], default: &["gyro", "accel"] },
};

/// Rotation: angle of a turn.
pub(super) const ANGLE: ParamSpec =
    quantity("angle", "angle of each turn, a multiple of 360 deg", Unit::Degree, (360.0, 36_000.0), 1080.0);

/// Rotation: time of a turn.
pub(super) const SPAN: ParamSpec = quantity("span", "time of each turn", Unit::Second, (1.0, 600.0), 5.0);

/// Rotation: time of each ramp within the turn.
pub(super) const RAMP: ParamSpec =
    quantity("ramp", "time of each of the two ramps within a turn", Unit::Second, (0.05, 60.0), 0.5);

/// Rotation: stillness after a turn; at least half a second of stillness comes before it.
pub(super) const REST: ParamSpec = quantity("rest", "stillness after each turn", Unit::Second, (1.0, 600.0), 10.0);

/// Rotation: samples a second.
pub(super) const TURN_RATE: ParamSpec =
    quantity("turn_rate", "samples per second of a turn", Unit::Hertz, (100.0, 1000.0), 1000.0);

/// Rotation: where the axis of the table points.
pub(super) const GEOMETRY: ParamSpec = ParamSpec {
    name: "geometry",
    about: "where the turning axis points: up, or parallel to the earth's axis",
    kind: ParamKind::Choice { of: &["vertical", "polar"], default: "vertical" },
};

/// Rotation: how well the angle is known.
pub(super) const ANGLE_U: ParamSpec =
    quantity("angle_u", "standard uncertainty of the angle of a turn", Unit::Degree, (0.0, 10.0), 0.003);

/// Rotation: how well the sample clock is known. 29 ppm is the standard uncertainty of a crystal of +-50 ppm, with all
/// values equally likely.
pub(super) const CLOCK_U: ParamSpec = quantity(
    "clock_u",
    "standard uncertainty of the sample clock, unless an earlier item has measured it by 1PPS",
    Unit::PartsPerMillion,
    (0.0, 1000.0),
    29.0,
);

/// Error of the samples' rate against true time.
pub const SAMPLE_RATE: MeasurementSpec = ppm(
    "sample_rate_error",
    "The oscillator of the slave board or of this computer is off: compare both with a frequency counter.",
);

/// Rotation: the scale factors that are accepted as possible.
pub(super) const BAND: ParamSpec =
    quantity("band", "half width of the band around the nominal scale factor", Unit::Percent, (0.1, 50.0), 5.0);

pub(super) const fn mg(name: &'static str, look_at: &'static str) -> MeasurementSpec {
    number(name, Unit::Milligravity, Dimension::Acceleration, look_at)
}

pub(super) const fn dph(name: &'static str, look_at: &'static str) -> MeasurementSpec {
    number(name, Unit::DegreePerHour, Dimension::AngularRate, look_at)
}

pub(super) const fn ppm(name: &'static str, look_at: &'static str) -> MeasurementSpec {
    number(name, Unit::PartsPerMillion, Dimension::Ratio, look_at)
}

pub(super) const fn percent(name: &'static str, look_at: &'static str) -> MeasurementSpec {
    number(name, Unit::Percent, Dimension::Ratio, look_at)
}

pub(super) const fn gauss(name: &'static str, look_at: &'static str) -> MeasurementSpec {
    number(name, Unit::Gauss, Dimension::MagneticField, look_at)
}

const fn degc(name: &'static str, look_at: &'static str) -> MeasurementSpec {
    number(name, Unit::DegreeCelsius, Dimension::Temperature, look_at)
}

/// Reads without an answer of a chip, as a fraction of all samples that the item used.
pub const FAILED_READS: MeasurementSpec = percent(
    "failed_reads",
    "A failed read shows 0, -1 or the end of the range: suspect the line between sensor and FPGA, then the sensor.",
);

/// Samples that repeat the one before on all channels, as a fraction of all samples that the item used.
pub const STALE_SAMPLES: MeasurementSpec = percent(
    "stale_samples",
    "The sensor is read more often than it updates, or it stops at times: compare its output rate with that of the stream.",
);

/// Samples far from their neighbours on both sides, as a fraction of all samples that the item used.
pub const SPIKES: MeasurementSpec =
    percent("spikes", "Single samples jump: look for loose contacts and disturbances, then suspect the sensor.");

/// The hint for a temperature or its drift outside its limit.
const WARM: &str = "The calibration holds for one constant temperature: let the module settle, and keep draughts away.";

/// Mean temperature of the sensors.
pub const TEMPERATURE: MeasurementSpec = degc("temperature", WARM);
/// Largest less smallest temperature within the captures of an item.
pub const TEMPERATURE_DRIFT: MeasurementSpec = degc("temperature_drift", WARM);

/// Measurements of every item that captures samples.
pub(super) const OF_SAMPLES: [MeasurementSpec; 4] = [SAMPLE_RATE, FAILED_READS, STALE_SAMPLES, SPIKES];

/// Sensor and axis of the couplings, in the order of their measurements.
pub const COUPLED_PAIRS: [(usize, usize); 6] = [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)];
/// Sensors whose axes stand at an angle, in the order of the measurements of that angle.
pub const SENSOR_PAIRS: [(usize, usize); 3] = [(0, 1), (0, 2), (1, 2)];

/// A kind of measurement of both inertial triads.
#[derive(Debug)]
pub struct PerTriad<const N: usize> {
    /// Gyroscopes.
    pub gyro: [MeasurementSpec; N],
    /// Accelerometers.
    pub accel: [MeasurementSpec; N],
}

/// Joins arrays of measurements to the list of an item.
macro_rules! measurements {
    ($($part:expr),* $(,)?) => {{
        const PARTS: &[&[MeasurementSpec]] = &[$(&$part),*];
        const ALL: [MeasurementSpec; $crate::catalogue::shared::count_of(PARTS)] =
            $crate::catalogue::shared::joined(PARTS);
        &ALL
    }};
}
pub(super) use measurements;

/// The number of measurements of all parts.
pub(super) const fn count_of(parts: &[&[MeasurementSpec]]) -> usize {
    let (mut count, mut part) = (0, 0);
    while part < parts.len() {
        count += parts[part].len();
        part += 1;
    }
    count
}

/// The measurements of all parts in one array; `N` is [`count_of`] them.
pub(super) const fn joined<const N: usize>(parts: &[&[MeasurementSpec]]) -> [MeasurementSpec; N] {
    let mut all = [SAMPLE_RATE; N];
    let (mut next, mut part) = (0, 0);
    while part < parts.len() {
        let mut place = 0;
        while place < parts[part].len() {
            all[next] = parts[part][place];
            next += 1;
            place += 1;
        }
        part += 1;
    }
    all
}
