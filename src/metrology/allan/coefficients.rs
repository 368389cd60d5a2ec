//! Noise coefficients from the slopes of an Allan deviation.

use nalgebra::{DMatrix, DVector};

use super::{Noise, Point};
use crate::linear;

/// A coefficient with its 68.3 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficient {
    /// Value.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

/// Coefficients of IEEE Std 952, annex C, for a rate in unit u:
/// `dev^2 = 3 Q^2 / tau^2 + N^2 / tau + (2 ln 2 / pi) B^2 + K^2 tau / 3 + R^2 tau^2 / 2`.
/// `None` where the record does not show the term.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Coefficients {
    /// Quantisation, u s.
    pub q: Option<Coefficient>,
    /// Random walk of the integral (angle, velocity), u sqrt(s): `dev` at 1 s.
    pub n: Option<Coefficient>,
    /// Bias instability, u: flat part / 0.664. Only where a flat part is seen.
    pub b: Option<Coefficient>,
    /// Random walk of the rate, u / sqrt(s): `dev` at 3 s.
    pub k: Option<Coefficient>,
    /// Ramp of the rate, u / s.
    pub r: Option<Coefficient>,
    /// Smallest deviation / 0.664: an upper bound of the bias instability, whether a flat part is seen or not.
    pub b_upper_bound: Option<f64>,
}

/// `sqrt(2 ln 2 / pi)`.
const FLAT: f64 = 0.664_282;

/// A term must carry this part of the variance at some averaging time to be called seen ...
const SEEN: f64 = 0.5;
/// ... and exceed this many times what chance makes of it where it is absent. (Not its own standard deviation: a long
/// averaging time has few degrees of freedom, so that this is always large, though the record may leave no doubt.)
const CHANCE: f64 = 4.0;

/// Coefficients of the five terms of `dev^2`.
fn terms(tau_s: f64) -> [f64; 5] {
    [3.0 / (tau_s * tau_s), 1.0 / tau_s, FLAT * FLAT, tau_s / 3.0, tau_s * tau_s / 2.0]
}

/// Weighted non-negative fit of the squared deviations. A term that the record does not show is left out, the least likely
/// one first, and the rest is fitted again: it would take from a neighbour that is there.
pub(super) fn fit(points: &[Point]) -> Coefficients {
    let usable: Vec<&Point> = points.iter().filter(|p| p.edf.is_finite() && p.edf > 0.5 && p.dev > 0.0).collect();
    let b_upper_bound = usable.iter().map(|p| p.dev / FLAT).reduce(f64::min);
    let mut coefficients = Coefficients { b_upper_bound, ..Coefficients::default() };
    if usable.len() < 2 {
        return coefficients;
    }
    let correlated = DMatrix::from_fn(usable.len(), usable.len(), |a, b| correlation(usable[a], usable[b]));
    let mut allowed = vec![0, 1, 2, 3, 4];
    while !allowed.is_empty() {
        let solved = Solved::of(&usable, &allowed);
        let seen: Vec<Seen> = (0..solved.free.len()).map(|row| solved.seen(row, &usable, &correlated)).collect();
        let least =
            seen.iter().zip(&solved.free).filter(|(s, _)| !s.plain).min_by(|a, b| a.0.odds.total_cmp(&b.0.odds));
        if let Some((_, least)) = least {
            allowed.retain(|c| c != least);
            continue;
        }
        let mut found = [None; 5];
        for (s, &c) in seen.iter().zip(&solved.free) {
            let square = solved.solution[c];
            let (low, high) = ((square - s.sd).max(0.0).sqrt(), (square + s.sd).sqrt());
            found[c] = Some(Coefficient { value: square.sqrt(), low, high });
        }
        [coefficients.q, coefficients.n, coefficients.b, coefficients.k, coefficients.r] = found;
        break;
    }
    coefficients
}

/// A fit with some of the terms.
struct Solved {
    solution: [f64; 5],
    /// Terms above zero.
    free: Vec<usize>,
    /// How each of these follows from the squared deviations, in units of their scatter.
    estimator: DMatrix<f64>,
    /// Fitted squares.
    model: Vec<f64>,
}

/// What speaks for a term.
struct Seen {
    /// Standard deviation of the square of the coefficient.
    sd: f64,
    /// That square over what chance makes of it where it is absent.
    odds: f64,
    plain: bool,
}

impl Solved {
    /// Weights come from the fitted curve and the degrees of freedom of each point, so that points that happen to be low
    /// do not weigh more.
    fn of(points: &[&Point], allowed: &[usize]) -> Self {
        let mut model: Vec<f64> = points.iter().map(|p| p.dev * p.dev).collect();
        let mut solved =
            Self { solution: [0.0; 5], free: Vec::new(), estimator: DMatrix::zeros(0, 0), model: Vec::new() };
        for _ in 0..20 {
            // Variance of a variance: 2 s^4 / edf.
            let sigma: Vec<f64> = model.iter().zip(points).map(|(s2, p)| s2 * (2.0 / p.edf).sqrt()).collect();
            let design = DMatrix::from_fn(points.len(), 5, |r, c| terms(points[r].tau_s)[c] / sigma[r]);
            let data = DMatrix::from_fn(points.len(), 1, |r, _| points[r].dev.powi(2) / sigma[r]);
            let (solution, free, cofactor) = non_negative(&design, &data, allowed);
            let estimator = (design.select_columns(&free) * cofactor).transpose();
            let now: Vec<f64> =
                points.iter().map(|p| terms(p.tau_s).iter().zip(solution).map(|(t, s)| t * s).sum()).collect();
            let settled = now.iter().zip(&model).all(|(a, b)| (a / b - 1.0).abs() < 1e-9);
            model.clone_from(&now);
            solved = Self { solution, free, estimator, model: now };
            // Without a term nothing is left to weigh.
            if settled || model.iter().any(|m| *m <= 0.0) {
                break;
            }
        }
        solved
    }

    /// Neighbouring deviations share their samples, so the data are correlated.
    fn seen(&self, row: usize, points: &[&Point], correlated: &DMatrix<f64>) -> Seen {
        let c = self.free[row];
        let part = |r: usize| terms(points[r].tau_s)[c] * self.solution[c] / self.model[r];
        let spread = |scatter: &dyn Fn(usize) -> f64| -> f64 {
            let w = DVector::from_fn(points.len(), |r, _| self.estimator[(row, r)] * scatter(r));
            (w.transpose() * correlated * &w)[0].max(0.0).sqrt()
        };
        let share = (0..points.len()).map(part).fold(0.0, f64::max);
        let (sd, chance) = (spread(&|_| 1.0), spread(&|r| 1.0 - part(r)));
        let odds = self.solution[c] / chance;
        Seen { sd, odds, plain: share >= SEEN && odds > CHANCE }
    }
}

/// Correlation of two overlapping Allan variances by how many octaves their averaging times are apart; from simulation
/// (1500 records of 4096 samples), white, flicker and random walk of the rate.
fn correlation(a: &Point, b: &Point) -> f64 {
    const WHITE: [f64; 6] = [1.0, 0.52, 0.16, 0.04, 0.02, 0.0];
    const FLICKER: [f64; 6] = [1.0, 0.68, 0.29, 0.11, 0.05, 0.02];
    const WALK: [f64; 6] = [1.0, 0.89, 0.67, 0.47, 0.33, 0.23];
    let table = |p: &Point| match p.noise {
        Some(Noise::FlickerRate) => FLICKER,
        Some(Noise::RateRandomWalk | Noise::FlickerWalk | Noise::RandomRun) => WALK,
        _ => WHITE,
    };
    let octaves = (a.tau_s / b.tau_s).log2().abs();
    let at = |table: [f64; 6]| {
        let k = (octaves as usize).min(5);
        let (low, high) = (table[k], table.get(k + 1).copied().unwrap_or(0.0));
        low + (high - low) * (octaves - k as f64).min(1.0)
    };
    (at(table(a)) * at(table(b))).sqrt()
}

/// Least squares with solution >= 0, over all subsets of the columns: with five of them that is the plainest way, and
/// it finds the optimum. Returns the solution, the free columns and the cofactor of these.
fn non_negative(design: &DMatrix<f64>, data: &DMatrix<f64>, allowed: &[usize]) -> ([f64; 5], Vec<usize>, DMatrix<f64>) {
    let mut best = ([0.0; 5], Vec::new(), DMatrix::zeros(0, 0));
    let mut best_squares = f64::INFINITY;
    for subset in 1_u32..1 << allowed.len() {
        let columns: Vec<usize> =
            allowed.iter().enumerate().filter(|(bit, _)| subset & (1 << bit) != 0).map(|(_, c)| *c).collect();
        if columns.len() > design.nrows() {
            continue;
        }
        let Ok(fit) = linear::least_squares("noise coefficients", &design.select_columns(&columns), data) else {
            continue;
        };
        let squares = fit.residuals.norm_squared();
        if fit.solution.iter().all(|s| *s >= 0.0) && squares < best_squares {
            let mut solution = [0.0; 5];
            columns.iter().zip(fit.solution.iter()).for_each(|(c, s)| solution[*c] = *s);
            best_squares = squares;
            best = (solution, columns, fit.cofactor);
        }
    }
    best
}
