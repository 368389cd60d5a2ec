//! How the board takes and times the samples of the IMU: on the grid of its own clock, unless a personality differs.

/// Faults of the samples' times.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct SamplingFaults {
    /// Error of a separate oscillator of the sensors against the board's, positive if too fast; samples are not
    /// resampled.
    pub(crate) rate_error_ppm: f64,
    /// The times in frames are counted from the requested rate, whatever the true sample times.
    pub(crate) counted_times: bool,
    /// The times in frames are wrong for a while.
    pub(crate) step: Option<TimeStep>,
}

/// A while in each stream in which the times are wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TimeStep {
    /// Start of that while, after the stream's start.
    pub(crate) at_s: f64,
    /// Length of that while.
    pub(crate) for_s: f64,
    /// Error of the times.
    pub(crate) step_us: i64,
}

impl SamplingFaults {
    /// Nanoseconds from the start of a stream to its sample `index`, the first one a period after the start.
    pub(crate) fn taken_ns(&self, index: u32, rate_hz: u64) -> u64 {
        let even_ns = on_grid_ns(index, rate_hz);
        if self.rate_error_ppm == 0.0 { even_ns } else { (even_ns as f64 / (1.0 + self.rate_error_ppm * 1e-6)) as u64 }
    }

    /// The time that a frame tells for its first sample, in place of the true one: nanoseconds after the stream's
    /// start.
    pub(crate) fn told_ns(&self, index: u32, rate_hz: u64) -> u64 {
        let told_ns = if self.counted_times { on_grid_ns(index, rate_hz) } else { self.taken_ns(index, rate_hz) };
        match self.step {
            Some(TimeStep { at_s, for_s, step_us }) if (at_s..at_s + for_s).contains(&(told_ns as f64 * 1e-9)) => {
                told_ns.saturating_add_signed(step_us.saturating_mul(1000))
            }
            _ => told_ns,
        }
    }
}

fn on_grid_ns(index: u32, rate_hz: u64) -> u64 {
    (u64::from(index) + 1) * 1_000_000_000 / rate_hz
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_fault_moves_the_times_as_it_says() {
        let own = SamplingFaults { rate_error_ppm: -5000.0, ..SamplingFaults::default() };
        // At 995 samples a second the 995th comes after a second.
        assert_eq!((own.taken_ns(994, 1000), own.told_ns(994, 1000)), (1_000_000_000, 1_000_000_000));
        let counted = SamplingFaults { counted_times: true, ..own };
        assert_eq!((counted.taken_ns(994, 1000), counted.told_ns(994, 1000)), (1_000_000_000, 995_000_000));
        let step = Some(TimeStep { at_s: 0.5, for_s: 0.1, step_us: -40 });
        let stepped = SamplingFaults { step, ..SamplingFaults::default() };
        let off_us = [498, 499, 598, 599].map(|k| stepped.told_ns(k, 1000) as i64 / 1000 - (i64::from(k) + 1) * 1000);
        assert_eq!(off_us, [0, -40, -40, 0]);
    }
}
