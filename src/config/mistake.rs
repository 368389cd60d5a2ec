//! Mistakes in a text file, shown the way compilers show theirs.

use std::fmt;
use std::ops::Range;

use gnc_text::{printable, quoted, shortened};

/// Mistakes that are kept. A file with more is not a file of ours, and people do not read further.
pub const MAX_MISTAKES: usize = 50;

/// Characters of a source line that are shown around a mistake: a terminal's width.
const SHOWN_CHARACTERS: usize = 100;

/// One mistake, with its place and what the writer can try.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// Where it is; `None` if it has no place in a file.
    pub place: Option<SourcePosition>,
    /// What is wrong: lower case, with its data.
    pub what: String,
    /// What the writer can try; may be empty.
    pub hint: String,
}

/// A place in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourcePosition {
    /// Name of the file.
    pub file: String,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// The line, printable, cut to what a terminal shows.
    pub text: String,
    /// First marked character of `text`, from 0.
    pub mark: usize,
    /// Number of marked characters, at least 1.
    pub marked: usize,
}

impl Mistake {
    /// A mistake without a place in a file.
    pub fn nowhere(what: impl Into<String>, hint: impl Into<String>) -> Self {
        Self { place: None, what: what.into(), hint: hint.into() }
    }
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(place) = &self.place else {
            f.write_str(&self.what)?;
            return if self.hint.is_empty() { Ok(()) } else { write!(f, "\n  try: {}", self.hint) };
        };
        let number = place.line.to_string();
        let gutter = " ".repeat(number.len());
        writeln!(f, "{}:{}:{}: {}", printable(&place.file), place.line, place.column, self.what)?;
        writeln!(f, " {number} | {}", place.text)?;
        write!(f, " {gutter} | {}{}", " ".repeat(place.mark), "^".repeat(place.marked))?;
        if self.hint.is_empty() { Ok(()) } else { write!(f, "\n {gutter} = try: {}", self.hint) }
    }
}

/// All mistakes of a file and what it includes, in the order of reading; at least one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Mistakes {
    kept: Vec<Mistake>,
    dropped: usize,
}

impl Mistakes {
    /// The mistakes, at most [`MAX_MISTAKES`].
    pub fn iter(&self) -> impl Iterator<Item = &Mistake> {
        self.kept.iter()
    }

    /// Returns the number of mistakes, those beyond [`MAX_MISTAKES`] included.
    pub fn count(&self) -> usize {
        self.kept.len() + self.dropped
    }

    /// The one mistake.
    pub fn one(mistake: Mistake) -> Self {
        Self { kept: vec![mistake], dropped: 0 }
    }

    /// Adds a mistake. It is only made if there is room, since finding its place reads the file again.
    pub fn add(&mut self, mistake: impl FnOnce() -> Mistake) {
        if self.kept.len() < MAX_MISTAKES {
            self.kept.push(mistake());
        } else {
            self.dropped += 1;
        }
    }

    /// The value, or the mistakes if there are any, sorted by place within each file.
    ///
    /// # Errors
    /// The mistakes.
    pub fn or<T>(mut self, value: T) -> Result<T, Mistakes> {
        if self.kept.is_empty() {
            return Ok(value);
        }
        // Files stay in the order of reading: the sort is stable and compares only places of one file.
        let mut files: Vec<String> = Vec::new();
        for place in self.kept.iter().filter_map(|mistake| mistake.place.as_ref()) {
            if !files.contains(&place.file) {
                files.push(place.file.clone());
            }
        }
        self.kept.sort_by_key(|mistake| {
            mistake.place.as_ref().map_or((usize::MAX, 0, 0), |place| {
                (files.iter().position(|file| *file == place.file).unwrap_or(0), place.line, place.column)
            })
        });
        Err(self)
    }
}

impl fmt::Display for Mistakes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, mistake) in self.kept.iter().enumerate() {
            if index > 0 {
                f.write_str("\n\n")?;
            }
            write!(f, "{mistake}")?;
        }
        if self.dropped > 0 {
            write!(f, "\n\nand {} more", self.dropped)?;
        }
        Ok(())
    }
}

impl std::error::Error for Mistakes {}

/// A text file that was read. It gives mistakes their places.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceText {
    /// The name that the user gave, or that an include made from it.
    pub name: String,
    /// The text as read.
    pub text: String,
}

impl SourceText {
    /// Takes bytes as a text of at most `max_bytes`.
    ///
    /// # Errors
    /// Too many bytes, or bytes that are not UTF-8.
    pub fn new(name: &str, bytes: Vec<u8>, max_bytes: usize) -> Result<Self, Mistakes> {
        if bytes.len() > max_bytes {
            let what = format!("{} has more than {max_bytes} bytes", quoted(name));
            return Err(Mistakes::one(Mistake::nowhere(what, "is this the right file?")));
        }
        match String::from_utf8(bytes) {
            Ok(text) => Ok(Self { name: name.to_owned(), text }),
            Err(error) => {
                let at = error.utf8_error().valid_up_to();
                let text = String::from_utf8_lossy(error.as_bytes()).into_owned();
                let source = Self { name: name.to_owned(), text };
                let byte = error.as_bytes().get(at).copied().unwrap_or_default();
                let what = format!("byte 0x{byte:02x} is not UTF-8");
                Err(Mistakes::one(source.mistake(at..at + 1, what, "save the file with the encoding UTF-8")))
            }
        }
    }

    /// A mistake at a range of bytes.
    pub fn mistake(&self, span: Range<usize>, what: impl Into<String>, hint: impl Into<String>) -> Mistake {
        Mistake { place: Some(self.place(span)), what: what.into(), hint: hint.into() }
    }

    /// The place of a range of bytes. A range over several lines is marked to the end of its first line.
    pub fn place(&self, span: Range<usize>) -> SourcePosition {
        let start = floor(&self.text, span.start);
        let before = &self.text[..start];
        let line = before.bytes().filter(|byte| *byte == b'\n').count() + 1;
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        let line_end = self.text[start..].find('\n').map_or(self.text.len(), |at| start + at);
        let column = self.text[line_start..start].chars().count();
        let end = floor(&self.text, span.end).clamp(start, line_end);
        let marked = self.text[start..end].chars().count().max(1);
        // A long line is shown from a little before the mistake; every character takes one place, so the mark fits.
        let skipped = if column < SHOWN_CHARACTERS * 3 / 4 { 0 } else { column - SHOWN_CHARACTERS / 4 };
        let text: String = self.text[line_start..line_end]
            .trim_end_matches('\r')
            .chars()
            .skip(skipped)
            .take(SHOWN_CHARACTERS)
            .map(|c| if gnc_text::is_hidden(c) { ' ' } else { c })
            .collect();
        // A mistake at a line end or beyond the shown part is marked at the end of the shown text.
        let shown = text.chars().count();
        let mark = (column - skipped).min(shown);
        let marked = marked.min(shown - mark).max(1);
        SourcePosition { file: self.name.clone(), line, column: column + 1, text, mark, marked }
    }
}

/// The nearest character boundary at or before a byte.
fn floor(text: &str, at: usize) -> usize {
    let at = at.min(text.len());
    (0..=at).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0)
}

/// A message of the TOML parser, printable and short.
pub(crate) fn syntax_message(message: &str) -> String {
    shortened(message.lines().next().unwrap_or("the text cannot be read"), 200)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Found by fuzzing: carriage returns before a mistake moved the mark beyond the line, one character for each.
    #[test]
    fn a_mark_stays_at_its_line() {
        let source = SourceText::new("plan.toml", b"a = 1\r\r\r".to_vec(), 100).unwrap();
        let place = source.place(8..8);
        assert_eq!((place.text.as_str(), place.column, place.mark, place.marked), ("a = 1", 9, 5, 1));
    }
}
