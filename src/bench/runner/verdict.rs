//! The outcome of an attempt: by its measurements, and by the trouble that ended it.

use std::time::Duration;

use gnc_analysis::motion::watch::Spoilt;
use gnc_board::BoardError;
use gnc_executive::catalogue::{TEMPERATURE, TEMPERATURE_DRIFT};
use gnc_executive::event::AttemptError;
use gnc_executive::measurement::Measurement;
use gnc_executive::outcome::Outcome;
use gnc_executive::plan::PlanItem;
use gnc_protocol::FaultCode;
use gnc_text::with_causes;

use crate::procedure::ProcedureError;

/// Judges an attempt. A restart, a device that does not work and a sensor at the end of its range are faults of the
/// module, and so is a limit that was violated before the trouble came. After losses on the line and all other trouble
/// the station cannot tell.
pub(super) fn judge(
    item: &PlanItem,
    measured: &[Measurement],
    trouble: Option<&ProcedureError>,
    stood: Option<Duration>,
) -> (Outcome, Option<AttemptError>) {
    let Some(trouble) = trouble else {
        let outcome = item.attempt_outcome(measured);
        let missing: Vec<&str> = item.missing(measured).collect();
        let error = (outcome == Outcome::Errored && !missing.is_empty()).then(|| AttemptError {
            text: format!("the item did not measure {}", missing.join(", ")),
            hint: "see the notes of this item in the log".into(),
            again: false,
        });
        return (outcome, error);
    };
    // Nothing that the station missed says anything about the module, not even a restart: the board's watchdog does that.
    if let Some(stood) = stood {
        let text = format!(
            "the station itself stood still for {:.1} s in this attempt, so nothing counts that it missed: {}",
            stood.as_secs_f64(),
            with_causes(trouble)
        );
        let hint = "keep the computer awake, and do not hold the program; then test again";
        return (Outcome::Errored, Some(AttemptError { text, hint: hint.into(), again: false }));
    }
    let outcome = match trouble {
        // The counts include what the line lost, so they say nothing about the module.
        ProcedureError::FramesLost { .. }
        | ProcedureError::TestIdsShared { .. }
        | ProcedureError::SamplesLost { .. }
        | ProcedureError::CaptureLost { .. }
        // The module had another temperature in the earlier run, and that is no fault of it.
        | ProcedureError::OtherTemperature { .. }
        // It is another module, or one that other limits are for.
        | ProcedureError::OtherModule(_)
        | ProcedureError::OtherPart { .. }
        // What the board says against the interface document says nothing either, and a value before it may be of the
        // same kind.
        | ProcedureError::Board(BoardError::Breach { .. } | BoardError::PowerLost) => Outcome::Errored,
        // A limit was violated before the trouble; that verdict stands.
        _ if violates(measured) => Outcome::Failed,
        ProcedureError::Board(BoardError::Restarted { .. }) => Outcome::Failed,
        ProcedureError::Board(BoardError::Fault {
            code: FaultCode::DeviceFault | FaultCode::DeviceTimeout, ..
        }) => Outcome::Failed,
        // The plan was checked: no motion asks for more than the published range. A table that went beyond it shows that
        // in the samples, and is `TooFast`.
        ProcedureError::Spoilt { spoilt: Spoilt::Saturated { .. }, .. } => Outcome::Failed,
        _ => Outcome::Errored,
    };
    (outcome, Some(AttemptError { text: with_causes(trouble), hint: trouble.try_this().to_owned(), again: false }))
}

/// The doubt about an attempt that fails by its temperatures alone, if a part of its captures is of an earlier run.
pub(super) fn other_temperature(measured: &[Measurement]) -> Option<ProcedureError> {
    let failed: Vec<&Measurement> =
        measured.iter().filter(|measurement| measurement.outcome == Some(Outcome::Failed)).collect();
    let of_heat = |measurement: &&Measurement| [TEMPERATURE.name, TEMPERATURE_DRIFT.name].contains(&&*measurement.name);
    if failed.is_empty() || !failed.iter().all(of_heat) {
        return None;
    }
    let said = |measurement: &&Measurement| format!("{} is outside its limit", measurement.name);
    Some(ProcedureError::OtherTemperature { what: failed.iter().map(said).collect::<Vec<_>>().join(", ") })
}

/// Whether a value that was measured lies outside its limit.
fn violates(measured: &[Measurement]) -> bool {
    measured.iter().any(|measurement| measurement.outcome == Some(Outcome::Failed))
}
