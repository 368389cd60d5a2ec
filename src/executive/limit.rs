//! Limits: the grammar for plans, and the judgement of a value.
//!
//! ```text
//! <= Q      >= Q      Q .. Q      Q +- Q      Q +- N %      == text      == N (counts)      == $serial_number
//! ```
//! Q is a number with its unit. In `Q .. Q` and `Q +- Q` the first number may be without a unit and then has that of
//! the last one: `0 +- 2 deg/s`. Bounds belong to the limit: a value equal to a bound keeps it.

use std::fmt;

use gnc_text::{printable, quoted};

use crate::number;
use crate::outcome::Outcome;
use crate::quantity::{Dimension, Quantity, QuantityError, Unit, number_and_unit, with_unit};
use crate::serial_number::SerialNumberPattern;

/// The placeholder in a limit for the serial number that was scanned for this run.
pub(crate) const SERIAL_NUMBER: &str = "$serial_number";

/// The kind of a measurement. It decides which limits are possible.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeasurementKind {
    /// A number of this dimension.
    Number(Dimension),
    /// A text.
    Text,
}

/// A limit ready for judgement: numbers in one unit, or an expected text.
#[derive(Clone, Debug, PartialEq)]
pub enum Limit {
    /// A number within bounds.
    Range(Range),
    /// A text equal to another.
    Text(Expected),
    /// One of several texts; only questions have such a limit.
    OneOf(Vec<String>),
    /// A text that matches a pattern; only questions have such a limit.
    Matches(SerialNumberPattern),
}

/// Bounds of a number, all in `unit`. The bounds belong to the range, and at least one exists.
#[derive(Clone, Debug, PartialEq)]
pub struct Range {
    /// The unit in which values are compared, shown and recorded.
    pub unit: Unit,
    /// The lowest good value.
    pub low: Option<f64>,
    /// The highest good value.
    pub high: Option<f64>,
    /// A good value closer than this to a bound is marginal.
    pub marginal: Option<f64>,
}

/// The text that a measurement must equal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Expected {
    /// The text itself.
    Literal(String),
    /// The serial number that was scanned for this run.
    SerialNumber,
}

impl Expected {
    /// The text to compare with, given the scanned serial number.
    pub fn resolve<'a>(&'a self, serial_number: &'a str) -> &'a str {
        match self {
            Expected::Literal(text) => text,
            Expected::SerialNumber => serial_number,
        }
    }
}

impl Range {
    /// Judges a number that is already in the unit of the range; NaN and infinity are errored.
    pub(crate) fn judge(&self, number: f64) -> Outcome {
        if !number.is_finite() {
            return Outcome::Errored;
        }
        if self.low.is_some_and(|low| number < low) || self.high.is_some_and(|high| number > high) {
            return Outcome::Failed;
        }
        let near_low = self.marginal_low().is_some_and(|bound| number < bound);
        let near_high = self.marginal_high().is_some_and(|bound| number > bound);
        if near_low || near_high { Outcome::Marginal } else { Outcome::Passed }
    }

    /// Good values below this are marginal.
    pub(crate) fn marginal_low(&self) -> Option<f64> {
        Some(number::denoised(self.low? + self.marginal?))
    }

    /// Good values above this are marginal.
    pub(crate) fn marginal_high(&self) -> Option<f64> {
        Some(number::denoised(self.high? - self.marginal?))
    }
}

impl Limit {
    /// Reads a limit for a measurement of this kind.
    ///
    /// # Errors
    /// Everything that a plan can get wrong: see [`LimitError`].
    pub fn parse(text: &str, kind: MeasurementKind) -> Result<Limit, LimitError> {
        let text = text.trim();
        if let Some(expected) = text.strip_prefix("==") {
            return equal(expected.trim(), kind);
        }
        let MeasurementKind::Number(dimension) = kind else {
            return Err(LimitError::TextNeedsEqual { text: text.to_owned() });
        };
        let (unit, low, high) = if let Some(bound) = text.strip_prefix("<=") {
            let bound = quantity(bound, dimension)?;
            (bound.unit, None, Some(bound.number))
        } else if let Some(bound) = text.strip_prefix(">=") {
            let bound = quantity(bound, dimension)?;
            (bound.unit, Some(bound.number), None)
        } else if let Some((low, high)) = text.split_once("..") {
            let high = quantity(high, dimension)?;
            let low = quantity_before(low, high.unit, dimension)?;
            // The first of two units is shown. Both measure the same dimension, so the conversion exists.
            let top = high.in_unit(low.unit).unwrap_or(f64::NAN);
            (low.unit, Some(low.number), Some(top))
        } else if let Some((centre, tolerance)) = text.split_once("+-") {
            around(centre, tolerance, dimension)?
        } else {
            return Err(LimitError::NoOperator { text: text.to_owned() });
        };
        if let (Some(low), Some(high)) = (low, high)
            && low > high
        {
            return Err(LimitError::LowAboveHigh { low, high, unit });
        }
        Ok(Limit::Range(Range { unit, low, high, marginal: None }))
    }

    /// Adds a marginal band: values inside the limit, but closer than this to a bound.
    ///
    /// # Errors
    /// A text limit, a band of another dimension, a band that is not positive, or a band that makes every good value
    /// marginal.
    pub(crate) fn with_marginal(self, text: &str) -> Result<Limit, LimitError> {
        let Limit::Range(range) = self else { return Err(LimitError::MarginalOfText) };
        let band = quantity(text, range.unit.dimension())?;
        let width = band.in_unit(range.unit).unwrap_or(f64::NAN);
        if !(width > 0.0 && width.is_finite()) {
            return Err(LimitError::MarginalNotPositive { band });
        }
        let range = Range { marginal: Some(width), ..range };
        if let (Some(low), Some(high)) = (range.marginal_low(), range.marginal_high())
            && low > high
        {
            return Err(LimitError::MarginalTooWide { band });
        }
        Ok(Limit::Range(range))
    }

    /// The width of its marginal band, if it has one, for people of every language: "0.005 g".
    #[must_use]
    pub fn band(&self) -> Option<String> {
        let Limit::Range(Range { unit, marginal, .. }) = self else { return None };
        marginal.map(|width| with_unit(&number::exact(width), *unit))
    }
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Limit::Range(range) => f.write_str(&bounds(range.low, range.high, range.unit)),
            Limit::Text(expected) => write!(f, "== {}", printable(expected.resolve(SERIAL_NUMBER))),
            Limit::OneOf(texts) => f.write_str(&one_of(texts)),
            Limit::Matches(pattern) => f.write_str(&matches(&pattern.to_string())),
        }
    }
}

/// Good texts for people of every language: "== clean", "== clean | worn".
pub(crate) fn one_of(texts: &[String]) -> String {
    format!("== {}", printable(&texts.join(" | ")))
}

/// A pattern for people: "=~ GPS-[0-9]{5}".
pub(crate) fn matches(pattern: &str) -> String {
    format!("=~ {}", printable(pattern))
}

/// Bounds for people: ">= 4.75 V", "0.4655 .. 0.5145 A"; empty without bounds.
pub(crate) fn bounds(low: Option<f64>, high: Option<f64>, unit: Unit) -> String {
    match (low, high) {
        (None, None) => String::new(),
        (Some(low), None) => format!(">= {}", with_unit(&number::exact(low), unit)),
        (None, Some(high)) => format!("<= {}", with_unit(&number::exact(high), unit)),
        (Some(low), Some(high)) if low == high => format!("== {}", with_unit(&number::exact(low), unit)),
        (Some(low), Some(high)) => {
            format!("{} .. {}", number::exact(low), with_unit(&number::exact(high), unit))
        }
    }
}

/// Why a limit is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LimitError {
    /// The text has no form of the grammar.
    #[error("{} is not a limit", quoted(text))]
    NoOperator {
        /// The text.
        text: String,
    },
    /// A number in the text cannot be read.
    #[error("{source}")]
    Quantity {
        /// What is wrong with it.
        source: QuantityError,
        /// What the measurement measures.
        dimension: Dimension,
    },
    /// A number without a unit, although the measurement has one.
    #[error("{} has no unit", number::exact(*number))]
    MissingUnit {
        /// The number.
        number: f64,
        /// What the measurement measures.
        dimension: Dimension,
    },
    /// A unit of another dimension.
    #[error("{quantity} is {}, but this measurement is {}", quantity.dimension().with_article(), dimension.with_article())]
    WrongDimension {
        /// The quantity as written.
        quantity: Quantity,
        /// What the measurement measures.
        dimension: Dimension,
    },
    /// Bounds in the wrong order.
    #[error("the low bound {} is above the high bound {}", with_unit(&number::exact(*low), *unit), with_unit(&number::exact(*high), *unit))]
    LowAboveHigh {
        /// Low bound, in `unit`.
        low: f64,
        /// High bound, in `unit`.
        high: f64,
        /// Their unit.
        unit: Unit,
    },
    /// A tolerance below zero.
    #[error("the tolerance {tolerance} is below zero")]
    NegativeTolerance {
        /// The tolerance as written.
        tolerance: Quantity,
    },
    /// A percentage of zero.
    #[error("a tolerance in % of 0 leaves no room")]
    PercentOfZero,
    /// A percentage of a percentage.
    #[error("% after +- is ambiguous: it could mean a part of the value, or a value in %")]
    PercentOfRatio,
    /// A bound beyond the range of an `f64`.
    #[error("a bound is too large")]
    BoundTooLarge,
    /// A text measurement with a numerical limit.
    #[error("{} is a limit for numbers, but this measurement is a text", quoted(text))]
    TextNeedsEqual {
        /// The limit as written.
        text: String,
    },
    /// Equality of a measured number.
    #[error("a measured {dimension} never equals a number exactly")]
    EqualOfNumber {
        /// What the measurement measures.
        dimension: Dimension,
    },
    /// No text after `==`.
    #[error("there is no text after ==")]
    NothingExpected,
    /// An unknown `$name`.
    #[error("unknown placeholder {}", quoted(text))]
    UnknownPlaceholder {
        /// The placeholder as written.
        text: String,
    },
    /// A marginal band beside a text.
    #[error("a text has no marginal band")]
    MarginalOfText,
    /// A band of zero or less.
    #[error("the marginal band {band} is not above zero")]
    MarginalNotPositive {
        /// The band as written.
        band: Quantity,
    },
    /// A band that covers the whole limit.
    #[error("with a marginal band of {band} every good value would be marginal")]
    MarginalTooWide {
        /// The band as written.
        band: Quantity,
    },
}

impl LimitError {
    /// What the writer of the plan can try.
    pub(crate) fn hint(&self) -> String {
        match self {
            LimitError::NoOperator { .. } => {
                "a limit is one of: <= Q, >= Q, Q .. Q, Q +- Q, Q +- N %, == text".to_owned()
            }
            LimitError::Quantity { source, dimension } => source.hint(*dimension),
            LimitError::MissingUnit { dimension, .. } | LimitError::WrongDimension { dimension, .. } => {
                dimension.hint()
            }
            LimitError::LowAboveHigh { .. } => "write the smaller one first".to_owned(),
            LimitError::NegativeTolerance { .. } => {
                "a tolerance counts in both directions; write it positive".to_owned()
            }
            LimitError::PercentOfZero | LimitError::PercentOfRatio => {
                "write both bounds: \"-0.5 % .. 0.5 %\" for a ratio, \"-2 .. 2 deg/s\" for a rate".to_owned()
            }
            LimitError::BoundTooLarge => "the largest number is about 1.8e308".to_owned(),
            LimitError::TextNeedsEqual { .. } | LimitError::NothingExpected => {
                "write == and the text, or == $serial_number for the scanned one".to_owned()
            }
            LimitError::EqualOfNumber { .. } => "give it a tolerance: Q +- Q".to_owned(),
            LimitError::UnknownPlaceholder { .. } => format!("the only placeholder is {SERIAL_NUMBER}"),
            LimitError::MarginalOfText => "leave the marginal band out".to_owned(),
            LimitError::MarginalNotPositive { .. } => "leave the band out if no value is to be marginal".to_owned(),
            LimitError::MarginalTooWide { .. } => "make it less than half the width of the limit".to_owned(),
        }
    }
}

fn equal(text: &str, kind: MeasurementKind) -> Result<Limit, LimitError> {
    if text.is_empty() {
        return Err(LimitError::NothingExpected);
    }
    match kind {
        MeasurementKind::Text if text == SERIAL_NUMBER => Ok(Limit::Text(Expected::SerialNumber)),
        MeasurementKind::Text if text.starts_with('$') => Err(LimitError::UnknownPlaceholder { text: text.to_owned() }),
        MeasurementKind::Text => Ok(Limit::Text(Expected::Literal(text.to_owned()))),
        MeasurementKind::Number(Dimension::Count) => {
            let count = quantity(text, Dimension::Count)?;
            let bound = Some(count.number);
            Ok(Limit::Range(Range { unit: count.unit, low: bound, high: bound, marginal: None }))
        }
        MeasurementKind::Number(dimension) => Err(LimitError::EqualOfNumber { dimension }),
    }
}

/// Bounds around a centre. The tolerance is a quantity of the same dimension or a percentage of the centre.
fn around(centre: &str, tolerance: &str, dimension: Dimension) -> Result<(Unit, Option<f64>, Option<f64>), LimitError> {
    let tolerance = read(tolerance, dimension)?;
    let percent = tolerance.unit == Unit::Percent;
    if percent && dimension == Dimension::Ratio {
        return Err(LimitError::PercentOfRatio);
    }
    if tolerance.number < 0.0 {
        return Err(LimitError::NegativeTolerance { tolerance });
    }
    let (centre, reach) = if percent {
        let centre = quantity(centre, dimension)?;
        if centre.number == 0.0 {
            return Err(LimitError::PercentOfZero);
        }
        (centre, centre.number.abs() * tolerance.number / 100.0)
    } else {
        let tolerance = of_dimension(tolerance, dimension)?;
        let centre = quantity_before(centre, tolerance.unit, dimension)?;
        (centre, tolerance.in_unit(centre.unit).unwrap_or(f64::NAN))
    };
    let (low, high) = (number::denoised(centre.number - reach), number::denoised(centre.number + reach));
    if !(low.is_finite() && high.is_finite()) {
        return Err(LimitError::BoundTooLarge);
    }
    Ok((centre.unit, Some(low), Some(high)))
}

/// Reads the first of two numbers. Without a unit it has that of the second.
fn quantity_before(text: &str, unit: Unit, dimension: Dimension) -> Result<Quantity, LimitError> {
    match number_and_unit(text) {
        Ok((number, "")) => Ok(Quantity::new(number, unit)),
        _ => quantity(text, dimension),
    }
}

fn quantity(text: &str, dimension: Dimension) -> Result<Quantity, LimitError> {
    of_dimension(read(text, dimension)?, dimension)
}

fn read(text: &str, dimension: Dimension) -> Result<Quantity, LimitError> {
    Quantity::parse(text).map_err(|source| LimitError::Quantity { source, dimension })
}

fn of_dimension(quantity: Quantity, dimension: Dimension) -> Result<Quantity, LimitError> {
    if quantity.dimension() == dimension {
        Ok(quantity)
    } else if quantity.unit == Unit::Count {
        Err(LimitError::MissingUnit { number: quantity.number, dimension })
    } else {
        Err(LimitError::WrongDimension { quantity, dimension })
    }
}

#[cfg(test)]
mod tests;
