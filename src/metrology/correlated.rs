//! Mean of epochs whose errors are not independent, since the epochs follow each other closely (GNSS fixes, slow
//! sensors).

use crate::{Refusal, series, stats};

/// Mean of correlated epochs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mean {
    /// Weighted mean.
    pub mean: f64,
    /// Standard deviation of an epoch of mean weight about the true mean: the scatter in the record, and the part of it
    /// that the record's own mean takes out.
    pub sd: f64,
    /// Standard uncertainty of the mean.
    pub mean_sd: f64,
    /// Independent epochs that would give the same uncertainty.
    pub effective: f64,
    /// Degrees of freedom of `mean_sd` for Student's t: `effective - 1`.
    pub dof: f64,
}

impl Mean {
    /// Expanded uncertainty of the mean, 95 % (Student's t).
    #[must_use]
    pub fn expanded(&self) -> f64 {
        self.mean_sd * stats::coverage_factor(0.95, self.dof)
    }
}

/// A record of fewer epochs than this does not show their correlation.
const LEAST: usize = 16;
/// An uncertainty needs at least this many independent epochs.
const LEAST_EFFECTIVE: f64 = 3.0;

/// Number of independent samples that have the same variance of the mean: `n / (1 + 2 sum rho_k)`, at most n.
///
/// The sum of autocorrelations ends where the sum of two neighbouring lags is no longer positive, and the sums are
/// taken not to rise again (initial monotone sequence, C. J. Geyer, *Practical Markov Chain Monte Carlo*, Statistical
/// Science 7(4), 1992, section 3.3): noise of the later lags does not enter. A record must hold many correlation times:
/// in a record of a few, the mean hides part of the correlation, and the number is too large.
///
/// # Errors
/// [`Refusal::NotFinite`], [`Refusal::TooFew`] below 16 samples, [`Refusal::Constant`].
pub fn effective_samples(values: &[f64]) -> Result<f64, Refusal> {
    series::finite("epochs", values)?;
    if values.len() < LEAST {
        return Err(Refusal::TooFew { what: "a correlation".to_owned(), got: values.len(), needed: LEAST });
    }
    let covariance = autocovariance(values);
    if covariance[0] <= 0.0 || values.iter().all(|v| *v == values[0]) {
        let (samples, value) = (values.len(), values[0]);
        return Err(Refusal::Constant { channel: "epochs".to_owned(), samples, value });
    }
    let pairs = covariance.as_chunks::<2>().0.iter().map(|pair| (pair[0] + pair[1]) / covariance[0]);
    let mut least = f64::INFINITY;
    let sum: f64 = pairs
        .take_while(|pair| *pair > 0.0)
        .map(|pair| {
            least = least.min(pair);
            least
        })
        .sum();
    let n = values.len() as f64;
    Ok(n / (2.0 * sum - 1.0).max(1.0))
}

/// Autocovariance at every lag, divided by the number of all samples, by the transform of the record padded to twice its
/// length.
fn autocovariance(values: &[f64]) -> Vec<f64> {
    let n = values.len();
    let mean = stats::mean(values);
    let (forward, backward) = (gnc_fourier::forward(2 * n), gnc_fourier::inverse(2 * n));
    let (mut time, mut spectrum) = (forward.make_input_vec(), forward.make_output_vec());
    time.iter_mut().zip(values).for_each(|(t, v)| *t = v - mean);
    // The buffers come from the plans themselves, so their lengths fit. The ends of a power spectrum are real.
    let transformed = forward.process(&mut time, &mut spectrum).is_ok();
    for c in &mut spectrum {
        *c = (c.norm_sqr() / (2.0 * (n * n) as f64)).into();
    }
    if !(transformed && backward.process(&mut spectrum, &mut time).is_ok()) {
        unreachable!("buffers of the plan do not fit the plan");
    }
    time.truncate(n);
    time
}

/// Mean of correlated epochs with weights (`1 / sigma^2` of each, or any numbers in that proportion; `None`: equal
/// weights).
///
/// The effective number E comes from the residuals times the root of their weights, which all have the same scatter.
/// The residuals hold `1 - 1 / E` of the variance, so the uncertainty of the mean is the root of their mean square over
/// `E - 1`. The uncertainty rests on the scatter in the record, not on the size that the weights claim.
///
/// # Errors
/// [`Refusal::Lengths`], [`Refusal::NotFinite`]; [`Refusal::Parameter`] for a weight that is not above 0;
/// [`Refusal::TooFew`] below 16 epochs or where fewer than three of them are independent; [`Refusal::Constant`].
pub fn mean(values: &[f64], weights: Option<&[f64]>) -> Result<Mean, Refusal> {
    let alike = vec![1.0; if weights.is_some() { 0 } else { values.len() }];
    let weights = weights.unwrap_or(&alike);
    series::channels(&["epochs", "weights"], &[values, weights])?;
    for w in weights {
        series::positive("weight", *w)?;
    }
    let total: f64 = weights.iter().sum();
    let level = values.first().copied().unwrap_or(0.0);
    let mean = level + values.iter().zip(weights).map(|(v, w)| w * (v - level)).sum::<f64>() / total;
    let residuals: Vec<f64> =
        values.iter().zip(weights).map(|(v, w)| (w * values.len() as f64 / total).sqrt() * (v - mean)).collect();
    let n = values.len() as f64;
    let effective = effective_samples(&residuals)?;
    if effective < LEAST_EFFECTIVE {
        let what = "independent epochs (the record is short against its correlation)".to_owned();
        return Err(Refusal::TooFew { what, got: effective as usize, needed: LEAST_EFFECTIVE as usize });
    }
    let square = residuals.iter().map(|r| r * r).sum::<f64>() / n;
    let mean_sd = (square / (effective - 1.0)).sqrt();
    Ok(Mean { mean, sd: mean_sd * effective.sqrt(), mean_sd, effective, dof: effective - 1.0 })
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    fn normal(dice: &mut ChaCha8Rng) -> f64 {
        StandardNormal.sample(dice)
    }

    /// First-order autoregression of unit variance: the mean of n has the variance of `n (1 - a) / (1 + a)` epochs.
    fn relaxation(n: usize, a: f64, dice: &mut ChaCha8Rng) -> Vec<f64> {
        let mut state = normal(dice);
        (0..n)
            .map(|_| {
                state = a * state + (1.0 - a * a).sqrt() * normal(dice);
                state
            })
            .collect()
    }

    #[test]
    fn known_correlations() {
        let dice = &mut ChaCha8Rng::seed_from_u64(1);
        for a in [0.0, 0.5, 0.9, 0.98] {
            let (n, runs) = (10_000, 30);
            let expected = n as f64 * (1.0 - a) / (1.0 + a);
            let found: f64 =
                (0..runs).map(|_| effective_samples(&relaxation(n, a, dice)).unwrap() / f64::from(runs)).sum();
            assert!((found / expected - 1.0).abs() < 0.1, "a {a}: {found} {expected}");
        }
        // Noise that alternates is no better than independent noise.
        assert_eq!(effective_samples(&relaxation(1000, -0.8, dice)).unwrap(), 1000.0);
    }

    /// Checks the autocovariance against its definition, lag by lag.
    #[test]
    fn autocovariance_of_the_definition() {
        let values = relaxation(37, 0.7, &mut ChaCha8Rng::seed_from_u64(2));
        let mean = values.iter().sum::<f64>() / 37.0;
        for (lag, found) in autocovariance(&values).into_iter().enumerate() {
            let products = values.iter().zip(&values[lag..]).map(|(a, b)| (a - mean) * (b - mean));
            assert!((found - products.sum::<f64>() / 37.0).abs() < 1e-14, "lag {lag}");
        }
    }

    /// 95 % intervals cover the truth, also for epochs of unlike noise. Intervals of dev / sqrt(n) cover hardly a
    /// third.
    #[test]
    fn intervals_cover_the_truth() {
        const SEED: u64 = 3;
        const RUNS: usize = 1000;
        println!("seed {SEED}");
        let dice = &mut ChaCha8Rng::seed_from_u64(SEED);
        let (mut covered, mut naive, mut weighted) = (0, 0, 0);
        for _ in 0..RUNS {
            // Ten minutes at 1 Hz with a correlation time of 10 s: 30 independent epochs.
            let epochs = relaxation(600, 0.905, dice);
            let m = mean(&epochs, None).unwrap();
            covered += usize::from(m.mean.abs() < m.expanded());
            naive += usize::from(m.mean.abs() < 1.96 * stats::mean_sd(&epochs).1 / 600.0_f64.sqrt());
            let sigma: Vec<f64> = (0..600).map(|i| if i < 300 { 1.0 } else { 3.0 }).collect();
            let unlike: Vec<f64> = epochs.iter().zip(&sigma).map(|(e, s)| 1e6 + e * s).collect();
            let m = mean(&unlike, Some(&sigma.iter().map(|s| 1.0 / (s * s)).collect::<Vec<_>>())).unwrap();
            weighted += usize::from((m.mean - 1e6).abs() < m.expanded());
        }
        println!("covered {covered}, weighted {weighted}, dev / sqrt(n) {naive} of {RUNS}");
        assert!((920..=965).contains(&covered) && (920..=965).contains(&weighted) && naive < 450);
    }

    #[test]
    fn refusals() {
        let dice = &mut ChaCha8Rng::seed_from_u64(4);
        let check = |values: &[f64], weights: Option<&[f64]>, expected: &str| {
            let refusal = mean(values, weights).unwrap_err().to_string();
            assert!(refusal.contains(expected), "{refusal}");
        };
        check(&[1.0; 5], None, "a correlation: 5 samples, needs at least 16");
        check(&[], None, "a correlation: 0 samples");
        check(&[1.0; 50], None, "all 50 samples are");
        check(&[f64::NAN; 50], None, "epochs: sample 0 is NaN");
        check(&[1.0; 50], Some(&[1.0; 49]), "channels differ in length");
        check(&relaxation(50, 0.0, dice), Some(&[0.0; 50]), "weight is 0");
        let ramp: Vec<f64> = (0..50).map(f64::from).collect();
        check(&ramp, None, "independent epochs (the record is short against its correlation)");
    }
}
