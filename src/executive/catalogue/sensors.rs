//! Inertial sensors, satellite receiver, AD channels and magnetometer.

use super::shared::{COVERAGE, FAILED_READS, SAMPLE_RATE, SPIKES, STALE_SAMPLES, ppm, quantity};
use super::{Device, ItemSpec, MeasurementSpec, ParamKind, ParamSpec, Resource, Trace, Traces, count, number, text};
use crate::quantity::{Dimension, Unit};

const GYRO_RATE: &str = "Is the module at rest? If it is, the zero rate of this gyroscope is off: suspect the sensor.";
const GYRO_SCATTER: &str = "Too much: does anything shake the table? Too little or none: this gyroscope no longer measures; suspect it or its supply.";
const ACCEL_FORCE: &str = "Is the module level and seated in its socket? If it is, suspect this accelerometer.";
const ACCEL_SCATTER: &str = "Too much: does anything shake the table? Too little or none: this accelerometer no longer measures; suspect it or its supply.";
const TEMPERATURE: &str = "Let the module reach room temperature; if it has, suspect the temperature sensor.";

/// Mean rate of each gyroscope.
pub const GYRO: [MeasurementSpec; 3] = [
    number("gyro_x", Unit::DegreePerSecond, Dimension::AngularRate, GYRO_RATE),
    number("gyro_y", Unit::DegreePerSecond, Dimension::AngularRate, GYRO_RATE),
    number("gyro_z", Unit::DegreePerSecond, Dimension::AngularRate, GYRO_RATE),
];
/// Standard deviation of each gyroscope.
pub const GYRO_NOISE: [MeasurementSpec; 3] = [
    number("gyro_x_noise", Unit::DegreePerSecond, Dimension::AngularRate, GYRO_SCATTER),
    number("gyro_y_noise", Unit::DegreePerSecond, Dimension::AngularRate, GYRO_SCATTER),
    number("gyro_z_noise", Unit::DegreePerSecond, Dimension::AngularRate, GYRO_SCATTER),
];
/// Mean specific force along each axis.
pub const ACCEL: [MeasurementSpec; 3] = [
    number("accel_x", Unit::Gravity, Dimension::Acceleration, ACCEL_FORCE),
    number("accel_y", Unit::Gravity, Dimension::Acceleration, ACCEL_FORCE),
    number("accel_z", Unit::Gravity, Dimension::Acceleration, ACCEL_FORCE),
];
/// Standard deviation of each accelerometer.
pub const ACCEL_NOISE: [MeasurementSpec; 3] = [
    number("accel_x_noise", Unit::Milligravity, Dimension::Acceleration, ACCEL_SCATTER),
    number("accel_y_noise", Unit::Milligravity, Dimension::Acceleration, ACCEL_SCATTER),
    number("accel_z_noise", Unit::Milligravity, Dimension::Acceleration, ACCEL_SCATTER),
];
/// Length of the mean specific force.
pub const ACCEL_NORM: MeasurementSpec = number(
    "accel_norm",
    Unit::Gravity,
    Dimension::Acceleration,
    "At rest the norm is 1 g in any attitude: the axis that is off names the accelerometer.",
);
/// Mean temperature of the gyroscopes.
pub const GYRO_TEMPERATURE: MeasurementSpec =
    number("gyro_temperature", Unit::DegreeCelsius, Dimension::Temperature, TEMPERATURE);
/// Mean temperature of the accelerometers.
pub const ACCEL_TEMPERATURE: MeasurementSpec =
    number("accel_temperature", Unit::DegreeCelsius, Dimension::Temperature, TEMPERATURE);
/// Channels that repeat one value, or "none".
pub const STUCK_CHANNELS: MeasurementSpec =
    text("stuck_channels", "These channels repeat one value: suspect the sensor or its line to the FPGA.");
/// Channels at the end of their range, or "none".
pub const SATURATED_CHANNELS: MeasurementSpec =
    text("saturated_channels", "These channels stand at the end of their range: suspect the sensor or its supply.");

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
        GYRO[0],
        GYRO[1],
        GYRO[2],
        GYRO_NOISE[0],
        GYRO_NOISE[1],
        GYRO_NOISE[2],
        ACCEL[0],
        ACCEL[1],
        ACCEL[2],
        ACCEL_NOISE[0],
        ACCEL_NOISE[1],
        ACCEL_NOISE[2],
        ACCEL_NORM,
        GYRO_TEMPERATURE,
        ACCEL_TEMPERATURE,
        STUCK_CHANNELS,
        SATURATED_CHANNELS,
        SAMPLE_RATE,
        FAILED_READS,
        STALE_SAMPLES,
        SPIKES,
    ],
    devices: &[Device::Slave],
    resources: &[Resource::Still, Resource::Link],
    needs: &[],
    traces: Traces { leaves: &[], feels: &[Trace::Heat] },
    timeout_s: 30.0,
};

const BOARD_CLOCK: &str = "The slave board's oscillator is off: have the board checked.";
const PLACE: &str = "Check that the antenna sees the sky, and that its place in the bench file is right.";

/// The hint for impossible values under a good checksum.
const RECEIVER: &str =
    "The line is good, but the receiver sends impossible values: suspect the receiver or its firmware.";

/// 3D, 2D, "dimensions unknown", "lost", or why there is no fix.
pub const FIX_TYPE: MeasurementSpec = text(
    "fix_type",
    "No fix: check antenna, cable and sky; 2D: too few satellites; dimensions unknown: the receiver sends no GSA.",
);
/// Mean latitude, WGS-84.
pub const LATITUDE: MeasurementSpec = number("latitude", Unit::Degree, Dimension::Angle, PLACE);
/// Mean longitude, WGS-84.
pub const LONGITUDE: MeasurementSpec = number("longitude", Unit::Degree, Dimension::Angle, PLACE);
/// Mean height above the ellipsoid.
pub const HEIGHT: MeasurementSpec = number("height", Unit::Metre, Dimension::Length, PLACE);
/// Horizontal distance of the mean place from the surveyed one.
pub const HORIZONTAL_ERROR: MeasurementSpec = number("horizontal_error", Unit::Metre, Dimension::Length, PLACE);
/// Difference of the mean height from the surveyed one.
pub const HEIGHT_ERROR: MeasurementSpec = number("height_error", Unit::Metre, Dimension::Length, PLACE);
/// Mean speed over ground.
pub const GROUND_SPEED: MeasurementSpec = number(
    "ground_speed",
    Unit::MetrePerSecond,
    Dimension::Speed,
    "The antenna does not move: look for reflections, or suspect the receiver.",
);
/// Fewest satellites used in an epoch.
pub const SATELLITES_USED: MeasurementSpec = count("satellites_used", "Few satellites: check antenna, cable and sky.");
/// Time from the first sentence after the restart to the first fix.
pub const TIME_TO_FIX: MeasurementSpec = number(
    "time_to_fix",
    Unit::Second,
    Dimension::Time,
    "The start was slow: check the sky, and whether the receiver keeps its almanac.",
);
/// Horizontal dilution of precision, the newest.
pub const HDOP: MeasurementSpec =
    count("hdop", "The satellites are badly placed in the sky: try again later, or check what hides the sky.");
/// Vertical dilution of precision, the newest.
pub const VDOP: MeasurementSpec =
    count("vdop", "The satellites are badly placed in the sky: try again later, or check what hides the sky.");
/// Pulses that came.
pub const PPS_PULSES: MeasurementSpec =
    count("pps_pulses", "No pulse: check the 1PPS line. Without a fix the receiver sends no pulse.");
/// Largest deviation of a period from a second.
pub const PPS_PERIOD_ERROR: MeasurementSpec = number(
    "pps_period_error",
    Unit::Microsecond,
    Dimension::Time,
    "The pulses are not one second apart: check the 1PPS line for bounces, then the reference clock of the board.",
);
/// Error of the board's clock, measured by the pulses.
pub const BOARD_CLOCK_ERROR: MeasurementSpec = ppm("board_clock_error", BOARD_CLOCK);
/// Sentences that arrived broken.
pub const SENTENCE_ERRORS: MeasurementSpec = count(
    "sentence_errors",
    "Sentences arrive damaged: check the line between receiver and DSP; receiver_faults counts faults of the receiver itself.",
);
/// Sentences without a checksum.
pub const SENTENCES_UNCHECKED: MeasurementSpec = count(
    "sentences_unchecked",
    "The receiver sends no checksums: switch them on, so that the station can check the line.",
);
/// Impossible values under a good checksum.
pub const RECEIVER_FAULTS: MeasurementSpec = count("receiver_faults", RECEIVER);
/// The first of these faults, or "none".
pub const RECEIVER_FAULT: MeasurementSpec = text("receiver_fault", RECEIVER);
/// Frames of another protocol.
pub const FOREIGN_FRAMES: MeasurementSpec =
    count("foreign_frames", "The receiver sends another protocol besides NMEA: check the settings of its port.");
/// Epochs with a time that was sent before.
pub const EPOCHS_REPEATED: MeasurementSpec = count(
    "epochs_repeated",
    "The receiver sends the same time again: its clock has stopped, or it plays back a recording.",
);
/// Spans of 1024 weeks by which the date is too early.
pub const WEEK_ROLLOVERS: MeasurementSpec =
    count("week_rollovers", "The date is 1024 weeks too early, or more: the receiver's firmware is too old.");

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
        FIX_TYPE,
        LATITUDE,
        LONGITUDE,
        HEIGHT,
        HORIZONTAL_ERROR,
        HEIGHT_ERROR,
        GROUND_SPEED,
        SATELLITES_USED,
        TIME_TO_FIX,
        HDOP,
        VDOP,
        PPS_PULSES,
        PPS_PERIOD_ERROR,
        BOARD_CLOCK_ERROR,
        SENTENCE_ERRORS,
        SENTENCES_UNCHECKED,
        RECEIVER_FAULTS,
        RECEIVER_FAULT,
        FOREIGN_FRAMES,
        EPOCHS_REPEATED,
        WEEK_ROLLOVERS,
    ],
    devices: &[Device::Slave],
    resources: &[],
    needs: &[],
    traces: Traces::NONE,
    timeout_s: 120.0,
};

const AD_ON: &str = "Check the DIP switch, the rail that it connects and the channel's input.";
const AD_OFF: &str = "The channel reads something with its switch off: look for a short, or a switch that was left on.";
const MAG_SWEEP: &str =
    "The reading does not follow the heading as the field does: look for iron nearby, then suspect the magnetometer.";

/// Measurements of a channel behind a DIP switch.
#[derive(Debug)]
pub struct SwitchedSpec {
    /// Mean with the channel's own switch on and all others off.
    pub on: MeasurementSpec,
    /// Mean with all switches off.
    pub off: MeasurementSpec,
}

/// Channels 4 to 8.
pub const SWITCHED: [SwitchedSpec; 5] = [
    SwitchedSpec {
        on: number("ad4_on", Unit::Volt, Dimension::Voltage, AD_ON),
        off: number("ad4_off", Unit::Volt, Dimension::Voltage, AD_OFF),
    },
    SwitchedSpec {
        on: number("ad5_on", Unit::Volt, Dimension::Voltage, AD_ON),
        off: number("ad5_off", Unit::Volt, Dimension::Voltage, AD_OFF),
    },
    SwitchedSpec {
        on: number("ad6_on", Unit::Volt, Dimension::Voltage, AD_ON),
        off: number("ad6_off", Unit::Volt, Dimension::Voltage, AD_OFF),
    },
    SwitchedSpec {
        on: number("ad7_on", Unit::Volt, Dimension::Voltage, AD_ON),
        off: number("ad7_off", Unit::Volt, Dimension::Voltage, AD_OFF),
    },
    SwitchedSpec {
        on: number("ad8_on", Unit::Volt, Dimension::Voltage, AD_ON),
        off: number("ad8_off", Unit::Volt, Dimension::Voltage, AD_OFF),
    },
];
/// Span of the field along X and Y over a turn.
pub const MAG_SPAN: [MeasurementSpec; 2] = [
    number("mag_x_span", Unit::Gauss, Dimension::MagneticField, MAG_SWEEP),
    number("mag_y_span", Unit::Gauss, Dimension::MagneticField, MAG_SWEEP),
];
/// Largest change of a channel when the switch of another channel is flipped.
pub const CROSSTALK: MeasurementSpec = number(
    "crosstalk",
    Unit::Millivolt,
    Dimension::Voltage,
    "Another channel moves with the switch: look for a short between the inputs, or a bad multiplexer.",
);
/// Mean field along Z.
pub const MAG_Z: MeasurementSpec = number(
    "mag_z",
    Unit::Gauss,
    Dimension::MagneticField,
    "Compare with the vertical field in the bench file: look for iron near the socket, or a bad channel.",
);

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
        SWITCHED[0].on,
        SWITCHED[0].off,
        SWITCHED[1].on,
        SWITCHED[1].off,
        SWITCHED[2].on,
        SWITCHED[2].off,
        SWITCHED[3].on,
        SWITCHED[3].off,
        SWITCHED[4].on,
        SWITCHED[4].off,
        CROSSTALK,
        MAG_SPAN[0],
        MAG_SPAN[1],
        MAG_Z,
    ],
    devices: &[Device::Slave, Device::Operator],
    resources: &[Resource::Attitude],
    needs: &[],
    traces: Traces { leaves: &[Trace::Switches], feels: &[Trace::Switches] },
    timeout_s: 600.0,
};

const SCATTER: &str =
    "The positions scatter: check the antenna's view of the sky and its cable, then suspect the receiver.";

/// Root mean square of the horizontal errors about the surveyed antenna.
pub const POSITION_HORIZONTAL: MeasurementSpec = number("position_horizontal", Unit::Metre, Dimension::Length, PLACE);
/// Root mean square of the errors of height.
pub const POSITION_HEIGHT: MeasurementSpec = number("position_height", Unit::Metre, Dimension::Length, PLACE);
/// Root mean square of the speed over ground.
pub const VELOCITY_HORIZONTAL: MeasurementSpec =
    number("velocity_horizontal", Unit::MetrePerSecond, Dimension::Speed, SCATTER);
/// Root mean square of the vertical speed.
pub const VELOCITY_HEIGHT: MeasurementSpec = number("velocity_height", Unit::MetrePerSecond, Dimension::Speed, SCATTER);
/// Standard deviation of the intervals between pulses.
pub const PPS_JITTER: MeasurementSpec =
    number("pps_jitter", Unit::Nanosecond, Dimension::Time, "The pulses scatter: check the 1PPS line.");
/// Error of the pulses against true time.
pub const PPS_ACCURACY: MeasurementSpec = number(
    "pps_accuracy",
    Unit::Nanosecond,
    Dimension::Time,
    "This figure needs an external time reference: the station has none.",
);
/// Epochs with a fix.
pub const EPOCHS: MeasurementSpec =
    count("epochs", "Epochs are missing: the fix was lost, or the line loses sentences.");
/// Number of independent epochs that would give the same uncertainty.
pub const EFFECTIVE_EPOCHS: MeasurementSpec =
    count("effective_epochs", "Too few epochs are independent, so the figure is uncertain: collect longer.");

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
        POSITION_HORIZONTAL,
        POSITION_HEIGHT,
        VELOCITY_HORIZONTAL,
        VELOCITY_HEIGHT,
        PPS_JITTER,
        BOARD_CLOCK_ERROR,
        PPS_ACCURACY,
        EPOCHS,
        EFFECTIVE_EPOCHS,
    ],
    devices: &[Device::Slave],
    resources: &[],
    needs: &[],
    traces: Traces { leaves: &[Trace::Heat], feels: &[] },
    timeout_s: 14_400.0,
};
