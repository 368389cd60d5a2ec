//! ISO 15765-2 (ISO-TP) over classic CAN, normal addressing: one message of up to 4095 bytes in frames of eight.
//!
//! [`IsoTpSender`] and [`IsoTpReceiver`] are the two state machines for one id in one direction; link time is passed
//! in. They take any frames without a panic, and every wait has an end.

mod receiver;
mod sender;

use core::time::Duration;

pub use receiver::{Failure, FlowSettings, IsoTpReceived, IsoTpReceiver};
pub use sender::{IsoTpSender, SendError, StartError};

/// Longest message whose length fits into the twelve bits of a first frame.
pub const MAX_PDU: usize = 4095;
/// N_Bs: how long the sender waits for flow control.
pub const N_BS: Duration = Duration::from_millis(1000);
/// N_Cr: how long the receiver waits for the next consecutive frame.
pub const N_CR: Duration = Duration::from_millis(1000);
/// N_WFTmax: how often in a row flow control may say "wait". Without this bound a sender would hang.
pub const MAX_WAITS: u8 = 10;

/// Upper four bits of the first byte.
const SINGLE: u8 = 0x0;
const FIRST: u8 = 0x1;
const CONSECUTIVE: u8 = 0x2;
const FLOW: u8 = 0x3;

/// Bytes of a message in a single frame, at most.
const IN_SINGLE: usize = 7;
/// Bytes of a message in a first frame.
const IN_FIRST: usize = 6;
/// Bytes of a message in a consecutive frame, at most.
const IN_CONSECUTIVE: usize = 7;

/// Whether the data of a frame is flow control, which is for the sender; all other frames are for the receiver.
#[must_use]
pub fn is_flow_control(data: &[u8]) -> bool {
    data.first().is_some_and(|first| first >> 4 == FLOW)
}

/// The flow control that a receiver sends to the sender.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flow {
    /// Go on: this many consecutive frames (0: all), with at least this separation.
    Continue {
        /// Frames up to the next flow control; 0: no more flow control.
        block_size: u8,
        /// STmin as its byte on the wire, see [`separation`].
        st_min: u8,
    },
    /// Wait for another flow control.
    Wait,
    /// The message is too long for the receiver.
    Overflow,
}

impl Flow {
    /// The three bytes of the frame.
    #[must_use]
    pub fn to_bytes(self) -> [u8; 3] {
        match self {
            Self::Continue { block_size, st_min } => [FLOW << 4, block_size, st_min],
            Self::Wait => [FLOW << 4 | 1, 0, 0],
            Self::Overflow => [FLOW << 4 | 2, 0, 0],
        }
    }

    /// Reads flow control; `None` for anything else, an unknown flow status and too few bytes.
    #[must_use]
    pub fn from_bytes(data: &[u8]) -> Option<Self> {
        match *data {
            [0x30, block_size, st_min, ..] => Some(Self::Continue { block_size, st_min }),
            [0x31, _, _, ..] => Some(Self::Wait),
            [0x32, _, _, ..] => Some(Self::Overflow),
            _ => None,
        }
    }
}

/// The time that an STmin byte stands for: 0..0x7F milliseconds, 0xF1..0xF9 for 100..900 microseconds. Reserved bytes
/// stand for the longest time, 127 ms.
#[must_use]
pub fn separation(st_min: u8) -> Duration {
    match st_min {
        0..=0x7f => Duration::from_millis(st_min.into()),
        0xf1..=0xf9 => Duration::from_micros(u64::from(st_min - 0xf0) * 100),
        _ => Duration::from_millis(127),
    }
}
