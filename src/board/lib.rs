//! The slave board as the station sees it: typed calls, streams, and a plain word when it restarts or falls silent.
//!
//! [`Board`] is a handle; the conversation itself (`conversation.rs`) is a task that owns the link, repeats what was
//! lost and keeps the board's watchdog quiet. The crate does not know what is tested, and it does not say whose fault a restart
//! is.

mod client;
mod conversation;
mod desk;
mod error;
pub mod latest;
mod readings;
mod status;
pub mod stream;
#[cfg(test)]
mod tests;

pub use client::Board;
pub use conversation::{Answer, LinkReport};
pub use desk::Desk;
pub use error::BoardError;
pub use readings::{Readings, StreamReading};
pub use status::{Absent, Advance, Pulse};
