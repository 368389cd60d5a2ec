//! Power spectral density after Welch.

use realfft::RealFftPlanner;

use crate::{Refusal, series, stats};

/// One-sided power spectral density.
#[derive(Debug, Clone, PartialEq)]
pub struct Psd {
    /// Frequencies from 0 to half the rate, Hz.
    pub frequency_hz: Vec<f64>,
    /// Density, unit squared per Hz; white noise of Allan coefficient N reads `2 N^2`.
    pub density: Vec<f64>,
    /// Segments that were averaged.
    pub segments: usize,
}

/// Welch's averaged periodogram (IEEE Trans. Audio Electroacoust. 15, 1967): periodic Hann window, 50 % overlap, the
/// mean of each segment removed, one-sided density. Samples after the last whole segment are not used.
///
/// # Errors
/// [`Refusal::NotFinite`], [`Refusal::Parameter`] for a segment below 8 samples, [`Refusal::TooFew`] when the record is
/// shorter than one segment, [`Refusal::Constant`].
pub fn welch(values: &[f64], rate_hz: f64, segment: usize) -> Result<Psd, Refusal> {
    series::finite("record", values)?;
    series::positive("rate (Hz)", rate_hz)?;
    if segment < 8 {
        return Err(Refusal::Parameter { name: "segment", value: segment as f64, expected: "at least 8 samples" });
    }
    if values.len() < segment {
        return Err(Refusal::TooFew { what: "one segment".to_owned(), got: values.len(), needed: segment });
    }
    if values.iter().all(|v| *v == values[0]) {
        return Err(Refusal::Constant { channel: "record".to_owned(), samples: values.len(), value: values[0] });
    }
    let window: Vec<f64> =
        (0..segment).map(|i| 0.5 - 0.5 * (std::f64::consts::TAU * i as f64 / segment as f64).cos()).collect();
    let power: f64 = window.iter().map(|w| w * w).sum();
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(segment);
    let (mut input, mut output) = (transform.make_input_vec(), transform.make_output_vec());
    let mut scratch = transform.make_scratch_vec();
    let mut density = vec![0.0; output.len()];
    let hop = segment - segment / 2;
    let mut segments = 0_u32;
    for start in (0..=values.len() - segment).step_by(hop) {
        let part = &values[start..start + segment];
        let mean = stats::mean(part);
        for ((x, v), w) in input.iter_mut().zip(part).zip(&window) {
            *x = (v - mean) * w;
        }
        if transform.process_with_scratch(&mut input, &mut output, &mut scratch).is_err() {
            // The buffers come from the plan itself, so their lengths fit.
            unreachable!("buffers of the plan do not fit the plan");
        }
        for (d, c) in density.iter_mut().zip(&output) {
            *d += c.norm_sqr();
        }
        segments += 1;
    }
    let last = density.len() - 1;
    for (k, d) in density.iter_mut().enumerate() {
        // The mean and, of an even segment, half the rate have no mirror image.
        let sides = if k == 0 || (k == last && segment.is_multiple_of(2)) { 1.0 } else { 2.0 };
        *d *= sides / (rate_hz * power * f64::from(segments));
    }
    let frequency_hz = (0..=last).map(|k| k as f64 * rate_hz / segment as f64).collect();
    Ok(Psd { frequency_hz, density, segments: segments as usize })
}
