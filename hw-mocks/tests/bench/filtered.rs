//! White noise behind a low-pass, by its closed form in frequency and plain sums: the reference for the simulation.

use std::f64::consts::PI;

/// A Butterworth low-pass: the square of its gain at a frequency.
pub(crate) fn power(frequency_hz: f64, cutoff_hz: f64, order: i32) -> f64 {
    1.0 / (1.0 + (frequency_hz / cutoff_hz).powi(2 * order))
}

/// The square of the gain of a mean over a span.
pub(crate) fn power_of_mean(frequency_hz: f64, span_s: f64) -> f64 {
    let x = PI * frequency_hz * span_s;
    if x == 0.0 { 1.0 } else { (x.sin() / x).powi(2) }
}

/// The integral over all frequencies, by the midpoint rule up to far beyond the pass band.
fn integral(span_s: f64, cutoff_hz: f64, of: impl Fn(f64) -> f64) -> f64 {
    let highest_hz = 200.0 * cutoff_hz.max(1.0 / span_s);
    let step_hz = 0.002 * cutoff_hz.min(1.0 / span_s);
    let count = (highest_hz / step_hz) as u32;
    (0..count).map(|k| 2.0 * step_hz * of((f64::from(k) + 0.5) * step_hz)).sum()
}

/// Variance of means over a span of filtered white noise. Without the filter, its mean over a second would have the
/// variance 1.
pub(crate) fn variance(span_s: f64, cutoff_hz: f64, order: i32) -> f64 {
    integral(span_s, cutoff_hz, |f| power(f, cutoff_hz, order) * power_of_mean(f, span_s))
}

/// Half the mean square of the difference of neighbouring means.
pub(crate) fn allan_variance(span_s: f64, cutoff_hz: f64, order: i32) -> f64 {
    integral(span_s, cutoff_hz, |f| {
        power(f, cutoff_hz, order) * power_of_mean(f, span_s) * 2.0 * (PI * f * span_s).sin().powi(2)
    })
}

/// Two-sided density of consecutive means, over that of the white noise before the filter, at a frequency below half
/// the rate.
pub(crate) fn density(frequency_hz: f64, span_s: f64, cutoff_hz: f64, order: i32) -> f64 {
    let folded = |k: i32| {
        let f = frequency_hz + f64::from(k) / span_s;
        power(f, cutoff_hz, order) * power_of_mean(f, span_s)
    };
    (-200..=200).map(folded).sum()
}
