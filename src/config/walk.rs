//! A walk over a parsed TOML file. It notes every mistake of meaning with its place and goes on.
//!
//! serde's derive stops at the first mistake, but the writer of a file with ten mistakes should be able to mend all in
//! one go.

use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::ops::Range;

use gnc_text::quoted;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::mistake::{Mistakes, SourceText, syntax_message};
use crate::suggest::did_you_mean;

/// Bytes of a file that are marked at a mistake.
pub type Span = Range<usize>;

/// The walk over one file; it notes the mistakes.
pub struct Walk<'s> {
    source: &'s SourceText,
    mistakes: RefCell<Mistakes>,
}

impl<'s> Walk<'s> {
    /// A walk that starts with the mistakes of files that were read before.
    pub fn new(source: &'s SourceText, mistakes: Mistakes) -> Self {
        Self { source, mistakes: RefCell::new(mistakes) }
    }

    /// The mistakes so far.
    pub fn into_mistakes(self) -> Mistakes {
        self.mistakes.into_inner()
    }

    /// Notes a mistake at a place of this file.
    pub fn mistake(&self, span: Span, what: impl Into<String>, hint: impl Into<String>) {
        self.mistakes.borrow_mut().add(|| self.source.mistake(span, what, hint));
    }
}

/// Reads a file that stands alone; `read` takes the keys of its top level.
///
/// # Errors
/// All mistakes of meaning, or the first syntax error alone.
pub fn read<T>(source: &SourceText, read: impl FnOnce(&TomlTable<'_, '_>) -> T) -> Result<T, Mistakes> {
    let tree = parse(source)?;
    let walk = Walk::new(source, Mistakes::default());
    let value = TomlTable::new(&walk, &tree, 0..0).read(read);
    walk.into_mistakes().or(value)
}

/// Parses a file.
///
/// # Errors
/// The first syntax error alone: what follows it is a guess.
pub fn parse(source: &SourceText) -> Result<DeTable<'_>, Mistakes> {
    DeTable::parse(&source.text).map(Spanned::into_inner).map_err(|error| {
        let (what, hint) = syntax(error.message());
        Mistakes::one(source.mistake(error.span().unwrap_or(0..0), what, hint))
    })
}

/// A message of the TOML parser in words for people who write such files.
fn syntax(message: &str) -> (String, &'static str) {
    let said = |text: &str| message.contains(text);
    if said("recursion") || said("recurse") {
        ("values are nested too deeply".to_owned(), "use at most 80 levels")
    } else if said("duplicate key") {
        ("this key appears twice".to_owned(), "remove one of them, or begin the next item with [[item]]")
    } else if said("invalid boolean") || said("must be quoted") {
        let what = "this is not a text in quotes, a number, true or false";
        (what.to_owned(), "write texts in quotes: name = \"functional\"")
    } else if said("basic string") || said("literal string") {
        (syntax_message(message), "end the text on the same line, with the quote that it begins with")
    } else {
        (syntax_message(message), "write texts in quotes; begin a table with [name], a list item with [[name]]")
    }
}

/// A table whose keys are taken one by one; [`TomlTable::finish`] refuses the keys that were not taken.
pub struct TomlTable<'w, 't> {
    walk: &'w Walk<'w>,
    table: &'t DeTable<'t>,
    known: RefCell<BTreeSet<Cow<'static, str>>>,
    /// Keys that were refused by name: their mistake is told, and no hint names them.
    refused: RefCell<BTreeSet<&'t str>>,
    /// The place of the table itself, for what is missing in it.
    span: Span,
}

impl<'w, 't> TomlTable<'w, 't> {
    /// The top level of a file, as [`parse`] returns it.
    pub fn new(walk: &'w Walk<'w>, table: &'t DeTable<'t>, span: Span) -> Self {
        Self { walk, table, known: RefCell::default(), refused: RefCell::default(), span }
    }

    /// The place of the table.
    pub fn span(&self) -> Span {
        self.span.clone()
    }

    /// Notes a mistake of the table as a whole.
    pub fn mistake(&self, what: impl Into<String>, hint: impl Into<String>) {
        self.walk.mistake(self.span(), what, hint);
    }

    /// Notes a mistake at a place within the table.
    pub fn mistake_at(&self, span: Span, what: impl Into<String>, hint: impl Into<String>) {
        self.walk.mistake(span, what, hint);
    }

    /// Whether there is a value under a key, of any type.
    pub fn has(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }

    /// The entry under a key; the key counts as known from now on.
    pub fn entry(&self, key: impl Into<Cow<'static, str>>) -> Option<TomlEntry<'w, 't>> {
        let key = key.into();
        let entry = self.table.get_key_value(&*key).map(|(name, value)| self.at(name, value));
        self.known.borrow_mut().insert(key);
        entry
    }

    /// The entry under a key that must be there.
    pub fn required(&self, key: &'static str, hint: &str) -> Option<TomlEntry<'w, 't>> {
        let entry = self.entry(key);
        if entry.is_none() {
            self.mistake(format!("{} is missing", quoted(key)), hint);
        }
        entry
    }

    /// Every entry, in the order of the file. The parser keeps entries sorted by name.
    pub fn entries(&self) -> Vec<TomlEntry<'w, 't>> {
        let mut entries: Vec<TomlEntry<'w, 't>> = self.table.iter().map(|(key, value)| self.at(key, value)).collect();
        entries.sort_by_key(|entry| entry.key_span);
        entries
    }

    fn at(&self, key: &'t Spanned<Cow<'t, str>>, value: &'t Spanned<DeValue<'t>>) -> TomlEntry<'w, 't> {
        let Range { start, end } = key.span();
        TomlEntry { walk: self.walk, key: key.get_ref(), key_span: (start, end), value }
    }

    /// A text.
    pub fn text(&self, key: &'static str) -> Option<(&'t str, Span)> {
        let entry = self.entry(key)?;
        Some((entry.text()?, entry.span()))
    }

    /// A text that must be there and must not be blank.
    pub fn required_text(&self, key: &'static str, hint: &str) -> Option<(&'t str, Span)> {
        let entry = self.required(key, hint)?;
        let text = entry.text()?;
        if text.trim().is_empty() {
            entry.mistake(format!("{} is empty", quoted(key)), hint);
            return None;
        }
        Some((text, entry.span()))
    }

    /// A text that must be there and may be empty.
    pub fn required_any_text(&self, key: &'static str, hint: &str) -> Option<(&'t str, Span)> {
        let entry = self.required(key, hint)?;
        Some((entry.text()?, entry.span()))
    }

    /// A truth value; false if the key is absent.
    pub fn flag(&self, key: &'static str) -> bool {
        self.entry(key).and_then(|entry| entry.flag()).unwrap_or(false)
    }

    /// A whole number within bounds; `absent` if the key is absent.
    pub fn integer(&self, key: &'static str, bounds: (i64, i64), absent: i64) -> i64 {
        self.entry(key).and_then(|entry| entry.integer(bounds)).unwrap_or(absent)
    }

    /// A number within bounds.
    pub fn number(&self, key: impl Into<Cow<'static, str>>, bounds: (f64, f64)) -> Option<f64> {
        self.entry(key)?.number(bounds)
    }

    /// A list of texts with their places.
    pub fn texts(&self, key: &'static str) -> Vec<(&'t str, Span)> {
        self.entry(key).map(|entry| entry.texts()).unwrap_or_default()
    }

    /// A table within this one.
    pub fn table(&self, key: impl Into<Cow<'static, str>>) -> Option<TomlTable<'w, 't>> {
        let entry = self.entry(key)?;
        Some(TomlTable { span: entry.key_span(), ..entry.table()? })
    }

    /// The result of `read` on a table within this one, if there is one. Keys that `read` does not take are refused.
    pub fn within<T>(
        &self,
        key: impl Into<Cow<'static, str>>,
        read: impl FnOnce(&TomlTable<'w, 't>) -> T,
    ) -> Option<T> {
        Some(self.table(key)?.read(read))
    }

    /// The elements of a list; empty if the key is absent. `wanted` says what the value must be if it is not a list.
    pub fn list(&self, key: &'static str, wanted: &str) -> Vec<TomlEntry<'w, 't>> {
        self.entry(key).and_then(|entry| entry.list(wanted)).unwrap_or_default()
    }

    /// A list of tables, written as `[[key]]`.
    pub fn tables(&self, key: &'static str) -> Vec<TomlTable<'w, 't>> {
        let wanted = format!("a list of tables, each beginning with [[{key}]]");
        self.list(key, &wanted).into_iter().filter_map(|element| element.table()).collect()
    }

    /// The result of `read` on this table. Keys that `read` does not take are refused.
    pub fn read<T>(self, read: impl FnOnce(&Self) -> T) -> T {
        let value = read(&self);
        self.finish();
        value
    }

    /// The entries that the reader has not asked for so far, in the order of the file.
    pub fn unknown(&self) -> Vec<TomlEntry<'w, 't>> {
        let (known, refused) = (self.known.borrow(), self.refused.borrow());
        let is_new = |key: &str| !known.contains(key) && !refused.contains(key);
        self.entries().into_iter().filter(|entry| is_new(entry.key)).collect()
    }

    /// Refuses the key of an entry that the reader did not ask for. The mistake gives this reason, not "unknown key".
    pub fn refuse(&self, entry: &TomlEntry<'w, 't>, what: impl Into<String>, hint: impl Into<String>) {
        entry.key_mistake(what, hint);
        self.refused.borrow_mut().insert(entry.key);
    }

    /// Refuses every key that the reader has not asked for.
    pub fn finish(self) {
        for entry in self.unknown() {
            let known = self.known.borrow();
            let keys = || known.iter().map(Cow::as_ref);
            let hint =
                did_you_mean(entry.key, keys(), || format!("the keys are {}", keys().collect::<Vec<_>>().join(", ")));
            entry.key_mistake(format!("unknown key {}", quoted(entry.key)), hint);
        }
    }
}

/// A value with the key under which it stands; an element of a list has the key of the list.
#[derive(Clone, Copy)]
pub struct TomlEntry<'w, 't> {
    walk: &'w Walk<'w>,
    key: &'t str,
    key_span: (usize, usize),
    value: &'t Spanned<DeValue<'t>>,
}

impl<'w, 't> TomlEntry<'w, 't> {
    /// The key.
    pub fn key(&self) -> &'t str {
        self.key
    }

    /// The place of the key.
    pub fn key_span(&self) -> Span {
        self.key_span.0..self.key_span.1
    }

    /// The value, unchecked.
    pub fn value(&self) -> &'t DeValue<'t> {
        self.value.get_ref()
    }

    /// The place of the value.
    pub fn span(&self) -> Span {
        self.value.span()
    }

    /// Notes a mistake of the value.
    pub fn mistake(&self, what: impl Into<String>, hint: impl Into<String>) {
        self.walk.mistake(self.span(), what, hint);
    }

    /// Notes a mistake of the key.
    pub fn key_mistake(&self, what: impl Into<String>, hint: impl Into<String>) {
        self.walk.mistake(self.key_span(), what, hint);
    }

    /// Notes that the value has the wrong type.
    pub fn wrong_type(&self, wanted: &str) {
        self.mistake(format!("{} is {}, and must be {wanted}", quoted(self.key), type_name(self.value())), "");
    }

    /// A text.
    pub fn text(&self) -> Option<&'t str> {
        let text = self.value().as_str();
        if text.is_none() {
            self.wrong_type("a text in quotes");
        }
        text
    }

    /// A truth value.
    pub fn flag(&self) -> Option<bool> {
        let flag = self.value().as_bool();
        if flag.is_none() {
            self.wrong_type("true or false");
        }
        flag
    }

    /// A whole number within bounds.
    pub fn integer(&self, (min, max): (i64, i64)) -> Option<i64> {
        let Some(written) = self.value().as_integer() else {
            self.wrong_type("a whole number");
            return None;
        };
        let number = i64::from_str_radix(written.as_str(), written.radix());
        number.ok().filter(|number| (min..=max).contains(number)).or_else(|| {
            self.out_of_range(written.as_str(), min, max);
            None
        })
    }

    /// A number within bounds. If a bound is infinite, an infinite value passes. NaN lies in no range.
    pub fn number(&self, (min, max): (f64, f64)) -> Option<f64> {
        let (written, number) = match self.value() {
            DeValue::Float(written) => (written.as_str(), written.as_str().parse().ok()),
            // Every whole number in a file has a nearest float.
            DeValue::Integer(written) => {
                let number = i64::from_str_radix(written.as_str(), written.radix());
                (written.as_str(), number.ok().map(|number| number as f64))
            }
            _ => {
                self.wrong_type("a number");
                return None;
            }
        };
        number.filter(|number| (min..=max).contains(number)).or_else(|| {
            self.out_of_range(written, min, max);
            None
        })
    }

    fn out_of_range(&self, written: &str, min: impl std::fmt::Display, max: impl std::fmt::Display) {
        let what = format!("{} is {}, and must be {min} to {max}", quoted(self.key), quoted(written));
        self.mistake(what.replace('"', ""), "");
    }

    /// The elements of a list; `wanted` says what the value must be if it is not a list.
    pub fn list(&self, wanted: &str) -> Option<Vec<TomlEntry<'w, 't>>> {
        let Some(list) = self.value().as_array() else {
            self.wrong_type(wanted);
            return None;
        };
        Some(list.iter().map(|value| TomlEntry { value, ..*self }).collect())
    }

    /// A list of exactly `N` elements; `wanted` says what the value must be otherwise.
    pub fn array<const N: usize>(&self, wanted: &str) -> Option<[TomlEntry<'w, 't>; N]> {
        let list = self.list(wanted)?;
        let many = list.len();
        let array = <[TomlEntry<'w, 't>; N]>::try_from(list).ok();
        if array.is_none() {
            self.mistake(format!("{} has {many} elements, and must be {wanted}", quoted(self.key)), "");
        }
        array
    }

    /// A list of texts with their places.
    pub fn texts(&self) -> Vec<(&'t str, Span)> {
        let mut texts = Vec::new();
        for element in self.list("a list of texts in brackets").unwrap_or_default() {
            match element.value().as_str() {
                Some(text) => texts.push((text, element.span())),
                None => element.wrong_type("a list of texts in quotes"),
            }
        }
        texts
    }

    /// A table.
    pub fn table(&self) -> Option<TomlTable<'w, 't>> {
        let Some(table) = self.value().as_table() else {
            self.wrong_type("a table");
            return None;
        };
        Some(TomlTable::new(self.walk, table, self.span()))
    }
}

/// The name of a TOML type, for people.
fn type_name(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a text",
        DeValue::Integer(_) => "a whole number",
        DeValue::Float(_) => "a decimal number",
        DeValue::Boolean(_) => "true or false",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => "a table",
    }
}
