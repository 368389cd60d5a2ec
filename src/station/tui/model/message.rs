//! The line of messages: what it says, and how long.

use std::borrow::Cow;
use std::time::Duration;

use super::ScreenModel;
use crate::phrases::in_language;
use crate::tui::lang::Lang;

/// How long news stays on the screen: long enough to be read twice.
const INFO_STAYS: Duration = Duration::from_secs(30);
/// How long a warning stays: an operator may be at the socket.
const WARNING_STAYS: Duration = Duration::from_secs(120);

/// How long the line stays that asks for ctrl-C once more, and how long the second one leaves: long enough to read it.
const ASKED_TO_LEAVE: Duration = Duration::from_secs(5);

/// How much a message matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MessageWeight {
    Info,
    Warning,
    Error,
}

/// How the limit of a question begins in errors and in the log.
const LIMIT_OF_QUESTION: &str = "Limit: ";

impl ScreenModel {
    /// What another part of the station says, in the language of the screen; also the plan's own words, as far as the plan has
    /// them in that language.
    pub(crate) fn said<'a>(&self, text: &'a str) -> Cow<'a, str> {
        let mut said = in_language(text, self.lang);
        let words = self.plan.ready().map_or(&[][..], |plan| &plan.asks.words);
        for question in words {
            let own = match self.lang {
                Lang::En => None,
                Lang::Zh => Some(question.zh.as_ref().unwrap_or(&question.en)),
                Lang::Ru => Some(question.ru.as_ref().unwrap_or(&question.en)),
            };
            if let Some(own) = own.filter(|_| !question.en.is_empty() && said.contains(&question.en)) {
                // The table knows no sentences behind words that it does not know, so these are looked up by themselves.
                let (before, after) = said.split_once(&question.en).unwrap_or_default();
                // "A number in V. Limit: 4.9 V": the unit would take in the limit.
                let after = after.trim_start();
                let limit = after.find(LIMIT_OF_QUESTION).unwrap_or(0);
                let pieces = [&after[..limit], &after[limit..]].map(|piece| in_language(piece.trim(), self.lang));
                let after = pieces.join(" ").trim().to_owned();
                let between = if after.is_empty() { "" } else { " " };
                said = format!("{before}{own}{between}{after}").into();
            }
        }
        said
    }

    pub(crate) fn say(&mut self, weight: MessageWeight, text: impl Into<String>) {
        self.message = Some((weight, text.into()));
        self.message_since = self.now.since_start;
    }

    /// Gives the message on the screen another weight.
    pub(crate) fn weigh(&mut self, weight: MessageWeight) {
        if let Some(message) = &mut self.message {
            message.0 = weight;
        }
    }

    /// Warns of something that no key caused. It does not replace an error, which matters more.
    pub(crate) fn mention(&mut self, text: impl Into<String>) {
        self.say_aside(MessageWeight::Warning, text);
    }

    /// Tells something that no key caused, unless an error is on the screen.
    pub(crate) fn say_aside(&mut self, weight: MessageWeight, text: impl Into<String>) {
        if !matches!(self.message, Some((MessageWeight::Error, _))) {
            self.say(weight, text);
        }
    }

    /// Whether the line on the screen says that ctrl-C leaves. The next one does as long as it is there.
    pub(crate) fn is_asked_to_leave(&self) -> bool {
        self.message.as_ref().is_some_and(|(_, told)| told == self.texts.interrupt_again)
    }

    /// Takes that line away.
    pub(crate) fn ask_no_more_to_leave(&mut self) {
        if self.is_asked_to_leave() {
            self.message = None;
        }
    }

    /// Takes away the line that says that earlier runs are looked at.
    pub(crate) fn has_looked_back(&mut self) {
        if self.message.as_ref().is_some_and(|(_, told)| told == self.texts.looking_back) {
            self.message = None;
        }
    }

    /// How long the message stays; `None` if there is none, or if it is an error, which stays until something follows.
    pub(crate) fn message_left(&self) -> Option<Duration> {
        let stays = match self.message.as_ref()?.0 {
            _ if self.is_asked_to_leave() => ASKED_TO_LEAVE,
            MessageWeight::Info => INFO_STAYS,
            MessageWeight::Warning => WARNING_STAYS,
            MessageWeight::Error => return None,
        };
        Some((self.message_since + stays).saturating_sub(self.now.since_start))
    }
}
