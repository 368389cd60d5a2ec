//! Values cut at one side: one code holds the tail that lies beyond it.

use std::ops::Range;

use super::character::Character;
use super::{Fault, Screening};
use crate::series;

/// Rows whose extreme is looked at.
const PART: usize = 64;
/// A code at the end of noise is rarer than the codes inside; so many times as often is no chance.
const RATIO: f64 = 3.0;
/// And so many rows more.
const MORE: f64 = 8.0;
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
        let scale = crate::stats::median(&mut scales);
        // Noise of a code or two has few codes, of which the last may well be the usual one.
        if scale < 2.0 * character.step || !character.pieces.iter().any(|piece| piece.block == number && piece.noisy) {
            continue;
        }
        for sign in [1.0, -1.0] {
            let Some(extreme) = usual_extreme(found, values, block, sign) else { continue };
            let width = (INSIDE * scale).max((CODES + 0.5) * character.step);
            let (mut at, mut inside) = (0, 0);
            for row in block.clone().filter(|row| found.keeps(*row)) {
                let below = sign * (extreme - values[row]);
                at += usize::from(below == 0.0);
                inside += usize::from(below > 0.0 && below <= width);
            }
            let codes = (width / character.step).floor().max(1.0);
            if at as f64 > RATIO * inside as f64 / codes + MORE {
                for row in block.clone().filter(|row| values[*row] == extreme) {
                    found.mark(row, Fault::Clipped);
                }
                let channel =
                    if blocks.len() > 1 { format!("{name} of stretch {}", number + 1) } else { name.to_owned() };
                found.clipped_at.get_or_insert((channel, extreme));
            }
        }
    }
}

/// The value that is the extreme of most parts.
fn usual_extreme(found: &Screening, values: &[f64], block: &Range<usize>, sign: f64) -> Option<f64> {
    let clean = found.left_out.total() == 0;
    let mut extremes: Vec<f64> = Vec::with_capacity(block.len() / PART + 1);
    let mut start = block.start;
    while start < block.end {
        let rows = start..(start + PART).min(block.end);
        let (low, high) = if clean {
            series::range(&values[rows.clone()])
        } else {
            rows.clone()
                .filter(|row| found.keeps(*row))
                .map(|row| values[row])
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
        };
        extremes.push(if sign > 0.0 { high } else { low });
        start = rows.end;
    }
    extremes.retain(|value| value.is_finite());
    extremes.sort_by(f64::total_cmp);
    extremes.chunk_by(|a, b| a == b).max_by_key(|same| same.len()).and_then(|same| same.first()).copied()
}
