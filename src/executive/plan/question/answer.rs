//! From what a person types, scans or pastes to a value.

use gnc_text::quoted;

use super::{DONE, Question, QuestionKind, YES};
use crate::measurement::Value;
use crate::quantity::{Quantity, Unit, number_and_unit};
use crate::serial_number::SerialNumberPattern;

/// Longest answer: as long as a line of the screen's fields.
const ANSWER_CHARACTERS: usize = 200;
/// Whole numbers from here on are not exact any more; nobody reads such a number off a meter.
const LARGEST: f64 = 9_007_199_254_740_992.0;
/// Digits of a group of thousands.
const THOUSANDS: usize = 3;

/// Why a text is no answer to a question.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AnswerError {
    /// Nothing was typed.
    #[error("the answer is empty")]
    Empty,
    /// It is too long.
    #[error("the answer has {characters} characters, and at most {ANSWER_CHARACTERS} are kept")]
    TooLong {
        /// Its characters.
        characters: usize,
    },
    /// It has characters that are no text.
    #[error("the answer has control characters")]
    Control,
    /// It is not a number.
    #[error("{} is not a number", quoted(text))]
    NotANumber {
        /// The text.
        text: String,
    },
    /// A comma that may stand for the decimal point, or between thousands.
    #[error("{} could be {} or {}", quoted(text), text.replace(',', "."), text.replace(',', ""))]
    Ambiguous {
        /// The text.
        text: String,
    },
    /// No meter shows such a number.
    #[error("the number {} is too large", quoted(text))]
    TooLarge {
        /// The text.
        text: String,
    },
    /// A unit that is unknown or of another dimension.
    #[error("{} is not in {unit}", quoted(text))]
    Unit {
        /// The text.
        text: String,
        /// The unit of the question.
        unit: Unit,
    },
    /// A word behind a number that has no unit.
    #[error("{} is not a plain number", quoted(text))]
    Plain {
        /// The text.
        text: String,
    },
    /// It does not match the pattern.
    #[error("{} does not match {pattern}", quoted(text))]
    Pattern {
        /// The text.
        text: String,
        /// The pattern.
        pattern: String,
    },
    /// It is none of the choices.
    #[error("{} is none of {}", quoted(text), of.join(", "))]
    NoChoice {
        /// The text.
        text: String,
        /// The choices.
        of: Vec<String>,
    },
    /// Something else than "done" was typed.
    #[error("{} is not {DONE}", quoted(text))]
    NotDone {
        /// The text.
        text: String,
    },
}

impl AnswerError {
    /// What the person can try.
    #[must_use]
    pub fn try_this(&self) -> &'static str {
        match self {
            AnswerError::Empty => "type or scan the answer",
            AnswerError::TooLong { .. } | AnswerError::Control => "type it by hand",
            AnswerError::NotANumber { .. } => "write a number, such as 3.3",
            AnswerError::Ambiguous { .. } => "write it with a decimal point, or without any comma",
            AnswerError::TooLarge { .. } => "read the number again",
            AnswerError::Unit { .. } => "write the number alone, or with this unit",
            AnswerError::Plain { .. } => "write the number alone",
            AnswerError::Pattern { .. } => "look at the text again",
            AnswerError::NoChoice { .. } => "write one of them, or its number",
            AnswerError::NotDone { .. } => "write done",
        }
    }
}

impl Question {
    /// Reads an answer.
    ///
    /// # Errors
    /// Why the text is no answer.
    pub fn read(&self, typed: &str) -> Result<Value, AnswerError> {
        let text = typed.trim();
        let characters = text.chars().count();
        if characters > ANSWER_CHARACTERS {
            return Err(AnswerError::TooLong { characters });
        }
        if text.chars().any(char::is_control) {
            return Err(AnswerError::Control);
        }
        // To one that is only done there is one answer, which stands in the hint.
        if text.is_empty() && self.kind != QuestionKind::Done {
            return Err(AnswerError::Empty);
        }
        let owned = || text.to_owned();
        match &self.kind {
            QuestionKind::Done if [DONE, YES].into_iter().any(|word| text.eq_ignore_ascii_case(word)) => {
                Ok(Value::text(DONE))
            }
            QuestionKind::Done => Err(AnswerError::NotDone { text: owned() }),
            QuestionKind::Text { pattern } => match pattern.as_ref().filter(|pattern| !pattern.fits(text)) {
                Some(pattern) => {
                    Err(AnswerError::Pattern { text: owned(), pattern: SerialNumberPattern::to_string(pattern) })
                }
                None => Ok(Value::text(text)),
            },
            QuestionKind::Number { unit } => number(text, *unit).map(Value::Number),
            QuestionKind::Choice { of } => {
                let at = text.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
                let alike = of.iter().find(|choice| choice.to_lowercase() == text.to_lowercase());
                let chosen = alike.or_else(|| of.get(at?));
                chosen.map(Value::text).ok_or_else(|| AnswerError::NoChoice { text: owned(), of: of.clone() })
            }
        }
    }
}

/// Reads a number as a person writes it: with a decimal comma, with or without its unit, with blanks around it.
fn number(text: &str, unit: Unit) -> Result<Quantity, AnswerError> {
    let plain: String = text.chars().map(half_width).collect();
    let plain = plain.trim();
    let end = plain.find(|c: char| !(c.is_ascii_digit() || ".,+-\u{2212}".contains(c))).unwrap_or(plain.len());
    let (digits, rest) = plain.split_at(end);
    let not_a_number = || AnswerError::NotANumber { text: text.to_owned() };
    let point = match digits.split_once(',') {
        None => plain.to_owned(),
        Some((_, fraction)) if digits.contains('.') || fraction.contains(',') => return Err(not_a_number()),
        Some((whole, fraction)) => {
            let whole = whole.trim_start_matches(['+', '-', '\u{2212}']);
            if fraction.len() == THOUSANDS && (1..=THOUSANDS).contains(&whole.len()) && !whole.starts_with('0') {
                return Err(AnswerError::Ambiguous { text: digits.to_owned() });
            }
            format!("{}{rest}", digits.replace(',', "."))
        }
    };
    let (number, written) = number_and_unit(&point).map_err(|error| match error {
        crate::quantity::QuantityError::TooLarge { .. } => AnswerError::TooLarge { text: text.to_owned() },
        _ => not_a_number(),
    })?;
    let named = if written.is_empty() { Some(unit) } else { Unit::parse(written) };
    let quantity = named.map(|named| Quantity::new(number, named));
    let Some((quantity, converted)) = quantity.and_then(|quantity| Some((quantity, quantity.in_unit(unit)?))) else {
        let text = text.to_owned();
        return Err(if unit == Unit::Count { AnswerError::Plain { text } } else { AnswerError::Unit { text, unit } });
    };
    // Neither as it is written nor in the unit of the question.
    if ![number, converted].iter().all(|number| number.abs() < LARGEST) {
        return Err(AnswerError::TooLarge { text: text.to_owned() });
    }
    Ok(quantity)
}

/// The usual character for one that an input method writes in full width, and a blank for every kind of blank.
fn half_width(character: char) -> char {
    match character {
        '\u{ff01}'..='\u{ff5e}' => char::from_u32(character as u32 - 0xfee0).unwrap_or(character),
        blank if blank.is_whitespace() => ' ',
        other => other,
    }
}
