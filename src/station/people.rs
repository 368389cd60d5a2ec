//! Lines for people on standard output, in the language of the locale.
//!
//! What a command finds is written here and nowhere else, so no line misses its translation. What programs read (JSON, CSV,
//! pages, completions) does not come here: it is the same in every language.

use std::fmt::Display;
use std::io::Write;

use crate::locale::{Environment, Lang};
use crate::phrases::in_language;

/// Where the lines go, and their language.
pub(crate) struct PeopleOutput<'o> {
    out: Box<dyn Write + 'o>,
    lang: Lang,
}

impl PeopleOutput<'static> {
    /// Standard output, in the language of the locale.
    pub(crate) fn standard() -> Self {
        Self { out: Box::new(std::io::stdout().lock()), lang: Environment::read().language(None) }
    }
}

impl<'o> PeopleOutput<'o> {
    /// Another place, in a language.
    #[cfg(test)]
    pub(crate) fn to(out: &'o mut Vec<u8>, lang: Lang) -> Self {
        Self { out: Box::new(out), lang }
    }

    pub(crate) fn lang(&self) -> Lang {
        self.lang
    }

    /// Says an English text: each of its lines in the language, as far as the table knows its sentences.
    pub(crate) fn say(&mut self, text: impl Display) {
        let text = text.to_string();
        for line in text.strip_suffix('\n').unwrap_or(&text).split('\n') {
            let line = in_language(line, self.lang);
            self.write(&line);
            self.write("\n");
        }
    }

    /// Writes what has its language already, such as a table whose columns are aligned.
    pub(crate) fn write(&mut self, text: &str) {
        // A reader that closed the pipe (`| head`) needs no more.
        let _ = self.out.write_all(text.as_bytes());
    }
}

/// Columns of a text on a terminal. Chinese characters take two.
pub(crate) fn columns_of(text: &str) -> usize {
    ratatui::text::Span::raw(text).width()
}
