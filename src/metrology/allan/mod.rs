//! Allan deviation and its family, with intervals and noise coefficients.
//!
//! Definitions after Riley, *Handbook of Frequency Stability Analysis* (NIST SP 1065), section 5; the inertial
//! coefficients after IEEE Std 952, annex C. A record of rates is summed to a phase (angle) first; its mean is removed
//! before, so that an offset costs no digits, and no deviation of the family sees it.

mod coefficients;
mod deviation;
mod edf;
mod noise;
mod overlapping;

pub use coefficients::{Coefficient, Coefficients};
pub use noise::Noise;

use crate::{Refusal, series, stats};

/// Which deviation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Allan, disjoint.
    Adev,
    /// Allan, overlapping.
    Oadev,
    /// Modified Allan.
    Mdev,
    /// Hadamard, disjoint.
    Hdev,
    /// Hadamard, overlapping.
    Ohdev,
    /// Total, without bias correction.
    Totdev,
}

impl Kind {
    /// Order of the difference of the phase.
    pub(crate) fn order(self) -> usize {
        if matches!(self, Self::Hdev | Self::Ohdev) { 3 } else { 2 }
    }
}

/// Averaging times.
#[derive(Debug, Clone, PartialEq)]
pub enum Taus {
    /// 1, 2, 4, 8, ... samples.
    Octave,
    /// 1, 2, 4, 10, 20, 40, 100, ... samples.
    Decade,
    /// Every number of samples.
    All,
    /// These times in s, each rounded to whole samples.
    Seconds(Vec<f64>),
}

/// What the samples are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input {
    /// Rates (frequencies).
    Rate,
    /// Their integral (angles, phases).
    Phase,
}

/// One averaging time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Averaging time, s.
    pub tau_s: f64,
    /// Deviation, in the unit of the rate.
    pub dev: f64,
    /// Number of differences that were averaged.
    pub n: usize,
    /// Equivalent degrees of freedom.
    pub edf: f64,
    /// Noise type on which they rest; `None` where the record is too short to tell.
    pub noise: Option<Noise>,
    /// Lower end of the 68.3 % interval of the true deviation.
    pub low: f64,
    /// Upper end of the same.
    pub high: f64,
}

/// What was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Analysis {
    /// One point for each averaging time, rising.
    pub points: Vec<Point>,
    /// Noise coefficients; all `None` unless the deviation is [`Kind::Adev`] or [`Kind::Oadev`].
    pub coefficients: Coefficients,
}

/// Work above which a list of averaging times is refused: about a minute.
const WORK_LIMIT: f64 = 1e11;

/// Computes a deviation of the Allan family at the averaging times, with 68.3 % intervals (chi-square, degrees of
/// freedom after Greenhall and Riley, *Uncertainty of Stability Variances Based on Finite Differences*, 2003; noise type
/// by lag-1 autocorrelation, Riley and Greenhall 2004) and noise coefficients. `threads` is how many may be used.
///
/// # Errors
/// [`Refusal::NotFinite`], [`Refusal::Parameter`], [`Refusal::TooFew`], [`Refusal::Constant`].
pub fn analyse(
    values: &[f64],
    input: Input,
    rate_hz: f64,
    kind: Kind,
    taus: &Taus,
    threads: usize,
) -> Result<Analysis, Refusal> {
    series::positive("rate (Hz)", rate_hz)?;
    let needed = 8;
    if values.len() < needed {
        return Err(Refusal::TooFew { what: "a deviation".to_owned(), got: values.len(), needed });
    }
    // One pass for both: a value that is not finite leaves no finite mean.
    let mean = deviation::mean(values, threads);
    if !mean.is_finite() {
        series::finite("record", values)?;
        return Err(Refusal::NotFinite { channel: "mean of the record".to_owned(), index: 0, value: mean });
    }
    if values.iter().all(|v| *v == values[0]) {
        return Err(Refusal::Constant { channel: "record".to_owned(), samples: values.len(), value: values[0] });
    }
    let phase = match input {
        Input::Rate => deviation::integrate(values, mean, 1.0 / rate_hz, threads),
        Input::Phase => values.iter().map(|v| v - values[0]).collect(),
    };
    let factors = factors(taus, phase.len(), rate_hz, kind)?;
    if factors.len() as f64 * phase.len() as f64 > WORK_LIMIT {
        let (value, expected) = (factors.len() as f64, "fewer averaging times for a record of this length");
        return Err(Refusal::Parameter { name: "number of averaging times", value, expected });
    }
    let sums = deviation::mean_squares(&phase, &factors, kind, threads);
    let noises = deviation::spread(&factors, threads, |m| noise::identify(&phase, m, kind.order()));
    let mut points: Vec<Point> = Vec::with_capacity(factors.len());
    for ((&m, (square, n)), noise) in factors.iter().zip(sums).zip(noises) {
        let tau_s = m as f64 / rate_hz;
        let dev = square.sqrt() / tau_s;
        // A record too short to tell at this averaging time is taken to go on as before.
        let noise = noise.or(points.last().and_then(|p| p.noise));
        let edf = edf::edf(kind, noise.unwrap_or(Noise::WhiteRate), m, phase.len());
        let unbiased = dev / edf::total_bias(kind, noise, m, phase.len()).sqrt();
        let (low, high) = stats::sd_interval(unbiased, edf, stats::ONE_SIGMA);
        points.push(Point { tau_s, dev, n, edf, noise, low, high });
    }
    let coefficients = match kind {
        Kind::Adev | Kind::Oadev => coefficients::fit(&points),
        _ => Coefficients::default(),
    };
    Ok(Analysis { points, coefficients })
}

/// Averaging factors in samples, rising, each with at least two differences.
fn factors(taus: &Taus, phases: usize, rate_hz: f64, kind: Kind) -> Result<Vec<usize>, Refusal> {
    let fits = |m: &usize| deviation::count(phases, *m, kind) >= 2;
    let factors: Vec<usize> = match taus {
        Taus::Octave => (0..usize::BITS - 1).map(|k| 1 << k).take_while(fits).collect(),
        Taus::Decade => (0..18).flat_map(|k| [1, 2, 4].map(|f| f * 10_usize.pow(k))).take_while(fits).collect(),
        Taus::All => (1..).take_while(fits).collect(),
        Taus::Seconds(list) => {
            let mut factors = Vec::with_capacity(list.len());
            for &tau_s in list {
                let m = (tau_s * rate_hz).round();
                if !(m >= 1.0 && m < phases as f64 && fits(&(m as usize))) {
                    let expected = "at least one sample and at least two differences in the record";
                    return Err(Refusal::Parameter { name: "averaging time (s)", value: tau_s, expected });
                }
                factors.push(m as usize);
            }
            factors.sort_unstable();
            factors.dedup();
            factors
        }
    };
    if factors.is_empty() {
        return Err(Refusal::TooFew { what: "a deviation".to_owned(), got: phases, needed: 8 });
    }
    Ok(factors)
}
