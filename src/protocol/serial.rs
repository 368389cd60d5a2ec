//! Frames on RS-422: `00 | COBS(frame) | 00`.
//!
//! A frame begins with 00 too, since a write that a timeout cuts off leaves half a frame on the wire.

use crate::frame::{CRC, Frame, FrameError, HEADER, Kind, MAX_FRAME};

/// Longest stuffed frame without its delimiters: one more byte for each begun block of 254 bytes.
pub const MAX_STUFFED: usize = MAX_FRAME + MAX_FRAME.div_ceil(254);
/// Longest frame on the wire.
pub const MAX_ON_WIRE: usize = MAX_STUFFED + 2;

/// Bytes kept of the last piece that was no frame: a line of text that a board prints.
pub const REJECTED: usize = 80;

/// A frame as it goes onto the wire.
pub type WireBytes = heapless::Vec<u8, MAX_ON_WIRE>;

/// Bytes of a frame with `payload` bytes on the wire, at most.
#[must_use]
pub const fn on_wire(payload: usize) -> usize {
    let frame = HEADER + payload + CRC;
    frame + frame.div_ceil(254) + 2
}

/// Stuffs a frame and adds its delimiters.
#[must_use]
pub fn encode(frame: &Frame) -> WireBytes {
    let bytes = frame.to_bytes();
    let mut wire = WireBytes::new();
    // The buffer holds the longest frame, so none of these calls can fail.
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
    /// Anything else between two delimiters that is not a frame: broken stuffing, wrong length, unknown kind.
    pub malformed: u32,
    /// Frames missing by their sequence numbers.
    pub missing: u32,
}

impl LineCounters {
    /// What was lost or damaged: frames missing, and of each kind of damage.
    #[must_use]
    pub fn lost(self) -> (u32, u32, u32) {
        (self.missing, self.bad_checksum, self.malformed)
    }
}

/// Finds frames in arbitrary bytes. Holds at most one frame and never stalls: after any rubbish the next delimiter
/// starts afresh.
#[derive(Debug)]
pub struct FrameDecoder {
    /// The received part of a frame that comes in pieces.
    pending: heapless::Vec<u8, MAX_STUFFED>,
    /// Room for the unstuffed bytes; without a meaning between two calls.
    unstuffed: [u8; MAX_STUFFED],
    overflowed: bool,
    expected_sequence: Option<u16>,
    counters: LineCounters,
    /// The beginning of the last piece that was no frame.
    rejected: heapless::Vec<u8, REJECTED>,
}

impl Default for FrameDecoder {
    fn default() -> Self {
        Self {
            pending: heapless::Vec::new(),
            unstuffed: [0; MAX_STUFFED],
            overflowed: false,
            expected_sequence: None,
            counters: LineCounters::default(),
            rejected: heapless::Vec::new(),
        }
    }
}

impl FrameDecoder {
    /// Takes bytes from the front of `bytes`, up to and including the first delimiter with a frame. `None` if no frame
    /// ended in them; all bytes are consumed then.
    pub fn next(&mut self, bytes: &mut &[u8]) -> Option<Result<Frame, FrameError>> {
        loop {
            let Some(end) = memchr::memchr(0, bytes) else {
                self.keep(bytes);
                *bytes = &[];
                return None;
            };
            let (chunk, rest) = (&bytes[..end], &bytes[end + 1..]);
            *bytes = rest;
            // A frame that came in one piece is read without a copy.
            let outcome = if self.pending.is_empty() {
                self.close(chunk)
            } else {
                self.keep(chunk);
                let pending = core::mem::take(&mut self.pending);
                self.close(&pending)
            };
            if outcome.is_some() {
                return outcome;
            }
        }
    }

    /// The counts so far.
    #[must_use]
    pub fn counters(&self) -> LineCounters {
        self.counters
    }

    /// The beginning of the last piece between two delimiters that was no frame, as it came: at most [`REJECTED`] bytes.
    #[must_use]
    pub fn rejected(&self) -> &[u8] {
        &self.rejected
    }

    /// Forgets the sequence of the other end, which starts afresh after a HELLO or a restart.
    pub fn restart_sequence(&mut self) {
        self.expected_sequence = None;
    }

    fn keep(&mut self, bytes: &[u8]) {
        if self.overflowed || self.pending.extend_from_slice(bytes).is_err() {
            self.overflowed = true;
            self.pending.clear();
        }
    }

    /// Handles a delimiter. Two in a row enclose nothing and have no meaning.
    #[inline]
    fn close(&mut self, stuffed: &[u8]) -> Option<Result<Frame, FrameError>> {
        if core::mem::take(&mut self.overflowed) || stuffed.len() > MAX_STUFFED {
            self.counters.malformed = self.counters.malformed.wrapping_add(1);
            self.rejected.clear();
            return Some(Err(FrameError::Long));
        }
        if stuffed.is_empty() {
            return None;
        }
        let outcome =
            unstuff(stuffed, &mut self.unstuffed).and_then(|length| Frame::from_bytes(&self.unstuffed[..length]));
        match &outcome {
            Ok(frame) => self.count(frame),
            Err(FrameError::Checksum { .. }) => self.counters.bad_checksum = self.counters.bad_checksum.wrapping_add(1),
            Err(FrameError::UnknownKind { .. }) => {
                self.counters.malformed = self.counters.malformed.wrapping_add(1);
                // The checksum is good: the frame arrived, and does not count as missing.
                let [_, _, _, _, _, _, low, high, ..] = self.unstuffed;
                self.follow(u16::from_le_bytes([low, high]));
            }
            Err(_) => self.counters.malformed = self.counters.malformed.wrapping_add(1),
        }
        if outcome.is_err() {
            self.rejected.clear();
            // There is room: the piece is cut to it.
            let _ = self.rejected.extend_from_slice(&stuffed[..stuffed.len().min(REJECTED)]);
        }
        Some(outcome)
    }

    fn count(&mut self, frame: &Frame) {
        // The other end may have started afresh with a HELLO, so a gap before a HELLO does not count.
        if frame.header.kind == Kind::Hello {
            self.expected_sequence = None;
        }
        self.follow(frame.header.sequence);
        self.counters.frames = self.counters.frames.wrapping_add(1);
    }

    fn follow(&mut self, sequence: u16) {
        if let Some(expected) = self.expected_sequence {
            let missing = sequence.wrapping_sub(expected);
            // A step back is a frame out of order or a restart, not 65,000 losses.
            if missing < 0x8000 {
                self.counters.missing = self.counters.missing.wrapping_add(u32::from(missing));
            }
        }
        self.expected_sequence = Some(sequence.wrapping_add(1));
    }
}

/// Longest run that is copied with a fixed length. Most runs of sample data are a few bytes long. A copy of fixed
/// length is two moves; a copy of variable length is a call.
const SHORT_RUN: usize = 16;

/// Removes the stuffing, run by run. Returns the number of bytes that came out, which is never more than went in.
fn unstuff(stuffed: &[u8], out: &mut [u8; MAX_STUFFED]) -> Result<usize, FrameError> {
    let (mut at, mut length) = (0, 0);
    while let Some(&code) = stuffed.get(at) {
        let run = usize::from(code).wrapping_sub(1);
        at += 1;
        let fixed = (stuffed.get(at..at + SHORT_RUN), out.get_mut(length..length + SHORT_RUN));
        if run <= SHORT_RUN
            && let (Some(from), Some(to)) = fixed
        {
            // Bytes copied beyond the run are overwritten next.
            to.copy_from_slice(from);
        } else {
            let from = stuffed.get(at..at.saturating_add(run)).ok_or(FrameError::Stuffing)?;
            out.get_mut(length..length + run).ok_or(FrameError::Stuffing)?.copy_from_slice(from);
        }
        at += run;
        length += run;
        // The zero after the last run is not data, and a full run is not followed by a zero.
        if code != 0xff && at < stuffed.len() {
            *out.get_mut(length).ok_or(FrameError::Stuffing)? = 0;
            length += 1;
        }
    }
    Ok(length)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(stuffed: &[u8], expected: Result<&[u8], FrameError>) {
        let mut out = [0xEE; MAX_STUFFED];
        let got = unstuff(stuffed, &mut out).map(|length| &out[..length]);
        assert_eq!(got, expected, "{stuffed:02x?}");
    }

    /// The first case is the worked example of the interface document.
    #[test]
    fn runs_and_codes() {
        check(&[2, 0x11, 1, 2, 0x2a], Ok(&[0x11, 0, 0, 0x2a]));
        check(&[1], Ok(&[]));
        check(&[1, 1], Ok(&[0]));
        check(&[2, 5], Ok(&[5]));
        check(&[2, 5, 1], Ok(&[5, 0]));
    }

    /// The frame arrived but its kind is unknown, so it counts as malformed and not as missing too.
    #[test]
    fn a_frame_of_unknown_kind_is_counted_once() {
        let mut decoder = FrameDecoder::default();
        for (kind, sequence) in [(0x16, 7), (0x19, 8), (0x16, 9), (0x19, 11), (0x16, 12)] {
            let mut bytes = [kind, 0, 0, 0, 2, 0, sequence, 0, 0, 0, 0, 0];
            let crc = crate::frame::checksum(&bytes[..HEADER]);
            bytes[HEADER..].copy_from_slice(&crc.to_le_bytes());
            let mut wire = [0; 16];
            cobs::encode(&bytes, &mut wire);
            let mut rest = wire.as_slice();
            while decoder.next(&mut rest).is_some() {}
        }
        let expected = LineCounters { frames: 3, bad_checksum: 0, malformed: 2, missing: 1 };
        assert_eq!(decoder.counters(), expected);
    }

    #[test]
    fn a_run_that_is_cut_short_is_broken() {
        for stuffed in [&[2][..], &[3, 1], &[1, 2], &[0xff, 1, 2, 3], &[0x80; 0x7f]] {
            check(stuffed, Err(FrameError::Stuffing));
        }
    }
}
