//! Units that a file names: checked against what the method is about, converted where it needs one, never guessed.

use std::ops::Range;

use gnc_executive::quantity::{Dimension, Unit};

use super::TableError;
use super::columns::Columns;
use super::names::{is_count, unit};

/// What a file says about the unit of some columns.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::compute) enum Named {
    Nothing,
    /// Counts of a converter, or a word that is no unit.
    Word(String),
    Unit(Unit),
}

impl Named {
    /// As people read it.
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
    /// The unit of some columns of numbers, after all were brought to that of the first. Raw outputs (counts, voltages)
    /// are of every kind; a unit of another kind than `dimension` is refused, as are columns of which only some name one.
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
            let what = format!("column `{}` is in {unit}, and the method is about {dimension}", name(columns.start));
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
                let what = format!("column `{}` has {a}, column `{}` {b}", name(columns.start), name(k));
                return Err(TableError::Units { what });
            };
            let note = format!("{} from {} to {}", name(k), text_of(&other), text_of(&first));
            self.about.understood.push(note);
            self.numbers[k].iter_mut().for_each(|v| *v *= factor);
            self.units[k] = self.units[columns.start].clone();
        }
        Ok(first)
    }

    /// Whether a unit that a file writes is one of these.
    pub(in crate::compute) fn is_in(&self, text: Option<&String>, dimension: Dimension) -> bool {
        matches!(named(text), Named::Unit(unit) if unit.dimension() == dimension)
    }
}

fn text_of(named: &Named) -> &str {
    named.text().unwrap_or("no unit")
}

/// Whether a record about this kind of quantity may be in a unit: in its own, or as the converter or the amplifier gave it.
fn fits(unit: Unit, dimension: Dimension) -> bool {
    unit.dimension() == dimension
        || matches!(unit.dimension(), Dimension::Voltage | Dimension::Current | Dimension::Count)
}
