//! Figures from captures: pure functions, the same on the bench and years later.
//!
//! A procedure captures; what the samples say is worked out here alone, so that `recompute` cannot differ from the run.

use gnc_executive::bench::Site;
use gnc_executive::catalogue::ItemId;
use gnc_executive::measurement::Value;
use gnc_executive::plan::Params;

use crate::capture::Capture;

/// What an analysis works with.
#[derive(Debug)]
pub struct Question<'a> {
    /// The item's parameters.
    pub params: &'a Params,
    /// Where the bench stands.
    pub site: Option<&'a Site>,
    /// The captures of this attempt, or of the item that its parameters name.
    pub captures: &'a [Capture],
    /// What the items before it found, oldest first, each with its name in the plan.
    pub earlier: &'a [(String, Findings)],
}

/// What an analysis found.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Findings {
    /// Measurements in the order of the catalogue: name, value.
    pub measured: Vec<(String, Value)>,
    /// Everything else for records, reports and later items: equation, parameters, covariance, residuals, budget.
    pub details: serde_json::Value,
}

/// Why no figure comes from captures.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FigureError {
    /// The item has no figures from captures.
    #[error("{item} has no figures from captures")]
    NoAnalysis {
        /// The item.
        item: ItemId,
    },
}

impl FigureError {
    /// What the operator can try.
    #[must_use]
    pub fn try_this(&self) -> &'static str {
        "take the item out of the plan"
    }
}

/// Works out the figures of an item.
///
/// # Errors
/// [`FigureError`].
pub fn analyse(item: ItemId, _: &Question<'_>) -> Result<Findings, FigureError> {
    Err(FigureError::NoAnalysis { item })
}
