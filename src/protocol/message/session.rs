//! What opens, keeps and ends a session, and the heads of the answers.

use crate::error::FaultCode;
use crate::wire::{FieldReader, FieldWriter, Text, Wire, WireError, wire_struct};

/// First bytes of every HELLO.
pub const MAGIC: [u8; 4] = *b"GNCT";

wire_struct! {
    /// HELLO from the host: opens a session, or asks again (same nonce) whether it is open.
    HostHello {
        /// [`MAGIC`].
        magic: [u8; 4],
        /// Lowest protocol version the host speaks.
        lowest: u8,
        /// Highest protocol version the host speaks.
        highest: u8,
        /// A number of the host's choice. A new number ends the session of the previous one.
        nonce: u32,
    }
}

wire_struct! {
    /// HELLO from the board.
    BoardHello {
        /// [`MAGIC`].
        magic: [u8; 4],
        /// The version in force, 0 if host and board have none in common.
        chosen: u8,
        /// Lowest protocol version the board speaks.
        lowest: u8,
        /// Highest protocol version the board speaks.
        highest: u8,
        /// The host's nonce.
        nonce: u32,
        /// A random number drawn at each start of the board.
        boot_id: u32,
        /// Bits of [`capability`].
        capabilities: u32,
        /// Serial number of the slave board (not of the module).
        serial: Text<32>,
        /// Firmware of the slave board.
        firmware: Text<32>,
    }
}

/// What a board can do, as bits in its HELLO.
pub mod capability {
    /// Switches the module's supply and measures it.
    pub const POWER: u32 = 1 << 0;
    /// The board has CAN.
    pub const CAN: u32 = 1 << 1;
    /// The module keeps a calibration, and the board compensates samples by it.
    pub const CALIBRATION: u32 = 1 << 2;
    /// Its sensors have an oscillator of their own. Readings come twice or are left out, so that the samples keep their
    /// spacing.
    pub const REPEATED_READINGS: u32 = 1 << 3;
}

/// Message ids of EVENT frames.
pub mod event {
    /// Board, every second: [`super::Heartbeat`].
    pub const HEARTBEAT: u16 = 0x0001;
    /// Host, every 500 ms: no payload. A REQUEST or HELLO counts as one too.
    pub const KEEP_ALIVE: u16 = 0x0002;
    /// Board: the watchdog ended the session and made the board safe. No payload.
    pub const WATCHDOG: u16 = 0x0003;
}

wire_struct! {
    /// The board's sign of life.
    Heartbeat {
        /// As in HELLO: another value means that the board restarted.
        boot_id: u32,
        /// Board time, in microseconds since its start.
        board_time_us: u64,
        /// Bit 0: session open; bit 1: module powered; bit 2: requests running; bit 3: streams running.
        state: u8,
    }
}

wire_struct! {
    /// Payload of ACCEPT.
    Accept {
        /// How long the board expects to take, in board time; 0 if it ends at once.
        expected_ms: u32,
    }
}

wire_struct! {
    /// Payload of PROGRESS.
    Progress {
        /// Share done, 0 to 1000.
        done_permille: u16,
        /// Board time spent on the request.
        elapsed_ms: u32,
    }
}

wire_struct! {
    /// Payload of NAK.
    Nak {
        /// A number of [`crate::NakCode`].
        code: u16,
        /// For people.
        text: Text<160>,
    }
}

/// Head of a RESULT payload; the body of the message follows when the status is 0, else a text of at most 160
/// bytes for people.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ResultHead {
    /// How the request ended.
    pub status: FaultCode,
    /// Board time from ACCEPT to the end, in microseconds.
    pub elapsed_us: u32,
}

impl Wire for ResultHead {
    fn put(&self, writer: &mut FieldWriter) -> Result<(), crate::wire::Overflow> {
        self.status.put(writer)?;
        self.elapsed_us.put(writer)
    }
    fn get(reader: &mut FieldReader<'_>) -> Result<Self, WireError> {
        Ok(Self { status: FaultCode::get(reader)?, elapsed_us: u32::get(reader)? })
    }
}
