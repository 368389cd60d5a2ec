//! The clocks of a personality, checked: the board's oscillator, and how the IMU's samples are taken by it.

use super::check::{Mistake, number};
use super::raw;
use crate::oscillator::Oscillator;
use crate::sampling::{SamplingFaults, TimeStep};

impl raw::Board {
    pub(super) fn oscillator(&self, d: Oscillator) -> Result<Oscillator, Mistake> {
        let (error, drift) = (self.clock_error_ppm.as_ref(), self.clock_drift_ppm_per_h.as_ref());
        Ok(Oscillator {
            error_ppm: number(error, "clock_error_ppm", -1e4, 1e4, d.error_ppm)?,
            drift_ppm_per_h: number(drift, "clock_drift_ppm_per_h", -1e3, 1e3, d.drift_ppm_per_h)?,
        })
    }
}

impl raw::Sampling {
    pub(super) fn check(&self) -> Result<SamplingFaults, Mistake> {
        let step = |step: &raw::TimeStep| {
            Ok(TimeStep {
                at_s: number(Some(&step.at_s), "at_s", 0.0, 1e6, 0.0)?,
                for_s: number(Some(&step.for_s), "for_s", 0.0, 1e6, 0.0)?,
                step_us: number(Some(&step.step_us), "step_us", -1e9, 1e9, 0.0)? as i64,
            })
        };
        Ok(SamplingFaults {
            rate_error_ppm: number(self.rate_error_ppm.as_ref(), "rate_error_ppm", -5e5, 5e5, 0.0)?,
            counted_times: self.counted_times,
            step: self.time_step.as_ref().map(step).transpose()?,
        })
    }
}
