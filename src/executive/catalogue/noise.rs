//! Noise over time and over frequency.

use super::performance::STILL;
use super::shared::{
    COMPENSATED, COVERAGE, OF_SAMPLES, PerTriad, RATE, SENSORS, SETTLE, dph, measurements, mg, quantity,
};
use super::{Device, ItemSpec, MeasurementSpec, ParamKind, ParamSpec, Resource, Traces, if_text, number};
use crate::quantity::{Dimension, Unit};

const WALK: &str = "More noise than usual: look for vibration, then suspect this sensor.";
const FLOOR: &str = "The bias wanders more than usual: look for draughts first, then suspect this sensor.";
const LINE: &str = "Something shakes the table at one frequency (see the spectrum), or disturbs the supply.";

const OF: ParamSpec =
    ParamSpec { name: "of", about: "the item whose hour of stillness is used", kind: ParamKind::Source { of: STILL } };

const DURATION: ParamSpec = quantity("duration", "time of stillness", Unit::Second, (60.0, 86_400.0), 3600.0);

const fn gyro(spec: MeasurementSpec) -> MeasurementSpec {
    if_text(spec, "sensors", "gyro")
}

const fn accel(spec: MeasurementSpec) -> MeasurementSpec {
    if_text(spec, "sensors", "accel")
}

const fn arw(name: &'static str) -> MeasurementSpec {
    gyro(number(name, Unit::DegreePerRootHour, Dimension::AngleRandomWalk, WALK))
}

const fn vrw(name: &'static str) -> MeasurementSpec {
    accel(number(name, Unit::MetrePerSecondPerRootHour, Dimension::VelocityRandomWalk, WALK))
}

/// Random walk of each sensor: N of the Allan deviation.
pub const RANDOM_WALK: PerTriad<3> = PerTriad {
    gyro: [arw("angle_random_walk_x"), arw("angle_random_walk_y"), arw("angle_random_walk_z")],
    accel: [vrw("velocity_random_walk_x"), vrw("velocity_random_walk_y"), vrw("velocity_random_walk_z")],
};
/// Bias instability of each sensor: B of the Allan deviation.
pub const BIAS_INSTABILITY: PerTriad<3> = PerTriad {
    gyro: [
        gyro(dph("bias_instability_gyro_x", FLOOR)),
        gyro(dph("bias_instability_gyro_y", FLOOR)),
        gyro(dph("bias_instability_gyro_z", FLOOR)),
    ],
    accel: [
        accel(mg("bias_instability_accel_x", FLOOR)),
        accel(mg("bias_instability_accel_y", FLOOR)),
        accel(mg("bias_instability_accel_z", FLOOR)),
    ],
};
/// Upper bound of the bias instability, whether the record shows a flat part or not.
pub const BIAS_INSTABILITY_BOUND: PerTriad<3> = PerTriad {
    gyro: [
        gyro(dph("bias_instability_bound_gyro_x", FLOOR)),
        gyro(dph("bias_instability_bound_gyro_y", FLOOR)),
        gyro(dph("bias_instability_bound_gyro_z", FLOOR)),
    ],
    accel: [
        accel(mg("bias_instability_bound_accel_x", FLOOR)),
        accel(mg("bias_instability_bound_accel_y", FLOOR)),
        accel(mg("bias_instability_bound_accel_z", FLOOR)),
    ],
};

/// Overlapping Allan deviation of all axes.
pub(super) static ALLAN: ItemSpec = ItemSpec {
    title: "Allan deviation",
    params: &[SENSORS, OF, DURATION, RATE, SETTLE],
    measurements: measurements![
        RANDOM_WALK.gyro,
        BIAS_INSTABILITY.gyro,
        BIAS_INSTABILITY_BOUND.gyro,
        RANDOM_WALK.accel,
        BIAS_INSTABILITY.accel,
        BIAS_INSTABILITY_BOUND.accel,
        OF_SAMPLES,
    ],
    devices: &[Device::Slave],
    resources: &[Resource::Still, Resource::Link],
    needs: COMPENSATED,
    traces: Traces::CAPTURES,
    timeout_s: 80_000.0,
};

const fn rate_density(name: &'static str) -> MeasurementSpec {
    gyro(number(name, Unit::DegreePerSecondPerRootHertz, Dimension::AngleRandomWalk, WALK))
}

const fn force_density(name: &'static str) -> MeasurementSpec {
    accel(number(name, Unit::MicrogravityPerRootHertz, Dimension::VelocityRandomWalk, WALK))
}

const fn line(name: &'static str) -> MeasurementSpec {
    number(name, Unit::Count, Dimension::Count, LINE)
}

/// Level of the white noise of each sensor.
pub const DENSITY: PerTriad<3> = PerTriad {
    gyro: [rate_density("density_gyro_x"), rate_density("density_gyro_y"), rate_density("density_gyro_z")],
    accel: [force_density("density_accel_x"), force_density("density_accel_y"), force_density("density_accel_z")],
};
/// Strongest line in the spectrum of each sensor, over its neighbours.
pub const STRONGEST_LINE: PerTriad<3> = PerTriad {
    gyro: [gyro(line("line_gyro_x")), gyro(line("line_gyro_y")), gyro(line("line_gyro_z"))],
    accel: [accel(line("line_accel_x")), accel(line("line_accel_y")), accel(line("line_accel_z"))],
};

/// One-sided spectra of all axes.
pub(super) static PSD: ItemSpec = ItemSpec {
    title: "Power spectral density",
    params: &[
        SENSORS,
        OF,
        DURATION,
        RATE,
        SETTLE,
        ParamSpec {
            name: "segment",
            about: "samples of a segment",
            kind: ParamKind::Integer { min: 64, max: 1_048_576, default: 4096 },
        },
        COVERAGE,
    ],
    measurements: measurements![DENSITY.gyro, DENSITY.accel, STRONGEST_LINE.gyro, STRONGEST_LINE.accel, OF_SAMPLES,],
    devices: &[Device::Slave],
    resources: &[Resource::Still, Resource::Link],
    needs: COMPENSATED,
    traces: Traces::CAPTURES,
    timeout_s: 80_000.0,
};
