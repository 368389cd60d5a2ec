//! The captures that an item takes over from an earlier run.

use gnc_analysis::capture::Capture;
use gnc_analysis::motion::{MotionStep, program};
use gnc_executive::catalogue::{ItemId, Trace};
use gnc_executive::plan::PlanItem;
use gnc_records::resume::{ResumeError, Resumed, Taken};
use tokio::task::JoinError;

use super::{ProcedureContext, ProcedureError, Recorder};

/// Whether an item takes captures over at all. The module may store other coefficients than those with which it compensated
/// the earlier samples.
fn takes_over(item: ItemId) -> bool {
    !item.feels(Trace::Coefficients)
}

/// Whether an earlier run has all captures of an item, so that the table stands still and the operator has nothing to prepare. Captures
/// that cannot be read are told when the item takes them over.
pub(crate) async fn is_captured(item: &PlanItem, resumed: &Resumed) -> bool {
    let Ok(Some(program)) = program(item.id, &item.params) else { return false };
    if !takes_over(item.id) {
        return false;
    }
    for repeat in 1..=item.repeats {
        let Ok(Ok(Taken { captures, .. })) = read(resumed, &item.name, repeat).await else { return false };
        let mut heads = program.steps.iter().filter_map(MotionStep::about);
        if !heads.all(|about| captures.iter().any(|capture| capture.about == *about)) {
            return false;
        }
    }
    true
}

/// The captures of this round of the item from an earlier run, read in parallel to the conversation with the board.
pub(super) async fn taken(
    bench: &ProcedureContext<'_>,
    recorder: &Recorder<'_>,
) -> Result<Vec<Capture>, ProcedureError> {
    let Some(resumed) = bench.resumed.filter(|_| takes_over(recorder.id())) else { return Ok(Vec::new()) };
    match read(resumed, recorder.item(), recorder.repeat()).await {
        Ok(taken) => {
            let Taken { captures, doubts } = taken?;
            for doubt in doubts {
                recorder.warning(doubt).await?;
            }
            Ok(captures)
        }
        Err(_) => Err(ProcedureError::Analysis {
            why: "the reading of earlier captures stopped unexpectedly, by a fault of this program".into(),
        }),
    }
}

async fn read(resumed: &Resumed, item: &str, repeat: u32) -> Result<Result<Taken, ResumeError>, JoinError> {
    let (resumed, item) = (resumed.clone(), item.to_owned());
    tokio::task::spawn_blocking(move || resumed.captures(&item, repeat)).await
}
