//! Units that a file names. They are checked against the quantity of the method, converted if it needs one unit, and
//! never guessed.

use std::ops::Range;

use gnc_executive::quantity::{Dimension, Unit};

use super::TableError;
use super::columns::Columns;
use super::names::{is_count, unit};

/// What a file says about the unit of some columns.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::compute) enum Named {
    Nothing,
    /// Counts of a converter, or a word that is not a unit.
    Word(String),
    Unit(Unit),
}

impl Named {
    /// The unit in words.
    pub(in crate::compute) fn text(&self) -> Option<&str> {
        match self {
            Self::Nothing => None,
            Self::Word(word) => Some(word),
            Self::Unit(unit) => Some(unit.symbol()),
        }
    }
}

fn named(text: Option<&String>) -> Named {
    match text {
        None => Named::Nothing,
        Some(text) if is_count(text) => Named::Word("LSB".to_owned()),
        Some(text) => unit(text).map_or_else(|| Named::Word(text.clone()), Named::Unit),
    }
}

impl Columns {
    /// Returns the unit of some columns of numbers, after conversion of all to the unit of the first. Raw outputs
    /// (counts, voltages) fit every dimension. Refuses a unit of another dimension, and columns of which only some name
    /// a unit.
    pub(in crate::compute) fn unit(
        &mut self,
        columns: Range<usize>,
        dimension: Dimension,
    ) -> Result<Named, TableError> {
        let name = |k: usize| self.names.get(k).map_or("", String::as_str);
        let first = named(self.units[columns.start].as_ref());
        if let Named::Unit(unit) = &first
            && !fits(*unit, dimension)
        {
            let what = format!("column `{}` is in {unit}, but the method works with {dimension}", name(columns.start));
            return Err(TableError::Units { what });
        }
        for k in columns.clone().skip(1) {
            let other = named(self.units[k].as_ref());
            if other == first {
                continue;
            }
            let factor = match (&first, &other) {
                (Named::Unit(to), Named::Unit(from)) => from.convert(1.0, *to),
                _ => None,
            };
            let Some(factor) = factor else {
                let text = |named: &Named| named.text().unwrap_or("no unit").to_owned();
                let (a, b) = (text(&first), text(&other));
                let what = format!("column `{}` has {a}, column `{}` has {b}", name(columns.start), name(k));
                return Err(TableError::Units { what });
            };
            let note = format!("{} from {} to {}", name(k), text_of(&other), text_of(&first));
            self.about.understood.push(note);
            self.numbers[k].iter_mut().for_each(|v| *v *= factor);
            self.units[k] = self.units[columns.start].clone();
        }
        Ok(first)
    }

    /// Whether the unit in a file has this dimension.
    pub(in crate::compute) fn is_in(&self, text: Option<&String>, dimension: Dimension) -> bool {
        matches!(named(text), Named::Unit(unit) if unit.dimension() == dimension)
    }
}

fn text_of(named: &Named) -> &str {
    named.text().unwrap_or("no unit")
}

/// Whether a record of this kind of quantity may have a unit: one of its dimension, or that of a converter or an
/// amplifier.
fn fits(unit: Unit, dimension: Dimension) -> bool {
    unit.dimension() == dimension
        || matches!(unit.dimension(), Dimension::Voltage | Dimension::Current | Dimension::Count)
}
