//! Uncertainty budgets after the GUM: contributions, combination, expansion.

use gnc_executive::quantity::Unit;
use gnc_executive::uncertainty::Uncertainty;
use gnc_metrology::stats;

use crate::details;

/// One contribution.
#[derive(Debug, Clone)]
struct Contribution {
    name: &'static str,
    /// A: from the record itself; B: from another source.
    kind: char,
    /// Standard uncertainty of the input, in `unit`.
    value: f64,
    unit: &'static str,
    distribution: &'static str,
    dof: f64,
    /// Change of the figure per input.
    sensitivity: f64,
}

/// The budget of one figure, in the unit of the figure.
#[derive(Debug, Clone)]
pub(super) struct Budget {
    unit: Unit,
    rows: Vec<Contribution>,
    shape: Shape,
}

/// The shape of the figure. The contributions count for each of its parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shape {
    /// One value.
    One,
    /// The largest of this many values, each with these contributions.
    LargestOf(usize),
    /// The length of a vector of two components, each with these contributions.
    LengthOfTwo,
}

impl Budget {
    pub(super) fn new(unit: Unit) -> Self {
        Self { unit, rows: Vec::new(), shape: Shape::One }
    }

    /// The budget of the largest of `values` values, where `self` is the budget of each value. It is more likely that
    /// any one of them misses its interval than that a given one does.
    pub(super) fn of_largest(self, values: usize) -> Self {
        Self { shape: if values > 1 { Shape::LargestOf(values) } else { Shape::One }, ..self }
    }

    /// The budget of the length of a vector, where `self` is the budget of each of its two components.
    pub(super) fn of_length(self) -> Self {
        Self { shape: Shape::LengthOfTwo, ..self }
    }

    pub(super) fn unit(&self) -> Unit {
        self.unit
    }

    /// Adds a contribution from the record itself, in the unit of the figure.
    pub(super) fn a(mut self, name: &'static str, value: f64, dof: f64) -> Self {
        let unit = self.unit.symbol();
        self.rows.push(Contribution { name, kind: 'A', value, unit, distribution: "t", dof, sensitivity: 1.0 });
        self
    }

    /// Adds a contribution from another source: the standard uncertainty of the input in its unit, and the change of
    /// the figure per input.
    pub(super) fn b(mut self, name: &'static str, value: f64, unit: &'static str, sensitivity: f64) -> Self {
        let distribution = "normal";
        self.rows.push(Contribution { name, kind: 'B', value, unit, distribution, dof: f64::INFINITY, sensitivity });
        self
    }

    /// Adds a contribution from another source: a bound within which all values are equally likely.
    pub(super) fn bound(mut self, name: &'static str, half_width: f64, unit: &'static str, sensitivity: f64) -> Self {
        let (value, distribution) = (half_width / 3.0_f64.sqrt(), "rectangular");
        self.rows.push(Contribution { name, kind: 'B', value, unit, distribution, dof: f64::INFINITY, sensitivity });
        self
    }

    /// Returns the standard uncertainty and the effective degrees of freedom (Welch-Satterthwaite).
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

    /// Returns the interval of the figure.
    pub(super) fn uncertainty(&self, figure: f64, probability: f64) -> Uncertainty {
        let (u, dof) = self.combined();
        let Some(k) = self.shape.coverage_factor(probability, dof) else {
            // Few degrees of freedom widen this interval as they widen that of a value.
            let widened = stats::coverage_factor(probability, dof) / stats::coverage_factor(probability, f64::INFINITY);
            let (low, high) = stats::amplitude_interval(figure, u * widened, probability);
            return Uncertainty::interval(low, high, probability);
        };
        Uncertainty::symmetric(figure, u, k, probability)
    }

    /// Returns the budget with its sum, in the form of the record.
    pub(super) fn written(&self, probability: f64) -> details::BudgetDetails {
        let (u, dof) = self.combined();
        let k = self.shape.coverage_factor(probability, dof);
        let row = |row: &Contribution| details::ContributionDetails {
            name: row.name.to_owned(),
            kind: row.kind.to_string(),
            value: row.value,
            unit: row.unit.to_owned(),
            distribution: row.distribution.to_owned(),
            dof: finite(row.dof),
            sensitivity: row.sensitivity,
            u: row.value * row.sensitivity.abs(),
        };
        details::BudgetDetails {
            unit: self.unit.symbol().to_owned(),
            contributions: self.rows.iter().map(row).collect(),
            u,
            dof: finite(dof),
            k: k.and_then(finite),
            expanded: k.and_then(|k| finite(k * u)),
            probability,
            figure: self.shape.label(),
        }
    }
}

impl Shape {
    /// Returns the coverage factor; `None` where the interval is not symmetric.
    fn coverage_factor(self, probability: f64, dof: f64) -> Option<f64> {
        match self {
            Shape::One => Some(stats::coverage_factor(probability, dof)),
            // Bonferroni: the probability to miss is at most the sum of the single ones.
            Shape::LargestOf(values) => Some(stats::coverage_factor(1.0 - (1.0 - probability) / values as f64, dof)),
            Shape::LengthOfTwo => None,
        }
    }

    fn label(self) -> Option<String> {
        match self {
            Shape::One => None,
            Shape::LargestOf(values) => Some(format!("the largest of {values}; k is that of all of them together")),
            Shape::LengthOfTwo => Some("a length of two components; the contributions are those of each".to_owned()),
        }
    }
}

/// Returns the number; `None` for an infinite one, since JSON has no infinity.
pub(super) fn finite(number: f64) -> Option<f64> {
    Some(number).filter(|number| number.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bonferroni's t of five comparisons with 10 degrees of freedom is 3.169, Student's 2.228.
    #[test]
    fn the_factor_of_the_largest() {
        let near = |found: f64, table: f64| assert!((found / table - 1.0).abs() < 3e-4, "{found} {table}");
        let one = Budget::new(Unit::Milligravity).a("noise", 1.0, 10.0);
        near(one.clone().of_largest(1).uncertainty(0.0, 0.95).high, 2.228);
        near(one.of_largest(5).uncertainty(0.0, 0.95).high, 3.169);
    }
}
