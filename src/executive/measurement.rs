//! A measured value and its judgement, in the form in which events and records carry them.

use gnc_text::printable;
use serde::{Deserialize, Serialize};

use crate::limit::{self, Limit};
use crate::number;
use crate::outcome::Outcome;
use crate::quantity::{Quantity, Unit, with_unit};
use crate::uncertainty::{Decision, Uncertainty};

/// A value that a procedure measured.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A number with its unit. It may be NaN or infinite; it is errored then.
    Number(Quantity),
    /// A number with its unit, and its coverage interval in that unit.
    Estimate(Quantity, Uncertainty),
    /// A text from outside; shown only through [`printable`].
    Text(String),
    /// A value that this bench or link cannot provide, and why. With a limit it is errored, never assumed.
    NotAvailable(String),
}

impl Value {
    /// A number in a unit.
    pub const fn number(number: f64, unit: Unit) -> Self {
        Value::Number(Quantity::new(number, unit))
    }

    /// A number in a unit with its coverage interval in that unit.
    pub const fn estimate(number: f64, unit: Unit, uncertainty: Uncertainty) -> Self {
        Value::Estimate(Quantity::new(number, unit), uncertainty)
    }

    /// A number of pieces, errors or words. Counts above 2^53 lose their last digits.
    pub fn count(count: u64) -> Self {
        Value::number(count as f64, Unit::Count)
    }

    /// A text.
    pub fn text(text: impl Into<String>) -> Self {
        Value::Text(text.into())
    }
}

/// The value as recorded: a finite number, a text, or null with the raw text beside it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Reading {
    /// A finite number in the unit of the measurement.
    Number(f64),
    /// A text.
    Text(String),
    /// No value: not a number, infinite, or not available; `raw` says which.
    Null,
}

/// One measured value with the limit that it was judged against.
///
/// Value, bounds and marginal bounds are all in `unit`, exactly as they were compared. So everyone can repeat the
/// judgement from the record alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// Name in the catalogue.
    pub name: String,
    /// Which repeat within the attempt, from 1; absent if the plan has no repeats.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub repeat: Option<u32>,
    /// The value.
    pub value: Reading,
    /// The raw text if there is no value: "NaN", "inf", "-inf", or why no value is available.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub raw: Option<String>,
    /// Unit of value and bounds; null for texts and counts.
    pub unit: Option<Unit>,
    /// The lowest good value.
    pub low: Option<f64>,
    /// The highest good value.
    pub high: Option<f64>,
    /// Good values below this are marginal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub marginal_low: Option<f64>,
    /// Good values above this are marginal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub marginal_high: Option<f64>,
    /// The coverage interval of the value, in `unit`; absent if the procedure states none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<Uncertainty>,
    /// The rule by which that interval counted; absent if it did not count.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub decision: Option<Decision>,
    /// The text that it must equal.
    pub expected: Option<String>,
    /// The texts of which it must be one; absent if it is not one of several.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub one_of: Vec<String>,
    /// The regular expression that all of it must match; absent if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pattern: Option<String>,
    /// Null for information: a measurement without a limit is never a pass.
    pub outcome: Option<Outcome>,
}

impl Measurement {
    /// The value as it was measured, before its judgement.
    pub fn measured(&self) -> Value {
        let unit = self.unit.unwrap_or(Unit::Count);
        match (&self.value, self.raw.as_deref()) {
            (Reading::Number(number), _) => match self.uncertainty {
                Some(uncertainty) => Value::estimate(*number, unit, uncertainty),
                None => Value::number(*number, unit),
            },
            (Reading::Text(text), _) => Value::text(text.clone()),
            (Reading::Null, Some("NaN")) => Value::number(f64::NAN, unit),
            (Reading::Null, Some("inf")) => Value::number(f64::INFINITY, unit),
            (Reading::Null, Some("-inf")) => Value::number(f64::NEG_INFINITY, unit),
            (Reading::Null, raw) => Value::NotAvailable(raw.unwrap_or_default().to_owned()),
        }
    }

    /// Judges a value against its limit, if there is one.
    ///
    /// `shown` is the unit for a number without a limit; a number with a limit takes the limit's unit. `serial_number`
    /// is the scanned one, for limits that name it. A value whose kind does not fit its limit is errored. `decision`
    /// applies to values with a coverage interval.
    pub fn judge(
        name: &str,
        value: &Value,
        shown: Unit,
        limit: Option<&Limit>,
        decision: Decision,
        serial_number: &str,
    ) -> Self {
        let mut measurement = Self {
            name: name.to_owned(),
            repeat: None,
            value: Reading::Null,
            raw: None,
            unit: None,
            low: None,
            high: None,
            marginal_low: None,
            marginal_high: None,
            uncertainty: None,
            decision: None,
            expected: None,
            one_of: Vec::new(),
            pattern: None,
            outcome: limit.map(|_| Outcome::Errored),
        };
        let mut unit = shown;
        match limit {
            Some(Limit::Range(range)) => {
                unit = range.unit;
                (measurement.low, measurement.high) = (range.low, range.high);
                (measurement.marginal_low, measurement.marginal_high) = (range.marginal_low(), range.marginal_high());
                measurement.unit = shown_unit(unit);
            }
            Some(Limit::Text(expected)) => measurement.expected = Some(expected.resolve(serial_number).to_owned()),
            Some(Limit::OneOf(texts)) => measurement.one_of.clone_from(texts),
            Some(Limit::Matches(pattern)) => measurement.pattern = Some(pattern.to_string()),
            None => {}
        }
        match value {
            Value::Number(quantity) => measurement.number(*quantity, None, unit, limit, decision),
            Value::Estimate(quantity, known) => measurement.number(*quantity, Some(known), unit, limit, decision),
            Value::Text(text) => {
                measurement.value = Reading::Text(text.clone());
                let good = match limit {
                    Some(Limit::Text(expected)) => Some(text == expected.resolve(serial_number)),
                    Some(Limit::OneOf(texts)) => Some(texts.contains(text)),
                    Some(Limit::Matches(pattern)) => Some(pattern.fits(text)),
                    Some(Limit::Range(_)) | None => None,
                };
                if let Some(good) = good {
                    measurement.outcome = Some(if good { Outcome::Passed } else { Outcome::Failed });
                }
            }
            Value::NotAvailable(why) => measurement.raw = Some(why.clone()),
        }
        measurement
    }

    /// Takes a number, converts it to `unit` and judges it.
    fn number(
        &mut self,
        quantity: Quantity,
        known: Option<&Uncertainty>,
        unit: Unit,
        limit: Option<&Limit>,
        decision: Decision,
    ) {
        // A value without a limit is not compared, and the procedure's own unit is better than no number.
        let (number, unit) = match quantity.in_unit(unit) {
            Some(number) => (number, unit),
            None => (quantity.number, quantity.unit),
        };
        self.unit = shown_unit(unit);
        if number.is_finite() {
            self.value = Reading::Number(number);
        } else {
            self.raw = Some(number::non_finite(number).to_owned());
        }
        let known = known.and_then(|known| known.in_unit(quantity.unit, unit));
        self.uncertainty = known.filter(Uncertainty::is_finite);
        let Some(Limit::Range(range)) = limit else { return };
        if range.unit != unit {
            return;
        }
        self.outcome = Some(match &known {
            None => range.judge(number),
            Some(known) => {
                self.decision = Some(decision);
                decision.judge(range, number, known)
            }
        });
    }

    /// Whether there is a measured value, NaN included; false for [`Value::NotAvailable`].
    pub(crate) fn is_available(&self) -> bool {
        self.value != Reading::Null || matches!(self.raw.as_deref(), Some("NaN" | "inf" | "-inf"))
    }

    /// The value for people, with its unit. It has enough digits to stay visibly on its side of every bound.
    pub fn value_text(&self) -> String {
        match &self.value {
            Reading::Number(value) => {
                let bounds: Vec<f64> =
                    [self.low, self.high, self.marginal_low, self.marginal_high].into_iter().flatten().collect();
                let unit = self.unit.unwrap_or(Unit::Count);
                with_unit(&number::beside(*value, unit.dimension().digits(), &bounds), unit)
            }
            Reading::Text(text) => printable(text).into_owned(),
            Reading::Null => printable(self.raw.as_deref().unwrap_or("no value")).into_owned(),
        }
    }

    /// The coverage interval for people: "+- 0.03", "2.9 .. 11"; empty if there is none.
    pub fn uncertainty_text(&self) -> String {
        let Some(known) = &self.uncertainty else { return String::new() };
        match known.expanded() {
            Some(expanded) => format!("+- {}", number::plain(expanded, number::INTERVAL_DIGITS)),
            None => {
                let (low, high) = number::interval(known.low, known.high);
                format!("{low} .. {high}")
            }
        }
    }

    /// The limit for people: "499 .. 501 us", "== DEMO-1"; empty for information.
    pub fn limit_text(&self) -> String {
        match (&self.expected, &self.pattern) {
            (Some(expected), _) => format!("== {}", printable(expected)),
            (None, Some(pattern)) => limit::matches(pattern),
            (None, None) if !self.one_of.is_empty() => limit::one_of(&self.one_of),
            (None, None) => limit::bounds(self.low, self.high, self.unit.unwrap_or(Unit::Count)),
        }
    }
}

fn shown_unit(unit: Unit) -> Option<Unit> {
    (unit != Unit::Count).then_some(unit)
}

#[cfg(test)]
mod tests;
