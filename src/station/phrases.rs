//! The sentences that the station makes, in the languages that are not its own.
//!
//! Code, records and logs hold one language, English: evidence has one wording, and a crate that calibrates sensors
//! knows no languages. Where a person reads, the screen looks a sentence up here. A table names each sentence by a
//! stable id, with its English form and its form in each other language; `{name}` is a place for a value:
//!
//! - `{name}`: text that is the same in each language, such as the name of a port;
//! - `{name#}`: a number;
//! - `{name*}`: another sentence of the table, such as the cause of an error.
//!
//! A sentence that the table does not know stays English. So does one of a record that another version wrote.

#[cfg(test)]
pub(crate) mod english;
mod form;
mod page;
mod table;

use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::LazyLock;

use form::{Form, PlaceKind};
pub use page::page;
use table::all;

use crate::locale::Lang;

/// Most sentences in one text, one in another or behind another. An error has a handful of causes.
const MOST: u32 = 24;
/// Longest text that is looked up, in bytes. Sentences for people are far shorter.
const LONGEST: usize = 4096;

/// The table, prepared for one language.
#[derive(Debug)]
pub(crate) struct Phrases {
    entries: Vec<Entry>,
    /// The entries whose English form begins with a whole word, by that word; and under "" all others.
    by_word: HashMap<&'static str, Vec<usize>>,
    lang: Lang,
}

#[derive(Debug)]
struct Entry {
    english: Form,
    other: Form,
}

static ZH: LazyLock<Phrases> = LazyLock::new(|| Phrases::of(Lang::Zh));
static RU: LazyLock<Phrases> = LazyLock::new(|| Phrases::of(Lang::Ru));

/// A text of the station in a language, as far as the table knows its sentences.
pub(crate) fn in_language(text: &str, lang: Lang) -> Cow<'_, str> {
    match lang {
        Lang::En => Cow::Borrowed(text),
        Lang::Zh => ZH.text(text),
        Lang::Ru => RU.text(text),
    }
}

impl Phrases {
    fn of(lang: Lang) -> Self {
        let form = |text: &'static str| Form::read(text).unwrap_or_default();
        let mut by_word: HashMap<&'static str, Vec<usize>> = HashMap::new();
        let mut entries = Vec::new();
        for sentence in all() {
            let english = form(sentence.en);
            let other = form(if lang == Lang::Zh { sentence.zh } else { sentence.ru });
            by_word.entry(english.first_word()).or_default().push(entries.len());
            entries.push(Entry { english, other });
        }
        Self { entries, by_word, lang }
    }

    fn text<'a>(&self, text: &'a str) -> Cow<'a, str> {
        if text.len() > LONGEST {
            return Cow::Borrowed(text);
        }
        let mut left = MOST;
        self.translated(text, &mut left).map_or(Cow::Borrowed(text), Cow::Owned)
    }

    /// `None`: nothing in it is a sentence of the table.
    fn translated(&self, text: &str, left: &mut u32) -> Option<String> {
        *left = left.checked_sub(1)?;
        let whole = self.whole(text);
        // A value at the end of a sentence could take in the cause behind it.
        let takes_more = whole.as_ref().is_some_and(|(entry, values)| entry.english.takes_joint(values));
        let parts = if whole.is_none() || takes_more { self.in_parts(text, left) } else { None };
        match (whole, parts) {
            (Some(_), Some(Parts { text, known: true, .. })) | (None, Some(Parts { text, .. })) => Some(text),
            // Words of its own tell more of what a text is than places that take anything.
            (Some((entry, _)), Some(Parts { text, first, .. })) if first > entry.english.own_bytes() => Some(text),
            (Some((entry, values)), _) => Some(self.filled(entry, &values, left)),
            (None, None) => None,
        }
    }

    /// The text as one sentence: of all that fit, the one with the most words of its own.
    fn whole<'a>(&self, text: &'a str) -> Option<(&Entry, Vec<&'a str>)> {
        let word = form::first_word_of(text);
        let candidates = [self.by_word.get(word), self.by_word.get("").filter(|_| !word.is_empty())];
        let fitting = candidates.into_iter().flatten().flatten().filter_map(|index| {
            let entry = &self.entries[*index];
            entry.english.values(text).map(|values| (entry, values))
        });
        fitting.max_by_key(|(entry, _)| entry.english.own_bytes())
    }

    fn filled(&self, entry: &Entry, values: &[&str], left: &mut u32) -> String {
        entry.other.fill(|name| {
            let (value, kind) = entry.english.value(name, values)?;
            let translated = (kind == PlaceKind::Sentence).then(|| self.translated(value, left)).flatten();
            Some(translated.map_or(Cow::Borrowed(value), Cow::Owned))
        })
    }

    /// The text as sentences behind each other, joined by a sign.
    fn in_parts(&self, text: &str, left: &mut u32) -> Option<Parts> {
        let joints = JOINTS.iter().flat_map(|(sign, zh)| text.match_indices(sign).map(move |(at, _)| (at, *sign, *zh)));
        let mut places: Vec<_> = joints.collect();
        places.sort_unstable_by_key(|(at, ..)| *at);
        let mut lenient = None;
        for (at, sign, zh) in places {
            let (before, after) = (&text[..at], &text[at + sign.len()..]);
            let shown = if self.lang == Lang::Zh { zh } else { sign };
            let first = self.whole(before);
            let own_bytes = first.as_ref().map_or(0, |(entry, _)| entry.english.own_bytes());
            let first = first.map(|(entry, values)| self.filled(entry, &values, left));
            // What stands before a colon is often a name.
            if first.is_none() && sign != ": " {
                continue;
            }
            let second = self.translated(after, left);
            let known = second.is_some() && (first.is_some() || (sign == ": " && is_name_or_place(before)));
            // A comma is mostly one within a sentence.
            if first.is_none() && second.is_none() || sign == ", " && !known {
                continue;
            }
            let (first, second) = (first.as_deref().unwrap_or(before), second.as_deref().unwrap_or(after));
            let parts = Parts { text: format!("{first}{shown}{second}"), known, first: own_bytes };
            if known {
                return Some(parts);
            }
            lenient.get_or_insert(parts);
        }
        lenient
    }
}

/// A text in parts.
struct Parts {
    text: String,
    /// Whether the table knows the sentences on both sides of the joint.
    known: bool,
    /// Bytes of the first sentence's own words.
    first: usize,
}

/// Whether it is one word, such as a name, or a place in a file: "a plan.toml:16:9".
fn is_name_or_place(text: &str) -> bool {
    let is_number = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    let mut from_end = text.rsplit(':');
    let ends_with_place = from_end.next().is_some_and(is_number) && from_end.next().is_some_and(is_number);
    ends_with_place || !text.contains(' ')
}

/// What joins two sentences, and its Chinese form.
const JOINTS: [(&str, &str); 5] = [(": ", "："), ("; ", "；"), (". ", "。"), (", ", "，"), ("\n", "\n")];

#[cfg(test)]
mod tests;
