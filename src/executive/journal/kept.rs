//! What a journal may take of the memory, against its bytes: a journal is read line by line, and most of what its lines say is
//! kept until the run is shown.

use serde_json::Value;

use super::JournalError;
use crate::event::{Event, EventKind};

/// Most bytes of memory that the events of a run may take: 800,000 measurements, or details with 6 million numbers. The journal of an
/// acceptance has a thousandth of that.
pub const MOST_KEPT: u64 = 384 << 20;
/// Bytes of memory for a byte of a line without details: names and texts have heads of their own.
const OF_OTHERS: u64 = 2;
/// What a value within a line takes, in bytes: 32 while the line is read and 32 as details, and a list has room to grow.
const OF_VALUE: u64 = 128;
/// What a list takes beside its values: it makes room for four at once.
const OF_LIST: u64 = 288;
/// What an object takes beside its values: it makes room for eleven at once.
const OF_OBJECT: u64 = 920;
/// What the name of a value takes beside its bytes.
const OF_NAME: u64 = 300;
/// What one end of a text takes beside its bytes.
const OF_QUOTE: u64 = 32;

/// What the events so far take.
#[derive(Clone, Copy, Debug, Default)]
pub struct Kept {
    bytes: u64,
}

impl Kept {
    /// Looks at a line before it is read: a few megabytes of empty lists become a gigabyte.
    ///
    /// # Errors
    /// It takes more than any run of this station.
    pub fn check_line(line: usize, bytes: &[u8]) -> Result<(), JournalError> {
        // That a short line may take as much is impossible, and most are short.
        if (bytes.len() as u64).saturating_mul(OF_OBJECT) > MOST_KEPT && weight(bytes) > MOST_KEPT {
            return Err(JournalError::TooMuch { line });
        }
        Ok(())
    }

    /// Counts the event of a line.
    ///
    /// # Errors
    /// The events so far take more than any run of this station.
    pub fn add(&mut self, line: usize, bytes: &[u8], kind: &EventKind) -> Result<(), JournalError> {
        let taken = match kind {
            EventKind::Found { details, .. } => retained(details),
            _ => (bytes.len() as u64).saturating_mul(OF_OTHERS),
        };
        self.bytes = self.bytes.saturating_add(taken.max(size_of::<Event>() as u64));
        if self.bytes > MOST_KEPT { Err(JournalError::TooMuch { line }) } else { Ok(()) }
    }
}

/// Bytes of a node of an object's tree: eleven names and values, and one for each five names at least.
const OF_NODE: u64 = 11 * (size_of::<String>() + size_of::<Value>()) as u64 + 16;
/// Names in a node of an object at least.
const IN_NODE: usize = 5;
/// Bytes that the allocator needs for a text or a list of its own.
const OF_ALLOCATION: u64 = 16;

/// The memory that details take beside their own value.
fn retained(value: &Value) -> u64 {
    let of_text = |text: &String| text.capacity() as u64 + OF_ALLOCATION;
    match value {
        Value::Null | Value::Bool(_) | Value::Number(_) => 0,
        Value::String(text) => of_text(text),
        Value::Array(values) => {
            let room = (values.capacity() * size_of::<Value>()) as u64 + OF_ALLOCATION;
            values.iter().map(retained).fold(room, u64::saturating_add)
        }
        Value::Object(values) => {
            let room = values.len().div_ceil(IN_NODE) as u64 * OF_NODE;
            values.iter().map(|(name, value)| of_text(name) + retained(value)).fold(room, u64::saturating_add)
        }
    }
}

/// The memory that a line of JSON takes at most while it is read.
fn weight(bytes: &[u8]) -> u64 {
    let (mut weight, mut in_text, mut escaped) = (bytes.len() as u64, false, false);
    for byte in bytes {
        let of = match byte {
            _ if escaped => {
                escaped = false;
                0
            }
            b'\\' if in_text => {
                escaped = true;
                0
            }
            b'"' => {
                in_text = !in_text;
                OF_QUOTE
            }
            _ if in_text => 0,
            b',' => OF_VALUE,
            b':' => OF_NAME,
            b'[' => OF_LIST,
            b'{' => OF_OBJECT,
            _ => 0,
        };
        weight = weight.saturating_add(of);
    }
    weight
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::NoteLevel;

    #[test]
    fn what_is_kept_has_a_bound() {
        let note = EventKind::Note { level: NoteLevel::Info, text: "x".into(), item: None };
        let mut kept = Kept::default();
        let most = vec![b'x'; (MOST_KEPT / OF_OTHERS) as usize];
        assert!(kept.add(1, &most, &note).is_ok());
        assert!(matches!(kept.add(7, b"x", &note), Err(JournalError::TooMuch { line: 7 })));
    }

    /// What is kept of details is what they take in memory and not what reading them took: lists and objects are counted with the room
    /// that they have.
    #[test]
    fn details_count_what_they_take() {
        let details = |text: &str| serde_json::from_str::<Value>(text).unwrap();
        assert_eq!(retained(&details("0.125")), 0);
        let numbers = details(&format!("[{}0]", "0,".repeat(999_999)));
        assert!((32_000_000..=64_100_000).contains(&retained(&numbers)), "{}", retained(&numbers));
        let objects = details(&format!("[{}{{\"a\":0}}]", "{\"a\":0},".repeat(999)));
        assert!((600_000..=800_000).contains(&retained(&objects)), "{}", retained(&objects));
    }

    /// Details that a station of an earlier version wrote, as often as the bound of that version let them be read.
    #[test]
    fn real_details_are_read_as_often_as_before() {
        let journal = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/older/chain-1/records");
        let mut folders = vec![std::path::PathBuf::from(journal)];
        let mut lines = Vec::new();
        while let Some(folder) = folders.pop() {
            for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
                if path.is_dir() {
                    folders.push(path);
                } else if path.ends_with("events.jsonl") {
                    let text = std::fs::read_to_string(path).unwrap();
                    lines.extend(text.lines().filter(|line| line.contains("\"found\"")).map(str::to_owned));
                }
            }
        }
        assert!(!lines.is_empty());
        for line in lines {
            let event: Event = serde_json::from_str(&line).unwrap();
            let mut kept = Kept::default();
            let bound_before = (48 << 20) / line.len();
            for at in 1..=bound_before {
                kept.add(at, line.as_bytes(), &event.kind).unwrap();
            }
        }
    }

    /// Lines far below the longest one, and what each kind of value takes in memory: more than what stands here.
    #[test]
    fn a_line_that_becomes_too_much_is_refused_before_it_is_read() {
        for (value, least_taken) in [("0,", 64), ("[0],", 176), ("{\"\":0},", 700), ("[],", 64), ("\"\",", 64)] {
            let line = value.repeat(16 << 10);
            let taken = 16 * 1024 * least_taken;
            assert!(weight(line.as_bytes()) >= taken, "{value} counts less than it takes");
            let too_much = value.repeat((MOST_KEPT / least_taken) as usize);
            let refused = Kept::check_line(5, too_much.as_bytes());
            assert!(matches!(refused, Err(JournalError::TooMuch { line: 5 })), "{value}");
            assert!(Kept::check_line(5, line.as_bytes()).is_ok(), "{value}");
        }
        // A long text takes its own bytes, whatever stands in it.
        let text = format!("\"{}\\\"{}\"", "[{,:".repeat(1 << 20), "[{,:".repeat(1 << 20));
        assert!(Kept::check_line(1, text.as_bytes()).is_ok());
    }
}
