//! Magnetometer: in its plane of rotation, and over the whole sphere.

use super::shared::{COVERAGE, OF_SAMPLES, RATE, SETTLE, gauss, measurements, percent, ppm, quantity};
use super::{Device, ItemSpec, MeasurementSpec, ParamKind, ParamSpec, Resource, Traces, count, number};
use crate::quantity::{Dimension, Unit};

const ZERO: &str = "There is iron near the sensor or in the module: clear the table, then suspect the magnetometer.";
const SHAPE: &str = "The sensitivities differ or the axes are not square: suspect the magnetometer.";
const FIELD: &str =
    "Compare with the field in the bench file: look for iron nearby, or a wrong heading of the spin axis.";
const ROUND: &str = "The corrected points do not lie on a circle: look for a disturbance that changes with time.";
const ROLL: &str = "The roll angle has the same error in each turn: look at the corrected plot, and look for iron that turns with the module.";
const LATE: &str =
    "Channels are sampled one after the other, or the table's angle is late: compare with the part's data.";

/// Zero of X and of Y.
pub const ZERO_OF_AXIS: [MeasurementSpec; 2] = [gauss("zero_x", ZERO), gauss("zero_y", ZERO)];
/// Sensitivity of X over that of Y.
pub const SENSITIVITY_RATIO: MeasurementSpec = percent("sensitivity_ratio", SHAPE);
/// Departure of the angle between X and Y from a right angle.
pub const ALPHA: MeasurementSpec = number("alpha", Unit::Degree, Dimension::Angle, SHAPE);
/// Radius of the corrected circle.
pub const RADIUS: MeasurementSpec = gauss("radius", FIELD);
/// Root mean square of the distances from the ellipse, over the radius.
pub const RESIDUAL_RMS: MeasurementSpec = percent("residual_rms", ROUND);
/// Largest error of the radius after correction, over the radius.
pub const RESIDUAL_PEAK: MeasurementSpec = percent("residual_peak", ROUND);
/// Error of the roll angle once and twice a turn.
pub const ROLL_ERROR: [MeasurementSpec; 2] = [
    number("roll_error_1", Unit::Degree, Dimension::Angle, ROLL),
    number("roll_error_2", Unit::Degree, Dimension::Angle, ROLL),
];
/// Time from the sampling of X to that of Y.
pub const SKEW: MeasurementSpec = number("skew", Unit::Microsecond, Dimension::Time, LATE);
/// Time from the table's angle to the sampling of the field.
pub const LAG: MeasurementSpec = number("lag", Unit::Microsecond, Dimension::Time, LATE);
/// Points that the fit left out, as a fraction of all.
pub const REJECTED_SHARE: MeasurementSpec = percent("rejected", "Spikes: look for loose connectors and motors nearby.");
/// Turns of the shortest spin.
pub const TURNS: MeasurementSpec = number("turns", Unit::Count, Dimension::Count, "The record is short: spin longer.");

/// The module spins about Z with Z to the north, in both senses and at two speeds.
pub(super) static ELLIPSE: ItemSpec = ItemSpec {
    title: "Magnetometer, plane of rotation",
    params: &[
        quantity("spin", "rate of the fast spin", Unit::DegreePerSecond, (30.0, 7200.0), 5400.0),
        quantity("slow_spin", "rate of the slow spin", Unit::DegreePerSecond, (10.0, 7200.0), 1800.0),
        ParamSpec {
            name: "senses",
            about: "senses of the spin: one sense alone cannot tell a sampling skew from a skewed axis",
            kind: ParamKind::Choices { of: &["+", "-"], default: &["+", "-"] },
        },
        quantity("duration", "time of each spin at full rate", Unit::Second, (1.0, 3600.0), 180.0),
        ParamSpec {
            name: "turn_rate",
            ..quantity("turn_rate", "samples per second", Unit::Hertz, (100.0, 1000.0), 1000.0)
        },
        SETTLE,
        COVERAGE,
    ],
    measurements: measurements![
        ZERO_OF_AXIS,
        [SENSITIVITY_RATIO, ALPHA, RADIUS, RESIDUAL_RMS, RESIDUAL_PEAK],
        ROLL_ERROR,
        [SKEW, LAG, REJECTED_SHARE, TURNS],
        OF_SAMPLES,
    ],
    devices: &[Device::Slave, Device::Operator],
    resources: &[Resource::Attitude, Resource::Link],
    needs: &[],
    traces: Traces::CAPTURES,
    timeout_s: 7200.0,
};

/// Hard iron along each axis.
pub const HARD_IRON: [MeasurementSpec; 3] =
    [gauss("hard_iron_x", ZERO), gauss("hard_iron_y", ZERO), gauss("hard_iron_z", ZERO)];
/// Elements of the correction less those of the unit matrix: the diagonal, then xy, xz and yz.
pub const SOFT_IRON: [MeasurementSpec; 6] = [
    ppm("soft_iron_xx", SHAPE),
    ppm("soft_iron_yy", SHAPE),
    ppm("soft_iron_zz", SHAPE),
    ppm("soft_iron_xy", SHAPE),
    ppm("soft_iron_xz", SHAPE),
    ppm("soft_iron_yz", SHAPE),
];
/// Length of the corrected field.
pub const FIELD_STRENGTH: MeasurementSpec = gauss("field", FIELD);
/// Error of that length against the field of the bench file.
pub const FIELD_ERROR: MeasurementSpec = percent("field_error", FIELD);
/// Root mean square of what the model leaves, over the field.
pub const RESIDUAL: MeasurementSpec = percent("residual", ROUND);
/// Evenness of the directions of the field over the sphere.
pub const COVERAGE_OF_SPHERE: MeasurementSpec =
    percent("coverage_of_sphere", "Some directions are missing: turn the module through more attitudes.");
/// Points that the fit left out.
pub const REJECTED: MeasurementSpec = count("rejected", "Spikes: look for loose connectors and motors nearby.");

/// Hard and soft iron over many attitudes.
pub(super) static ELLIPSOID: ItemSpec = ItemSpec {
    title: "Magnetometer, sphere",
    params: &[
        // The fit has nine parameters, so six attitudes are too few.
        ParamSpec {
            name: "positions",
            about: "attitudes: 12 are each axis up and down at two headings, 24 at four",
            kind: ParamKind::Choice { of: &["12", "24"], default: "24" },
        },
        quantity("dwell", "time in each position", Unit::Second, (0.5, 600.0), 5.0),
        RATE,
        SETTLE,
        COVERAGE,
    ],
    measurements: measurements![
        HARD_IRON,
        SOFT_IRON,
        [FIELD_STRENGTH, FIELD_ERROR, RESIDUAL, COVERAGE_OF_SPHERE, REJECTED],
        OF_SAMPLES,
    ],
    devices: &[Device::Slave, Device::Operator],
    resources: &[Resource::Attitude, Resource::Link],
    needs: &[],
    traces: Traces::CAPTURES,
    timeout_s: 7200.0,
};
