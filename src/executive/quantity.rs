//! Numbers with units, as a plan writes them and a procedure measures them.
//!
//! A quantity stays in its given unit and is converted once, at the comparison. Scales are exact ratios of integers. So
//! 1 g is 1000 mg and 500 us is 0.5 ms without an error in the last place, and a value equal to its limit stays equal.

mod spelling;
mod unit;
mod written;

use std::fmt;

use gnc_config::nearest;
use gnc_text::quoted;

use crate::number;

pub use unit::Unit;
pub(crate) use written::{bounded, bounded_at, quantity_at};

/// The kind of a quantity. Only numbers of one dimension can be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Dimension {
    /// A plain number without unit: pieces, errors, dilution of precision.
    Count,
    /// A part of a whole, in % or ppm.
    Ratio,
    /// Time; SI unit s.
    Time,
    /// Frequency; SI unit Hz.
    Frequency,
    /// Voltage; SI unit V.
    Voltage,
    /// Current; SI unit A.
    Current,
    /// Length; SI unit m.
    Length,
    /// Speed; SI unit m/s.
    Speed,
    /// Angle; SI unit rad.
    Angle,
    /// Angular rate; SI unit rad/s.
    AngularRate,
    /// Acceleration; SI unit m/s^2.
    Acceleration,
    /// Magnetic flux density; SI unit T.
    MagneticField,
    /// Temperature, kept in degC, since benches do not use kelvin.
    Temperature,
    /// Rate of a link; bit/s.
    BitRate,
    /// Amount of data; bytes.
    Data,
    /// Angular rate per unit of specific force; SI unit (rad/s)/(m/s^2).
    GSensitivity,
    /// Angle random walk, also the noise density of a rate; SI unit rad/sqrt(s).
    AngleRandomWalk,
    /// Velocity random walk, also the noise density of an acceleration; SI unit (m/s)/sqrt(s).
    VelocityRandomWalk,
}

impl Dimension {
    /// The name for people: "angular rate".
    pub(crate) fn as_str(self) -> &'static str {
        match self {
            Dimension::Count => "plain number",
            Dimension::Ratio => "ratio",
            Dimension::Time => "time",
            Dimension::Frequency => "frequency",
            Dimension::Voltage => "voltage",
            Dimension::Current => "current",
            Dimension::Length => "length",
            Dimension::Speed => "speed",
            Dimension::Angle => "angle",
            Dimension::AngularRate => "angular rate",
            Dimension::Acceleration => "acceleration",
            Dimension::MagneticField => "magnetic field",
            Dimension::Temperature => "temperature",
            Dimension::BitRate => "bit rate",
            Dimension::Data => "amount of data",
            Dimension::GSensitivity => "g-sensitivity",
            Dimension::AngleRandomWalk => "angle random walk",
            Dimension::VelocityRandomWalk => "velocity random walk",
        }
    }

    /// The units of this dimension, in the order of [`Unit::ALL`].
    pub(crate) fn units(self) -> impl Iterator<Item = Unit> {
        Unit::ALL.into_iter().filter(move |unit| unit.dimension() == self)
    }

    /// A hint that names the units of this dimension.
    pub(crate) fn hint(self) -> String {
        if self == Dimension::Count {
            return "write a plain number without a unit".to_owned();
        }
        let symbols: Vec<&str> = self.units().map(Unit::symbol).collect();
        format!("{} is written in {}", self.with_article(), symbols.join(", "))
    }

    /// Its name with the article.
    pub(crate) fn with_article(self) -> String {
        let name = self.as_str();
        let article = if name.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" };
        format!("{article} {name}")
    }

    /// The most usual unit, for examples.
    pub(crate) fn usual_unit(self) -> Unit {
        match self {
            Dimension::Count => Unit::Count,
            Dimension::Ratio => Unit::Percent,
            Dimension::Time => Unit::Second,
            Dimension::Frequency => Unit::Hertz,
            Dimension::Voltage => Unit::Volt,
            Dimension::Current => Unit::Ampere,
            Dimension::Length => Unit::Metre,
            Dimension::Speed => Unit::MetrePerSecond,
            Dimension::Angle => Unit::Degree,
            Dimension::AngularRate => Unit::DegreePerSecond,
            Dimension::Acceleration => Unit::Gravity,
            Dimension::MagneticField => Unit::Gauss,
            Dimension::Temperature => Unit::DegreeCelsius,
            Dimension::BitRate => Unit::BitPerSecond,
            Dimension::Data => Unit::Byte,
            Dimension::GSensitivity => Unit::DegreePerHourPerGravity,
            Dimension::AngleRandomWalk => Unit::DegreePerRootHour,
            Dimension::VelocityRandomWalk => Unit::MetrePerSecondPerRootHour,
        }
    }

    /// Significant digits for people. An angle may be a latitude, where 9 digits are a centimetre.
    pub(crate) fn digits(self) -> usize {
        if self == Dimension::Angle { 9 } else { 6 }
    }
}

impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

/// A number with its unit. The number may be any `f64`: measurements may give NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity {
    /// The number, in `unit`.
    pub number: f64,
    /// Its unit.
    pub unit: Unit,
}

impl Quantity {
    /// A number in a unit.
    pub(crate) const fn new(number: f64, unit: Unit) -> Self {
        Self { number, unit }
    }

    /// Reads "2 mg", "0.49 A", "20 °/h", "5 %" or "12" (a count). The unit may have any spelling of [`Unit::parse`].
    /// The space is optional, and the result is finite.
    ///
    /// # Errors
    /// No number, a number beyond the range of an `f64`, or a unit that is not in the table.
    pub fn parse(text: &str) -> Result<Self, QuantityError> {
        let (number, unit) = number_and_unit(text)?;
        match Unit::parse(unit) {
            Some(unit) => Ok(Self { number, unit }),
            None => Err(QuantityError::UnknownUnit { unit: unit.to_owned() }),
        }
    }

    /// The number in another unit; `None` if that unit measures another dimension.
    pub fn in_unit(self, unit: Unit) -> Option<f64> {
        self.unit.convert(self.number, unit)
    }

    /// The number in the SI unit of its dimension (degC for temperatures).
    pub(crate) fn si(self) -> f64 {
        self.unit.si(self.number)
    }

    /// The dimension of the unit.
    pub fn dimension(self) -> Dimension {
        self.unit.dimension()
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&with_unit(&number::plain(self.number, self.dimension().digits()), self.unit))
    }
}

/// Why a text is not a quantity.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum QuantityError {
    /// It does not begin with a number.
    #[error("{} does not begin with a number", quoted(text))]
    NotANumber {
        /// The text.
        text: String,
    },
    /// The number has no finite value.
    #[error("the number {} is too large", quoted(text))]
    TooLarge {
        /// The number as written.
        text: String,
    },
    /// The unit is not in the table.
    #[error("unknown unit {}", quoted(unit))]
    UnknownUnit {
        /// The unit as written.
        unit: String,
    },
}

impl QuantityError {
    /// What the writer can try if a quantity of this dimension is wanted.
    pub fn hint(&self, wanted: Dimension) -> String {
        match self {
            QuantityError::NotANumber { .. } => "write a number and its unit, such as \"0.49 A\"".to_owned(),
            QuantityError::TooLarge { .. } => "the largest number is about 1.8e308".to_owned(),
            QuantityError::UnknownUnit { unit } if decimals_after_a_comma(unit) => {
                "decimals have a point, such as \"0.49 A\"".to_owned()
            }
            QuantityError::UnknownUnit { unit } => match suggested_unit(unit, wanted) {
                Some(unit) => format!("did you mean \"{unit}\"?"),
                None => wanted.hint(),
            },
        }
    }
}

/// Splits a text into its finite number and what follows, trimmed.
pub(crate) fn number_and_unit(text: &str) -> Result<(f64, &str), QuantityError> {
    let text = text.trim();
    // Typeset documents have a true minus sign.
    let (sign, unsigned) = match text.strip_prefix('\u{2212}') {
        Some(rest) if !rest.starts_with(['+', '-']) => (-1.0, rest),
        _ => (1.0, text),
    };
    let end = number_length(unsigned);
    let (number, unit) = unsigned.split_at(end);
    let value: f64 = number.parse().map_err(|_| QuantityError::NotANumber { text: text.to_owned() })?;
    if !value.is_finite() {
        return Err(QuantityError::TooLarge { text: number.to_owned() });
    }
    Ok((sign * value, unit.trim_start()))
}

/// A printed number with the symbol of its unit.
pub(crate) fn with_unit(number: &str, unit: Unit) -> String {
    if unit == Unit::Count { number.to_owned() } else { format!("{number} {unit}") }
}

/// Length of the decimal number at the beginning. The exponent belongs to it only if digits follow.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits = |from: usize| from + bytes[from..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    let sign = |at: usize| at + usize::from(matches!(bytes.get(at), Some(b'+' | b'-')));
    let mut end = digits(sign(0));
    if bytes.get(end) == Some(&b'.') {
        end = digits(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let exponent = sign(end + 1);
        let exponent_end = digits(exponent);
        if exponent_end > exponent {
            end = exponent_end;
        }
    }
    end
}

/// Whether the number ends at a comma, as in `0,49 A`.
fn decimals_after_a_comma(unit: &str) -> bool {
    unit.strip_prefix(',').is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()))
}

/// The unit of the wanted dimension that a writer probably meant.
fn suggested_unit(unit: &str, wanted: Dimension) -> Option<&'static str> {
    let plain = spelling::plain(unit);
    match (plain.as_str(), wanted) {
        ("C", Dimension::Temperature) => return Some(Unit::DegreeCelsius.symbol()),
        ("baud", Dimension::BitRate) => return Some(Unit::BitPerSecond.symbol()),
        _ => {}
    }
    let known = || wanted.units().map(Unit::symbol);
    // A single letter in the wrong case is a likely mistake; another letter is not.
    known()
        .find(|symbol| symbol.eq_ignore_ascii_case(&plain))
        .or_else(|| nearest(&plain, known().filter(|symbol| symbol.len() > 1)))
}

#[cfg(test)]
mod tests;
