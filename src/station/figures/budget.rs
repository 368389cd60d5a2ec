//! Uncertainty budgets after the GUM: contributions, combination, expansion.

use gnc_executive::quantity::Unit;
use gnc_executive::uncertainty::Uncertainty;
use gnc_metrology::stats;
use serde_json::{Value, json};

/// One contribution.
#[derive(Debug, Clone)]
struct Contribution {
    name: &'static str,
    /// A: from the record itself; B: from elsewhere.
    kind: char,
    /// Standard uncertainty of the input, in `unit`.
    value: f64,
    unit: &'static str,
    distribution: &'static str,
    dof: f64,
    /// Figure per input.
    sensitivity: f64,
}

/// The budget of one figure, in the unit of the figure.
#[derive(Debug, Clone)]
pub(super) struct Budget {
    unit: Unit,
    rows: Vec<Contribution>,
    shape: Shape,
}

/// What the figure is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shape {
    /// A value with an error of either sign.
    Value,
    /// The length of a vector of two components, which both err as the budget says.
    Amplitude,
}

impl Budget {
    pub(super) fn new(unit: Unit) -> Self {
        Self { unit, rows: Vec::new(), shape: Shape::Value }
    }

    /// The budget of an amplitude: its contributions are those of either component.
    pub(super) fn of_amplitude(unit: Unit) -> Self {
        Self { shape: Shape::Amplitude, ..Self::new(unit) }
    }

    pub(super) fn unit(&self) -> Unit {
        self.unit
    }

    /// From the record itself, in the unit of the figure.
    pub(super) fn a(mut self, name: &'static str, value: f64, dof: f64) -> Self {
        let unit = self.unit.symbol();
        self.rows.push(Contribution { name, kind: 'A', value, unit, distribution: "t", dof, sensitivity: 1.0 });
        self
    }

    /// From elsewhere: the standard uncertainty of the input in its unit, and the figure per input.
    pub(super) fn b(mut self, name: &'static str, value: f64, unit: &'static str, sensitivity: f64) -> Self {
        let distribution = "normal";
        self.rows.push(Contribution { name, kind: 'B', value, unit, distribution, dof: f64::INFINITY, sensitivity });
        self
    }

    /// From elsewhere: a bound within which every value is as likely.
    pub(super) fn bound(mut self, name: &'static str, half_width: f64, unit: &'static str, sensitivity: f64) -> Self {
        let (value, distribution) = (half_width / 3.0_f64.sqrt(), "rectangular");
        self.rows.push(Contribution { name, kind: 'B', value, unit, distribution, dof: f64::INFINITY, sensitivity });
        self
    }

    /// Standard uncertainty and effective degrees of freedom (Welch-Satterthwaite).
    pub(super) fn combined(&self) -> (f64, f64) {
        let parts: Vec<(f64, f64)> = self
            .rows
            .iter()
            .map(|row| (row.value * row.sensitivity.abs(), row.dof))
            .filter(|(u, _)| *u != 0.0)
            .collect();
        let u = parts.iter().map(|(u, _)| u * u).sum::<f64>().sqrt();
        let dof = if parts.is_empty() { f64::INFINITY } else { stats::welch_satterthwaite(&parts) };
        (u, dof)
    }

    /// The interval of the figure.
    pub(super) fn uncertainty(&self, figure: f64, probability: f64) -> Uncertainty {
        let (u, dof) = self.combined();
        let k = stats::coverage_factor(probability, dof);
        match self.shape {
            Shape::Value => Uncertainty::symmetric(figure, u, k, probability),
            Shape::Amplitude => {
                // Few degrees of freedom widen it as they do a value's interval.
                let sd = u * k / stats::coverage_factor(probability, f64::INFINITY);
                let (low, high) = stats::amplitude_interval(figure, sd, probability);
                Uncertainty::interval(low, high, probability)
            }
        }
    }

    /// As a table with its sum.
    pub(super) fn json(&self, probability: f64) -> Value {
        let (u, dof) = self.combined();
        // The interval of an amplitude has a shape of its own.
        let k = match self.shape {
            Shape::Value => stats::coverage_factor(probability, dof),
            Shape::Amplitude => f64::NAN,
        };
        let rows: Vec<Value> = self
            .rows
            .iter()
            .map(|row| {
                json!({
                    "name": row.name,
                    "type": row.kind.to_string(),
                    "value": row.value,
                    "unit": row.unit,
                    "distribution": row.distribution,
                    "dof": finite(row.dof),
                    "sensitivity": row.sensitivity,
                    "u": row.value * row.sensitivity.abs(),
                })
            })
            .collect();
        json!({
            "unit": self.unit.symbol(), "contributions": rows, "u": u, "dof": finite(dof), "k": finite(k), "U": finite(k * u),
            "probability": probability,
        })
    }
}

/// JSON has no infinity: null.
pub(super) fn finite(number: f64) -> Option<f64> {
    Some(number).filter(|number| number.is_finite())
}
