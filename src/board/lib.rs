//! The slave board as the station sees it: typed calls, streams, and clear errors when the board restarts or falls
//! silent.
//!
//! [`BoardClient`] is a handle. The conversation itself (`session.rs`) is a task: it owns the link, repeats what was
//! lost and keeps the board's watchdog quiet. The crate does not know what is tested, and it does not say whose fault a
//! restart is.

mod breach;
mod client;
mod error;
pub mod latest;
mod lease;
mod readings;
pub mod rule;
mod session;
mod status;
pub mod stream;
#[cfg(test)]
mod tests;

pub use client::BoardClient;
pub use error::{BoardError, Heard};
pub use lease::BoardLease;
pub use readings::{Readings, StreamReading};
pub use session::{Answer, LinkReport};
pub use status::{Advance, BoardTime, LinkAbsence};
