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
    #[error("the serial number {} contains a character that nobody sees (U+{:04X})", quoted(text), *character as u32)]
    Invisible { text: String, character: char },
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
    if let Some(character) = text.chars().find(|character| is_invisible(*character)) {
        return Err(SerialNumberError::Invisible { text: text.to_owned(), character });
    }
    Ok(text.to_owned())
}

/// Whether nobody sees this character, or takes it for a space: with it, one label would have two numbers.
pub(crate) fn is_invisible(character: char) -> bool {
    matches!(character,
        '\u{a0}' | '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{115f}' | '\u{1160}' | '\u{17b4}' | '\u{17b5}'
        | '\u{180b}'..='\u{180f}' | '\u{2000}'..='\u{200f}' | '\u{2028}'..='\u{202f}' | '\u{205f}'..='\u{206f}'
        | '\u{3164}' | '\u{fe00}'..='\u{fe0f}' | '\u{feff}' | '\u{ffa0}' | '\u{fff0}'..='\u{fffd}'
        | '\u{e0000}'..='\u{e0fff}')
}
