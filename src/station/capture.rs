//! Captures: uninterrupted stretches of raw samples, each with how the module lay or moved meanwhile.

use gnc_protocol::calibration::CompensatedSample;
use gnc_protocol::stream::ImuSample;
use serde::{Deserialize, Serialize};

use crate::board::stream::Losses;

/// Samples of the IMU without a gap, on the board's clock.
#[derive(Debug, Clone, PartialEq)]
pub struct Capture {
    /// What was captured.
    pub about: About,
    /// Board time of the first sample, microseconds.
    pub first_us: u64,
    /// The raw samples, `1/about.rate_hz` apart.
    pub samples: Vec<ImuSample>,
    /// In their place, what the board itself makes of them with the calibration that the module holds.
    pub compensated: Vec<CompensatedSample>,
    /// What is missing, by place. A capture with losses is evidence of the loss, and no figure comes from it.
    pub losses: Losses,
    /// What the satellite receiver said meanwhile, where that was captured.
    pub receiver: Receiver,
}

/// What the satellite receiver said, and its pulses.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Receiver {
    /// Its bytes as they came.
    pub said: Vec<Said>,
    /// Board time of each 1PPS edge, nanoseconds, by a timer of 10 ns resolution.
    pub pulses_ns: Vec<u64>,
}

/// Some bytes of the receiver.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Said {
    /// Board time of the first one, microseconds.
    pub board_time_us: u64,
    /// The bytes; a sentence may end in the next ones.
    pub bytes: Vec<u8>,
}

/// What a capture is of. Written into the raw record before the first sample.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct About {
    /// Unique within the attempt, in words of the procedure: `x+`, `run 3`, `calibration 2 z- rotation`.
    pub label: String,
    /// Which of several like series it belongs to, from 1: the power cycle, the calibration of a repeatability.
    pub series: u32,
    /// What the module did.
    pub pose: Pose,
    /// Samples a second.
    pub rate_hz: u16,
}

/// How the module lay or moved. Axes are the module's, right-handed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind", deny_unknown_fields)]
pub enum Pose {
    /// Lying still.
    Still {
        /// Unit vector that points up, in module axes.
        up: [f64; 3],
        /// Heading of the reference axis (the one after the axis that is up), degrees clockwise from north.
        heading_deg: f64,
    },
    /// Still, then a turn of the table about one axis of the module, then still again.
    Rotating {
        /// 0 for X, 1 for Y, 2 for Z.
        axis: u8,
        /// The angle, right-handed about that axis.
        angle_deg: f64,
        /// Time of the turn, seconds.
        span_s: f64,
        /// Where the axis points.
        along: Along,
    },
    /// Turning steadily about one axis of the module, all the time.
    Spinning {
        /// 0 for X, 1 for Y, 2 for Z.
        axis: u8,
        /// Rate, right-handed about that axis.
        rate_dps: f64,
        /// Where the axis points.
        along: Along,
    },
}

/// Where the table's axis points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Along {
    /// Up.
    Up,
    /// To the north, level.
    North,
    /// To the celestial pole.
    Polar,
}
