//! Quantities in files: texts such as "0.49 A" under a key. Each refusal has its place and a hint.

use gnc_config::{Span, TomlEntry, TomlTable};
use gnc_text::quoted;

use super::{Dimension, Quantity, Unit};

/// A number with a unit of this dimension.
pub(crate) fn quantity(entry: &TomlEntry<'_, '_>, dimension: Dimension) -> Option<Quantity> {
    let Some(text) = entry.value().as_str() else {
        let example = Quantity::new(1.0, dimension.usual_unit());
        entry.wrong_type(&format!("a number and its unit in quotes, such as \"{example}\""));
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
                    quoted(entry.key()),
                    dimension.with_article()
                )
            };
            entry.mistake(what, dimension.hint());
            None
        }
        Err(error) => {
            entry.mistake(error.to_string(), error.hint(dimension));
            None
        }
    }
}

/// A number with a unit of this dimension under a key of a table, with its place.
pub(crate) fn quantity_at(
    table: &TomlTable<'_, '_>,
    key: &'static str,
    dimension: Dimension,
) -> Option<(Quantity, Span)> {
    let entry = table.entry(key)?;
    Some((quantity(&entry, dimension)?, entry.span()))
}

/// A number with a unit of the dimension of `unit`; converted to `unit` it lies within the bounds.
pub(crate) fn bounded(entry: &TomlEntry<'_, '_>, unit: Unit, (min, max): (f64, f64)) -> Option<Quantity> {
    let written = quantity(entry, unit.dimension())?;
    if written.in_unit(unit).is_some_and(|number| (min..=max).contains(&number)) {
        return Some(written);
    }
    let hint = format!("it may be {} to {}", Quantity::new(min, unit), Quantity::new(max, unit));
    entry.mistake(format!("{} is {written}", entry.key()), hint);
    None
}

/// The number under a key of a table, converted to `unit`, in which it lies within the bounds.
pub(crate) fn bounded_at(table: &TomlTable<'_, '_>, key: &'static str, unit: Unit, bounds: (f64, f64)) -> Option<f64> {
    bounded(&table.entry(key)?, unit, bounds)?.in_unit(unit)
}
