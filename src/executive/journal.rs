//! A run's journal: its events as JSON lines, and the fold of a stored journal.
//!
//! Each event is one line, appended at once. If a station loses its power, the last line of its journal may be cut off.
//! Zero bytes may follow if the file system had no time for the data. That run is interrupted, and all earlier events
//! are good.
//!
//! A later version of the station may add kinds of events and values, or raise the number of the schema that the first
//! event names. Such a journal is refused as [`JournalError::Newer`]; it is not damaged. Any other journal that cannot
//! be read is damaged. A misspelt name looks like a new one: only the digests of the record tell the two apart.

mod kept;
mod lines;
mod newer;

use std::io::{self, BufRead};

use crate::event::{EVENTS_SCHEMA, Event, EventKind, SELECTION_SCHEMA};
use crate::state::{OutOfOrder, RunState};

pub use kept::{Kept, MOST_KEPT};
pub use lines::{JournalLines, LONGEST_LINE};
pub use newer::Unknown;

/// The content of a stored journal.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredJournal {
    /// The run after the last whole event; [`RunState::is_interrupted`] if it has no end.
    pub state: RunState,
    /// Bytes of the whole events, line ends included.
    pub good_bytes: usize,
    /// Bytes after the whole events: the event that was being written.
    pub cut_bytes: usize,
}

/// Why a journal is refused.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// A line is not an event.
    #[error("line {line} of the journal is not an event")]
    NotAnEvent {
        /// Number of the line, from 1.
        line: usize,
        /// What the parser says.
        source: serde_json::Error,
    },
    /// A later version of the station wrote the journal, and this version does not know all of its content.
    #[error("written by a newer version of the station ({unknown})")]
    Newer {
        /// Number of the line, from 1.
        line: usize,
        /// The content that this version does not know.
        unknown: Unknown,
    },
    /// The first event names a schema that no version of the station has.
    #[error(
        "line {line} of the journal has the schema {}, and this program reads {EVENTS_SCHEMA} and {SELECTION_SCHEMA}",
        gnc_text::quoted(schema)
    )]
    OtherSchema {
        /// Number of the line, from 1.
        line: usize,
        /// The schema.
        schema: String,
    },
    /// No version of the station writes such a line.
    #[error("line {line} of the journal is longer than {LONGEST_LINE} bytes")]
    LineTooLong {
        /// Number of the line, from 1.
        line: usize,
    },
    /// No run of the station says so much.
    #[error("up to line {line} the journal would take more than {} MiB of memory", MOST_KEPT >> 20)]
    TooMuch {
        /// Number of the line, from 1.
        line: usize,
    },
    /// An event cannot follow those before it.
    #[error("line {line} of the journal contradicts the lines before it")]
    OutOfOrder {
        /// Number of the line, from 1.
        line: usize,
        /// What is out of order.
        source: OutOfOrder,
    },
}

/// Why a journal that is read piece by piece gives no run.
#[derive(Debug, thiserror::Error)]
pub enum FoldError {
    /// The file cannot be read on.
    #[error("the journal cannot be read")]
    Read(#[source] io::Error),
    /// What was read is no journal.
    #[error(transparent)]
    Journal(#[from] JournalError),
}

/// The event as a line with its end, ready to be appended.
///
/// # Errors
/// Never for today's events; the serializer's type allows an error.
pub fn line(event: &Event) -> Result<String, serde_json::Error> {
    let mut line = serde_json::to_string(event)?;
    line.push('\n');
    Ok(line)
}

/// Folds a stored journal; an empty journal gives an empty state.
///
/// # Errors
/// A line other than the last is damaged, events do not follow from each other, or a later version wrote them.
pub fn fold(bytes: &[u8]) -> Result<StoredJournal, JournalError> {
    fold_from(bytes).map_err(|error| match error {
        FoldError::Journal(error) => error,
        // Bytes in memory can always be read.
        FoldError::Read(source) => JournalError::NotAnEvent { line: 0, source: serde::de::Error::custom(source) },
    })
}

/// Folds a journal line by line, so that no more than one line of it is in memory.
///
/// # Errors
/// As [`fold`], and the file cannot be read.
pub fn fold_from(source: impl BufRead) -> Result<StoredJournal, FoldError> {
    let mut lines = JournalLines::new(source);
    let mut state = RunState::new();
    let mut kept = Kept::default();
    let mut good_bytes = 0;
    while let Some(piece) = lines.next_line()? {
        let line = piece.number;
        Kept::check_line(line, piece.bytes)?;
        let event: Event = match serde_json::from_slice(piece.bytes) {
            Ok(event) => event,
            // Only the last line can be cut off, and then it has no line end. A line that lacks only its end is whole.
            Err(source) => match newer::unknown(piece.bytes, &source, state.next_seq()) {
                Some(unknown) => return Err(JournalError::Newer { line, unknown }.into()),
                None if !piece.bytes.ends_with(b"\n") => break,
                None => return Err(JournalError::NotAnEvent { line, source }.into()),
            },
        };
        if let EventKind::RunStarted { header, .. } = &event.kind
            && ![EVENTS_SCHEMA, SELECTION_SCHEMA].contains(&header.schema.as_str())
        {
            let schema = header.schema.clone();
            return Err(match newer::schema(&schema) {
                Some(unknown) => JournalError::Newer { line, unknown },
                None => JournalError::OtherSchema { line, schema },
            }
            .into());
        }
        // The state keeps the first notes only, and the journal of a long run may have many.
        if !matches!(event.kind, EventKind::Note { .. }) || !state.has_all_notes() {
            kept.add(line, piece.bytes, &event.kind)?;
        }
        good_bytes += piece.bytes.len();
        state.apply(&event).map_err(|source| JournalError::OutOfOrder { line, source })?;
    }
    // The last line may lack its end, and zeros may follow it.
    let cut_bytes = lines.bytes_read() - good_bytes;
    Ok(StoredJournal { state, good_bytes, cut_bytes })
}

#[cfg(test)]
mod tests;
