//! Lines for people on standard output, in the language of the locale.
//!
//! Each command whose lines are for people writes them through [`Lines`], so that a new line is looked up in the table of
//! sentences like all others. What is kept or read by programs (records, JSON, CSV, JUnit, events) does not come here.
//!
//! A line may be a row of a table: cells with two spaces or more between them. Each cell is looked up by itself, and
//! begins in the column where it begins in English, as the terminal counts columns.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::io::{self, Write};

use gnc_executive::catalogue::ItemId;
use gnc_executive::record::{ItemRecord, RunRecord};
use gnc_text::{printable, printable_lines};
use ratatui::text::Span;

use crate::locale::{Environment, Lang};
use crate::phrases::{LONGEST, Tries, in_language, in_language_within};

/// Begins the cell with what a person looks at when a measurement is bad.
const LOOK_AT: &str = "look at: ";

/// Words before a sentence that is looked up by itself: a place at the beginning of another one could take them in.
const BEFORE: [&str; 2] = ["note: ", "DANGER: "];

/// Texts for which a line has tries. A row has a dozen cells, and most of them are short.
const TEXTS_OF_LINE: u32 = 4;

/// Most texts in another: a banner with a name, words with a remark, a list in it.
const MOST_DEPTH: u32 = 8;

/// The language of lines, and the names that no language changes.
#[derive(Clone, Debug)]
pub(crate) struct Wording {
    lang: Lang,
    names: BTreeSet<String>,
    /// Names of measurements: what stands behind one is its value.
    measurements: BTreeSet<String>,
}

impl Wording {
    /// The language of the locale.
    pub(crate) fn of_locale() -> Self {
        Self::new(Environment::read().language(None))
    }

    pub(crate) fn new(lang: Lang) -> Self {
        Self { lang, names: BTreeSet::new(), measurements: BTreeSet::new() }
    }

    /// The language.
    pub(crate) fn lang(&self) -> Lang {
        self.lang
    }

    /// Keeps names as they are, whatever words they look like.
    pub(crate) fn keep<'a>(&mut self, names: impl IntoIterator<Item = &'a str>) {
        self.names.extend(names.into_iter().map(|name| printable(name).into_owned()));
    }

    /// Keeps what people named in a run, and the names of its items and measurements.
    pub(crate) fn keep_names_of(&mut self, run: &RunRecord) {
        self.keep([run.serial_number.as_str(), &run.plan.name, &run.station]);
        let plan = &run.plan;
        self.keep([format!("{} {}, SHA-256 {}", plan.name, plan.version, plan.sha256).as_str()]);
        self.keep(run.operator.as_deref());
        self.keep(run.board.iter().map(|board| board.board_serial.as_str()));
        for item in &run.items {
            self.keep_names_of_item(item);
        }
    }

    /// Keeps the names of an item and its measurements.
    pub(crate) fn keep_names_of_item(&mut self, item: &ItemRecord) {
        self.keep([item.name.as_str()]);
        let measured = item.attempts.iter().flat_map(|attempt| &attempt.measurements);
        self.measurements.extend(measured.map(|measurement| printable(&measurement.name).into_owned()));
    }

    /// A text of one or more lines in the language.
    pub(crate) fn text(&self, english: &str) -> String {
        if self.lang == Lang::En {
            return english.to_owned();
        }
        english.split('\n').map(|line| self.line(line)).collect::<Vec<_>>().join("\n")
    }

    fn line(&self, line: &str) -> String {
        // The station says no such line. A person's note may be one.
        if line.len() > LONGEST {
            return line.to_owned();
        }
        let mut tries = Tries::of_texts(TEXTS_OF_LINE);
        let indent = line.len() - line.trim_start_matches(' ').len();
        let (indent, rest) = line.split_at(indent);
        let mut out = indent.to_owned();
        // Where the next cell begins in English, and how far the line is told.
        let (mut column, mut told) = (indent.len(), indent.len());
        // A verdict in capitals is no row of a table: what follows it stands close to it.
        let is_row = !rest.chars().take(2).all(char::is_uppercase);
        let cells = cells(rest);
        // At the beginning of a row stands a word of the station.
        let is_alone = cells.len() == 1;
        for (index, (text, gap)) in cells.into_iter().enumerate() {
            column += width(text) + gap;
            let cell = match (index > 0 || is_alone) && self.names.contains(text) {
                true => Cow::Borrowed(text),
                false => self.cell(text, MOST_DEPTH, &mut tries),
            };
            out.push_str(&cell);
            told += width(&cell);
            if gap > 0 {
                let missing = if is_row { column.saturating_sub(told) } else { gap };
                let missing = missing.max(2);
                out.push_str(&" ".repeat(missing));
                told += missing;
            }
        }
        out
    }

    /// A text without columns: a sentence, words in a list, or a name with words behind it.
    fn cell<'a>(&self, text: &'a str, depth: u32, tries: &mut Tries) -> Cow<'a, str> {
        let Some(depth) = depth.checked_sub(1).filter(|_| !text.is_empty()) else { return Cow::Borrowed(text) };
        if let Some(banner) = text.strip_prefix("*** ").and_then(|text| text.strip_suffix(" ***")) {
            return Cow::Owned(format!("*** {} ***", self.cell(banner, depth, tries)));
        }
        if let Some(told) = self.look_at(text) {
            return Cow::Owned(told);
        }
        if let Some((name, rest)) = name_before(text, &self.measurements) {
            return Cow::Owned(format!("{name} {}", self.cell(rest, depth, tries)));
        }
        if let Some((word, rest)) = BEFORE.iter().find_map(|word| Some((word, text.strip_prefix(word)?))) {
            let told = format!("{word}{}", self.cell(rest, depth, tries));
            return Cow::Owned(in_language_within(&told, self.lang, tries).into_owned());
        }
        // A place at the end of a sentence could take in a whole list.
        let list = self.list(text, tries);
        if let Some((list, 2..)) = list {
            return Cow::Owned(list);
        }
        let whole = in_language_within(text, self.lang, tries);
        if let Cow::Owned(whole) = whole {
            return Cow::Owned(whole);
        }
        if let Some((name, rest)) = name_before(text, &self.names) {
            return Cow::Owned(format!("{name} {}", self.cell(rest, depth, tries)));
        }
        if let Some((list, _)) = list {
            return Cow::Owned(list);
        }
        self.with_remark(text, depth, tries).map_or(Cow::Borrowed(text), Cow::Owned)
    }

    /// The advice of the catalogue, which has its translations beside it.
    fn look_at(&self, text: &str) -> Option<String> {
        let sentence = text.strip_prefix(LOOK_AT)?;
        let all = ItemId::ALL.iter().flat_map(|item| item.spec().measurements);
        let known = all.map(|measurement| measurement.look_at).find(|known| *known == sentence)?;
        Some(in_language(&format!("{LOOK_AT}{}", (self.lang.texts().look_at_sentence)(known)), self.lang).into_owned())
    }

    /// "1 passed, 2 failed": parts with a comma between them, and how many of them the table knows, at least one.
    fn list(&self, text: &str, tries: &mut Tries) -> Option<(String, usize)> {
        // The clauses of a sentence are no list.
        if text.contains(['(', ';']) || text.contains(": ") {
            return None;
        }
        let parts: Vec<&str> = text.split(", ").collect();
        let told: Vec<Cow<'_, str>> = parts
            .iter()
            .map(|part| match self.names.contains(*part) {
                true => Cow::Borrowed(*part),
                false => in_language_within(part, self.lang, tries),
            })
            .collect();
        let known = told.iter().filter(|part| matches!(part, Cow::Owned(_))).count();
        let comma = if self.lang == Lang::Zh { "，" } else { ", " };
        (parts.len() > 1 && known > 0).then(|| (told.join(comma), known))
    }

    /// "ERRORED (simulated, selection)": words, and a remark in parentheses behind them.
    fn with_remark(&self, text: &str, depth: u32, tries: &mut Tries) -> Option<String> {
        let (words, remark) = text.strip_suffix(')')?.split_once(" (")?;
        let told = in_language_within(words, self.lang, tries);
        let remarked = self.cell(remark, depth, tries);
        if matches!((&told, &remarked), (Cow::Borrowed(_), Cow::Borrowed(_))) {
            return None;
        }
        Some(match self.lang {
            Lang::Zh => format!("{told}（{remarked}）"),
            Lang::En | Lang::Ru => format!("{told} ({remarked})"),
        })
    }
}

/// One of these names at the beginning, and the words behind it.
fn name_before<'a>(text: &'a str, names: &BTreeSet<String>) -> Option<(&'a str, &'a str)> {
    let ends = text.match_indices(' ').map(|(at, _)| at);
    let mut named = ends.filter(|at| names.contains(&text[..*at]));
    named.next_back().map(|at| (&text[..at], &text[at + 1..]))
}

/// Cells as the terminal counts them.
pub(crate) fn width(text: &str) -> usize {
    Span::raw(text).width()
}

/// The text with spaces behind it, as wide as its column.
pub(crate) fn padded(text: &str, columns: usize) -> String {
    format!("{text}{}", " ".repeat(columns.saturating_sub(width(text))))
}

/// The cells of a line, each with the number of spaces behind it.
fn cells(line: &str) -> Vec<(&str, usize)> {
    let mut cells = Vec::new();
    let mut rest = line;
    while let Some(at) = rest.find("  ") {
        let behind = &rest[at..];
        let next = behind.trim_start_matches(' ');
        cells.push((&rest[..at], behind.len() - next.len()));
        rest = next;
    }
    cells.push((rest, 0));
    cells
}

/// Where lines for people go.
#[derive(Debug)]
pub(crate) struct Lines<W> {
    out: W,
    /// Their language.
    pub(crate) wording: Wording,
}

impl Lines<io::StdoutLock<'static>> {
    /// Standard output, in the language of the locale.
    pub(crate) fn to_stdout() -> Self {
        Self::new(io::stdout().lock())
    }
}

impl<W: Write> Lines<W> {
    pub(crate) fn new(out: W) -> Self {
        Self { out, wording: Wording::of_locale() }
    }

    /// Another language than that of the locale.
    #[cfg(test)]
    pub(crate) fn in_language(out: W, lang: Lang) -> Self {
        Self { out, wording: Wording::new(lang) }
    }

    /// Writes one or more lines.
    ///
    /// # Errors
    /// The reader is gone, or the disk is full.
    pub(crate) fn try_say(&mut self, english: impl std::fmt::Display) -> io::Result<()> {
        writeln!(self.out, "{}", printable_lines(&self.wording.text(&english.to_string())))
    }

    /// Writes one or more lines. A reader that has seen enough is no error.
    pub(crate) fn say(&mut self, english: impl std::fmt::Display) {
        let _ = self.try_say(english);
    }

    /// Writes lines that are sentences and no rows of a table: their indent may belong to the sentence, and what stands in
    /// columns in them is quoted. A reader that has seen enough is no error.
    pub(crate) fn say_sentences(&mut self, english: impl std::fmt::Display) {
        let english = english.to_string();
        for line in english.strip_suffix('\n').unwrap_or(&english).split('\n') {
            let _ = writeln!(self.out, "{}", printable(&in_language(line, self.wording.lang)));
        }
    }

    /// Writes what is said of something: a run, a part of the records.
    pub(crate) fn say_of(&mut self, what: &str, english: impl std::fmt::Display) {
        let colon = if self.wording.lang == Lang::Zh { "：" } else { ": " };
        let said = self.wording.text(&english.to_string());
        let _ = writeln!(self.out, "{}", printable_lines(&format!("{what}{colon}{said}")));
    }

    /// Writes a sentence that is said of something with a name. A reader that has seen enough is no error.
    pub(crate) fn say_sentence_of(&mut self, name: &str, english: &str) {
        let colon = if self.wording.lang == Lang::Zh { "：" } else { ": " };
        let said = in_language(english, self.wording.lang);
        let _ = writeln!(self.out, "{}", printable(&format!("{name}{colon}{said}")));
    }

    /// Writes a line that is in the language already.
    ///
    /// # Errors
    /// As [`Lines::try_say`].
    pub(crate) fn say_as_it_is(&mut self, line: impl std::fmt::Display) -> io::Result<()> {
        writeln!(self.out, "{}", printable_lines(&line.to_string()))
    }

    /// Writes whole lines that are in the language already.
    ///
    /// # Errors
    /// As [`Lines::try_say`].
    pub(crate) fn write_as_it_is(&mut self, lines: &str) -> io::Result<()> {
        self.out.write_all(lines.as_bytes())
    }

    /// Writes what is left.
    ///
    /// # Errors
    /// As [`Lines::try_say`].
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

#[cfg(test)]
mod tests;
