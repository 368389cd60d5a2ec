//! Motion programs: the motions of an item with the module, step by step, computed before anything moves.
//!
//! A program is pure data from an item's parameters, so that the plan check and the log can say beforehand how long it
//! takes and how fast it turns.

mod check;
mod programs;
mod resume;
pub mod watch;

use std::fmt;

use gnc_rig::Orientation;

use crate::capture::{CaptureHead, Pose};

pub use check::mistakes;
pub use programs::OFF_S;
pub use programs::program;
pub use resume::ResumeAction;

/// A step of a program.
#[derive(Debug, Clone, PartialEq)]
pub enum MotionStep {
    /// The module is laid down.
    Lay(Orientation),
    /// A pause without motion: mounting, temperature and filters settle.
    Settle {
        /// Bench time of the pause.
        span_s: f64,
    },
    /// Capture of samples while the module lies still or keeps its spin.
    Capture {
        /// What the samples are of.
        about: CaptureHead,
        /// Board time of the capture.
        span_s: f64,
        /// The sensors that count.
        uses: Uses,
    },
    /// Capture of samples while the module lies still, is turned and lies still again.
    Turn {
        /// What the samples are of. The pose says how the module is turned.
        about: CaptureHead,
        /// Time of each of the two ramps within the turn.
        ramp_s: f64,
        /// Time at rest after the turn.
        rest_s: f64,
        /// The sensors that count.
        uses: Uses,
    },
    /// The table spins from here on.
    Spin {
        /// Rate, right-handed about the axis along the table's.
        rate_dps: f64,
    },
    /// The table comes to rest.
    Stop,
    /// The module is switched off, and on again after `off_s`.
    PowerCycle {
        /// Bench time without power.
        off_s: f64,
    },
    /// A capture of the satellite receiver.
    Receiver {
        /// What the capture is of.
        about: CaptureHead,
        /// Longest wait for a fix.
        timeout_s: f64,
        /// Time of the capture after the fix.
        span_s: f64,
    },
}

/// The sensors that a capture is made for. Saturation of one of them spoils the capture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Uses {
    /// Gyroscopes and accelerometers.
    Inertial,
    /// The gyroscopes alone.
    Gyro,
    /// The magnetometer alone: the gyroscopes may be out of range.
    Magnetometer,
    /// Gyroscopes and accelerometers, compensated by the board.
    Compensated,
}

/// Published range of the gyroscopes. They saturate at 419 deg/s (interface document, section 10).
pub const GYRO_RANGE_DPS: f64 = 400.0;

/// Time at rest before a turn. The analysis needs at least half a second.
pub const REST_BEFORE_S: f64 = 1.0;

/// The motions of an item.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MotionProgram {
    /// The steps, in order.
    pub steps: Vec<MotionStep>,
}

impl MotionProgram {
    /// Returns the bench time of all captures and pauses. It does not include the time to lay the module down.
    #[must_use]
    pub fn span_s(&self) -> f64 {
        self.steps.iter().map(MotionStep::span_s).sum()
    }

    /// Returns how often the module is laid down.
    #[must_use]
    pub fn lays(&self) -> usize {
        self.steps.iter().filter(|step| matches!(step, MotionStep::Lay(_))).count()
    }

    /// Returns the least number of IMU samples that the program captures.
    #[must_use]
    pub(crate) fn samples(&self) -> u64 {
        let of = |about: &CaptureHead, span_s: f64| (span_s * f64::from(about.rate_hz)).round() as u64;
        let samples = self.steps.iter().map(|step| match step {
            MotionStep::Capture { about, span_s, .. } => of(about, *span_s),
            MotionStep::Turn { about, .. } => of(about, step.span_s()),
            _ => 0,
        });
        samples.sum()
    }
}

impl MotionStep {
    /// Returns what the step captures, if it captures.
    #[must_use]
    pub fn about(&self) -> Option<&CaptureHead> {
        match self {
            Self::Capture { about, .. } | Self::Turn { about, .. } | Self::Receiver { about, .. } => Some(about),
            _ => None,
        }
    }

    /// Returns the least bench time of the step.
    #[must_use]
    pub fn span_s(&self) -> f64 {
        match self {
            Self::Settle { span_s } | Self::Capture { span_s, .. } | Self::Receiver { span_s, .. } => *span_s,
            Self::Turn { about, rest_s, .. } => match about.pose {
                Pose::Rotating { span_s, .. } => REST_BEFORE_S + span_s + rest_s,
                _ => REST_BEFORE_S + rest_s,
            },
            Self::PowerCycle { off_s } => *off_s,
            Self::Lay(_) | Self::Spin { .. } | Self::Stop => 0.0,
        }
    }
}

impl fmt::Display for MotionProgram {
    /// "takes 31 min 12 s of bench time: 6 captures with 360000 samples, the module is laid down 6 times"
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let is_capture = |step: &&MotionStep| {
            matches!(step, MotionStep::Capture { .. } | MotionStep::Turn { .. } | MotionStep::Receiver { .. })
        };
        let captures = self.steps.iter().filter(is_capture).count();
        let captures = Count(captures, "capture");
        write!(f, "takes {} of bench time: {captures}", DisplayDuration(self.span_s()))?;
        if self.samples() > 0 {
            write!(f, " with {} samples", self.samples())?;
        }
        match self.lays() {
            0 => {}
            1 => write!(f, ", the module is laid down once")?,
            times => write!(f, ", the module is laid down {times} times")?,
        }
        let cycles = self.steps.iter().filter(|step| matches!(step, MotionStep::PowerCycle { .. })).count();
        if cycles > 0 { write!(f, ", {}", Count(cycles, "power cycle")) } else { Ok(()) }
    }
}

/// "1 capture", "6 captures".
#[derive(Debug, Clone, Copy)]
pub struct Count(pub usize, pub &'static str);

impl fmt::Display for Count {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(count, what) = self;
        write!(f, "{count} {what}{}", if *count == 1 { "" } else { "s" })
    }
}

/// A time for people: "1 h 02 min", "5 min 30 s", "12.5 s".
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DisplayDuration(pub f64);

impl fmt::Display for DisplayDuration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let whole = self.0.max(0.0).round() as u64;
        match whole {
            3600.. => write!(f, "{} h {:02} min", whole / 3600, whole % 3600 / 60),
            60.. => write!(f, "{} min {:02} s", whole / 60, whole % 60),
            _ => write!(f, "{:.1} s", self.0),
        }
    }
}

#[cfg(test)]
mod tests;
