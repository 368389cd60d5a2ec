//! The module sends test frames back: standard and extended ids, 0 to 8 bytes, in order, none lost, none altered.
//!
//! Whose fault is what is missing? The module's where its own controller tells of it, where a frame comes back altered,
//! and where two change places although only one was on its way. All else may be the line, the adapter or this computer.

mod frames;

use std::io;
use std::time::Duration;

use gnc_protocol::can::CanFrame;
use gnc_protocol::message::{CanCounters, CanCountersReply, CanState};
use tokio::time::timeout;

use super::{Bench, Report, Trouble};
use crate::link::NoFrame;
use crate::link::can::{CanLink, Tap};
use frames::{Seen, compare, single_frames, test_frames};

/// Frames under way: the oldest controllers hold 64 bytes, which are four frames, and a host that is late loses a fifth.
const IN_FLIGHT: usize = 4;
/// What is not back by then does not come: a frame takes 0.3 ms each way, an adapter and a busy computer some 20 ms.
const QUIET: Duration = Duration::from_millis(250);
/// Waits in vain after which no more frames are sent: nothing new would be learnt of a bus like this.
const IN_VAIN: usize = 8;

pub(super) async fn run(bench: &Bench<'_>, report: &Report<'_>) -> Result<(), Trouble> {
    if let Some(tap) = bench.board.tap() {
        return measure(bench, tap, report).await;
    }
    let target = bench.can.ok_or(Trouble::CannotRun { item: super::ItemId::Can, why: "it has no CAN link" })?;
    let mut link = CanLink::open(target)?;
    let Some(tap) = link.tap() else { return Ok(()) };
    let measured = tokio::select! {
        biased;
        measured = measure(bench, &tap, report) => measured,
        error = drive(&mut link) => Err(error.into()),
    };
    link.close().await;
    measured
}

/// Moves frames for the tap; what else is on the bus is nobody's here.
async fn drive(link: &mut CanLink) -> io::Error {
    loop {
        match link.next(true).await {
            Err(error) => return error,
            Ok(Err(NoFrame::Away)) => return went_away(&link.name()),
            Ok(_) => {}
        }
    }
}

/// Frames that nobody acknowledges count as errors of the module's controller: nothing of such an exchange is judged.
fn went_away(name: &str) -> io::Error {
    io::Error::new(io::ErrorKind::NotConnected, format!("{name} went away in the middle of the test"))
}

async fn measure(bench: &Bench<'_>, tap: &Tap, report: &Report<'_>) -> Result<(), Trouble> {
    let before = bench.board.call(&CanCounters {}).await?;
    let (lost_before, absences) = (tap.lost_by_host(), tap.absences());
    tap.drain().await;
    let frames = test_frames();
    let Exchanged { sent, returned } = exchange(tap, &frames, IN_FLIGHT).await?;
    let after = bench.board.call(&CanCounters {}).await?;
    let seen = compare(&frames[..sent], &returned);
    let by_host = tap.lost_by_host().zip(lost_before).map(|(after, before)| after.saturating_sub(before));
    let swaps = seen.out_of_order > 0 && swaps_in_single_file(tap, before.received).await?;
    if tap.absences() != absences {
        return Err(went_away("the CAN bus").into());
    }

    report.count("frames_sent", sent as u64).await?;
    report.count("frames_altered", seen.altered).await?;
    report.count("frames_out_of_order", seen.out_of_order + seen.twice).await?;
    report.count("tx_error_counter", after.tx_errors.into()).await?;
    report.count("rx_error_counter", after.rx_errors.into()).await?;
    report.text("bus_off", if after.state == CanState::BusOff as u8 { "yes" } else { "no" }).await?;
    match tap.errors() {
        Some(errors) => report.count("adapter_errors", errors.frames.into()).await?,
        None => report.not_available("adapter_errors", "not available: slcan does not tell of error frames").await?,
    }
    let Seen { lost, out_of_order, twice, .. } = seen;
    if lost + out_of_order + twice > 0 && !swaps && !is_module_at_fault(&seen, &before, &after) {
        let (sent, astray) = (sent as u64, out_of_order + twice);
        let received = after.received.wrapping_sub(before.received);
        return Err(Trouble::FramesLost { sent, lost, astray, received, by_host: by_host.unwrap_or(0) });
    }
    report.count("frames_lost", lost).await
}

/// Frames that are lost, doubled or late while the module's controller knows of nothing say nothing about the module.
fn is_module_at_fault(seen: &Seen, before: &CanCountersReply, after: &CanCountersReply) -> bool {
    let received = after.received.wrapping_sub(before.received);
    let echoed = after.echoed.wrapping_sub(before.echoed);
    seen.altered > 0
        || after.tx_errors > 0
        || after.rx_errors > 0
        || after.state != CanState::ErrorActive as u8
        || received != echoed
}

/// Whether frames change places although the next one is sent only when the last one is back, or does not come: then
/// the module kept it back. An adapter or a driver that lets one frame pass another does so for milliseconds.
async fn swaps_in_single_file(tap: &Tap, mark: u32) -> io::Result<bool> {
    let frames = single_frames(mark);
    let Exchanged { sent, mut returned } = exchange(tap, &frames, 1).await?;
    returned.retain(|frame| frame.data().starts_with(&mark.to_le_bytes()));
    Ok(compare(&frames[..sent], &returned).out_of_order > 0)
}

/// How far a set of frames came.
struct Exchanged {
    /// Frames sent.
    sent: usize,
    returned: Vec<CanFrame>,
}

/// Sends frames, so many at a time, and gives what came back.
async fn exchange(tap: &Tap, frames: &[CanFrame], in_flight: usize) -> io::Result<Exchanged> {
    let mut returned = Vec::with_capacity(frames.len());
    let (mut sent, mut given_up, mut in_vain) = (0, 0, 0);
    while sent < frames.len() && in_vain < IN_VAIN {
        tap.send(frames[sent]).await?;
        sent += 1;
        while sent >= returned.len() + given_up + in_flight {
            match timeout(QUIET, tap.receive()).await {
                Ok(frame) => {
                    returned.push(frame?);
                    in_vain = 0;
                }
                // All of them are lost: the next ones must not wait for them too.
                Err(_) => {
                    given_up = sent - returned.len();
                    in_vain += 1;
                }
            }
        }
    }
    while returned.len() < sent
        && let Ok(frame) = timeout(QUIET, tap.receive()).await
    {
        returned.push(frame?);
    }
    Ok(Exchanged { sent, returned })
}
