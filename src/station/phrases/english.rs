//! What tests look for in texts of other languages: English that is left, and values that are lost.

use std::collections::BTreeMap;

use crate::locale::Lang;

/// The Latin words of a text that are not one letter.
pub(crate) fn latin(text: &str) -> impl Iterator<Item = &str> {
    let words = text.split(|c: char| !(c.is_ascii_alphanumeric() || "-_/.".contains(c)));
    let words = words.map(|word| word.trim_matches(['-', '_', '/', '.']));
    words.filter(|word| word.chars().filter(char::is_ascii_alphabetic).count() >= 2)
}

/// Where a command begins that a person is to type. It ends before a comma, a semicolon, or a word of the language.
const COMMANDS: [&str; 4] = ["sudo ", "echo 1 | ", "kill ", "gnc-station records "];

/// Bytes of the word at the beginning.
fn latin_letters(text: &str) -> usize {
    text.find(|c: char| !(c.is_ascii_lowercase() || c == '_')).unwrap_or(text.len())
}

/// The text without what is typed, quoted or written in a file: commands, texts in quotes, keys of a section.
fn without_quoted(text: &str) -> String {
    let (mut out, mut rest) = (String::new(), text);
    while let Some(c) = rest.chars().next() {
        let behind = &rest[c.len_utf8()..];
        let end = match c {
            '`' | '"' => behind.find(c).map(|at| c.len_utf8() + at + 1),
            // A section, and the key of it that stands behind.
            '[' => behind
                .find("] ")
                .map(|at| at + 3 + latin_letters(&behind[at + 2..]))
                .or(behind.find(']').map(|at| at + 2)),
            _ if COMMANDS.iter().any(|command| rest.starts_with(command)) => {
                Some(rest.find(|c: char| !c.is_ascii() || ";,".contains(c)).unwrap_or(rest.len()))
            }
            _ => None,
        };
        if end.is_none() {
            out.push(c);
        }
        rest = &rest[end.unwrap_or(c.len_utf8())..];
    }
    out
}

/// The numbers of a text, each with how often it stands there. Digits in a word, as of RS-422, count too.
fn numbers(text: &str) -> BTreeMap<String, usize> {
    let mut found = BTreeMap::new();
    // The power of a unit: m/s^2 is м/с² in Russian.
    for run in text.replace('²', "^2").split(|c: char| !(c.is_ascii_digit() || c == '.')) {
        let run = run.trim_matches('.');
        if !run.is_empty() {
            *found.entry(run.to_owned()).or_default() += 1;
        }
    }
    found
}

/// Checks that a text has no English word in another language but names, and as many lines and the same numbers as the
/// English one.
#[track_caller]
pub(crate) fn holds_none(english: &str, other: &str, lang: Lang, is_name: &dyn Fn(&str) -> bool) {
    let shown = without_quoted(other);
    let left: Vec<&str> = latin(&shown).filter(|word| !is_name(word)).collect();
    assert!(left.is_empty(), "{lang:?}: English is left: {left:?} in\n{other}");
    assert_eq!(english.lines().count(), other.lines().count(), "{lang:?}: lines of\n{english}\n{other}");
    for (english, other) in english.lines().zip(other.lines()) {
        assert_eq!(numbers(english), numbers(other), "{lang:?}: the numbers of\n{english}\n{other}");
    }
}
