//! Text from outside, made safe to show.
//!
//! Serial numbers come from barcode readers, texts from boards and keys from plans: all of them may hold terminal
//! escapes, or characters that turn the reading direction around.

use std::borrow::Cow;
use std::fmt::Write as _;

/// Largest number of characters of foreign text in a message; more would hide what the message says.
const QUOTED_CHARACTERS: usize = 60;

/// The text with every control, direction and invisible character written as its escape.
///
/// Line breaks are escaped too, so that the result is always one line.
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.chars().any(is_unprintable) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match c {
            '\n' => out.push_str("\\n"),
            '\r' => out.push_str("\\r"),
            '\t' => out.push_str("\\t"),
            c if is_unprintable(c) => {
                // Writing to a String cannot fail.
                let _ = write!(out, "\\u{{{:x}}}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    Cow::Owned(out)
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
        Some((end, _)) => format!("{}…", printable(&text[..end])),
    }
}

fn is_unprintable(c: char) -> bool {
    c.is_control()
        || matches!(c,
            '\u{ad}' | '\u{61c}' | '\u{180e}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}')
}

#[cfg(test)]
mod tests {
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
}
