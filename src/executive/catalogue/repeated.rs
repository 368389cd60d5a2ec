//! Whole calibrations after power cycles: how well their scale factors and couplings agree.

use super::shared::{
    ANGLE, ANGLE_U, BAND, CLOCK_U, COVERAGE, DWELL, GEOMETRY, GRAVITY_U, OF_SAMPLES, POSE_U, POSITIONS, PerTriad, RAMP,
    RATE, REST, SENSORS, SETTLE, SPAN, TEMPERATURE, TEMPERATURE_DRIFT, TURN_RATE, measurements, ppm,
};
use super::{Device, ItemId, ItemSpec, MeasurementSpec, ParamKind, ParamSpec, Resource, Traces, if_text};

const SCALE: &str = "The scale factor differs from power-on to power-on: suspect this sensor or its supply.";
const COUPLING: &str = "Calibrations disagree about this pair of axes: was the module put into its socket again between them? If not, suspect the sensors.";
const ANGLES: &str =
    "The angles between the sensors' axes change from calibration to calibration: suspect the sensors.";

const fn gyro(name: &'static str, look_at: &'static str) -> MeasurementSpec {
    if_text(ppm(name, look_at), "sensors", "gyro")
}

const fn accel(name: &'static str, look_at: &'static str) -> MeasurementSpec {
    if_text(ppm(name, look_at), "sensors", "accel")
}

const CALIBRATIONS: ParamSpec = ParamSpec {
    name: "calibrations",
    about: "whole calibrations, each after its own power-on",
    kind: ParamKind::Integer { min: 2, max: 50, default: 6 },
};

/// Relative standard deviation of each scale factor from power-on to power-on.
pub const SCALE_FACTOR_SD: PerTriad<3> = PerTriad {
    gyro: [
        gyro("scale_factor_repeatability_gyro_x", SCALE),
        gyro("scale_factor_repeatability_gyro_y", SCALE),
        gyro("scale_factor_repeatability_gyro_z", SCALE),
    ],
    accel: [
        accel("scale_factor_repeatability_accel_x", SCALE),
        accel("scale_factor_repeatability_accel_y", SCALE),
        accel("scale_factor_repeatability_accel_z", SCALE),
    ],
};

/// Positions and rotations, repeated after each power-on.
pub(super) static SCALE_FACTOR_REPEATABILITY: ItemSpec = ItemSpec {
    title: "Scale factor repeatability",
    params: &[
        SENSORS,
        CALIBRATIONS,
        POSITIONS,
        DWELL,
        RATE,
        SETTLE,
        ANGLE,
        SPAN,
        RAMP,
        REST,
        TURN_RATE,
        GEOMETRY,
        BAND,
        COVERAGE,
        POSE_U,
        GRAVITY_U,
        ANGLE_U,
        CLOCK_U,
    ],
    measurements: measurements![
        SCALE_FACTOR_SD.gyro,
        SCALE_FACTOR_SD.accel,
        [TEMPERATURE, TEMPERATURE_DRIFT],
        OF_SAMPLES,
    ],
    devices: &[Device::Slave, Device::Operator, Device::BoardSupply],
    resources: &[Resource::Attitude, Resource::Link, Resource::Power],
    needs: &[],
    traces: Traces::CYCLES_AND_CAPTURES,
    timeout_s: 80_000.0,
};

/// Coupling that the first calibration leaves; sensors and axes as in [`COUPLED_PAIRS`](super::COUPLED_PAIRS).
pub const COUPLINGS_LEFT: PerTriad<6> = PerTriad {
    gyro: [
        gyro("coupling_gyro_xy", COUPLING),
        gyro("coupling_gyro_xz", COUPLING),
        gyro("coupling_gyro_yx", COUPLING),
        gyro("coupling_gyro_yz", COUPLING),
        gyro("coupling_gyro_zx", COUPLING),
        gyro("coupling_gyro_zy", COUPLING),
    ],
    accel: [
        accel("coupling_accel_xy", COUPLING),
        accel("coupling_accel_xz", COUPLING),
        accel("coupling_accel_yx", COUPLING),
        accel("coupling_accel_yz", COUPLING),
        accel("coupling_accel_zx", COUPLING),
        accel("coupling_accel_zy", COUPLING),
    ],
};
/// Angle between two sensors that the first calibration leaves; the sensors as in
/// [`SENSOR_PAIRS`](super::SENSOR_PAIRS).
pub const NONORTHOGONALITY_LEFT: PerTriad<3> = PerTriad {
    gyro: [
        gyro("nonorthogonality_gyro_xy", ANGLES),
        gyro("nonorthogonality_gyro_xz", ANGLES),
        gyro("nonorthogonality_gyro_yz", ANGLES),
    ],
    accel: [
        accel("nonorthogonality_accel_xy", ANGLES),
        accel("nonorthogonality_accel_xz", ANGLES),
        accel("nonorthogonality_accel_yz", ANGLES),
    ],
};

/// The later calibrations judged with the coefficients of the first one.
pub(super) static CROSS_COUPLING: ItemSpec = ItemSpec {
    title: "Cross coupling after compensation",
    params: &[
        SENSORS,
        ParamSpec {
            name: "of",
            about: "the item whose calibrations are used",
            kind: ParamKind::Source { of: &[ItemId::ScaleFactorRepeatability] },
        },
        CALIBRATIONS,
        POSITIONS,
        DWELL,
        RATE,
        SETTLE,
        ANGLE,
        SPAN,
        RAMP,
        REST,
        TURN_RATE,
        GEOMETRY,
        BAND,
        COVERAGE,
        POSE_U,
        GRAVITY_U,
        ANGLE_U,
        CLOCK_U,
    ],
    measurements: measurements![
        COUPLINGS_LEFT.gyro,
        COUPLINGS_LEFT.accel,
        NONORTHOGONALITY_LEFT.gyro,
        NONORTHOGONALITY_LEFT.accel,
        OF_SAMPLES,
    ],
    devices: &[Device::Slave, Device::Operator, Device::BoardSupply],
    resources: &[Resource::Attitude, Resource::Link, Resource::Power],
    needs: &[],
    traces: Traces::CYCLES_AND_CAPTURES,
    timeout_s: 80_000.0,
};
