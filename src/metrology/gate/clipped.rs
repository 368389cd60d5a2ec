//! Values that are cut off at one side: one code holds the tail that lies beyond it.

use std::borrow::Cow;
use std::ops::Range;

use super::character::Character;
use super::extremes::PART;
use super::{RowFault, Screening};
use crate::stats;

/// Least ratio of the rows at an end's code to those at the codes inside, for a clipped end. A code at the end of noise
/// is rarer than the codes inside, so this ratio is not chance.
const RATIO: f64 = 3.0;
/// Least number of additional rows at the end's code.
const MORE: f64 = 8.0;
/// Width, in scales, in which a tail lies beside its end.
const TAIL: f64 = 6.0;
/// Different words that are searched for at an end.
const WORDS: usize = 4;
/// Width in which the codes inside are counted, in scales and in codes.
const INSIDE: f64 = 0.25;
const CODES: f64 = 4.0;

pub(super) fn search(
    found: &mut Screening,
    name: &str,
    values: &[f64],
    character: &Character,
    blocks: &[Range<usize>],
) {
    for (number, block) in blocks.iter().enumerate() {
        let mut scales: Vec<f64> =
            character.pieces.iter().filter(|piece| piece.block == number).map(|piece| piece.moving_scale).collect();
        if block.len() < PART || scales.is_empty() {
            continue;
        }
        let scale = stats::median(&mut scales);
        // Noise of a code or two has few codes, and the last of them may be the most usual one.
        if scale < 2.0 * character.step || !character.pieces.iter().any(|piece| piece.block == number && piece.noisy) {
            continue;
        }
        for sign in [1.0, -1.0] {
            for _ in 0..WORDS {
                let ends = ranges(found, values, character, number, block);
                let Some(extreme) = usual_extreme(&ends, sign) else { break };
                if !is_too_often(found, values, block, sign, extreme, scale, character.step) {
                    break;
                }
                let is_word = is_word(found, values, block, extreme, scale);
                for row in block.clone().filter(|row| values[*row] == extreme) {
                    found.mark(row, if is_word { RowFault::FailedRead } else { RowFault::Clipped });
                }
                if !is_word {
                    found.cut_at(name, number, blocks, extreme);
                    break;
                }
                // The search goes on, since the end of the noise lies behind the word.
            }
        }
    }
}

/// Whether a code at an end comes more often than the codes inside.
fn is_too_often(
    found: &Screening,
    values: &[f64],
    block: &Range<usize>,
    sign: f64,
    extreme: f64,
    scale: f64,
    step: f64,
) -> bool {
    let width = (INSIDE * scale).max((CODES + 0.5) * step);
    let below = |value: &f64| sign * (extreme - value);
    let (at, inside) = if found.left_out.total() == 0 {
        beside(values[block.clone()].iter().map(below), width)
    } else {
        beside(block.clone().filter(|row| found.keeps(*row)).map(|row| below(&values[row])), width)
    };
    let codes = (width / step).floor().max(1.0);
    at as f64 > RATIO * inside as f64 / codes + MORE
}

/// Whether no value lies near a code at an end. Then the code is a wrong word and not the end of the noise. The spread of
/// the values limits the scale too, since many such words spoil the differences.
fn is_word(found: &Screening, values: &[f64], block: &Range<usize>, extreme: f64, scale: f64) -> bool {
    let mut kept: Vec<f64> = block.clone().filter(|row| found.keeps(*row)).map(|row| values[row]).collect();
    let level = stats::median(&mut kept);
    let away = |value: &&f64| **value != extreme;
    let nearest = kept.iter().filter(away).map(|value| (value - extreme).abs()).fold(f64::INFINITY, f64::min);
    let mut spread: Vec<f64> = kept.iter().map(|value| (value - level).abs()).collect();
    let spread = stats::median(&mut spread) / stats::MEDIAN_DEVIATION;
    spread > 0.0 && nearest.is_finite() && nearest > TAIL * spread.min(scale)
}

/// The number of distances that are 0, and the number above 0 up to a width.
fn beside(below: impl Iterator<Item = f64>, width: f64) -> (u64, u64) {
    // The counts are as wide as the values, so that the compiler can use vectors.
    below.fold((0, 0), |(at, inside), below| {
        (at + u64::from(below == 0.0), inside + u64::from((below > 0.0) & (below <= width)))
    })
}

/// Smallest and largest of the values that are used in each part of a block.
fn ranges<'a>(
    found: &Screening,
    values: &[f64],
    character: &'a Character,
    number: usize,
    block: &Range<usize>,
) -> Cow<'a, [(f64, f64)]> {
    if found.left_out.total() == 0 {
        return Cow::Borrowed(character.extremes.of_block(number));
    }
    let parts = block.clone().step_by(PART).map(|start| start..(start + PART).min(block.end));
    let of_part = |rows: Range<usize>| {
        rows.filter(|row| found.keeps(*row))
            .map(|row| values[row])
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
    };
    parts.map(of_part).collect()
}

/// The value that is the extreme of most parts.
fn usual_extreme(ranges: &[(f64, f64)], sign: f64) -> Option<f64> {
    let extremes = ranges.iter().map(|(low, high)| if sign > 0.0 { *high } else { *low });
    let mut extremes: Vec<f64> = extremes.filter(|value| value.is_finite()).collect();
    extremes.sort_unstable_by(f64::total_cmp);
    extremes.chunk_by(|a, b| a == b).max_by_key(|same| same.len()).and_then(|same| same.first()).copied()
}
