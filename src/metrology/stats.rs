//! Statistics: location, spread and the quantiles of Student's t and chi-square (from `statrs`), effective degrees of
//! freedom.

use statrs::distribution::{ChiSquared, Continuous, ContinuousCDF, StudentsT};

/// Probability at which a good point is named as a suspect, shared by all points (Bonferroni).
pub(crate) const SUSPECT_PROBABILITY: f64 = 0.001;

/// Externally studentised residual of a point of a fit: the residual over the standard deviation that the other points
/// give it. `squares` is the sum of the squares of all residuals, `own` is 1 less the leverage of the point, `dof` are
/// the degrees of freedom of the others, `floor` is the least variance.
pub(crate) fn studentised(residual: f64, squares: f64, own: f64, dof: f64, floor: f64) -> f64 {
    let others = (squares - residual * residual / own) / dof;
    residual / (others.max(floor) * own).sqrt()
}

/// Two-sided probability of one standard deviation of a normal distribution, erf(1/sqrt 2).
pub const ONE_SIGMA: f64 = 0.682_689_492_137_085_9;

/// Two-sided coverage factor of Student's t: `P(|t| <= k) = probability`. Infinite `dof` gives the normal factor;
/// NaN for `dof <= 0`, where no interval exists.
#[must_use]
pub fn coverage_factor(probability: f64, dof: f64) -> f64 {
    if dof.is_nan() || dof <= 0.0 {
        return f64::NAN;
    }
    let upper = 0.5 + probability / 2.0;
    if dof > MANY {
        // Cornish-Fisher to the second order. The third order is below 1e-8 here, where the library's search is slow or
        // endless.
        let z = normal_quantile(upper);
        let second =
            if dof.is_finite() { (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / (96.0 * dof * dof) } else { 0.0 };
        return z + (z.powi(3) + z) / (4.0 * dof) + second;
    }
    StudentsT::new(0.0, 1.0, dof).map_or(f64::NAN, |t| t.inverse_cdf(upper))
}

/// Above this number of degrees of freedom the quantiles come from expansions in 1 / dof.
const MANY: f64 = 1000.0;

/// Quantile of chi-square with `dof` degrees of freedom (need not be whole). NaN for `dof <= 0`.
#[must_use]
pub fn chi_square_quantile(probability: f64, dof: f64) -> f64 {
    if dof.is_nan() || dof <= 0.0 {
        return f64::NAN;
    }
    let Ok(chi_square) = ChiSquared::new(dof) else { return f64::NAN };
    if dof <= MANY {
        return chi_square.inverse_cdf(probability);
    }
    // Wilson-Hilferty is good to some 1e-6 here, and a Newton step squares that error. Far out no step is needed.
    let z = normal_quantile(probability);
    let a = 2.0 / (9.0 * dof);
    let start = dof * (1.0 - a + z * a.sqrt()).powi(3);
    if dof > 1e6 { start } else { start - (chi_square.cdf(start) - probability) / chi_square.pdf(start) }
}

/// Probability that chi-square with `dof` degrees of freedom is at most `value`. NaN for `dof <= 0`.
#[must_use]
pub fn chi_square_probability(value: f64, dof: f64) -> f64 {
    if dof.is_nan() || dof <= 0.0 {
        return f64::NAN;
    }
    ChiSquared::new(dof).map_or(f64::NAN, |chi_square| chi_square.cdf(value.max(0.0)))
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

/// Interval of the length of a vector of two components, measured as `found`, where each component has the standard
/// uncertainty `sd`. It is taken from the distribution of the length about `found` (propagated after JCGM 101; Rice
/// 1945), from its `(1 - probability) / 2` to its `(1 + probability) / 2` quantile. Where the region that holds the
/// vector with this probability includes the length 0, the interval goes from 0 to the `probability` quantile: a length
/// has no sign, and the true length may be zero. NaN where a number is not finite or `sd` is negative.
#[must_use]
pub fn amplitude_interval(found: f64, sd: f64, probability: f64) -> (f64, f64) {
    if !(found.is_finite() && sd >= 0.0 && sd.is_finite() && (0.0..1.0).contains(&probability)) {
        return (f64::NAN, f64::NAN);
    }
    if sd == 0.0 {
        return (found, found);
    }
    let ratio = found.abs() / sd;
    let quantile = |p: f64| sd * rice_quantile(p, ratio);
    // Radius of the region: chi-square of two degrees of freedom.
    if ratio <= (-2.0 * (1.0 - probability).ln()).sqrt() {
        return (0.0, quantile(probability));
    }
    (quantile(0.5 - probability / 2.0), quantile(0.5 + probability / 2.0))
}

/// Quantile of the length of a vector of two normal components of variance 1 about a vector of length `ratio`.
fn rice_quantile(probability: f64, ratio: f64) -> f64 {
    // Far out the length is normal. The component across adds half its variance over the length to the mean, and takes
    // half of its variance over the square of the length from the variance.
    if ratio > 20.0 {
        return ratio + 0.5 / ratio + normal_quantile(probability) * (1.0 - 0.25 / (ratio * ratio));
    }
    let (mut low, mut high) = (0.0, ratio + 10.0);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if rice_probability(middle, ratio) < probability { low = middle } else { high = middle }
    }
    f64::midpoint(low, high)
}

/// Probability that the length is at most `length`: a mixture of chi-squares of even degrees of freedom with Poisson
/// weights.
fn rice_probability(length: f64, ratio: f64) -> f64 {
    let (lambda, x) = (ratio * ratio / 2.0, length * length / 2.0);
    let terms = (lambda + 12.0 * lambda.sqrt() + 40.0) as usize;
    // Chi-square of 2 (j + 1) degrees of freedom is at most 2 x with 1 - sum over i <= j of x^i e^-x / i!.
    let (mut weight, mut term) = ((-lambda).exp(), (-x).exp());
    let (mut below, mut sum) = (1.0 - term, 0.0);
    for j in 1..=terms {
        sum += weight * below;
        weight *= lambda / j as f64;
        term *= x / j as f64;
        below -= term;
    }
    sum
}

/// Median of the absolute value of a normal variable, in standard deviations.
pub(crate) const MEDIAN_DEVIATION: f64 = 0.674_49;
/// Median of the absolute difference of two normal values, in standard deviations: 0.6745 sqrt 2.
pub(crate) const MEDIAN_DIFFERENCE: f64 = 0.953_87;

/// Mean, with the first value removed before the sum so that an offset costs no digits. NaN when empty.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    let Some(&first) = values.first() else { return f64::NAN };
    first + sum(values, |v| v - first) / values.len() as f64
}

/// Mean and sample standard deviation (n - 1); the deviation is NaN below two values.
#[must_use]
pub fn mean_sd(values: &[f64]) -> (f64, f64) {
    let mean = mean(values);
    let sum = sum(values, |v| (v - mean) * (v - mean));
    let sd = if values.len() < 2 { f64::NAN } else { (sum / (values.len() - 1) as f64).sqrt() };
    (mean, sd)
}

/// Root of the mean of the squares; NaN when empty. The sum keeps the order of the values, since a record must give the
/// same bits when it is computed again.
#[must_use]
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

/// Sum in eight lanes over blocks of 1024. It runs at memory speed and has the rounding error of short sums.
pub(crate) fn sum(values: &[f64], term: impl Fn(f64) -> f64) -> f64 {
    const LANES: usize = 8;
    values
        .chunks(1024)
        .map(|block| {
            let mut lanes = [0.0; LANES];
            let (whole, rest) = block.as_chunks::<LANES>();
            for chunk in whole {
                for l in 0..LANES {
                    lanes[l] += term(chunk[l]);
                }
            }
            lanes.iter().sum::<f64>() + rest.iter().map(|v| term(*v)).sum::<f64>()
        })
        .sum()
}

/// Standard deviation of noise from the median absolute difference of neighbours. Motion in less than half of the
/// record does not affect it. 0 below two values.
#[must_use]
pub fn median_step(values: &[f64]) -> f64 {
    let mut steps: Vec<f64> = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    if steps.is_empty() { 0.0 } else { median(&mut steps) / MEDIAN_DIFFERENCE }
}

/// Standard deviation of the white part of a record, from successive differences: `sqrt(mean(diff^2) / 2)` (von
/// Neumann). Drift and steps hardly affect it.
#[must_use]
pub fn white_sd(values: &[f64]) -> f64 {
    let sum: f64 = values.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
    (sum / (2.0 * (values.len().max(2) - 1) as f64)).sqrt()
}

/// Standard deviation of white noise whose means would scatter like those of a record. It comes from the median
/// absolute difference of neighbouring means in all stretches, each with the number of rows of its means, times the
/// root of that number. Behind a low-pass, neighbours have nearly the same error, and means scatter by more than
/// [`white_sd`] shows. Motion in less than half of the record does not affect it. 0 where no stretch holds two means.
#[must_use]
pub fn sd_of_means(stretches: &[(&[f64], usize)]) -> f64 {
    let mut differences = Vec::new();
    for (values, rows) in stretches {
        let level = values.first().copied().unwrap_or(0.0);
        let running = values.iter().scan(0.0, |sum, value| {
            *sum += value - level;
            Some(*sum)
        });
        let sums: Vec<f64> = std::iter::once(0.0).chain(running).collect();
        let rows = (*rows).max(1);
        let root = (rows as f64).sqrt();
        let pairs = sums.iter().zip(sums.iter().skip(rows)).zip(sums.iter().skip(2 * rows));
        differences.extend(pairs.map(|((from, middle), to)| (to - 2.0 * middle + from).abs() / root));
    }
    if differences.is_empty() { 0.0 } else { median(&mut differences) / MEDIAN_DIFFERENCE }
}

/// Median of the values. The function reorders them. NaN when empty.
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

/// Smallest and largest of finite values.
#[must_use]
pub fn range(values: &[f64]) -> (f64, f64) {
    const LANES: usize = 8;
    let (mut low, mut high) = ([f64::INFINITY; LANES], [f64::NEG_INFINITY; LANES]);
    let (whole, rest) = values.as_chunks::<LANES>();
    // Plain comparisons, so that the compiler can use vectors; f64::min would also treat NaN.
    for chunk in whole {
        for l in 0..LANES {
            low[l] = if chunk[l] < low[l] { chunk[l] } else { low[l] };
            high[l] = if chunk[l] > high[l] { chunk[l] } else { high[l] };
        }
    }
    let both = |(l, h): (f64, f64), v: f64| (l.min(v), h.max(v));
    low.into_iter()
        .chain(high)
        .chain(rest.iter().copied())
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), both)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Expected values come from printed tables of the distributions.
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

    /// scipy.stats: rice.ppf of 0.025, 0.95 and 0.975. Where 0 lies within the region, the interval starts there.
    #[test]
    fn intervals_of_a_length() {
        for (found, low, high) in [
            (0.0, 0.0, 2.447746830680816),
            (1.0, 0.0, 2.939762553344385),
            (2.4, 0.0, 4.202747424414629),
            (2.5, 0.8969311967571351, 4.607035163014746),
            (5.0, 3.1660453112322613, 7.044187018673138),
            (19.9, 17.966480076988617, 21.88392370872212),
            (25.0, 23.06086035239773, 26.97921646261016),
        ] {
            let (a, b) = amplitude_interval(3.0 * found, 3.0, 0.95);
            assert!((a / 3.0 - low).abs() < 1e-4 && (b / 3.0 - high).abs() < 1e-4, "{found}: {a} {b}");
        }
        assert!(amplitude_interval(1.0, -1.0, 0.95).0.is_nan() && amplitude_interval(f64::NAN, 1.0, 0.95).1.is_nan());
    }

    /// The expansions begin where they agree with the exact quantiles.
    #[test]
    fn expansions_take_over_smoothly() {
        // scipy.stats: chi2.ppf and t.ppf at 1001 degrees of freedom.
        for (p, chi) in [
            (0.025, 915.2133312204413),
            (0.16, 956.5117667305462),
            (0.84, 1045.4735558850198),
            (0.975, 1090.574735898763),
        ] {
            assert!(
                (chi_square_quantile(p, 1001.0) / chi - 1.0).abs() < 1e-9,
                "{p}: {}",
                chi_square_quantile(p, 1001.0)
            );
        }
        assert!((coverage_factor(0.95, 1001.0) - 1.9623367052808798).abs() < 1e-8, "{}", coverage_factor(0.95, 1001.0));
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

    /// 2, 4, 4, 4, 5, 5, 7, 9: mean 5, squares about it 32, squares about zero 232.
    #[test]
    fn textbook_example() {
        let values = [2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0];
        assert_eq!(mean_sd(&values), (5.0, (32.0_f64 / 7.0).sqrt()));
        assert_eq!(rms(&values), 29.0_f64.sqrt());
        assert!(mean(&[]).is_nan() && rms(&[]).is_nan() && mean_sd(&[1.0]).1.is_nan());
    }

    /// GUM H.1.6: end gauge, effective degrees of freedom 16 from 25/18, 9.7/25.6, 2.9/50 and 16.6/2 nm with 34 in all.
    #[test]
    fn effective_degrees_of_freedom_of_the_gum() {
        let dof = welch_satterthwaite(&[(25.0, 18.0), (9.7, 25.6), (2.9, 50.0), (16.6, 2.0)]);
        assert!((dof - 16.7).abs() < 0.1, "{dof}");
    }
}
