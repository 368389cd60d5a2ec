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

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    fn white(n: usize, seed: u64) -> Vec<f64> {
        let mut dice = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        (0..n).map(|_| StandardNormal.sample(&mut dice)).collect()
    }

    /// A sine of amplitude A on a frequency of the transform reads `A^2 / 2` over the equivalent noise bandwidth of the
    /// window, 1.5 bins, there, a quarter of it on both sides and nothing elsewhere; its power is `A^2 / 2`.
    #[test]
    fn a_sine_on_a_bin() {
        let (amplitude, rate_hz, segment, bin) = (3.0, 200.0, 256, 19);
        let values: Vec<f64> = (0..segment * 8)
            .map(|i| 1e6 + amplitude * (std::f64::consts::TAU * (bin * i) as f64 / segment as f64 + 0.4).sin())
            .collect();
        let psd = welch(&values, rate_hz, segment).unwrap();
        let step_hz = rate_hz / segment as f64;
        assert_eq!((psd.segments, psd.frequency_hz.len()), (15, segment / 2 + 1));
        assert_eq!((psd.frequency_hz[bin], psd.frequency_hz[segment / 2]), (bin as f64 * step_hz, rate_hz / 2.0));
        let peak = amplitude * amplitude / 2.0 / (1.5 * step_hz);
        for (k, density) in psd.density.iter().enumerate() {
            let expected = [peak, peak / 4.0].get(k.abs_diff(bin)).copied().unwrap_or(0.0);
            assert!((density - expected).abs() < 1e-7 * peak, "bin {k}: {density} {expected}");
        }
        let power = psd.density.iter().sum::<f64>() * step_hz;
        assert!((power / (amplitude * amplitude / 2.0) - 1.0).abs() < 1e-7, "{power}");
    }

    /// White noise of Allan coefficient N reads 2 N^2: samples of deviation s at a rate have `N = s / sqrt(rate)`.
    #[test]
    fn white_noise() {
        let (rate_hz, sd) = (100.0, 0.7);
        let values: Vec<f64> = white(400_000, 5).iter().map(|v| sd * v - 40.0).collect();
        let psd = welch(&values, rate_hz, 512).unwrap();
        let level = 2.0 * sd * sd / rate_hz;
        // Without the first bins, which the removed mean bends, and the last, which has no mirror image. Each is a mean
        // over 1561 segments that overlap: 2.7 % of scatter; of all of them 0.22 % (as the variance of the samples).
        let inner = &psd.density[2..256];
        let mean = stats::mean(inner);
        assert!((mean / level - 1.0).abs() < 4.0 * 0.0022, "{mean} {level}");
        assert!(inner.iter().all(|d| (d / level - 1.0).abs() < 5.0 * 0.027));
        assert!((psd.density[256] / level - 0.5).abs() < 0.1, "half the rate has one side");
    }

    /// Parseval for one segment: the integral of the density is the power of the windowed samples over the window's.
    #[test]
    fn power_is_kept() {
        for segment in [8, 9, 500, 1021] {
            let values = white(segment, 9);
            let psd = welch(&values, 50.0, segment).unwrap();
            let integral = psd.density.iter().sum::<f64>() * 50.0 / segment as f64;
            let mean = values.iter().sum::<f64>() / segment as f64;
            let (mut power, mut window_power) = (0.0, 0.0);
            for (i, v) in values.iter().enumerate() {
                let w = (std::f64::consts::PI * i as f64 / segment as f64).sin().powi(2);
                power += (w * (v - mean)).powi(2);
                window_power += w * w;
            }
            assert!((integral / (power / window_power) - 1.0).abs() < 1e-12, "{segment}: {integral}");
        }
    }

    #[test]
    fn refusals() {
        let check = |values: &[f64], rate_hz, segment, expected: &str| {
            assert_eq!(welch(values, rate_hz, segment).unwrap_err().to_string(), expected);
        };
        check(&[1.0, f64::NAN, 2.0], 1.0, 8, "record: sample 1 is NaN");
        check(&white(7, 1), 1.0, 8, "one segment: 7 samples, needs at least 8");
        check(&white(9, 1), 1.0, 7, "segment is 7, expected at least 8 samples");
        check(&white(9, 1), 0.0, 8, "rate (Hz) is 0, expected a finite number above 0");
        check(&[2.0; 9], 1.0, 8, "record: all 9 samples are 2");
    }
}
