//! slcan (LAWICEL): CAN over a serial port in ASCII lines, as USB adapters and the Linux `slcand` speak it.
//!
//! One decoder reads both directions: frames, commands to the adapter, and its answers. Answers are optional: adapters
//! differ in what they acknowledge, so this module does not wait for an answer.

use super::{CanFrame, CanId};

/// Longest line: `T`, eight digits of id, length, sixteen digits of data, four of a timestamp.
pub const MAX_LINE: usize = 30;
/// Longest line that [`encode`] makes, with its end.
pub const MAX_ENCODED: usize = 27;
/// Ends a line.
const END: u8 = b'\r';
/// A whole line in one byte: the adapter refused.
const BELL: u8 = 7;

/// A frame as a line.
pub type SlcanLine = heapless::Vec<u8, MAX_ENCODED>;

/// The bytes that open an adapter at 500 kbit/s: the end of a line that may be half sent, close, rate, open.
pub const OPEN_500K: &[u8] = b"\rC\rS6\rO\r";
/// The bytes that close it.
pub const CLOSE: &[u8] = b"C\r";

/// A line with a meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SlcanEvent {
    /// A data frame.
    Frame(CanFrame),
    /// A remote frame; this protocol has none.
    Remote(CanId),
    /// `O`: join the bus.
    Open,
    /// `L`: listen only.
    Listen,
    /// `C`: leave the bus.
    Close,
    /// `S0` to `S8`: choose the bit rate; `S6` is 500 kbit/s.
    Rate(u8),
    /// Another command or answer, by its first letter.
    Other(u8),
    /// The adapter refused a command.
    Refused,
}

/// Counts of the decoder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Data frames.
    pub frames: u32,
    /// Lines that are not slcan.
    pub bad_lines: u32,
}

/// Value of a hexadecimal digit; 0xff for other characters.
static DIGITS: [u8; 256] = digits();

const fn digits() -> [u8; 256] {
    let mut table = [0xff; 256];
    let mut value = 0;
    while value < 16 {
        table[b"0123456789ABCDEF"[value] as usize] = value as u8;
        table[b"0123456789abcdef"[value] as usize] = value as u8;
        value += 1;
    }
    table
}

/// Finds lines in arbitrary bytes. Holds at most one line and never stalls.
#[derive(Debug, Default)]
pub struct SlcanDecoder {
    /// The received part of a line that comes in pieces.
    pending: heapless::Vec<u8, MAX_LINE>,
    overflowed: bool,
    counters: Counters,
}

impl SlcanDecoder {
    /// Takes bytes from the front of `bytes`, up to and including the next line with a meaning. Empty lines are
    /// skipped; bad ones are counted. `None` if all bytes are consumed.
    #[inline]
    pub fn next(&mut self, bytes: &mut &[u8]) -> Option<SlcanEvent> {
        loop {
            let Some(end) = memchr::memchr2(END, BELL, bytes) else {
                self.keep(bytes);
                *bytes = &[];
                return None;
            };
            let (chunk, terminator, rest) = (&bytes[..end], bytes[end], &bytes[end + 1..]);
            *bytes = rest;
            if terminator == BELL {
                // A line that the bell cuts off is lost.
                self.counters.bad_lines += u32::from(!chunk.is_empty() || !self.pending.is_empty());
                self.pending.clear();
                self.overflowed = false;
                return Some(SlcanEvent::Refused);
            }
            // A line that came in one piece is read without a copy.
            let item = if self.pending.is_empty() && !self.overflowed {
                self.close(chunk)
            } else {
                self.keep(chunk);
                let pending = core::mem::take(&mut self.pending);
                self.close(&pending)
            };
            if item.is_some() {
                return item;
            }
        }
    }

    /// The counts so far.
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.counters
    }

    fn keep(&mut self, bytes: &[u8]) {
        if self.overflowed || self.pending.extend_from_slice(bytes).is_err() {
            self.overflowed = true;
            self.pending.clear();
        }
    }

    #[inline]
    fn close(&mut self, line: &[u8]) -> Option<SlcanEvent> {
        // A line that is too long is refused whether it came in pieces or not.
        let too_long = line.len() > MAX_LINE;
        // Some adapters end lines with CR LF, so the next line begins with the LF.
        let line = line.strip_prefix(b"\n").unwrap_or(line);
        let overflowed = core::mem::take(&mut self.overflowed) || too_long;
        if line.is_empty() && !overflowed {
            return None;
        }
        let item = if overflowed { None } else { parse(line) };
        match item {
            Some(SlcanEvent::Frame(_)) => self.counters.frames = self.counters.frames.wrapping_add(1),
            None => self.counters.bad_lines = self.counters.bad_lines.wrapping_add(1),
            Some(_) => {}
        }
        item
    }
}

#[inline]
fn parse(line: &[u8]) -> Option<SlcanEvent> {
    let (&letter, rest) = line.split_first()?;
    match letter {
        b't' => frame(CanId::Standard(number::<3>(rest)? as u16), &rest[3..]),
        b'T' => frame(CanId::Extended(number::<8>(rest)?), &rest[8..]),
        b'r' => remote(CanId::Standard(number::<3>(rest)? as u16), &rest[3..]),
        b'R' => remote(CanId::Extended(number::<8>(rest)?), &rest[8..]),
        b'O' if rest.is_empty() => Some(SlcanEvent::Open),
        b'L' if rest.is_empty() => Some(SlcanEvent::Listen),
        b'C' if rest.is_empty() => Some(SlcanEvent::Close),
        b'S' => match rest {
            [rate @ b'0'..=b'8'] => Some(SlcanEvent::Rate(rate - b'0')),
            _ => None,
        },
        // z, Z: a frame was sent; F: status; V, N: version, serial number; s, M, m, W, X, Z0, U..: set-up that
        // adapters differ in.
        b'z' | b'Z' | b'F' | b'V' | b'v' | b'N' | b's' | b'M' | b'm' | b'W' | b'X' | b'U' | b'P' | b'A' | b'Q' => {
            Some(SlcanEvent::Other(letter))
        }
        _ => None,
    }
}

/// Reads `COUNT` hexadecimal digits from the front.
#[inline]
fn number<const COUNT: usize>(text: &[u8]) -> Option<u32> {
    let text = text.first_chunk::<COUNT>()?;
    let (mut value, mut wrong) = (0, 0);
    for &digit in text {
        let digit = DIGITS[usize::from(digit)];
        wrong |= digit;
        value = value << 4 | u32::from(digit & 0x0f);
    }
    (wrong < 0x10).then_some(value)
}

/// Reads length and data; adapters may add a timestamp of four digits.
#[inline]
fn frame(id: CanId, rest: &[u8]) -> Option<SlcanEvent> {
    let (length, rest) = length(rest)?;
    if rest.len() != 2 * length && !has_timestamp(rest, 2 * length) {
        return None;
    }
    let (mut data, mut wrong) = ([0; 8], 0);
    for (byte, pair) in data.iter_mut().zip(rest[..2 * length].as_chunks::<2>().0) {
        let (high, low) = (DIGITS[usize::from(pair[0])], DIGITS[usize::from(pair[1])]);
        wrong |= high | low;
        *byte = high << 4 | low & 0x0f;
    }
    if wrong >= 0x10 {
        return None;
    }
    CanFrame::new(id, &data[..length]).map(SlcanEvent::Frame)
}

fn remote(id: CanId, rest: &[u8]) -> Option<SlcanEvent> {
    let (_, rest) = length(rest)?;
    let good = id.is_valid() && (rest.is_empty() || has_timestamp(rest, 0));
    good.then_some(SlcanEvent::Remote(id))
}

#[inline]
fn length(rest: &[u8]) -> Option<(usize, &[u8])> {
    let (&digit, rest) = rest.split_first()?;
    matches!(digit, b'0'..=b'8').then(|| (usize::from(digit - b'0'), rest))
}

fn has_timestamp(rest: &[u8], at: usize) -> bool {
    rest.get(at..).is_some_and(|stamp| stamp.len() == 4 && number::<4>(stamp).is_some())
}

/// A frame as a line, with its end.
#[must_use]
pub fn encode(frame: &CanFrame) -> SlcanLine {
    const HEX: &[u8; 16] = b"0123456789ABCDEF";
    let mut line = SlcanLine::new();
    // The buffer holds the longest line, so no push can fail.
    let mut put = |byte| {
        let _ = line.push(byte);
    };
    let (letter, id, digits) = match frame.id() {
        CanId::Standard(id) => (b't', u32::from(id), 3),
        CanId::Extended(id) => (b'T', id, 8),
    };
    put(letter);
    (0..digits).rev().for_each(|digit| put(HEX[(id >> (4 * digit)) as usize & 0x0f]));
    put(b'0' + frame.data().len() as u8);
    for &byte in frame.data() {
        put(HEX[usize::from(byte >> 4)]);
        put(HEX[usize::from(byte & 0x0f)]);
    }
    put(END);
    line
}
