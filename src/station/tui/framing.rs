//! The serial number within a scan: what scanners put around a code is taken off, and what cannot be a number is told.

use std::time::Duration;

use super::decode::whole_sequence;
use super::fields;
use super::input::{Scanned, ends_scan};
pub(crate) use crate::serial_number::is_other_layout;
use crate::serial_number::{self, MAX_CHARACTERS, SerialNumberError, is_invisible};

/// FNC1 of GS1 codes, between fields of variable length.
const GS: char = '\u{1d}';
/// How long the rest of a line may take at a serial port: the slowest scanners send a character in 10 ms.
const REST_OF_LINE: Duration = Duration::from_millis(150);
/// Bytes of a line that are kept, more than any code holds.
const MAX_LINE: usize = 8192;

/// Why a scan holds no serial number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum ScanProblem {
    /// There is nothing within the frame.
    Empty,
    TooLong {
        characters: usize,
    },
    /// Control characters or keys within the code.
    Control,
    /// Several fields, as GS1 codes have them; they stand here with `|` between them.
    Fields(String),
    /// Letters of another alphabet or of full width: the keyboard's layout is not that of the label.
    Layout(String),
    /// A character that nobody sees, by its number.
    Invisible(char),
}

/// Takes the frame off a scan. `before` is its beginning, if that was given as keys.
pub(crate) fn number(before: &str, scan: &Scanned) -> Result<String, ScanProblem> {
    let text = unframed(before, scan);
    // A code that says who it is (GS1) begins with FNC1, behind the name of the symbology.
    let text = without_symbology(&text).trim_matches(is_frame);
    let characters = text.chars().count() + scan.dropped;
    if text.is_empty() {
        return Err(ScanProblem::Empty);
    }
    if characters > MAX_CHARACTERS {
        return Err(ScanProblem::TooLong { characters });
    }
    if text.contains(GS) && text.chars().all(|character| character == GS || !character.is_control()) {
        return Err(ScanProblem::Fields(text.replace(GS, " | ")));
    }
    if text.chars().any(char::is_control) {
        return Err(ScanProblem::Control);
    }
    match text.chars().find(|character| is_invisible(*character)) {
        Some(character) => Err(ScanProblem::Invisible(character)),
        None => Ok(text.to_owned()),
    }
}

/// A scan without its frame, but with the name of the symbology.
pub(crate) fn unframed(before: &str, scan: &Scanned) -> String {
    let mut bytes = before.as_bytes().to_vec();
    bytes.extend(&scan.bytes);
    let text = String::from_utf8_lossy(without_keys(&bytes)).replace('\0', "");
    text.trim_matches(is_frame).to_owned()
}

/// The serial number that a scanner put on the command line, read as the screen reads a scan: without what scanners put around a
/// code.
pub(crate) fn given(scan: &str) -> Result<String, SerialNumberError> {
    let scanned = Scanned { bytes: scan.as_bytes().to_vec(), ended: true, ..Scanned::default() };
    let text = || scan.trim().to_owned();
    let number = number("", &scanned).map_err(|problem| match problem {
        ScanProblem::Empty => SerialNumberError::Empty,
        ScanProblem::TooLong { characters } => SerialNumberError::TooLong { characters },
        ScanProblem::Control => SerialNumberError::Control { text: text() },
        ScanProblem::Fields(fields) => SerialNumberError::Fields { fields },
        ScanProblem::Layout(text) => SerialNumberError::Layout { text },
        ScanProblem::Invisible(character) => SerialNumberError::Invisible { text: text(), character },
    })?;
    serial_number::check(&number)
}

/// The serial number that stands in a field of a scan of the command line; `None` if the scan has no fields, or not just one
/// serial number among them.
pub(crate) fn field_given(scan: &str) -> Option<String> {
    let scanned = Scanned { bytes: scan.as_bytes().to_vec(), ended: true, ..Scanned::default() };
    let code = unframed("", &scanned);
    serial_number::check(fields::serial_number(&code)?).ok()
}

/// What scanners put before and behind a code: control characters, spaces, the mark of the byte order.
fn is_frame(character: char) -> bool {
    character.is_control() || character.is_whitespace() || character == '\u{feff}'
}

/// The name of the symbology in front of a code, as AIM writes it: `]C1` of GS1-128, `]d2` of GS1 DataMatrix.
fn without_symbology(text: &str) -> &str {
    let mut characters = text.chars();
    let named = characters.next() == Some(']')
        && characters.next().is_some_and(|code| code.is_ascii_alphabetic())
        && characters.next().is_some_and(|modifier| modifier.is_ascii_alphanumeric());
    let rest = characters.as_str();
    if named && !rest.is_empty() { rest } else { text }
}

/// The code without keys that a scanner pressed before or behind it.
fn without_keys(bytes: &[u8]) -> &[u8] {
    let framing = |byte: u8| byte < 0x20 && byte != 0x1b;
    let mut rest = bytes;
    while let [first, behind @ ..] = rest {
        rest = match whole_sequence(rest) {
            Some(length) => &rest[length..],
            None if framing(*first) => behind,
            None => break,
        };
    }
    // From the first escape on, nothing but keys may follow.
    let Some(at) = rest.iter().position(|byte| *byte == 0x1b) else { return rest };
    let mut tail = &rest[at..];
    while let [first, behind @ ..] = tail {
        tail = match whole_sequence(tail) {
            Some(length) => &tail[length..],
            None if framing(*first) => behind,
            None => return rest,
        };
    }
    &rest[..at]
}

/// Cuts what a scanner at a serial port sends into scans.
#[derive(Debug, Default)]
pub(crate) struct ScannerLines {
    line: Scanned,
    last_at: Duration,
}

impl ScannerLines {
    /// Takes bytes that came at this time.
    pub(crate) fn feed(&mut self, at: Duration, bytes: &[u8]) -> Vec<Scanned> {
        let mut scans = Vec::new();
        self.last_at = at;
        for byte in bytes {
            if !ends_scan(*byte) {
                if self.line.bytes.len() < MAX_LINE {
                    self.line.bytes.push(*byte);
                } else {
                    self.line.dropped += 1;
                }
            } else if self.has_text() {
                scans.push(Scanned { ended: true, ..std::mem::take(&mut self.line) });
            }
        }
        scans
    }

    /// When [`ScannerLines::rest`] is due if no byte comes.
    pub(crate) fn due_at(&self) -> Option<Duration> {
        (!self.line.bytes.is_empty()).then(|| self.last_at + REST_OF_LINE)
    }

    /// Takes what came so far as all of the code: some scanners send no line end.
    pub(crate) fn rest(&mut self) -> Option<Scanned> {
        let has_text = self.has_text();
        let line = std::mem::take(&mut self.line);
        has_text.then_some(line)
    }

    /// Forgets what came: the scanner went away in the middle of a code.
    pub(crate) fn cut(&mut self) {
        self.line = Scanned::default();
    }

    /// Whether there is more than the frame of the next code, the LF of CR LF or STX.
    fn has_text(&self) -> bool {
        self.line.bytes.iter().any(|byte| *byte > b' ')
    }
}

#[cfg(test)]
mod tests;
