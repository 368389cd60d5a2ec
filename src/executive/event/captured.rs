//! What the journal says of a raw file, so that it cannot be exchanged while the run has no end.

use serde::{Deserialize, Serialize};

/// What a raw file holds when a capture is complete, and again when the file is. The file is only ever appended to, so these bytes
/// stay its first ones.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CapturedSamples {
    /// Name of the item.
    pub item: String,
    /// Attempt, from 1.
    pub attempt: u32,
    /// The file, relative to the folder of the run.
    pub file: String,
    /// Number of bytes that are on disk.
    pub bytes: u64,
    /// Their SHA-256, as hexadecimal digits.
    pub sha256: String,
    /// SHA-256 of all lines of the journal before this one. What writes the journal fills it in.
    pub journal_sha256: String,
    /// The station's signature of [`CapturedSamples::signed_text`], as hexadecimal digits; absent if the station has no key.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub signature: Option<String>,
}

impl CapturedSamples {
    /// The text that a station signs. The digest of the journal covers module, plan and bench, and all that was measured before.
    pub fn signed_text(&self) -> String {
        format!("gnc-captured/1 {} {} {} {}", self.journal_sha256, self.sha256, self.bytes, self.file)
    }
}
