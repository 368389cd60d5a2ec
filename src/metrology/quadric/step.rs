//! A centre that moves within a record, because iron is moved or magnetised while the module turns.

use nalgebra::{SMatrix, SVector};

use crate::Refusal;

/// Number of equal parts of a record. The record is divided between two of them.
const PARTS: usize = 8;
/// Least eigenvalue of the mean `u u'` of a part, times the dimension. Below it a part does not show its own centre.
const SEEN: f64 = 0.3;

/// Refuses a record whose first and second part have centres farther apart than `limit` of the radius. `unit` returns a
/// corrected point over the radius, whose length is 1 on the surface; the check leaves out spikes.
pub(crate) fn check<const D: usize>(
    rows: usize,
    shape: &'static str,
    limit: f64,
    unit: impl Fn(usize) -> SVector<f64, D>,
) -> Result<(), Refusal> {
    let mut sums = [(SMatrix::<f64, D, D>::zeros(), SVector::<f64, D>::zeros(), 0.0); PARTS];
    for row in 0..rows {
        let point = unit(row);
        let length = point.norm();
        if (0.5..1.5).contains(&length) {
            let u = point / length;
            let sum = &mut sums[row * PARTS / rows];
            sum.0 += u * u.transpose();
            sum.1 += u * (length - 1.0);
            sum.2 += 1.0;
        }
    }
    // Least squares of `length - 1 = u' centre` over a part of the record.
    let centre = |parts: &[(SMatrix<f64, D, D>, SVector<f64, D>, f64)]| {
        let mut sum = (SMatrix::<f64, D, D>::zeros(), SVector::<f64, D>::zeros(), 0.0);
        parts.iter().for_each(|part| sum = (sum.0 + part.0, sum.1 + part.1, sum.2 + part.2));
        let decomposed = nalgebra::DMatrix::from_fn(D, D, |r, c| sum.0[(r, c)] / sum.2);
        let seen = nalgebra::SymmetricEigen::new(decomposed).eigenvalues.min() * D as f64;
        (sum.2 > 20.0 && seen > SEEN).then(|| sum.0.try_inverse().map(|inverse| inverse * sum.1)).flatten()
    };
    let moved = (1..PARTS).filter_map(|k| Some((k, (centre(&sums[k..])? - centre(&sums[..k])?).norm())));
    match moved.max_by(|a, b| a.1.total_cmp(&b.1)) {
        Some((k, ratio)) if ratio > limit => Err(Refusal::CentreMoves {
            shape,
            row: (k * rows).div_ceil(PARTS) + 1,
            percent: 100.0 * ratio,
            limit_percent: 100.0 * limit,
        }),
        _ => Ok(()),
    }
}

/// Refuses points that lie farther from the surface than `limit` of its radius, root mean square.
pub(crate) fn near(shape: &'static str, ratio: f64, limit: f64) -> Result<(), Refusal> {
    if ratio <= limit {
        return Ok(());
    }
    Err(Refusal::Residual { shape, percent: 100.0 * ratio, limit_percent: 100.0 * limit })
}
