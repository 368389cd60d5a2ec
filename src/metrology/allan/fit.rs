//! The fit of noise terms to squared Allan deviations, and whether it holds.
//!
//! Every coefficient comes from generalised least squares of the squared deviations at 1, 2, 4, ... samples, with their
//! covariance under the fitted curve. The fit holds where chi-square does not reject it.
//!
//! A low-pass, a hold or any other short memory of the sensor takes a constant off the variance of the angle: for white
//! noise of coefficient N with memory, `var(angle) = N^2 t - C` as soon as the memory is over, and the deviation
//! follows as `dev^2 = N^2 / tau - 3 C / (2 tau^2)`. So a band limit is a quantisation term of the other sign, whatever
//! its order. Within the memory the curve differs by the rest of the memory, which falls exponentially: at twice the
//! time it is squared. So the fit leaves out one octave more than chi-square asks for, and nothing of the memory
//! remains. Chance may hide the rest of the memory in the first of these points, and then N absorbs it. Every memory
//! lowers the first deviation, so that deviation must also show that the memory is over.

use nalgebra::{DMatrix, DVector};

use super::scatter::{Parts, Scatter};
use crate::{linear, stats};

/// Terms of `dev^2`: Q, N, B, K, R, and a Gauss-Markov noise of unit variance.
pub(super) const TERMS: usize = 6;
pub(super) const Q: usize = 0;
pub(super) const N: usize = 1;
pub(super) const B: usize = 2;
pub(super) const K: usize = 3;
pub(super) const R: usize = 4;
pub(super) const G: usize = 5;

/// `sqrt(2 ln 2 / pi)`.
pub(super) const FLAT: f64 = 0.664_282;

/// A fit holds from this probability of chi-square on.
const HOLDS: f64 = 0.001;
/// A point belongs to the curve behind it unless it raises chi-square by more than chance does with this probability.
const BELONGS: f64 = 0.02;
/// Number of points that are tested, one after the other, for whether they belong to the curve.
const ASKED: usize = 3;
/// Below this probability the points lie closer to a curve than noise can: a single event causes all of them.
const TOO_GOOD: f64 = 1e-6;
/// Relative standard deviation of the model's own error at each point, used where no fit holds by chance alone.
const MODEL_ERROR: f64 = 0.03;
/// A band limit is fitted from this many standard deviations on, since a band limit that is missed bends N.
const BAND_LIMIT: f64 = 1.5;
/// Largest rest of the sensor's memory at a fit's first point, taken as that of a low-pass of the first order, in
/// standard deviations of that point. (A steeper low-pass forgets sooner than one of the first order with the same
/// deviation at one sample.)
const REMEMBERED: f64 = 3.0;
/// Quantisation is fitted from this many standard deviations on.
const QUANTISATION: f64 = 3.0;
/// A term is fitted if it improves chi-square by this much. (At 2, after Akaike, a weak walk is taken for a flat part.)
const TERM_COST: f64 = 1.6;
/// A fit with fewer degrees of freedom than this is not believed.
const FEWEST_DOF: usize = 3;

/// Coefficients of the terms, for a correlation time of the Gauss-Markov noise (0: there is none).
pub(super) fn terms(tau_s: f64, markov_s: f64) -> [f64; TERMS] {
    [3.0 / (tau_s * tau_s), 1.0 / tau_s, FLAT * FLAT, tau_s / 3.0, tau_s * tau_s / 2.0, markov(tau_s, markov_s)]
}

/// Squared Allan deviation of an exponentially correlated noise of unit variance (IEEE Std 952, annex C.1.1.6):
/// `(2 / x) [1 - (3 - 4 e^-x + e^-2x) / 2 x]` with `x = tau / T`.
fn markov(tau_s: f64, markov_s: f64) -> f64 {
    if markov_s <= 0.0 {
        return 0.0;
    }
    let x = tau_s / markov_s;
    if x < 0.01 {
        // The first terms of the series, since the difference below loses its digits here.
        return x * (2.0 / 3.0 - x * (0.5 - x * 7.0 / 30.0));
    }
    2.0 / x * (1.0 - (3.0 - 4.0 * (-x).exp() + (-2.0 * x).exp()) / (2.0 * x))
}

/// Squared deviations at rising averaging times, and how they scatter.
pub(super) struct DeviationCurve {
    pub(super) tau_s: Vec<f64>,
    pub(super) square: Vec<f64>,
    pub(super) scatter: Scatter,
    /// Factor by which the record scatters more than white noise at each averaging time, from its spectrum, within a
    /// band limit.
    pub(super) memory: Vec<f64>,
}

/// A fit.
#[derive(Debug, Clone)]
pub(super) struct Solved {
    /// First point used.
    pub(super) start: usize,
    /// Squares of the coefficients. That of Q is negative for a band limit.
    pub(super) squares: [f64; TERMS],
    /// Terms that were fitted.
    pub(super) fitted: Vec<usize>,
    /// Covariance of their squares.
    pub(super) covariance: DMatrix<f64>,
    /// Correlation time of the Gauss-Markov noise; 0 without one.
    pub(super) markov_s: f64,
    /// Square of N and its standard deviation over the choices of slow terms.
    walk: Option<(f64, f64)>,
    /// How much worse the best fit without a flat part is, in chi-square.
    pub(super) flat_gain: f64,
    /// How the squares of the coefficients follow from the squared deviations used.
    estimator: DMatrix<f64>,
    /// Covariance of the squared deviations used.
    points: DMatrix<f64>,
    /// Whether the model was given an error of its own.
    pub(super) model_error: f64,
    pub(super) chi_square: f64,
    pub(super) dof: usize,
    /// Probability of a larger chi-square.
    pub(super) p: f64,
}

/// The result of the search.
pub(super) enum Search {
    Holds(Solved),
    /// The nearest fit, which chi-square rejects.
    Rejected(Solved),
    /// The points lie on a curve without any scatter.
    TooGood(Solved),
    TooFew,
}

/// Finds the simplest fit that holds, in this order: from the first point on; with quantisation; with a band limit,
/// from the first point that belongs to the curve behind it and one octave more; the same again with an error of the
/// model.
pub(super) fn search(curve: &DeviationCurve) -> Search {
    let mut nearest: Option<Solved> = None;
    for model_error in [0.0, MODEL_ERROR] {
        match curve.search(&Model { markov_s: 0.0, model_error }, curve.tau_s.len()) {
            Search::Rejected(rejected) => {
                let before = nearest.take();
                nearest = [Some(rejected), before].into_iter().flatten().max_by(|a, b| a.p.total_cmp(&b.p));
            }
            Search::TooFew => {}
            found => return found,
        }
    }
    nearest.map_or(Search::TooFew, Search::Rejected)
}

/// Finds the fit with a Gauss-Markov noise beside the other terms, of the likeliest correlation time. Such noise
/// looks like a slow, bounded wander of the bias, as of a sensor that is warmed in turns. `None` where no such fit
/// holds.
pub(super) fn search_with_markov(curve: &DeviationCurve) -> Option<Solved> {
    let candidates: Vec<f64> = curve.correlation_times().flat_map(|t| [t, t * std::f64::consts::SQRT_2]).collect();
    [0.0, MODEL_ERROR].into_iter().find_map(|model_error| {
        let fitted = |markov_s: f64| match curve.search(&Model { markov_s, model_error }, EARLY) {
            Search::Holds(fit) if fit.fitted.contains(&G) && fit.p >= LIKELY => Some(fit),
            _ => None,
        };
        candidates.iter().filter_map(|markov_s| fitted(*markov_s)).max_by(|a, b| a.p.total_cmp(&b.p))
    })
}

/// A fit with a Gauss-Markov noise begins at one of this many first points: the sensor's memory is over by then.
const EARLY: usize = 7;

/// From this probability of chi-square on, a fit with a Gauss-Markov noise takes the place of a fit without it.
const LIKELY: f64 = 0.02;

/// A choice of slow terms.
struct Choice {
    /// Weighted sum of squares, and the cost of its terms.
    cost: f64,
    /// Whether the choice has a flat part.
    flat: bool,
    /// Square of N and its variance.
    walk: Option<(f64, f64)>,
}

/// What all fits of a search have in common.
struct Model {
    markov_s: f64,
    model_error: f64,
}

/// Whether the first of these fits holds, and the points that only the first ones use belong to the curve behind them.
fn belongs(fits: &[Solved]) -> bool {
    let Some((first, behind)) = fits.split_first() else { return false };
    let added = |(index, fit): (usize, &Solved)| {
        let added = (first.chi_square - fit.chi_square).max(0.0);
        1.0 - stats::chi_square_probability(added, (index + 1) as f64) >= BELONGS
    };
    first.dof >= FEWEST_DOF && first.p >= HOLDS && behind.iter().take(ASKED).enumerate().all(added)
}

impl DeviationCurve {
    /// The simplest fit of a model that holds, from one of the first `starts` points on.
    fn search(&self, model: &Model, starts: usize) -> Search {
        let fits = |banded: bool, starts: usize| -> Vec<Solved> {
            (0..starts).map_while(|start| self.solve(start, banded, model, TERM_COST)).collect()
        };
        let plain = fits(false, 1 + ASKED);
        let odds = self.solve(0, true, model, TERM_COST).and_then(|banded| banded.odds(Q)).unwrap_or(0.0);
        if let Some(first) = plain.first() {
            if model.model_error == 0.0 && first.dof > FEWEST_DOF && 1.0 - first.p < TOO_GOOD {
                return Search::TooGood(first.clone());
            }
            if belongs(&plain) && (-BAND_LIMIT..QUANTISATION).contains(&odds) {
                return self.holds(first, false, None);
            }
        }
        let banded = fits(true, starts);
        // Chance makes a band limit of one white record in fifteen. So a band limit is in doubt where all points follow
        // a fit without it.
        let doubt = plain.first().filter(|_| belongs(&plain));
        if let Some(first) = banded.first().filter(|_| belongs(&banded) && odds >= QUANTISATION) {
            return self.holds(first, true, doubt);
        }
        for start in 0..banded.len() {
            if belongs(&banded[start..])
                && let Some(further) = banded.get(start + 1)
                && further.p >= HOLDS
                && further.remembers(self) <= REMEMBERED
            {
                return self.holds(further, true, doubt);
            }
        }
        let all = plain.into_iter().chain(banded).filter(|fit| fit.dof >= FEWEST_DOF);
        all.max_by(|a, b| a.p.total_cmp(&b.p)).map_or(Search::TooFew, Search::Rejected)
    }

    /// The fit with N as the mean over every choice of slow terms, weighted by how well each follows the points
    /// (Buckland, Burnham and Augustin, *Model Selection: An Integral Part of Inference*, 1997). A term that is there
    /// but too weak to be chosen would bend N, and the spread over the choices is the uncertainty of choosing. The
    /// choices include those of a fit without the memory, where it holds as well: beside it, Q and each point left out
    /// cost as much as a term.
    fn holds(&self, chosen: &Solved, banded: bool, plain: Option<&Solved>) -> Search {
        let mut solved = chosen.clone();
        let mut choices = self.choices(chosen, banded);
        let least = |with: &dyn Fn(&Choice) -> bool| {
            choices.iter().filter(|c| with(c)).map(|c| c.cost).fold(f64::INFINITY, f64::min)
        };
        solved.flat_gain = least(&|c| !c.flat) - least(&|_| true);
        if let Some(plain) = plain {
            let memory = TERM_COST * (1 + chosen.start) as f64;
            choices.iter_mut().for_each(|choice| choice.cost += memory);
            choices.extend(self.choices(plain, false));
        }
        let best = choices.iter().map(|c| c.cost).fold(f64::INFINITY, f64::min);
        let (mut total, mut first, mut second) = (0.0, 0.0, 0.0);
        for Choice { cost, walk, .. } in choices {
            let Some((square, variance)) = walk else { continue };
            let weight = (-(cost - best) / 2.0).exp();
            total += weight;
            first += weight * square;
            second += weight * (square * square + variance);
        }
        let mean = first / total;
        let sd = (second / total - mean * mean).sqrt();
        if sd.is_finite() {
            solved.walk = Some((mean, sd));
        }
        Search::Holds(solved)
    }

    /// Every choice of slow terms that fits from the first point of `chosen` on, under its scatter.
    fn choices(&self, chosen: &Solved, banded: bool) -> Vec<Choice> {
        let of = |markov_s: f64| {
            let (design, square) = self.from(chosen.start, markov_s);
            Constrained::all(&design, &square, &chosen.points, &allowed(banded, markov_s), TERM_COST)
                .unwrap_or_default()
        };
        let mut fits = of(chosen.markov_s);
        if chosen.markov_s == 0.0 {
            // A bounded wander of any correlation time costs as much as a term.
            for markov_s in self.correlation_times() {
                let wandering = of(markov_s).into_iter().filter(|fit| fit.columns.contains(&G));
                fits.extend(wandering.map(|fit| Constrained { cost: fit.cost + TERM_COST, ..fit }));
            }
        }
        let choice = |fit: Constrained| {
            let variance = |row: usize| {
                let estimator = fit.estimator.row(row);
                (estimator * &chosen.points * estimator.transpose())[0]
            };
            let walk = fit.columns.iter().position(|c| *c == N).map(|row| (fit.squares[N], variance(row)));
            Choice { cost: fit.cost, flat: fit.columns.contains(&B), walk }
        };
        fits.into_iter().map(choice).collect()
    }

    /// Correlation times of a Gauss-Markov noise that the record can show, an octave apart, s.
    fn correlation_times(&self) -> impl Iterator<Item = f64> + '_ {
        let longest_s = self.tau_s.last().map_or(0.0, |last| last / 2.0);
        self.tau_s.iter().skip(EARLY).copied().take_while(move |t| *t <= longest_s)
    }

    /// Terms and squared deviations from a point on.
    fn from(&self, start: usize, markov_s: f64) -> (DMatrix<f64>, DVector<f64>) {
        let tau_s = &self.tau_s[start..];
        let design = DMatrix::from_fn(tau_s.len(), TERMS, |r, c| terms(tau_s[r], markov_s)[c]);
        (design, DVector::from_column_slice(&self.square[start..]))
    }

    /// Generalised least squares from point `start` on. `None` with too few points or without any solution.
    fn solve(&self, start: usize, banded: bool, model: &Model, term_cost: f64) -> Option<Solved> {
        let Model { markov_s, model_error } = *model;
        if start >= self.square.len() {
            return None;
        }
        let (design, square) = self.from(start, markov_s);
        let mut allowed = allowed(banded, markov_s);
        // The scatter is that of the fitted curve, so that points that happen to be low do not weigh more. The first
        // round uses the scatter of white noise through the points.
        let mut parts: Vec<Parts> = self.square.iter().map(|s| [0.0, *s, 0.0, 0.0]).collect();
        let mut solved = None;
        for round in 0..ROUNDS {
            let covariance = self.covariance(start, &parts, banded, model_error);
            let cost = if round == CHOICE { term_cost } else { 0.0 };
            let fit = Constrained::fit(&design, &square, &covariance, &allowed, cost)?;
            parts = self.tau_s.iter().zip(&self.square).map(|(t, s)| fit.parts(*t, *s, markov_s)).collect();
            if round == CHOICE {
                allowed.clone_from(&fit.columns);
            }
            solved = Some(fit);
        }
        let fit = solved?;
        let dof = square.len().checked_sub(fit.columns.len()).filter(|dof| *dof > 0)?;
        let points = self.covariance(start, &parts, banded, model_error);
        let model = &design * DVector::from_column_slice(&fit.squares);
        let chi_square = chi_square(&square, &model, &points)?;
        let estimator = fit.estimator;
        Some(Solved {
            start,
            squares: fit.squares,
            fitted: fit.columns,
            covariance: &estimator * &points * estimator.transpose(),
            markov_s,
            walk: None,
            flat_gain: f64::INFINITY,
            estimator,
            points,
            model_error,
            chi_square,
            dof,
            p: 1.0 - stats::chi_square_probability(chi_square, dof as f64),
        })
    }

    fn covariance(&self, start: usize, parts: &[Parts], banded: bool, model_error: f64) -> DMatrix<f64> {
        let mut covariance = self.scatter.covariance(start, parts);
        if banded {
            let memory = &self.memory[start..];
            covariance = covariance.map_with_location(|a, b, c| c * memory[a] * memory[b]);
        }
        for (r, parts) in parts[start..].iter().enumerate() {
            // The relative error of a squared deviation is twice that of the deviation.
            covariance[(r, r)] += (2.0 * model_error * parts.iter().sum::<f64>()).powi(2);
        }
        covariance
    }
}

/// Rounds of reweighting, and the round that chooses the terms: before it all terms take part, after it only the chosen
/// ones.
const ROUNDS: usize = 9;
const CHOICE: usize = 3;

impl Solved {
    /// Whether a memory of the sensor was fitted, of either sign.
    pub(super) fn memory(&self) -> bool {
        self.start > 0 || self.squares[Q] < 0.0
    }

    /// Whether the first points lack what the memory adds behind them. A low-pass only takes off.
    pub(super) fn adds(&self) -> bool {
        self.start > 0 && self.odds(Q).is_some_and(|odds| odds >= QUANTISATION)
    }

    /// The rest of the memory of a low-pass of the first order at the first point used, in standard deviations of that
    /// point. Its coefficient a from sample to sample follows from the deviation at one sample: the low-pass leaves
    /// `(1 - a)^2 / (1 + a)` of white noise there. At m samples it leaves `1 - 3 c / 2 m` with `c = 2 a / (1 - a^2)`,
    /// and `2 c a^m / m` until it is over.
    fn remembers(&self, curve: &DeviationCurve) -> f64 {
        let (Some(dt_s), Some(first)) = (curve.tau_s.first(), curve.square.first()) else { return 0.0 };
        let left = first * dt_s / self.squares[N];
        if self.squares[N] <= 0.0 || left >= 1.0 {
            return 0.0;
        }
        let a = (2.0 + left - (left * (left + 8.0)).sqrt()) / 2.0;
        let (c, m) = (2.0 * a / (1.0 - a * a), curve.tau_s[self.start] / dt_s);
        // The memory of a slower low-pass would take off more than there is.
        let level = (1.0 - 1.5 * c / m).max(0.0);
        2.0 * c * a.powf(m) / m / level * self.model(curve.tau_s[self.start]) / self.points[(0, 0)].sqrt()
    }

    fn row(&self, term: usize) -> Option<usize> {
        self.fitted.iter().position(|f| *f == term)
    }

    /// A square over its standard deviation.
    fn odds(&self, term: usize) -> Option<f64> {
        self.sd(term).map(|sd| self.squares[term] / sd)
    }

    /// Standard deviation of the square of a coefficient.
    fn sd(&self, term: usize) -> Option<f64> {
        self.row(term).map(|row| self.covariance[(row, row)].max(0.0).sqrt())
    }

    /// Square of a coefficient and its standard deviation, as they are given.
    pub(super) fn given(&self, term: usize) -> Option<(f64, f64)> {
        let walk = self.walk.filter(|_| term == N);
        walk.or_else(|| self.sd(term).map(|sd| (self.squares[term], sd)))
    }

    /// Largest share of the fitted square that a term has at an averaging time used.
    pub(super) fn share(&self, term: usize, tau_s: &[f64]) -> f64 {
        tau_s[self.start..].iter().map(|t| self.part(term, *t)).fold(0.0, f64::max)
    }

    /// The square of the coefficient over the square that chance gives where the term is absent.
    pub(super) fn over_chance(&self, term: usize, tau_s: &[f64]) -> Option<f64> {
        let row = self.row(term)?;
        let weights = DVector::from_fn(self.estimator.ncols(), |r, _| {
            self.estimator[(row, r)] * (1.0 - self.part(term, tau_s[self.start + r])).max(0.0)
        });
        let chance = (weights.transpose() * &self.points * &weights)[0].max(0.0).sqrt();
        Some(self.squares[term] / chance)
    }

    fn part(&self, term: usize, tau_s: f64) -> f64 {
        self.squares[term] * terms(tau_s, self.markov_s)[term] / self.model(tau_s)
    }

    /// Fitted square at an averaging time.
    pub(super) fn model(&self, tau_s: f64) -> f64 {
        terms(tau_s, self.markov_s).iter().zip(self.squares).map(|(t, s)| t * s).sum()
    }

    /// Parts of the noises in the fitted square at an averaging time.
    pub(super) fn parts(&self, tau_s: f64) -> Parts {
        parts(&self.squares, tau_s, self.markov_s)
    }
}

/// Parts of the noises in the fitted square. A band limit reduces white noise; a ramp counts as a walk, which scatters
/// most. A Gauss-Markov noise is a walk below its correlation time and white above it.
fn parts(squares: &[f64; TERMS], tau_s: f64, markov_s: f64) -> Parts {
    let t = terms(tau_s, markov_s);
    let of = |term: usize| t[term] * squares[term];
    let x2 = if markov_s > 0.0 { (tau_s / markov_s).powi(2) } else { 0.0 };
    let white = x2 / (x2 + TURN);
    let walk = of(K) + of(R) + of(G) * (1.0 - white);
    [of(Q).max(0.0), of(N) + of(G) * white + of(Q).min(0.0), of(B), walk]
}

/// Square of the averaging time, in correlation times, at which a Gauss-Markov noise turns from walk to white: that of the
/// frequency to which the Allan window answers most, `1 / (2 tau)`, against the corner `1 / (2 pi T)`.
const TURN: f64 = std::f64::consts::PI * std::f64::consts::PI;

/// Chi-square of the points about the model. A squared deviation of few degrees of freedom is far from normal, but its
/// cube root is nearly normal (Wilson and Hilferty 1931).
fn chi_square(square: &DVector<f64>, model: &DVector<f64>, covariance: &DMatrix<f64>) -> Option<f64> {
    let n = square.len();
    let sd: Vec<f64> = (0..n).map(|r| covariance[(r, r)].sqrt()).collect();
    let z = DVector::from_fn(n, |r, _| {
        let a = (sd[r] / model[r]).powi(2) / 9.0;
        ((square[r] / model[r]).cbrt() - (1.0 - a)) / a.sqrt()
    });
    let correlation = DMatrix::from_fn(n, n, |a, b| covariance[(a, b)] / (sd[a] * sd[b]));
    let solved = correlation.cholesky()?.solve(&z);
    Some(z.dot(&solved)).filter(|c| c.is_finite())
}

/// Columns of the terms that may take part.
fn allowed(banded: bool, markov_s: f64) -> Vec<usize> {
    (usize::from(!banded)..if markov_s > 0.0 { TERMS } else { G }).collect()
}

/// A fit with some of the terms.
struct Constrained {
    /// Weighted sum of squares, and the cost of its terms.
    cost: f64,
    squares: [f64; TERMS],
    columns: Vec<usize>,
    estimator: DMatrix<f64>,
}

impl Constrained {
    /// The fit with the least cost.
    fn fit(
        design: &DMatrix<f64>,
        square: &DVector<f64>,
        covariance: &DMatrix<f64>,
        allowed: &[usize],
        cost: f64,
    ) -> Option<Self> {
        Self::all(design, square, covariance, allowed, cost)?.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// Least squares with a solution >= 0, for every subset of the columns that has one. Q is the exception: it may
    /// have either sign and is always fitted where it is allowed. With five columns this is the plainest way.
    fn all(
        design: &DMatrix<f64>,
        square: &DVector<f64>,
        covariance: &DMatrix<f64>,
        allowed: &[usize],
        cost: f64,
    ) -> Option<Vec<Self>> {
        let lower = covariance.clone().cholesky()?.l();
        let white = |m: &DMatrix<f64>| lower.solve_lower_triangular(m);
        let (whitened, data) =
            (white(design)?, white(&DMatrix::from_column_slice(square.len(), 1, square.as_slice()))?);
        let mut fits = Vec::new();
        for subset in 1_u32..1 << allowed.len() {
            let columns: Vec<usize> =
                allowed.iter().enumerate().filter(|(bit, _)| subset & (1 << bit) != 0).map(|(_, c)| *c).collect();
            if columns.len() > square.len() || (allowed.contains(&Q) && !columns.contains(&Q)) {
                continue;
            }
            let part = whitened.select_columns(&columns);
            let Ok(fit) = linear::least_squares("noise coefficients", &part, &data) else { continue };
            let cost = fit.residuals.norm_squared() + cost * columns.len() as f64;
            let allowed = columns.iter().zip(fit.solution.iter()).all(|(c, s)| *c == Q || *s >= 0.0);
            if !allowed {
                continue;
            }
            let mut solution = [0.0; TERMS];
            columns.iter().zip(fit.solution.iter()).for_each(|(c, s)| solution[*c] = *s);
            if (0..design.nrows()).any(|r| (0..TERMS).map(|c| design[(r, c)] * solution[c]).sum::<f64>() <= 0.0) {
                continue;
            }
            // The rows act on whitened data, which are `lower^-1` times the squared deviations.
            let estimator = (lower.tr_solve_lower_triangular(&(part * fit.cofactor))?).transpose();
            fits.push(Self { cost, squares: solution, columns, estimator });
        }
        Some(fits)
    }

    /// Before the first point of a fit there is no curve, so the parts there come from the points themselves.
    fn parts(&self, tau_s: f64, square: f64, markov_s: f64) -> Parts {
        let parts = parts(&self.squares, tau_s, markov_s);
        if parts.iter().all(|p| *p >= 0.0) { parts } else { [0.0, square, 0.0, 0.0] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks the definition: half the mean square of the difference of two neighbouring means, with the covariance
    /// `e^-|t|` of the noise summed over a fine grid.
    #[test]
    fn deviation_of_a_gauss_markov_noise() {
        for (tau_s, markov_s) in [(0.02, 3.0), (1.0, 3.0), (6.0, 3.0), (100.0, 3.0)] {
            let cells = 400;
            let weight = |k: i32| if k < cells { -1.0 } else { 1.0 } / f64::from(cells);
            let sum: f64 = (0..2 * cells)
                .flat_map(|a| (0..2 * cells).map(move |b| (a, b)))
                .map(|(a, b)| {
                    let apart_s = f64::from((a - b).abs()) * tau_s / f64::from(cells);
                    weight(a) * weight(b) * (-apart_s / markov_s).exp()
                })
                .sum();
            let found = markov(tau_s, markov_s);
            assert!((found / (sum / 2.0) - 1.0).abs() < 0.01, "{tau_s}: {found} {}", sum / 2.0);
        }
        // Both forms of the sum meet where the code changes from one to the other.
        assert!((markov(0.01 - 1e-9, 1.0) / markov(0.01 + 1e-9, 1.0) - 1.0).abs() < 1e-6);
    }
}
