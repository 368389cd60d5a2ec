//! The oscillator of the slave board against true time.

/// The properties of an oscillator. Its count and true time both begin with the bench.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Oscillator {
    /// How much too fast it runs at the bench's start, parts per million.
    pub error_ppm: f64,
    /// How much faster it gets each hour after that, parts per million.
    pub drift_ppm_per_h: f64,
}

impl Oscillator {
    /// Nanoseconds counted at a true moment: `t (1 + error) + drift t^2 / 2`.
    #[must_use]
    pub(crate) fn count_ns(&self, true_s: f64) -> f64 {
        true_s * 1e9 * (1.0 + self.error_ppm * 1e-6 + self.drift_per_s() * true_s / 2.0)
    }

    /// The true moment of a count, in seconds: the root of the same equation, in the form that loses no digits.
    #[must_use]
    pub(crate) fn true_s(&self, count_ns: u64) -> f64 {
        let (count_s, pace) = (count_ns as f64 * 1e-9, 1.0 + self.error_ppm * 1e-6);
        // A drift that would stop the oscillator is cut off: personalities allow no such drift within a day.
        let root = (pace * pace + 2.0 * self.drift_per_s() * count_s).max(0.0).sqrt();
        2.0 * count_s / (pace + root)
    }

    fn drift_per_s(&self) -> f64 {
        self.drift_ppm_per_h * 1e-6 / 3600.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn count_and_true_time_are_each_others_inverse() {
        for (error_ppm, drift_ppm_per_h) in [(0.0, 0.0), (3.0, 0.0), (-30.0, 2.0), (10_000.0, -100.0)] {
            let oscillator = Oscillator { error_ppm, drift_ppm_per_h };
            for true_s in [0.0, 1e-3, 1.0, 3600.0, 86_400.0] {
                let back_s = oscillator.true_s(oscillator.count_ns(true_s).round() as u64);
                assert!((back_s - true_s).abs() < 2e-9, "{oscillator:?}: {true_s} s became {back_s} s");
            }
        }
        let oscillator = Oscillator { error_ppm: 30.0, drift_ppm_per_h: 2.0 };
        // After an hour: 30 ppm, and a mean of 1 ppm from the drift.
        assert!((oscillator.count_ns(3600.0) - 3600e9 * (1.0 + 31e-6)).abs() < 1.0);
    }
}
