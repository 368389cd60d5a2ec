//! The coverage interval of a value, and the rule by which it counts in the judgement.

use serde::{Deserialize, Serialize};

use crate::limit::Range;
use crate::outcome::Outcome;
use crate::quantity::Unit;

/// The interval that holds the true value with a stated probability (GUM, coverage interval).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Uncertainty {
    /// Its lower end, in the unit of the value.
    pub low: f64,
    /// Its upper end.
    pub high: f64,
    /// Coverage factor: the ends are the value -+ k standard uncertainties. Absent if the interval is not symmetric,
    /// such as that of a standard deviation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub k: Option<f64>,
    /// Probability of the interval, 0.95 for 95 %.
    pub probability: f64,
}

impl Uncertainty {
    /// The interval `value -+ k u`.
    pub fn symmetric(value: f64, standard: f64, k: f64, probability: f64) -> Self {
        Self { low: value - k * standard, high: value + k * standard, k: Some(k), probability }
    }

    /// An interval of any shape.
    pub fn interval(low: f64, high: f64, probability: f64) -> Self {
        Self { low, high, k: None, probability }
    }

    /// The expanded uncertainty U: half the width of a symmetric interval.
    pub fn expanded(&self) -> Option<f64> {
        self.k.map(|_| (self.high - self.low) / 2.0)
    }

    /// Whether the interval is usable: its ends are numbers, in order.
    pub fn is_finite(&self) -> bool {
        self.low.is_finite() && self.high.is_finite() && self.low <= self.high && self.k.is_none_or(f64::is_finite)
    }

    /// The interval in another unit; `None` if that unit measures another dimension.
    pub fn in_unit(&self, from: Unit, to: Unit) -> Option<Self> {
        Some(Self { low: from.convert(self.low, to)?, high: from.convert(self.high, to)?, ..*self })
    }
}

/// The rule for a value whose coverage interval crosses its limit (JCGM 106, ISO 14253-1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Decision {
    /// Simple acceptance: the value decides. A value inside its limit is marginal if its interval crosses the limit.
    #[default]
    Simple,
    /// Guard band by the uncertainty: the whole interval must lie inside the limit.
    GuardBand,
}

impl Decision {
    /// The name in plans.
    pub(crate) fn as_str(self) -> &'static str {
        match self {
            Decision::Simple => "simple",
            Decision::GuardBand => "guard-band",
        }
    }

    /// Judges a number with its interval, both in the unit of the range. Without a usable interval the result is
    /// errored: the side of the limit on which the value lies is unknown then.
    pub(crate) fn judge(self, range: &Range, number: f64, uncertainty: &Uncertainty) -> Outcome {
        let alone = range.judge(number);
        if !alone.is_good() {
            return alone;
        }
        if !uncertainty.is_finite() {
            return Outcome::Errored;
        }
        let crosses = range.low.is_some_and(|low| uncertainty.low < low)
            || range.high.is_some_and(|high| uncertainty.high > high);
        match self {
            _ if !crosses => alone,
            Decision::Simple => Outcome::Marginal,
            Decision::GuardBand => Outcome::Failed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_counts_where_the_interval_crosses_the_limit() {
        let range = Range { unit: Unit::DegreePerHour, low: Some(-10.0), high: Some(10.0), marginal: Some(1.0) };
        for (value, half, simple, guarded) in [
            (5.0, 1.0, Outcome::Passed, Outcome::Passed),
            (9.5, 0.1, Outcome::Marginal, Outcome::Marginal),
            (8.0, 2.0, Outcome::Passed, Outcome::Passed),
            (8.0, 2.1, Outcome::Marginal, Outcome::Failed),
            (-8.0, 2.1, Outcome::Marginal, Outcome::Failed),
            // A value outside is outside, however uncertain it is.
            (10.1, 5.0, Outcome::Failed, Outcome::Failed),
            (5.0, f64::INFINITY, Outcome::Errored, Outcome::Errored),
            (5.0, f64::NAN, Outcome::Errored, Outcome::Errored),
            (f64::NAN, 1.0, Outcome::Errored, Outcome::Errored),
        ] {
            let uncertainty = Uncertainty::interval(value - half, value + half, 0.95);
            assert_eq!(Decision::Simple.judge(&range, value, &uncertainty), simple, "{value} {half}");
            assert_eq!(Decision::GuardBand.judge(&range, value, &uncertainty), guarded, "{value} {half}");
        }
    }

    #[test]
    fn symmetric_intervals_have_an_expanded_uncertainty() {
        let uncertainty = Uncertainty::symmetric(1.0, 0.25, 2.0, 0.95).in_unit(Unit::Gravity, Unit::Milligravity);
        assert_eq!(uncertainty.and_then(|known| known.expanded()), Some(500.0));
        assert_eq!(Uncertainty::interval(0.6, 2.5, 0.95).expanded(), None);
        assert_eq!(Uncertainty::interval(0.6, 2.5, 0.95).in_unit(Unit::Gravity, Unit::Degree), None);
    }
}
