//! Whether a record resolves the sensor's noise.
//!
//! Rounding to codes a step q apart adds `q^2 / 12` to the variance of noise as long as its standard deviation is not
//! far below q (Widrow and Kollár, *Quantization Noise*, chapter 4). Smaller noise hides within a code or toggles
//! between two codes. Then the record shows where the mean lies in a code, not how large the noise is.

use crate::{quantisation::least_step, stats};

/// Codes of a record that stand too far apart for its noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Unresolved {
    /// Least step between codes, unit of the record.
    pub(super) step: f64,
    /// Standard deviation of the samples about the mean of their neighbourhood.
    pub(super) sd: f64,
}

/// Noise is below the resolution if a step is at least this many standard deviations wide. A record that toggles
/// between two codes has a standard deviation of half a step at most; noise of 0.5 steps shows 0.58 with the rounding.
const WIDEST_STEP: f64 = 1.95;
/// Samples of a neighbourhood.
const NEIGHBOURS: usize = 256;
/// Differences below this part of the values are rounding errors.
const ARITHMETIC: f64 = 1e-12;

/// The step and the noise of a record of rates, where the step is too wide for the noise. Most neighbourhoods decide,
/// so that neither a spike nor a slow wander counts as noise.
pub(super) fn unresolved(rates: &[f64]) -> Option<Unresolved> {
    let (low, high) = stats::range(rates);
    let floor = ARITHMETIC * low.abs().max(high.abs());
    let step = least_step(rates, floor)?;
    let variance = |part: &[f64]| {
        let mean = stats::mean(part);
        stats::sum(part, |v| (v - mean) * (v - mean)) / part.len() as f64
    };
    let parts = rates.chunks_exact(NEIGHBOURS.min(rates.len()));
    let sd = stats::median(&mut parts.map(variance).collect::<Vec<_>>()).sqrt();
    (step > WIDEST_STEP * sd).then_some(Unresolved { step, sd })
}
