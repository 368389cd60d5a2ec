//! The sentences that the station makes, in the languages that are not its own.
//!
//! Code, records and logs hold one language, English: evidence has one wording, and a crate that calibrates sensors
//! knows no languages. Where a person reads, the screen looks a sentence up here. A table names each sentence by a
//! stable id, with its English form and its form in each other language; `{name}` is a place for a value:
//!
//! - `{name}`: text that is the same in each language, such as the name of a port;
//! - `{name#}`: a number;
//! - `{name*}`: another sentence of the table, such as the cause of an error;
//! - `{name!}`: a person's own words. Nothing in them is looked up, even if they read like a sentence of the table;
//! - `{name@}`: a name that a person gave, without what joins two sentences. Nothing in it is looked up either.
//!
//! A sentence that the table does not know stays English. So does one of a record that another version wrote. Text comes
//! from boards, files and people too, so each look-up has a budget: what is left when it is spent stays English.

#[cfg(test)]
pub(crate) mod english;
mod form;
mod page;
mod table;

use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::{LazyLock, Mutex};

use form::{Form, PlaceKind};
pub use page::page;
use table::all;

use crate::locale::Lang;

/// Most sentences in one text, one in another or behind another. An error has a handful of causes.
const MOST: u32 = 24;
/// Longest text that is looked up, in bytes. Sentences for people are far shorter.
pub(crate) const LONGEST: usize = 4096;
/// Most tries of forms for one text. Most of them look at the ends of the text alone; an error with its causes and its hint
/// needs some ten thousand.
const MOST_TRIES: u32 = 120_000;
/// Most joints of one text at which it is taken apart. An error with all its causes has a dozen.
const MOST_JOINTS: usize = 64;
/// Most bytes of texts that are kept with what they are in the language: some screens full of long ones.
const MOST_KEPT: usize = 1 << 20;

/// How many tries of forms are left for a text or a line.
#[derive(Debug)]
pub(crate) struct Tries(u32);

impl Tries {
    /// For this many texts.
    pub(crate) fn of_texts(texts: u32) -> Self {
        Self(MOST_TRIES.saturating_mul(texts))
    }

    /// Takes one. `false`: none is left.
    fn take(&mut self) -> bool {
        self.0 = self.0.saturating_sub(1);
        self.0 > 0
    }

    #[cfg(test)]
    pub(crate) fn left(&self) -> u64 {
        u64::from(self.0)
    }

    fn are_spent(&self) -> bool {
        self.0 == 0
    }
}

/// What one look-up may still cost.
#[derive(Debug)]
struct Budget<'t> {
    tries: &'t mut Tries,
    /// Sentences.
    left: u32,
    /// Pieces of the text by where they lie in memory, with what they are in the language: an end of the text is come to from
    /// each joint before it.
    pieces: HashMap<(usize, usize), Option<String>>,
}

/// The table, prepared for one language.
#[derive(Debug)]
pub(crate) struct Phrases {
    entries: Vec<Entry>,
    /// The entries whose English form begins with a whole word, by that word; and under "" all others.
    by_word: HashMap<&'static str, Vec<usize>>,
    lang: Lang,
    kept: Mutex<Kept>,
}

/// Texts that were looked up before: a screen draws the same ones many times.
#[derive(Debug, Default)]
struct Kept {
    /// `None`: nothing in it is a sentence of the table.
    texts: HashMap<String, Option<String>>,
    bytes: usize,
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

/// As [`in_language`], with tries that several texts share.
pub(crate) fn in_language_within<'a>(text: &'a str, lang: Lang, tries: &mut Tries) -> Cow<'a, str> {
    let phrases = match lang {
        Lang::En => return Cow::Borrowed(text),
        Lang::Zh => &ZH,
        Lang::Ru => &RU,
    };
    phrases.found(text, tries).map_or(Cow::Borrowed(text), Cow::Owned)
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
        Self { entries, by_word, lang, kept: Mutex::default() }
    }

    fn text<'a>(&self, text: &'a str) -> Cow<'a, str> {
        if text.len() > LONGEST {
            return Cow::Borrowed(text);
        }
        // While another thread uses the store, the text is looked up.
        let before = self.kept.try_lock().ok().and_then(|kept| kept.texts.get(text).cloned());
        let found = before.unwrap_or_else(|| {
            let found = self.found(text, &mut Tries::of_texts(1));
            if let Ok(mut kept) = self.kept.try_lock() {
                kept.keep(text, found.as_deref());
            }
            found
        });
        found.map_or(Cow::Borrowed(text), Cow::Owned)
    }

    /// `None`: nothing in it is a sentence of the table, or it is too long.
    fn found(&self, text: &str, tries: &mut Tries) -> Option<String> {
        if text.len() > LONGEST {
            return None;
        }
        self.translated(text, &mut Budget { tries, left: MOST, pieces: HashMap::new() })
    }

    /// `None`: nothing in it is a sentence of the table.
    fn translated(&self, text: &str, budget: &mut Budget<'_>) -> Option<String> {
        let place = (text.as_ptr().addr(), text.len());
        if let Some(before) = budget.pieces.get(&place) {
            return before.clone();
        }
        budget.left = budget.left.checked_sub(1)?;
        let told = self.translated_anew(text, budget);
        budget.pieces.insert(place, told.clone());
        told
    }

    fn translated_anew(&self, text: &str, budget: &mut Budget<'_>) -> Option<String> {
        let whole = self.whole(text, budget.tries);
        // A value at the end of a sentence could take in the cause behind it.
        let takes_more = whole.as_ref().is_some_and(|(entry, values)| {
            entry.english.takes_joint(values) || self.joins_more(entry, values, budget.tries)
        });
        let parts = if whole.is_none() || takes_more { self.in_parts(text, budget) } else { None };
        match (whole, parts) {
            (Some(_), Some(Parts { text, known: true, .. })) | (None, Some(Parts { text, .. })) => Some(text),
            // Words of its own tell more of what a text is than places that take anything.
            (Some((entry, _)), Some(Parts { text, first, .. })) if first > entry.english.own_bytes() => Some(text),
            (Some((entry, values)), _) => Some(self.filled(entry, &values, budget)),
            (None, None) => None,
        }
    }

    /// Whether the form begins with a place for a sentence, and more than one sentence stands in it: a form such as "A; then B"
    /// would take a part of the hint behind A for A.
    fn joins_more(&self, entry: &Entry, values: &[&str], tries: &mut Tries) -> bool {
        let first = entry.english.sentence_at_begin(values).filter(|first| first.contains("; "));
        first.is_some_and(|first| {
            self.whole(first, tries).is_none_or(|(entry, values)| entry.english.takes_joint(&values))
        })
    }

    /// The text as one sentence: of all that fit, the one with the most words of its own. `None` also if the tries are spent
    /// before all forms are tried: another one could fit better.
    fn whole<'a>(&self, text: &'a str, tries: &mut Tries) -> Option<(&Entry, Vec<&'a str>)> {
        let word = form::first_word_of(text);
        let candidates = [self.by_word.get(word), self.by_word.get("").filter(|_| !word.is_empty())];
        let mut best: Option<(&Entry, Vec<&'a str>)> = None;
        for index in candidates.into_iter().flatten().flatten() {
            let entry = &self.entries[*index];
            if let Some(values) = entry.english.values(text, tries)
                && best.as_ref().is_none_or(|(best, _)| entry.english.weight() >= best.english.weight())
            {
                best = Some((entry, values));
            }
            if tries.are_spent() {
                return None;
            }
        }
        best
    }

    fn filled(&self, entry: &Entry, values: &[&str], budget: &mut Budget<'_>) -> String {
        entry.other.fill(|name| {
            let (value, kind) = entry.english.value(name, values)?;
            let translated = (kind == PlaceKind::Sentence).then(|| self.translated(value, budget)).flatten();
            Some(translated.map_or(Cow::Borrowed(value), Cow::Owned))
        })
    }

    /// The text as sentences behind each other, joined by a sign.
    fn in_parts(&self, text: &str, budget: &mut Budget<'_>) -> Option<Parts> {
        let joints = JOINTS.iter().flat_map(|(sign, zh)| text.match_indices(sign).map(move |(at, _)| (at, *sign, *zh)));
        let mut places: Vec<_> = joints.collect();
        places.sort_unstable_by_key(|(at, ..)| *at);
        let mut lenient = None;
        for (at, sign, zh) in places.into_iter().take(MOST_JOINTS) {
            if budget.tries.are_spent() {
                break;
            }
            let (before, after) = (&text[..at], &text[at + sign.len()..]);
            let shown = if self.lang == Lang::Zh { zh } else { sign };
            let first = self.whole(before, budget.tries);
            let own_bytes = first.as_ref().map_or(0, |(entry, _)| entry.english.own_bytes());
            let first = first.map(|(entry, values)| self.filled(entry, &values, budget));
            // What stands before a colon is often a name.
            if first.is_none() && sign != ": " {
                continue;
            }
            let second = self.translated(after, budget);
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

impl Kept {
    fn keep(&mut self, text: &str, found: Option<&str>) {
        let bytes = text.len() + found.map_or(0, str::len);
        if self.bytes + bytes > MOST_KEPT {
            *self = Self::default();
        }
        self.bytes += bytes;
        self.texts.insert(text.to_owned(), found.map(str::to_owned));
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

/// The forms and places that are tried meanwhile, as the tries themselves count them.
#[cfg(test)]
pub(crate) fn tried_in(work: impl FnOnce()) -> u64 {
    form::TRIED.set(0);
    work();
    form::TRIED.get()
}

#[cfg(test)]
mod tests;
