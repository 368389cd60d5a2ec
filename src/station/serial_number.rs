//! Serial numbers as scanned. They come from outside, so they may hold any text.

use gnc_executive::serial_number::SerialNumberPattern;
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
    #[error("the scan holds several fields: {}", quoted(fields))]
    Fields { fields: String },
    #[error("{}: the scanner types in another layout", quoted(text))]
    Layout { text: String },
    #[error("the serial number {} contains the sign {} (U+{:04X}), which bench and plan do not allow", quoted(text), quoted(&sign.to_string()), *sign as u32)]
    Sign { text: String, sign: char },
}

impl SerialNumberError {
    /// What the person can try.
    pub(crate) fn try_this(&self) -> &'static str {
        match self {
            Self::Layout { .. } => "switch to English, and scan again",
            Self::Fields { .. } => "scan the number's own code",
            Self::Sign { .. } => {
                "scan the module's label again; if the label has this sign, write it into serial_number of the bench file"
            }
            _ => "scan the module's label again",
        }
    }
}

/// Refuses a number with signs beyond printable ASCII, unless patterns name just these signs, those of bench and plan. Letters
/// of another layout of the keyboard than that of the label are called that.
pub(crate) fn check_signs<'a>(
    number: &str,
    patterns: impl IntoIterator<Item = &'a SerialNumberPattern>,
) -> Result<(), SerialNumberError> {
    let text = number.to_owned();
    match SerialNumberPattern::not_allowed(number, patterns) {
        None => Ok(()),
        Some(_) if is_other_layout(number) => Err(SerialNumberError::Layout { text }),
        Some(sign) => Err(SerialNumberError::Sign { text, sign }),
    }
}

/// Whether there are patterns, and a number fits all of them.
pub(crate) fn is_asked_for<'a>(number: &str, patterns: impl IntoIterator<Item = &'a SerialNumberPattern>) -> bool {
    let mut patterns = patterns.into_iter().peekable();
    patterns.peek().is_some() && patterns.all(|pattern| pattern.fits(number))
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

/// Whether a number was typed in another layout of the keyboard than that of the label: Cyrillic or other letters that are
/// not Latin, or forms of full width from a Chinese input method. Chinese characters are not typed by a scanner, but some
/// codes hold them.
pub(crate) fn is_other_layout(number: &str) -> bool {
    number.chars().any(|character| match character {
        // Full-width forms, half-width kana, the ideographic space and punctuation.
        '\u{ff01}'..='\u{ffee}' | '\u{3000}'..='\u{303f}' => true,
        // Latin with its accents, Chinese characters.
        '\0'..='\u{24f}' | '\u{1e00}'..='\u{1eff}' | '\u{3400}'..='\u{9fff}' | '\u{f900}'..='\u{faff}' => false,
        '\u{20000}'..='\u{3ffff}' => false,
        _ => character.is_alphabetic(),
    })
}

/// Whether nobody sees this character, or takes it for a space: with it, one label would have two numbers.
pub(crate) fn is_invisible(character: char) -> bool {
    matches!(character,
        '\u{a0}' | '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{115f}' | '\u{1160}' | '\u{17b4}' | '\u{17b5}'
        | '\u{180b}'..='\u{180f}' | '\u{2000}'..='\u{200f}' | '\u{2028}'..='\u{202f}' | '\u{205f}'..='\u{206f}'
        | '\u{3164}' | '\u{fe00}'..='\u{fe0f}' | '\u{feff}' | '\u{ffa0}' | '\u{fff0}'..='\u{fffd}'
        | '\u{e0000}'..='\u{e0fff}')
}
