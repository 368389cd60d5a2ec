//! Text from outside, made safe to show.
//!
//! Serial numbers come from barcode readers, texts from boards, keys from plans, names from disks: all of them may hold
//! terminal escapes, characters that turn the reading direction around, and characters that no person sees.

use std::borrow::Cow;
use std::fmt::Write as _;

use unicode_width::UnicodeWidthChar as _;

use crate::joined::{Before, is_joiner};

/// Largest number of characters of foreign text in a message; more would hide what the message says.
const QUOTED_CHARACTERS: usize = 60;
/// Most marks over or under one letter. Languages need two or three; more of them grow into the lines above and below.
const MOST_MARKS: usize = 3;

/// The text with every control, direction and invisible character written as its escape.
///
/// Line breaks are escaped too, so that the result is always one line. A text that is printable already stays as it is. Joiners
/// stay where the writing of a name needs them, as in Persian, Hindi, Sinhala and emoji; [`crate::exact`] escapes these too.
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, false)
}

/// As [`printable`], but line feeds stay: for texts of several lines whose parts were escaped one by one.
#[must_use]
pub fn printable_lines(text: &str) -> Cow<'_, str> {
    escaped(text, true)
}

fn escaped(text: &str, keeps_lines: bool) -> Cow<'_, str> {
    let mut out: Option<String> = None;
    let (mut marks, mut before) = (Marks::default(), Before::default());
    let mut characters = text.char_indices().peekable();
    while let Some((at, c)) = characters.next() {
        let next = characters.peek().map(|(_, next)| *next);
        if before.needs(c, next, marks.has_place()) {
            before.pass(c);
        } else if marks.hides(c) {
            before = Before::default();
            if !(keeps_lines && c == '\n') {
                escape(out.get_or_insert_with(|| text[..at].to_owned()), c);
                continue;
            }
        } else {
            before.pass(c);
        }
        if let Some(out) = &mut out {
            out.push(c);
        }
    }
    out.map_or(Cow::Borrowed(text), Cow::Owned)
}

/// Writes the escape of a character.
pub(crate) fn escape(out: &mut String, c: char) {
    match c {
        '\n' => out.push_str("\\n"),
        '\r' => out.push_str("\\r"),
        '\t' => out.push_str("\\t"),
        c => {
            // Writing to a String cannot fail.
            let _ = write!(out, "\\u{{{:x}}}", u32::from(c));
        }
    }
}

/// The text in quotes for a message: printable and shortened.
#[must_use]
pub fn quoted(text: &str) -> String {
    format!("\"{}\"", shortened(text, QUOTED_CHARACTERS))
}

/// The printable text, cut with an ellipsis if it has more than `characters` characters.
#[must_use]
pub fn shortened(text: &str, characters: usize) -> String {
    match text.char_indices().nth(characters) {
        None => printable(text).into_owned(),
        Some((end, _)) => format!("{}…", printable(text[..end].trim_end_matches(is_joiner))),
    }
}

/// Counts the marks over one letter along a text.
#[derive(Debug, Default)]
pub(crate) struct Marks {
    over_letter: usize,
    after_letter: bool,
}

impl Marks {
    /// Whether one mark more may stand over the letter.
    pub(crate) fn has_place(&self) -> bool {
        self.after_letter && self.over_letter < MOST_MARKS
    }

    /// Whether the next character is to be escaped: it is hidden in any place, or a mark too many, or a mark without a letter
    /// of its own, which would sit on what stands before the text.
    pub(crate) fn hides(&mut self, c: char) -> bool {
        if is_hidden(c) {
            *self = Self::default();
            return true;
        }
        if c.width() == Some(0) {
            self.over_letter += 1;
            return !self.after_letter || self.over_letter > MOST_MARKS;
        }
        *self = Self { over_letter: 0, after_letter: true };
        false
    }
}

/// Whether a character does not show what it is: a control, a line or paragraph separator, a mark of direction, a character
/// that no person sees, or one for which each font has another picture or none.
///
/// Source: Unicode 16, general categories Cc, Cf, Co, Zl, Zp, property `Default_Ignorable_Code_Point`, and noncharacters.
#[must_use]
pub fn is_hidden(c: char) -> bool {
    c.is_control()
        || matches!(c,
            '\u{ad}' | '\u{34f}' | '\u{600}'..='\u{605}' | '\u{61c}' | '\u{6dd}' | '\u{70f}' | '\u{890}' | '\u{891}'
            | '\u{8e2}' | '\u{115f}' | '\u{1160}' | '\u{17b4}' | '\u{17b5}' | '\u{180b}'..='\u{180f}'
            | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{2800}' | '\u{3164}'
            | '\u{e000}'..='\u{f8ff}' | '\u{fdd0}'..='\u{fdef}' | '\u{fe00}'..='\u{fe0f}' | '\u{feff}' | '\u{ffa0}'
            | '\u{fff0}'..='\u{fffb}' | '\u{110bd}' | '\u{110cd}' | '\u{13430}'..='\u{1343f}'
            | '\u{1bca0}'..='\u{1bca3}' | '\u{1d173}'..='\u{1d17a}' | '\u{e0000}'..='\u{10ffff}')
        || u32::from(c) & 0xfffe == 0xfffe
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn escapes_never_reach_the_terminal() {
        assert_eq!(printable("DEMO-1"), "DEMO-1");
        assert_eq!(printable("a\u{1b}[31mred"), "a\\u{1b}[31mred");
        assert_eq!(printable("two\r\nlines\t"), "two\\r\\nlines\\t");
        assert_eq!(printable("\u{9b}31m"), "\\u{9b}31m");
        assert_eq!(printable("a\u{202e}b"), "a\\u{202e}b");
        assert_eq!(printable("µ模块"), "µ模块");
    }

    #[test]
    fn quotes_are_short() {
        assert_eq!(quoted("x"), "\"x\"");
        assert_eq!(quoted(&"x".repeat(10_000)).chars().count(), 63);
    }

    /// What must not reach a reader, as the Unicode charts name it.
    const HIDDEN: [(u32, u32); 19] = [
        (0x00, 0x1f),       // C0
        (0x7f, 0x9f),       // DEL, C1
        (0xad, 0xad),       // soft hyphen
        (0x34f, 0x34f),     // combining grapheme joiner
        (0x61c, 0x61c),     // Arabic letter mark
        (0x115f, 0x1160),   // Hangul fillers
        (0x180b, 0x180f),   // Mongolian selectors and vowel separator
        (0x200b, 0x200f),   // zero width space, joiners, direction marks
        (0x2028, 0x202e),   // line and paragraph separators, embeddings, overrides
        (0x2060, 0x206f),   // word joiner, invisible operators, isolates
        (0x3164, 0x3164),   // Hangul filler
        (0xe000, 0xf8ff),   // private use
        (0xfe00, 0xfe0f),   // variation selectors
        (0xfeff, 0xfeff),   // byte order mark
        (0xffa0, 0xffa0),   // half-width Hangul filler
        (0xfff0, 0xfffb),   // reserved, interlinear annotations
        (0xfffe, 0xffff),   // noncharacters
        (0xe0000, 0xe0fff), // tags, more variation selectors
        (0xf0000, 0x10ffff),
    ];

    #[test]
    fn no_hidden_character_is_left() {
        for c in HIDDEN.into_iter().flat_map(|(first, last)| first..=last).filter_map(char::from_u32) {
            let text = printable(&format!("a{c}b")).into_owned();
            assert!(text.is_ascii() && !text.contains(c), "U+{:04X} came through: {text:?}", u32::from(c));
        }
    }

    #[test]
    fn letters_of_all_languages_stay() {
        for text in [
            "БИНС-12 ёй",
            "模块、“一”",
            "é Å ñ",
            "e\u{301}",
            "Việt",
            "क्षि",
            "शक्\u{200c}ति",
            "क्\u{200d}षि",
            "علی\u{200c}رضا",
            "مُحَمَّدٌ",
            "ශ්\u{200d}රී ලංකා",
            "ที่นี่ น้ำ กำลัง",
            "Nguye\u{302}\u{303}n Việt",
            "שָׁלוֹם",
            "👩\u{200d}🔧 ❤\u{fe0f}",
            "שלום",
            "日本",
            "한국",
            "№ 5 °C ±3 µm … –",
            "🙂",
        ] {
            assert_eq!(printable(text), text);
        }
    }

    #[test]
    fn marks_do_not_grow_over_other_lines() {
        let flood = "a".to_owned() + &"\u{301}".repeat(40);
        let shown = printable(&flood);
        assert_eq!(shown.matches('\u{301}').count(), 3, "{shown}");
        // A mark without a letter would sit on the quote before it.
        assert_eq!(quoted("\u{301}a"), "\"\\u{301}a\"");
    }

    #[test]
    fn lines_stay_lines() {
        assert_eq!(printable_lines("a\nb\u{2028}c\r\n"), "a\nb\\u{2028}c\\r\n");
    }

    proptest! {
        #[test]
        fn any_text_becomes_one_line_that_shows_itself(text in any::<String>()) {
            let shown = printable(&text).into_owned();
            // A joiner that a name needs is no other hidden character, and never one of two.
            let hidden = |c: char| is_hidden(c) && !is_joiner(c);
            prop_assert!(!shown.chars().any(hidden) && !shown.starts_with(is_joiner), "{shown:?}");
            // What was made printable once stays.
            prop_assert_eq!(printable(&shown), shown.as_str());
            prop_assert_eq!(text.lines().map(printable).collect::<Vec<_>>().join("\n"), {
                let lines = text.lines().collect::<Vec<_>>().join("\n");
                printable_lines(&lines).into_owned()
            });
        }
    }
}
