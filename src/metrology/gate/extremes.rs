//! A channel in parts: the smallest and the largest value of each part, and the places in a part where a condition
//! holds. Most parts hold nothing that the gate looks for; the gate passes over them at memory speed.

use std::ops::Range;

use crate::stats;

/// Rows of a part. Each piece begins with a part.
pub(super) const PART: usize = 64;

/// Ranges of the parts of one channel, block after block.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Extremes {
    parts: Vec<(f64, f64)>,
    /// First row and first part of each block.
    blocks: Vec<(usize, usize)>,
}

impl Extremes {
    /// Begins a block at a row.
    pub(super) fn begin(&mut self, row: usize) {
        self.blocks.push((row, self.parts.len()));
    }

    /// Adds the next rows of the block: whole parts, unless they are its last ones.
    pub(super) fn add(&mut self, values: &[f64]) {
        self.parts.extend(values.chunks(PART).map(stats::range));
    }

    /// Smallest and largest value of each part of a block.
    pub(super) fn of_block(&self, block: usize) -> &[(f64, f64)] {
        let start = self.blocks[block].1;
        let end = self.blocks.get(block + 1).map_or(self.parts.len(), |(_, part)| *part);
        &self.parts[start..end]
    }

    /// Smallest and largest value of all parts that these rows of a block touch.
    pub(super) fn around(&self, block: usize, rows: &Range<usize>) -> (f64, f64) {
        let (first, part) = self.blocks[block];
        let at = |row: usize| part + (row - first) / PART;
        self.parts[at(rows.start)..=at(rows.end - 1)]
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), part| (low.min(part.0), high.max(part.1)))
    }
}

/// The places in a part where a condition holds. Most parts have no such place. The first test has no early end, so
/// that the compiler can use vectors.
pub(super) fn places(is_so: impl Iterator<Item = bool> + Clone) -> impl Iterator<Item = usize> {
    let mut places = [0_usize; PART];
    let mut count = 0;
    if is_so.clone().fold(false, |any, is_so| any | is_so) {
        for (place, is_so) in is_so.take(PART).enumerate() {
            // No branch here, since the condition is as good as random.
            places[count % PART] = place;
            count += usize::from(is_so);
        }
    }
    places.into_iter().take(count)
}
