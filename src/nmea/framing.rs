//! Finds sentences in bytes that come in arbitrary pieces, with frames of other protocols and noise between the
//! sentences.

use super::protocols::{self, Front, Protocol};

/// Longest sentence. NMEA 0183 allows 82 characters; receivers are known to exceed it by several hundred.
pub(super) const MAX_SENTENCE: usize = 1024;
/// A sentence that was under way when listening began is not an error. It takes at most this many bytes.
const UNDER_WAY: u64 = 1024;
/// Noise without an end of line counts once for this many bytes.
const NOISE: usize = 512;
/// Longest group between backslashes before a sentence (NMEA 0183 version 4, TAG block).
const MAX_TAG: usize = 128;

/// A piece found in the bytes.
#[derive(Debug, PartialEq)]
pub(super) enum Piece<'a> {
    /// The text between `$` or `!` and the checksum.
    Sentence(&'a str),
    /// A whole frame of another protocol.
    Foreign(Protocol),
    /// A spoilt sentence, or bytes without a meaning.
    Broken,
}

/// Finds sentences and frames.
#[derive(Debug, Default)]
pub(super) struct Framer {
    buffer: Vec<u8>,
    /// Bytes that were processed.
    heard: u64,
    /// Whether a whole piece was found. From then on a broken piece was broken on the line.
    synchronised: bool,
    /// Length of the noise so far.
    noise: usize,
    /// Whether this receiver sends checksums.
    checksums: bool,
    unchecked: u32,
}

/// What to do with the front of the buffer.
enum Step {
    /// The bytes do not suffice; wait for more.
    Wait,
    /// Bytes without a meaning.
    Skip(usize),
    /// A byte without a meaning that ends a line.
    EndOfLine,
    Noise,
    Broken(usize),
    Foreign(Protocol, usize),
    /// A sentence with a right checksum.
    Checked(usize),
    /// A line of this many bytes without a checksum.
    Unchecked(usize),
}

impl Framer {
    /// Sentences that were taken without a checksum.
    pub(super) fn unchecked(&self) -> u32 {
        self.unchecked
    }

    /// Takes bytes as they come.
    pub(super) fn push(&mut self, bytes: &[u8], found: impl FnMut(Piece<'_>)) {
        self.buffer.extend_from_slice(bytes);
        self.take(false, found);
    }

    /// Ends the input. Bytes that look like the beginning of a long frame may contain whole sentences. A piece that the
    /// end cut off is not an error.
    pub(super) fn finish(&mut self, mut found: impl FnMut(Piece<'_>)) {
        self.take(true, |piece| {
            if piece != Piece::Broken {
                found(piece);
            }
        });
        self.buffer.clear();
    }

    fn take(&mut self, last: bool, mut found: impl FnMut(Piece<'_>)) {
        let mut buffer = std::mem::take(&mut self.buffer);
        let mut at = 0;
        while at < buffer.len() {
            let rest = &buffer[at..];
            let taken = match step(rest, last) {
                Step::Wait => break,
                Step::Skip(length) => length,
                Step::EndOfLine => {
                    self.noise = 0;
                    1
                }
                Step::Noise => {
                    self.noise(&mut found);
                    1
                }
                Step::Broken(length) => {
                    self.broken(&mut found);
                    length
                }
                Step::Foreign(protocol, length) => {
                    self.whole();
                    found(Piece::Foreign(protocol));
                    length
                }
                Step::Checked(length) => {
                    self.checksums = true;
                    self.whole();
                    self.sentence(&rest[1..length - 3], &mut found);
                    length
                }
                Step::Unchecked(length) => {
                    self.without_checksum(&rest[1..length], &mut found);
                    length
                }
            };
            at += taken;
            self.heard = self.heard.saturating_add(taken as u64);
            self.synchronised |= self.heard > UNDER_WAY;
        }
        buffer.drain(..at);
        self.buffer = buffer;
    }

    fn whole(&mut self) {
        (self.synchronised, self.noise) = (true, 0);
    }

    fn sentence(&mut self, body: &[u8], found: &mut impl FnMut(Piece<'_>)) {
        // The scan has accepted only printable ASCII.
        if let Ok(text) = std::str::from_utf8(body) {
            found(Piece::Sentence(text));
        }
    }

    /// Handles a sentence without a checksum. If the receiver sends no checksums at all, the sentence is accepted and
    /// counted. If other sentences have one, the line lost it.
    fn without_checksum(&mut self, body: &[u8], found: &mut impl FnMut(Piece<'_>)) {
        let address = body.split(|byte| *byte == b',').next().unwrap_or_default();
        let addressed = address.len() >= 5 && address.iter().all(u8::is_ascii_alphanumeric);
        if self.checksums || !addressed || body.contains(&b'*') {
            self.broken(found);
            self.noise = 0;
        } else {
            self.whole();
            self.unchecked = self.unchecked.saturating_add(1);
            self.sentence(body, found);
        }
    }

    fn broken(&mut self, found: &mut impl FnMut(Piece<'_>)) {
        if self.synchronised {
            found(Piece::Broken);
        }
        // The rest of the line belongs to the broken piece.
        self.noise = 1;
    }

    fn noise(&mut self, found: &mut impl FnMut(Piece<'_>)) {
        if self.noise.is_multiple_of(NOISE) && self.synchronised {
            found(Piece::Broken);
        }
        self.noise += 1;
    }
}

/// The step for the front of the buffer; `last` if no more bytes come.
fn step(bytes: &[u8], last: bool) -> Step {
    match protocols::front(bytes) {
        Front::Frame(protocol, length) => return Step::Foreign(protocol, length),
        Front::More if !last => return Step::Wait,
        Front::More | Front::No => {}
    }
    match bytes[0] {
        b'\r' | b'\n' => Step::EndOfLine,
        b' ' | b'\t' | 0 => Step::Skip(1),
        b'$' | b'!' => sentence(bytes),
        b'\\' => tag(bytes),
        _ => Step::Noise,
    }
}

/// Reads a sentence. It ends with its checksum or its line. A character that is not allowed in a sentence begins
/// something else.
fn sentence(bytes: &[u8]) -> Step {
    for (at, byte) in bytes.iter().enumerate().skip(1) {
        match byte {
            _ if at > MAX_SENTENCE => return Step::Broken(at),
            b'*' => {
                return match bytes.get(at + 1..at + 3).map(hexadecimal) {
                    None => Step::Wait,
                    Some(Some(told)) if told == bytes[1..at].iter().fold(0, |sum, byte| sum ^ byte) => {
                        Step::Checked(at + 3)
                    }
                    Some(Some(_)) => Step::Broken(at + 3),
                    Some(None) => Step::Broken(at + 1),
                };
            }
            b'\r' | b'\n' => return Step::Unchecked(at),
            b' '..=b'~' if !matches!(byte, b'$' | b'!') => {}
            _ => return Step::Broken(at),
        }
    }
    Step::Wait
}

fn hexadecimal(digits: &[u8]) -> Option<u8> {
    let text = std::str::from_utf8(digits).ok().filter(|text| text.bytes().all(|digit| digit.is_ascii_hexdigit()))?;
    u8::from_str_radix(text, 16).ok()
}

fn tag(bytes: &[u8]) -> Step {
    match bytes.iter().skip(1).take(MAX_TAG).position(|byte| !matches!(byte, b' '..=b'~') || *byte == b'\\') {
        Some(at) if bytes[at + 1] == b'\\' => Step::Skip(at + 2),
        None if bytes.len() <= MAX_TAG => Step::Wait,
        _ => Step::Noise,
    }
}
