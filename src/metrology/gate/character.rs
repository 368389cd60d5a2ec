//! The character of a channel, piece by piece: step between codes, scale of the noise, whether there is noise at all.

use std::ops::Range;

use super::extremes::Extremes;
use crate::stats::MEDIAN_DIFFERENCE;

/// Rows of a piece.
const PIECE: usize = 2048;
/// Differences that are looked at in a piece, so that its scale is known to a tenth.
const LOOKS: usize = 128;
/// Values from which the step between codes is learned.
const LEARN: usize = 4096;
/// Least share of differences that change their sign in noise. Of independent values two differences in three change
/// their sign, of low-passed ones a tenth at a twentieth of the rate; a smooth motion turns once or twice.
const NOISY: f64 = 0.08;
/// Up to this whole number, differences of whole numbers are exact.
const WHOLE: f64 = 1e15;
/// Least number of differences that show whether there is noise.
const FEWEST: usize = 12;

/// A stretch of a block.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Piece {
    pub(super) rows: Range<usize>,
    /// Position of the block.
    pub(super) block: usize,
    /// Standard deviation of the noise, from the differences.
    pub(super) scale: f64,
    /// The same scale from differences that are not 0, and the number of these.
    pub(super) moving_scale: f64,
    pub(super) moving: usize,
    /// Whether differences change their sign as noise does.
    pub(super) noisy: bool,
    turns: Turns,
}

/// How often differences follow each other, and change their sign.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Turns {
    changes: usize,
    pairs: usize,
    /// Changes to or from a difference of one code.
    of_one_code: usize,
}

impl Turns {
    /// Adds two differences that are both not 0.
    fn add(&mut self, before: f64, after: f64, step: f64) {
        self.pairs += 1;
        if (before < 0.0) != (after < 0.0) {
            self.changes += 1;
            self.of_one_code += usize::from(before.abs().min(after.abs()) < 1.5 * step);
        }
    }

    /// Counts the differences of all rows that move.
    fn of_moving(values: &[f64], step: f64) -> Self {
        let (mut turns, mut before) = (Self::default(), 0.0);
        for pair in values.windows(2).filter(|pair| pair[0] != pair[1]) {
            let difference = pair[1] - pair[0];
            if before != 0.0 {
                turns.add(before, difference, step);
            }
            before = difference;
        }
        turns
    }

    /// Whether the sign mostly changes by a code: noise of a code and less. A ramp has large differences of one sign,
    /// which do not show the noise.
    fn are_of_one_code(self) -> bool {
        const MOSTLY: f64 = 0.8;
        self.of_one_code as f64 > MOSTLY * self.changes as f64
    }

    /// Whether the sign changes as often as that of noise.
    fn are_noise(self) -> bool {
        self.pairs >= FEWEST && self.changes as f64 > NOISY * self.pairs as f64
    }
}

/// One channel.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Character {
    /// Step between codes; 0 where all values are equal.
    pub(super) step: f64,
    pub(super) pieces: Vec<Piece>,
    pub(super) extremes: Extremes,
}

impl Character {
    pub(super) fn of(values: &[f64], blocks: &[Range<usize>]) -> Self {
        let step = step(values);
        let mut pieces = Vec::new();
        let mut extremes = Extremes::default();
        let mut room = Room::default();
        for (block, rows) in blocks.iter().enumerate() {
            let rows = rows.start.min(values.len())..rows.end.min(values.len());
            extremes.begin(rows.start);
            let mut start = rows.start;
            while start < rows.end {
                // The last piece takes the rest, so that every piece is long enough to have a scale.
                let end = if rows.end - start < 2 * PIECE { rows.end } else { start + PIECE };
                // This comes first, since it brings the whole piece into the cache.
                extremes.add(&values[start..end]);
                pieces.push(room.piece(values, start..end, block, step));
                start = end;
            }
        }
        pool(&mut pieces);
        Self { step, pieces, extremes }
    }

    /// Chance that noise gives one code in a row and the same code in the next; 1 where the record does not show it.
    pub(super) fn chance_of_repeat(&self, piece: &Piece) -> f64 {
        // 1 / (2 sqrt pi): two independent normal values within one step.
        self.chance(piece, 0.2821)
    }

    /// Chance that noise gives one certain code; 1 where the record does not show it.
    pub(super) fn chance_of_code(&self, piece: &Piece) -> f64 {
        // 1 / sqrt(2 pi): the density at the centre.
        self.chance(piece, 0.3989)
    }

    fn chance(&self, piece: &Piece, density: f64) -> f64 {
        let coarse = piece.moving_scale * MEDIAN_DIFFERENCE < 1.5 * self.step || piece.turns.are_of_one_code();
        if !piece.noisy || coarse || piece.moving < FEWEST {
            return 1.0;
        }
        (density * self.step / piece.moving_scale).min(1.0)
    }
}

impl Piece {
    /// Whether enough rows of the piece move to show its own scale.
    pub(super) fn speaks(&self) -> bool {
        self.moving >= FEWEST
    }
}

/// Standard deviation of noise, from the differences of neighbours and from those of every third row. The larger one
/// counts, since neighbours behind a low-pass differ by less than the noise.
pub(super) fn scale(values: &[f64]) -> f64 {
    let mut room = Room::default();
    room.scale(values, 1)
}

/// Buffers that are kept between pieces.
#[derive(Default)]
struct Room {
    /// Differences as bits: those of numbers without a sign have the order of the numbers, and are fast to compare.
    differences: Vec<u64>,
}

impl Room {
    fn scale(&mut self, values: &[f64], stride: usize) -> f64 {
        let mut of_lag = |lag: usize| {
            self.differences.clear();
            let pairs = values.iter().zip(values.get(lag..).unwrap_or_default()).step_by(stride);
            self.differences.extend(pairs.map(|(a, b)| (b - a).abs().to_bits()));
            median(&mut self.differences) / MEDIAN_DIFFERENCE
        };
        of_lag(1).max(of_lag(3))
    }

    /// Collects the differences that are not 0.
    fn moving(&mut self, part: &[f64], stride: usize, step: f64) -> Turns {
        self.differences.clear();
        let mut turns = Turns::default();
        for triple in part.windows(3).step_by(stride) {
            let (before, after) = (triple[1] - triple[0], triple[2] - triple[1]);
            if after != 0.0 {
                self.differences.push(after.abs().to_bits());
            } else if before != 0.0 {
                self.differences.push(before.abs().to_bits());
            }
            if before != 0.0 && after != 0.0 {
                turns.add(before, after, step);
            }
        }
        turns
    }

    fn piece(&mut self, values: &[f64], rows: Range<usize>, block: usize, step: f64) -> Piece {
        let part = &values[rows.clone()];
        let stride = part.len().div_ceil(LOOKS).max(1);
        let scale = self.scale(part, stride);
        // An odd stride, so that a pattern of the record does not fall in step with it.
        let stride = if stride > 2 { stride | 1 } else { 1 };
        let mut turning = self.moving(part, stride, step);
        if self.differences.len() < FEWEST && stride > 1 {
            // Where the sensor updates seldom, few of the sampled differences move, and all differences are needed.
            turning = self.moving(part, 1, step);
        }
        let moving = self.differences.len();
        let median = median(&mut self.differences);
        // Where every other row repeats, no two differences follow each other. Then only the rows that move are taken.
        let turns = if turning.pairs >= FEWEST { turning } else { Turns::of_moving(part, step) };
        let noisy = turns.are_noise();
        Piece { rows, block, scale, moving_scale: median / MEDIAN_DIFFERENCE, moving, noisy, turns }
    }
}

/// Median of numbers without a sign, by their bits; 0 when empty.
fn median(bits: &mut [u64]) -> f64 {
    let n = bits.len();
    if n == 0 {
        return 0.0;
    }
    let (below, upper, _) = bits.select_nth_unstable(n / 2);
    let upper = f64::from_bits(*upper);
    if n % 2 == 1 {
        return upper;
    }
    f64::midpoint(below.iter().max().map_or(upper, |lower| f64::from_bits(*lower)), upper)
}

fn common_divisor(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { common_divisor(b, a % b) }
}

/// Pools the scales of all blocks, where a sensor updates only a few times in each block: no block alone shows its
/// noise.
fn pool(pieces: &mut [Piece]) {
    if pieces.iter().all(|piece| piece.turns.pairs < FEWEST) {
        let turns = pieces.iter().fold(Turns::default(), |sum, Piece { turns, .. }| Turns {
            changes: sum.changes + turns.changes,
            pairs: sum.pairs + turns.pairs,
            of_one_code: sum.of_one_code + turns.of_one_code,
        });
        pieces.iter_mut().for_each(|piece| piece.noisy = turns.are_noise());
    }
    let moving: usize = pieces.iter().map(|piece| piece.moving).sum();
    if pieces.iter().any(Piece::speaks) || moving < FEWEST {
        return;
    }
    let mut scales: Vec<f64> = pieces.iter().filter(|piece| piece.moving > 0).map(|piece| piece.moving_scale).collect();
    let scale = crate::stats::median(&mut scales);
    for piece in pieces {
        (piece.moving_scale, piece.moving) = (scale, moving);
    }
}

/// Step between codes: the largest common divisor of the distances of whole numbers, else the smallest distance.
fn step(values: &[f64]) -> f64 {
    let mut sorted: Vec<f64> = values.iter().copied().take(LEARN).filter(|value| value.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let whole = sorted.iter().all(|value| value.fract() == 0.0 && value.abs() < WHOLE);
    if whole {
        let alone = sorted.chunk_by(|a, b| a == b).filter(|same| same.len() == 1).count();
        let divisor = sorted.windows(2).fold(0, |divisor, pair| common_divisor(divisor, (pair[1] - pair[0]) as u64));
        // One value that differs from all others does not show the codes.
        let told = sorted.chunk_by(|a, b| a == b).count() > 1 + alone.min(1);
        return if told { divisor.max(1) as f64 } else { 1.0 };
    }
    let largest = sorted.first().map_or(0.0, |low| low.abs()).max(sorted.last().map_or(0.0, |high| high.abs()));
    // A difference within the rounding of two values is not a step. Each pair has its own rounding, since one large
    // word does not show that of the others.
    let rounding = |pair: &[f64]| 1e-13 * pair[0].abs().max(pair[1].abs());
    sorted
        .windows(2)
        .filter(|pair| pair[1] - pair[0] > rounding(pair))
        .map(|pair| pair[1] - pair[0])
        .fold(f64::INFINITY, f64::min)
        .min(largest)
}
