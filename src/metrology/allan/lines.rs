//! Lines in a record, such as vibration: found in the spectrum, fitted as sinusoids and taken off.

use nalgebra::{Matrix4, Vector4};

use crate::psd::RobustSpectrum;
use crate::stats;

/// A sinusoid in a record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sinusoid {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Amplitude, unit of the record.
    pub amplitude: f64,
}

/// Lines taken off at most.
const MOST: usize = 8;
/// Rounds of the fit of one line. Its frequency settles quadratically.
const ROUNDS: usize = 6;

/// Takes the lines off the record, the strongest first, and returns them.
pub(super) fn take_off(values: &mut [f64], rate_hz: f64) -> Vec<Sinusoid> {
    let mut lines = Vec::new();
    while lines.len() < MOST
        && let Some(spectrum) = RobustSpectrum::of(values, rate_hz)
        && let Some(bin) = spectrum.line()
        && let step = spectrum.step_hz / rate_hz
        && let Some((frequency, amplitude)) = take_one(values, bin as f64 * step, 1.5 * step)
    {
        lines.push(Sinusoid { frequency_hz: frequency * rate_hz, amplitude });
    }
    lines
}

/// Fits a sinusoid with a frequency near `near` (cycles a sample), and takes it off.
fn take_one(values: &mut [f64], near: f64, width: f64) -> Option<(f64, f64)> {
    let mut frequency = peak(values, near, width)?;
    let (n, mean) = (values.len() as f64, stats::mean(values));
    let mut solution = Vector4::zeros();
    for round in 0..ROUNDS {
        // `a cos + b sin + u (c cos + d sin)` with u from -1 to 1 over the record: c and d show how far the frequency
        // is off.
        let (mut normal, mut data) = (Matrix4::zeros(), Vector4::zeros());
        each(values.len(), frequency, |i, u, cos, sin| {
            let row = Vector4::new(cos, sin, u * cos, u * sin);
            normal += row * row.transpose();
            data += row * (values[i] - mean);
        });
        solution = normal.cholesky()?.solve(&data);
        let (a, b, c, d) = (solution[0], solution[1], solution[2], solution[3]);
        let off = (b * c - a * d) / (a * a + b * b);
        if round + 1 < ROUNDS {
            frequency += off * 2.0 / n / std::f64::consts::TAU;
        }
        if !(frequency > 0.0 && frequency < 0.5) {
            return None;
        }
    }
    let mut taken = vec![0.0; values.len()];
    each(values.len(), frequency, |i, _, cos, sin| taken[i] = solution[0] * cos + solution[1] * sin);
    values.iter_mut().zip(taken).for_each(|(v, t)| *v -= t);
    Some((frequency, solution[0].hypot(solution[1])))
}

/// The place of every sample from -1 to 1, and the sinusoid there with phase zero in the middle.
fn each(n: usize, frequency: f64, mut work: impl FnMut(usize, f64, f64, f64)) {
    let middle = (n as f64 - 1.0) / 2.0;
    for i in 0..n {
        let t = i as f64 - middle;
        let (sin, cos) = (std::f64::consts::TAU * (frequency * t).fract()).sin_cos();
        work(i, t / middle, cos, sin);
    }
}

/// Frequency of the largest ordinate of the whole record's periodogram near `near`, in cycles a sample.
fn peak(values: &[f64], near: f64, width: f64) -> Option<f64> {
    let n = values.len();
    let mean = stats::mean(values);
    let transform = gnc_fourier::forward(n);
    let mut input: Vec<f64> = values
        .iter()
        .enumerate()
        .map(|(i, v)| (v - mean) * (std::f64::consts::PI * (i as f64 + 0.5) / n as f64).sin().powi(2))
        .collect();
    let mut output = transform.make_output_vec();
    transform.process(&mut input, &mut output).ok()?;
    let bin = |f: f64| ((f * n as f64).round().max(1.0) as usize).min(output.len() - 1);
    let best = (bin(near - width)..=bin(near + width))
        .max_by(|a, b| output[*a].norm_sqr().total_cmp(&output[*b].norm_sqr()))?;
    Some(best as f64 / n as f64)
}
