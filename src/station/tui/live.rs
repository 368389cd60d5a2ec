//! Live readings on the screen: the newest value of each, and the recent values of those that are drawn over time.

use std::collections::VecDeque;
use std::time::Duration;

use gnc_board::Readings;
use gnc_protocol::stream::{ACCEL_LSB_PER_G, GYRO_LSB_PER_DPS, ImuSample, MAG_LSB_PER_GAUSS};

/// Points of each curve: one minute at ten points a second.
const POINTS: usize = 600;
/// Time between two points; a faster sample replaces the newest point.
const EVERY: Duration = Duration::from_millis(100);

/// A point of the curves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LivePoint {
    /// Time since the start of the program.
    pub at: Duration,
    pub imu: LiveSample,
}

/// A sample at nominal scale, along the module's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LiveSample {
    pub rate_dps: [f64; 3],
    pub accel_g: [f64; 3],
    pub field_gauss: [f64; 3],
    pub gyro_temperature_c: f64,
    pub accel_temperature_c: f64,
}

impl From<&ImuSample> for LiveSample {
    fn from(sample: &ImuSample) -> Self {
        Self {
            rate_dps: sample.gyro.map(|counts| f64::from(counts) / GYRO_LSB_PER_DPS),
            accel_g: sample.accel.map(|counts| f64::from(counts) / ACCEL_LSB_PER_G),
            field_gauss: sample.mag.map(|counts| f64::from(counts) / MAG_LSB_PER_GAUSS),
            gyro_temperature_c: f64::from(sample.gyro_temperature) / 100.0,
            accel_temperature_c: f64::from(sample.accel_temperature) / 100.0,
        }
    }
}

/// The newest readings, and the recent points of the curves.
#[derive(Debug, Default)]
pub(crate) struct History {
    pub newest: Readings,
    /// When the newest readings came.
    pub at: Option<Duration>,
    pub points: VecDeque<LivePoint>,
}

impl History {
    pub(crate) fn is_empty(&self) -> bool {
        self.at.is_none()
    }

    /// Takes readings; equal readings change nothing.
    pub(crate) fn take(&mut self, readings: Readings, at: Duration) {
        if readings == self.newest {
            return;
        }
        let fresh = readings.imu.as_ref().filter(|imu| Some(*imu) != self.newest.imu.as_ref());
        if let Some((_, sample)) = fresh {
            let imu = LiveSample::from(sample);
            match self.points.back_mut() {
                Some(last) if at.saturating_sub(last.at) < EVERY => last.imu = imu,
                _ => {
                    if self.points.len() == POINTS {
                        self.points.pop_front();
                    }
                    self.points.push_back(LivePoint { at, imu });
                }
            }
        }
        self.newest = readings;
        self.at = Some(at);
    }

    /// The newest sample.
    pub(crate) fn imu(&self) -> Option<LiveSample> {
        self.newest.imu.as_ref().map(|(_, sample)| LiveSample::from(sample))
    }
}
