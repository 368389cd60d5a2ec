//! The only source of the events of a run. The journal numbers, times and folds each event, and passes it to the record
//! before others hear of it.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use chrono::{DateTime, FixedOffset, Local, TimeDelta};
use gnc_executive::event::{Event, EventKind};
use gnc_executive::state::RunState;
use gnc_records::store::{RawFile, RecordWriter, StoreError};
use tokio::time::Instant;

/// Emits the events of one run.
#[derive(Debug)]
pub struct RunJournal {
    writer: RecordWriter,
    state: Arc<Mutex<RunState>>,
    began: Instant,
    /// The date of the beginning, if dates follow the run's own clock and not the computer's.
    dated: Option<DateTime<FixedOffset>>,
}

impl RunJournal {
    /// A journal without events.
    #[must_use]
    pub fn new(writer: RecordWriter) -> Self {
        let state = writer.state();
        Self { writer, state, began: Instant::now(), dated: None }
    }

    /// A journal that begins at this date and counts on by the run's clock, independent of the computer's calendar. It
    /// is for runs that must repeat.
    #[must_use]
    pub fn dated(writer: RecordWriter, began: DateTime<FixedOffset>) -> Self {
        Self { dated: Some(began), ..Self::new(writer) }
    }

    /// The date after this time since the beginning.
    fn date(&self, elapsed_us: u64) -> DateTime<FixedOffset> {
        match self.dated {
            Some(began) => began + TimeDelta::microseconds(elapsed_us.cast_signed()),
            None => Local::now().fixed_offset(),
        }
    }

    /// Emits an event. After the end of an item or of the run the record must be believable, nothing may be powered before the
    /// beginning is in the chain, and a capture that the journal does not name is made again: for these events the call returns
    /// only when they are on disk.
    ///
    /// # Errors
    /// [`StoreError`] when this or an earlier event could not be written.
    pub async fn emit(&self, kind: EventKind) -> Result<(), StoreError> {
        let must_be_on_disk = matches!(
            kind,
            EventKind::RunStarted { .. }
                | EventKind::Captured(_)
                | EventKind::ItemEnded { .. }
                | EventKind::RunEnded(_)
        );
        // First a place, then the number: a caller that is dropped while it waits takes no number, and events reach the
        // record in the order of their numbers.
        let place = self.writer.place().await?;
        let written = {
            let mut state = self.lock();
            let elapsed_us = u64::try_from(self.began.elapsed().as_micros()).unwrap_or(u64::MAX);
            let event = Event { seq: state.next_seq(), at: self.date(elapsed_us), elapsed_us, kind };
            state.apply(&event).map_err(StoreError::OutOfOrder)?;
            place.write(event, must_be_on_disk)
        };
        written.synced().await
    }

    /// Opens a file for the raw samples of an attempt.
    ///
    /// # Errors
    /// [`StoreError`].
    pub(crate) async fn raw(&self, item: &str, attempt: u32, repeat: u32) -> Result<RawFile, StoreError> {
        self.writer.raw(item, attempt, repeat).await
    }

    /// Waits until every raw file is whole.
    pub(crate) async fn raw_files_ended(&self) {
        self.writer.raw_files_ended().await;
    }

    /// Where the run's record is.
    #[must_use]
    pub(crate) fn folder(&self) -> &std::path::Path {
        self.writer.folder()
    }

    /// Looks at the run as it stands.
    pub fn look<T>(&self, look: impl FnOnce(&RunState) -> T) -> T {
        look(&self.lock())
    }

    fn lock(&self) -> MutexGuard<'_, RunState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Ends the record.
    pub async fn close(self) -> Result<(), StoreError> {
        self.writer.close().await
    }
}
