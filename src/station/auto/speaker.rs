//! The one printer of `--auto` for people: every line goes through it, in the language of the locale.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::sync::Arc;

use gnc_executive::plan::{Plan, QuestionWords};
use gnc_executive::record::{ItemRecord, RunRecord};
use gnc_text::{printable, printable_lines};

use crate::locale::Lang;
use crate::phrases::LONGEST;
use crate::wording::Wording;

/// What begins the words about the key that answers a request.
const PRESS: &str = " Press ";

/// Writes lines to standard output, or to standard error if the events go to standard output.
#[derive(Clone, Debug)]
pub(super) struct Speaker {
    events_to_stdout: bool,
    wording: Wording,
    /// The words of the plan's questions, by their names.
    questions: Arc<BTreeMap<String, QuestionWords>>,
}

impl Speaker {
    pub(super) fn new(events_to_stdout: bool, plan: &Plan, serial_number: &str) -> Self {
        let asked = plan.items().iter().flat_map(|item| &item.questions);
        let questions = asked.map(|question| (question.name.clone(), question.words.clone())).collect();
        let mut wording = Wording::of_locale();
        wording.keep([serial_number]);
        Self { events_to_stdout, wording, questions: Arc::new(questions) }
    }

    /// Whether events take up standard output.
    pub(super) fn events_to_stdout(&self) -> bool {
        self.events_to_stdout
    }

    pub(super) fn lang(&self) -> Lang {
        self.wording.lang()
    }

    /// Keeps the names of a run as they are.
    pub(super) fn keep_names_of(&mut self, run: &RunRecord) {
        self.wording.keep_names_of(run);
    }

    /// Keeps the names of an item and its measurements as they are.
    pub(super) fn keep_names_of_item(&mut self, item: &ItemRecord) {
        self.wording.keep_names_of_item(item);
    }

    /// A text in the language.
    pub(super) fn words(&self, english: &str) -> String {
        self.wording.text(english)
    }

    /// A line in the language.
    pub(super) fn say(&self, english: &str) {
        self.say_as_it_is(&self.words(english));
    }

    /// A line that is in the language already.
    pub(super) fn say_as_it_is(&self, line: &str) {
        // What came from outside is escaped already. This is for what is forgotten.
        self.write(&format!("{}\n", printable_lines(line)));
    }

    /// Writes a text. A terminal that is gone must not stop the test.
    pub(super) fn write(&self, text: &str) {
        let mut out: Box<dyn Write> =
            if self.events_to_stdout { Box::new(io::stderr()) } else { Box::new(io::stdout()) };
        let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    }

    /// A question of the plan, in the plan's own words of the language if it has such.
    pub(super) fn question(&self, name: &str, english: &str) -> String {
        let Some(words) = self.questions.get(name).filter(|_| self.lang() != Lang::En) else {
            return self.request(english);
        };
        let own = match self.lang() {
            Lang::En => None,
            Lang::Zh => words.zh.as_deref(),
            Lang::Ru => words.ru.as_deref(),
        };
        let (english, own) = (printable(english), printable(own.unwrap_or(&words.en)));
        match english.split_once(&*printable(&words.en)) {
            Some((before, after)) => {
                let parts = [self.sentences(before), own.into_owned(), self.sentences(after)];
                let parts: Vec<&str> = parts.iter().map(String::as_str).filter(|part| !part.is_empty()).collect();
                parts.join(self.between())
            }
            None => self.sentences(&english),
        }
    }

    /// A request to the operator.
    pub(super) fn request(&self, english: &str) -> String {
        let english = printable(english);
        match self.words(&english) {
            told if told == *english => self.sentences(&english),
            told => told,
        }
    }

    /// Sentences behind each other, of which some may be a person's own.
    fn sentences(&self, english: &str) -> String {
        if self.lang() == Lang::En || english.len() > LONGEST {
            return english.to_owned();
        }
        let mut told: Vec<String> = Vec::new();
        let mut rest = english.trim();
        while !rest.is_empty() {
            // "1 .. 2 V" ends no sentence.
            let ends = rest.match_indices(". ").map(|(at, _)| at + 1);
            let mut ends = ends.filter(|end| rest.get(..end - 1).is_some_and(|text| !text.ends_with([' ', '.'])));
            let end = ends.next().unwrap_or(rest.len());
            let end = rest[..end].find(PRESS).unwrap_or(end);
            let (one, more) = rest.split_at(end);
            told.push(match one.strip_prefix('(').and_then(|one| one.strip_suffix(')')) {
                Some(remark) => format!("({})", self.words(remark)),
                None => self.words(one),
            });
            rest = more.trim_start();
        }
        told.join(self.between())
    }

    /// What stands between two sentences.
    fn between(&self) -> &'static str {
        match self.lang() {
            Lang::Zh => "",
            Lang::En | Lang::Ru => " ",
        }
    }
}

#[cfg(test)]
mod tests;
