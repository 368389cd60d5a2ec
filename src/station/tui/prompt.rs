//! A question of the run on the screen, with the answer as far as it is typed.

use std::time::Duration;

use gnc_bench::fixture::{Ask, QuestionAsked};
use gnc_executive::plan::QuestionKind;

use super::field::InputField;

/// A question of the run.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Prompt {
    pub item: String,
    pub ask: Ask,
    /// When it came, since the start of the program.
    pub since: Duration,
    /// The answer as far as it is typed.
    pub typed: InputField,
}

impl Prompt {
    /// The question of the plan that it is, if it is one.
    pub(crate) fn question(&self) -> Option<&QuestionAsked> {
        match &self.ask {
            Ask::Question(asked) => Some(asked),
            _ => None,
        }
    }

    /// Whether it is a question of the plan, or the look over the answers.
    pub(super) fn has_answer(&self) -> bool {
        matches!(self.ask, Ask::Question(_) | Ask::LookOver(_))
    }

    /// Whether it takes words. "Done" is a key.
    pub(crate) fn takes_words(&self) -> bool {
        self.question().is_some_and(|asked| asked.question.kind != QuestionKind::Done)
    }
}
