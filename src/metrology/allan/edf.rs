//! Equivalent degrees of freedom.
//!
//! C. A. Greenhall and W. J. Riley, *Uncertainty of Stability Variances Based on Finite Differences* (2003), for all but
//! the total variance; NIST SP 1065, table 7, for that.

use super::{DeviationKind, PowerLawNoise};

/// Terms up to which the sums are carried out.
const J_MAX: f64 = 100.0;

/// Equivalent degrees of freedom of a variance at averaging factor `m` from a number of phases.
pub(super) fn edf(kind: DeviationKind, noise: PowerLawNoise, m: usize, phases: usize) -> f64 {
    // Beyond the exponents for which the variance converges, its chi-square does not exist; the nearest exponent takes
    // their place.
    let alpha = if kind.order() == 3 { noise.alpha() } else { noise.alpha().max(-2) };
    let ratio = (phases - 1) as f64 / m as f64;
    if let (DeviationKind::Totdev, Some(&(b, c))) = (kind, TOTAL.get(usize::try_from(-alpha).unwrap_or(usize::MAX)))
        && ratio < TOTAL_RATIO
    {
        return b * ratio - c;
    }
    let overlapping =
        matches!(kind, DeviationKind::Oadev | DeviationKind::Ohdev | DeviationKind::Mdev | DeviationKind::Totdev);
    let modified = kind == DeviationKind::Mdev;
    Filter { alpha, d: kind.order(), m: m as f64, modified, overlapping }.edf(phases as f64)
}

/// Above this T / tau the total variance counts as the overlapping Allan variance, since the ends that it adds no
/// longer matter. (The formula of the table goes on to more degrees of freedom than there are samples.) The two meet
/// within 5 % here.
const TOTAL_RATIO: f64 = 16.0;

/// `edf = b T / tau - c` of the total variance for alpha 0, -1, -2 (SP 1065, table 7).
const TOTAL: [(f64, f64); 3] = [(1.50, 0.0), (1.17, 0.22), (0.93, 0.36)];

/// Expected total variance over the Allan variance, `1 - a tau / T` (SP 1065).
pub(super) fn total_bias(kind: DeviationKind, noise: Option<PowerLawNoise>, m: usize, phases: usize) -> f64 {
    let a = match (kind, noise) {
        (DeviationKind::Totdev, Some(PowerLawNoise::FlickerRate)) => 1.0 / (3.0 * std::f64::consts::LN_2),
        (DeviationKind::Totdev, Some(PowerLawNoise::RateRandomWalk)) => 0.75,
        _ => 0.0,
    };
    1.0 - a * m as f64 / (phases - 1) as f64
}

struct Filter {
    alpha: i32,
    /// Order of the difference.
    d: usize,
    m: f64,
    modified: bool,
    overlapping: bool,
}

impl Filter {
    fn edf(&self, phases: f64) -> f64 {
        let (m, d) = (self.m, self.d as f64);
        let f = if self.modified { 1.0 } else { m };
        let s = if self.overlapping { m } else { 1.0 };
        let count = 1.0 + (s * (phases - (m / f + m * d)) / m).floor();
        let terms = count.min((d + 1.0) * s);
        let r = count / s;
        let inverse = if self.modified {
            if terms <= J_MAX {
                self.sum(terms, count, s, 1.0)
            } else if r > d + 1.0 {
                long(self.table1(), r)
            } else {
                self.sum(J_MAX, J_MAX, J_MAX / r, 1.0)
            }
        } else if self.alpha <= 0 {
            if terms <= J_MAX {
                // With a long filter the phase is as good as continuous. The phase of white rate is a sum of
                // independent samples at any length. The paper smooths it as well, which would give 17 % too many
                // degrees of freedom at one sample.
                let smooth = self.alpha < 0 && m * (d + 1.0) <= J_MAX;
                self.sum(terms, count, s, if smooth { m } else { f64::INFINITY })
            } else if r > d + 1.0 {
                long(self.table2(), r)
            } else {
                self.sum(J_MAX, J_MAX, J_MAX / r, f64::INFINITY)
            }
        } else if self.alpha == 1 {
            if terms <= J_MAX {
                self.sum(terms, count, s, m)
            } else {
                // Table 3: the variance grows with the logarithm of the filter's length.
                let (b0, b1) = if self.d == 2 { (15.23, 12.0) } else { (47.8, 40.0) };
                let scale = (b0 + b1 * m.ln()).powi(2);
                if r > d + 1.0 {
                    long(self.table2(), r) / scale
                } else {
                    let m_prime = J_MAX / r;
                    self.basic_sum(J_MAX, J_MAX, m_prime, m_prime) / (scale * J_MAX)
                }
            }
        } else {
            self.white_phase(count, r)
        };
        1.0 / inverse
    }

    /// Case 4: white phase noise.
    fn white_phase(&self, count: f64, r: f64) -> f64 {
        let binomial = |n: usize, k: usize| (1..=k).map(|i| (n + 1 - i) as f64 / i as f64).product::<f64>();
        let centre = binomial(2 * self.d, self.d).powi(2);
        let k = r.ceil() as usize;
        if k <= self.d {
            let sum: f64 = (1..k).map(|k| (1.0 - k as f64 / r) * binomial(2 * self.d, self.d - k).powi(2)).sum();
            (1.0 + 2.0 * sum / centre) / count
        } else {
            (binomial(4 * self.d, 2 * self.d) / centre - self.d as f64 / (2.0 * r)) / count
        }
    }

    fn sum(&self, terms: f64, count: f64, s: f64, f: f64) -> f64 {
        self.basic_sum(terms, count, s, f) / (self.sz(0.0, f).powi(2) * count)
    }

    /// Equation 10.
    fn basic_sum(&self, terms: f64, count: f64, s: f64, f: f64) -> f64 {
        let term = |j: f64| (1.0 - j / count) * self.sz(j / s, f).powi(2);
        let middle: f64 = (1..terms as u32).map(|j| 2.0 * term(f64::from(j))).sum();
        term(0.0) + term(terms) + middle
    }

    /// Equation 9: central difference of order 2 d.
    fn sz(&self, t: f64, f: f64) -> f64 {
        let weights: &[f64] = if self.d == 2 { &[6.0, -4.0, 1.0] } else { &[20.0, -15.0, 6.0, -1.0] };
        weights
            .iter()
            .zip([0.0, 1.0, 2.0, 3.0])
            .map(|(w, k)| if k == 0.0 { w * self.sx(t, f) } else { w * (self.sx(t - k, f) + self.sx(t + k, f)) })
            .sum()
    }

    /// Equation 8: averaging over `1 / f`.
    fn sx(&self, t: f64, f: f64) -> f64 {
        if f.is_infinite() {
            return sw(t, self.alpha + 2);
        }
        f * f * (2.0 * sw(t, self.alpha) - sw(t - 1.0 / f, self.alpha) - sw(t + 1.0 / f, self.alpha))
    }

    /// Modified variances, long records: table 1.
    fn table1(&self) -> (f64, f64) {
        match (self.alpha, self.d) {
            (2, 2) => (7.0 / 9.0, 0.5),
            (1, 2) => (0.997, 0.616),
            (0, 2) => (1.033, 0.607),
            (-1, 2) => (1.048, 0.534),
            _ => (1.302, 0.535),
        }
    }

    /// Unmodified variances, long records: table 2.
    fn table2(&self) -> (f64, f64) {
        match (self.alpha, self.d) {
            (1, 2) => (790.0, 410.0),
            (0, 2) => (2.0 / 3.0, 1.0 / 3.0),
            (-1, 2) => (0.852, 0.375),
            (_, 2) => (1.079, 0.368),
            (1, _) => (9950.0, 6520.0),
            (0, _) => (7.0 / 9.0, 0.5),
            (-1, _) => (0.997, 0.617),
            (-2, _) => (1.033, 0.607),
            (-3, _) => (1.053, 0.553),
            _ => (1.302, 0.535),
        }
    }
}

fn long((a0, a1): (f64, f64), r: f64) -> f64 {
    (a0 - a1 / r) / r
}

/// Equation 7: generalised autocovariance of the integrated noise.
fn sw(t: f64, alpha: i32) -> f64 {
    let t = t.abs();
    match alpha {
        2 => -t,
        0 => t.powi(3),
        -2 => t.powi(5),
        -4 => t.powi(7),
        _ if t == 0.0 => 0.0,
        1 => t.powi(2) * t.ln(),
        -1 => t.powi(4) * t.ln(),
        _ => t.powi(6) * t.ln(),
    }
}
