//! The clock of the samples, compared with the board's own time and with true time.
//!
//! The board's time must agree to a microsecond, or there is no figure. Against true time the clock is known from the
//! receiver's 1PPS, where an item before this one had it. Otherwise it is a crystal with the tolerance that the bench
//! file states or, without such a statement, the plan.

use gnc_executive::bench::BenchSite;
use gnc_executive::details::Details;
use gnc_executive::measurement::Value;
use gnc_executive::quantity::Unit;
use gnc_executive::uncertainty::Uncertainty;
use gnc_metrology::stats;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::budget::Budget;
use super::{AnalysisInput, FigureError, Findings};
use crate::capture::{Capture, HostView};
use crate::details::DetailsPart;

/// The board's clock as an item measured it.
pub(super) const BOARD_CLOCK: DetailsPart<BoardClock> = DetailsPart::new("board_clock");
/// Limits of the interval between two pulses of neighbouring seconds. Outside them a pulse is missing, or one is a
/// bounce.
pub(super) const SECOND_NS: (f64, f64) = (0.99e9, 1.01e9);
/// Least scatter that is assumed for a pulse, whatever a few pulses show: receivers state 20 to 100 ns.
const PULSE_NS: f64 = 100.0;
/// Pulses that scatter by more than this are not a reference.
const MOST_SCATTER_NS: f64 = 10_000.0;
/// Largest drift of a crystal since its measurement, or between two calibrations: some kelvins of temperature.
const DRIFT_PPM: f64 = 5.0;

/// The board's clock compared with true time, by the pulses of a receiver with a fix.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BoardClock {
    /// How much faster the board's clock runs, parts per million.
    pub error_ppm: f64,
    /// Standard uncertainty of `error_ppm` at the time of the pulses.
    pub u_ppm: f64,
    /// Seconds between the pulses.
    pub span_s: f64,
}

impl BoardClock {
    /// Computes the error from the board times of 1PPS edges, nanoseconds.
    ///
    /// # Errors
    /// The reason why the pulses give no result, in words.
    pub fn of_pulses(pulses_ns: &[u64]) -> Result<Self, String> {
        let intervals = pulses_ns.windows(2).map(|pair| pair[1].saturating_sub(pair[0]) as f64);
        let whole: Vec<f64> = intervals.filter(|ns| (SECOND_NS.0..=SECOND_NS.1).contains(ns)).collect();
        if whole.is_empty() {
            return Err("no two pulses came a second apart".into());
        }
        let n = whole.len() as f64;
        let mean_ns = stats::mean(&whole);
        let farthest_ns = whole.iter().map(|ns| (ns - mean_ns).abs()).fold(0.0, f64::max);
        if farthest_ns > MOST_SCATTER_NS {
            return Err(format!("the pulses scatter by {:.1} us", farthest_ns * 1e-3));
        }
        // Neighbouring intervals share an edge, so that only the first and the last edge count: a difference of two
        // scatters.
        let edge_ns = if whole.len() > 2 { stats::mean_sd(&whole).1 / 2.0_f64.sqrt() } else { 0.0 };
        let u_ppm = edge_ns.max(PULSE_NS) * 2.0_f64.sqrt() / n * 1e-3;
        Ok(Self { error_ppm: (mean_ns * 1e-9 - 1.0) * 1e6, u_ppm, span_s: n })
    }

    /// Returns the error as a measurement, at the given probability.
    #[must_use]
    pub fn value(&self, probability: f64) -> Value {
        estimate(self.error_ppm, self.u_ppm, probability)
    }

    /// Returns the details of the item that measured it.
    #[must_use]
    pub fn details(&self) -> Details {
        json!({ BOARD_CLOCK.key(): self }).into()
    }
}

fn estimate(error_ppm: f64, u_ppm: f64, probability: f64) -> Value {
    let k = stats::coverage_factor(probability, f64::INFINITY);
    Value::estimate(error_ppm, Unit::PartsPerMillion, Uncertainty::symmetric(error_ppm, u_ppm, k, probability))
}

/// The sample clock compared with true time, as a figure uses it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ClockTerms {
    /// The part by which the clock runs too fast, as far as it was measured: samples come at `1 + error` times their
    /// rate.
    error: f64,
    u_ppm: f64,
    basis: Basis,
}

/// The source of what is known of a clock. The first available source counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Basis {
    Pulses,
    Bench,
    Plan,
}

impl ClockTerms {
    /// Takes the newest pulses before this item, else the bench file, else the plan.
    pub(super) fn of(question: &AnalysisInput<'_>) -> Result<Self, FigureError> {
        let by_plan_ppm = question.params.quantity("clock_u", Unit::PartsPerMillion)?;
        let by_bench_ppm = BenchSite::fixture(question.site).board_clock_u_ppm;
        Ok(match (measured(question.earlier), by_bench_ppm) {
            (Some(clock), _) => Self { error: clock.error_ppm * 1e-6, u_ppm: with_drift(&clock), basis: Basis::Pulses },
            (None, Some(u_ppm)) => Self { error: 0.0, u_ppm, basis: Basis::Bench },
            (None, None) => Self { error: 0.0, u_ppm: by_plan_ppm, basis: Basis::Plan },
        })
    }

    /// Returns the samples in a second of true time.
    pub(super) fn rate_hz(&self, asked_hz: f64) -> f64 {
        asked_hz * (1.0 + self.error)
    }

    /// Adds the clock to the budget of a figure that changes by `per_ppm` with the clock.
    pub(super) fn in_budget(&self, budget: Budget, per_ppm: f64) -> Budget {
        let name = match self.basis {
            Basis::Pulses => "sample clock, by 1PPS",
            Basis::Bench => "sample clock, by the bench file",
            Basis::Plan => "sample clock, not measured",
        };
        budget.b(name, self.u_ppm, "ppm", per_ppm)
    }

    /// Returns what a reader of the figure needs to know of the clock.
    pub(super) fn details(&self) -> serde_json::Value {
        let basis = match self.basis {
            Basis::Pulses => "1PPS of the receiver, in an item before this one; its error is taken out",
            Basis::Bench => "not measured against true time: board_clock_u of the bench file counts",
            Basis::Plan => "not measured against true time: the tolerance of its crystal counts",
        };
        json!({ "basis": basis, "error_ppm": self.error * 1e6, "u_ppm": self.u_ppm })
    }
}

fn with_drift(clock: &BoardClock) -> f64 {
    clock.u_ppm.hypot(drift_ppm())
}

/// Standard uncertainty of a clock's drift between two measurements.
pub(super) fn drift_ppm() -> f64 {
    DRIFT_PPM / 3.0_f64.sqrt()
}

fn measured(earlier: &[(String, Findings)]) -> Option<BoardClock> {
    earlier.iter().rev().find_map(|(_, findings)| BOARD_CLOCK.of(&findings.details))
}

/// Checks that the samples of every capture lie on the grid of the board's own time.
pub(super) fn check(captures: &[Capture]) -> Result<(), FigureError> {
    for capture in captures {
        // Missing samples have their own error.
        if !capture.losses.any() {
            let unfit = |fault| FigureError::Clock { label: capture.about.label.clone(), fault };
            capture.check_clock().map_err(unfit)?;
        }
    }
    Ok(())
}

/// Returns the rate of the samples against true time, relative to the rate that was asked for: by 1PPS, else by the
/// host's clock over the capture with the smallest uncertainty.
#[must_use]
pub fn sample_rate_error<'h>(
    earlier: &[(String, Findings)],
    views: impl Iterator<Item = &'h HostView>,
    probability: f64,
) -> Value {
    if let Some(clock) = measured(earlier) {
        return estimate(clock.error_ppm, with_drift(&clock), probability);
    }
    let mut best: Option<(f64, f64)> = None;
    let mut why = None;
    for view in views {
        match view {
            HostView::Compared { error_ppm, u_ppm } if best.is_none_or(|(_, least)| *u_ppm < least) => {
                best = Some((*error_ppm, *u_ppm));
            }
            HostView::Compared { .. } => {}
            HostView::Nothing(text) => why = why.or(Some(text.clone())),
        }
    }
    match best {
        Some((error_ppm, u_ppm)) => estimate(error_ppm, u_ppm, probability),
        None => Value::NotAvailable(why.unwrap_or_else(|| "no samples were captured".into())),
    }
}
