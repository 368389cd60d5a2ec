//! A result as a table for people and as JSON for programs. Both come from one list of entries.

use std::borrow::Cow;
use std::fmt::Write as _;

use gnc_metrology::Refusal;
use gnc_text::printable;
use nalgebra::{SMatrix, Vector3};
use serde_json::{Map, Value, json};

use super::table::{Columns, RecordClock};
use crate::locale::Lang;
use crate::phrases::in_language;
use crate::wording::width as width_of;

/// Named figures in the order in which people read them.
pub(super) struct FigureReport {
    method: &'static str,
    entries: Vec<Entry>,
    /// Keys whose figure does not exist, with the reason.
    absent: Vec<(&'static str, String)>,
    /// Keys of the version before, which programs may still read, with the description of each.
    deprecated: Vec<(&'static str, Value, &'static str)>,
}

struct Entry {
    key: &'static str,
    unit: String,
    body: Body,
}

enum Body {
    Value(Value),
    Rows {
        columns: &'static [&'static str],
        rows: Vec<Vec<Value>>,
    },
    /// Named objects with equal keys: each row is a name, its unit, and the object or null.
    Named {
        columns: &'static [&'static str],
        rows: Vec<(&'static str, &'static str, Value)>,
    },
    /// For programs only.
    Hidden(Value),
    /// One line for people, of phrases behind each other, and an object for programs.
    Told(Vec<String>, Value),
}

impl FigureReport {
    pub(super) fn new(method: &'static str) -> Self {
        Self { method, entries: Vec::new(), absent: Vec::new(), deprecated: Vec::new() }
    }

    /// Adds a figure. The unit is for people; programs find it in the documentation.
    pub(super) fn put(&mut self, key: &'static str, unit: impl Into<String>, value: impl Into<Value>) -> &mut Self {
        self.entries.push(Entry { key, unit: unit.into(), body: Body::Value(value.into()) });
        self
    }

    /// Adds a figure that does not exist: `null` for programs, with the reason under `absent`.
    pub(super) fn absent(&mut self, key: &'static str, why: impl Into<String>) -> &mut Self {
        let why = why.into();
        self.put(key, why.clone(), Value::Null);
        self.absent.push((key, why));
        self
    }

    /// Keeps a key of the version before, or `key.of it`, for programs. `instead` says what it is and which key to read
    /// in its place. People do not see it.
    pub(super) fn deprecated(
        &mut self,
        key: &'static str,
        value: impl Into<Value>,
        instead: &'static str,
    ) -> &mut Self {
        self.deprecated.push((key, value.into(), instead));
        self
    }

    /// Adds facts about the record itself: what was understood of its form, its units and its clock.
    pub(super) fn record(&mut self, columns: &Columns) -> &mut Self {
        let understood = &columns.about.understood;
        let line = if understood.is_empty() { vec!["plain table".to_owned()] } else { understood.clone() };
        self.entries.push(Entry { key: "understood", unit: String::new(), body: Body::Told(line, json!(understood)) });
        let units: Vec<(&String, &String)> =
            columns.names.iter().zip(&columns.units).filter_map(|(name, unit)| Some((name, unit.as_ref()?))).collect();
        if !units.is_empty() {
            let line = units.iter().map(|(name, unit)| format!("{name} [{unit}]")).collect();
            let units = units.into_iter().map(|(name, unit)| (name.clone(), json!(unit))).collect::<Map<_, _>>();
            self.entries.push(Entry { key: "units", unit: String::new(), body: Body::Told(line, json!(units)) });
        }
        let (line, clock) = told(&columns.about.clock);
        self.entries.push(Entry { key: "clock", unit: String::new(), body: Body::Told(vec![line], clock) });
        self
    }

    /// Adds a list of rows with named columns.
    pub(super) fn rows(
        &mut self,
        key: &'static str,
        columns: &'static [&'static str],
        rows: Vec<Vec<Value>>,
    ) -> &mut Self {
        self.entries.push(Entry { key, unit: String::new(), body: Body::Rows { columns, rows } });
        self
    }

    /// Adds named objects with equal keys; the last column is that of their units.
    pub(super) fn named(
        &mut self,
        key: &'static str,
        columns: &'static [&'static str],
        rows: Vec<(&'static str, &'static str, Value)>,
    ) -> &mut Self {
        self.entries.push(Entry { key, unit: String::new(), body: Body::Named { columns, rows } });
        self
    }

    /// Adds an entry for programs only.
    pub(super) fn hidden(&mut self, key: &'static str, value: impl Into<Value>) -> &mut Self {
        self.entries.push(Entry { key, unit: String::new(), body: Body::Hidden(value.into()) });
        self
    }

    /// One JSON object.
    pub(super) fn json(&self) -> String {
        let mut object = Map::new();
        object.insert("method".to_owned(), json!(self.method));
        for entry in &self.entries {
            let value = match &entry.body {
                Body::Value(value) | Body::Hidden(value) | Body::Told(_, value) => value.clone(),
                Body::Named { rows, .. } => {
                    rows.iter().map(|(name, _, value)| ((*name).to_owned(), value.clone())).collect()
                }
                Body::Rows { columns, rows } => rows
                    .iter()
                    .map(|row| columns.iter().map(|c| (*c).to_owned()).zip(row.iter().cloned()).collect::<Map<_, _>>())
                    .collect(),
            };
            object.insert(entry.key.to_owned(), value);
        }
        if !self.absent.is_empty() {
            object.insert("absent".to_owned(), self.absent.iter().map(|(k, why)| (*k, why.as_str())).collect());
        }
        if !self.deprecated.is_empty() {
            object.insert("deprecated".to_owned(), self.deprecated.iter().map(|(k, _, why)| (*k, *why)).collect());
            for (key, value, _) in &self.deprecated {
                let (place, name) = match key.split_once('.') {
                    Some((outer, inner)) => (object.get_mut(outer).and_then(Value::as_object_mut), inner),
                    None => (Some(&mut object), *key),
                };
                if let Some(place) = place {
                    place.insert(name.to_owned(), value.clone());
                }
            }
        }
        let mut text = serde_json::to_string_pretty(&object).unwrap_or_default();
        text.push('\n');
        text
    }

    /// A table for people. Keys and names of columns are those of the object for programs, in every language.
    pub(super) fn table(&self, lang: Lang) -> String {
        let mut text = format!("{}\n", self.method);
        let width = self.entries.iter().map(|e| e.key.len()).max().unwrap_or(0);
        for entry in &self.entries {
            match &entry.body {
                Body::Value(value) => {
                    show(
                        &mut text,
                        entry.key,
                        &in_language(&printable(&entry.unit), lang),
                        value,
                        &Place { width, lang },
                    );
                }
                Body::Rows { columns, rows } => grid(&mut text, entry.key, columns, rows, lang),
                Body::Named { columns, rows } => {
                    let (figures, unit) = columns.split_at(columns.len().saturating_sub(1));
                    let unit: Vec<_> = unit.iter().map(|unit| in_language(unit, lang)).collect();
                    let heads = [""].into_iter().chain(figures.iter().copied()).chain(unit.iter().map(AsRef::as_ref));
                    let heads: Vec<&str> = heads.collect();
                    let cells = rows
                        .iter()
                        .map(|(name, unit, value)| {
                            let figures = figures.iter().map(|c| value.get(c).cloned().unwrap_or(Value::Null));
                            [json!(name)].into_iter().chain(figures).chain([json!(in_language(unit, lang))]).collect()
                        })
                        .collect::<Vec<Vec<Value>>>();
                    grid(&mut text, entry.key, &heads, &cells, lang);
                }
                Body::Told(line, _) => {
                    let line: Vec<_> = line.iter().map(|phrase| told_in(phrase, lang)).collect();
                    let _ = writeln!(text, "  {:<width$}  {}", entry.key, line.join(", "));
                }
                Body::Hidden(_) => {
                    let _ = writeln!(text, "  {:<width$}  {}", entry.key, in_language("with --json", lang));
                }
            }
        }
        text
    }
}

/// A phrase about the record. One that is little more than names of columns stands in the table behind a word of its own,
/// since its few words fit other sentences too.
fn told_in(phrase: &str, lang: Lang) -> String {
    let phrase = &*printable(phrase);
    match in_language(phrase, lang) {
        Cow::Owned(told) => told,
        Cow::Borrowed(_) => {
            let whole = format!("understood {phrase}");
            let told = in_language(&whole, lang);
            if *told == *whole { phrase.to_owned() } else { told.into_owned() }
        }
    }
}

/// The result of a clock check, in words and as an object.
fn told(clock: &RecordClock) -> (String, Value) {
    match clock {
        RecordClock::OnGrid => {
            let said = "checked, the board's times of all frames lie on the grid of the rate".to_owned();
            let object = json!({ "said": said, "checked": true, "column": "board time of the frames" });
            (said, object)
        }
        RecordClock::NotChecked(why) => {
            let said = format!("not checked: {why}");
            let object = json!({ "said": said, "checked": false, "reason": why });
            (said, object)
        }
        RecordClock::Checked { rate, column, tolerance } => {
            // 95 % interval of a normal distribution, with two digits.
            let expanded_hz = 1.96 * rate.rate_u_hz;
            let decimals = (1.0 - expanded_hz.max(1e-9).log10().floor()).clamp(0.0, 9.0) as usize;
            let mut said = format!("checked, {:.decimals$} Hz +- {expanded_hz:.decimals$}", rate.rate_hz);
            let digits = (1.0 - rate.jitter_s.max(1e-9).log10().floor()).clamp(0.0, 9.0) as usize;
            if rate.jitter_s > 0.01 / rate.rate_hz {
                let _ = write!(said, ", jitter {:.digits$} s", rate.jitter_s);
            }
            if rate.samples_per_stamp > 1.05 {
                let _ = write!(said, ", {:.2} samples per stamp", rate.samples_per_stamp);
            }
            if let Some(tolerance) = tolerance {
                let _ = write!(said, ", within {} ppm of the stated rate", (tolerance * 1e8).round() / 100.0);
            }
            let _ = write!(said, " (column {column})");
            let object = json!({
                "said": said,
                "checked": true,
                "column": column,
                "rate_hz": rate.rate_hz,
                "rate_u_hz": rate.rate_u_hz,
                "jitter_s": rate.jitter_s,
                "samples_per_stamp": rate.samples_per_stamp,
                "blocks": rate.blocks,
                "tolerance_ppm": tolerance.map(|t| t * 1e6),
            });
            (said, object)
        }
    }
}

/// JSON of a refusal.
pub(super) fn refusal_json(method: &str, refusal: &Refusal) -> String {
    let refused = json!({ "method": method, "refused": refusal.to_string(), "hint": refusal.hint() });
    format!("{refused:#}\n")
}

pub(super) fn vector(v: &Vector3<f64>) -> Value {
    json!([v[0], v[1], v[2]])
}

pub(super) fn matrix<const R: usize, const C: usize>(m: &SMatrix<f64, R, C>) -> Value {
    m.row_iter().map(|row| row.iter().map(|v| json!(v)).collect::<Value>()).collect()
}

/// Where a figure stands in the table for people.
#[derive(Clone, Copy)]
struct Place {
    /// Columns of the keys before it.
    width: usize,
    lang: Lang,
}

/// Writes a figure; its unit is in the language already.
fn show(text: &mut String, key: &str, unit: &str, value: &Value, place: &Place) {
    let Place { width, lang } = *place;
    match value {
        Value::Array(items) if items.iter().any(|i| matches!(i, Value::Array(_) | Value::Object(_))) => {
            for (i, item) in items.iter().enumerate() {
                show(text, if i == 0 { key } else { "" }, if i == 0 { unit } else { "" }, item, place);
            }
        }
        Value::Object(map) => {
            for (i, (name, item)) in map.iter().enumerate() {
                let item = &in_words(name, item, lang);
                let label = if i == 0 { key } else { "" };
                let unit = if i == 0 { unit } else { "" };
                let inner = Place { width: width + 15, lang };
                show(text, &format!("{label:<width$}  {:<13}", printable(name)), unit, item, &inner);
            }
        }
        // A list of texts is one of names.
        Value::String(said) => {
            let _ = writeln!(text, "  {key:<width$}  {}  {unit}", in_language(&printable(said), lang));
        }
        _ => {
            let _ = writeln!(text, "  {key:<width$}  {}  {unit}", plain(value, lang));
        }
    }
}

fn plain(value: &Value, lang: Lang) -> String {
    match value {
        Value::Null => format!("{:>13}", "-"),
        Value::String(s) => printable(s).into_owned(),
        Value::Number(n) if n.is_f64() => figure(n.as_f64().unwrap_or(f64::NAN)),
        Value::Array(items) if items.len() > 12 => in_language(&format!("{} values", items.len()), lang).into_owned(),
        Value::Array(items) => items.iter().map(|item| plain(item, lang)).collect::<Vec<_>>().join(" "),
        Value::Bool(is) => {
            let word = in_language(if *is { "true" } else { "false" }, lang);
            format!("{:1$}{word}", "", 13_usize.saturating_sub(width_of(&word)))
        }
        other => format!("{other:>13}"),
    }
}

/// Seven significant digits, aligned.
fn figure(v: f64) -> String {
    if v == 0.0 || (1e-3..1e6).contains(&v.abs()) {
        let whole = if v == 0.0 { 0 } else { v.abs().log10().floor() as i32 };
        let decimals = usize::try_from(6 - whole).unwrap_or(0).min(9);
        format!("{v:>13.decimals$}")
    } else {
        format!("{v:>13.6e}")
    }
}

/// Columns and lists whose texts are words of the station. The others hold names from the file.
const WORDS: [&str; 2] = ["noise", "terms"];

/// A list of words in the language.
fn in_words(name: &str, value: &Value, lang: Lang) -> Value {
    match value {
        Value::Array(words) if WORDS.contains(&name) => {
            words.iter().map(|word| word.as_str().map(|word| in_language(word, lang))).collect()
        }
        other => other.clone(),
    }
}

fn grid(text: &mut String, key: &str, columns: &[&str], rows: &[Vec<Value>], lang: Lang) {
    let cell = |(value, column): (&Value, &&str)| {
        let shown = plain(value, lang);
        let lang = if WORDS.contains(column) { lang } else { Lang::En };
        in_language(shown.trim(), lang).into_owned()
    };
    let cells: Vec<Vec<String>> = rows.iter().map(|row| row.iter().zip(columns).map(cell).collect()).collect();
    let widths: Vec<usize> = columns
        .iter()
        .enumerate()
        .map(|(c, name)| cells.iter().map(|row| width_of(&row[c])).chain([width_of(name)]).max().unwrap_or(0))
        .collect();
    let _ = writeln!(text, "  {key}");
    let mut line = |cells: &mut dyn Iterator<Item = &str>| {
        text.push_str("   ");
        for (cell, width) in cells.zip(&widths) {
            let _ = write!(text, " {:1$}{cell}", "", width.saturating_sub(width_of(cell)));
        }
        text.push('\n');
    };
    line(&mut columns.iter().copied());
    for row in &cells {
        line(&mut row.iter().map(String::as_str));
    }
}
