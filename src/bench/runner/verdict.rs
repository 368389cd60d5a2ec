//! The outcome of an attempt: by its measurements, and by the trouble that ended it.

use std::time::Duration;

use gnc_analysis::motion::watch::Spoilt;
use gnc_board::BoardError;
use gnc_executive::catalogue::ports::FRAMES_LOST;
use gnc_executive::catalogue::{ItemId, TEMPERATURE, TEMPERATURE_DRIFT};
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
        if let (Outcome::Failed, Some(stood)) = (outcome, stood.filter(|_| only_waited_for(item, measured))) {
            let what = format!("{} is outside its limit", FRAMES_LOST.name);
            let (text, hint) = (stood_still(stood, &what), KEEP_AWAKE.to_owned());
            return (Outcome::Errored, Some(AttemptError { text, hint, again: false }));
        }
        let missing: Vec<&str> = item.missing(measured).collect();
        let error = (outcome == Outcome::Errored && !missing.is_empty()).then(|| AttemptError {
            text: format!("the item did not measure {}", missing.join(", ")),
            hint: "see the notes of this item in the log".into(),
            again: false,
        });
        return (outcome, error);
    };
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
    // A fault of the module stays one, however the station stood. Where it cannot tell, that it stood still is the first thing to know.
    let (text, hint) = match stood.filter(|_| outcome == Outcome::Errored) {
        Some(stood) => (stood_still(stood, &with_causes(trouble)), KEEP_AWAKE),
        None => (with_causes(trouble), trouble.try_this()),
    };
    (outcome, Some(AttemptError { text, hint: hint.to_owned(), again: false }))
}

/// What can be tried if the station stood still.
const KEEP_AWAKE: &str = "keep the computer awake, do not hold the program, and end other programs that need the whole computer; then test again";

fn stood_still(stood: Duration, what: &str) -> String {
    let stood_s = stood.as_secs_f64();
    format!(
        "the station itself stood still for {stood_s:.1} s in this attempt, so nothing counts that it missed: {what}"
    )
}

/// Whether an attempt fails only by frames of CAN that did not come in time. Their time is that of the station: all other items wait by
/// the board's clock.
fn only_waited_for(item: &PlanItem, measured: &[Measurement]) -> bool {
    let mut failed = measured.iter().filter(|measurement| measurement.outcome == Some(Outcome::Failed));
    item.id == ItemId::Can && failed.all(|measurement| measurement.name == FRAMES_LOST.name)
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

#[cfg(test)]
mod tests {
    use gnc_executive::plan::Plan;
    use serde_json::json;

    use super::*;

    /// Frames that a station did not wait for are no fault of the module. All else that it measured is.
    #[test]
    fn lost_frames_do_not_count_if_the_station_stood_still() {
        let text = b"name = \"p\"\nversion = \"1\"\n[[item]]\nid = \"can\"\n[item.limits]\nframes_lost = \"<= 0\"\nframes_altered = \"<= 0\"\n";
        let plan = Plan::read("p.toml", text.to_vec(), &mut |name| Err(name.to_owned())).unwrap();
        let item = &plan.items()[0];
        let count = |name: &str, outcome: &str| {
            let json = json!({
                "name": name, "value": 1.0, "unit": null, "low": null, "high": 0.0, "expected": null, "outcome": outcome,
            });
            serde_json::from_value::<Measurement>(json).unwrap()
        };
        let stood = Some(Duration::from_secs(2));
        let both = |lost: &str, altered: &str| vec![count("frames_lost", lost), count("frames_altered", altered)];
        for (measured, stood, expected) in [
            (both("failed", "passed"), stood, Outcome::Errored),
            (both("failed", "passed"), None, Outcome::Failed),
            (both("failed", "failed"), stood, Outcome::Failed),
            (both("passed", "failed"), stood, Outcome::Failed),
            (both("passed", "passed"), stood, Outcome::Passed),
        ] {
            let (outcome, error) = judge(item, &measured, None, stood);
            assert_eq!(outcome, expected, "{measured:?}");
            assert_eq!(error.is_some(), expected == Outcome::Errored, "{error:?}");
        }
    }

    /// A station that is held just when a bad module shows itself does not get a second try for it.
    #[test]
    fn a_fault_of_the_module_stays_one_if_the_station_stood_still() {
        let text =
            b"name = \"p\"\nversion = \"1\"\n[[item]]\nid = \"cpu\"\n[item.limits]\ncore1_register_errors = \"== 0\"\n";
        let plan = Plan::read("p.toml", text.to_vec(), &mut |name| Err(name.to_owned())).unwrap();
        let item = &plan.items()[0];
        let measured = |outcome: &str| {
            let measurement = json!({
                "name": "core1_register_errors", "value": 1.0, "unit": null, "low": 0.0, "high": 0.0, "expected": null,
                "outcome": outcome,
            });
            vec![serde_json::from_value::<Measurement>(measurement).unwrap()]
        };
        let code = FaultCode::DeviceFault;
        let fault = BoardError::Fault { what: "the test", code, text: String::new(), elapsed: Duration::ZERO };
        let restarted = BoardError::Restarted { asked: true, during: "the test".into(), before: 1, after: 2 };
        let (fault, restarted) = (ProcedureError::Board(fault), ProcedureError::Board(restarted));
        let ended = ProcedureError::Board(BoardError::SessionEnded { early: None });
        let stood = Some(Duration::from_secs(5));
        for (measured, trouble, expected) in [
            (vec![], &fault, Outcome::Failed),
            (vec![], &restarted, Outcome::Failed),
            (measured("failed"), &ended, Outcome::Failed),
            (measured("passed"), &ended, Outcome::Errored),
        ] {
            for stood in [None, stood] {
                let (outcome, error) = judge(item, &measured, Some(trouble), stood);
                let said = error.expect("why").text;
                assert_eq!(outcome, expected, "{said}");
                let is_said = said.starts_with("the station itself stood still for 5.0 s");
                assert_eq!(is_said, stood.is_some() && outcome == Outcome::Errored, "{said}");
            }
        }
    }
}
