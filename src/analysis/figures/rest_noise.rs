//! Noise of gyroscopes within a turn, from their rest before and after it.
//!
//! The noise has two parts. *Short*: the scatter of the means of blocks of rest, so that samples that a low-pass has
//! made alike do not count as independent. *Slow*: a turn ends at the heading where it began, so that both rests see
//! the same rotation of the earth. Their means differ by the short noise and by the wander of the bias.

use gnc_metrology::stats;
use nalgebra::Vector3;

/// Length of a block, s: far above the memory of a sensor's low-pass (16 ms at 10 Hz).
const BLOCK_S: f64 = 0.25;

/// Outputs at rest, sample by sample.
#[derive(Debug)]
pub(super) struct Rest {
    pub(super) before: Vec<Vector3<f64>>,
    pub(super) after: Vec<Vector3<f64>>,
}

/// Noise of one sensor, in the square of the unit of its outputs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RestNoise {
    /// Variance of a mean times the time over which it is taken, s.
    density_s: f64,
    density_dof: f64,
    /// Variance of the part that the bias adds to the mean of one turn.
    slow: f64,
    slow_dof: f64,
}

impl RestNoise {
    /// Returns the noise of the three sensors, from the rests of one turn or more; `None` where the rests are too short
    /// for two blocks.
    pub(super) fn of(rests: &[Rest], rate_hz: f64) -> Option<[Self; 3]> {
        let block = ((BLOCK_S * rate_hz).round() as usize).max(1);
        let [x, y, z] = [0, 1, 2].map(|axis| Self::of_axis(rests, axis, block, rate_hz));
        Some([x?, y?, z?])
    }

    fn of_axis(rests: &[Rest], axis: usize, block: usize, rate_hz: f64) -> Option<Self> {
        let values = |part: &[Vector3<f64>]| part.iter().map(|value| value[axis]).collect::<Vec<f64>>();
        let (mut squares, mut density_dof) = (0.0, 0.0);
        for part in rests.iter().flat_map(|rest| [&rest.before, &rest.after]) {
            let means: Vec<f64> = values(part).chunks_exact(block).map(stats::mean).collect();
            let mean = stats::mean(&means);
            if means.len() > 1 {
                squares += means.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
                density_dof += means.len() as f64 - 1.0;
            }
        }
        if density_dof == 0.0 {
            return None;
        }
        let density_s = squares / density_dof * block as f64 / rate_hz;
        let (mut excess, mut slow_dof) = (0.0, 0.0);
        for rest in rests.iter().filter(|rest| !rest.before.is_empty() && !rest.after.is_empty()) {
            let step = stats::mean(&values(&rest.after)) - stats::mean(&values(&rest.before));
            let [before_s, after_s] = [&rest.before, &rest.after].map(|part| part.len() as f64 / rate_hz);
            excess += step * step - density_s * (before_s.recip() + after_s.recip());
            slow_dof += 1.0;
        }
        // A difference of two means holds the wander twice.
        let slow = if slow_dof > 0.0 { (excess / slow_dof / 2.0).max(0.0) } else { 0.0 };
        Some(Self { density_s, density_dof, slow, slow_dof })
    }

    /// Returns the standard deviation of a mean over `span_s`, and its degrees of freedom: short noise.
    pub(super) fn short(&self, span_s: f64) -> (f64, f64) {
        ((self.density_s / span_s).sqrt(), self.density_dof)
    }

    /// Returns the standard deviation of the part that the bias adds to the mean of a turn, and its degrees of freedom.
    pub(super) fn slow(&self) -> (f64, f64) {
        (self.slow.sqrt(), self.slow_dof.max(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::world::Dice;
    use super::*;

    /// Noise behind a low-pass of 10 Hz at 1 kHz has the density of the white noise before it, although neighbours
    /// differ by a fortieth of it. A bias that steps by 3 between the rests has a variance of 4.5 for one of them.
    #[test]
    fn density_and_wander_are_found() {
        let mut dice = Dice::new(3);
        let (rate_hz, keep) = (1000.0, (-std::f64::consts::TAU * 10.0 / 1000.0_f64).exp());
        let mut state = Vector3::zeros();
        let mut part = |samples: usize, level: f64| -> Vec<Vector3<f64>> {
            (0..samples)
                .map(|_| {
                    state = state * keep + Vector3::from_fn(|_, _| dice.normal()) * (1.0 - keep);
                    state.add_scalar(level)
                })
                .collect()
        };
        let rests: Vec<Rest> = (0..40)
            .map(|k| Rest { before: part(1000, 0.0), after: part(8000, if k % 2 == 0 { 3.0 } else { -3.0 }) })
            .collect();
        for noise in RestNoise::of(&rests, rate_hz).unwrap() {
            // A variance of 1 at 1 kHz: 1e-3 in a second.
            assert!((noise.short(1.0).0 / 1e-3_f64.sqrt() - 1.0).abs() < 0.1, "{noise:?}");
            assert!((noise.slow().0 / 4.5_f64.sqrt() - 1.0).abs() < 0.02, "{noise:?}");
        }
        assert_eq!(RestNoise::of(&[Rest { before: part(10, 0.0), after: part(300, 0.0) }], rate_hz), None);
    }
}
