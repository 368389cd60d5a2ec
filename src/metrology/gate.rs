//! The gate before every method: it finds the rows of a record that are no measurements.
//!
//! A read that the chip did not answer gives 0, -1 or the end of the range; a disturbance gives one sample far from its
//! neighbours; a sensor that is read more often than it updates repeats the row before; a converter at the end of its
//! range gives one value in place of a tail. Means and integrals would use all of these, so the gate finds them on the
//! channels of one chip at a time, before anything is computed.
//!
//! What counts as rare follows from the record itself: the scale of its noise beside a sample, the step between its
//! codes, and the chance that noise of that scale gives the same code twice. Noise below one code does not show which
//! repeats are faults, and a smooth record without noise shows no faults; both pass.
//!
//! The gate takes a few passes over the values, O(n); it looks closely only at what stands out.

mod character;
mod clipped;
mod excess;
mod extremes;
mod failed;
mod held;
mod mend;
mod smoother;
mod spikes;
mod stale;
mod tails;
#[cfg(test)]
mod tests;

use std::ops::Range;

use crate::{Refusal, quantisation};
use character::Character;

/// Largest share of failed reads and spikes that is left out of means and of fits to points, percent. Up to five rows
/// in a hundred can be separated from the rest. A record with more is refused.
pub const MOST_OF_MEANS_PERCENT: f64 = 5.0;
/// The same share where rows are steps of time, percent. Each row left out is replaced there, and two in a hundred do
/// not show in the interval of an integral or a deviation.
pub const MOST_OF_SERIES_PERCENT: f64 = 2.0;
/// A sensor that is read more often than this for each update counts as one that stops.
const MOST_POLLED: f64 = 10.0;

/// Rows from which the step of an output is learned.
const LEARN_STEP: usize = 1 << 16;

/// What is wrong with a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowFault {
    /// A word in place of a sample: 0, -1, an end of the range, or any word where the sensor cannot have been.
    FailedRead,
    /// Far from its neighbours on both sides.
    Spike,
    /// A repetition of the row before, on all channels, or for long on one.
    Stale,
    /// Cut off at one value.
    Clipped,
}

/// The number of rows left out, by the kind of fault.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// Failed reads.
    pub failed_reads: usize,
    /// Spikes.
    pub spikes: usize,
    /// Stale rows.
    pub stale: usize,
    /// Clipped rows.
    pub clipped: usize,
}

impl LeftOut {
    /// Returns the number of all rows left out.
    #[must_use]
    pub fn total(&self) -> usize {
        self.failed_reads + self.spikes + self.stale + self.clipped
    }

    fn of(&mut self, fault: RowFault) -> &mut usize {
        match fault {
            RowFault::FailedRead => &mut self.failed_reads,
            RowFault::Spike => &mut self.spikes,
            RowFault::Stale => &mut self.stale,
            RowFault::Clipped => &mut self.clipped,
        }
    }
}

/// What the rows mean to a method.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowMeaning {
    /// Samples of a mean or points of a curve: their number and order do not matter.
    Samples,
    /// Steps of time, counted. An additional row adds time that did not pass.
    Steps,
    /// Steps of time whose times were checked against a clock.
    ClockedSteps,
}

/// The layout of a record before the gate.
#[derive(Debug, Clone, Copy)]
pub struct RecordLayout<'a> {
    /// Uninterrupted stretches: positions, runs, captures. Neighbours lie within one stretch.
    pub blocks: &'a [Range<usize>],
    /// Whether each stretch is meant to have one level, so that a value cut off at one side shows.
    pub still: bool,
    /// Output at the end of the range, if known.
    pub range_end: Option<f64>,
}

impl RecordLayout<'_> {
    /// Whether a value is an end of the range: the known end, or that of a word of 8, 12, 16, 20, 24 or 32 bits.
    fn is_end(&self, value: f64) -> bool {
        let of_word = |bits: i32| value == f64::from(bits).exp2() - 1.0 || value == -f64::from(bits).exp2();
        self.range_end.is_some_and(|end| value.abs() >= end) || [7, 11, 15, 19, 23, 31].into_iter().any(of_word)
    }
}

/// A record that is one stretch.
#[must_use]
pub fn one_stretch(rows: usize) -> [Range<usize>; 1] {
    std::array::from_fn(|_| 0..rows)
}

/// The result of the gate.
#[derive(Debug, Clone, PartialEq)]
pub struct Screening {
    faults: Vec<Option<RowFault>>,
    left_out: LeftOut,
    clipped_at: Option<(String, f64)>,
    polled: Option<f64>,
}

impl Screening {
    /// Screens the channels of one chip. `names` are the names of the channels.
    ///
    /// Channels have equal length. The gate ignores values that are not finite; the checks of the method find them.
    #[must_use]
    pub fn of(names: &[&str], channels: &[&[f64]], layout: &RecordLayout<'_>) -> Self {
        let rows = channels.iter().map(|channel| channel.len()).min().unwrap_or(0);
        let mut found = Self { faults: vec![None; rows], left_out: LeftOut::default(), clipped_at: None, polled: None };
        let characters: Vec<Character> =
            channels.iter().map(|values| Character::of(&values[..rows], layout.blocks)).collect();
        failed::at_once(&mut found, channels, &characters, layout);
        for (values, character) in channels.iter().zip(&characters) {
            held::search(&mut found, values, character, layout);
        }
        found.polled = stale::search(&mut found, names, channels, &characters, layout);
        for (values, character) in channels.iter().zip(&characters) {
            spikes::search(&mut found, values, character, layout);
        }
        if layout.still {
            for ((name, values), character) in names.iter().zip(channels).zip(&characters) {
                clipped::search(&mut found, name, values, character, layout.blocks);
            }
        }
        found
    }

    /// Adds the faults that were found on another chip of the same record.
    #[must_use]
    pub fn and(mut self, other: Self) -> Self {
        for (row, fault) in other.faults.iter().enumerate() {
            if let Some(fault) = fault {
                self.mark(row, *fault);
            }
        }
        self.clipped_at = self.clipped_at.or(other.clipped_at);
        self.polled = self.polled.or(other.polled);
        self
    }

    /// Returns the number of rows of the record.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.faults.len()
    }

    /// Returns the number of rows that are left.
    #[must_use]
    pub fn used(&self) -> usize {
        self.rows() - self.left_out.total()
    }

    /// Returns the numbers of rows that are not used.
    #[must_use]
    pub fn left_out(&self) -> &LeftOut {
        &self.left_out
    }

    /// Returns the first row that is not used, from 1.
    #[must_use]
    pub fn first_row(&self) -> Option<usize> {
        if self.left_out.total() == 0 {
            return None;
        }
        self.faults.iter().position(Option::is_some).map(|row| row + 1)
    }

    /// Returns what is wrong with a row, from 0.
    #[must_use]
    pub fn fault(&self, row: usize) -> Option<RowFault> {
        self.faults.get(row).copied().flatten()
    }

    /// Whether a row, from 0, is used.
    #[must_use]
    pub fn keeps(&self, row: usize) -> bool {
        self.fault(row).is_none()
    }

    /// Returns the values of the rows that are used.
    #[must_use]
    pub fn kept<T: Copy>(&self, values: &[T]) -> Vec<T> {
        values.iter().zip(&self.faults).filter(|(_, fault)| fault.is_none()).map(|(value, _)| *value).collect()
    }

    /// Returns a motion in which the line between the neighbours replaces each row left out.
    ///
    /// # Errors
    /// [`Refusal::Unbridged`]: the motion bends where a row is left out, so that the integral is not known to its noise.
    pub fn bridged(&self, name: &str, values: &[f64], blocks: &[Range<usize>]) -> Result<Vec<f64>, Refusal> {
        mend::unbent(name, values, &self.faults, blocks)?;
        Ok(mend::bridge(values, &self.faults, blocks))
    }

    /// Returns noise in which values of the same distribution replace the rows left out.
    #[must_use]
    pub fn refilled(&self, values: &[f64], blocks: &[Range<usize>]) -> Vec<f64> {
        let mut mended = mend::refill(values, &self.faults, blocks);
        // In a record that shows codes, values between the codes would hide the step.
        let kept = self.kept(&values[..values.len().min(LEARN_STEP)]);
        if let (Some(step), Some(first)) = (quantisation::coarse_step(&[&kept]), kept.first()) {
            for row in (0..mended.len()).filter(|row| !self.keeps(*row)) {
                mended[row] = first + ((mended[row] - first) / step).round() * step;
            }
        }
        mended
    }

    /// Checks whether a method may go on with the rows that are left.
    ///
    /// # Errors
    /// [`Refusal::Clipped`], [`Refusal::BadRows`], [`Refusal::Stale`], each with the first row and the share.
    pub fn admit(&self, rows: RowMeaning) -> Result<(), Refusal> {
        let first = |fault| 1 + self.faults.iter().position(|found| *found == Some(fault)).unwrap_or(0);
        let total = self.rows();
        let limit_percent = if rows == RowMeaning::Samples { MOST_OF_MEANS_PERCENT } else { MOST_OF_SERIES_PERCENT };
        let above = |count: usize, limit_percent: f64| count as f64 * 100.0 > limit_percent * total as f64;
        let LeftOut { failed_reads, spikes, stale, clipped } = self.left_out;
        // Where one row in four is bad, the scale is wrong and the end of the noise looks clipped. The refusal names
        // the larger number.
        let mostly_bad = above(failed_reads + spikes, limit_percent) && failed_reads + spikes > clipped;
        if let Some((channel, value)) = self.clipped_at.as_ref().filter(|_| !mostly_bad) {
            let (channel, value) = (channel.clone(), *value);
            return Err(Refusal::Clipped {
                channel,
                value,
                samples: clipped,
                total,
                first_row: first(RowFault::Clipped),
            });
        }
        if above(failed_reads + spikes, limit_percent) {
            let (what, samples, fault) = if failed_reads >= spikes {
                ("failed reads", failed_reads, RowFault::FailedRead)
            } else {
                ("spikes", spikes, RowFault::Spike)
            };
            return Err(Refusal::BadRows { what, samples, total, first_row: first(fault), limit_percent });
        }
        let polled = self.polled.is_some_and(|rows| rows <= MOST_POLLED);
        let too_many = match rows {
            RowMeaning::Samples => above(stale, limit_percent) && !polled,
            RowMeaning::Steps => stale > 0,
            RowMeaning::ClockedSteps => above(stale, limit_percent),
        };
        if too_many {
            let rows_per_update = self.polled.map(|_| total as f64 / (total - stale).max(1) as f64);
            return Err(Refusal::Stale { samples: stale, total, first_row: first(RowFault::Stale), rows_per_update });
        }
        Ok(())
    }

    /// Returns the rows for each update of a sensor that is read more often than it updates.
    #[must_use]
    pub fn rows_per_update(&self) -> Option<f64> {
        self.polled
    }

    /// Notes where and at which value a channel is cut off; only the first place counts.
    fn cut_at(&mut self, name: &str, block: usize, blocks: &[Range<usize>], value: f64) {
        let channel = if blocks.len() > 1 { format!("{name} of stretch {}", block + 1) } else { name.to_owned() };
        self.clipped_at.get_or_insert((channel, value));
    }

    /// Marks a row that has no fault yet. Returns whether it did.
    fn mark(&mut self, row: usize, fault: RowFault) -> bool {
        let Some(place @ None) = self.faults.get_mut(row) else { return false };
        *place = Some(fault);
        *self.left_out.of(fault) += 1;
        true
    }
}
