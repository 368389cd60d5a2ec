//! Serial numbers on the screen.

use gnc_executive::standing::Standing;

use crate::tui::field::{InputField, MAX_CHARACTERS};

/// Serial numbers: the one being typed, the current one, and the next one.
#[derive(Debug, Default)]
pub(crate) struct Scan {
    pub typed: InputField,
    /// The last characters that came as keys, whether a field took them or not; the beginning of a scan may be among them.
    pub recent: String,
    /// The last scan without a line end.
    pub unended: String,
    /// The scans of this scanner have a line end, so one without was cut off.
    pub has_ends: bool,
    pub current: Option<String>,
    /// Scanned while a run was on.
    pub next: Option<String>,
    /// What the records say of `current` by the plan on the screen; `None` until they were searched.
    pub standing: Option<Standing>,
}

impl Scan {
    /// Whether what is typed is a scan without a line end, and no hand has changed it.
    pub(crate) fn waits(&self) -> bool {
        !self.unended.is_empty() && self.typed.text() == self.unended
    }

    /// Keeps a character that came as a key, and forgets what no scan can reach back to.
    pub(crate) fn keep(&mut self, character: char) {
        self.recent.push(character);
        if self.recent.chars().count() > MAX_CHARACTERS {
            self.recent.remove(0);
        }
    }
}
