//! Magnetometer: in its plane of rotation, and over the whole sphere.

use super::shared::{
    COVERAGE, FAILED_READS, RATE, SAMPLE_RATE, SETTLE, SPIKES, STALE_SAMPLES, gauss, percent, ppm, quantity,
};
use super::{Device, ItemSpec, ParamKind, ParamSpec, Resource, count, number};
use crate::quantity::{Dimension, Unit};

const ZERO: &str = "There is iron near the sensor or in the module: clear the table, then suspect the magnetometer.";
const SHAPE: &str = "The sensitivities differ or the axes are not square: suspect the magnetometer.";
const FIELD: &str =
    "Compare with the field in the bench file: look for iron nearby, or a wrong heading of the spin axis.";
const ROUND: &str = "The corrected points do not lie on a circle: look for a disturbance that changes with time.";
const ROLL: &str = "The roll angle has the same error in each turn: look at the corrected plot, and look for iron that turns with the module.";
const LATE: &str =
    "Channels are sampled one after the other, or the table's angle is late: compare with the part's data.";

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
    measurements: &[
        gauss("zero_x", ZERO),
        gauss("zero_y", ZERO),
        percent("sensitivity_ratio", SHAPE),
        number("alpha", Unit::Degree, Dimension::Angle, SHAPE),
        gauss("radius", FIELD),
        percent("residual_rms", ROUND),
        percent("residual_peak", ROUND),
        number("roll_error_1", Unit::Degree, Dimension::Angle, ROLL),
        number("roll_error_2", Unit::Degree, Dimension::Angle, ROLL),
        number("skew", Unit::Microsecond, Dimension::Time, LATE),
        number("lag", Unit::Microsecond, Dimension::Time, LATE),
        percent("rejected", "Spikes: look for loose connectors and motors nearby."),
        number("turns", Unit::Count, Dimension::Count, "The record is short: spin longer."),
        SAMPLE_RATE,
        FAILED_READS,
        STALE_SAMPLES,
        SPIKES,
    ],
    devices: &[Device::Slave, Device::Operator],
    resources: &[Resource::Attitude, Resource::Link],
    needs: &[],
    timeout_s: 7200.0,
};

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
    measurements: &[
        gauss("hard_iron_x", ZERO),
        gauss("hard_iron_y", ZERO),
        gauss("hard_iron_z", ZERO),
        ppm("soft_iron_xx", SHAPE),
        ppm("soft_iron_yy", SHAPE),
        ppm("soft_iron_zz", SHAPE),
        ppm("soft_iron_xy", SHAPE),
        ppm("soft_iron_xz", SHAPE),
        ppm("soft_iron_yz", SHAPE),
        gauss("field", FIELD),
        percent("field_error", FIELD),
        percent("residual", ROUND),
        percent("coverage_of_sphere", "Some directions are missing: turn the module through more attitudes."),
        count("rejected", "Spikes: look for loose connectors and motors nearby."),
        SAMPLE_RATE,
        FAILED_READS,
        STALE_SAMPLES,
        SPIKES,
    ],
    devices: &[Device::Slave, Device::Operator],
    resources: &[Resource::Attitude, Resource::Link],
    needs: &[],
    timeout_s: 7200.0,
};
