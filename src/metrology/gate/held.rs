//! One word that stays for several rows, far from both sides: a chip or a link that hung on a 0 or on the word of an
//! error. Medians of neighbours do not show it, since its rows are neighbours of each other. A held end of the range is
//! not a failed read: the sensor is at its end, and the methods check for that.

use std::ops::Range;

use super::character::Character;
use super::extremes::PART;
use super::spikes::{CURVED, REACH, SIDE, limit};
use super::stale::COMMON;
use super::{RecordLayout, RowFault, Screening};

/// Marks words that are held for up to [`REACH`] rows. The search for stale rows finds longer ones.
///
/// It looks only where the record's noise makes repeats rare, since a motion without noise has plateaus.
pub(super) fn search(found: &mut Screening, values: &[f64], character: &Character, layout: &RecordLayout<'_>) {
    for piece in character.pieces.iter().filter(|piece| character.chance_of_repeat(piece) < COMMON) {
        let block = &layout.blocks[piece.block];
        // For a sensor that is read more often than it updates, only the rows that move show the scale.
        let far = limit(character, piece.scale.max(piece.moving_scale), block);
        let mut from = piece.rows.start;
        while from < piece.rows.end {
            let to = (from + PART).min(piece.rows.end);
            let (low, high) = character.extremes.around(piece.block, &(from.saturating_sub(1).max(block.start)..to));
            if high - low > far {
                look(found, values, layout, block, from..to, far);
            }
            from = to;
        }
    }
}

/// Marks the words that begin in these rows.
fn look(
    found: &mut Screening,
    values: &[f64],
    layout: &RecordLayout<'_>,
    block: &Range<usize>,
    rows: Range<usize>,
    far: f64,
) {
    let mut row = rows.start;
    while row < rows.end {
        let value = values[row];
        let end =
            row + (row..block.end.min(values.len())).take(REACH + 1).take_while(|at| values[*at] == value).count();
        let begins = row == block.start || values[row - 1] != value;
        if begins
            && (2..=REACH).contains(&(end - row))
            && !layout.is_end(value)
            && is_far(found, values, block, &(row..end), far)
        {
            for held in row..end {
                found.mark(held, RowFault::FailedRead);
            }
        }
        row = end;
    }
}

/// Whether both sides lie far away in one direction, and move from row to row by far less than that.
fn is_far(found: &Screening, values: &[f64], block: &Range<usize>, held: &Range<usize>, far: f64) -> bool {
    let word = values[held.start];
    let other = |row: &usize| found.keeps(*row) && values[*row] != word;
    let side = |rows: &mut dyn Iterator<Item = usize>| -> Vec<f64> {
        rows.filter(other).take(SIDE).map(|row| values[row]).collect()
    };
    let left = side(&mut (held.start.saturating_sub(REACH).max(block.start)..held.start).rev());
    let right = side(&mut (held.end..(held.end + REACH).min(block.end)));
    let mut steps: Vec<f64> =
        [&left, &right].into_iter().flat_map(|side| side.windows(2)).map(|pair| (pair[1] - pair[0]).abs()).collect();
    steps.retain(|step| *step != 0.0);
    let away: Vec<f64> = [&left, &right].into_iter().filter_map(|side| side.first()).map(|near| word - near).collect();
    let far = far.max(CURVED * crate::stats::median(&mut steps));
    !steps.is_empty() && (away.iter().all(|away| *away > far) || away.iter().all(|away| *away < -far))
}
