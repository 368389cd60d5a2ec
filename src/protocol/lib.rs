//! The messages and bytes between the host and the slave test board.
//!
//! `docs/ICD.md` is the contract; this crate is its Rust form. It holds frames for RS-422 ([`serial`]), messages with
//! their byte layouts ([`message`]), calibrations ([`calibration`]), sample streams ([`stream`]), the same over CAN
//! ([`can`]) and the board's end of the conversation ([`slave`]). It has no I/O, no clock and no allocator: bytes and
//! link time go in, frames come out.
#![no_std]

pub mod analogue;
pub mod calibration;
pub mod can;
pub mod error;
pub mod frame;
pub mod message;
pub mod pattern;
pub mod serial;
pub mod slave;
pub mod stream;
pub mod timing;
pub mod wire;

pub use error::{FaultCode, NakCode};
pub use frame::{Flags, Frame, Header, Kind, MAX_PAYLOAD, PROTOCOL_VERSION, Payload};
pub use message::{Call, Request};
