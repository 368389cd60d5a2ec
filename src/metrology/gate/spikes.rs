//! Samples far from their neighbours on both sides.

use std::ops::Range;

use super::character::{self, Character, Piece};
use super::extremes::PART;
use super::{RecordLayout, RowFault, Screening, stale};
use crate::stats;

/// Neighbours on each side whose median a sample is compared with. Two of them may be spikes themselves.
pub(super) const SIDE: usize = 5;
/// Largest distance of a neighbour, in rows.
pub(super) const REACH: usize = 64;
/// Rows on each side that give the scale beside a candidate.
const BESIDE: usize = 128;
/// Scales by which a spike differs from both sides. Of 10^8 normal samples none differs by so much.
const FAR: f64 = 6.0;
/// The least such number of scales where a record is known to hold spikes.
const NEAR: f64 = 4.0;
/// Part of the spikes found that may be honest tails.
const HONEST: f64 = 0.1;
/// A difference below this many steps is not a spike, in scales of [`FAR`]: quantised noise of a fraction of a code
/// jumps by two or three codes.
const STEP: f64 = 0.75;
/// A line through five samples predicts the next with half as much noise again as their median has.
const LINES: f64 = 1.5;
/// Rows on each side that show by how much a curved motion leaves such lines, and the factor by which a spike leaves
/// them more.
const CURVE: usize = 12;
pub(super) const CURVED: f64 = 8.0;
/// Rows on each side whose median is the level of a record that stands still.
const LEVEL: usize = 32;
/// Where the scale of the rows that move exceeds that of all rows by this factor, most rows do not move.
const POLLED: f64 = 1.5;
/// Part of the limit within which a sample lies on the level, or on the chord between its neighbours.
const ON_LEVEL: f64 = 0.5;
/// Most consecutive rows that are spikes by that level. More of them are a level of their own: the module or its field
/// moved.
const LONGEST: usize = 8;
/// Number of touching bursts that chance gives in a record, above which two bursts may touch.
const TOUCHING: f64 = 0.01;
/// Number of passes. Spikes hide each other; each pass finds the spikes that the pass before laid open.
const PASSES: usize = 5;

pub(super) fn search(found: &mut Screening, values: &[f64], character: &Character, layout: &RecordLayout<'_>) {
    let mut spikes = Vec::new();
    let mut sought = Sought { far: FAR, longest: LONGEST };
    for _ in 0..PASSES {
        let before = spikes.len();
        for piece in &character.pieces {
            look(found, values, character, piece, layout, sought, &mut spikes);
        }
        // The rows are marked after a whole pass, since their kind is known only when all of them are known.
        for row in &spikes[before..] {
            found.mark(*row, RowFault::Spike);
        }
        let next = sought.after(&spikes, values.len());
        if spikes.is_empty() || (spikes.len() == before && next == sought) {
            break;
        }
        sought = next;
    }
    if spikes.is_empty() {
        return;
    }
    let (lowest, highest) = crate::stats::range(values);
    let ends: Vec<f64> = [lowest, highest]
        .into_iter()
        .filter(|end| spikes.iter().filter(|row| values[**row] == *end).count() > 1)
        .collect();
    for row in spikes {
        let value = values[row];
        let at_end = ends.contains(&value) || layout.is_end(value);
        if value == 0.0 || value == -1.0 || value == -character.step || at_end {
            found.reconsider(row);
        }
    }
}

impl Screening {
    /// Marks a spike as a failed read.
    fn reconsider(&mut self, row: usize) {
        if let Some(place @ Some(RowFault::Spike)) = self.faults.get_mut(row) {
            *place = Some(RowFault::FailedRead);
            self.left_out.spikes -= 1;
            self.left_out.failed_reads += 1;
        }
    }
}

/// The limits that a pass applies to spikes.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sought {
    /// Least difference of a spike, in scales.
    far: f64,
    /// Most consecutive rows of a spike.
    longest: usize,
}

impl Sought {
    /// The limits of the next pass, where these spikes are known.
    fn after(self, spikes: &[usize], rows: usize) -> Self {
        Self { far: closest(spikes.len(), rows).min(self.far), longest: longest(spikes, rows).max(self.longest) }
    }
}

/// Scales by which a spike stands out where this many are known: the gate loses few honest samples and finds many bad
/// ones.
fn closest(spikes: usize, rows: usize) -> f64 {
    let tails = HONEST * spikes as f64 / rows.max(1) as f64;
    stats::normal_quantile(1.0 - (tails / 2.0).clamp(1e-12, 0.4)).clamp(NEAR, FAR)
}

/// Most consecutive spikes, where these are known: twice the longest burst, where bursts that are together too long for
/// one burst may touch by chance.
fn longest(spikes: &[usize], rows: usize) -> usize {
    let mut spikes = spikes.to_vec();
    spikes.sort_unstable();
    let lengths = spikes.chunk_by(|row, next| row + 1 == *next).map(<[usize]>::len);
    let (bursts, longest) = lengths
        .filter(|length| (LONGEST / 2 + 1..=LONGEST).contains(length))
        .fold((0_usize, 0), |(bursts, longest), length| (bursts + 1, longest.max(length)));
    // Each burst ends at the row before another burst with the chance that a burst begins in a given row.
    let touching = (bursts * bursts) as f64 / rows.max(1) as f64;
    if touching > TOUCHING { 2 * longest } else { LONGEST }
}

/// Factor for the scale of a short block, since a scale from few differences may be half of the true one.
fn few(block: &Range<usize>) -> f64 {
    1.0 + 2.0 / (block.len().clamp(2, 256) as f64).sqrt()
}

/// A sample that differs from both sides by more than this is not noise of this scale.
pub(super) fn limit(character: &Character, scale: f64, block: &Range<usize>) -> f64 {
    limit_of(FAR, character, scale, block)
}

fn limit_of(far: f64, character: &Character, scale: f64, block: &Range<usize>) -> f64 {
    far * few(block) * scale.max(STEP * character.step)
}

fn look(
    found: &Screening,
    values: &[f64],
    character: &Character,
    piece: &Piece,
    layout: &RecordLayout<'_>,
    Sought { far, longest }: Sought,
    spikes: &mut Vec<usize>,
) {
    let block = &layout.blocks[piece.block];
    // For a sensor that is read more often than it updates, most neighbours are equal. Then the rows that move give the
    // scale.
    let is_polled = piece.moving_scale > POLLED * piece.scale && character.chance_of_repeat(piece) < stale::COMMON;
    let moving_scale = if is_polled { piece.moving_scale } else { 0.0 };
    let limit_beside = |scale: f64| limit_of(far, character, scale.max(moving_scale), block);
    let limit = limit_beside(piece.scale);
    // If a median of five lies far away, one of the next three samples lies far away too.
    let first = piece.rows.start.max(block.start + 3).min(piece.rows.end);
    let candidates = |from: usize, to: usize| {
        let (low, high) = character.extremes.around(piece.block, &(from - 3..to));
        if high - low <= limit {
            return 0;
        }
        let lag = |lag: usize| values[from - lag..to - lag].iter();
        let beside = values[from..to].iter().zip(lag(1)).zip(lag(2)).zip(lag(3));
        beside
            .map(|(((x, a), b), c)| {
                u32::from(((x - a).abs() > limit) | ((x - b).abs() > limit) | ((x - c).abs() > limit))
            })
            .sum::<u32>()
    };
    let mut consider = |row: usize| {
        if !found.keeps(row) {
            return;
        }
        let leaves = if layout.still { leaves_level(found, values, block, row, limit, longest) } else { None };
        if leaves == Some(true) {
            spikes.push(row);
        } else if leaves.is_none() && stands_out(found, values, block, row, limit) {
            let beside = row.saturating_sub(BESIDE).max(block.start)..(row + BESIDE).min(block.end);
            if stands_out(found, values, block, row, limit_beside(character::scale(&values[beside]))) {
                spikes.push(row);
            }
        }
    };
    (piece.rows.start..first).for_each(&mut consider);
    let mut from = first;
    while from < piece.rows.end {
        let to = (from + PART).min(piece.rows.end);
        // Beside rows that are left out the next three samples are not enough.
        let holes = found.left_out.total() > 0 && (from.saturating_sub(SIDE)..to).any(|row| !found.keeps(row));
        if holes || candidates(from, to) > 0 {
            (from..to).for_each(&mut consider);
        }
        from = to;
    }
}

/// Whether a sample differs by more than a limit, to the same side, from the medians of its neighbours left and right.
fn stands_out(found: &Screening, values: &[f64], block: &Range<usize>, row: usize, limit: f64) -> bool {
    let value = values[row];
    let left = median(found, values, (row.saturating_sub(REACH).max(block.start)..row).rev());
    let right = median(found, values, row + 1..(row + 1 + REACH).min(block.end));
    match (left, right) {
        (Some(left), Some(right)) if (right - left).abs() > limit => leaves_motion(found, values, block, row, limit),
        (Some(left), Some(right)) => one_sided(value - left, value - right).abs() > limit,
        (Some(side), None) | (None, Some(side)) => (value - side).abs() > limit,
        (None, None) => false,
    }
}

/// Whether a sample lies farther from the levels on both sides than their samples spread. This finds consecutive
/// spikes, which hide each other from their nearest neighbours. `Some(false)`: the sample lies on the level, as good
/// samples between spikes do. `None`: the level does not decide, or too many consecutive rows leave it.
fn leaves_level(
    found: &Screening,
    values: &[f64],
    block: &Range<usize>,
    row: usize,
    limit: f64,
    longest: usize,
) -> Option<bool> {
    let value = values[row];
    let near = ON_LEVEL * limit;
    let (mut left, mut right) = ([0.0; LEVEL], [0.0; LEVEL]);
    let left = beside(found, values, (row.saturating_sub(2 * LEVEL).max(block.start)..row).rev(), &mut left);
    let right = beside(found, values, row + 1..(row + 1 + 2 * LEVEL).min(block.end), &mut right);
    if left.len().min(right.len()) < SIDE {
        return None;
    }
    if has_median_near(left, value, near) && has_median_near(right, value, near) {
        return Some(false);
    }
    let (to_left, to_right) = (value - stats::median(left), value - stats::median(right));
    if to_left.abs().max(to_right.abs()) < near {
        return Some(false);
    }
    let off = one_sided(to_left, to_right);
    if off.abs() <= limit || (to_left - to_right).abs() > limit {
        return None;
    }
    let level = value - f64::midpoint(to_left, to_right);
    let leaves = |row: &usize| (values[*row] - level) * off.signum() > near;
    let on_end = (block.start..row).rev().take_while(leaves).take(longest).count()
        + (row + 1..block.end).take_while(leaves).take(longest).count();
    if on_end >= longest {
        return None;
    }
    let mut spread: Vec<f64> = left.iter().chain(&*right).map(|value| (value - level).abs()).collect();
    (off.abs() > FAR * stats::median(&mut spread) / stats::MEDIAN_DEVIATION).then_some(true)
}

/// The smaller of two differences of one sign; 0 where their signs differ.
fn one_sided(left: f64, right: f64) -> f64 {
    match left.signum() == right.signum() {
        true if left.abs() < right.abs() => left,
        true => right,
        false => 0.0,
    }
}

/// Whether a sample leaves the lines through its neighbours on both sides, where these move so fast that medians hide
/// it. The sample leaves them by more than noise does, and by much more than the samples beside it, which a curved
/// motion also moves off the lines.
///
/// A motion that bends also leaves both lines to one side, as where a low-pass rounds the beginning of a ramp. But it
/// lies on the other side of the chord between the nearest neighbours. A spike leaves lines and chord to the same side.
fn leaves_motion(found: &Screening, values: &[f64], block: &Range<usize>, row: usize, limit: f64) -> bool {
    let sides = |row: usize| {
        let left = line(found, values, (row.saturating_sub(REACH).max(block.start)..row).rev(), row)?;
        Some((values[row] - left, values[row] - line(found, values, row + 1..(row + 1 + REACH).min(block.end), row)?))
    };
    let Some((left, right)) = sides(row) else { return false };
    let off = one_sided(left, right);
    let from_chord = chord(found, values, block, row).map_or(off, |chord| values[row] - chord);
    if off.abs() <= LINES * limit || from_chord * off.signum() < ON_LEVEL * limit {
        return false;
    }
    let off = off.abs();
    let beside = row.saturating_sub(CURVE).max(block.start)..(row + CURVE + 1).min(block.end);
    let mut usual: Vec<f64> = beside
        .filter(|other| *other != row && found.keeps(*other))
        .filter_map(|other| sides(other).map(|(left, right)| f64::midpoint(left, right).abs()))
        .collect();
    !usual.is_empty() && off > CURVED * stats::median(&mut usual)
}

/// The value, at a row, of the line between the nearest rows that are used on both sides.
fn chord(found: &Screening, values: &[f64], block: &Range<usize>, row: usize) -> Option<f64> {
    let left = (row.saturating_sub(REACH).max(block.start)..row).rev().find(|other| found.keeps(*other))?;
    let right = (row + 1..(row + 1 + REACH).min(block.end)).find(|other| found.keeps(*other))?;
    Some(values[left] + (values[right] - values[left]) * (row - left) as f64 / (right - left) as f64)
}

/// The value, at a row, of the line through the next rows that are used: median of their slopes, median of the
/// remainders.
fn line(found: &Screening, values: &[f64], rows: impl Iterator<Item = usize>, row: usize) -> Option<f64> {
    let points: Vec<(f64, f64)> = rows
        .filter(|row| found.keeps(*row))
        .take(SIDE)
        .map(|other| (other as f64 - row as f64, values[other]))
        .collect();
    let mut slopes: Vec<f64> = Vec::with_capacity(SIDE * (SIDE - 1) / 2);
    for (at, (x, y)) in points.iter().enumerate() {
        slopes.extend(points[at + 1..].iter().map(|(other_x, other_y)| (other_y - y) / (other_x - x)));
    }
    if points.len() < 3 {
        return None;
    }
    let slope = stats::median(&mut slopes);
    Some(stats::median(&mut points.iter().map(|(x, y)| y - slope * x).collect::<Vec<_>>()))
}

/// Median of the next rows that are used. At the edge of a block two rows are enough; one row is not.
fn median(found: &Screening, values: &[f64], rows: impl Iterator<Item = usize>) -> Option<f64> {
    let mut room = [0.0; SIDE];
    let beside = beside(found, values, rows, &mut room);
    (beside.len() > 1).then(|| stats::median(beside))
}

/// The values of the next rows that are used, as many as fit the buffer.
fn beside<'a>(
    found: &Screening,
    values: &[f64],
    rows: impl Iterator<Item = usize>,
    room: &'a mut [f64],
) -> &'a mut [f64] {
    let mut count = 0;
    for row in rows.filter(|row| found.faults[*row].is_none()) {
        if count == room.len() {
            break;
        }
        room[count] = values[row];
        count += 1;
    }
    &mut room[..count]
}

/// Whether the median of some values certainly lies nearer to `value` than `near`: both middle values lie nearer then.
/// This function counts, in a tenth of the time of a median.
fn has_median_near(beside: &[f64], value: f64, near: f64) -> bool {
    let (below, above) = beside.iter().fold((0_u64, 0_u64), |(below, above), other| {
        let off = value - other;
        (below + u64::from(off >= near), above + u64::from(off <= -near))
    });
    let most = (beside.len() as u64 - 1) / 2;
    below <= most && above <= most
}
