//! Captures: uninterrupted stretches of raw samples. Each capture says how the module lay or moved meanwhile.

use gnc_metrology::AXES;
use gnc_metrology::sample_clock::{ClockFault, SampleClock};
use gnc_protocol::calibration::CompensatedSample;
use gnc_protocol::stream::{ImuSample, Losses};
use gnc_rig::Along;
use serde::{Deserialize, Serialize};

/// Most samples of an attempt: a day at 200 Hz has 17 million. They take 40 bytes of memory each, or 48 if the board compensates
/// them: less than a gigabyte in all.
pub const MOST_SAMPLES: usize = 20_000_000;

/// Samples of the IMU without a gap, on the board's clock.
#[derive(Debug, Clone, PartialEq)]
pub struct Capture {
    /// Description of the capture.
    pub about: CaptureHead,
    /// Board time of the first sample, microseconds.
    pub first_us: u64,
    /// The raw samples, `1/about.rate_hz` apart.
    pub samples: Vec<ImuSample>,
    /// Samples that the board itself compensates with the calibration that the module holds, in place of the raw
    /// samples.
    pub compensated: Vec<CompensatedSample>,
    /// Missing samples, by place. A capture with losses is evidence of the loss, and no figure comes from it.
    pub losses: Losses,
    /// Output of the satellite receiver during the capture, where the capture includes it.
    pub receiver: ReceiverCapture,
    /// What is known of the clock of the samples.
    pub timing: Timing,
}

/// The clock of a capture.
#[derive(Debug, Clone, PartialEq)]
pub struct Timing {
    /// The times of the samples, by the board's clock.
    pub board: SampleClock,
    /// The board's clock compared with that of the host.
    pub host: HostView,
}

/// The comparison of the board's clock with the host's clock.
#[derive(Debug, Clone, PartialEq)]
pub enum HostView {
    /// Both clocks ran beside each other for long enough.
    Compared {
        /// How much faster the board's clock ran than the host's, parts per million.
        error_ppm: f64,
        /// Standard uncertainty of `error_ppm`, from the latency of the link and the host's own clock.
        u_ppm: f64,
    },
    /// There is no comparison, for this reason.
    Nothing(String),
}

impl Default for HostView {
    fn default() -> Self {
        Self::Nothing("the record does not compare the board's clock with the host's".into())
    }
}

impl Timing {
    /// The timing of a capture of this rate, without a sample.
    #[must_use]
    pub fn new(rate_hz: u16) -> Self {
        Self { board: SampleClock::new(rate_hz), host: HostView::default() }
    }

    /// The timing of `samples` samples on the grid of their rate, without a comparison with the host's clock.
    #[must_use]
    pub fn even(rate_hz: u16, first_us: u64, samples: usize) -> Self {
        Self { board: SampleClock::even(rate_hz, first_us, samples), ..Self::new(rate_hz) }
    }
}

impl Capture {
    /// Checks that the samples came at the rate that was asked for, by the board's own time.
    ///
    /// # Errors
    /// [`ClockFault`].
    pub fn check_clock(&self) -> Result<(), ClockFault> {
        match self.samples.len().max(self.compensated.len()) {
            // The receiver's bytes have no rate.
            0 => Ok(()),
            samples => self.timing.board.check(samples).map(|_| ()),
        }
    }
}

/// Output of the satellite receiver, and its pulses.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ReceiverCapture {
    /// Bytes of the receiver, as they came.
    pub said: Vec<Said>,
    /// Board time of each 1PPS edge, nanoseconds, by a timer of 10 ns resolution.
    pub pulses_ns: Vec<u64>,
}

/// Some bytes of the receiver.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Said {
    /// Board time of the first byte, microseconds.
    pub board_time_us: u64,
    /// The bytes. A sentence may end in the next bytes.
    pub bytes: Vec<u8>,
}

/// What a capture is of. It is written into the raw record before the first sample.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CaptureHead {
    /// Label in words of the procedure, unique within the attempt: `x+`, `run 3`, `calibration 2 z- rotation`.
    pub label: String,
    /// Number of the series among several like series, from 1: the power cycle, or the calibration of a repeatability.
    pub series: u32,
    /// The motion or position of the module.
    pub pose: Pose,
    /// Samples a second.
    pub rate_hz: u16,
}

impl CaptureHead {
    /// Returns what `compute` calls `position` (the axis that is up, as `x+`) and `run` (axis and direction of a turn).
    /// Each is empty where it does not apply to the capture.
    #[must_use]
    pub fn position_and_run(&self) -> (String, String) {
        let name = |axis: usize, positive: bool| format!("{}{}", AXES[axis % 3], if positive { '+' } else { '-' });
        match &self.pose {
            Pose::Still { up, .. } => {
                let axis = up.iter().position(|part| part.abs() == 1.0);
                (axis.map(|axis| name(axis, up[axis] > 0.0)).unwrap_or_default(), String::new())
            }
            Pose::Rotating { axis, angle_deg, .. } => (String::new(), name(usize::from(*axis), *angle_deg > 0.0)),
            Pose::Spinning { .. } => (String::new(), String::new()),
        }
    }
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
        /// Angle of the turn, right-handed about that axis.
        angle_deg: f64,
        /// Time of the turn, seconds.
        span_s: f64,
        /// Direction of the axis.
        along: Along,
    },
    /// Turning steadily about one axis of the module, all the time.
    Spinning {
        /// 0 for X, 1 for Y, 2 for Z.
        axis: u8,
        /// Rate, right-handed about that axis.
        rate_dps: f64,
        /// Direction of the axis.
        along: Along,
    },
}
