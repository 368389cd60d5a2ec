//! The number of rows in which honest noise shows a word that lies in its tail.
//!
//! Noise about a level, in codes, is log-concave: with n1 and n2 rows at the codes one and two steps from a word
//! towards the level, at most n1^2 / n2 rows show the word itself. This holds for coarse noise as well, whose scale is
//! unknown.

use std::ops::Range;

use super::Screening;
use super::character::Character;
use crate::stats;

/// Rows on each side that show on which side of a word the level lies.
const BESIDE: usize = 5;
/// Least distance of the level from the word, in steps.
const OFF: f64 = 1.5;
/// Least rows at a code, so that two codes show how fast the tail falls.
const FEW: f64 = 8.0;

/// The rows among these whose neighbours on both sides lie to one side of the word, and the number of them that a
/// channel's noise gives; `None` where the noise may give any number.
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
    // The counts are as wide as the values, so that the compiler can use vectors.
    let (mut one, mut two, mut beyond) = (0_u64, 0_u64, 0_u64);
    for value in &values[..found.rows()] {
        let off = side * (value - word);
        one += u64::from((off - step).abs() < 0.25 * step);
        two += u64::from((off - 2.0 * step).abs() < 0.25 * step);
        beyond |= u64::from(off < -0.25 * step);
    }
    let (one, two, beyond) = (one as f64, two as f64, beyond != 0);
    let ratio = at_most(one) / f64::max(two, 1.0);
    let natural = at_most(one) * ratio;
    let natural = match beyond {
        true => natural,
        // Where no row lies beyond the word, the word may be the end of the range, which holds the whole tail.
        false if ratio < 1.0 && two >= FEW => natural / (1.0 - ratio),
        false => of_groups(values[..found.rows()].iter().map(|value| side * (value - word) / step))?,
    };
    Some((tail, natural))
}

/// A number plus two deviations.
fn at_most(count: f64) -> f64 {
    count + 2.0 * count.sqrt() + 1.0
}

/// Most rows at a word or beyond it, from the codes by which each row lies off the word. The rule for the codes one and
/// two steps off also holds for the first 2, 4, 8 ... codes and as many behind them. `None` where no such group
/// decides.
fn of_groups(offs: impl Iterator<Item = f64>) -> Option<f64> {
    // Rows up to 1, 2, 4 ... codes off, and more than half of that.
    let mut groups = [0_u64; 64];
    for off in offs.filter(|off| *off > 0.5) {
        let codes = (off.round() as u64).max(1);
        groups[((codes - 1).checked_ilog2().map_or(0, |bits| bits + 1) as usize).min(63)] += 1;
    }
    let mut within = 0;
    groups.windows(2).find_map(|pair| {
        within += pair[0];
        let ratio = at_most(within as f64) / pair[1] as f64;
        (ratio < 1.0).then(|| at_most(within as f64) * ratio / (1.0 - ratio))
    })
}
