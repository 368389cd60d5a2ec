//! Values that replace rows left out of a series, so that the other rows keep their times.

use std::ops::Range;

use super::RowFault;
use super::smoother::{STRIDE, Smoother};
use crate::{Refusal, quantisation, stats};

/// Part of the noise of a sum that one bridge may leave open.
const BENT: f64 = 0.25;
/// Rows beside a hole that show its level.
const BESIDE: usize = 16;
/// Rows from which the correlation of neighbours is learned.
const LEARN: usize = 1 << 16;
/// Part of the squared error of the nearest neighbours below which more neighbours predict much better. A line near a
/// quarter of the rate with six tenths of the deviation of the noise lies there.
const CLOSER: f64 = 0.8;
/// Number of errors that gives their mean square to 3 %.
const SQUARES: usize = 2048;

/// Runs of rows that are left out, within their blocks.
fn holes(faults: &[Option<RowFault>], block: &Range<usize>) -> Vec<Range<usize>> {
    let mut holes = Vec::new();
    let mut row = block.start;
    while row < block.end.min(faults.len()) {
        if faults[row].is_none() {
            row += 1;
            continue;
        }
        let start = row;
        while row < block.end.min(faults.len()) && faults[row].is_some() {
            row += 1;
        }
        holes.push(start..row);
    }
    holes
}

/// Checks that at every hole the lines through both sides meet within the noise of a block's sum.
pub(super) fn unbent(
    name: &str,
    values: &[f64],
    faults: &[Option<RowFault>],
    blocks: &[Range<usize>],
) -> Result<(), Refusal> {
    for block in blocks {
        let holes = holes(faults, block);
        if holes.is_empty() {
            continue;
        }
        // Noise below a step leaves most neighbours equal. Then its noise is the rounding.
        let values_of_block = &values[block.clone()];
        let rounding = quantisation::least_step(values_of_block, 0.0).unwrap_or(0.0) / 12.0_f64.sqrt();
        let noise = stats::median_step(values_of_block).max(rounding) * (block.len() as f64).sqrt();
        for hole in holes {
            let slope = |from: usize| {
                let other = from + 1;
                let inside = block.contains(&from) && block.contains(&other);
                (inside && faults[from].is_none() && faults[other].is_none()).then(|| values[other] - values[from])
            };
            let left = hole.start.checked_sub(2).and_then(slope);
            let (Some(left), Some(right)) = (left, slope(hole.end)) else { continue };
            // Half of the gap that the slopes leave open, in each row of the hole.
            let open = (left - right).abs() / 2.0 * hole.len() as f64;
            if open > BENT * noise {
                return Err(Refusal::Unbridged { channel: name.to_owned(), row: hole.start + 1, open, noise });
            }
        }
    }
    Ok(())
}

/// A series in which the line between the neighbours fills each hole; where there is only one neighbour, its value.
pub(super) fn bridge(values: &[f64], faults: &[Option<RowFault>], blocks: &[Range<usize>]) -> Vec<f64> {
    let mut mended = values.to_vec();
    for block in blocks {
        for hole in holes(faults, block) {
            let left = (hole.start > block.start).then(|| values[hole.start - 1]);
            let right = (hole.end < block.end).then(|| values[hole.end]);
            let (Some(left), Some(right)) = (left.or(right), right.or(left)) else { continue };
            let length = (hole.len() + 1) as f64;
            for (step, row) in hole.enumerate() {
                mended[row] = left + (right - left) * (step + 1) as f64 / length;
            }
        }
    }
    mended
}

/// A series in which each hole holds the prediction of its neighbours and an error that this prediction has elsewhere
/// in the record. A line alone would take its share of noise out of every deviation and density. With the correlations
/// of the record, the new values vary as the values that they replace.
///
/// The prediction uses the nearest neighbours and the level beside a hole. It uses more neighbours on both sides where
/// these predict much better, as beside vibration or behind a low-pass.
pub(super) fn refill(values: &[f64], faults: &[Option<RowFault>], blocks: &[Range<usize>]) -> Vec<f64> {
    let mut mended = bridge(values, faults, blocks);
    for block in blocks {
        let holes = holes(faults, block);
        if holes.is_empty() {
            continue;
        }
        let nearest = Nearest::learn(values, faults, block);
        nearest.refill(&mut mended, &holes);
        if let Some(smoother) = Smoother::learn(values, faults, block, nearest.mean)
            && smoother.square() < CLOSER * nearest.square()
        {
            smoother.refill(&mut mended, &holes, block);
        }
    }
    mended
}

/// The prediction of a value between two neighbours l and r: `m + a (l + r - 2 m)` with `a = r1 / (1 + r2)`, where r1,
/// r2 are the correlations of rows one and two apart. m is the level beside the value: `M + b (L - M)`, with the mean M
/// of the block, the mean L of the rows beside, and the regression b of a value on L. White noise has b = 0. With b = 1
/// the value would follow its neighbours and raise every deviation at longer times.
struct Nearest<'a> {
    values: &'a [f64],
    faults: &'a [Option<RowFault>],
    block: &'a Range<usize>,
    weight: f64,
    mean: f64,
    slope: f64,
}

impl<'a> Nearest<'a> {
    fn learn(values: &'a [f64], faults: &'a [Option<RowFault>], block: &'a Range<usize>) -> Self {
        let (mean, slope) = regression(values, faults, block);
        Self { values, faults, block, weight: weight(values, faults, block), mean, slope }
    }

    /// The level that the rows beside some rows give for these.
    fn level(&self, rows: Range<usize>) -> f64 {
        self.mean + self.slope * (mean_beside(self.values, self.faults, self.block, rows) - self.mean)
    }

    fn between(&self, level: f64, left: f64, right: f64) -> f64 {
        level + self.weight * (left + right - 2.0 * level)
    }

    /// Errors of the prediction at rows with sound neighbours, taken in turn. No period of the record is likely to
    /// share the stride.
    fn errors(&self) -> impl FnMut() -> f64 {
        let Self { values, block, .. } = *self;
        let sound = |row: usize| block.contains(&row) && self.faults[row].is_none();
        let mut donor = block.start;
        move || {
            for _ in 0..block.len() {
                donor = block.start + (donor - block.start + STRIDE) % block.len();
                if donor > block.start && sound(donor - 1) && sound(donor) && sound(donor + 1) {
                    let level = self.level(donor..donor + 1);
                    return values[donor] - self.between(level, values[donor - 1], values[donor + 1]);
                }
            }
            0.0
        }
    }

    /// Mean square of some errors.
    fn square(&self) -> f64 {
        let mut error = self.errors();
        (0..SQUARES).map(|_| error().powi(2)).sum::<f64>() / SQUARES as f64
    }

    fn refill(&self, mended: &mut [f64], holes: &[Range<usize>]) {
        let mut error = self.errors();
        for hole in holes {
            let level = self.level(hole.clone());
            for row in hole.clone() {
                let left = if row > self.block.start { mended[row - 1] } else { level };
                let right = if hole.end < self.block.end { self.values[hole.end] } else { level };
                mended[row] = self.between(level, left, right) + error();
            }
        }
    }
}

/// Mean of the sound rows beside a hole.
fn mean_beside(values: &[f64], faults: &[Option<RowFault>], block: &Range<usize>, hole: Range<usize>) -> f64 {
    let left = (block.start..hole.start).rev().filter(|row| faults[*row].is_none()).take(BESIDE);
    let right = (hole.end..block.end).filter(|row| faults[*row].is_none()).take(BESIDE);
    let beside: Vec<f64> = left.chain(right).map(|row| values[row]).collect();
    if beside.is_empty() { values[hole.start] } else { stats::mean(&beside) }
}

/// Mean of the sound rows, and the regression of a row on the mean of the rows beside it, between 0 and 1.
fn regression(values: &[f64], faults: &[Option<RowFault>], block: &Range<usize>) -> (f64, f64) {
    let rows = block.start..block.end.min(block.start + LEARN);
    let sound: Vec<f64> = block.clone().filter(|row| faults[*row].is_none()).map(|row| values[row]).collect();
    if sound.is_empty() {
        return (values[block.start], 0.0);
    }
    let mean = stats::mean(&sound);
    // Sums of the values and numbers of the faults up to a row.
    let mut sums = vec![(0.0, 0_usize)];
    for row in rows.clone() {
        let (sum, bad) = sums[sums.len() - 1];
        // A row that is left out adds nothing, since a large word would take the digits of all sums behind it.
        let is_bad = faults[row].is_some();
        sums.push((sum + if is_bad { 0.0 } else { values[row] - mean }, bad + usize::from(is_bad)));
    }
    let (mut squares, mut products) = (0.0, 0.0);
    for row in BESIDE..rows.len().saturating_sub(BESIDE) {
        let ((from, bad_before), (to, bad)) = (sums[row - BESIDE], sums[row + BESIDE + 1]);
        if bad == bad_before {
            let own = values[rows.start + row] - mean;
            let beside = (to - from - own) / (2 * BESIDE) as f64;
            squares += beside * beside;
            products += beside * own;
        }
    }
    // A block too short for a regression takes the level of the rows beside.
    (mean, if squares > 0.0 { (products / squares).clamp(0.0, 1.0) } else { 1.0 })
}

/// `r1 / (1 + r2)`, from rows about the mean of their piece.
fn weight(values: &[f64], faults: &[Option<RowFault>], block: &Range<usize>) -> f64 {
    const PIECE: usize = 4 * BESIDE;
    let rows = block.start..block.end.min(block.start + LEARN);
    let (mut squares, mut one, mut two) = (0.0, 0.0, 0.0);
    let mut start = rows.start;
    while start < rows.end {
        let piece = start..(start + PIECE).min(rows.end);
        start = piece.end;
        if piece.len() < 3 || faults[piece.clone()].iter().any(Option::is_some) {
            continue;
        }
        let mean = stats::mean(&values[piece.clone()]);
        for triple in values[piece].windows(3) {
            let [a, b, c] = [triple[0] - mean, triple[1] - mean, triple[2] - mean];
            squares += b * b;
            one += f64::midpoint(a * b, b * c);
            two += a * c;
        }
    }
    if squares <= 0.0 {
        return 0.0;
    }
    (one / squares / (1.0 + two / squares).max(0.1)).clamp(-0.5, 0.5)
}
