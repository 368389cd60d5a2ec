//! The error that the steps of an output leave in a mean.
//!
//! A mean of rounded values is off by
//! `b(x) = q sum over k of (-1)^k / (pi k) sin(2 pi k x / q) exp(-2 pi^2 k^2 s^2 / q^2)`, where q is the step, x the
//! level and s the deviation of normal noise (Widrow and Kollár, *Quantization Noise*, chapters 4 and 9). More rows do
//! not average this error. At s = 0 its root mean square over all levels is `q / sqrt(12)`; at half a step it is 0.0016
//! q, at one step 6e-10 q. The noise follows from the variance of the values about their own mean, which is
//! `s^2 + q^2 / 12 - rms(b)^2` on average over all levels.

use std::f64::consts::PI;

use statrs::function::erf::erf;

use crate::stats;

/// Rows of a piece, within which the level counts as one level. A jump between two pieces adds to neither of them.
const PIECE: usize = 64;
/// Noise, in steps, from which on a mean is off by less than 2e-4 steps.
const FINE: f64 = 0.6;
/// Variance, in steps squared, that noise far below a step does not reach at any level; such noise gives 0.25 at most.
const QUIET: f64 = 0.3;
/// Differences below this part of the values are rounding errors.
const ARITHMETIC: f64 = 1e-12;

/// Standard uncertainty of the means of stretches from the steps of the output, in its unit. Each stretch lies at one
/// level. The error is one for each level and is as large for every part of the stretch; the error of the quiet
/// stretches counts for all stretches. 0 where the noise is well above a step, and where the values do not show the
/// step.
#[must_use]
pub fn mean_error_sd(stretches: &[&[f64]]) -> f64 {
    coarse(stretches).map_or(0.0, |(step, error)| step * error)
}

/// The step between the codes of an output whose noise is not well above the step.
pub(crate) fn coarse_step(stretches: &[&[f64]]) -> Option<f64> {
    coarse(stretches).map(|(step, _)| step)
}

/// Step, and standard uncertainty of a mean in steps, where this uncertainty is above 0.
fn coarse(stretches: &[&[f64]]) -> Option<(f64, f64)> {
    let step = step(stretches)?;
    let of_all: Vec<(&[f64], Spread)> = stretches
        .iter()
        .map(|values| (*values, Spread::of(values, |piece| stats::mean_sd(piece).1, step)))
        .filter(|(_, spread)| spread.rows > 0.0)
        .collect();
    let is_quiet = |spread: &Spread| spread.variance < QUIET;
    let any_quiet = of_all.iter().any(|(_, spread)| is_quiet(spread));
    let counts = || of_all.iter().filter(|(_, spread)| !any_quiet || is_quiet(spread));
    let (sum, rows) =
        counts().fold((0.0, 0.0), |(sum, rows), (_, spread)| (sum + spread.variance * spread.rows, rows + spread.rows));
    let levels: Vec<&[f64]> = counts().map(|(values, _)| *values).collect();
    let error = error(noise(sum / rows, spread(&levels, step)));
    (error > 0.0).then_some((step, error))
}

/// Whether a sensor with the noise of these stretches cannot give one value for `rows` rows, at any level. The
/// stretches that change most decide.
#[must_use]
pub fn is_stuck(stretches: &[&[f64]], rows: usize) -> bool {
    // A chance of once in a million records.
    const RARE: f64 = 1e-6;
    // Variance that a level half-way between two codes shows without noise, and its scatter in half a hundred rows.
    const SEEN: f64 = 0.4;
    let Some(step) = step(stretches) else { return false };
    // Neighbours of slow noise have nearly the same error, and only their difference changes a value.
    let spreads = stretches.iter().map(|values| Spread::of(values, stats::white_sd, step));
    let mut variances: Vec<f64> = spreads.map(|spread| spread.variance).filter(|variance| *variance > 0.0).collect();
    variances.sort_by(f64::total_cmp);
    let usual = variances.get(variances.len().saturating_sub(1) / 2);
    usual.is_some_and(|variance| *variance > SEEN && within(0.5, noise(*variance, 0.0)).powf(rows as f64) < RARE)
}

/// Step between the codes of an output: the least difference of neighbours. Values that stand still do not show it, but
/// whole numbers are counts.
fn step(stretches: &[&[f64]]) -> Option<f64> {
    let (low, high) = stretches
        .iter()
        .map(|values| stats::range(values))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), range| (low.min(range.0), high.max(range.1)));
    let floor = ARITHMETIC * low.abs().max(high.abs());
    let steps = stretches.iter().filter_map(|values| least_step(values, floor));
    let is_long = || stretches.iter().any(|values| values.len() > 1);
    let are_whole = || stretches.iter().all(|values| values.iter().all(|value| value.fract() == 0.0));
    steps.reduce(f64::min).or_else(|| (is_long() && are_whole()).then_some(1.0))
}

/// Variance of a stretch in its pieces, in steps squared, and the number of rows behind it.
struct Spread {
    variance: f64,
    rows: f64,
}

impl Spread {
    fn of(values: &[f64], deviation: impl Fn(&[f64]) -> f64, step: f64) -> Self {
        let pieces = values.chunks(PIECE).filter(|piece| piece.len() > 1);
        let (sum, rows) = pieces.fold((0.0, 0.0), |(sum, rows), piece| {
            (sum + deviation(piece).powi(2) * piece.len() as f64, rows + piece.len() as f64)
        });
        Self { variance: sum / rows / (step * step), rows }
    }
}

/// Part of a step over which the levels of these stretches spread. Levels a whole number of steps apart have the same
/// error.
fn spread(stretches: &[&[f64]], step: f64) -> f64 {
    let levels = stretches.iter().filter(|values| !values.is_empty());
    let mut parts: Vec<f64> = levels.map(|values| (stats::mean(values) / step).rem_euclid(1.0)).collect();
    parts.sort_by(f64::total_cmp);
    // The distances from one level to the next, and from the last level of a round to the first.
    let next = parts.iter().skip(1).copied().chain(parts.first().map(|first| first + 1.0));
    1.0 - parts.iter().zip(next).map(|(part, next)| next - part).fold(0.0, f64::max)
}

/// Root mean square of a mean's error over all levels, in steps, for noise in steps.
fn error(noise: f64) -> f64 {
    if noise >= FINE {
        return 0.0;
    }
    let term = |k: f64| (-4.0 * (PI * k * noise).powi(2)).exp() / (k * k);
    // Without noise the terms add up to pi^2 / 6; with the least noise that differs from none the terms end soon.
    let sum = if noise < 0.01 { PI * PI / 6.0 } else { (1..200).map(|k| term(f64::from(k))).sum() };
    (sum / 2.0).sqrt() / PI
}

/// The noise, in steps, behind a variance in steps squared. A level half-way between two codes shows more variance than
/// the mean over all levels. The smaller the part of a step over which the levels spread, the more of this excess is
/// counted.
fn noise(variance: f64, spread: f64) -> f64 {
    let shown = |noise: f64| {
        let usual = noise * noise + 1.0 / 12.0 - error(noise).powi(2);
        usual + (half_way(noise) - usual).max(0.0) * (1.0 - spread / 2.0)
    };
    if variance >= FINE * FINE + 1.0 / 12.0 {
        return (variance - 1.0 / 12.0).sqrt();
    }
    let (mut low, mut high) = (0.0, FINE);
    for _ in 0..40 {
        let middle = f64::midpoint(low, high);
        if shown(middle) < variance { low = middle } else { high = middle }
    }
    low
}

/// Variance of rounded noise about a level half-way between two codes.
fn half_way(noise: f64) -> f64 {
    (0..8).map(f64::from).map(|k| (k + 0.5).powi(2) * (within(k + 1.0, noise) - within(k, noise))).sum()
}

/// Part of normal noise within `steps` steps of its mean.
fn within(steps: f64, noise: f64) -> f64 {
    match noise > 0.0 {
        true => erf(steps / noise / std::f64::consts::SQRT_2),
        false => f64::from(u8::from(steps > 0.0)),
    }
}

/// The least difference of neighbours that is above a floor.
pub(crate) fn least_step(values: &[f64], floor: f64) -> Option<f64> {
    const LANES: usize = 8;
    let mut least = [f64::INFINITY; LANES];
    let differences = |now: &[f64], before: &[f64], least: &mut [f64; LANES]| {
        for (least, (now, before)) in least.iter_mut().zip(now.iter().zip(before)) {
            let difference = (now - before).abs();
            *least = if (difference > floor) & (difference < *least) { difference } else { *least };
        }
    };
    let (now, before) = (values.get(1..)?, &values[..values.len() - 1]);
    let ((now, last_now), (before, last_before)) = (now.as_chunks::<LANES>(), before.as_chunks::<LANES>());
    for (now, before) in now.iter().zip(before) {
        differences(now, before, &mut least);
    }
    differences(last_now, last_before, &mut least);
    least.into_iter().reduce(f64::min).filter(|least| least.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Means of normal noise rounded at 400 levels, from the normal distribution: sums of codes times their
    /// probability, without the series above.
    #[test]
    fn the_error_is_that_of_rounded_noise() {
        let cell = |x: f64, noise: f64| {
            let below = |edge: f64| 0.5 * (1.0 + erf((edge - x) / noise / 2.0_f64.sqrt()));
            (-9..=9).map(f64::from).fold((0.0, 0.0), |(mean, square), code| {
                let p = below(code + 0.5) - below(code - 0.5);
                (mean + p * code, square + p * code * code)
            })
        };
        for noise_steps in [0.02, 0.1, 0.2, 0.3, 0.4, 0.5] {
            let (mut squares, mut variance, mut largest) = (0.0, 0.0, 0.0_f64);
            for level in 0..400 {
                let x = f64::from(level) / 400.0 - 0.49875;
                let (mean, square) = cell(x, noise_steps);
                squares += (mean - x).powi(2) / 400.0;
                variance += (square - mean * mean) / 400.0;
                largest = largest.max(square - mean * mean);
            }
            let rms = squares.sqrt();
            assert!(
                (error(noise_steps) - rms).abs() < 2e-3 * rms + 1e-6,
                "{noise_steps}: {} {rms}",
                error(noise_steps)
            );
            assert!((noise(variance, 2.0) - noise_steps).abs() < 2e-3, "{noise_steps}");
            assert!(noise(largest, 0.0) < noise_steps + 2e-3, "{noise_steps}");
        }
        assert!((error(0.0) - 1.0 / 12.0_f64.sqrt()).abs() < 1e-12 && error(FINE) == 0.0);
    }

    #[test]
    fn steps_are_seen_and_fine_noise_is_not_touched() {
        let still = [vec![4.0; 90], vec![5.0, 4.0, 4.0, 4.0]].concat();
        assert!((mean_error_sd(&[&still]) - 1.0 / 12.0_f64.sqrt()).abs() < 1e-3, "{}", mean_error_sd(&[&still]));
        let noisy: Vec<f64> = (0..500).map(|k: i32| f64::from(k * 7919 % 7)).collect();
        assert_eq!(mean_error_sd(&[&noisy]), 0.0);
        // Counts that stand still are known to half a count; other numbers that stand still show no step.
        assert!((mean_error_sd(&[&[512.0; 20], &[-512.0; 20]]) - 1.0 / 12.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(mean_error_sd(&[&[9.8; 20], &[-9.8; 20]]), 0.0);
    }

    /// A noisy stretch does not hide the error of a quiet one.
    #[test]
    fn a_noisy_stretch_does_not_hide_a_quiet_one() {
        let noisy: Vec<f64> = (0..600).map(|k: i32| f64::from(k * 7919 % 7)).collect();
        let quiet: Vec<f64> = (0..600).map(|k: i32| 40.0 + f64::from(u8::from(k % 50 == 0))).collect();
        assert!((mean_error_sd(&[&noisy, &quiet]) - 1.0 / 12.0_f64.sqrt()).abs() < 1e-3);
        let still = [9.0; 600];
        assert!(is_stuck(&[&noisy, &noisy, &still], 600) && !is_stuck(&[&noisy, &quiet, &still, &still], 600));
    }

    /// Noise of 0.72 steps keeps its most usual code in half of the rows (erf(0.5 / (0.72 sqrt 2)) = 0.51), so that 40
    /// rows are equal once in 10^12 records and 8 rows in two hundred. Noise that shows at one level of three counts as
    /// no noise.
    #[test]
    fn one_value_is_stuck_where_the_noise_would_change_it() {
        let noise = |k: usize| [0.0, 0.0, 1.0, 0.0, -1.0, -1.0, 0.0, 1.0, 0.0, -1.0][k * 7 % 10];
        let noisy: Vec<f64> = (0..640).map(noise).collect();
        assert!(is_stuck(&[&noisy], 40) && !is_stuck(&[&noisy], 8));
        let toggles: Vec<f64> = (0..640).map(|k| f64::from(k * 7919 % 101 % 2)).collect();
        assert!(!is_stuck(&[&toggles, &[7.0; 640], &[99.0; 640]], 640));
        assert!(!is_stuck(&[&[7.0; 640], &[99.0; 640]], 640));
    }
}
