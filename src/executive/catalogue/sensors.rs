//! Inertial sensors, satellite receiver, AD channels and magnetometer.

use super::shared::{COVERAGE, FAILED_READS, SPIKES, STALE_SAMPLES, quantity};
use super::{Device, ItemSpec, ParamKind, ParamSpec, Resource, count, number, text};
use crate::quantity::{Dimension, Unit};

const GYRO: &str = "Is the module at rest? If it is, the zero rate of this gyroscope is off: suspect the sensor.";
const GYRO_NOISE: &str = "Too much: does anything shake the table? Too little or none: this gyroscope no longer measures; suspect it or its supply.";
const ACCEL: &str = "Is the module level and seated in its socket? If it is, suspect this accelerometer.";
const ACCEL_NOISE: &str = "Too much: does anything shake the table? Too little or none: this accelerometer no longer measures; suspect it or its supply.";
const TEMPERATURE: &str = "Let the module reach room temperature; if it has, suspect the temperature sensor.";

/// Gyroscopes and accelerometers at rest; axes of the module, right-handed, +1 g on the axis that points up.
pub(super) static IMU: ItemSpec = ItemSpec {
    title: "IMU at rest",
    params: &[
        ParamSpec {
            name: "samples",
            about: "samples to average",
            kind: ParamKind::Integer { min: 50, max: 10_000, default: 400 },
        },
        ParamSpec {
            name: "rate",
            about: "samples per second",
            kind: ParamKind::Quantity { unit: Unit::Hertz, min: 1.0, max: 1000.0, default: 200.0 },
        },
    ],
    measurements: &[
        number("gyro_x", Unit::DegreePerSecond, Dimension::AngularRate, GYRO),
        number("gyro_y", Unit::DegreePerSecond, Dimension::AngularRate, GYRO),
        number("gyro_z", Unit::DegreePerSecond, Dimension::AngularRate, GYRO),
        number("gyro_x_noise", Unit::DegreePerSecond, Dimension::AngularRate, GYRO_NOISE),
        number("gyro_y_noise", Unit::DegreePerSecond, Dimension::AngularRate, GYRO_NOISE),
        number("gyro_z_noise", Unit::DegreePerSecond, Dimension::AngularRate, GYRO_NOISE),
        number("accel_x", Unit::Gravity, Dimension::Acceleration, ACCEL),
        number("accel_y", Unit::Gravity, Dimension::Acceleration, ACCEL),
        number("accel_z", Unit::Gravity, Dimension::Acceleration, ACCEL),
        number("accel_x_noise", Unit::Milligravity, Dimension::Acceleration, ACCEL_NOISE),
        number("accel_y_noise", Unit::Milligravity, Dimension::Acceleration, ACCEL_NOISE),
        number("accel_z_noise", Unit::Milligravity, Dimension::Acceleration, ACCEL_NOISE),
        number(
            "accel_norm",
            Unit::Gravity,
            Dimension::Acceleration,
            "At rest the norm is 1 g in any attitude: the axis that is off names the accelerometer.",
        ),
        number("gyro_temperature", Unit::DegreeCelsius, Dimension::Temperature, TEMPERATURE),
        number("accel_temperature", Unit::DegreeCelsius, Dimension::Temperature, TEMPERATURE),
        text("stuck_channels", "These channels repeat one value: suspect the sensor or its line to the FPGA."),
        text("saturated_channels", "These channels stand at the end of their range: suspect the sensor or its supply."),
        FAILED_READS,
        STALE_SAMPLES,
        SPIKES,
    ],
    devices: &[Device::Slave],
    resources: &[Resource::Still, Resource::Link],
    timeout_s: 30.0,
};

const PLACE: &str = "Check that the antenna sees the sky, and that its place in the bench file is right.";

/// Satellite receiver, judged against the surveyed place of the antenna.
pub(super) static GNSS: ItemSpec = ItemSpec {
    title: "GNSS receiver",
    params: &[
        ParamSpec {
            name: "start",
            about: "how the receiver is started",
            kind: ParamKind::Choice { of: &["hot", "warm", "cold", "as-is"], default: "hot" },
        },
        ParamSpec {
            name: "window",
            about: "time to collect sentences and pulses after the fix",
            kind: ParamKind::Quantity { unit: Unit::Second, min: 1.0, max: 3600.0, default: 2.0 },
        },
        ParamSpec {
            name: "timeout",
            about: "time to wait for a fix",
            kind: ParamKind::Quantity { unit: Unit::Second, min: 1.0, max: 3600.0, default: 60.0 },
        },
    ],
    measurements: &[
        text("fix_type", "No fix: check antenna, cable and sky; 2D: too few satellites."),
        number("latitude", Unit::Degree, Dimension::Angle, PLACE),
        number("longitude", Unit::Degree, Dimension::Angle, PLACE),
        number("height", Unit::Metre, Dimension::Length, PLACE),
        number("horizontal_error", Unit::Metre, Dimension::Length, PLACE),
        number("height_error", Unit::Metre, Dimension::Length, PLACE),
        number(
            "ground_speed",
            Unit::MetrePerSecond,
            Dimension::Speed,
            "The antenna does not move: look for reflections, or suspect the receiver.",
        ),
        count("satellites_used", "Few satellites: check antenna, cable and sky."),
        number(
            "time_to_fix",
            Unit::Second,
            Dimension::Time,
            "A slow start: check the sky, and whether the receiver keeps its almanac.",
        ),
        count("hdop", "The satellites stand badly: try again later, or check what hides the sky."),
        count("vdop", "The satellites stand badly: try again later, or check what hides the sky."),
        count("pps_pulses", "No pulse: check the 1PPS line; none comes without a fix."),
        number(
            "pps_period_error",
            Unit::Microsecond,
            Dimension::Time,
            "The pulses are not a second apart: check the 1PPS line for bounces, then the reference clock of the board.",
        ),
        count("sentence_errors", "Sentences arrive broken: check the line between receiver and DSP."),
        count(
            "epochs_repeated",
            "The receiver says the same moment again: its clock stands, or it plays something back.",
        ),
        count("week_rollovers", "The date is 1024 weeks too early, or more: the receiver's firmware is too old."),
    ],
    devices: &[Device::Slave],
    resources: &[],
    timeout_s: 120.0,
};

const AD_ON: &str = "Check the DIP switch, the rail that it connects and the channel's input.";
const AD_OFF: &str = "The channel reads something with its switch off: look for a short, or a switch that was left on.";
const MAG_SPAN: &str =
    "The reading does not follow the heading as the field does: look for iron nearby, then suspect the magnetometer.";

/// AD channels: 1-3 the magnetometer, 4-8 through the DIP switches.
pub(super) static AD: ItemSpec = ItemSpec {
    title: "AD channels and magnetometer",
    params: &[
        ParamSpec {
            name: "samples",
            about: "samples to average for each reading",
            kind: ParamKind::Integer { min: 1, max: 10_000, default: 64 },
        },
        ParamSpec {
            name: "headings",
            about: "headings to which the module is turned",
            kind: ParamKind::Integer { min: 2, max: 36, default: 4 },
        },
    ],
    measurements: &[
        number("ad4_on", Unit::Volt, Dimension::Voltage, AD_ON),
        number("ad4_off", Unit::Volt, Dimension::Voltage, AD_OFF),
        number("ad5_on", Unit::Volt, Dimension::Voltage, AD_ON),
        number("ad5_off", Unit::Volt, Dimension::Voltage, AD_OFF),
        number("ad6_on", Unit::Volt, Dimension::Voltage, AD_ON),
        number("ad6_off", Unit::Volt, Dimension::Voltage, AD_OFF),
        number("ad7_on", Unit::Volt, Dimension::Voltage, AD_ON),
        number("ad7_off", Unit::Volt, Dimension::Voltage, AD_OFF),
        number("ad8_on", Unit::Volt, Dimension::Voltage, AD_ON),
        number("ad8_off", Unit::Volt, Dimension::Voltage, AD_OFF),
        number(
            "crosstalk",
            Unit::Millivolt,
            Dimension::Voltage,
            "Another channel moves with the switch: look for a short between the inputs, or a bad multiplexer.",
        ),
        number("mag_x_span", Unit::Gauss, Dimension::MagneticField, MAG_SPAN),
        number("mag_y_span", Unit::Gauss, Dimension::MagneticField, MAG_SPAN),
        number(
            "mag_z",
            Unit::Gauss,
            Dimension::MagneticField,
            "Compare with the vertical field of the bench file: iron near the socket, or a bad channel.",
        ),
    ],
    devices: &[Device::Slave, Device::Operator],
    resources: &[Resource::Attitude],
    timeout_s: 600.0,
};

const SCATTER: &str = "The solution scatters: check what the antenna sees and its cable, then suspect the receiver.";

/// One-sigma position and velocity about the surveyed antenna; pulses against the board's timer.
pub(super) static GNSS_ACCURACY: ItemSpec = ItemSpec {
    title: "GNSS accuracy",
    params: &[
        quantity("duration", "time to collect after the fix", Unit::Second, (60.0, 86_400.0), 600.0),
        quantity("timeout", "time to wait for a fix", Unit::Second, (1.0, 3600.0), 60.0),
        COVERAGE,
        quantity("clock_u", "standard uncertainty of the board's clock", Unit::PartsPerMillion, (0.0, 1000.0), 12.0),
        quantity("survey_u", "standard uncertainty of the antenna's place, each axis", Unit::Metre, (0.0, 10.0), 0.05),
    ],
    measurements: &[
        number("position_horizontal", Unit::Metre, Dimension::Length, PLACE),
        number("position_height", Unit::Metre, Dimension::Length, PLACE),
        number("velocity_horizontal", Unit::MetrePerSecond, Dimension::Speed, SCATTER),
        number("velocity_height", Unit::MetrePerSecond, Dimension::Speed, SCATTER),
        number("pps_jitter", Unit::Nanosecond, Dimension::Time, "The pulses scatter: check the 1PPS line."),
        number("pps_accuracy", Unit::Nanosecond, Dimension::Time, "Needs an external time reference."),
        count("epochs", "Epochs are missing: the fix was lost, or the line loses sentences."),
        count("effective_epochs", "So few epochs are independent that the figure is uncertain: collect longer."),
    ],
    devices: &[Device::Slave],
    resources: &[],
    timeout_s: 14_400.0,
};
