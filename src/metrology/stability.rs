//! Stability of a record and repeatability of repeated figures.

use crate::{Refusal, quantisation, series, stats};

/// Number of blocks, spread over the record, and rows of each, that show how its noise compares with its steps.
const LOOKS: usize = 64;
const LOOKS_ROWS: usize = 1024;

/// Spread of the means of disjoint blocks.
#[derive(Debug, Clone, PartialEq)]
pub struct Stability {
    /// Mean of each block.
    pub block_means: Vec<f64>,
    /// Mean of the block means.
    pub mean: f64,
    /// Sample standard deviation (n - 1) of the block means: the stability.
    pub sd: f64,
    /// Lower end of the 95 % interval of `sd` (chi-square, which takes the block means as independent). The interval
    /// includes the error from the steps of the output.
    pub sd_low: f64,
    /// Upper end of the same interval.
    pub sd_high: f64,
    /// Standard uncertainty of a block mean from the steps of the output ([`quantisation::mean_error_sd`]).
    pub resolution_sd: f64,
    /// Samples of one block.
    pub block_samples: usize,
    /// Samples at the end that do not fill a block and are dropped.
    pub tail_samples: usize,
}

/// Bias stability: means of disjoint blocks of `block_s`, tail dropped, no detrending, sample standard deviation. It is
/// neither a moving average nor an Allan deviation.
///
/// # Errors
/// [`Refusal::NotFinite`], [`Refusal::Parameter`], [`Refusal::TooFew`] below two blocks; [`Refusal::Constant`] and
/// [`Refusal::Stuck`] for a sensor that shows one value throughout, or over a whole block of a noisy record.
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
    alive(values, block_samples)?;
    let block_means: Vec<f64> = values.chunks_exact(block_samples).map(stats::mean).collect();
    let (mean, sd) = stats::mean_sd(&block_means);
    let resolution_sd = quantisation::mean_error_sd(&looks(values, block_samples));
    let (sd_low, sd_high) = interval(sd, block_means.len(), resolution_sd);
    Ok(Stability {
        mean,
        sd,
        sd_low,
        sd_high,
        resolution_sd,
        block_samples,
        tail_samples: values.len() % block_samples,
        block_means,
    })
}

/// Beginnings of blocks, spread over the record.
fn looks(values: &[f64], block_samples: usize) -> Vec<&[f64]> {
    let apart = (values.len() / block_samples).div_ceil(LOOKS);
    let blocks = values.chunks_exact(block_samples).step_by(apart);
    blocks.map(|block| &block[..block.len().min(LOOKS_ROWS)]).collect()
}

/// 95 % interval of the deviation of `means` means, where each mean has an error of its own. Two deviations differ by
/// the deviation of the errors at most. That is half a step where the errors take two values, or `sqrt(3)` times their
/// standard uncertainty.
fn interval(sd: f64, means: usize, error_sd: f64) -> (f64, f64) {
    let (low, high) = stats::sd_interval(sd, (means - 1) as f64, 0.95);
    let open = 3.0_f64.sqrt() * error_sd;
    ((low - open).max(0.0), high + open)
}

/// Checks that the record shows more than one value, and that every block does so where the noise is above a step.
fn alive(values: &[f64], block_samples: usize) -> Result<(), Refusal> {
    let Some((first, rest)) = values.split_first() else { return Ok(()) };
    if rest.iter().all(|v| v == first) {
        return Err(Refusal::Constant { channel: "record".to_owned(), samples: values.len(), value: *first });
    }
    // A block that moves shows it in its first rows, so only a block that stands still is read in full.
    let stuck = |block: &[f64]| block.iter().all(|v| *v == block[0]);
    let Some(block) = values.chunks_exact(block_samples).position(stuck) else { return Ok(()) };
    if !quantisation::is_stuck(&looks(values, block_samples), block_samples) {
        return Ok(());
    }
    Err(Refusal::Stuck {
        channel: "record".to_owned(),
        place: format!("block {}, from row {},", block + 1, block * block_samples + 1),
        value: values[block * block_samples],
        samples: block_samples,
    })
}

/// Spread of one figure over repeated runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Repeatability {
    /// Number of runs.
    pub runs: usize,
    /// Mean of the figures.
    pub mean: f64,
    /// Sample standard deviation (n - 1; with n it would be 9.5 % less over six runs).
    pub sd: f64,
    /// 95 % interval of `sd`: 0.62 to 2.45 times the figure for six runs.
    pub sd_low: f64,
    /// Upper end of the same interval.
    pub sd_high: f64,
    /// Standard uncertainty of each figure, from the steps of the output. The scatter does not show it.
    pub resolution_sd: f64,
}

impl Repeatability {
    /// Returns the standard uncertainty of the mean: `sd / sqrt(runs)` with `runs - 1` degrees of freedom, combined
    /// with the error that all figures may share.
    #[must_use]
    pub fn mean_sd(&self) -> f64 {
        (self.sd / (self.runs as f64).sqrt()).hypot(self.resolution_sd)
    }

    /// Returns the half width of the 95 % interval of the mean (Student's t).
    #[must_use]
    pub fn mean_expanded(&self) -> f64 {
        stats::coverage_factor(0.95, (self.runs - 1) as f64) * self.mean_sd()
    }
}

/// Repeatability of a figure over runs with the power cycled between them. `resolution_sd` is the standard uncertainty
/// of each figure from the steps of the output, 0 where the steps are fine.
///
/// # Errors
/// [`Refusal::NotFinite`], [`Refusal::TooFew`] below two runs, [`Refusal::Alike`] where all runs agree to the last digit.
pub fn repeatability(figures: &[f64], resolution_sd: f64) -> Result<Repeatability, Refusal> {
    series::finite("runs", figures)?;
    if figures.len() < 2 {
        return Err(Refusal::TooFew { what: "runs".to_owned(), got: figures.len(), needed: 2 });
    }
    if figures.iter().all(|f| *f == figures[0]) {
        return Err(Refusal::Alike { what: "figures of the runs", count: figures.len(), value: figures[0] });
    }
    let (mean, sd) = stats::mean_sd(figures);
    let (sd_low, sd_high) = interval(sd, figures.len(), resolution_sd);
    Ok(Repeatability { runs: figures.len(), mean, sd, sd_low, sd_high, resolution_sd })
}

/// Finds runs whose figure stands out of the scatter of the others. Returns their places, and by how many standard
/// deviations of the others they stand out (externally studentised, against Student's t with `runs - 2` degrees of
/// freedom). The scatter is at least that of the steps of the output, which give each figure the standard uncertainty
/// `resolution_sd`.
#[must_use]
pub fn suspects(figures: &[f64], resolution_sd: f64) -> Vec<(usize, f64)> {
    let n = figures.len() as f64;
    if n < 4.0 {
        return Vec::new();
    }
    let (mean, sd) = stats::mean_sd(figures);
    let limit = stats::coverage_factor(1.0 - stats::SUSPECT_PROBABILITY / n, n - 2.0);
    let of = |(place, figure): (usize, &f64)| {
        let own = 1.0 - 1.0 / n;
        let residual = figure - mean;
        let exact = (1e-12 * figure.abs().max(mean.abs())).powi(2);
        let least = exact.max(resolution_sd * resolution_sd);
        let studentised = stats::studentised(residual, sd * sd * (n - 1.0), own, n - 2.0, least);
        (studentised.abs() > limit).then_some((place, studentised))
    };
    figures.iter().enumerate().filter_map(of).collect()
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
        check(&[1.0; 99], 0.1, "record: all 99 samples are 1");
        check(&[1.0; 99], 0.25, "block (s) is 0.25, expected a whole number of samples");
        check(&[1.0; 99], -1.0, "block (s) is -1, expected a finite number above 0");
    }

    /// A block of one value is found where the noise of the rest is above a step. It is accepted where that noise is
    /// below a step.
    #[test]
    fn a_stuck_block() {
        let noise = |k: usize| ((k * 7919 % 101) as f64 - 50.0).round();
        let mut noisy: Vec<f64> = (0..1000).map(noise).collect();
        assert!(stability(&noisy, 10.0, 5.0).is_ok());
        noisy[200..260].fill(7.0);
        let refusal = stability(&noisy, 10.0, 5.0).unwrap_err().to_string();
        let expected = "record stands still at 7 for 50 samples of block 5, from row 201, while it is noisy elsewhere";
        assert_eq!(refusal, expected);
        // Steps of one code on a slow drift: most blocks correctly show one value.
        let coarse: Vec<f64> =
            (0..1000).map(|k| (0.003 * f64::from(k) + 0.1 * noise(k as usize) / 50.0).round()).collect();
        assert!(coarse.chunks(50).any(|block| block.iter().all(|v| *v == block[0])));
        assert!(stability(&coarse, 10.0, 5.0).is_ok());
    }

    /// The definition: a figure less the mean of the others, over their deviation and the uncertainty of their mean.
    #[test]
    fn a_run_that_stands_out_is_named() {
        let figures = [10.1, 9.9, 10.2, 9.8, 0.0, 10.0, 10.1, 9.9];
        let others = [10.1, 9.9, 10.2, 9.8, 10.0, 10.1, 9.9];
        let (mean, sd) = stats::mean_sd(&others);
        let [(place, studentised)] = suspects(&figures, 0.0)[..] else { panic!("{:?}", suspects(&figures, 0.0)) };
        assert_eq!(place, 4);
        assert!(
            (studentised / ((0.0 - mean) / (sd * (1.0 + 1.0 / 7.0_f64).sqrt())) - 1.0).abs() < 1e-9,
            "{studentised}"
        );
        assert!(suspects(&others, 0.0).is_empty() && suspects(&figures[2..5], 0.0).is_empty());
    }

    /// With a coarse output one run in eight shows the next code. A run two codes away is not rounding.
    #[test]
    fn a_run_one_code_away_is_no_suspect_of_a_coarse_output() {
        let one_code = [100.0, 100.0, 100.0, 100.0, 101.0, 100.0, 100.0, 100.0];
        assert!(suspects(&one_code, 1.0 / 12.0_f64.sqrt()).is_empty());
        assert_eq!(suspects(&one_code.map(|v| 100.0 + 5.0 * (v - 100.0)), 1.0 / 12.0_f64.sqrt()).len(), 1);
    }

    #[test]
    fn six_runs() {
        let r = repeatability(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 0.0).unwrap();
        assert!((r.sd - 3.5_f64.sqrt()).abs() < 1e-15 && (r.sd_high / r.sd - 2.4526).abs() < 1e-4);
        // t of 5 degrees of freedom is 2.5706: 1.8708 / sqrt(6) times that.
        assert!((r.mean_expanded() - 2.570_582 * (3.5_f64 / 6.0).sqrt()).abs() < 1e-5);
        assert!(repeatability(&[1.0], 0.0).is_err());
        assert_eq!(repeatability(&[2.0; 6], 0.0).unwrap_err().to_string(), "all 6 figures of the runs are 2");
    }
}
