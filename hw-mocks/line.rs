//! One direction of the RS-422 line: bytes leave it at the pace of 8N1.

use std::time::Duration;

use gnc_protocol::timing::BITS_PER_BYTE;

/// Longest line time of a piece in which bytes are handed on, as the buffers of a serial adapter do.
const PIECE: Duration = Duration::from_millis(1);

/// Number of bytes taken from the front after which the rest is moved down.
const KEPT: usize = 64 * 1024;

/// Bytes on their way.
#[derive(Debug, Default)]
pub(crate) struct ByteLine {
    bytes: Vec<u8>,
    /// Number of bytes at the front that have passed and were taken.
    taken: usize,
    /// Time of a byte in ns; 0 for a line without pace.
    byte_ns: u64,
    /// The time at which the byte before the first in the queue has passed.
    free_at: Duration,
}

impl ByteLine {
    /// A line with this rate; `None` for a line without pace.
    pub(crate) fn new(rate_baud: Option<f64>) -> Self {
        let byte_ns = rate_baud.map_or(0, |baud| (f64::from(BITS_PER_BYTE) * 1e9 / baud.max(1.0)) as u64);
        Self { byte_ns, ..Self::default() }
    }

    pub(crate) fn len(&self) -> usize {
        self.bytes.len() - self.taken
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub(crate) fn clear(&mut self) {
        self.bytes.clear();
        self.taken = 0;
    }

    pub(crate) fn push(&mut self, bytes: &[u8], now: Duration) {
        if self.is_empty() {
            self.free_at = self.free_at.max(now);
        }
        self.bytes.extend_from_slice(bytes);
    }

    /// The bytes that have passed by `now`.
    pub(crate) fn ready(&self, now: Duration) -> &[u8] {
        let through = match self.byte_ns {
            0 => self.len(),
            byte_ns => (now.saturating_sub(self.free_at).as_nanos() / u128::from(byte_ns)) as usize,
        };
        &self.bytes[self.taken..][..through.min(self.len())]
    }

    /// Removes bytes from the front.
    pub(crate) fn consume(&mut self, count: usize) {
        self.taken += count.min(self.len());
        if self.is_empty() {
            self.clear();
        } else if self.taken >= KEPT {
            self.bytes.drain(..self.taken);
            self.taken = 0;
        }
        self.free_at += Duration::from_nanos(self.byte_ns * count as u64);
    }

    /// The time at which the next piece has passed.
    pub(crate) fn next_due(&self) -> Option<Duration> {
        if self.is_empty() {
            return None;
        }
        let bytes = self.len() as u64;
        Some(
            self.free_at
                + Duration::from_nanos(self.byte_ns * bytes).min(PIECE.max(Duration::from_nanos(self.byte_ns))),
        )
    }
}
