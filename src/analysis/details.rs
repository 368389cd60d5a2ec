//! Parts of an item's details that other code reads: reports draw them, and the passport takes figures from them.
//!
//! Details are stored as JSON. Each part that code reads again is defined here once, with its key and its form, so that
//! a figure cannot write a form that a reader does not know. Numbers that only people read may be missing: JSON has no
//! infinity and writes null for it.

pub mod calibrating;
pub mod performance;

use std::collections::BTreeMap;
use std::marker::PhantomData;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// A part of details: its key, and `T` as its form.
pub struct DetailsPart<T> {
    key: &'static str,
    form: PhantomData<fn() -> T>,
}

impl<T> DetailsPart<T> {
    pub(crate) const fn new(key: &'static str) -> Self {
        Self { key, form: PhantomData }
    }

    /// Returns the key of the part.
    #[must_use]
    pub const fn key(&self) -> &'static str {
        self.key
    }
}

impl<T: DeserializeOwned> DetailsPart<T> {
    /// Returns the part of these details; `None` where it is missing or has another form, as in details of another
    /// version.
    #[must_use]
    pub fn of(&self, details: &Value) -> Option<T> {
        T::deserialize(details.get(self.key)?).ok()
    }
}

/// Budgets of the figures, by the names of the measurements.
pub const BUDGET: DetailsPart<BTreeMap<String, BudgetDetails>> = DetailsPart::new("budget");

/// The axes of a calibration in the table, in the seat and relative to each other.
pub const FRAMES: DetailsPart<AxesDetails> = DetailsPart::new("frames");

/// Uncertainty budget of one figure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BudgetDetails {
    /// Unit of `u` and `U`.
    pub unit: String,
    /// Contributions that are combined.
    pub contributions: Vec<ContributionDetails>,
    /// Combined standard uncertainty.
    pub u: f64,
    /// Effective degrees of freedom; null stands for infinite.
    pub dof: Option<f64>,
    /// Coverage factor; null where the interval is not symmetric.
    pub k: Option<f64>,
    /// Expanded uncertainty `k u`.
    #[serde(rename = "U")]
    pub expanded: Option<f64>,
    /// Probability of the interval.
    pub probability: f64,
    /// Kind of figure, where it is not a plain value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub figure: Option<String>,
}

/// A contribution to a budget.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContributionDetails {
    /// Source of the contribution.
    pub name: String,
    /// A: from the record itself; B: from another source.
    #[serde(rename = "type")]
    pub kind: String,
    /// Standard uncertainty of the input.
    pub value: f64,
    /// Unit of `value`.
    pub unit: String,
    /// Distribution of the input.
    pub distribution: String,
    /// Degrees of freedom; null stands for infinite.
    pub dof: Option<f64>,
    /// Change of the figure per input.
    pub sensitivity: f64,
    /// Contribution in the unit of the figure.
    pub u: f64,
}

/// A triad's axes relative to the table, to the module's seat and to each other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AxesDetails {
    /// Rows are sensors, columns axes of the table.
    pub coupling_to_table: [[f64; 3]; 3],
    /// Rows are sensors, columns axes of the seat.
    pub coupling_to_seat: [[f64; 3]; 3],
    /// Angles between the sensors' own axes less a right angle: xy, xz, yz.
    pub nonorthogonality_rad: [f64; 3],
    /// How the seat is mounted on the table; null where that was not measured.
    pub mounting_deg: Option<[f64; 3]>,
    /// Standard uncertainty of the mounting.
    pub mounting_u_deg: f64,
    /// Frame of the coefficients, in words.
    pub label: String,
}
