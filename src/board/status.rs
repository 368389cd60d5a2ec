//! What the board and the line to it tell beside answers and streams.

use std::time::Duration;

/// An absence of the port or interface that is over.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LinkAbsence {
    /// The port or interface.
    pub name: String,
    /// How long it was away.
    pub lasted: Duration,
}

/// The board's last report of its own time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BoardTime {
    /// Board time in microseconds.
    pub board_time_us: u64,
    /// Heartbeats since the session's start.
    pub beats: u32,
}

/// How far the running request is, for people; some of these may be skipped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Advance {
    /// Share done, 0 to 1000.
    pub done_permille: u16,
    /// Board time spent.
    pub elapsed_ms: u32,
    /// Board time expected in all.
    pub expected_ms: u32,
}
