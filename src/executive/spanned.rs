//! A walk over a parsed TOML file that notes every mistake of meaning with its place and goes on.
//!
//! serde's derive stops at the first mistake, and a plan with ten of them should be mended in one go.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::ops::Range;

use gnc_text::quoted;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::mistake::{Mistakes, Source, syntax_message};
use crate::quantity::{Dimension, Quantity, Unit};
use crate::suggest::nearest;

/// Bytes of a file that are marked at a mistake.
pub(crate) type Span = Range<usize>;

/// One file during its walk: where mistakes are noted.
pub(crate) struct Walk<'s> {
    source: &'s Source,
    mistakes: RefCell<Mistakes>,
}

impl<'s> Walk<'s> {
    /// Goes on with the mistakes of files that were read before.
    pub(crate) fn new(source: &'s Source, mistakes: Mistakes) -> Self {
        Self { source, mistakes: RefCell::new(mistakes) }
    }

    /// The mistakes so far.
    pub(crate) fn into_mistakes(self) -> Mistakes {
        self.mistakes.into_inner()
    }

    /// Notes a mistake at a place of this file.
    pub(crate) fn mistake(&self, span: Span, what: impl Into<String>, hint: impl Into<String>) {
        self.mistakes.borrow_mut().add(|| self.source.mistake(span, what, hint));
    }

    /// Notes that a value has the wrong type.
    fn wrong_type(&self, value: &Spanned<DeValue<'_>>, key: &str, wanted: &str) {
        let what = format!("{} is {}, and must be {wanted}", quoted(key), type_name(value.get_ref()));
        self.mistake(value.span(), what, "");
    }
}

/// Parses a file; a syntax error stands alone, since what follows it is guesswork.
pub(crate) fn parse(source: &Source) -> Result<DeTable<'_>, Mistakes> {
    DeTable::parse(&source.text).map(Spanned::into_inner).map_err(|error| {
        let (what, hint) = syntax(error.message());
        Mistakes::one(source.mistake(error.span().unwrap_or(0..0), what, hint))
    })
}

/// A message of the TOML parser in the words of somebody who writes plans.
fn syntax(message: &str) -> (String, &'static str) {
    let said = |text: &str| message.contains(text);
    if said("recursion") || said("recurse") {
        ("values lie too deep in each other".to_owned(), "at most 80 levels are read")
    } else if said("duplicate key") {
        ("this key stands twice".to_owned(), "remove one of them, or begin the next item with [[item]]")
    } else if said("invalid boolean") || said("must be quoted") {
        let what = "this is no text in quotes, no number, and neither true nor false";
        (what.to_owned(), "texts stand in quotes: name = \"functional\"")
    } else if said("basic string") || said("literal string") {
        (syntax_message(message), "a text ends with the quote that it began with, in the same line")
    } else {
        (syntax_message(message), "texts stand in quotes, a table begins with [name], a list item with [[name]]")
    }
}

/// A table whose keys are taken one by one; [`Table::finish`] refuses those that nobody took.
pub(crate) struct Table<'w, 't> {
    walk: &'w Walk<'w>,
    table: &'t DeTable<'t>,
    known: RefCell<BTreeSet<&'static str>>,
    /// The place of the table itself, for what is missing in it.
    span: Span,
}

/// A value with the key under which it stands.
#[derive(Clone, Copy)]
pub(crate) struct Entry<'t> {
    pub(crate) key: &'t str,
    pub(crate) key_span: (usize, usize),
    pub(crate) value: &'t Spanned<DeValue<'t>>,
}

impl<'w, 't> Table<'w, 't> {
    pub(crate) fn new(walk: &'w Walk<'w>, table: &'t DeTable<'t>, span: Span) -> Self {
        Self { walk, table, known: RefCell::default(), span }
    }

    /// The place of the table.
    pub(crate) fn span(&self) -> Span {
        self.span.clone()
    }

    /// The entry under a key; the key counts as known from now on.
    pub(crate) fn entry(&self, key: &'static str) -> Option<Entry<'t>> {
        self.known.borrow_mut().insert(key);
        let (name, value) = self.table.get_key_value(key)?;
        Some(Entry { key: name.get_ref(), key_span: (name.span().start, name.span().end), value })
    }

    /// Every entry, in the order of the file; all keys count as known.
    pub(crate) fn entries(&self) -> Vec<Entry<'t>> {
        entries(self.table)
    }

    /// A text.
    pub(crate) fn text(&self, key: &'static str) -> Option<(&'t str, Span)> {
        let entry = self.entry(key)?;
        let Some(text) = entry.value.get_ref().as_str() else {
            self.walk.wrong_type(entry.value, key, "a text in quotes");
            return None;
        };
        Some((text, entry.value.span()))
    }

    /// A text that must be there and must not be blank.
    pub(crate) fn required_text(&self, key: &'static str, hint: &str) -> Option<(&'t str, Span)> {
        if !self.has(key) {
            self.known.borrow_mut().insert(key);
            self.walk.mistake(self.span(), format!("{} is missing", quoted(key)), hint);
            return None;
        }
        let (text, span) = self.text(key)?;
        if text.trim().is_empty() {
            self.walk.mistake(span, format!("{} is empty", quoted(key)), hint);
            return None;
        }
        Some((text, span))
    }

    /// A truth value, or what stands for its absence.
    pub(crate) fn flag(&self, key: &'static str) -> bool {
        let Some(entry) = self.entry(key) else { return false };
        entry.value.get_ref().as_bool().unwrap_or_else(|| {
            self.walk.wrong_type(entry.value, key, "true or false");
            false
        })
    }

    /// A whole number within bounds, or what stands for its absence.
    pub(crate) fn integer(&self, key: &'static str, bounds: (i64, i64), absent: i64) -> i64 {
        self.entry(key).and_then(|entry| integer(self.walk, entry.value, key, bounds)).unwrap_or(absent)
    }

    /// A number with a unit of this dimension.
    pub(crate) fn quantity(&self, key: &'static str, dimension: Dimension) -> Option<(Quantity, Span)> {
        let entry = self.entry(key)?;
        quantity(self.walk, entry.value, key, dimension).map(|quantity| (quantity, entry.value.span()))
    }

    /// A list of texts with their places.
    pub(crate) fn texts(&self, key: &'static str) -> Vec<(&'t str, Span)> {
        let Some(entry) = self.entry(key) else { return Vec::new() };
        texts(self.walk, entry.value, key)
    }

    /// A table within this one.
    pub(crate) fn table(&self, key: &'static str) -> Option<Table<'w, 't>> {
        let entry = self.entry(key)?;
        let Some(table) = entry.value.get_ref().as_table() else {
            self.walk.wrong_type(entry.value, key, "a table");
            return None;
        };
        Some(Table::new(self.walk, table, entry.key_span.0..entry.key_span.1))
    }

    /// Whether there is a value under a key, whatever it is.
    pub(crate) fn has(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }

    /// A list of tables, written as `[[key]]`.
    pub(crate) fn tables(&self, key: &'static str) -> Vec<Table<'w, 't>> {
        let Some(entry) = self.entry(key) else { return Vec::new() };
        let Some(list) = entry.value.get_ref().as_array() else {
            let wanted = format!("a list of tables, each beginning with [[{key}]]");
            self.walk.wrong_type(entry.value, key, &wanted);
            return Vec::new();
        };
        let mut tables = Vec::with_capacity(list.len());
        for value in list {
            match value.get_ref().as_table() {
                Some(table) => tables.push(Table::new(self.walk, table, value.span())),
                None => self.walk.wrong_type(value, key, "a table"),
            }
        }
        tables
    }

    /// Refuses every key that nobody asked for.
    pub(crate) fn finish(self) {
        let known = self.known.into_inner();
        for entry in entries(self.table) {
            if !known.contains(entry.key) {
                let hint = match nearest(entry.key, known.iter().copied()) {
                    Some(key) => format!("did you mean \"{key}\"?"),
                    None => format!("the keys are {}", known.iter().copied().collect::<Vec<_>>().join(", ")),
                };
                self.walk.mistake(
                    entry.key_span.0..entry.key_span.1,
                    format!("unknown key {}", quoted(entry.key)),
                    hint,
                );
            }
        }
    }
}

/// The entries of a table in the order of the file; the parser keeps them sorted by name.
fn entries<'t>(table: &'t DeTable<'t>) -> Vec<Entry<'t>> {
    let mut entries: Vec<Entry<'t>> = table
        .iter()
        .map(|(key, value)| Entry { key: key.get_ref(), key_span: (key.span().start, key.span().end), value })
        .collect();
    entries.sort_by_key(|entry| entry.key_span);
    entries
}

/// A whole number within bounds.
pub(crate) fn integer(walk: &Walk<'_>, value: &Spanned<DeValue<'_>>, key: &str, (min, max): (i64, i64)) -> Option<i64> {
    let Some(written) = value.get_ref().as_integer() else {
        walk.wrong_type(value, key, "a whole number");
        return None;
    };
    match i64::from_str_radix(written.as_str(), written.radix()) {
        Ok(number) if (min..=max).contains(&number) => Some(number),
        _ => {
            let what = format!("{} is {}, and must be {min} to {max}", quoted(key), quoted(written.as_str()));
            walk.mistake(value.span(), what.replace('"', ""), "");
            None
        }
    }
}

/// A number with a unit of this dimension.
pub(crate) fn quantity(
    walk: &Walk<'_>,
    value: &Spanned<DeValue<'_>>,
    key: &str,
    dimension: Dimension,
) -> Option<Quantity> {
    let Some(text) = value.get_ref().as_str() else {
        let example = Quantity::new(1.0, dimension.usual_unit());
        walk.wrong_type(value, key, &format!("a number and its unit in quotes, such as \"{example}\""));
        return None;
    };
    match Quantity::parse(text) {
        Ok(quantity) if quantity.dimension() == dimension => Some(quantity),
        Ok(quantity) => {
            let what = if quantity.unit == Unit::Count {
                format!("{} has no unit", quoted(text))
            } else {
                format!(
                    "{} is {}, and {} is {}",
                    quoted(text),
                    quantity.dimension().with_article(),
                    quoted(key),
                    dimension.with_article()
                )
            };
            walk.mistake(value.span(), what, dimension.hint());
            None
        }
        Err(error) => {
            walk.mistake(value.span(), error.to_string(), error.hint(dimension));
            None
        }
    }
}

/// A list of texts with their places.
pub(crate) fn texts<'t>(walk: &Walk<'_>, value: &'t Spanned<DeValue<'t>>, key: &str) -> Vec<(&'t str, Span)> {
    let Some(list) = value.get_ref().as_array() else {
        walk.wrong_type(value, key, "a list of texts in brackets");
        return Vec::new();
    };
    let mut texts = Vec::with_capacity(list.len());
    for element in list {
        match element.get_ref().as_str() {
            Some(text) => texts.push((text, element.span())),
            None => walk.wrong_type(element, key, "a list of texts in quotes"),
        }
    }
    texts
}

/// A list of numbers with units of this dimension, with their places.
pub(crate) fn quantities(
    walk: &Walk<'_>,
    value: &Spanned<DeValue<'_>>,
    key: &str,
    dimension: Dimension,
) -> Vec<(Quantity, Span)> {
    let Some(list) = value.get_ref().as_array() else {
        let example = Quantity::new(1.0, dimension.usual_unit());
        walk.wrong_type(value, key, &format!("a list of numbers with their units, such as [\"{example}\"]"));
        return Vec::new();
    };
    let read = |element: &Spanned<DeValue<'_>>| {
        quantity(walk, element, key, dimension).map(|quantity| (quantity, element.span()))
    };
    list.iter().filter_map(read).collect()
}

/// A TOML type for people.
fn type_name(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a text",
        DeValue::Integer(_) => "a whole number",
        DeValue::Float(_) => "a number without unit",
        DeValue::Boolean(_) => "true or false",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => "a table",
    }
}
