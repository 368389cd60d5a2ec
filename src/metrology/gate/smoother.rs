//! A prediction of a row from the rows on both sides, learned from the record itself: lines such as vibration, a
//! low-pass, and slow wander.

use std::ops::Range;

use nalgebra::{SMatrix, SVector};

use super::RowFault;

/// Rows on each side.
pub(super) const SIDE: usize = 16;
/// Rows from which the prediction is learned, and how many of them lie together.
const LEARN: usize = 1 << 16;
const TOGETHER: usize = 1 << 10;
/// Least number of rows to learn from: 64 for each weight.
const FEWEST: usize = 64 * SIDE;
/// Longest hole. In longer ones nearly all neighbours are holes.
const LONGEST: usize = 4 * SIDE;
/// Rounds in which holes take each other into account.
const ROUNDS: usize = 16;
/// Stride through the errors. It is a large prime, so that no period of a record is likely to share it.
pub(super) const STRIDE: usize = 7919;
/// Part of the largest square that is added to all of them, so that a record without noise gives weights.
const RIDGE: f64 = 1e-12;

/// Least squares of a row on the sums of the two rows `1 .. SIDE` before and behind it, all about the mean.
pub(super) struct Smoother {
    mean: f64,
    weights: SVector<f64, SIDE>,
    /// Errors of the prediction in the rows from which it is learned.
    errors: Vec<f64>,
}

impl Smoother {
    /// `None` where too few rows have sound neighbours.
    pub(super) fn learn(values: &[f64], faults: &[Option<RowFault>], block: &Range<usize>, mean: f64) -> Option<Self> {
        let rows = rows(faults, block);
        if rows.len() < FEWEST {
            return None;
        }
        let mut squares = SMatrix::<f64, SIDE, SIDE>::zeros();
        let mut products = SVector::<f64, SIDE>::zeros();
        for row in &rows {
            let sums = sums(values, *row, mean);
            squares += sums * sums.transpose();
            products += sums * (values[*row] - mean);
        }
        let ridge = RIDGE * squares.diagonal().max();
        (0..SIDE).for_each(|at| squares[(at, at)] += ridge);
        let weights = squares.cholesky()?.solve(&products);
        let error = |row: &usize| values[*row] - mean - weights.dot(&sums(values, *row, mean));
        let mut errors: Vec<f64> = rows.iter().map(error).collect();
        if errors.len().is_multiple_of(STRIDE) {
            // A multiple of the stride would make the walk come back to a few errors.
            errors.pop();
        }
        Some(Self { mean, weights, errors })
    }

    /// Mean square of the errors.
    pub(super) fn square(&self) -> f64 {
        self.errors.iter().map(|error| error * error).sum::<f64>() / self.errors.len() as f64
    }

    /// Fills the holes with the prediction, each row with an error of the prediction.
    ///
    /// A hole may lie beside other holes. Each hole is drawn in turn about the present values of the others; after some
    /// rounds this draws all of them from their common distribution (Gibbs' sampler; Geman and Geman 1984).
    pub(super) fn refill(&self, mended: &mut [f64], holes: &[Range<usize>], block: &Range<usize>) {
        let mut at = 0;
        let inner = block.start + SIDE..block.end.saturating_sub(SIDE);
        for _ in 0..ROUNDS {
            for hole in holes.iter().filter(|hole| hole.len() <= LONGEST) {
                for row in hole.clone().filter(|row| inner.contains(row)) {
                    at = (at + STRIDE) % self.errors.len();
                    mended[row] = self.mean + self.weights.dot(&sums(mended, row, self.mean)) + self.errors[at];
                }
            }
        }
    }
}

/// Sums of the two rows one, two ... before and behind a row, about a mean.
fn sums(values: &[f64], row: usize, mean: f64) -> SVector<f64, SIDE> {
    SVector::from_fn(|at, _| values[row - 1 - at] - mean + (values[row + 1 + at] - mean))
}

/// Rows with sound neighbours on both sides, from all over a block.
fn rows(faults: &[Option<RowFault>], block: &Range<usize>) -> Vec<usize> {
    let stretches = if block.len() <= LEARN { block.len().div_ceil(TOGETHER) } else { LEARN / TOGETHER };
    let mut rows = Vec::new();
    for stretch in 0..stretches {
        let from = block.start + stretch * block.len() / stretches;
        let to = (from + TOGETHER).min(block.start + (stretch + 1) * block.len() / stretches);
        let inner = from.max(block.start + SIDE)..to.min(block.end.saturating_sub(SIDE));
        rows.extend(inner.filter(|row| faults[row - SIDE..=row + SIDE].iter().all(Option::is_none)));
    }
    rows
}
