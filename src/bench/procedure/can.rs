//! The module sends test frames back: standard and extended ids, 0 to 8 bytes, in order, without a lost or altered
//! frame.

mod exchange;
mod frames;
mod ledger;
#[cfg(test)]
mod tests;
mod verdict;

use std::hash::{BuildHasher as _, RandomState};
use std::io;

use gnc_executive::catalogue::ports::{
    ADAPTER_ERRORS, BUS_OFF, FRAMES_ALTERED, FRAMES_LOST, FRAMES_OUT_OF_ORDER, FRAMES_SENT, RX_ERROR_COUNTER,
    TX_ERROR_COUNTER,
};
use gnc_link::NoFrame;
use gnc_link::can::{CanLink, Tap};
use gnc_protocol::message::{CanCounters, CanState};

use super::{ProcedureContext, ProcedureError, Recorder};
use exchange::observe;
use frames::Mark;

pub(super) async fn run(bench: &ProcedureContext<'_>, recorder: &Recorder<'_>) -> Result<(), ProcedureError> {
    if let Some(tap) = bench.board.tap() {
        return measure(bench, tap, recorder).await;
    }
    let target = bench.can.ok_or(ProcedureError::CannotRun { item: super::ItemId::Can, why: "it has no CAN link" })?;
    let mut link = CanLink::open(target)?;
    if let Some(doubt) = link.doubt().filter(|_| bench.is_real) {
        let text = format!("{doubt}; that was not so when the run began");
        return Err(io::Error::other(text).into());
    }
    let Some(tap) = link.tap() else { return Ok(()) };
    let measured = tokio::select! {
        biased;
        measured = measure(bench, &tap, recorder) => measured,
        error = drive(&mut link) => Err(error.into()),
    };
    link.close().await;
    measured
}

/// Moves frames for the tap and drops everything else on the bus.
async fn drive(link: &mut CanLink) -> io::Error {
    loop {
        match link.next(true).await {
            Err(error) => return error,
            Ok(Err(NoFrame::Away)) => return went_away(&link.name()),
            Ok(_) => {}
        }
    }
}

/// An exchange in which the bus went away is not judged: frames without an acknowledging node count as errors of the
/// module's controller.
fn went_away(name: &str) -> io::Error {
    io::Error::new(io::ErrorKind::NotConnected, format!("{name} went away in the middle of the test"))
}

async fn measure(bench: &ProcedureContext<'_>, tap: &Tap, recorder: &Recorder<'_>) -> Result<(), ProcedureError> {
    let (lost_before, absences) = (tap.lost_by_host(), tap.absences());
    // Draw a new mark each time, so that late frames of another exchange are recognised.
    let mark = Mark(RandomState::new().hash_one(()) as u32);
    let observed =
        observe(tap, mark, async || Ok::<_, ProcedureError>(bench.board.call(&CanCounters {}).await?)).await?;
    let by_host = tap.lost_by_host().zip(lost_before).map_or(0, |(after, before)| after.saturating_sub(before));
    if tap.absences() != absences {
        return Err(went_away("the CAN bus").into());
    }

    let (seen, after) = (&observed.seen, &observed.after);
    recorder.count(&FRAMES_SENT, seen.sent).await?;
    recorder.count(&FRAMES_ALTERED, seen.altered + observed.alone.altered).await?;
    recorder.count(&FRAMES_OUT_OF_ORDER, seen.out_of_order + seen.twice).await?;
    recorder.count(&TX_ERROR_COUNTER, after.tx_errors.into()).await?;
    recorder.count(&RX_ERROR_COUNTER, after.rx_errors.into()).await?;
    recorder.text(&BUS_OFF, if after.state == CanState::BusOff as u8 { "yes" } else { "no" }).await?;
    match tap.errors() {
        Some(errors) => recorder.count(&ADAPTER_ERRORS, errors.frames.into()).await?,
        None => recorder.not_available(&ADAPTER_ERRORS, "not available: slcan does not report error frames").await?,
    }
    if !observed.is_module_at_fault(by_host)
        && let Some(doubt) = observed.doubt(by_host)
    {
        return Err(doubt);
    }
    if seen.lost > 0 && observed.is_busy() {
        let why = "not available: the bus was full of other frames, and test frames may still be on their way";
        return Ok(recorder.not_available(&FRAMES_LOST, why).await?);
    }
    Ok(recorder.count(&FRAMES_LOST, seen.lost).await?)
}
