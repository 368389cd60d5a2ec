//! What the interval of an overlapping Allan deviation can cover at best: the chi-square of its exact degrees of freedom.
//!
//! A squared deviation is a sum of squares of normal values that depend on each other. It is distributed as the sum of
//! independent squares with the eigenvalues of their covariance as weights, of which chi-square has the mean and the
//! variance but not the form. At long averaging times few of them count, and the two differ.

use nalgebra::DMatrix;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Differences of an averaging time that are taken: as good as all of them.
const OF_TAU: usize = 16;
/// Beyond this many averaging times in a record the sum is as good as chi-square.
const LONG: usize = 20;
/// Probability within one standard deviation.
pub const ONE_SIGMA: f64 = 0.682_689_492_137_086;

/// Share of records whose 68.3 % interval of the deviation at m samples (a power of two) holds the truth where the degrees of freedom are
/// exact. `of_sum` is the variance of the sum of so many samples (up to a part that no difference sees).
pub fn coverage(of_sum: &dyn Fn(usize) -> f64, samples: usize, m: usize) -> f64 {
    if samples > LONG * m {
        return ONE_SIGMA;
    }
    // From here on all lengths are in steps.
    let step = m.div_ceil(OF_TAU);
    let (m, samples) = (m / step, samples / step);
    let count = samples - 2 * m + 1;
    let of_sum: Vec<f64> = (0..count + 2 * m).map(|n| of_sum(n * step)).collect();
    // Covariance of the sums that begin so far apart, and of their differences.
    let sums = |apart: usize| (of_sum[apart + m] - 2.0 * of_sum[apart] + of_sum[apart.abs_diff(m)]) / 2.0;
    let differences = |apart: usize| 2.0 * sums(apart) - sums(apart + m) - sums(apart.abs_diff(m));
    let of_lag: Vec<f64> = (0..count).map(differences).collect();
    let eigenvalues = DMatrix::from_fn(count, count, |a, b| of_lag[a.abs_diff(b)]).symmetric_eigenvalues();
    let total = eigenvalues.sum();
    let weights: Vec<f64> = eigenvalues.iter().map(|l| l / total).collect();
    let edf = 1.0 / weights.iter().map(|w| w * w).sum::<f64>();
    let chi_square = ChiSquared::new(edf).unwrap();
    let above = |tail: f64| above(&weights, chi_square.inverse_cdf(tail) / edf);
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

/// Simulated with numpy: 400,000 sums of squares of white, flicker and random-walk noise, averaged over a fifth and a quarter
/// of the record; their standard error is 0.0007.
#[test]
fn coverage_of_a_chi_square() {
    type Sum = fn(usize) -> f64;
    let white: Sum = |n| n as f64;
    let flicker: Sum = |n| if n == 0 { 0.0 } else { -(n as f64).powi(2) * (n as f64).ln() };
    let walk: Sum = |n| -(n as f64).powi(3) / 6.0;
    let kinds = [(white, [0.718, 0.730]), (flicker, [0.705, 0.710]), (walk, [0.714, 0.728])];
    for (of_sum, expected) in kinds {
        for (parts, expected) in [5, 4].into_iter().zip(expected) {
            let found = coverage(&of_sum, 1024 * parts, 1024);
            println!("{found} {expected}");
            assert!((found - expected).abs() < 0.003, "{found} {expected}");
        }
    }
}
