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

/// A term must carry this part of the variance at some averaging time to be called seen.
const SEEN: f64 = 0.5;

/// Weighted non-negative fit of the squared deviations. Weights come from the fitted curve and the degrees of freedom of
/// each point, so that points that happen to be low do not weigh more.
pub(super) fn fit(points: &[Point]) -> Coefficients {
    let usable: Vec<&Point> = points.iter().filter(|p| p.edf.is_finite() && p.edf > 0.5 && p.dev > 0.0).collect();
    let b_upper_bound = usable.iter().map(|p| p.dev / FLAT).reduce(f64::min);
    let mut coefficients = Coefficients { b_upper_bound, ..Coefficients::default() };
    if usable.len() < 2 {
        return coefficients;
    }
    let terms = |tau: f64| [3.0 / (tau * tau), 1.0 / tau, FLAT * FLAT, tau / 3.0, tau * tau / 2.0];
    let mut model: Vec<f64> = usable.iter().map(|p| p.dev * p.dev).collect();
    let mut solution = [0.0; 5];
    let mut free = Vec::new();
    let mut cofactor = DMatrix::zeros(0, 0);
    let mut design = DMatrix::zeros(0, 0);
    for _ in 0..20 {
        // Variance of a variance: 2 s^4 / edf.
        let sigma: Vec<f64> = model.iter().zip(&usable).map(|(s2, p)| s2 * (2.0 / p.edf).sqrt()).collect();
        design = DMatrix::from_fn(usable.len(), 5, |r, c| terms(usable[r].tau_s)[c] / sigma[r]);
        let data = DVector::from_fn(usable.len(), |r, _| usable[r].dev.powi(2) / sigma[r]);
        (solution, free, cofactor) = non_negative(&design, &data);
        let before = model.clone();
        model = usable.iter().map(|p| terms(p.tau_s).iter().zip(solution).map(|(t, s)| t * s).sum()).collect();
        if model.iter().zip(&before).all(|(a, b)| (a / b - 1.0).abs() < 1e-9) {
            break;
        }
    }
    // Neighbouring deviations share their samples: covariance of the solution with correlated data.
    let weighted = design.select_columns(&free) * &cofactor;
    let correlated = DMatrix::from_fn(usable.len(), usable.len(), |a, b| correlation(usable[a], usable[b]));
    let covariance = weighted.transpose() * correlated * &weighted;
    let mut found = [None; 5];
    for (row, &c) in free.iter().enumerate() {
        let share = usable.iter().zip(&model).map(|(p, s2)| terms(p.tau_s)[c] * solution[c] / s2).fold(0.0, f64::max);
        let sd: f64 = covariance[(row, row)];
        let sd = sd.max(0.0).sqrt();
        if share >= SEEN && solution[c] > 2.0 * sd {
            let (low, high) = ((solution[c] - sd).max(0.0).sqrt(), (solution[c] + sd).sqrt());
            found[c] = Some(Coefficient { value: solution[c].sqrt(), low, high });
        }
    }
    [coefficients.q, coefficients.n, coefficients.b, coefficients.k, coefficients.r] = found;
    coefficients
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
fn non_negative(design: &DMatrix<f64>, data: &DVector<f64>) -> ([f64; 5], Vec<usize>, DMatrix<f64>) {
    let mut best = ([0.0; 5], Vec::new(), DMatrix::zeros(0, 0));
    let mut best_squares = f64::INFINITY;
    for subset in 1_u32..32 {
        let columns: Vec<usize> = (0..5).filter(|c| subset & (1 << c) != 0).collect();
        if columns.len() > design.nrows() {
            continue;
        }
        let data = DMatrix::from_column_slice(data.len(), 1, data.as_slice());
        let Ok(fit) = linear::least_squares("noise coefficients", &design.select_columns(&columns), &data) else {
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
