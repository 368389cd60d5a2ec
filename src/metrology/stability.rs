//! Stability of a record and repeatability of repeated figures.

use crate::{Refusal, series, stats};

/// Spread of the means of disjoint blocks.
#[derive(Debug, Clone, PartialEq)]
pub struct Stability {
    /// Mean of each block.
    pub block_means: Vec<f64>,
    /// Mean of the block means.
    pub mean: f64,
    /// Sample standard deviation (n - 1) of the block means: the stability.
    pub sd: f64,
    /// 95 % interval of `sd` (chi-square; it takes the block means as independent).
    pub sd_low: f64,
    /// Upper end of the same.
    pub sd_high: f64,
    /// Samples of one block.
    pub block_samples: usize,
    /// Samples at the end that fill no block and are dropped.
    pub tail_samples: usize,
}

/// Bias stability: means of disjoint blocks of `block_s`, tail dropped, no detrending, sample standard deviation. It is
/// neither a moving average nor an Allan deviation.
///
/// # Errors
/// [`Refusal::NotFinite`], [`Refusal::Parameter`], [`Refusal::TooFew`] below two blocks.
pub fn stability(values: &[f64], rate_hz: f64, block_s: f64) -> Result<Stability, Refusal> {
    series::finite("record", values)?;
    let samples = series::positive("rate (Hz)", rate_hz)? * series::positive("block (s)", block_s)?;
    let block_samples = samples.round() as usize;
    if block_samples == 0 {
        return Err(Refusal::Parameter { name: "block (s)", value: block_s, expected: "at least one sample" });
    }
    if (samples - block_samples as f64).abs() > 1e-6 * samples {
        return Err(Refusal::Parameter { name: "block (s)", value: block_s, expected: "a whole number of samples" });
    }
    if values.len() < 2 * block_samples {
        return Err(Refusal::TooFew { what: "two blocks".to_owned(), got: values.len(), needed: 2 * block_samples });
    }
    let block_means: Vec<f64> = values.chunks_exact(block_samples).map(stats::mean).collect();
    let (mean, sd) = stats::mean_sd(&block_means);
    let (sd_low, sd_high) = stats::sd_interval(sd, (block_means.len() - 1) as f64, 0.95);
    Ok(Stability { mean, sd, sd_low, sd_high, block_samples, tail_samples: values.len() % block_samples, block_means })
}

/// Spread of one figure over repeated runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Repeatability {
    /// Runs.
    pub runs: usize,
    /// Mean of the figures.
    pub mean: f64,
    /// Sample standard deviation (n - 1; n would be 9.5 % less over six runs).
    pub sd: f64,
    /// 95 % interval of `sd`: 0.62 to 2.45 times the figure for six runs.
    pub sd_low: f64,
    /// Upper end of the same.
    pub sd_high: f64,
}

/// Repeatability of a figure over runs with the power cycled between them.
///
/// # Errors
/// [`Refusal::NotFinite`], [`Refusal::TooFew`] below two runs.
pub fn repeatability(figures: &[f64]) -> Result<Repeatability, Refusal> {
    series::finite("runs", figures)?;
    if figures.len() < 2 {
        return Err(Refusal::TooFew { what: "runs".to_owned(), got: figures.len(), needed: 2 });
    }
    let (mean, sd) = stats::mean_sd(figures);
    let (sd_low, sd_high) = stats::sd_interval(sd, (figures.len() - 1) as f64, 0.95);
    Ok(Repeatability { runs: figures.len(), mean, sd, sd_low, sd_high })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_disjoint_and_the_tail_is_dropped() {
        let values = [1.0, 3.0, 2.0, 4.0, 6.0, 8.0, 100.0];
        let s = stability(&values, 10.0, 0.2).unwrap();
        assert_eq!((s.block_means.as_slice(), s.tail_samples), ([2.0, 3.0, 7.0].as_slice(), 1));
        assert_eq!((s.mean, s.sd), (4.0, 7.0_f64.sqrt()));
    }

    #[test]
    fn refusals() {
        let check = |values: &[f64], block_s, expected: &str| {
            assert_eq!(stability(values, 10.0, block_s).unwrap_err().to_string(), expected);
        };
        check(&[1.0, 2.0, 3.0], 0.2, "two blocks: 3 samples, needs at least 4");
        check(&[1.0, f64::NAN], 0.1, "record: sample 1 is NaN");
        check(&[1.0; 99], 0.25, "block (s) is 0.25, expected a whole number of samples");
        check(&[1.0; 99], -1.0, "block (s) is -1, expected a finite number above 0");
    }

    #[test]
    fn six_runs() {
        let r = repeatability(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).unwrap();
        assert!((r.sd - 3.5_f64.sqrt()).abs() < 1e-15 && (r.sd_high / r.sd - 2.4526).abs() < 1e-4);
        assert!(repeatability(&[1.0]).is_err());
    }
}
