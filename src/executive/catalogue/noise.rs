//! Noise over time and over frequency.

use super::performance::STILL;
use super::shared::{
    COMPENSATED, COVERAGE, FAILED_READS, RATE, SAMPLE_RATE, SENSORS, SETTLE, SPIKES, STALE_SAMPLES, dph, mg, quantity,
};
use super::{Device, ItemSpec, MeasurementSpec, ParamKind, ParamSpec, Resource, if_text, number};
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

/// Overlapping Allan deviation of all axes.
pub(super) static ALLAN: ItemSpec = ItemSpec {
    title: "Allan deviation",
    params: &[SENSORS, OF, DURATION, RATE, SETTLE],
    measurements: &[
        arw("angle_random_walk_x"),
        arw("angle_random_walk_y"),
        arw("angle_random_walk_z"),
        gyro(dph("bias_instability_gyro_x", FLOOR)),
        gyro(dph("bias_instability_gyro_y", FLOOR)),
        gyro(dph("bias_instability_gyro_z", FLOOR)),
        gyro(dph("bias_instability_bound_gyro_x", FLOOR)),
        gyro(dph("bias_instability_bound_gyro_y", FLOOR)),
        gyro(dph("bias_instability_bound_gyro_z", FLOOR)),
        vrw("velocity_random_walk_x"),
        vrw("velocity_random_walk_y"),
        vrw("velocity_random_walk_z"),
        accel(mg("bias_instability_accel_x", FLOOR)),
        accel(mg("bias_instability_accel_y", FLOOR)),
        accel(mg("bias_instability_accel_z", FLOOR)),
        accel(mg("bias_instability_bound_accel_x", FLOOR)),
        accel(mg("bias_instability_bound_accel_y", FLOOR)),
        accel(mg("bias_instability_bound_accel_z", FLOOR)),
        SAMPLE_RATE,
        FAILED_READS,
        STALE_SAMPLES,
        SPIKES,
    ],
    devices: &[Device::Slave],
    resources: &[Resource::Still, Resource::Link],
    needs: COMPENSATED,
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
    measurements: &[
        rate_density("density_gyro_x"),
        rate_density("density_gyro_y"),
        rate_density("density_gyro_z"),
        force_density("density_accel_x"),
        force_density("density_accel_y"),
        force_density("density_accel_z"),
        gyro(line("line_gyro_x")),
        gyro(line("line_gyro_y")),
        gyro(line("line_gyro_z")),
        accel(line("line_accel_x")),
        accel(line("line_accel_y")),
        accel(line("line_accel_z")),
        SAMPLE_RATE,
        FAILED_READS,
        STALE_SAMPLES,
        SPIKES,
    ],
    devices: &[Device::Slave],
    resources: &[Resource::Still, Resource::Link],
    needs: COMPENSATED,
    timeout_s: 80_000.0,
};
