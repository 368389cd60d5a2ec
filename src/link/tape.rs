//! What came over a line as it came, for a test of the other end's sender.

use gnc_protocol::can::CanFrame;

/// Bytes that a tape holds: a second of a full line at 921,600 baud. What comes later is not kept.
const BYTES: usize = 92_160;
/// Frames of a bus that a tape holds: a second of a full bus.
const FRAMES: usize = 4096;

/// What came over a line since the tape was begun. Only the kind of the link is filled.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Tape {
    on: bool,
    /// Bytes of RS-422, delimiters included.
    pub bytes: Vec<u8>,
    /// Frames of CAN under the ids of the conversation.
    pub frames: Vec<CanFrame>,
}

impl Tape {
    /// An empty tape that keeps what comes.
    pub(crate) fn begun() -> Self {
        Self { on: true, ..Self::default() }
    }

    pub(crate) fn keep_bytes(&mut self, bytes: &[u8]) {
        if self.on {
            let room = BYTES - self.bytes.len().min(BYTES);
            self.bytes.extend_from_slice(&bytes[..room.min(bytes.len())]);
        }
    }

    pub(crate) fn keep_frame(&mut self, frame: CanFrame) {
        if self.on && self.frames.len() < FRAMES {
            self.frames.push(frame);
        }
    }
}
