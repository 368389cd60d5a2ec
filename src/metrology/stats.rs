//! Statistics: location, spread and the quantiles of Student's t and chi-square (from `statrs`), effective degrees of
//! freedom.

use statrs::distribution::{ChiSquared, ContinuousCDF, StudentsT};

/// The two-sided probability of one standard deviation of a normal distribution, erf(1/sqrt 2).
pub const ONE_SIGMA: f64 = 0.682_689_492_137_085_9;

/// Two-sided coverage factor of Student's t: `P(|t| <= k) = probability`. Infinite `dof` gives the normal factor;
/// NaN for `dof <= 0`, where no interval exists.
#[must_use]
pub fn coverage_factor(probability: f64, dof: f64) -> f64 {
    if dof.is_nan() || dof <= 0.0 {
        return f64::NAN;
    }
    // Beyond this the t and the normal quantile agree to 1e-9, and statrs' series loses digits.
    let dof = dof.min(1e8);
    StudentsT::new(0.0, 1.0, dof).map_or(f64::NAN, |t| t.inverse_cdf(0.5 + probability / 2.0))
}

/// Quantile of chi-square with `dof` degrees of freedom (need not be whole). NaN for `dof <= 0`.
#[must_use]
pub fn chi_square_quantile(probability: f64, dof: f64) -> f64 {
    if dof.is_nan() || dof <= 0.0 {
        return f64::NAN;
    }
    if dof > 1e5 {
        // Wilson-Hilferty: at this size its error is below 1e-9 relative, where the incomplete gamma function is slow.
        let z = normal_quantile(probability);
        let a = 2.0 / (9.0 * dof);
        return dof * (1.0 - a + z * a.sqrt()).powi(3);
    }
    ChiSquared::new(dof).map_or(f64::NAN, |c| c.inverse_cdf(probability))
}

/// Quantile of the standard normal distribution.
#[must_use]
pub fn normal_quantile(probability: f64) -> f64 {
    statrs::distribution::Normal::standard().inverse_cdf(probability)
}

/// Two-sided interval of a standard deviation estimated as `sd` with `dof` degrees of freedom (chi-square).
#[must_use]
pub fn sd_interval(sd: f64, dof: f64, probability: f64) -> (f64, f64) {
    let low = sd * (dof / chi_square_quantile(0.5 + probability / 2.0, dof)).sqrt();
    let high = sd * (dof / chi_square_quantile(0.5 - probability / 2.0, dof)).sqrt();
    (low, high)
}

/// Mean, with the first value removed before the sum so that an offset costs no digits. NaN when empty.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    let Some(&first) = values.first() else { return f64::NAN };
    // Blocks keep the rounding error at the square root of the length.
    let sum: f64 = values.chunks(1024).map(|block| block.iter().map(|v| v - first).sum::<f64>()).sum();
    first + sum / values.len() as f64
}

/// Mean and sample standard deviation (n - 1); the deviation is NaN below two values.
#[must_use]
pub fn mean_sd(values: &[f64]) -> (f64, f64) {
    let mean = mean(values);
    let sum: f64 = values.chunks(1024).map(|block| block.iter().map(|v| (v - mean).powi(2)).sum::<f64>()).sum();
    let sd = if values.len() < 2 { f64::NAN } else { (sum / (values.len() - 1) as f64).sqrt() };
    (mean, sd)
}

/// Standard deviation of the white part of a record, from successive differences: `sqrt(mean(diff^2) / 2)`
/// (von Neumann). Drift and steps hardly enter it.
#[must_use]
pub fn white_sd(values: &[f64]) -> f64 {
    let sum: f64 = values.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
    (sum / (2.0 * (values.len().max(2) - 1) as f64)).sqrt()
}

/// Median of the values, which are reordered. NaN when empty.
#[must_use]
pub fn median(values: &mut [f64]) -> f64 {
    let n = values.len();
    if n == 0 {
        return f64::NAN;
    }
    let (below, &mut upper, _) = values.select_nth_unstable_by(n / 2, f64::total_cmp);
    if n % 2 == 1 {
        return upper;
    }
    let lower = below.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    f64::midpoint(lower, upper)
}

/// Effective degrees of freedom of a combined uncertainty (Welch-Satterthwaite, GUM G.2b): each pair is a standard
/// uncertainty, already multiplied by its sensitivity, and its degrees of freedom (infinity for type B).
#[must_use]
pub fn welch_satterthwaite(contributions: &[(f64, f64)]) -> f64 {
    let variance: f64 = contributions.iter().map(|(u, _)| u * u).sum();
    let weighted: f64 = contributions.iter().map(|(u, dof)| u.powi(4) / dof).sum();
    variance * variance / weighted
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Expected values from printed tables of the distributions.
    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (dof, k) in [(1.0, 12.7062), (2.0, 4.3027), (6.0, 2.4469), (30.0, 2.0423), (f64::INFINITY, 1.95996)] {
            assert!((coverage_factor(0.95, dof) - k).abs() < 1e-4, "t of {dof}: {}", coverage_factor(0.95, dof));
        }
        for (p, dof, q) in [(0.95, 5.0, 11.0705), (0.025, 10.0, 3.24697), (0.975, 100.0, 129.561)] {
            assert!((chi_square_quantile(p, dof) - q).abs() < 1e-3 * q, "chi2 {p} {dof}");
        }
        assert!(coverage_factor(0.95, 0.0).is_nan() && chi_square_quantile(0.5, f64::NAN).is_nan());
    }

    /// The two branches of the chi-square quantile meet.
    #[test]
    fn wilson_hilferty_takes_over_smoothly() {
        for p in [0.025, 0.16, 0.84, 0.975] {
            let (exact, approximate) = (chi_square_quantile(p, 99_999.0), chi_square_quantile(p, 100_001.0) - 2.0);
            assert!((exact / approximate - 1.0).abs() < 1e-7, "{p}: {exact} {approximate}");
        }
    }

    /// Six runs: the 95 % interval is 0.62 to 2.45 times the figure.
    #[test]
    fn interval_of_six_runs() {
        let (low, high) = sd_interval(1.0, 5.0, 0.95);
        assert!((low - 0.6242).abs() < 1e-4 && (high - 2.4526).abs() < 1e-4, "{low} {high}");
    }

    #[test]
    fn spread_survives_an_offset() {
        let values = [1e9 + 1.0, 1e9 + 2.0, 1e9 + 3.0, 1e9 + 4.0];
        let (mean, sd) = mean_sd(&values);
        assert_eq!((mean - 1e9, sd), (2.5, (5.0_f64 / 3.0).sqrt()));
        assert!((white_sd(&values) - 0.5_f64.sqrt()).abs() < 1e-12);
        assert_eq!(median(&mut values.map(|v| v - 1e9)), 2.5);
    }

    /// GUM H.1.6: end gauge, effective degrees of freedom 16 from 25/18, 9.7/25.6, 2.9/50 and 16.6/2 nm with 34 in all.
    #[test]
    fn effective_degrees_of_freedom_of_the_gum() {
        let dof = welch_satterthwaite(&[(25.0, 18.0), (9.7, 25.6), (2.9, 50.0), (16.6, 2.0)]);
        assert!((dof - 16.7).abs() < 0.1, "{dof}");
    }
}
