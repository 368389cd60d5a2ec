//! Where the chain ended at one moment at which no station wrote it. Readers take hundreds of thousands of lines apart, and a station
//! that begins or closes a run does not wait for that.

use std::collections::BTreeMap;
use std::path::Path;

use super::CHAIN;
use super::append::lock_shared;
use super::entry::Place;
use super::read::{DayChain, chain_up_to, counter};
use crate::store::{StoreError, reader};

/// The counter and the lengths of all chains, taken while no station wrote. A chain only grows, so what stands before these lengths is
/// what stood there then, however long it takes to read it.
pub(super) struct Snapshot<'a> {
    records: &'a Path,
    /// The days, each with the length of its chain; 0 if it has none.
    days: BTreeMap<String, u64>,
    /// What the counter said.
    pub(super) counted: Result<Option<Place>, StoreError>,
}

impl<'a> Snapshot<'a> {
    /// Where the lock cannot be had, what stands there is taken all the same.
    ///
    /// # Errors
    /// The records folder cannot be read.
    pub(super) fn take(records: &'a Path) -> Result<Self, StoreError> {
        let held = lock_shared(records).ok();
        let length = |day: &String| records.join(day).join(CHAIN).symlink_metadata().map_or(0, |meta| meta.len());
        let days = reader::day_names(records)?.into_iter().map(|day| (length(&day), day));
        let days = days.map(|(length, day)| (day, length)).collect();
        let counted = counter(records);
        drop(held);
        Ok(Self { records, days, counted })
    }

    /// The days, oldest first.
    pub(super) fn days(&self) -> impl Iterator<Item = &str> {
        self.days.keys().map(String::as_str)
    }

    /// The chain of a day, as it was.
    ///
    /// # Errors
    /// It cannot be read.
    pub(super) fn chain_of(&self, day: &str) -> Result<Option<DayChain>, StoreError> {
        chain_up_to(self.records, day, self.days.get(day).copied().unwrap_or(0))
    }
}
