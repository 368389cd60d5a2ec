//! What a journal may take of the memory, against its bytes: a journal is read line by line, and most of what its lines say is
//! kept until the run is shown.

use super::JournalError;
use crate::event::{Event, EventKind};

/// Most bytes of memory that the events of a run may take: 800,000 measurements, or 48 MB of details. The journal of an
/// acceptance has a thousandth of that.
pub const MOST_KEPT: u64 = 384 << 20;
/// Bytes of memory for a byte of a line with details: `0,` becomes a number of eight bytes, and a list grows beyond its end.
const OF_DETAILS: u64 = 8;
/// Bytes of memory for a byte of any other line: names and texts have heads of their own.
const OF_OTHERS: u64 = 2;

/// What the events so far take.
#[derive(Clone, Copy, Debug, Default)]
pub struct Kept {
    bytes: u64,
}

impl Kept {
    /// Counts the event of a line.
    ///
    /// # Errors
    /// The events so far take more than any run of this station.
    pub fn add(&mut self, line: usize, bytes: usize, kind: &EventKind) -> Result<(), JournalError> {
        let of_byte = if matches!(kind, EventKind::Found { .. }) { OF_DETAILS } else { OF_OTHERS };
        let taken = (bytes as u64).saturating_mul(of_byte).max(size_of::<Event>() as u64);
        self.bytes = self.bytes.saturating_add(taken);
        if self.bytes > MOST_KEPT { Err(JournalError::TooMuch { line }) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::NoteLevel;

    #[test]
    fn what_is_kept_has_a_bound() {
        let note = EventKind::Note { level: NoteLevel::Info, text: "x".into(), item: None };
        let mut kept = Kept::default();
        let most = (MOST_KEPT / OF_OTHERS) as usize;
        assert!(kept.add(1, most, &note).is_ok());
        assert!(matches!(kept.add(7, 1, &note), Err(JournalError::TooMuch { line: 7 })));
        assert!(matches!(Kept::default().add(3, usize::MAX, &note), Err(JournalError::TooMuch { line: 3 })));
    }
}
