//! Degrees of freedom of a deviation, from the noises of the fit.

use super::fit::Solved;
use super::lines::Sinusoid;
use super::scatter::{self, BASIS, Parts, window};
use super::{DeviationKind, PowerLawNoise, edf};
use crate::psd::RobustSpectrum;
use crate::stats;

/// What is known of a record whose fit holds.
pub(super) struct Known<'a> {
    pub(super) fit: &'a Solved,
    /// First averaging time of the fit, s.
    pub(super) used_from_s: f64,
    pub(super) lines: &'a [Sinusoid],
    /// Spectrum without the lines, where a band limit or a line was seen.
    pub(super) spectrum: Option<&'a RobustSpectrum>,
    pub(super) rate_hz: f64,
    pub(super) kind: DeviationKind,
    pub(super) phases: usize,
}

impl Known<'_> {
    /// Noise that dominates at an averaging factor, and the degrees of freedom there.
    pub(super) fn at(&self, m: usize) -> (PowerLawNoise, f64) {
        let tau_s = m as f64 / self.rate_hz;
        let mut parts = if tau_s < self.used_from_s { [0.0; BASIS.len()] } else { self.fit.parts(tau_s) };
        let total: f64 = parts.iter().sum();
        if total.is_nan() || total <= 0.0 {
            parts = [0.0, 1.0, 0.0, 0.0];
        }
        let of = |noise| edf::edf(self.kind, noise, m, self.phases);
        let noise = dominant(&parts);
        let total: f64 = parts.iter().sum();
        // Relative standard deviations add up: the noises have nearly the same correlation between the differences.
        let sd: f64 = BASIS
            .iter()
            .zip(parts)
            .filter(|(_, part)| *part > 0.0)
            .map(|(noise, part)| part / total * (2.0 / of(*noise)).sqrt())
            .sum();
        let mut variance = sd * sd;
        if parts[0] <= 0.0 && self.kind == DeviationKind::Oadev {
            variance = variance.max(2.0 / of(PowerLawNoise::WhiteRate));
        }
        if self.kind == DeviationKind::Oadev
            && let Some(spectrum) = self.spectrum
        {
            // Within the sensor's memory no power law holds; there the spectrum itself says how the deviation scatters.
            let measured = scatter::measured(spectrum, self.rate_hz, self.phases - 1, m);
            if self.fit.memory()
                && let Some((_, measured)) = measured
            {
                variance = measured;
            }
            if !self.lines.is_empty() {
                let square = measured.map_or_else(|| self.fit.model(tau_s), |(square, _)| square);
                variance = self.with_lines(spectrum, m, square, variance);
            }
        }
        (noise, 2.0 / variance)
    }

    /// Relative variance of a squared deviation of noise and lines. The lines themselves do not scatter; the noise
    /// beside each line does, by `(2 / n) S(f) (A^2 / 2) H^2`.
    fn with_lines(&self, spectrum: &RobustSpectrum, m: usize, square: f64, variance: f64) -> f64 {
        let (mut total, mut scatter) = (square, variance * square * square);
        for line in self.lines {
            let h = window(m, line.frequency_hz / self.rate_hz);
            let power = line.amplitude * line.amplitude / 2.0;
            let bin = (line.frequency_hz / spectrum.step_hz).round() as usize;
            // One ordinate scatters by half of itself, and an interval that rests on one ordinate does so too.
            let end = spectrum.density.len().min(bin + BESIDE_LINE + 1);
            let near = spectrum.density.get(bin.saturating_sub(BESIDE_LINE).max(1)..end).unwrap_or(&[]);
            let density = if near.is_empty() { 0.0 } else { stats::mean(near) * self.rate_hz };
            total += power * h;
            scatter += 2.0 * density * power * h * h / (self.phases - 1) as f64;
        }
        scatter / (total * total)
    }
}

/// Ordinates on each side of a line that show the noise there.
const BESIDE_LINE: usize = 8;

fn dominant(parts: &Parts) -> PowerLawNoise {
    let largest = parts.iter().zip(BASIS).max_by(|a, b| a.0.total_cmp(b.0));
    largest.map_or(PowerLawNoise::WhiteRate, |(_, noise)| noise)
}
