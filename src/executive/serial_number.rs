//! The pattern of serial numbers, as a bench file or a plan writes it: `serial_number = "SN-[0-9]{4}"`.
//!
//! A serial number is printable ASCII. A pattern allows a sign beyond that by its name: the sign itself stands in the pattern, or
//! a range does whose ends stand there, `[А-Я]`. So signs that look like others (`С` and `C`) come in by no `.` or `\w`.

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
        let whole = Regex::new(&format!("^(?:{text})$")).map_err(|error| error.to_string())?;
        Ok(Self { text: text.into(), whole: Arc::new(whole) })
    }

    /// Whether all of a serial number matches.
    #[must_use]
    pub fn fits(&self, serial_number: &str) -> bool {
        self.whole.is_match(serial_number)
    }

    /// Whether the pattern names this sign: the sign stands in it, or lies in a range of signs beyond ASCII whose ends stand in it.
    #[must_use]
    pub fn names(&self, sign: char) -> bool {
        let signs: Vec<char> = self.text.chars().collect();
        let in_range =
            |range: &[char]| !range[0].is_ascii() && range[1] == '-' && (range[0]..=range[2]).contains(&sign);
        signs.contains(&sign) || signs.windows(3).any(in_range)
    }

    /// The first sign of a serial number that is not printable ASCII and that no pattern names. All patterns must fit the number, for
    /// else they say nothing of it.
    pub fn not_allowed<'a>(serial_number: &str, patterns: impl IntoIterator<Item = &'a Self>) -> Option<char> {
        let patterns: Vec<&Self> = patterns.into_iter().collect();
        let fit = patterns.iter().all(|pattern| pattern.fits(serial_number));
        let named = |sign: char| fit && patterns.iter().any(|pattern| pattern.names(sign));
        serial_number.chars().find(|sign| !matches!(sign, ' '..='~') && !named(*sign))
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
