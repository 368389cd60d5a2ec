//! The pattern of serial numbers, as a bench file or a plan writes it: `serial_number = "SN-[0-9]{4}"`.
//!
//! A serial number is printable ASCII. A pattern allows a sign beyond that by its name: the sign itself stands in the pattern, or
//! a range does whose ends stand there, `[А-Я]`. So signs that look like others (`С` and `C`) come in by no `.` or `\w`.

mod signs;

use std::fmt;
use std::sync::Arc;

use gnc_config::TomlTable;
use gnc_text::quoted;
use regex_lite::Regex;

/// Longest pattern; the longest serial number has 64 characters.
const PATTERN_CHARACTERS: usize = 256;

/// A regular expression that a whole serial number must match.
#[derive(Clone, Debug)]
pub struct SerialNumberPattern {
    /// As it is written.
    text: Arc<str>,
    /// Shared: bench and plan travel in messages, and stay small so.
    whole: Arc<Regex>,
    /// The signs that it names, and ranges of them.
    named: Arc<[(char, char)]>,
}

impl SerialNumberPattern {
    /// Reads a pattern.
    ///
    /// # Errors
    /// Why it is no regular expression.
    pub fn new(text: &str) -> Result<Self, String> {
        if text.chars().count() > PATTERN_CHARACTERS {
            return Err(format!("it has more than {PATTERN_CHARACTERS} characters"));
        }
        // Alone first: a bracket that is closed too early must not close that of the line below.
        Regex::new(text).map_err(|error| error.to_string())?;
        let signs = signs::read(text);
        let both_cases = Regex::new(&format!("^(?:{})$", signs.both_cases));
        // What the library reads otherwise, like brackets in a comment, counts as it is written.
        let whole = both_cases.or_else(|_| Regex::new(&format!("^(?:{text})$")));
        let whole = whole.map_err(|error| error.to_string())?;
        Ok(Self { text: text.into(), whole: Arc::new(whole), named: signs.named.into() })
    }

    /// Whether all of a serial number matches.
    #[must_use]
    pub fn fits(&self, serial_number: &str) -> bool {
        self.whole.is_match(serial_number)
    }

    /// Whether the pattern names this sign: the sign stands in it, by itself or by its number, or lies in a range of signs beyond ASCII
    /// whose ends stand in it. Where the flag `i` is on, both cases of a letter are named.
    #[must_use]
    pub fn names(&self, sign: char) -> bool {
        self.named.iter().any(|(first, last)| (*first..=*last).contains(&sign))
    }

    /// A sign of a serial number that is not printable ASCII and that no pattern names. A pattern that the number does not fit may
    /// mean other numbers: then the first sign beyond ASCII is not allowed, unless patterns name all signs of the number. So
    /// `None` does not say that the number fits.
    pub fn not_allowed<'a>(serial_number: &str, patterns: impl IntoIterator<Item = &'a Self>) -> Option<char> {
        let patterns: Vec<&Self> = patterns.into_iter().collect();
        let beyond = || serial_number.chars().filter(|sign| !matches!(sign, ' '..='~'));
        let unnamed = beyond().find(|sign| !patterns.iter().any(|pattern| pattern.names(*sign)))?;
        let fits = patterns.iter().all(|pattern| pattern.fits(serial_number));
        if fits { Some(unnamed) } else { beyond().next() }
    }
}

/// The text tells all that the pattern does.
impl PartialEq for SerialNumberPattern {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
    }
}

impl fmt::Display for SerialNumberPattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// Reads a pattern of a table, if it is there. `example` is one for the hint.
pub(crate) fn pattern(table: &TomlTable<'_, '_>, key: &'static str, example: &str) -> Option<SerialNumberPattern> {
    let (text, span) = table.text(key)?;
    match SerialNumberPattern::new(text) {
        Ok(pattern) => Some(pattern),
        Err(why) => {
            let hint = format!("write a regular expression, like \"{example}\"");
            table.mistake_at(span, format!("the pattern {} cannot be read: {why}", quoted(text)), hint);
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_of_a_number_must_match() {
        let fits = |pattern: &str, number: &str| SerialNumberPattern::new(pattern).expect("a pattern").fits(number);
        assert!(fits("SN-[0-9]{4}", "SN-0001"));
        for number in ["SN-001", "SN-00011", "xSN-0001", "SN-0001\n", "sn-0001", "SN-00०1", ""] {
            assert!(!fits("SN-[0-9]{4}", number), "{number:?}");
        }
        // Alternatives are held whole too.
        assert!(fits("A[0-9]|B[0-9]", "B1") && !fits("A[0-9]|B[0-9]", "A1x") && !fits("A[0-9]|B[0-9]", "xB1"));
        assert!(fits("БИНС-\\d+", "БИНС-12"));
        assert!(fits("(?i)бинс-[0-9]+", "БИНС-12") && fits("(?i)[а-яё]+", "ЁЖ") && fits("(?i)\\x{431}", "Б"));
        assert!(!fits("бинс-[0-9]+", "БИНС-12") && !fits("(?i:б)инс", "БИНС"));
    }

    #[test]
    fn a_sign_beyond_ascii_is_named() {
        let not_allowed = |pattern: &str, number: &str| {
            let pattern = SerialNumberPattern::new(pattern).expect("a pattern");
            SerialNumberPattern::not_allowed(number, [&pattern])
        };
        for (pattern, number) in [
            ("БИНС-\\d+", "БИНС-12"),
            ("[А-Я]{2}-1", "ЫТ-1"),
            ("№ ?[0-9]+", "№ 5"),
            (".*", "S N~!"),
            ("[模块]+", "模块"),
            ("(?i)бинс-[0-9]+", "БИНС-12"),
            ("(?i)[а-яё]{4}-[0-9]+", "ЁЖИК-12"),
            ("(?i:Б)инс-1", "бинс-1"),
            ("\\x{0411}-1", "Б-1"),
            ("\\u0411[\\x{0410}-\\x{042F}]-1", "БЯ-1"),
            // Too short, and yet no sign of it is wrong.
            ("БИНС-[0-9]{4}", "БИНС-123"),
        ] {
            assert_eq!(not_allowed(pattern, number), None, "{pattern} {number}");
        }
        for (pattern, number, sign) in [
            (".*", "SN-é", 'é'),
            ("\\w+", "SNО", 'О'),
            ("[^a]+", "a\u{202e}", '\u{202e}'),
            ("[ -\u{10ffff}]+", "S\u{200b}", '\u{200b}'),
            ("БИНС-\\d+", "БИНК-12", 'Б'),
            ("[А-Я]+", "Ю\u{301}", 'Ю'),
            ("(?i)s.+", "SЖ", 'Ж'),
            ("БИНС-[0-9]+", "бинс-12", 'б'),
            ("А-Я.", "А-ЯЖ", 'Ж'),
        ] {
            assert_eq!(not_allowed(pattern, number), Some(sign), "{pattern} {number}");
        }
        assert_eq!(SerialNumberPattern::not_allowed("SN-0001 x", []), None);
        for sign in ['\t', '\u{7f}', 'µ', '\u{a0}', '🙂', '\n'] {
            assert_eq!(SerialNumberPattern::not_allowed(&format!("SN{sign}1"), []), Some(sign));
        }
    }

    #[test]
    fn what_is_no_pattern() {
        for text in ["SN-[0-9", "SN-(1", "a)|(b", "*", "x{2,1}", "\\p{", &"x".repeat(257)] {
            assert!(SerialNumberPattern::new(text).is_err(), "{text}");
        }
    }
}
