//! The form of a sentence: its own words, and places for values between them.

use std::borrow::Cow;

use super::Tries;

/// Most tries to fit a text to one form. A text that needs more is none of the station's sentences.
const MOST_TRIES_OF_FORM: u32 = 2000;

/// What a place takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PlaceKind {
    /// Text that is the same in each language.
    Text,
    /// A number.
    Number,
    /// A sentence with translations of its own.
    Sentence,
    /// A person's own words: nothing in them is looked up.
    Own,
    /// A name that a person gave: nothing in it is looked up, and nothing in it joins two sentences.
    Name,
}

#[derive(Debug, Clone, PartialEq, Eq)]
struct Place {
    name: &'static str,
    kind: PlaceKind,
    /// The words behind it.
    then: &'static str,
}

/// A form.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Form {
    begin: &'static str,
    places: Vec<Place>,
}

impl Form {
    /// Reads a form. `None`: its braces do not fit.
    pub(super) fn read(text: &'static str) -> Option<Self> {
        let mut pieces = text.split('{');
        let begin = pieces.next()?;
        let place = |piece: &'static str| {
            let (name, then) = piece.split_once('}')?;
            let (name, kind) = match name.split_at_checked(name.len().checked_sub(1)?)? {
                (name, "#") => (name, PlaceKind::Number),
                (name, "*") => (name, PlaceKind::Sentence),
                (name, "!") => (name, PlaceKind::Own),
                (name, "@") => (name, PlaceKind::Name),
                _ => (name, PlaceKind::Text),
            };
            let is_name = !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'_');
            (is_name && !then.contains('}')).then_some(Place { name, kind, then })
        };
        let places = pieces.map(place).collect::<Option<Vec<_>>>()?;
        (!begin.contains('}')).then_some(Self { begin, places })
    }

    /// Names and kinds of its places, sorted, each once.
    #[cfg(test)]
    pub(super) fn places(&self) -> std::collections::BTreeMap<&'static str, PlaceKind> {
        self.places.iter().map(|place| (place.name, place.kind)).collect()
    }

    /// Bytes of its own words.
    pub(super) fn own_bytes(&self) -> usize {
        self.begin.len() + self.places.iter().map(|place| place.then.len()).sum::<usize>()
    }

    /// How much of a text the form tells: whether it begins with the indent of a line, which no sentence has; its own words; and
    /// among equals those at the beginning, since places at both ends take anything.
    pub(super) fn weight(&self) -> (bool, usize, usize) {
        (self.begin.starts_with("  "), self.own_bytes(), self.begin.len())
    }

    /// The word that each text of this form begins with; empty if a place may change it.
    pub(super) fn first_word(&self) -> &'static str {
        match self.begin.split_once(' ') {
            Some((word, _)) => word,
            None if self.places.is_empty() => self.begin,
            None => "",
        }
    }

    /// The values of its places in a text of this form. `None` also if no try is left.
    pub(super) fn values<'a>(&self, text: &'a str, tries: &mut Tries) -> Option<Vec<&'a str>> {
        if !tries.take() {
            return None;
        }
        count();
        let rest = text.strip_prefix(self.begin)?;
        let fits_at_end = self.places.last().map_or(rest.is_empty(), |place| rest.ends_with(place.then));
        if !fits_at_end {
            return None;
        }
        let mut values = Vec::with_capacity(self.places.len());
        let mut of_form = MOST_TRIES_OF_FORM;
        self.fits(rest, &mut values, &mut of_form, tries).then_some(values)
    }

    fn fits<'a>(&self, rest: &'a str, values: &mut Vec<&'a str>, of_form: &mut u32, tries: &mut Tries) -> bool {
        let Some(place) = self.places.get(values.len()) else { return rest.is_empty() };
        let is_last = values.len() + 1 == self.places.len();
        let ends: Box<dyn Iterator<Item = usize>> = match place.then {
            then if is_last => Box::new(rest.strip_suffix(then).map(str::len).into_iter()),
            // Two places without a word between them: nothing tells them apart.
            "" => return false,
            then => Box::new(rest.match_indices(then).map(|(at, _)| at)),
        };
        for end in ends {
            *of_form = of_form.saturating_sub(1);
            if *of_form == 0 || !tries.take() {
                return false;
            }
            count();
            let value = &rest[..end];
            if !takes(place.kind, value) || self.is_another_value(place.name, value, values) {
                continue;
            }
            values.push(value);
            if self.fits(&rest[end + place.then.len()..], values, of_form, tries) {
                return true;
            }
            values.pop();
        }
        false
    }

    /// Whether a place of the same name before took another value.
    fn is_another_value(&self, name: &str, value: &str, values: &[&str]) -> bool {
        self.places.iter().zip(values).any(|(place, before)| place.name == name && *before != value)
    }

    /// Whether a text among the values holds what joins two sentences.
    pub(super) fn takes_joint(&self, values: &[&str]) -> bool {
        self.places.iter().zip(values).any(|(place, value)| place.kind == PlaceKind::Text && has_joint(value))
    }

    /// The value of a place for a sentence with which the form begins.
    pub(super) fn sentence_at_begin<'a>(&self, values: &[&'a str]) -> Option<&'a str> {
        let place = self.places.first().filter(|place| self.begin.is_empty() && place.kind == PlaceKind::Sentence);
        place.and_then(|_| values.first().copied())
    }

    /// The value of a place, and its kind.
    pub(super) fn value<'a>(&self, name: &str, values: &[&'a str]) -> Option<(&'a str, PlaceKind)> {
        let index = self.places.iter().position(|place| place.name == name)?;
        Some((values.get(index)?, self.places[index].kind))
    }

    /// The form with its places filled in.
    pub(super) fn fill<'a>(&self, mut value: impl FnMut(&str) -> Option<Cow<'a, str>>) -> String {
        let mut out = self.begin.to_owned();
        for place in &self.places {
            out.push_str(&value(place.name).unwrap_or_default());
            out.push_str(place.then);
        }
        out
    }
}

fn has_joint(value: &str) -> bool {
    value.contains(": ") || value.contains("; ")
}

fn takes(kind: PlaceKind, value: &str) -> bool {
    let in_number = |byte: u8| byte.is_ascii_digit() || matches!(byte, b'.' | b'+' | b'-' | b'e' | b',');
    match kind {
        // A value is one line; what follows on the next is another sentence.
        PlaceKind::Text | PlaceKind::Own => !value.contains('\n'),
        PlaceKind::Name => !value.contains('\n') && !has_joint(value),
        // What stands behind a number, such as a comma, is no part of it.
        PlaceKind::Number => {
            value.bytes().all(in_number)
                && value.bytes().next_back().is_some_and(|byte| byte.is_ascii_digit())
                && !value.starts_with([',', 'e'])
        }
        PlaceKind::Sentence => !value.is_empty(),
    }
}

/// The first word of a text; the whole text if it is one word.
pub(super) fn first_word_of(text: &str) -> &str {
    text.split_once(' ').map_or(text, |(word, _)| word)
}

#[cfg(test)]
std::thread_local! {
    /// Forms and places tried in this thread, whatever the budget says.
    pub(super) static TRIED: std::cell::Cell<u64> = const { std::cell::Cell::new(0) };
}

/// Tests count each form and each place that is tried.
fn count() {
    #[cfg(test)]
    TRIED.set(TRIED.get() + 1);
}
