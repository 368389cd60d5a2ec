//! Noise coefficients, each with its interval or the reason why it is not given.

use std::fmt;

use super::fit::{B, FLAT, G, K, N, Q, R, Search, Solved};
use super::lines::Sinusoid;
use crate::coefficient::Coefficient;
use crate::psd::Plateau;
use crate::stats;

/// Why a coefficient is not given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MissingCoefficient {
    /// Coefficients are taken from the Allan deviation.
    OtherDeviation,
    /// The record has too few averaging times for a fit.
    TooShort,
    /// The noise is below the resolution of the record.
    Unresolved {
        /// Least step between codes.
        step: f64,
        /// Standard deviation of the samples.
        sd: f64,
    },
    /// Chi-square rejects the nearest fit.
    Rejected {
        /// Chi-square of the nearest fit.
        chi_square: f64,
        /// Degrees of freedom of the fit.
        dof: usize,
        /// Probability of a larger one.
        p: f64,
    },
    /// The deviations lie on a curve without any scatter: a single event causes all of them.
    OneEvent {
        /// Chi-square of the fit.
        chi_square: f64,
        /// Degrees of freedom of the fit.
        dof: usize,
    },
    /// The spectrum's plateau contradicts N.
    Contradicted {
        /// N of the deviations.
        curve: f64,
        /// N of the spectrum.
        spectrum: f64,
    },
    /// The fit is as good without the term.
    NotNeeded,
    /// The term carries too little of the variance at each averaging time.
    Hidden {
        /// Largest share of the term.
        share: f64,
    },
    /// Chance alone gives a coefficient of this size.
    Chance {
        /// The square of the coefficient over the square that chance gives.
        odds: f64,
    },
    /// Other terms in its place fit nearly as well.
    Rivalled {
        /// How much worse the other terms fit, in chi-square.
        gain: f64,
    },
    /// Its whole interval exceeds what the lowest deviation allows.
    AboveBound {
        /// Lower end of the interval that was found.
        low: f64,
        /// Upper bound.
        bound: f64,
    },
    /// The fit leaves out the averaging times at which the term shows.
    LeftOut {
        /// First averaging time used, s.
        used_from_s: f64,
    },
}

impl fmt::Display for MissingCoefficient {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OtherDeviation => write!(f, "coefficients come from adev or oadev only"),
            Self::TooShort => write!(f, "the record has too few averaging times for a fit"),
            Self::Unresolved { step, sd } => write!(
                f,
                "the noise is below the resolution: the codes are {step:.4e} apart and the samples scatter by {sd:.4e}, about \
                 half of that or less; record with a finer resolution"
            ),
            Self::Rejected { chi_square, dof, p } => write!(
                f,
                "no fit holds: the nearest has chi-square {chi_square:.1} with {dof} degrees of freedom (p {p:.1e}); look at \
                 the record for steps, spikes, drifting lines and temperature"
            ),
            Self::OneEvent { chi_square, dof } => write!(
                f,
                "the deviations lie on a slope without scatter (chi-square {chi_square:.1e} with {dof} degrees of freedom): \
                 look for a spike in the record"
            ),
            Self::Contradicted { curve, spectrum } => write!(
                f,
                "the deviations give {curve:.4e}, the plateau of the spectrum {spectrum:.4e}: look for spikes in the record"
            ),
            Self::NotNeeded => write!(f, "the fit is as good without it"),
            Self::Hidden { share } => write!(
                f,
                "it carries at most {:.0} % of the variance at any averaging time, {:.0} % are needed",
                100.0 * share,
                100.0 * SEEN
            ),
            Self::Chance { odds } => {
                write!(f, "its square is {odds:.1} times what chance makes of it, {CHANCE:.0} are needed")
            }
            Self::Rivalled { gain } => write!(
                f,
                "other terms fit nearly as well: chi-square is {gain:.1} larger without it, {RIVALLED:.0} are needed"
            ),
            Self::AboveBound { low, bound } => {
                write!(f, "the fit gives {low:.4e} at least, more than the upper bound of {bound:.4e}")
            }
            Self::LeftOut { used_from_s } => {
                write!(f, "the sensor's memory hides it: the fit begins at {used_from_s} s")
            }
        }
    }
}

/// Coefficients of IEEE Std 952, annex C, for a rate in unit u:
/// `dev^2 = 3 Q^2 / tau^2 + N^2 / tau + (2 ln 2 / pi) B^2 + K^2 tau / 3 + R^2 tau^2 / 2`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseCoefficients {
    /// Quantisation, u s.
    pub q: Result<Coefficient, MissingCoefficient>,
    /// Random walk of the integral (angle, velocity), u sqrt(s): `dev` at 1 s.
    pub n: Result<Coefficient, MissingCoefficient>,
    /// Bias instability, u: flat part / 0.664. Given only where a flat part is seen.
    pub b: Result<Coefficient, MissingCoefficient>,
    /// Random walk of the rate, u / sqrt(s): `dev` at 3 s.
    pub k: Result<Coefficient, MissingCoefficient>,
    /// Ramp of the rate, u / s.
    pub r: Result<Coefficient, MissingCoefficient>,
    /// Smallest upper end of a 95 % interval of the deviations / 0.664 (or the upper end of B, where that is more): an upper
    /// bound of the bias instability, whether a flat part is seen or not.
    pub b_upper_bound: Option<f64>,
}

impl NoiseCoefficients {
    pub(super) fn absent(why: MissingCoefficient, b_upper_bound: Option<f64>) -> Self {
        Self { q: Err(why), n: Err(why), b: Err(why), k: Err(why), r: Err(why), b_upper_bound }
    }
}

impl Default for NoiseCoefficients {
    /// The coefficients of a deviation that has none.
    fn default() -> Self {
        Self::absent(MissingCoefficient::OtherDeviation, None)
    }
}

/// How well the coefficients follow the deviations.
#[derive(Debug, Clone, PartialEq)]
pub struct FitQuality {
    /// Whether the fit holds: chi-square does not reject it. Without that no coefficient is given.
    pub holds: bool,
    /// Chi-square of the deviations used, which are correlated.
    pub chi_square: f64,
    /// Degrees of freedom of chi-square.
    pub dof: usize,
    /// Probability of a larger one.
    pub p: f64,
    /// Names of the terms fitted.
    pub terms: Vec<&'static str>,
    /// First averaging time used, s.
    pub used_from_s: f64,
    /// Correlation time of the Gauss-Markov noise, s, where one was fitted.
    pub correlation_s: Option<f64>,
    /// Relative standard deviation that each deviation was given for the model's own error.
    pub model_error: f64,
    /// Lines that were taken off before.
    pub lines: Vec<Sinusoid>,
}

/// A term is seen if it carries this part of the variance at some averaging time ...
const SEEN: f64 = 0.5;
/// ... and exceeds this many times what chance gives where the term is absent. (The comparison is not with the term's
/// own standard deviation. That is always large, since a long averaging time has few degrees of freedom, even where the
/// record leaves no doubt.)
const CHANCE: f64 = 4.0;
/// B must improve chi-square by this much, since the beginning of a walk looks much like a flat part.
const RIVALLED: f64 = 4.0;
/// N of the deviations and N of the spectrum contradict each other if they differ by more than this many standard
/// deviations ...
const CONTRADICTION: f64 = 5.0;
/// ... and by more than this part of N, since the plateau may bend a little.
const BENT: f64 = 0.05;

/// Coefficients of a fit at these averaging times, or why there are none.
pub(super) fn of(
    search: &Search,
    tau_s: &[f64],
    plateau: Option<&Plateau>,
    b_upper_bound: Option<f64>,
) -> NoiseCoefficients {
    let solved = match search {
        Search::Holds(solved) => solved,
        Search::Rejected(s) => {
            let why = MissingCoefficient::Rejected { chi_square: s.chi_square, dof: s.dof, p: s.p };
            return NoiseCoefficients::absent(why, b_upper_bound);
        }
        Search::TooGood(s) => {
            let why = MissingCoefficient::OneEvent { chi_square: s.chi_square, dof: s.dof };
            return NoiseCoefficients::absent(why, b_upper_bound);
        }
        Search::TooFew => return NoiseCoefficients::absent(MissingCoefficient::TooShort, b_upper_bound),
    };
    let seen = |term| seen(solved, term, tau_s);
    let b = seen(B).and_then(|b| match b_upper_bound {
        _ if solved.flat_gain < RIVALLED => Err(MissingCoefficient::Rivalled { gain: solved.flat_gain }),
        Some(bound) if b.low > bound => Err(MissingCoefficient::AboveBound { low: b.low, bound }),
        _ => Ok(b),
    });
    // Where both agree, B may still exceed the bound by chance.
    let b_upper_bound = b_upper_bound.map(|bound| b.map_or(bound, |b| bound.max(b.high)));
    let q =
        if solved.start == 0 { seen(Q) } else { Err(MissingCoefficient::LeftOut { used_from_s: tau_s[solved.start] }) };
    let found = NoiseCoefficients { q, n: seen(N), b, k: seen(K), r: seen(R), b_upper_bound };
    match (found.n, plateau) {
        // A single event would appear in all coefficients.
        (Ok(n), Some(plateau)) if contradict(n, plateau.n()) => {
            let why = MissingCoefficient::Contradicted { curve: n.value, spectrum: plateau.n().value };
            NoiseCoefficients::absent(why, b_upper_bound)
        }
        _ => found,
    }
}

fn seen(solved: &Solved, term: usize, tau_s: &[f64]) -> Result<Coefficient, MissingCoefficient> {
    let (Some((square, sd)), Some(odds)) = (solved.given(term), solved.over_chance(term, tau_s)) else {
        return Err(MissingCoefficient::NotNeeded);
    };
    let share = solved.share(term, tau_s);
    if share < SEEN {
        return Err(MissingCoefficient::Hidden { share: share.max(0.0) });
    }
    if odds <= CHANCE {
        return Err(MissingCoefficient::Chance { odds });
    }
    // A square with this many degrees of freedom has this scatter.
    let value = square.sqrt();
    let (low, high) = stats::sd_interval(value, 2.0 * (square / sd).powi(2), stats::ONE_SIGMA);
    Ok(Coefficient { value, low, high })
}

/// Whether a fit holds from averaging times on at which the white noise of the sensor shows (up to `memory_s`), and the
/// N of the fit does not contradict the plateau.
pub(super) fn reaches_white(search: &Search, tau_s: &[f64], plateau: Option<&Plateau>, memory_s: f64) -> bool {
    let Search::Holds(solved) = search else { return !matches!(search, Search::Rejected(_)) };
    let agrees = match (seen(solved, N, tau_s), plateau) {
        (Ok(n), Some(plateau)) => !contradict(n, plateau.n()),
        _ => true,
    };
    agrees && !solved.adds() && tau_s[solved.start] <= memory_s
}

fn contradict(a: Coefficient, b: Coefficient) -> bool {
    let sd = ((a.high - a.low) / 2.0).hypot((b.high - b.low) / 2.0);
    (a.value - b.value).abs() > CONTRADICTION * sd + BENT * a.value.min(b.value)
}

/// The quality of the fit that a search found; `None` where there were too few averaging times.
pub(super) fn fit(
    search: &Search,
    tau_s: &[f64],
    coefficients: &NoiseCoefficients,
    lines: &[Sinusoid],
) -> Option<FitQuality> {
    let (Search::Holds(s) | Search::Rejected(s) | Search::TooGood(s)) = search else { return None };
    let term = |c: &usize| match *c {
        Q if s.squares[Q] < 0.0 => "band limit",
        Q if s.start > 0 => "memory",
        Q => "Q",
        N => "N",
        B => "B",
        K => "K",
        G => "Gauss-Markov",
        _ => "R",
    };
    let lined = if lines.is_empty() { None } else { Some("line") };
    Some(FitQuality {
        holds: matches!(search, Search::Holds(_))
            && !matches!(
                coefficients.n,
                Err(MissingCoefficient::Contradicted { .. } | MissingCoefficient::Unresolved { .. })
            ),
        chi_square: s.chi_square,
        dof: s.dof,
        p: s.p,
        terms: s.fitted.iter().map(term).chain(lined).collect(),
        used_from_s: tau_s[s.start],
        correlation_s: Some(s.markov_s).filter(|markov_s| *markov_s > 0.0),
        model_error: s.model_error,
        lines: lines.to_vec(),
    })
}

/// Upper bound of B from one deviation with `edf` degrees of freedom.
pub(super) fn bound(dev: f64, edf: f64) -> f64 {
    stats::sd_interval(dev, edf, 0.95).1 / FLAT
}
