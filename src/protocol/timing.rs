//! Times of the link, in wall time on both ends. Process times (an erase, a fix) belong to the board and have no bound
//! here: a request lives as long as its PROGRESS comes.

use core::time::Duration;

/// The board accepts or refuses a request within this time of its last byte, wire time not counted.
pub const ACCEPT_WITHIN: Duration = Duration::from_millis(50);
/// How often a request without an ACCEPT is sent again under the same id. Three losses in a row at a bit error
/// rate of 1e-6 and full frames happen once in 10^7 requests.
pub const RESENDS: u32 = 3;
/// The board sends PROGRESS at least this often while a request runs.
pub const PROGRESS_EVERY: Duration = Duration::from_millis(500);
/// The host asks again after this long without a sign of life from an accepted request: three missed PROGRESS.
pub const PROGRESS_LOST_AFTER: Duration = Duration::from_millis(1500);
/// Time between two heartbeats of the board.
pub const HEARTBEAT_EVERY: Duration = Duration::from_millis(1000);
/// Time between two keep-alives of the host.
pub const KEEP_ALIVE_EVERY: Duration = Duration::from_millis(500);
/// The board makes itself safe after this long without a KEEP_ALIVE, REQUEST or HELLO. Three keep-alives may be lost.
/// Including the time to act, the board is safe within 2 s of the last one.
pub const WATCHDOG: Duration = Duration::from_millis(1750);

/// Bits on an 8N1 line for one byte.
pub const BITS_PER_BYTE: u32 = 10;

/// Time that `bytes` need on an 8N1 line.
#[must_use]
pub fn wire_time(bytes: usize, rate_baud: u32) -> Duration {
    let bits = bytes as u64 * u64::from(BITS_PER_BYTE);
    Duration::from_micros((bits * 1_000_000).div_ceil(u64::from(rate_baud.max(1))))
}
