//! Reads that a chip did not answer: the same word on all of its channels at once.

use std::ops::Range;

use super::character::Character;
use super::excess::{self, Excess, beside};
use super::extremes::{PART, places};
use super::{RecordLayout, RowFault, Screening, tails};

/// Rows beside a row that show its level.
const BESIDE: usize = 5;
/// A channel that lies within this many scales and steps of the word may show the word by chance.
const NEAR: f64 = 8.0;

/// Marks rows in which all channels show 0, or all show -1, where that is not chance.
pub(super) fn at_once(found: &mut Screening, channels: &[&[f64]], characters: &[Character], layout: &RecordLayout<'_>) {
    let lowest_step = characters.iter().map(|character| character.step).fold(f64::INFINITY, f64::min);
    let mut words = vec![0.0, -1.0];
    if lowest_step.is_finite() && lowest_step > 0.0 {
        // In a record with its own unit, -1 is one code below 0. A link that shortens codes returns the middle of each
        // step, and then the codes next to 0 stand for 0 and -1.
        let first = channels.iter().find_map(|values| values.first()).copied().unwrap_or(0.0);
        let above = if lowest_step.fract() == 0.0 { first.rem_euclid(lowest_step) } else { 0.0 };
        words.extend([above, above - lowest_step].into_iter().filter(|word| ![0.0, -1.0].contains(word)));
    }
    for (word, rows) in words.iter().zip(rows_of(channels, &words, found.rows())) {
        if !rows.is_empty() {
            judge(found, channels, characters, layout.blocks, *word, &rows);
            // A motion is not judged, since its turning points may show one code often.
            if layout.still {
                judge_tails(found, channels, characters, layout.blocks, *word, &rows);
            }
        }
    }
}

/// For each word, the rows in which all channels show it.
fn rows_of(channels: &[&[f64]], words: &[f64], rows: usize) -> Vec<Vec<usize>> {
    let mut found = vec![Vec::new(); words.len()];
    let Some((first, others)) = channels.split_first() else { return found };
    for (part, values) in first[..rows].chunks(PART).enumerate() {
        for (word, rows) in words.iter().zip(&mut found) {
            let of_first = places(values.iter().map(|value| value == word)).map(|place| part * PART + place);
            rows.extend(of_first.filter(|row| others.iter().all(|values| values[*row] == *word)));
        }
    }
    found
}

fn judge(
    found: &mut Screening,
    channels: &[&[f64]],
    characters: &[Character],
    blocks: &[Range<usize>],
    word: f64,
    rows: &[usize],
) {
    let pieces = characters.first().map_or(&[][..], |character| &character.pieces);
    let chance = |at: usize| -> f64 {
        characters.iter().map(|character| character.chance_of_code(&character.pieces[at])).product()
    };
    let expected: f64 = pieces.iter().enumerate().map(|(at, piece)| piece.rows.len() as f64 * chance(at)).sum();
    let on_end = rows.windows(2).any(|pair| pair[0] + 1 == pair[1]);
    let again = if on_end { repeats_of_others(found, channels, word) } else { 0.0 };
    let mut block = 0;
    let mut unsure = Vec::new();
    for run in rows.chunk_by(|row, next| row + 1 == *next) {
        let at = pieces.partition_point(|piece| piece.rows.end <= run[0]).min(pieces.len().saturating_sub(1));
        // Chance does not give a run as long as this: all its rows are failed reads. A sensor that is read more often
        // than it updates shows each word several times.
        let (chance, again) = (chance(at), again.max(chance(at)));
        let on_end =
            run.len() > 1 && run.len() >= excess::shortest_run(again, (found.rows() as f64 * chance / again) as usize);
        for row in run {
            while block + 1 < blocks.len() && blocks[block].end <= *row {
                block += 1;
            }
            if on_end || is_impossible(channels, characters, &blocks[block], word, *row) {
                found.mark(*row, RowFault::FailedRead);
            } else {
                unsure.push(*row);
            }
        }
    }
    let mut excess = Excess::of(unsure.len(), expected, || codes_beside(channels, word, characters));
    for row in unsure {
        if excess.takes(1) {
            found.mark(row, RowFault::FailedRead);
        }
    }
}

/// Marks rows of a word that lies in the tail of a channel's noise, where the tail gives fewer of them.
fn judge_tails(
    found: &mut Screening,
    channels: &[&[f64]],
    characters: &[Character],
    blocks: &[Range<usize>],
    word: f64,
    rows: &[usize],
) {
    for (values, character) in channels.iter().zip(characters) {
        for side in [1.0, -1.0] {
            let unsure: Vec<usize> = rows.iter().copied().filter(|row| found.keeps(*row)).collect();
            let in_tail = tails::in_tail(found, values, character, blocks, (word, &unsure), side);
            let Some((tail, natural)) = in_tail else { continue };
            let mut excess = Excess::over(tail.len(), natural);
            for row in tail {
                if excess.takes(1) {
                    found.mark(row, RowFault::FailedRead);
                }
            }
        }
    }
}

/// Part of the rows in which all channels repeat a value other than the word.
fn repeats_of_others(found: &Screening, channels: &[&[f64]], word: f64) -> f64 {
    let repeats = (1..found.rows()).filter(|row| {
        channels.iter().all(|values| values[*row] == values[row - 1])
            && channels.iter().any(|values| values[*row] != word)
    });
    repeats.count() as f64 / found.rows() as f64
}

/// Whether a channel lies far from the word on both sides of a row.
fn is_impossible(channels: &[&[f64]], characters: &[Character], block: &Range<usize>, word: f64, row: usize) -> bool {
    channels.iter().zip(characters).any(|(values, character)| {
        let far = NEAR * scale_at(character, row).max(character.step);
        let left = &values[row.saturating_sub(BESIDE).max(block.start)..row];
        let right = &values[row + 1..(row + 1 + BESIDE).min(block.end)];
        // A motion that begins or ends in the word is near it on one side.
        is_apart(left, word, far) && is_apart(right, word, far)
    })
}

/// Rows at the codes one and two steps beside a word, each the mean of both sides. Only for a single channel: several
/// channels show one word by chance too seldom to matter.
fn codes_beside(channels: &[&[f64]], word: f64, characters: &[Character]) -> Option<[f64; 2]> {
    let ([values], [character]) = (channels, characters) else { return None };
    (character.step > 0.0).then(|| beside(values.iter().map(|value| (value - word) / character.step)))
}

fn scale_at(character: &Character, row: usize) -> f64 {
    let at = character.pieces.partition_point(|piece| piece.rows.end <= row);
    character.pieces.get(at).map_or(0.0, |piece| piece.scale)
}

/// Whether the median of some values lies far from a word.
fn is_apart(values: &[f64], word: f64, far: f64) -> bool {
    let near = values.iter().filter(|value| (*value - word).abs() <= far).count();
    // The median lies between the values of a majority.
    if values.is_empty() || 2 * near > values.len() {
        return false;
    }
    let mut beside = [0.0; BESIDE];
    let beside = &mut beside[..values.len().min(BESIDE)];
    beside.copy_from_slice(&values[..beside.len()]);
    (crate::stats::median(beside) - word).abs() > far
}
