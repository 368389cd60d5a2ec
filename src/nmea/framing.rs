//! Sentences in bytes that come cut anywhere, with frames of other protocols and noise between them.

use super::protocols::{self, Front, Protocol};

/// Longest sentence. NMEA 0183 allows 82 characters; receivers are known to exceed it by several hundred.
pub(super) const MAX_SENTENCE: usize = 1024;
/// What was under way when listening began is no error: at most so many bytes.
const UNDER_WAY: u64 = 1024;
/// Noise without an end of line counts once in so many bytes.
const NOISE: usize = 512;
/// Longest group between backslashes in front of a sentence (NMEA 0183 version 4, TAG block).
const MAX_TAG: usize = 128;

/// What was found in the bytes.
#[derive(Debug, PartialEq)]
pub(super) enum Piece<'a> {
    /// What stands between `$` or `!` and the checksum.
    Sentence(&'a str),
    /// A whole frame that is none of NMEA.
    Foreign(Protocol),
    /// A spoilt sentence, or bytes that are nothing.
    Broken,
}

/// Finds sentences and frames.
#[derive(Debug, Default)]
pub(super) struct Framer {
    buffer: Vec<u8>,
    /// Bytes that were dealt with.
    heard: u64,
    /// Whether something whole was heard, so that what is broken was broken on the way.
    synchronised: bool,
    /// Length of the noise so far.
    noise: usize,
    /// Whether this receiver says checksums.
    checksums: bool,
    unchecked: u32,
}

/// What to do with the front of the buffer.
enum Step {
    /// Nothing before more bytes come.
    Wait,
    /// Nothing of meaning.
    Skip(usize),
    /// The same, and it ends a line.
    EndOfLine,
    Noise,
    Broken(usize),
    Foreign(Protocol, usize),
    /// A sentence with a right checksum.
    Checked(usize),
    /// A line of so many bytes without a checksum.
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

    /// No more bytes come: what looks like the beginning of a long frame may have whole sentences in it. Nothing is an
    /// error that the end cut off.
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
        // Printable ASCII by the scan.
        if let Ok(text) = std::str::from_utf8(body) {
            found(Piece::Sentence(text));
        }
    }

    /// A receiver that says no checksum at all is taken at its word, which is counted. Where others have one, the line
    /// lost it.
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
        // The rest of the line belongs to it.
        self.noise = 1;
    }

    fn noise(&mut self, found: &mut impl FnMut(Piece<'_>)) {
        if self.noise.is_multiple_of(NOISE) && self.synchronised {
            found(Piece::Broken);
        }
        self.noise += 1;
    }
}

/// What stands at the front; `last` where no more bytes come.
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

/// A sentence ends with its checksum, or with its line. What cannot stand in one begins something else.
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
