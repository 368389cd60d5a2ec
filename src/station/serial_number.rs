//! Serial numbers as scanned. They come from outside, so they may hold any text.

use gnc_text::quoted;

/// Longest serial number; the longest code that a barcode reader of this kind of line gives has 48 characters.
pub(crate) const MAX_CHARACTERS: usize = 64;

/// Why a text is not a serial number.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum SerialNumberError {
    #[error("the serial number is empty")]
    Empty,
    #[error("the serial number has {characters} characters, at most {MAX_CHARACTERS} are allowed")]
    TooLong { characters: usize },
    #[error("the serial number {} contains control characters", quoted(text))]
    Control { text: String },
}

/// Returns the serial number without white space around it, which some scanners add. White space inside belongs to the
/// number.
pub(crate) fn check(scanned: &str) -> Result<String, SerialNumberError> {
    let text = scanned.trim();
    let characters = text.chars().count();
    if text.is_empty() {
        return Err(SerialNumberError::Empty);
    }
    if characters > MAX_CHARACTERS {
        return Err(SerialNumberError::TooLong { characters });
    }
    if text.chars().any(char::is_control) {
        return Err(SerialNumberError::Control { text: text.to_owned() });
    }
    Ok(text.to_owned())
}
