//! The scatter of the squared deviations of one record, and the covariance of those of different averaging times.
//!
//! A squared overlapping Allan deviation is the periodogram of the record under the window
//! `H_m(f) = 2 sin^4(pi f m) / (m sin(pi f))^2` (f in cycles a sample), and the ordinates of a periodogram are
//! independent, so that for a record of n samples `cov(a, b) = (1 / n) int S^2 H_a H_b df` (Percival and Walden,
//! *Spectral Analysis for Physical Applications*, chapter 8; for white noise at m = 1 this is the known
//! `3 sigma^4 / n`). The integral leaves out the ends of the record. They enter by the degrees of freedom of Greenhall
//! and Riley, which give the variances of pure noises.

use nalgebra::DMatrix;

use super::{DeviationKind, PowerLawNoise, edf};
use crate::psd::RobustSpectrum;

/// The noises that make up a curve, bluest first.
pub(super) const BASIS: [PowerLawNoise; 4] =
    [PowerLawNoise::WhitePhase, PowerLawNoise::WhiteRate, PowerLawNoise::FlickerRate, PowerLawNoise::RateRandomWalk];
/// The part of each noise in a squared deviation.
pub(super) type Parts = [f64; BASIS.len()];

/// Pairs of the noises.
const PAIRS: usize = BASIS.len() * (BASIS.len() + 1) / 2;
/// Frequencies of an octave at which the integrals are taken. Their error is below 1 %.
const FREQUENCIES: f64 = 24.0;

/// Window of a squared Allan deviation at m samples and a frequency in cycles a sample.
pub(super) fn window(m: usize, frequency: f64) -> f64 {
    let x = std::f64::consts::PI * frequency;
    2.0 * (x * m as f64).sin().powi(4) / (m as f64 * x.sin()).powi(2)
}

/// Squared deviation and its relative variance from a measured spectrum: `(1 / n) int S^2 H^2 / (int S H)^2`. `None`
/// where the frequencies of the spectrum are too far apart to show the window of an averaging factor.
pub(super) fn measured(spectrum: &RobustSpectrum, rate_hz: f64, samples: usize, m: usize) -> Option<(f64, f64)> {
    let segment = 2 * (spectrum.density.len() - 1);
    if m * OF_SEGMENT > segment {
        return None;
    }
    let step = 1.0 / segment as f64;
    let (mut level, mut squares) = (0.0, 0.0);
    for (k, density) in spectrum.density.iter().enumerate().skip(1) {
        let sh = density * rate_hz * window(m, k as f64 * step);
        level += sh * step;
        squares += sh * sh * step;
    }
    // The square of a density that scatters is too large by the variance of the density.
    squares /= 1.0 + spectrum.relative_sd.powi(2);
    Some((level, squares / samples as f64 / (level * level)))
}

/// An averaging factor is at most this part of a segment.
const OF_SEGMENT: usize = 32;

/// Relative covariances of the squared deviations at some averaging factors, for each pair of noises.
pub(super) struct Scatter {
    points: usize,
    /// For each pair of noises (k, l) and points (a, b).
    common: Vec<f64>,
}

impl Scatter {
    pub(super) fn new(factors: &[usize], phases: usize) -> Self {
        let n = factors.len();
        let mut common = vec![0.0; PAIRS * n * n];
        let mut level = vec![[0.0; BASIS.len()]; n];
        let samples = (phases - 1) as f64;
        let step = 2.0_f64.powf(1.0 / FREQUENCIES);
        let count = ((2.0 * samples).log2() * FREQUENCIES).ceil() as usize;
        for i in 0..count {
            let frequency = 0.5 * step.powf(-(i as f64 + 0.5));
            let width = frequency * step.ln();
            // Power-law densities of the rate, as sums and differences of white noise give them.
            let w2 = 4.0 * (std::f64::consts::PI * frequency).sin().powi(2);
            let density = [w2, 1.0, 1.0 / w2.sqrt(), 1.0 / w2];
            let windows: Vec<f64> = factors.iter().map(|m| window(*m, frequency)).collect();
            for (level, h) in level.iter_mut().zip(&windows) {
                level.iter_mut().zip(density).for_each(|(level, s)| *level += s * h * width);
            }
            for (pair, (k, l)) in pairs().enumerate() {
                let s = density[k] * density[l] * width / samples;
                let table = &mut common[pair * n * n..(pair + 1) * n * n];
                for a in 0..n {
                    for b in a..n {
                        table[a * n + b] += s * windows[a] * windows[b];
                    }
                }
            }
        }
        for (pair, (k, l)) in pairs().enumerate() {
            let table = &mut common[pair * n * n..(pair + 1) * n * n];
            for a in 0..n {
                for b in a..n {
                    table[a * n + b] /= (level[a][k] * level[a][l] * level[b][k] * level[b][l]).sqrt();
                }
            }
        }
        // What the ends of the record add to the variance of a point, to the power of 1/4: a covariance takes it once
        // for each of the two noises and each of the two points.
        let ends: Vec<[f64; BASIS.len()]> = factors
            .iter()
            .enumerate()
            .map(|(a, m)| {
                let mut ends = [1.0; BASIS.len()];
                for (pair, (k, l)) in pairs().enumerate().filter(|(_, (k, l))| k == l) {
                    let variance = 2.0 / edf::edf(DeviationKind::Oadev, BASIS[l], *m, phases);
                    ends[k] = (variance / common[pair * n * n + a * n + a]).powf(0.25);
                }
                ends
            })
            .collect();
        for (pair, (k, l)) in pairs().enumerate() {
            let table = &mut common[pair * n * n..(pair + 1) * n * n];
            for a in 0..n {
                for b in a..n {
                    table[a * n + b] *= ends[a][k] * ends[a][l] * ends[b][k] * ends[b][l];
                    table[b * n + a] = table[a * n + b];
                }
            }
        }
        Self { points: n, common }
    }

    /// Covariance of the squared deviations from point `start` on. Each squared deviation is the sum of its parts.
    pub(super) fn covariance(&self, start: usize, parts: &[Parts]) -> DMatrix<f64> {
        let n = self.points;
        let roots: Vec<Parts> = parts.iter().map(|p| p.map(|v| v.max(0.0).sqrt())).collect();
        DMatrix::from_fn(n - start, n - start, |a, b| {
            let (a, b) = (a + start, b + start);
            pairs()
                .enumerate()
                .map(|(pair, (k, l))| {
                    let both = if k == l { 1.0 } else { 2.0 };
                    both * roots[a][k] * roots[a][l] * roots[b][k] * roots[b][l] * self.common[(pair * n + a) * n + b]
                })
                .sum()
        })
    }
}

fn pairs() -> impl Iterator<Item = (usize, usize)> {
    (0..BASIS.len()).flat_map(|k| (k..BASIS.len()).map(move |l| (k, l)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// White noise: the squared deviations at 1 and 2 samples are sums over products of differences with the weights
    /// (-1, 1) and (-1, -1, 1, 1) / 2. Their covariances at all lags, squared and added up, are 6, 1.75 and 1.5 for the
    /// pairs (1, 1), (2, 2), (1, 2). The variances and the covariance of the squares are half of these over n.
    #[test]
    fn covariance_of_white_noise_is_that_of_its_differences() {
        let n = 100_000;
        let scatter = Scatter::new(&[1, 2], n + 1);
        let found = scatter.covariance(0, &[[0.0, 1.0, 0.0, 0.0], [0.0, 0.5, 0.0, 0.0]]);
        for (at, expected) in [((0, 0), 6.0), ((1, 1), 1.75), ((0, 1), 1.5)] {
            let expected = expected / (2.0 * n as f64);
            assert!((found[at] / expected - 1.0).abs() < 0.02, "{at:?}: {} {expected}", found[at]);
        }
    }
}
