//! Tells the keys of a hand from the scan of a barcode reader that types as a keyboard does.
//!
//! Both come as bytes of the terminal. A scanner types a character every few milliseconds and a hand does not, so bytes
//! that follow each other within [`HAND`] belong together. Everything within a scan is text of the code or its frame: line
//! ends, Tab, control characters and escape sequences in it are never keys.
//!
//! The rules are pure: bytes come with the time at which they came, and nobody looks at a clock here.

mod etx;

use std::time::Duration;

use super::decode::{Dialect, Key, KeyDecoder, whole_sequence};
use etx::{Etx, HeldEtx};

/// Characters of a hand are further apart than this. The fastest typists reach 80 ms, now and then two keys roll within 20 ms;
/// scanners type a character in 1 to 15 ms.
const HAND: Duration = Duration::from_millis(30);
/// How long the rest of a scan may take: a wireless scanner loses a moment now and then. No hand presses a key so soon after
/// a scan.
const REST_OF_SCAN: Duration = Duration::from_millis(150);
/// How long the rest of an escape sequence may take on a slow line, before a lone escape is the key.
const REST_OF_KEY: Duration = Duration::from_millis(50);
/// How long the rest of pasted text may take. Text without an end must not lock the keyboard.
const REST_OF_PASTE: Duration = Duration::from_secs(2);
/// Fewest characters that come at once and are a scan: two keys of a hand may roll over each other.
const SCAN: usize = 3;
/// The same for characters that a line end follows at once.
const ENDED_SCAN: usize = 2;
/// Equal bytes that come at once are a key that is held down: terminals repeat it 20 to 50 times a second.
const HELD: usize = 4;
/// Bytes of a scan that are kept, more than any code holds; more are counted.
const MAX_SCAN: usize = 8192;

/// What the operator did.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Input {
    /// A key was pressed, or text was pasted.
    Key(Key),
    /// A code was scanned.
    Scan(Scanned),
}

/// A scan as it came, with its frame.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Scanned {
    pub bytes: Vec<u8>,
    /// Bytes that are not kept, since no code is so long.
    pub dropped: usize,
    /// A line end or another end followed. Without one nobody knows whether the code is whole.
    pub ended: bool,
    /// The last so many characters, given as keys already, are the beginning of this scan.
    pub taken_back: usize,
}

/// Reads the bytes of the terminal.
#[derive(Debug, Default)]
pub(crate) struct InputReader {
    /// Keys of a hand, and pasted text.
    decoder: KeyDecoder,
    burst: Burst,
    /// Characters given as keys of which each followed the one before soon: the beginning of a scan may be among them.
    recent: usize,
    /// When the last of them came.
    recent_at: Duration,
    /// Until then the frame of the last scan may go on.
    frame_until: Option<Duration>,
    /// When the last byte came.
    last_at: Duration,
    /// Ctrl-C, which may be the head of a code.
    etx: HeldEtx,
}

/// Bytes that came at once and are not told yet.
#[derive(Debug, Default)]
struct Burst {
    bytes: Vec<u8>,
    dropped: usize,
    began_at: Duration,
    /// Long enough for a scan. Its rest may come later.
    scanning: bool,
    /// It began where the frame of the scan before may go on.
    in_frame: bool,
}

impl InputReader {
    /// A reader for the keys of a terminal.
    pub(crate) fn new(dialect: Dialect) -> Self {
        Self { decoder: KeyDecoder::new(dialect), ..Self::default() }
    }

    /// Takes bytes that came at this time.
    pub(crate) fn feed(&mut self, at: Duration, bytes: &[u8], out: &mut Vec<Input>) {
        // Not what ctrl-C waits for: these bytes may have come before this program found time to read them.
        self.settle(at, out);
        let mut rest = bytes;
        while let Some(first) = rest.first() {
            if self.etx.byte_comes(at, *first) {
                self.tell_keys(at, vec![Key::Ctrl('c')], out);
            }
            let taken = match whole_sequence(rest) {
                _ if self.decoder.is_pasting() => self.keys(at, &rest[..1], out),
                // Only what came in one piece: a terminal sends a key so, a scanner types it character by character.
                Some(length) if self.is_key(at, &rest[length..]) => {
                    self.close(out);
                    self.frame_until = None;
                    self.keys(at, &rest[..length], out)
                }
                Some(length) => self.push(at, &rest[..length], out),
                None if self.is_frame(at, *first) => 1,
                None => self.push(at, &rest[..1], out),
            };
            rest = &rest[taken..];
            self.last_at = at;
        }
    }

    /// When [`InputReader::pass_time`] is due if no byte comes; `None` if nothing waits.
    pub(crate) fn due_at(&self) -> Option<Duration> {
        if self.decoder.is_pasting() {
            return Some(self.last_at + REST_OF_PASTE);
        }
        // What ctrl-C waits for may have come already.
        if self.burst.bytes.is_empty() { self.etx.due_at() } else { Some(self.last_at + self.burst.rest()) }
    }

    /// Takes note that it is this late. What came may then be whole.
    pub(crate) fn pass_time(&mut self, at: Duration, out: &mut Vec<Input>) {
        self.settle(at, out);
        if self.burst.bytes.is_empty() && self.etx.is_due(at) {
            self.tell_keys(at, vec![Key::Ctrl('c')], out);
        }
    }

    /// Tells what the silence up to this time makes whole.
    fn settle(&mut self, at: Duration, out: &mut Vec<Input>) {
        if self.decoder.is_pasting() && at >= self.last_at + REST_OF_PASTE {
            self.decoder.end_paste();
        }
        let silence = at.saturating_sub(self.last_at);
        if !self.burst.bytes.is_empty() && !self.burst.scanning && silence >= self.burst.rest() {
            if self.burst.is_scan() {
                self.burst.scanning = true;
            } else {
                self.close(out);
            }
        }
        if self.burst.scanning && silence >= REST_OF_SCAN {
            self.close(out);
        }
    }

    /// Whether an escape sequence that came in one piece is a key. Within a scan or at its head it is none.
    fn is_key(&self, at: Duration, behind: &[u8]) -> bool {
        let alone = behind.is_empty() || whole_sequence(behind).is_some();
        let after_silence = self.burst.scanning && at.saturating_sub(self.last_at) >= HAND;
        alone && (self.burst.bytes.is_empty() || after_silence)
    }

    /// Whether this byte goes on with the frame of the scan that has ended: the LF of CR LF, or ETX.
    fn is_frame(&self, at: Duration, byte: u8) -> bool {
        self.burst.bytes.is_empty() && ends_scan(byte) && self.frame_until.is_some_and(|until| at < until)
    }

    /// Takes bytes whose meaning the next ones may change.
    fn push(&mut self, at: Duration, bytes: &[u8], out: &mut Vec<Input>) -> usize {
        self.last_at = at;
        if self.burst.bytes.is_empty() {
            self.burst.began_at = at;
            self.burst.in_frame = self.frame_until.take().is_some_and(|until| at < until);
        }
        let room = MAX_SCAN.saturating_sub(self.burst.bytes.len());
        self.burst.bytes.extend(&bytes[..bytes.len().min(room)]);
        self.burst.dropped += bytes.len().saturating_sub(room);
        match bytes {
            [end] if ends_scan(*end) => self.line_end(at, out),
            [.., b'~'] if self.burst.bytes.ends_with(PASTE_BEGIN) => {
                self.burst.bytes.truncate(self.burst.bytes.len() - PASTE_BEGIN.len());
                self.close(out);
                self.keys(at, PASTE_BEGIN, out);
            }
            _ if !self.burst.scanning && self.burst.is_held() => self.close(out),
            // A hand rests on no key while the terminal waits for its neighbour: these are keys.
            [0x7f | 0x08] if self.burst.bytes.len() == 1 => self.close(out),
            _ => {}
        }
        bytes.len()
    }

    /// A line end came: it ends a scan, or it is the key of a hand.
    fn line_end(&mut self, at: Duration, out: &mut Vec<Input>) {
        let characters = self.burst.characters();
        if self.burst.scanning || characters >= ENDED_SCAN {
            self.tell_scan(true, out);
            self.frame_until = Some(at + REST_OF_SCAN);
        } else if characters > 0 {
            self.close(out);
        }
    }

    /// Tells what waits: a scan, or keys.
    fn close(&mut self, out: &mut Vec<Input>) {
        if self.burst.bytes.is_empty() {
            return;
        }
        if self.burst.scanning || self.burst.is_scan() {
            return self.tell_scan(false, out);
        }
        let burst = std::mem::take(&mut self.burst);
        let mut keys = Vec::new();
        self.decoder.feed(&burst.bytes, &mut keys);
        self.decoder.flush(&mut keys);
        // A hand presses no key with Ctrl together with another one: this is the end of a code of one character.
        if keys.iter().any(|key| matches!(key, Key::Char(_))) {
            keys.retain(|key| !matches!(key, Key::Ctrl(_)));
        }
        // A scanner goes on with its frame, unless it is Esc alone, which does no harm.
        if burst.in_frame && burst.bytes != [0x1b] {
            keys.retain(|key| matches!(key, Key::Char(_)));
        }
        if burst.began_at > self.recent_at + REST_OF_SCAN {
            self.recent = 0;
        }
        if let Some(at) = keys.iter().position(|key| *key == Key::Ctrl('c')) {
            match self.etx.pressed(burst.began_at, &keys) {
                Etx::Waits => return,
                Etx::IsKey => {}
                Etx::IsSecondKey => keys.insert(at, Key::Ctrl('c')),
            }
        }
        self.tell_keys(self.last_at, keys, out);
    }

    /// Gives bytes to the decoder of keys at once.
    fn keys(&mut self, at: Duration, bytes: &[u8], out: &mut Vec<Input>) -> usize {
        let mut keys = Vec::new();
        self.decoder.feed(bytes, &mut keys);
        self.tell_keys(at, keys, out);
        bytes.len()
    }

    fn tell_keys(&mut self, at: Duration, keys: Vec<Key>, out: &mut Vec<Input>) {
        for key in &keys {
            self.recent = if matches!(key, Key::Char(character) if *character != ' ') { self.recent + 1 } else { 0 };
        }
        self.recent_at = at;
        out.extend(spaces_in_text(keys).into_iter().map(Input::Key));
    }

    /// Whether the burst goes on with characters that were given as keys.
    fn joins(&self) -> bool {
        self.recent > 0 && self.burst.began_at <= self.recent_at + REST_OF_SCAN
    }

    fn tell_scan(&mut self, ended: bool, out: &mut Vec<Input>) {
        let taken_back = if self.joins() { self.recent } else { 0 };
        self.recent = 0;
        let Burst { bytes, dropped, .. } = std::mem::take(&mut self.burst);
        out.push(Input::Scan(Scanned { bytes, dropped, ended, taken_back }));
    }
}

/// The beginning of pasted text.
const PASTE_BEGIN: &[u8] = b"\x1b[200~";

impl Burst {
    /// How long the rest may take.
    fn rest(&self) -> Duration {
        match self.decoded().1 {
            _ if self.scanning => REST_OF_SCAN,
            true => REST_OF_KEY,
            false => HAND,
        }
    }

    /// The keys that a hand would have pressed, and whether one of them is not whole.
    fn decoded(&self) -> (Vec<Key>, bool) {
        let (mut decoder, mut keys) = (KeyDecoder::default(), Vec::new());
        decoder.feed(&self.bytes, &mut keys);
        (keys, decoder.is_waiting())
    }

    fn characters(&self) -> usize {
        self.decoded().0.iter().filter(|key| matches!(key, Key::Char(_))).count()
    }

    /// Whether so many different characters came at once that no hand typed them.
    fn is_scan(&self) -> bool {
        let keys = self.decoded().0;
        let mut characters = keys.iter().filter(|key| matches!(key, Key::Char(_)));
        let first = characters.clone().next();
        // An input method gives a whole word at once, and a hand has chosen it.
        let is_word = keys.iter().any(|key| matches!(key, Key::Char(character) if is_composed(*character)));
        !is_word && characters.clone().count() >= SCAN && characters.any(|key| Some(key) != first)
    }

    /// Whether a key is held down.
    fn is_held(&self) -> bool {
        self.bytes.len() == HELD && self.bytes.iter().all(|byte| *byte == self.bytes[0])
    }
}

/// Whether an input method composes the character: kana, Hangul and the ideographs of Unicode 16. Its full-width forms of
/// ASCII are not among them: a scanner types those through an input method.
fn is_composed(character: char) -> bool {
    matches!(character, '\u{3040}'..='\u{31ff}' | '\u{3400}'..='\u{9fff}' | '\u{ac00}'..='\u{d7a3}' | '\u{20000}'..='\u{323af}')
}

/// Bytes by which scanners end a code: CR, LF, Tab, ETX, EOT.
pub(crate) fn ends_scan(byte: u8) -> bool {
    matches!(byte, b'\r' | b'\n' | b'\t' | 0x03 | 0x04)
}

/// A space that comes together with other characters is text, and ticks no item.
fn spaces_in_text(mut batch: Vec<Key>) -> Vec<Key> {
    if batch.iter().any(|key| matches!(key, Key::Char(character) if *character != ' ')) {
        for key in batch.iter_mut().filter(|key| **key == Key::Char(' ')) {
            *key = Key::Pasted(' ');
        }
    }
    batch
}

#[cfg(test)]
mod tests;
