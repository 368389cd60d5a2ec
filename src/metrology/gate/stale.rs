//! Rows that repeat the row before on all channels, more often or longer than noise does by chance.

use std::ops::Range;

use super::character::{Character, Piece};
use super::excess::{Excess, beside};
use super::{Fault, Screening};

/// Chance in the whole record of a run of repeats that is taken for a fault.
const RARE: f64 = 1e-5;
/// Scales by which neighbours of a repeat differ where the record moves.
const MOVING: f64 = 8.0;
/// Part of the rows above which repeats are the rule: a sensor that is read more often than it updates.
const MANY: f64 = 0.1;
/// Above this chance of a repeat the noise lies below the resolution, and nothing can be said.
const COMMON: f64 = 0.5;

/// Marks stale rows. Gives the rows for each update where the sensor is read more often than it updates.
pub(super) fn search(
    found: &mut Screening,
    channels: &[&[f64]],
    characters: &[Character],
    blocks: &[Range<usize>],
) -> Option<f64> {
    let rows = found.rows();
    let pieces = characters.first().map_or(&[][..], |character| &character.pieces);
    let repeats: Vec<usize> = pieces.iter().map(|piece| count(channels, piece, blocks)).collect();
    if repeats.iter().all(|count| *count == 0) {
        return None;
    }
    let chances: Vec<f64> = (0..pieces.len()).map(|at| chance(characters, at)).collect();
    let judged = || (0..pieces.len()).filter(|at| chances[*at] < COMMON);
    let expected: f64 = judged().map(|at| pieces[at].rows.len() as f64 * chances[at]).sum();
    let counted: usize = judged().map(|at| repeats[at]).sum();
    // A few are no news where chance gives any.
    let news = counted.saturating_sub(if expected > 1e-3 { 3 } else { 0 });
    let mut excess = Excess::of(news, expected, || steps_beside(channels, characters, blocks));
    if counted as f64 > MANY * rows as f64 {
        excess = excess.all();
    }
    let mut marked = 0;
    for at in judged().filter(|at| repeats[*at] > 0) {
        // So many repeats in a row are no chance in a record of this length.
        let shortest = (RARE / rows as f64).ln().div_euclid(chances[at].ln()) as usize + 1;
        let mut run = 0;
        let block = &blocks[pieces[at].block];
        for row in pieces[at].rows.clone() {
            if repeats_at(channels, block.start, row) {
                if run == 0 && pauses(channels, characters, at, block, row) {
                    marked += usize::from(found.mark(row, Fault::Stale));
                }
                run += 1;
                continue;
            }
            marked += mark(found, row, run, shortest, &mut excess);
            run = 0;
        }
        marked += mark(found, pieces[at].rows.end, run, shortest, &mut excess);
    }
    polled(found, marked, blocks)
}

/// Whether a channel moves fast before and after a repeat, and not in it: no chance, however coarse the noise.
fn pauses(channels: &[&[f64]], characters: &[Character], at: usize, block: &Range<usize>, row: usize) -> bool {
    if row < block.start + 2 || row + 1 >= block.end {
        return false;
    }
    channels.iter().zip(characters).any(|(values, character)| {
        let far = MOVING * character.pieces[at].moving_scale.max(character.step);
        let (before, after) = (values[row - 1] - values[row - 2], values[row + 1] - values[row]);
        (before > far && after > far) || (before < -far && after < -far)
    })
}

fn mark(found: &mut Screening, end: usize, run: usize, shortest: usize, excess: &mut Excess) -> usize {
    if run == 0 || !(run >= shortest || excess.takes(run)) {
        return 0;
    }
    (end - run..end).filter(|row| found.mark(*row, Fault::Stale)).count()
}

/// Steps of one and of two codes from row to row, each the mean of both senses; only of one channel.
fn steps_beside(channels: &[&[f64]], characters: &[Character], blocks: &[Range<usize>]) -> Option<[f64; 2]> {
    let ([values], [character]) = (channels, characters) else { return None };
    if character.step <= 0.0 {
        return None;
    }
    let within = |block: &Range<usize>| values[block.start.min(values.len())..block.end.min(values.len())].windows(2);
    Some(beside(blocks.iter().flat_map(within).map(|pair| (pair[1] - pair[0]) / character.step)))
}

fn repeats_at(channels: &[&[f64]], start: usize, row: usize) -> bool {
    row > start && channels.iter().all(|values| values[row] == values[row - 1])
}

fn count(channels: &[&[f64]], piece: &Piece, blocks: &[Range<usize>]) -> usize {
    let start = piece.rows.start.max(blocks[piece.block].start + 1);
    let Some((first, others)) = channels.split_first() else { return 0 };
    if start >= piece.rows.end {
        return 0;
    }
    let (now, before) = (&first[start..piece.rows.end], &first[start - 1..piece.rows.end - 1]);
    let of_first: u32 = now.iter().zip(before).map(|(a, b)| u32::from(a == b)).sum();
    if of_first == 0 || others.is_empty() {
        return of_first as usize;
    }
    (start..piece.rows.end).filter(|row| channels.iter().all(|values| values[*row] == values[row - 1])).count()
}

/// Chance of a repeat on all channels in a piece; of a piece that stands still, the larger one of those beside it.
fn chance(characters: &[Character], at: usize) -> f64 {
    let of_piece = |at: usize| -> f64 {
        characters.iter().map(|character| character.chance_of_repeat(&character.pieces[at])).product()
    };
    let speaks = |at: &usize| characters.iter().any(|character| character.pieces[*at].speaks());
    if speaks(&at) {
        return of_piece(at);
    }
    let count = characters.first().map_or(0, |character| character.pieces.len());
    let (before, after) = ((0..at).rev().find(speaks), (at + 1..count).find(speaks));
    before.into_iter().chain(after).map(of_piece).reduce(f64::max).unwrap_or(1.0)
}

/// Rows for each update, where nearly all rows lie in updates of one length.
fn polled(found: &Screening, stale: usize, blocks: &[Range<usize>]) -> Option<f64> {
    let rows: usize = blocks.iter().map(Range::len).sum();
    let ratio = rows as f64 / (rows - stale.min(rows)).max(1) as f64;
    if ratio < 1.2 {
        return None;
    }
    let even = |length: usize| if (length as f64 - ratio).abs() <= 1.0 { length } else { 0 };
    let mut evenly = 0;
    for block in blocks {
        let mut length = 0;
        for row in block.clone() {
            if found.fault(row) != Some(Fault::Stale) {
                evenly += even(length);
                length = 0;
            }
            length += 1;
        }
        evenly += even(length);
    }
    (evenly as f64 > 0.95 * rows as f64).then_some(ratio)
}
