//! How often honest noise shows a word that lies in its tail.
//!
//! Noise about a level, in codes, is log-concave: with n1 and n2 rows at the codes one and two steps from a word towards the
//! level, at most n1^2 / n2 rows show the word itself. This holds for coarse noise as well, of which no scale is known.

use std::ops::Range;

use super::Screening;
use super::character::Character;
use crate::stats;

/// Rows on each side that say on which side of a word the level lies.
const BESIDE: usize = 5;
/// Steps by which the level lies off the word.
const OFF: f64 = 1.5;

/// The rows among these whose neighbours on both sides lie to one side of the word, and how many of them a channel's noise
/// gives; `None` where it may give any number.
pub(super) fn in_tail(
    found: &Screening,
    values: &[f64],
    character: &Character,
    blocks: &[Range<usize>],
    (word, rows): (f64, &[usize]),
    side: f64,
) -> Option<(Vec<usize>, f64)> {
    let step = character.step;
    if step <= 0.0 || !character.pieces.iter().any(|piece| piece.noisy) {
        return None;
    }
    let mut block = 0;
    let mut is_off = |row: usize| {
        while block + 1 < blocks.len() && blocks[block].end <= row {
            block += 1;
        }
        let block = &blocks[block];
        let apart = |rows: Range<usize>| {
            let mut beside: Vec<f64> =
                rows.filter(|row| found.keeps(*row)).map(|row| side * (values[row] - word)).collect();
            beside.len() > 1 && stats::median(&mut beside) > OFF * step
        };
        apart(row.saturating_sub(BESIDE).max(block.start)..row) && apart(row + 1..(row + 1 + BESIDE).min(block.end))
    };
    let tail: Vec<usize> = rows.iter().copied().filter(|row| is_off(*row)).collect();
    if tail.is_empty() {
        return None;
    }
    // Whole counts as wide as the values, which the compiler turns into vectors.
    let (mut one, mut two, mut beyond) = (0_u64, 0_u64, 0_u64);
    for value in &values[..found.rows()] {
        let off = side * (value - word);
        one += u64::from((off - step).abs() < 0.25 * step);
        two += u64::from((off - 2.0 * step).abs() < 0.25 * step);
        beyond |= u64::from(off < -0.25 * step);
    }
    let (one, two, beyond) = (one as f64, two as f64, beyond != 0);
    // Two deviations more at the code beside the word.
    let ratio = (one + 2.0 * one.sqrt() + 1.0) / f64::max(two, 1.0);
    let natural = (one + 2.0 * one.sqrt() + 1.0) * ratio;
    // Where nothing lies beyond the word it may be the end of the range, which holds the whole tail.
    let natural = match beyond {
        true => natural,
        false if ratio < 1.0 => natural / (1.0 - ratio),
        false if two == 0.0 => natural,
        false => return None,
    };
    Some((tail, natural))
}
