//! How a check ends.

use std::time::Duration;

/// What a check measured when the board does what the document demands, or why it ended otherwise.
pub(crate) type Verdict<T = String> = Result<T, Stop>;

/// Why a check ended before it passed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Stop {
    /// The board did something else than the document demands: what came.
    Failed(String),
    /// The demand does not bind this board on this link: why.
    NotApplicable(String),
    /// No session could be opened: what came instead.
    Closed(String),
    /// The module could not be switched on: what came instead.
    Unpowered(String),
    /// The board fell silent for this long in the middle of the check.
    Silent(Duration),
    /// The port or interface went away: what the system said.
    Gone(String),
    /// A person stopped the checks.
    Cancelled,
}

/// Ends a check: the board did something else.
pub(crate) fn failed<T>(what: impl Into<String>) -> Verdict<T> {
    Err(Stop::Failed(what.into()))
}

/// Ends a check: the demand does not bind here.
pub(crate) fn not_applicable<T>(why: impl Into<String>) -> Verdict<T> {
    Err(Stop::NotApplicable(why.into()))
}

/// Ends a check as failed unless `holds`.
pub(crate) fn demand(holds: bool, otherwise: impl FnOnce() -> String) -> Verdict<()> {
    if holds { Ok(()) } else { failed(otherwise()) }
}
