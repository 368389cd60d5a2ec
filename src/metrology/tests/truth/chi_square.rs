//! The best possible coverage of the interval of an overlapping Allan deviation: the chi-square of its exact degrees of
//! freedom.
//!
//! A squared deviation is a sum of squares of correlated normal values. It is distributed like the sum of independent
//! squares with the eigenvalues of their covariance as weights. Chi-square has the mean and the variance of this sum,
//! but not its form. At long averaging times few of the squares count, and the two differ.

use gnc_metrology::stats::{self, ONE_SIGMA};
use nalgebra::DMatrix;

/// Number of differences taken from an averaging time; more do not change the result.
const OF_TAU: usize = 16;
/// Beyond this many averaging times in a record the sum is as good as chi-square.
const LONG: usize = 20;

/// Share of records whose 68.3 % interval of the deviation at m samples (a power of two) holds the truth where the
/// degrees of freedom are exact. `of_sum` is the variance of the sum of a number of samples (up to a part that no
/// difference shows).
pub fn coverage(of_sum: &dyn Fn(usize) -> f64, samples: usize, m: usize) -> f64 {
    if samples > LONG * m {
        return ONE_SIGMA;
    }
    // From here on all lengths count in steps.
    let step = m.div_ceil(OF_TAU);
    let (m, samples) = (m / step, samples / step);
    let count = samples - 2 * m + 1;
    let of_sum: Vec<f64> = (0..count + 2 * m).map(|n| of_sum(n * step)).collect();
    // Covariance of the sums that begin `apart` steps apart, and of their differences.
    let sums = |apart: usize| (of_sum[apart + m] - 2.0 * of_sum[apart] + of_sum[apart.abs_diff(m)]) / 2.0;
    let differences = |apart: usize| 2.0 * sums(apart) - sums(apart + m) - sums(apart.abs_diff(m));
    let of_lag: Vec<f64> = (0..count).map(differences).collect();
    let eigenvalues = DMatrix::from_fn(count, count, |a, b| of_lag[a.abs_diff(b)]).symmetric_eigenvalues();
    let total = eigenvalues.sum();
    let weights: Vec<f64> = eigenvalues.iter().map(|l| l / total).collect();
    let edf = 1.0 / weights.iter().map(|w| w * w).sum::<f64>();
    let above = |tail: f64| above(&weights, stats::chi_square_quantile(tail, edf) / edf);
    above((1.0 - ONE_SIGMA) / 2.0) - above((1.0 + ONE_SIGMA) / 2.0)
}

/// Probability that the sum of squares exceeds x (J. P. Imhof, *Computing the distribution of quadratic forms in normal
/// variables*, Biometrika 48, 1961), for weights that add up to 1.
fn above(weights: &[f64], x: f64) -> f64 {
    const STEP: f64 = 0.02;
    const STEPS: usize = 50_000;
    let at = |i: usize| {
        let u = (i as f64 + 0.5) * STEP;
        let (mut phase, mut power) = (-x * u / 2.0, 0.0);
        for w in weights {
            phase += (w * u).atan() / 2.0;
            power += (w * u).powi(2).ln_1p() / 4.0;
        }
        (phase.sin() / u, power)
    };
    let mut sum = 0.0;
    for (value, power) in (0..STEPS).map(at) {
        sum += value * (-power).exp() * STEP;
        if power > 25.0 {
            break;
        }
    }
    0.5 + sum / std::f64::consts::PI
}
