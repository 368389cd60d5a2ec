//! The board's memory of the errors that it found.

use std::collections::VecDeque;

use gnc_protocol::message::{ErrorKind, ErrorRecord, ErrorRecordsReply};

/// Number of records that are kept; older ones are dropped.
pub(crate) const KEPT: usize = 64;
/// Records that one request may leave: a dead memory must not push out the findings of other requests.
pub(crate) const PER_REQUEST: usize = 4;

/// The request that found an error, and the time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Finder {
    /// The host's number of the request.
    pub request: u16,
    /// Its message id.
    pub message: u16,
    /// Board time, in microseconds.
    pub board_time_us: u64,
}

/// An error that was found.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ErrorFinding {
    /// Its kind.
    pub kind: ErrorKind,
    /// Its place.
    pub place: u32,
    /// The expected value.
    pub expected: u32,
    /// The value found.
    pub got: u32,
}

/// The last records of a session.
#[derive(Debug, Clone, Default)]
pub(crate) struct ErrorLog {
    kept: VecDeque<ErrorRecord>,
    total: u16,
}

impl ErrorLog {
    /// Notes the first few findings of a request.
    pub(crate) fn note(&mut self, finder: Finder, findings: impl IntoIterator<Item = ErrorFinding>) {
        for finding in findings.into_iter().take(PER_REQUEST) {
            if self.kept.len() == KEPT {
                self.kept.pop_front();
            }
            self.kept.push_back(ErrorRecord {
                index: self.total,
                request: finder.request,
                message: finder.message,
                kind: finding.kind as u16,
                board_time_us: finder.board_time_us,
                place: finding.place,
                expected: finding.expected,
                got: finding.got,
            });
            self.total = self.total.saturating_add(1);
        }
    }

    /// Records from an index on, as many as fit into a reply.
    #[must_use]
    pub(crate) fn from(&self, index: u16) -> ErrorRecordsReply {
        let mut reply = ErrorRecordsReply { total: self.total, ..ErrorRecordsReply::default() };
        // The host asks for further records with the next index.
        for record in self.kept.iter().filter(|record| record.index >= index).take(IN_A_REPLY) {
            let _ = reply.records.push(record.clone());
        }
        reply
    }
}

/// The bound of the list: 16 records of 28 bytes.
const IN_A_REPLY: usize = 16;
