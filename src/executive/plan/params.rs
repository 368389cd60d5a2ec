//! Parameters of an item: the plan's values, checked against the catalogue, and defaults for the others.

use std::collections::BTreeMap;

use gnc_config::{TomlEntry, TomlTable, Value, did_you_mean};
use gnc_text::quoted;

use crate::catalogue::{ItemId, ParamKind, When};
use crate::quantity::{Quantity, Unit, bounded};

/// Every parameter of an item.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Params(BTreeMap<&'static str, ParamValue>);

/// The value of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub enum ParamValue {
    /// A whole number.
    Integer(i64),
    /// Different whole numbers, at least one.
    Integers(Vec<i64>),
    /// A number with its unit, as written.
    Quantity(Quantity),
    /// One text of the catalogue's set.
    Choice(&'static str),
    /// Different texts of the catalogue's set, at least one.
    Choices(Vec<&'static str>),
    /// Name of the item whose captures are used; `None` for the item's own.
    Source(Option<String>),
}

/// A procedure asks for a parameter that its item does not have in this form. This is a mistake in the procedure.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the item has no parameter {name} that is {wanted}")]
pub struct ParamError {
    /// Name of the parameter.
    pub name: String,
    /// The form that was asked for.
    pub wanted: &'static str,
}

impl Params {
    /// The value of a parameter.
    pub(crate) fn get(&self, name: &str) -> Option<&ParamValue> {
        self.0.get(name)
    }

    /// A whole number.
    ///
    /// # Errors
    /// The catalogue has no such parameter for the item.
    pub fn integer(&self, name: &str) -> Result<i64, ParamError> {
        match self.get(name) {
            Some(ParamValue::Integer(value)) => Ok(*value),
            _ => Err(missing(name, "a whole number")),
        }
    }

    /// A list of whole numbers.
    ///
    /// # Errors
    /// The catalogue has no such parameter for the item.
    pub fn integers(&self, name: &str) -> Result<&[i64], ParamError> {
        match self.get(name) {
            Some(ParamValue::Integers(values)) => Ok(values),
            _ => Err(missing(name, "a list of whole numbers")),
        }
    }

    /// A number in the unit that the procedure works with.
    ///
    /// # Errors
    /// The catalogue has no such parameter for the item, or it has another dimension.
    pub fn quantity(&self, name: &str, unit: Unit) -> Result<f64, ParamError> {
        match self.get(name) {
            Some(ParamValue::Quantity(value)) => value.in_unit(unit).ok_or_else(|| missing(name, unit.symbol())),
            _ => Err(missing(name, unit.symbol())),
        }
    }

    /// One text of a set.
    ///
    /// # Errors
    /// The catalogue has no such parameter for the item.
    pub fn choice(&self, name: &str) -> Result<&'static str, ParamError> {
        match self.get(name) {
            Some(ParamValue::Choice(value)) => Ok(value),
            _ => Err(missing(name, "a text")),
        }
    }

    /// A list of texts of a set.
    ///
    /// # Errors
    /// The catalogue has no such parameter for the item.
    pub fn choices(&self, name: &str) -> Result<&[&'static str], ParamError> {
        match self.get(name) {
            Some(ParamValue::Choices(values)) => Ok(values),
            _ => Err(missing(name, "a list of texts")),
        }
    }

    /// Name of the item whose captures are used; `None` if the item captures by itself.
    ///
    /// # Errors
    /// The catalogue has no such parameter for the item.
    pub fn source(&self, name: &str) -> Result<Option<&str>, ParamError> {
        match self.get(name) {
            Some(ParamValue::Source(value)) => Ok(value.as_deref()),
            _ => Err(missing(name, "the name of an item")),
        }
    }

    /// Whether a measurement comes with these parameters.
    pub fn switch_on(&self, when: Option<When>) -> bool {
        match when {
            None => true,
            Some(When::HasInteger { param, element }) => {
                self.integers(param).is_ok_and(|values| values.contains(&element))
            }
            Some(When::HasText { param, element }) => self.choices(param).is_ok_and(|values| values.contains(&element)),
        }
    }
}

/// Reads the parameters of an item. A wrong one gets its default, so that the walk can go on.
pub(super) fn read(table: Option<&TomlTable<'_, '_>>, id: ItemId) -> Params {
    let spec = id.spec();
    let mut params: BTreeMap<&'static str, ParamValue> =
        spec.params.iter().map(|param| (param.name, default(&param.kind))).collect();
    for entry in table.into_iter().flat_map(TomlTable::entries) {
        let Some(param) = spec.param(entry.key()) else {
            let names: Vec<&str> = spec.params.iter().map(|param| param.name).collect();
            let hint = did_you_mean(entry.key(), names.iter().copied(), || match names.is_empty() {
                true => "it has no parameters".to_owned(),
                false => format!("its parameters are {}", names.join(", ")),
            });
            let what = format!("{id} has no parameter {}", quoted(entry.key()));
            entry.key_mistake(what, hint);
            continue;
        };
        if let Some(value) = value(&entry, param.name, &param.kind) {
            params.insert(param.name, value);
        }
    }
    Params(params)
}

fn default(kind: &ParamKind) -> ParamValue {
    match *kind {
        ParamKind::Integer { default, .. } => ParamValue::Integer(default),
        ParamKind::Integers { default, .. } => ParamValue::Integers(default.to_vec()),
        ParamKind::Quantity { unit, default, .. } => ParamValue::Quantity(Quantity::new(default, unit)),
        ParamKind::Choice { default, .. } => ParamValue::Choice(default),
        ParamKind::Choices { default, .. } => ParamValue::Choices(default.to_vec()),
        ParamKind::Source { .. } => ParamValue::Source(None),
    }
}

fn value(entry: &TomlEntry<'_, '_>, name: &'static str, kind: &ParamKind) -> Option<ParamValue> {
    match *kind {
        ParamKind::Integer { min, max, .. } => entry.integer((min, max)).map(ParamValue::Integer),
        ParamKind::Integers { min, max, .. } => integers(entry, (min, max)).map(ParamValue::Integers),
        ParamKind::Quantity { unit, min, max, .. } => bounded(entry, unit, (min, max)).map(ParamValue::Quantity),
        ParamKind::Choice { of, .. } => {
            let text = entry.value().as_str().unwrap_or_default();
            let choice = of.iter().find(|choice| **choice == text);
            if choice.is_none() {
                entry.mistake(format!("{name} cannot be {}", written(entry)), choices_hint(text, of));
            }
            choice.map(|choice| ParamValue::Choice(choice))
        }
        ParamKind::Choices { of, .. } => {
            let mut chosen: Vec<&'static str> = Vec::new();
            for element in entry.list("a list of texts in brackets").unwrap_or_default() {
                let Some(text) = element.text() else { continue };
                match of.iter().find(|choice| **choice == text) {
                    Some(choice) if chosen.contains(choice) => {
                        element.mistake(format!("{} appears twice in {name}", quoted(text)), "");
                    }
                    Some(choice) => chosen.push(choice),
                    None => element.mistake(format!("{name} cannot hold {}", quoted(text)), choices_hint(text, of)),
                }
            }
            if entry.value().as_array().is_some_and(|list| list.is_empty()) {
                entry.mistake(format!("{name} is empty"), choices_hint("", of));
            }
            (!chosen.is_empty()).then_some(ParamValue::Choices(chosen))
        }
        // A later step checks whether such an item stands before this one, when all items are read.
        ParamKind::Source { of } => {
            let text = entry.value().as_str();
            if text.is_none() {
                let ids = of.iter().map(|id| id.as_str()).collect::<Vec<_>>().join(" or ");
                let hint = format!("write the name of an item before this one that is {ids}");
                entry.mistake(format!("{name} cannot be {}", written(entry)), hint);
            }
            text.map(|text| ParamValue::Source(Some(text.to_owned())))
        }
    }
}

fn integers(entry: &TomlEntry<'_, '_>, bounds: (i64, i64)) -> Option<Vec<i64>> {
    let name = entry.key();
    if entry.value().as_array().is_none_or(|list| list.is_empty()) {
        let hint = format!("write a list of whole numbers from {} to {}", bounds.0, bounds.1);
        entry.mistake(format!("{name} cannot be {}", written(entry)), hint);
        return None;
    }
    let mut numbers = Vec::new();
    for element in entry.list("a list of whole numbers")? {
        let number = element.integer(bounds)?;
        if numbers.contains(&number) {
            element.mistake(format!("{number} appears twice in {name}"), "");
        } else {
            numbers.push(number);
        }
    }
    Some(numbers)
}

/// A value in the form for a message.
fn written(entry: &TomlEntry<'_, '_>) -> String {
    match entry.value() {
        Value::String(text) => quoted(text),
        Value::Integer(number) => number.as_str().to_owned(),
        Value::Array(list) if list.is_empty() => "an empty list".to_owned(),
        Value::Array(_) => "a list".to_owned(),
        Value::Table(_) => "a table".to_owned(),
        Value::Boolean(flag) => flag.to_string(),
        Value::Float(_) => "a number without unit".to_owned(),
        Value::Datetime(_) => "a date".to_owned(),
    }
}

fn choices_hint(text: &str, of: &[&'static str]) -> String {
    did_you_mean(text, of.iter().copied(), || {
        format!("it may be {}", of.iter().map(|choice| format!("\"{choice}\"")).collect::<Vec<_>>().join(", "))
    })
}

fn missing(name: &str, wanted: &'static str) -> ParamError {
    ParamError { name: name.to_owned(), wanted }
}
