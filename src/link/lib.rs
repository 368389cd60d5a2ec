//! Ways to reach a slave board: RS-422 by a serial port, CAN by the kernel or by an slcan adapter, a cable in memory.
//!
//! A link carries frames, looks for a port that went away, and counts what the line lost or damaged. It does not know
//! what the frames mean: `gnc-board` asks, waits and repeats.

mod absence;
pub mod can;
mod doubt;
mod link;
pub mod memory;
mod received;
pub mod serial;
mod tape;
mod target;

pub use absence::RETURNS_WITHIN;
pub use doubt::Doubt;
pub use link::{Link, LinkError};
pub use received::{LinkEvent, NoFrame};
pub use tape::Tape;
pub use target::Target;
