//! Calibration of accelerometers and gyroscopes, and its storage in the module.

use super::shared::{
    ANGLE, ANGLE_U, BAND, CALIBRATED, CLOCK_U, COVERAGE, DWELL, GEOMETRY, GRAVITY_U, HEADING, HEADING_U, OF_SAMPLES,
    POSE_U, POSITIONS, RAMP, RATE, REST, SETTLE, SPAN, TEMPERATURE, TEMPERATURE_DRIFT, TURN_RATE, dph, measurements,
    mg, ppm,
};
use super::{
    Device, ItemId, ItemSpec, MeasurementSpec, ParamKind, ParamSpec, Resource, Trace, Traces, count, number, text,
};
use crate::quantity::{Dimension, Unit};

const ACCEL_BIAS: &str = "Is this accelerometer in its range in every position? If it is, suspect the sensor.";
const SCALE: &str =
    "Check gravity and the angle of the turns in plan and bench file; if they are right, suspect the sensor.";
const COUPLING: &str = "A socket turned by 3.4 arc minutes adds 0.1 %: check the seat. The seat does not change the angles between the module's axes (nonorthogonality).";
const ANGLES: &str = "The axes of the sensors are not square to each other. This is a property of the module; its seat does not change it.";
const RESIDUAL: &str = "The positions do not fit one model: look for a position in which the module moved or was not at the right attitude.";

/// Bias of each accelerometer.
pub const FORCE_BIAS: [MeasurementSpec; 3] =
    [mg("bias_x", ACCEL_BIAS), mg("bias_y", ACCEL_BIAS), mg("bias_z", ACCEL_BIAS)];
/// Error of each scale factor against the nominal one.
pub const SCALE_ERROR: [MeasurementSpec; 3] =
    [ppm("scale_error_x", SCALE), ppm("scale_error_y", SCALE), ppm("scale_error_z", SCALE)];
/// Coupling of an axis (second letter) into a sensor (first letter), relative to the seat; sensors and axes as in
/// [`COUPLED_PAIRS`](super::COUPLED_PAIRS).
pub const COUPLINGS: [MeasurementSpec; 6] = [
    ppm("coupling_xy", COUPLING),
    ppm("coupling_xz", COUPLING),
    ppm("coupling_yx", COUPLING),
    ppm("coupling_yz", COUPLING),
    ppm("coupling_zx", COUPLING),
    ppm("coupling_zy", COUPLING),
];
/// Departure of the angle between two sensors from a right angle; the sensors as in [`SENSOR_PAIRS`](super::SENSOR_PAIRS).
pub const NONORTHOGONALITY: [MeasurementSpec; 3] =
    [ppm("nonorthogonality_xy", ANGLES), ppm("nonorthogonality_xz", ANGLES), ppm("nonorthogonality_yz", ANGLES)];
/// Root mean square of what the model leaves of the positions.
pub const FORCE_RESIDUAL: MeasurementSpec = mg("residual_rms", RESIDUAL);

/// Accelerometers from still positions.
pub(super) static SIX_POSITION: ItemSpec = ItemSpec {
    title: "Accelerometer calibration, positions",
    params: &[POSITIONS, DWELL, RATE, SETTLE, COVERAGE, POSE_U, GRAVITY_U],
    measurements: measurements![
        FORCE_BIAS,
        SCALE_ERROR,
        COUPLINGS,
        NONORTHOGONALITY,
        [FORCE_RESIDUAL, TEMPERATURE, TEMPERATURE_DRIFT],
        OF_SAMPLES,
    ],
    devices: &[Device::Slave, Device::Operator],
    resources: &[Resource::Attitude, Resource::Link],
    needs: &[],
    traces: Traces::CAPTURES,
    timeout_s: 14_400.0,
};

const GYRO_BIAS: &str = "Is this gyroscope alive and the module still? If it is, suspect the sensor.";
const PER_G: &str = "This gyroscope answers to gravity more than it should: suspect the sensor or its mounting.";

const fn per_g(name: &'static str) -> MeasurementSpec {
    number(name, Unit::DegreePerHourPerGravity, Dimension::GSensitivity, PER_G)
}

const fn dps(name: &'static str) -> MeasurementSpec {
    number(name, Unit::DegreePerSecond, Dimension::AngularRate, GYRO_BIAS)
}

/// Bias of each gyroscope.
pub const RATE_BIAS: [MeasurementSpec; 3] = [dps("bias_x"), dps("bias_y"), dps("bias_z")];
/// Answer of each gyroscope (row) to the force along each axis (column).
pub const G_SENSITIVITY: [[MeasurementSpec; 3]; 3] = [
    [per_g("g_sensitivity_xx"), per_g("g_sensitivity_xy"), per_g("g_sensitivity_xz")],
    [per_g("g_sensitivity_yx"), per_g("g_sensitivity_yy"), per_g("g_sensitivity_yz")],
    [per_g("g_sensitivity_zx"), per_g("g_sensitivity_zy"), per_g("g_sensitivity_zz")],
];
/// Root mean square of what the model leaves of the positions.
pub const RATE_RESIDUAL: MeasurementSpec = dph("residual_rms", RESIDUAL);

/// Gyroscopes from still positions: bias and g-sensitivity.
pub(super) static GYRO_STILL: ItemSpec = ItemSpec {
    title: "Gyroscope calibration, stillness",
    params: &[
        ParamSpec {
            name: "of",
            about: "the item whose positions are used",
            kind: ParamKind::Source { of: &[ItemId::SixPosition] },
        },
        POSITIONS,
        DWELL,
        RATE,
        SETTLE,
        COVERAGE,
        HEADING,
        HEADING_U,
    ],
    measurements: measurements![
        RATE_BIAS,
        G_SENSITIVITY[0],
        G_SENSITIVITY[1],
        G_SENSITIVITY[2],
        [RATE_RESIDUAL, TEMPERATURE, TEMPERATURE_DRIFT],
        OF_SAMPLES,
    ],
    devices: &[Device::Slave, Device::Operator],
    resources: &[Resource::Attitude, Resource::Link],
    needs: &[],
    traces: Traces::CAPTURES,
    timeout_s: 14_400.0,
};

const AT_ATTITUDE: &str = "This bias is for the attitude of the turns and contains g-sensitivity: compare it with the bias from the still positions.";
const MISMATCH: &str = "The table did not turn by the same angle in both senses: check the table.";

/// Bias of each gyroscope at the attitude of the turns.
pub const BIAS_AT_ATTITUDE: [MeasurementSpec; 3] = [
    dph("bias_at_attitude_x", AT_ATTITUDE),
    dph("bias_at_attitude_y", AT_ATTITUDE),
    dph("bias_at_attitude_z", AT_ATTITUDE),
];
/// Difference between the turns in both senses about each axis.
pub const TURN_MISMATCH: [MeasurementSpec; 3] =
    [ppm("mismatch_x", MISMATCH), ppm("mismatch_y", MISMATCH), ppm("mismatch_z", MISMATCH)];

/// Gyroscopes from turns by a known angle.
pub(super) static ROTATION: ItemSpec = ItemSpec {
    title: "Gyroscope calibration, rotation",
    params: &[ANGLE, SPAN, RAMP, REST, TURN_RATE, SETTLE, GEOMETRY, BAND, COVERAGE, ANGLE_U, CLOCK_U, POSE_U],
    measurements: measurements![
        SCALE_ERROR,
        COUPLINGS,
        NONORTHOGONALITY,
        BIAS_AT_ATTITUDE,
        TURN_MISMATCH,
        [TEMPERATURE, TEMPERATURE_DRIFT],
        OF_SAMPLES,
    ],
    devices: &[Device::Slave, Device::Operator],
    resources: &[Resource::Attitude, Resource::Link],
    needs: &[],
    traces: Traces::CAPTURES,
    timeout_s: 3600.0,
};

/// Coefficients that the module takes.
pub const COEFFICIENTS: MeasurementSpec =
    count("coefficients", "The module takes accelerometer, gyroscope and magnetometer coefficients.");
/// Coefficients that do not read back as they were written, bit for bit.
pub const COEFFICIENTS_ALTERED: MeasurementSpec =
    count("coefficients_altered", "The coefficients read back differ from those written: suspect the module's flash.");
/// "good", or what is wrong with the stored coefficients.
pub const CHECKSUM: MeasurementSpec =
    text("checksum", "The stored checksum does not match the stored coefficients: suspect the module's flash.");
/// Time to store the coefficients.
pub const STORE_TIME: MeasurementSpec = number(
    "write_time",
    Unit::Millisecond,
    Dimension::Time,
    "Storing takes long: suspect the module's flash, or its supply.",
);

/// The coefficients are stored in the module.
pub(super) static DOWNLOAD: ItemSpec = ItemSpec {
    title: "Calibration stored in the module",
    params: &[],
    measurements: &[COEFFICIENTS, COEFFICIENTS_ALTERED, CHECKSUM, STORE_TIME],
    devices: &[Device::Slave, Device::BoardSupply, Device::BoardCalibration],
    resources: &[Resource::Flash, Resource::Link, Resource::Power],
    needs: CALIBRATED,
    traces: Traces { leaves: &[Trace::PowerOn, Trace::Coefficients], feels: &[] },
    timeout_s: 600.0,
};

const CHECK_ACCEL: &str = "The stored calibration does not give gravity: since the calibration, was the module moved in its socket, or another calibration stored? If not, calibrate again.";
const CHECK_GYRO: &str =
    "The stored calibration does not give the angle of the turn: check the table, then calibrate again.";

/// Error of the compensated specific force along each axis.
pub const FORCE_ERROR: [MeasurementSpec; 3] =
    [mg("force_error_x", CHECK_ACCEL), mg("force_error_y", CHECK_ACCEL), mg("force_error_z", CHECK_ACCEL)];
/// Error of the compensated angular rate about each axis.
pub const RATE_ERROR: [MeasurementSpec; 3] =
    [dph("rate_error_x", CHECK_GYRO), dph("rate_error_y", CHECK_GYRO), dph("rate_error_z", CHECK_GYRO)];
/// Error of the angle of the turn.
pub const ANGLE_ERROR: MeasurementSpec = ppm("angle_error", CHECK_GYRO);
/// Angle that shows across the axis of the turn.
pub const CROSS_ANGLE: MeasurementSpec = ppm("cross_angle", CHECK_GYRO);

/// One position and one rotation with samples that the module itself compensates.
pub(super) static CHECK: ItemSpec = ItemSpec {
    title: "Check of the stored calibration",
    params: &[
        super::shared::quantity("dwell", "time in the position", Unit::Second, (10.0, 3600.0), 60.0),
        RATE,
        SETTLE,
        ParamSpec {
            name: "axis",
            about: "axis that points up in the position; the module turns about it",
            kind: ParamKind::Choice { of: &["x", "y", "z"], default: "z" },
        },
        ANGLE,
        SPAN,
        RAMP,
        REST,
        TURN_RATE,
        COVERAGE,
        HEADING,
        HEADING_U,
        POSE_U,
        GRAVITY_U,
        ANGLE_U,
        CLOCK_U,
    ],
    measurements: measurements![FORCE_ERROR, RATE_ERROR, [ANGLE_ERROR, CROSS_ANGLE], OF_SAMPLES,],
    devices: &[Device::Slave, Device::Operator, Device::BoardCalibration],
    resources: &[Resource::Attitude, Resource::Link],
    needs: &[(ItemId::CalibrationDownload, None)],
    traces: Traces::COMPENSATED,
    timeout_s: 1800.0,
};
