//! Allan deviation and its family, with intervals and noise coefficients.
//!
//! Definitions after Riley, *Handbook of Frequency Stability Analysis* (NIST SP 1065), section 5; the inertial
//! coefficients after IEEE Std 952, annex C. The code removes the mean of a record of rates and then sums the record to
//! a phase (angle). The removal keeps digits that an offset would cost, and does not change any deviation of the
//! family.

mod coefficients;
mod deviation;
mod edf;
mod fit;
mod freedom;
mod lines;
mod noise;
mod overlapping;
mod parallel;
mod resolution;
mod scatter;

use std::borrow::Cow;

pub use crate::coefficient::Coefficient;
pub use coefficients::{FitQuality, MissingCoefficient, NoiseCoefficients};
use fit::Search;
pub use lines::Sinusoid;
pub use noise::PowerLawNoise;
use resolution::Unresolved;

use crate::psd::{Plateau, RobustSpectrum};
use crate::{Refusal, series, stats};

/// The deviation to compute.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DeviationKind {
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

impl DeviationKind {
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
    /// The given times in s, each rounded to whole samples.
    Seconds(Vec<f64>),
}

/// The kind of the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input {
    /// Rates (frequencies).
    Rate,
    /// Their integral (angles, phases).
    Phase,
}

/// One averaging time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviationPoint {
    /// Averaging time, s.
    pub tau_s: f64,
    /// Deviation, in the unit of the rate.
    pub dev: f64,
    /// Number of differences that were averaged.
    pub n: usize,
    /// Equivalent degrees of freedom.
    pub edf: f64,
    /// Noise type on which the degrees of freedom rest; `None` where the record is too short to tell.
    pub noise: Option<PowerLawNoise>,
    /// Lower end of the 68.3 % interval of the true deviation.
    pub low: f64,
    /// Upper end of the same interval.
    pub high: f64,
}

/// The result of `analyse`.
#[derive(Debug, Clone, PartialEq)]
pub struct Analysis {
    /// One point for each averaging time, rising.
    pub points: Vec<DeviationPoint>,
    /// Noise coefficients; all [`MissingCoefficient::OtherDeviation`] unless the deviation is [`DeviationKind::Adev`] or [`DeviationKind::Oadev`].
    pub coefficients: NoiseCoefficients,
    /// How well the coefficients follow the deviations; `None` with another deviation, or a record too short for a fit.
    pub fit: Option<FitQuality>,
    /// Level part of the spectrum, which gives a second value of N; `None` with another deviation, or where no part is
    /// level or the record does not resolve its noise.
    pub plateau: Option<Plateau>,
}

/// Bound on the work of a list of averaging times: about a minute. A list with more work is refused.
const WORK_LIMIT: f64 = 1e11;
/// A fit takes averaging times up to this part of the record: beyond it a deviation has hardly two degrees of freedom.
const LONGEST_FITTED: usize = 4;

/// Computes a deviation of the Allan family at the averaging times, with 68.3 % intervals (chi-square, degrees of
/// freedom after Greenhall and Riley, *Uncertainty of Stability Variances Based on Finite Differences*, 2003) and noise
/// coefficients. The noises at an averaging time are those of the fit; with other deviations, or where no fit holds,
/// they come from the lag-1 autocorrelation (Riley and Greenhall 2004). The fit takes the overlapping deviations at 1,
/// 2, 4, ... samples, whatever averaging times are asked for. `threads` is the largest number of threads to use.
///
/// # Errors
/// [`Refusal::NotFinite`], [`Refusal::Parameter`], [`Refusal::TooFew`], [`Refusal::Constant`].
pub fn analyse(
    values: &[f64],
    input: Input,
    rate_hz: f64,
    kind: DeviationKind,
    taus: &Taus,
    threads: usize,
) -> Result<Analysis, Refusal> {
    series::positive("rate (Hz)", rate_hz)?;
    let needed = 8;
    if values.len() < needed {
        return Err(Refusal::TooFew { what: "a deviation".to_owned(), got: values.len(), needed });
    }
    // This pass also finds values that are not finite: with one of them the mean is not finite.
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
    let fitted = match kind {
        DeviationKind::Adev | DeviationKind::Oadev => {
            let rates = match input {
                Input::Rate => Cow::Borrowed(values),
                Input::Phase => values.windows(2).map(|w| (w[1] - w[0]) * rate_hz).collect(),
            };
            let known = if kind == DeviationKind::Oadev { (&factors, &sums) } else { (&Vec::new(), &Vec::new()) };
            Some(Fitted::of(rates, &phase, rate_hz, known, threads))
        }
        _ => None,
    };
    let known = fitted.as_ref().and_then(|fitted| fitted.known(rate_hz, kind, phase.len()));
    let names = match known {
        Some(_) => Vec::new(),
        None => noise::names(&parallel::spread(&factors, threads, |m| noise::identify(&phase, m, kind.order()))),
    };
    let point = |(k, (&m, (square, n))): (usize, (&usize, (f64, usize)))| {
        let tau_s = m as f64 / rate_hz;
        let dev = square.sqrt() / tau_s;
        let (noise, edf) = match &known {
            Some(known) => {
                let (noise, edf) = known.at(m);
                (Some(noise), edf)
            }
            None => (names[k], edf::edf(kind, names[k].unwrap_or(PowerLawNoise::WhiteRate), m, phase.len())),
        };
        let unbiased = dev / edf::total_bias(kind, noise, m, phase.len()).sqrt();
        let (low, high) = stats::sd_interval(unbiased, edf, stats::ONE_SIGMA);
        DeviationPoint { tau_s, dev, n, edf, noise, low, high }
    };
    let points: Vec<DeviationPoint> = factors.iter().zip(sums).enumerate().map(point).collect();
    let Some(fitted) = &fitted else {
        return Ok(Analysis { points, coefficients: NoiseCoefficients::default(), fit: None, plateau: None });
    };
    let b_upper_bound = fitted.b_upper_bound(&points, rate_hz);
    let coefficients = coefficients::of(&fitted.search, &fitted.tau_s, fitted.plateau.as_ref(), b_upper_bound);
    // A counter of angle carries its rounding remainder to the next sample. Where it shows as quantisation, it hides
    // nothing.
    let unresolved = fitted.unresolved.filter(|u| u.sd == 0.0 || coefficients.q.is_err());
    let (coefficients, plateau) = match unresolved {
        Some(u) => (NoiseCoefficients::absent(MissingCoefficient::Unresolved { step: u.step, sd: u.sd }, None), None),
        None => (coefficients, fitted.plateau),
    };
    let fit = coefficients::fit(&fitted.search, &fitted.tau_s, &coefficients, &fitted.lines);
    Ok(Analysis { points, coefficients, fit, plateau })
}

/// Averaging times of fewer samples than this give no bound of B, as long as there are longer ones: within the sensor's
/// memory the deviation falls below any flat part.
const MEMORY_SAMPLES: f64 = 32.0;

/// The fit of a record, and the data on which it rests.
struct Fitted {
    /// Set where the codes of the record are too far apart for the noise.
    unresolved: Option<Unresolved>,
    tau_s: Vec<f64>,
    search: Search,
    lines: Vec<Sinusoid>,
    /// Spectrum of the record without the lines.
    spectrum: Option<RobustSpectrum>,
    plateau: Option<Plateau>,
}

impl Fitted {
    /// `known` holds averaging factors whose sums are known already.
    fn of(
        mut rates: Cow<'_, [f64]>,
        phase: &[f64],
        rate_hz: f64,
        known: (&Vec<usize>, &Vec<(f64, usize)>),
        threads: usize,
    ) -> Self {
        let samples = rates.len();
        let unresolved = resolution::unresolved(&rates);
        let grid: Vec<usize> =
            (0..usize::BITS).map(|k| 1 << k).take_while(|m| *m <= samples / LONGEST_FITTED).collect();
        let tau_s: Vec<f64> = grid.iter().map(|m| *m as f64 / rate_hz).collect();
        let mut spectrum = RobustSpectrum::of(&rates, rate_hz);
        let mut lines = Vec::new();
        let mut cleaned = None;
        if spectrum.as_ref().is_some_and(|s| s.line().is_some()) {
            lines = lines::take_off(rates.to_mut(), rate_hz);
            spectrum = RobustSpectrum::of(&rates, rate_hz);
            let mean = deviation::mean(&rates, threads);
            cleaned = Some(deviation::integrate(&rates, mean, 1.0 / rate_hz, threads));
        }
        let sums = match (&cleaned, grid.iter().map(|m| known.0.binary_search(m).ok()).collect::<Option<Vec<_>>>()) {
            (None, Some(places)) => places.into_iter().map(|place| known.1[place]).collect(),
            _ => deviation::mean_squares(cleaned.as_deref().unwrap_or(phase), &grid, DeviationKind::Oadev, threads),
        };
        let square = sums.iter().zip(&tau_s).map(|((square, _), tau_s)| square / (tau_s * tau_s)).collect();
        let stretch = |&m: &usize| {
            let white = 2.0 / edf::edf(DeviationKind::Oadev, PowerLawNoise::WhiteRate, m, phase.len());
            let measured = spectrum.as_ref().and_then(|s| scatter::measured(s, rate_hz, samples, m));
            measured.map_or(1.0, |(_, variance)| (variance / white).sqrt().max(1.0))
        };
        let memory = grid.iter().map(stretch).collect();
        let curve = fit::DeviationCurve { scatter: scatter::Scatter::new(&grid, phase.len()), tau_s, square, memory };
        let plateau = spectrum.as_ref().and_then(|spectrum| spectrum.without_lines().plateau());
        let mut search = fit::search(&curve);
        // Without a term for a bounded wander, the fit takes the wander's long end for the noise of the sensor.
        if !coefficients::reaches_white(&search, &curve.tau_s, plateau.as_ref(), MEMORY_SAMPLES / rate_hz)
            && let Some(fit) = fit::search_with_markov(&curve)
        {
            search = Search::Holds(fit);
        }
        Self { unresolved, tau_s: curve.tau_s, search, lines, spectrum, plateau }
    }

    /// Upper bound of B, from the deviations beyond the sensor's memory.
    fn b_upper_bound(&self, points: &[DeviationPoint], rate_hz: f64) -> Option<f64> {
        let lowest = |shortest_s: f64| {
            let usable = points.iter().filter(|p| p.edf.is_finite() && p.dev > 0.0 && p.tau_s >= shortest_s);
            usable.map(|p| coefficients::bound(p.dev, p.edf)).reduce(f64::min)
        };
        lowest(self.used_from_s().max(MEMORY_SAMPLES / rate_hz)).or_else(|| lowest(0.0))
    }

    /// First averaging time of the fit, s.
    fn used_from_s(&self) -> f64 {
        if let Search::Holds(fit) = &self.search { self.tau_s[fit.start] } else { 0.0 }
    }

    fn known(&self, rate_hz: f64, kind: DeviationKind, phases: usize) -> Option<freedom::Known<'_>> {
        let Search::Holds(fit) = &self.search else { return None };
        Some(freedom::Known {
            fit,
            used_from_s: self.used_from_s(),
            lines: &self.lines,
            spectrum: self.spectrum.as_ref(),
            rate_hz,
            kind,
            phases,
        })
    }
}

/// Averaging factors in samples, rising, each with at least two differences.
fn factors(taus: &Taus, phases: usize, rate_hz: f64, kind: DeviationKind) -> Result<Vec<usize>, Refusal> {
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
