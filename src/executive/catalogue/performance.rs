//! The errors that remain after calibration: biases, their stability and repeatability, resolution.

use super::shared::{
    CALIBRATED, COMPENSATED, COVERAGE, DWELL, GRAVITY_U, HEADING, HEADING_U, OF_SAMPLES, POSE_U, PerTriad, RATE,
    SENSORS, SETTLE, TEMPERATURE, TEMPERATURE_DRIFT, dph, measurements, mg, percent, quantity,
};
use super::{Device, ItemId, ItemSpec, MeasurementSpec, ParamKind, ParamSpec, Resource, Traces, if_text, number, text};
use crate::quantity::{Dimension, Unit};

const BIAS: &str = "The calibration is no longer right: has the module warmed up, and does it lie as in its calibration? If so, calibrate again.";
const STABILITY: &str = "The bias wanders: look for draughts and vibration first, then suspect this sensor.";
const REPEATABILITY: &str = "The bias differs from power-on to power-on: suspect this sensor or its supply.";

const fn gyro(spec: MeasurementSpec) -> MeasurementSpec {
    if_text(spec, "sensors", "gyro")
}

const fn accel(spec: MeasurementSpec) -> MeasurementSpec {
    if_text(spec, "sensors", "accel")
}

/// Rate that calibration leaves of each gyroscope at rest.
pub const RATE_BIAS_LEFT: [MeasurementSpec; 3] = [dph("bias_x", BIAS), dph("bias_y", BIAS), dph("bias_z", BIAS)];
/// What the rates still hold of the earth's rotation.
pub const EARTH_LABEL: MeasurementSpec =
    text("label", "This text says how much of the earth's rotation is still in the figures.");

/// Three minutes of compensated rate, the axis Z up.
pub(super) static GYRO_BIAS: ItemSpec = ItemSpec {
    title: "Gyroscope bias",
    params: &[
        quantity("dwell", "time of stillness", Unit::Second, (10.0, 7200.0), 180.0),
        RATE,
        SETTLE,
        COVERAGE,
        HEADING,
        HEADING_U,
        POSE_U,
    ],
    measurements: measurements![RATE_BIAS_LEFT, [EARTH_LABEL, TEMPERATURE], OF_SAMPLES,],
    devices: &[Device::Slave],
    resources: &[Resource::Still, Resource::Link],
    needs: CALIBRATED,
    traces: Traces::CAPTURES,
    timeout_s: 14_400.0,
};

const fn if_axis(spec: MeasurementSpec, axis: &'static str) -> MeasurementSpec {
    if_text(spec, "axes", axis)
}

/// Bias that calibration leaves of each accelerometer.
pub const FORCE_BIAS_LEFT: [MeasurementSpec; 3] =
    [if_axis(mg("bias_x", BIAS), "x"), if_axis(mg("bias_y", BIAS), "y"), if_axis(mg("bias_z", BIAS), "z")];

/// The module turns upside down about the third axis. This cancels the error of level and the coupling to the axis that
/// is up.
pub(super) static ACCEL_BIAS: ItemSpec = ItemSpec {
    title: "Accelerometer bias",
    params: &[
        ParamSpec {
            name: "axes",
            about: "axes to measure; each needs a position, and that position turned upside down about the third axis",
            kind: ParamKind::Choices { of: &["x", "y", "z"], default: &["x", "y", "z"] },
        },
        quantity("dwell", "time in each position", Unit::Second, (10.0, 7200.0), 180.0),
        RATE,
        SETTLE,
        COVERAGE,
        POSE_U,
        GRAVITY_U,
    ],
    measurements: measurements![FORCE_BIAS_LEFT, [TEMPERATURE], OF_SAMPLES,],
    devices: &[Device::Slave, Device::Operator],
    resources: &[Resource::Attitude, Resource::Link],
    needs: &[(ItemId::SixPosition, None)],
    traces: Traces::CAPTURES,
    timeout_s: 14_400.0,
};

/// Standard deviation of disjoint means of each sensor.
pub const BIAS_STABILITY_SD: PerTriad<3> = PerTriad {
    gyro: [
        gyro(dph("bias_stability_gyro_x", STABILITY)),
        gyro(dph("bias_stability_gyro_y", STABILITY)),
        gyro(dph("bias_stability_gyro_z", STABILITY)),
    ],
    accel: [
        accel(mg("bias_stability_accel_x", STABILITY)),
        accel(mg("bias_stability_accel_y", STABILITY)),
        accel(mg("bias_stability_accel_z", STABILITY)),
    ],
};

/// Disjoint means over an hour.
pub(super) static BIAS_STABILITY: ItemSpec = ItemSpec {
    title: "Bias stability",
    params: &[
        SENSORS,
        quantity("duration", "time of stillness", Unit::Second, (60.0, 86_400.0), 3600.0),
        quantity("block", "time of each mean", Unit::Second, (0.1, 600.0), 10.0),
        RATE,
        SETTLE,
        COVERAGE,
    ],
    measurements: measurements![
        BIAS_STABILITY_SD.gyro,
        BIAS_STABILITY_SD.accel,
        [TEMPERATURE, TEMPERATURE_DRIFT],
        OF_SAMPLES,
    ],
    devices: &[Device::Slave],
    resources: &[Resource::Still, Resource::Link],
    needs: COMPENSATED,
    traces: Traces::CAPTURES,
    timeout_s: 80_000.0,
};

/// Standard deviation of the means of each sensor from power-on to power-on.
pub const BIAS_REPEATABILITY_SD: PerTriad<3> = PerTriad {
    gyro: [
        gyro(dph("bias_repeatability_gyro_x", REPEATABILITY)),
        gyro(dph("bias_repeatability_gyro_y", REPEATABILITY)),
        gyro(dph("bias_repeatability_gyro_z", REPEATABILITY)),
    ],
    accel: [
        accel(mg("bias_repeatability_accel_x", REPEATABILITY)),
        accel(mg("bias_repeatability_accel_y", REPEATABILITY)),
        accel(mg("bias_repeatability_accel_z", REPEATABILITY)),
    ],
};

/// Means after power cycles.
pub(super) static BIAS_REPEATABILITY: ItemSpec = ItemSpec {
    title: "Bias repeatability",
    params: &[
        SENSORS,
        ParamSpec {
            name: "runs",
            about: "runs, each after its own power-on",
            kind: ParamKind::Integer { min: 3, max: 50, default: 6 },
        },
        ParamSpec { name: "dwell", about: "time of each run", ..DWELL },
        quantity("gap", "time between the end of a run and the next power-on", Unit::Second, (0.0, 86_400.0), 600.0),
        RATE,
        SETTLE,
        COVERAGE,
    ],
    measurements: measurements![
        BIAS_REPEATABILITY_SD.gyro,
        BIAS_REPEATABILITY_SD.accel,
        [TEMPERATURE, TEMPERATURE_DRIFT],
        OF_SAMPLES,
    ],
    devices: &[Device::Slave, Device::BoardSupply],
    resources: &[Resource::Still, Resource::Link, Resource::Power],
    needs: COMPENSATED,
    traces: Traces::CYCLES_AND_CAPTURES,
    timeout_s: 80_000.0,
};

const STEP: &str = "The mean does not follow a small step in both senses: check that the fixture made the step, then suspect this sensor or its converter.";
const RANGE: &str = "The range comes from the settings of the part and its codes; no motion has shown it.";

/// Default for means of ten seconds and a module that just keeps 10 deg/h of bias stability: 14 cycles tell half a step
/// of 18 deg/h from the whole step.
const CYCLES_GYRO: ParamSpec = ParamSpec {
    name: "gyro_cycles",
    about: "steps of each gyroscope in each sense, each between two levels without a step",
    kind: ParamKind::Integer { min: 2, max: 1000, default: 14 },
};

/// Default for a step of 1 mg and means that scatter by a quarter of it.
const CYCLES_ACCEL: ParamSpec = ParamSpec {
    name: "accel_cycles",
    about: "steps of each accelerometer in each sense, each between two levels without a step",
    kind: ParamKind::Integer { min: 2, max: 1000, default: 10 },
};

/// Response of each sensor to the step, over the step.
pub const STEP_RESPONSE: PerTriad<3> = PerTriad {
    gyro: [
        gyro(percent("step_response_gyro_x", STEP)),
        gyro(percent("step_response_gyro_y", STEP)),
        gyro(percent("step_response_gyro_z", STEP)),
    ],
    accel: [
        accel(percent("step_response_accel_x", STEP)),
        accel(percent("step_response_accel_y", STEP)),
        accel(percent("step_response_accel_z", STEP)),
    ],
};
/// Range of gyroscopes, accelerometers and magnetometer.
pub const RANGES: [MeasurementSpec; 3] = [
    number("range_gyro", Unit::DegreePerSecond, Dimension::AngularRate, RANGE),
    number("range_accel", Unit::Gravity, Dimension::Acceleration, RANGE),
    number("range_mag", Unit::Gauss, Dimension::MagneticField, RANGE),
];

/// Small steps in both senses.
pub(super) static RESOLUTION: ItemSpec = ItemSpec {
    title: "Resolution",
    params: &[
        SENSORS,
        quantity("gyro_step", "step of the angular rate", Unit::DegreePerSecond, (0.0001, 10.0), 0.005),
        quantity(
            "accel_step",
            "step of the specific force, by tilting from level",
            Unit::Milligravity,
            (0.01, 100.0),
            1.0,
        ),
        CYCLES_GYRO,
        CYCLES_ACCEL,
        quantity("dwell", "time on each level", Unit::Second, (1.0, 3600.0), 10.0),
        RATE,
        SETTLE,
        COVERAGE,
        POSE_U,
    ],
    measurements: measurements![STEP_RESPONSE.gyro, STEP_RESPONSE.accel, RANGES, OF_SAMPLES,],
    devices: &[Device::Slave, Device::Operator],
    resources: &[Resource::Attitude, Resource::Link],
    needs: COMPENSATED,
    traces: Traces::CAPTURES,
    timeout_s: 7200.0,
};

/// Items with an hour of stillness.
pub(super) const STILL: &[ItemId] = &[ItemId::BiasStability];
