//! A question of a plan to the operator, and what counts as an answer to it.

mod answer;
mod read;

use std::fmt;

use crate::quantity::Unit;
use crate::serial_number::SerialNumberPattern;

pub use answer::AnswerError;
pub(super) use read::{Asked, limits, limits_of_part, questions};

/// The value of a question that has no other answer than "done".
pub const DONE: &str = "done";
/// The short word for it, as at the terminal.
pub const YES: &str = "y";

/// A question of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Question {
    /// Unique name in the plan; the answer is a measurement of this name.
    pub name: String,
    /// What is asked.
    pub words: QuestionWords,
    /// What counts as an answer.
    pub kind: QuestionKind,
    /// Path of a picture, as it is found from where the plan was found.
    pub picture: Option<String>,
    /// SHA-256 of the picture as hexadecimal digits, once it was read.
    pub picture_sha256: Option<String>,
}

/// The words of a question.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct QuestionWords {
    /// In English. The record has these.
    pub en: String,
    /// In Chinese.
    pub zh: Option<String>,
    /// In Russian.
    pub ru: Option<String>,
}

/// What counts as an answer to a question.
#[derive(Clone, Debug, PartialEq)]
pub enum QuestionKind {
    /// Something was done.
    Done,
    /// A text.
    Text {
        /// What the whole text must match.
        pattern: Option<SerialNumberPattern>,
    },
    /// A number.
    Number {
        /// Its unit, if the answer names none.
        unit: Unit,
    },
    /// One of several texts.
    Choice {
        /// All of them.
        of: Vec<String>,
    },
}

impl QuestionKind {
    /// The word for it in plans.
    fn as_str(&self) -> &'static str {
        match self {
            QuestionKind::Done => "done",
            QuestionKind::Text { .. } => "text",
            QuestionKind::Number { .. } => "number",
            QuestionKind::Choice { .. } => "choice",
        }
    }
}

impl fmt::Display for QuestionKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

#[cfg(test)]
mod tests;
