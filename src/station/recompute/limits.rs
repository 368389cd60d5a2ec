//! The limits of a plan that judge a run again, if they depend on the part number of the module.

use gnc_executive::catalogue::ItemId;
use gnc_executive::catalogue::processor::{HARDWARE, PART};
use gnc_executive::event::EventKind;
use gnc_executive::measurement::Reading;
use gnc_executive::part::{LimitsChosen, PartName};
use gnc_executive::plan::Plan;

use super::source::{RecordedRun, RunError};

/// A plan with the limits for the module of a run.
pub(super) struct Judging {
    pub(super) plan: Plan,
    /// Which limits they are; `None` if the plan has none by part number.
    pub(super) chosen: Option<LimitsChosen>,
}

/// Takes the limits that the run used, or chooses those of another plan by what the module said in the run.
pub(super) fn choose(run: &RecordedRun, plan: &Plan, is_other_plan: bool) -> Result<Judging, RunError> {
    let recorded = chosen(run);
    if !plan.has_parts() || (!is_other_plan && recorded.is_none()) {
        return Ok(Judging { plan: plan.clone(), chosen: None });
    }
    let chosen = match recorded {
        Some(recorded) if !is_other_plan => recorded.clone(),
        _ => {
            let module = module(run).ok_or_else(|| RunError::Unfit {
                what: "its limits depend on the part number, and the run does not say that of the module".to_owned(),
            })?;
            plan.choose_limits(&module)?
        }
    };
    let judging = match &chosen.part {
        None => plan.clone(),
        Some(part) => plan.with_limits_of(part).ok_or_else(|| RunError::Unfit {
            what: format!("it has no limits for part {part}, by which the run was judged"),
        })?,
    };
    Ok(Judging { plan: judging, chosen: Some(chosen) })
}

/// The limits that the run used.
pub(super) fn chosen(run: &RecordedRun) -> Option<&LimitsChosen> {
    run.events.iter().find_map(|event| match &event.kind {
        EventKind::LimitsChosen(chosen) => Some(chosen),
        _ => None,
    })
}

/// What the module was: as the run chose its limits, or as the item of the identity measured.
fn module(run: &RecordedRun) -> Option<PartName> {
    if let Some(chosen) = chosen(run) {
        return Some(chosen.module.clone());
    }
    let mut identities: Vec<&str> = Vec::new();
    if let Some(EventKind::RunStarted { items, .. }) = run.events.first().map(|event| &event.kind) {
        let of_identity = items.iter().filter(|item| item.id == ItemId::Identity);
        identities.extend(of_identity.map(|item| item.name.as_str()));
    }
    let measured = |name: &str| {
        run.events.iter().find_map(|event| match &event.kind {
            EventKind::Measured { item, measurement, .. }
                if measurement.name == name && identities.contains(&&**item) =>
            {
                match &measurement.value {
                    Reading::Text(text) => Some(text.as_str()),
                    _ => None,
                }
            }
            _ => None,
        })
    };
    Some(PartName::new(measured(PART.name)?, Some(measured(HARDWARE.name)?)))
}
