//! Reads that a chip did not answer: the same word on all of its channels at once.

use std::ops::Range;

use super::character::Character;
use super::excess::{Excess, beside};
use super::{Fault, Screening};

/// Rows beside a row from which its level is known.
const BESIDE: usize = 5;
/// A channel that lies within so many scales and steps of the word may show it by chance.
const NEAR: f64 = 8.0;

/// Marks rows in which all channels show 0, or all show -1, where that is no chance.
pub(super) fn at_once(found: &mut Screening, channels: &[&[f64]], characters: &[Character], blocks: &[Range<usize>]) {
    let lowest_step = characters.iter().map(|character| character.step).fold(f64::INFINITY, f64::min);
    let mut words = vec![0.0, -1.0];
    if lowest_step.is_finite() && lowest_step > 0.0 {
        // -1 of a record in units of its own is one code below 0. A link that shortens codes gives back the middle of each
        // step, and then the codes next to 0 stand for 0 and -1.
        let first = channels.iter().find_map(|values| values.first()).copied().unwrap_or(0.0);
        let above = if lowest_step.fract() == 0.0 { first.rem_euclid(lowest_step) } else { 0.0 };
        words.extend([above, above - lowest_step].into_iter().filter(|word| ![0.0, -1.0].contains(word)));
    }
    for word in words {
        let rows = rows_of(channels, word, found.rows());
        if !rows.is_empty() {
            judge(found, channels, characters, blocks, word, &rows);
        }
    }
}

fn rows_of(channels: &[&[f64]], word: f64, rows: usize) -> Vec<usize> {
    let Some((first, others)) = channels.split_first() else { return Vec::new() };
    // A plain count is at memory speed; most records have none.
    let count: usize = first[..rows]
        .chunks(1024)
        .map(|part| part.iter().map(|value| u32::from(*value == word)).sum::<u32>() as usize)
        .sum();
    if count == 0 {
        return Vec::new();
    }
    (0..rows).filter(|row| first[*row] == word && others.iter().all(|values| values[*row] == word)).collect()
}

fn judge(
    found: &mut Screening,
    channels: &[&[f64]],
    characters: &[Character],
    blocks: &[Range<usize>],
    word: f64,
    rows: &[usize],
) {
    let mut expected = 0.0;
    let pieces = characters.first().map_or(0, |character| character.pieces.len());
    for piece in 0..pieces {
        let of_channel = |character: &Character| character.chance_of_code(&character.pieces[piece]);
        expected += characters[0].pieces[piece].rows.len() as f64 * characters.iter().map(of_channel).product::<f64>();
    }
    let mut excess = Excess::of(rows.len(), expected, || codes_beside(channels, word, characters));
    let mut block = 0;
    for row in rows {
        while block + 1 < blocks.len() && blocks[block].end <= *row {
            block += 1;
        }
        let impossible = || {
            channels.iter().zip(characters).any(|(values, character)| {
                let far = NEAR * scale_at(character, *row).max(character.step);
                level(values, &blocks[block], *row, word).is_some_and(|level| (level - word).abs() > far)
            })
        };
        if impossible() || excess.takes(1) {
            found.mark(*row, Fault::FailedRead);
        }
    }
}

/// Rows at the codes one and two steps beside a word, each the mean of both sides; only of one channel, for several show
/// one word by chance too seldom to matter.
fn codes_beside(channels: &[&[f64]], word: f64, characters: &[Character]) -> Option<[f64; 2]> {
    let ([values], [character]) = (channels, characters) else { return None };
    (character.step > 0.0).then(|| beside(values.iter().map(|value| (value - word) / character.step)))
}

fn scale_at(character: &Character, row: usize) -> f64 {
    let at = character.pieces.partition_point(|piece| piece.rows.end <= row);
    character.pieces.get(at).map_or(0.0, |piece| piece.scale)
}

/// The smaller distance from the word of the medians on both sides decides: a motion that begins or ends in it is none.
fn level(values: &[f64], block: &Range<usize>, row: usize, word: f64) -> Option<f64> {
    let left = median(&values[row.saturating_sub(BESIDE).max(block.start)..row]);
    let right = median(&values[row + 1..(row + 1 + BESIDE).min(block.end)]);
    match (left, right) {
        (Some(left), Some(right)) => Some(if (left - word).abs() < (right - word).abs() { left } else { right }),
        _ => None,
    }
}

fn median(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| crate::stats::median(&mut values.to_vec()))
}
