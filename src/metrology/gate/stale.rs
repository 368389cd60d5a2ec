//! Rows that repeat the row before, more often or longer than noise does by chance: on all channels at once, and then on one
//! channel alone.

use std::ops::Range;

use super::character::{Character, Piece};
use super::excess::{self, Excess, beside};
use super::extremes::{PART, places};
use super::{RecordLayout, RowFault, Screening};

/// Scales by which neighbours of a repeat differ where the record moves.
const MOVING: f64 = 8.0;
/// Above this part of the rows, repeats are the rule: the sensor is read more often than it updates.
const MANY: f64 = 0.1;
/// Consecutive repeats that are too many for a sensor that is read more often than it updates.
const LONG: usize = super::MOST_POLLED as usize;
/// Above this chance of a repeat the noise lies below the resolution, and the search cannot decide.
pub(super) const COMMON: f64 = 0.5;

/// Marks stale rows. Returns the rows for each update where the sensor is read more often than it updates.
pub(super) fn search(
    found: &mut Screening,
    names: &[&str],
    channels: &[&[f64]],
    characters: &[Character],
    layout: &RecordLayout<'_>,
) -> Option<f64> {
    let blocks = layout.blocks;
    let before = found.left_out.stale;
    on_all(found, names, channels, characters, layout);
    // This comes after the search on all channels: repeats that all channels share are not news on one of them.
    if channels.len() > 1 {
        for (values, character) in channels.iter().zip(characters) {
            frozen(found, values, character, layout);
        }
    }
    polled(found, found.left_out.stale - before, blocks)
}

/// Marks rows that repeat the row before on all channels.
fn on_all(
    found: &mut Screening,
    names: &[&str],
    channels: &[&[f64]],
    characters: &[Character],
    layout: &RecordLayout<'_>,
) {
    let blocks = layout.blocks;
    let rows = found.rows();
    let pieces = characters.first().map_or(&[][..], |character| &character.pieces);
    let mut repeats: Vec<usize> = Vec::new();
    let ends: Vec<usize> = pieces
        .iter()
        .map(|piece| {
            note(channels, piece, &blocks[piece.block], |row| found.keeps(row), &mut repeats);
            repeats.len()
        })
        .collect();
    if repeats.is_empty() {
        return;
    }
    let alone: Vec<f64> = channels.iter().map(|values| repeats_alone(&values[..rows], repeats.len())).collect();
    let of_piece = |at: usize| &repeats[at.checked_sub(1).map_or(0, |before| ends[before])..ends[at]];
    let chances_of = |of: OfChannel| (0..pieces.len()).map(|at| chance(characters, &alone, at, of)).collect::<Vec<_>>();
    let chances = chances_of(Character::chance_of_repeat);
    // A run stays at one code, and a run at the most usual code stays longest.
    let chances_to_stay = chances_of(Character::chance_of_code);
    let judged = || (0..pieces.len()).filter(|at| chances[*at] < COMMON);
    let expected: f64 = judged().map(|at| pieces[at].rows.len() as f64 * chances[at]).sum();
    let counted: usize = judged().map(|at| of_piece(at).len()).sum();
    let runs = |at: usize| of_piece(at).chunk_by(|row, next| row + 1 == *next);
    let shortest = |at: usize| excess::shortest_run(chances_to_stay[at], rows);
    // Runs that chance does not give are left out of the number that chance gives.
    let many = counted as f64 > MANY * rows as f64;
    let is_unsure = |at: usize, run: &[usize]| many || run.len() < shortest(at);
    let unsure: usize =
        judged().flat_map(|at| runs(at).filter(move |run| is_unsure(at, run)).map(<[usize]>::len)).sum();
    // Up to three repeats are not suspect where chance gives any.
    let news = unsure.saturating_sub(if expected > 1e-3 { 3 } else { 0 });
    let mut excess = Excess::of(news, expected, || steps_beside(channels, characters, blocks));
    if many {
        excess = excess.all();
    }
    for at in judged().filter(|at| !of_piece(*at).is_empty()) {
        let shortest = shortest(at);
        let block = &blocks[pieces[at].block];
        for run in runs(at) {
            // A record that lies still also moves before and after a repeat, where two spikes stand beside the repeat.
            if !layout.still && pauses(channels, characters, at, block, run[0]) {
                found.mark(run[0], RowFault::Stale);
            }
            // Methods of several channels check that each channel lies within its range. Methods of one channel leave
            // this to the gate.
            if let ([name], [values], [character]) = (names, channels, characters)
                && run.len() >= shortest.max(LONG)
                && layout.is_end(values[run[0]])
                && is_extreme(character, pieces[at].block, values[run[0]])
            {
                (run[0] - 1..=run[run.len() - 1]).for_each(|row| {
                    found.mark(row, RowFault::Clipped);
                });
                found.cut_at(name, pieces[at].block, blocks, values[run[0]]);
            } else if run.len() >= shortest || excess.takes(run.len()) {
                for row in run {
                    found.mark(*row, RowFault::Stale);
                }
            }
        }
    }
}

/// Whether no value of a block lies farther from 0 than `value`.
fn is_extreme(character: &Character, block: usize, value: f64) -> bool {
    let parts = character.extremes.of_block(block).iter();
    parts.copied().all(|(low, high)| if value > 0.0 { high <= value } else { low >= value })
}

/// Marks rows in which one channel alone repeats itself for longer than chance allows, while the others go on.
///
/// A channel that is read more often than it updates, such as a temperature beside rates, repeats itself all the time.
/// For such a channel an update counts as one row.
fn frozen(found: &mut Screening, values: &[f64], character: &Character, layout: &RecordLayout<'_>) {
    let judged = || character.pieces.iter().filter(|piece| character.chance_of_repeat(piece) < COMMON);
    // Consecutive repeats, by piece, and the number of them without a fault so far.
    let mut runs: Vec<(&Piece, Vec<usize>, usize)> = Vec::new();
    let mut repeats = Vec::new();
    for piece in judged() {
        repeats.clear();
        note(&[values], piece, &layout.blocks[piece.block], |_| true, &mut repeats);
        for run in repeats.chunk_by(|row, next| row + 1 == *next) {
            let unknown = run.iter().filter(|row| found.keeps(**row)).count();
            if unknown > 0 {
                runs.push((piece, run.to_vec(), unknown));
            }
        }
    }
    if runs.is_empty() {
        return;
    }
    let rows: usize = judged().map(|piece| piece.rows.clone().filter(|row| found.keeps(*row)).count()).sum();
    let chance = judged().map(|piece| character.chance_of_repeat(piece)).fold(0.0, f64::max);
    let each = update(runs.iter().map(|(.., unknown)| *unknown).collect(), rows, chance);
    for (piece, run, unknown) in runs {
        // A code that is usual in the piece stays longer than other codes by chance.
        let is_short = |chance: f64| {
            let shortest = excess::shortest_run(chance, found.rows());
            unknown + 1 < each.saturating_mul(shortest.saturating_add(1))
        };
        let chance = character.chance_of_code(piece);
        if is_short(chance) || is_short(chance.max(usual(values, piece, &run))) {
            continue;
        }
        // A sensor at the end of its range is not frozen.
        for row in run.into_iter().filter(|row| !layout.is_end(values[*row])) {
            found.mark(row, RowFault::Stale);
        }
    }
}

/// Part of the other rows of a piece that show the code of these repeats.
fn usual(values: &[f64], piece: &Piece, run: &[usize]) -> f64 {
    let Some(code) = run.first().map(|row| values[*row]) else { return 0.0 };
    let held = run.len() + 1;
    let same = values[piece.rows.clone()].iter().filter(|value| **value == code).count();
    same.saturating_sub(held) as f64 / piece.rows.len().saturating_sub(held).max(1) as f64
}

/// Rows for each update of a channel, from its consecutive repeats: the length that one update in ten exceeds, apart
/// from those that chance makes longer.
fn update(mut repeats: Vec<usize>, rows: usize, chance: f64) -> usize {
    let updates = rows.saturating_sub(repeats.iter().sum());
    let longer = (updates as f64 * (MANY + chance)) as usize;
    repeats.sort_unstable_by(|a, b| b.cmp(a));
    1 + repeats.get(longer).copied().unwrap_or(0)
}

/// Whether a channel moves fast before and after a repeat, but not in it. This is not chance, however coarse the noise
/// is.
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

/// Steps of one and of two codes from row to row, each the mean of both directions. Only for a single channel.
fn steps_beside(channels: &[&[f64]], characters: &[Character], blocks: &[Range<usize>]) -> Option<[f64; 2]> {
    let ([values], [character]) = (channels, characters) else { return None };
    if character.step <= 0.0 {
        return None;
    }
    let within = |block: &Range<usize>| values[block.start.min(values.len())..block.end.min(values.len())].windows(2);
    Some(beside(blocks.iter().flat_map(within).map(|pair| (pair[1] - pair[0]) / character.step)))
}

/// Adds the rows of a piece that repeat the row before on all channels and must be noted.
fn note(
    channels: &[&[f64]],
    piece: &Piece,
    block: &Range<usize>,
    is_noted: impl Fn(usize) -> bool,
    repeats: &mut Vec<usize>,
) {
    let start = piece.rows.start.max(block.start + 1);
    let Some((first, others)) = channels.split_first() else { return };
    if start >= piece.rows.end {
        return;
    }
    let (now, before) = (&first[start..piece.rows.end], &first[start - 1..piece.rows.end - 1]);
    for (part, (now, before)) in now.chunks(PART).zip(before.chunks(PART)).enumerate() {
        let rows = places(now.iter().zip(before).map(|(a, b)| a == b)).map(|place| start + part * PART + place);
        let on_all = |row: &usize| others.iter().all(|values| values[*row] == values[row - 1]);
        repeats.extend(rows.filter(|row| is_noted(*row) && on_all(row)));
    }
}

/// Part of the rows in which a channel repeats itself, where the channel mostly does so while others go on; 0
/// elsewhere.
fn repeats_alone(values: &[f64], on_all: usize) -> f64 {
    let repeats = values.windows(2).map(|pair| usize::from(pair[0] == pair[1])).sum::<usize>();
    if repeats > 2 * on_all { repeats as f64 / values.len() as f64 } else { 0.0 }
}

/// A chance that a channel gives in a piece.
type OfChannel = fn(&Character, &Piece) -> f64;

/// Chance of a repeat on all channels in a piece. A piece that stands still takes the larger chance of the pieces
/// beside it. A channel that repeats itself alone gives the part of such rows, whatever its noise is.
fn chance(characters: &[Character], alone: &[f64], at: usize, of: OfChannel) -> f64 {
    let of_piece = |at: usize| -> f64 {
        let of_channel = |(character, alone): (&Character, &f64)| of(character, &character.pieces[at]).max(*alone);
        characters.iter().zip(alone).map(of_channel).product()
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
            if found.fault(row) != Some(RowFault::Stale) {
                evenly += even(length);
                length = 0;
            }
            length += 1;
        }
        evenly += even(length);
    }
    (evenly as f64 > 0.95 * rows as f64).then_some(ratio)
}
