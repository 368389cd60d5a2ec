//! Frames on RS-422: `00 | COBS(frame) | 00`.
//!
//! A frame also begins with 00, since a write cut off by a timeout leaves half a frame on the wire.

use crate::frame::{CRC, Frame, FrameError, HEADER, Kind, MAX_FRAME};

/// Longest stuffed frame without its delimiters: one more byte for each 254 begun.
pub const MAX_STUFFED: usize = MAX_FRAME + MAX_FRAME.div_ceil(254);
/// Longest frame on the wire.
pub const MAX_ON_WIRE: usize = MAX_STUFFED + 2;

/// A frame as it goes onto the wire.
pub type WireBytes = heapless::Vec<u8, MAX_ON_WIRE>;

/// Bytes of a frame with `payload` bytes on the wire, at most.
#[must_use]
pub const fn on_wire(payload: usize) -> usize {
    let frame = HEADER + payload + CRC;
    frame + frame.div_ceil(254) + 2
}

/// Stuffs a frame and puts its delimiters round it.
#[must_use]
pub fn encode(frame: &Frame) -> WireBytes {
    let bytes = frame.to_bytes();
    let mut wire = WireBytes::new();
    // The buffer holds the longest frame, so that none of these can fail.
    let _ = wire.resize(MAX_ON_WIRE, 0);
    let stuffed = cobs::encode(&bytes, &mut wire[1..=MAX_STUFFED]);
    wire.truncate(stuffed + 2);
    wire[stuffed + 1] = 0;
    wire
}

/// What the decoder has seen on the wire, for the statistics of the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LineCounters {
    /// Good frames.
    pub frames: u32,
    /// Frames with a wrong checksum.
    pub bad_checksum: u32,
    /// Anything else between two delimiters that is no frame: broken stuffing, wrong length, unknown kind.
    pub malformed: u32,
    /// Frames missing by their sequence numbers.
    pub missing: u32,
}

/// Finds frames in whatever arrives. Holds at most one frame; never stalls: after any rubbish the next
/// delimiter starts afresh.
#[derive(Debug)]
pub struct Decoder {
    pending: heapless::Vec<u8, MAX_STUFFED>,
    overflowed: bool,
    expected_sequence: Option<u16>,
    counters: LineCounters,
}

impl Default for Decoder {
    fn default() -> Self {
        Self {
            pending: heapless::Vec::new(),
            overflowed: false,
            expected_sequence: None,
            counters: LineCounters::default(),
        }
    }
}

impl Decoder {
    /// Takes the bytes up to and including the first delimiter off the front of `bytes`. `None`: no frame ended
    /// in them, and they are all consumed.
    pub fn next(&mut self, bytes: &mut &[u8]) -> Option<Result<Frame, FrameError>> {
        loop {
            let Some(end) = memchr::memchr(0, bytes) else {
                self.keep(bytes);
                *bytes = &[];
                return None;
            };
            let (chunk, rest) = (&bytes[..end], &bytes[end + 1..]);
            *bytes = rest;
            self.keep(chunk);
            if let Some(outcome) = self.close() {
                return Some(outcome);
            }
        }
    }

    /// What was seen so far.
    #[must_use]
    pub fn counters(&self) -> LineCounters {
        self.counters
    }

    /// Forgets the sequence of the other end, which starts afresh after a HELLO or a reboot.
    pub fn restart_sequence(&mut self) {
        self.expected_sequence = None;
    }

    fn keep(&mut self, bytes: &[u8]) {
        if self.overflowed || self.pending.extend_from_slice(bytes).is_err() {
            self.overflowed = true;
            self.pending.clear();
        }
    }

    /// A delimiter came. Two in a row enclose nothing and mean nothing.
    fn close(&mut self) -> Option<Result<Frame, FrameError>> {
        let overflowed = core::mem::take(&mut self.overflowed);
        if overflowed {
            self.counters.malformed = self.counters.malformed.wrapping_add(1);
            return Some(Err(FrameError::Long));
        }
        if self.pending.is_empty() {
            return None;
        }
        let outcome = match cobs::decode_in_place(&mut self.pending) {
            Ok(length) => Frame::from_bytes(&self.pending[..length]),
            Err(_) => Err(FrameError::Stuffing),
        };
        self.pending.clear();
        match &outcome {
            Ok(frame) => self.count(frame),
            Err(FrameError::Checksum { .. }) => self.counters.bad_checksum = self.counters.bad_checksum.wrapping_add(1),
            Err(_) => self.counters.malformed = self.counters.malformed.wrapping_add(1),
        }
        Some(outcome)
    }

    fn count(&mut self, frame: &Frame) {
        let sequence = frame.header.sequence;
        // With a HELLO the other end may have started afresh; what is missing before one says nothing.
        if let Some(expected) = self.expected_sequence.filter(|_| frame.header.kind != Kind::Hello) {
            let missing = sequence.wrapping_sub(expected);
            // A step back is a frame out of order or a restart, not 65,000 losses.
            if missing < 0x8000 {
                self.counters.missing = self.counters.missing.wrapping_add(u32::from(missing));
            }
        }
        self.expected_sequence = Some(sequence.wrapping_add(1));
        self.counters.frames = self.counters.frames.wrapping_add(1);
    }
}
