//! The uncertainty of the mean of a record whose neighbours are not independent.
//!
//! The variance of a mean is the sum of the autocovariances (a spectrum at zero frequency), taken here from block means
//! with a flat-topped window of lags (Politis and Romano 1995), and corrected for the part that the removal of the mean
//! takes out. Records of like kind are pooled. By simulation (6000 records of white noise with a Gauss-Markov bias of
//! correlation times up to a twentieth of the record) the interval of six pooled records holds the truth in 94 to 96 %
//! of cases, of one record in 93 to 94 %.

use gnc_metrology::stats;

/// Blocks of a record.
pub(super) const BLOCKS: usize = 48;
/// Number of records from which on more lags are used.
const MANY: usize = 4;

/// Variance of the mean of one of the records.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MeanVariance {
    /// Variance in the square of the record's unit.
    pub(super) variance: f64,
    /// Effective degrees of freedom.
    pub(super) dof: f64,
}

impl MeanVariance {
    pub(super) fn sd(&self) -> f64 {
        self.variance.sqrt()
    }
}

/// Computes the variance from block means of equally long records, with at least 8 blocks each.
pub(super) fn variance(records: &[Vec<f64>]) -> MeanVariance {
    let (share, dof_each) = if records.len() >= MANY { (4, 2.5) } else { (6, 3.8) };
    let used: Vec<&Vec<f64>> = records.iter().filter(|record| record.len() >= 8).collect();
    let count = used.len().max(1) as f64;
    let each: Vec<(f64, f64)> = used.iter().map(|record| of_one(record, record.len() / share)).collect();
    let variance = each.iter().map(|(long, _)| long).sum::<f64>() / count;
    // The deviation is at least half of that of independent blocks: an estimate near zero is chance.
    let floor = each.iter().map(|(_, white)| white).sum::<f64>() / count / 4.0;
    MeanVariance { variance: variance.max(floor), dof: dof_each * count }
}

/// Variance with lags up to `lags`, and variance as if the blocks were independent.
fn of_one(blocks: &[f64], lags: usize) -> (f64, f64) {
    let n = blocks.len();
    let mean = stats::mean(blocks);
    let mut sum = 0.0;
    let mut weights = 0.0;
    let mut at_zero = 0.0;
    for lag in 0..lags.max(1) {
        let covariance =
            blocks.iter().zip(&blocks[lag..]).map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>() / (n - lag) as f64;
        let half = lags as f64 / 2.0;
        let taper = if lag as f64 <= half { 1.0 } else { (lags - lag) as f64 / half };
        let weight = if lag == 0 { 1.0 } else { 2.0 } * taper * (1.0 - lag as f64 / n as f64);
        sum += weight * covariance / n as f64;
        weights += weight;
        if lag == 0 {
            at_zero = covariance / n as f64;
        }
    }
    (sum / (1.0 - weights / n as f64), at_zero)
}

/// Degrees of freedom of the standard deviation of a correlated series: `(n - 1) / (1 + 2 sum rho^2)`.
pub(super) fn dof_of_sd(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    (n - 1.0) / (1.0 + 2.0 * correlations(values).map(|rho| rho * rho).sum::<f64>())
}

fn correlations(values: &[f64]) -> impl Iterator<Item = f64> + '_ {
    let n = values.len();
    let mean = stats::mean(values);
    let square: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    let chance = 2.0 / (n.max(1) as f64).sqrt();
    (1..n / 2)
        .map(move |lag| values.iter().zip(&values[lag..]).map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>() / square)
        .take_while(move |rho| *rho > chance)
}
