//! The module sends test frames back: standard and extended ids, 0 to 8 bytes, in order, none lost, none altered.

use std::io;
use std::time::Duration;

use gnc_protocol::can::id::{ECHO_EXTENDED, ECHO_STANDARD, echo_of};
use gnc_protocol::can::{CanFrame, CanId};
use gnc_protocol::message::{CanCounters, CanCountersReply, CanState};
use gnc_protocol::pattern::Xorshift32;
use tokio::time::timeout;

use super::{Bench, Report, Trouble};
use crate::link::can::{CanLink, Tap};

/// Times that the whole set is sent.
const ROUNDS: u32 = 3;
/// Frames under way: fewer than any mailbox or buffer on the way holds.
const IN_FLIGHT: usize = 8;
/// What is not back by then does not come: a frame takes 0.3 ms each way, an adapter and a busy computer some 20 ms.
const QUIET: Duration = Duration::from_millis(250);

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
        if let Err(error) = link.next(true).await {
            return error;
        }
    }
}

async fn measure(bench: &Bench<'_>, tap: &Tap, report: &Report<'_>) -> Result<(), Trouble> {
    let before = bench.board.call(&CanCounters {}).await?;
    tap.drain().await;
    let sent = test_frames();
    let returned = exchange(tap, &sent).await?;
    let after = bench.board.call(&CanCounters {}).await?;
    let seen = compare(&sent, &returned);

    report.count("frames_sent", sent.len() as u64).await?;
    report.count("frames_altered", seen.altered).await?;
    report.count("frames_out_of_order", seen.out_of_order).await?;
    report.count("tx_error_counter", after.tx_errors.into()).await?;
    report.count("rx_error_counter", after.rx_errors.into()).await?;
    report.text("bus_off", if after.state == CanState::BusOff as u8 { "yes" } else { "no" }).await?;
    match tap.errors() {
        Some(errors) => report.count("adapter_errors", errors.frames.into()).await?,
        None => report.not_available("adapter_errors", "not available: slcan does not tell of error frames").await?,
    }
    if seen.lost > 0 && !is_module_at_fault(&seen, &before, &after) {
        let received = after.received.wrapping_sub(before.received);
        return Err(Trouble::FramesLost { sent: sent.len() as u64, lost: seen.lost, received });
    }
    report.count("frames_lost", seen.lost).await
}

/// Frames that are lost while the module's controller knows of nothing say nothing about the module.
fn is_module_at_fault(seen: &Seen, before: &CanCountersReply, after: &CanCountersReply) -> bool {
    let swallowed =
        after.received.wrapping_sub(before.received).saturating_sub(after.echoed.wrapping_sub(before.echoed));
    seen.altered + seen.out_of_order > 0
        || after.tx_errors > 0
        || after.rx_errors > 0
        || after.state != CanState::ErrorActive as u8
        || swallowed > 0
}

/// Both kinds of ids with every length and four fillings; no two frames of a round are alike.
fn test_frames() -> Vec<CanFrame> {
    let mut mixed = Xorshift32::new(1);
    let mut frames = Vec::new();
    for number in (0..ROUNDS).flat_map(|_| 0..72_u32) {
        let (extended, length, filling) = (number >= 36, number % 36 / 4, number % 4);
        let id = if extended {
            // A step that is prime to the number of ids, so that all their bits change.
            CanId::Extended(ECHO_EXTENDED + number * 1021 % 0x1_0000)
        } else {
            CanId::Standard(ECHO_STANDARD + number as u16 % 16)
        };
        let byte = |at: u32| match filling {
            0 => 0x00,
            1 => 0xff,
            2 if at.is_multiple_of(2) => 0x55,
            2 => 0xaa,
            _ => mixed.next().unwrap_or_default() as u8,
        };
        let data: Vec<u8> = (0..length).map(byte).collect();
        frames.extend(CanFrame::new(id, &data));
    }
    frames
}

/// Sends frames, a few at a time, and gives what came back.
async fn exchange(tap: &Tap, frames: &[CanFrame]) -> io::Result<Vec<CanFrame>> {
    let mut returned = Vec::with_capacity(frames.len());
    let mut given_up = 0;
    for (sent, frame) in frames.iter().enumerate() {
        tap.send(*frame).await?;
        while sent + 1 >= returned.len() + given_up + IN_FLIGHT {
            match timeout(QUIET, tap.receive()).await {
                Ok(frame) => returned.push(frame?),
                // All of them are lost: the next ones must not wait for them too.
                Err(_) => given_up = sent + 1 - returned.len(),
            }
        }
    }
    while returned.len() < frames.len()
        && let Ok(frame) = timeout(QUIET, tap.receive()).await
    {
        returned.push(frame?);
    }
    Ok(returned)
}

#[derive(Debug, Default, PartialEq, Eq)]
struct Seen {
    lost: u64,
    altered: u64,
    out_of_order: u64,
}

/// What happened to the frames on their way.
fn compare(sent: &[CanFrame], returned: &[CanFrame]) -> Seen {
    let expected = |frame: &CanFrame| echo_of(frame.id()).and_then(|id| CanFrame::new(id, frame.data()));
    let expected: Vec<Option<CanFrame>> = sent.iter().map(expected).collect();
    let mut open: Vec<usize> = (0..expected.len()).collect();
    let mut seen = Seen::default();
    let mut latest = 0;
    for frame in returned {
        let alike = |wanted: &CanFrame| wanted.id() == frame.id() && wanted.data().len() == frame.data().len();
        let find =
            |fits: &dyn Fn(&CanFrame) -> bool| open.iter().position(|at| expected[*at].as_ref().is_some_and(fits));
        // Rounds repeat frames, so that the first that fits is meant.
        if let Some(place) = find(&|wanted| wanted == frame) {
            let at = open.remove(place);
            seen.out_of_order += u64::from(at < latest);
            latest = latest.max(at);
        } else if let Some(place) = find(&alike) {
            open.remove(place);
            seen.altered += 1;
        } else if expected.contains(&Some(*frame)) {
            // It came twice.
            seen.out_of_order += 1;
        } else {
            seen.altered += 1;
        }
    }
    seen.lost = open.len() as u64;
    seen
}

#[cfg(test)]
mod tests {
    use super::*;

    fn echoes() -> Vec<CanFrame> {
        test_frames().iter().map(|frame| CanFrame::new(echo_of(frame.id()).unwrap(), frame.data()).unwrap()).collect()
    }

    fn check(returned: &[CanFrame], lost: u64, altered: u64, out_of_order: u64) {
        assert_eq!(compare(&test_frames(), returned), Seen { lost, altered, out_of_order });
    }

    #[test]
    fn every_length_and_both_kinds_of_ids_are_sent() {
        let frames = test_frames();
        for extended in [false, true] {
            for length in 0..=8 {
                let fits = |frame: &&CanFrame| {
                    matches!(frame.id(), CanId::Extended(_)) == extended && frame.data().len() == length
                };
                assert_eq!(frames.iter().filter(fits).count(), 12, "extended {extended}, {length} bytes");
            }
        }
        let distinct: std::collections::HashSet<_> = frames[..72].iter().collect();
        assert_eq!(distinct.len(), 72);
    }

    #[test]
    fn what_happened_on_the_way_is_told_apart() {
        let good = echoes();
        check(&good, 0, 0, 0);
        check(&good[..200], 16, 0, 0);
        let mut swapped = good.clone();
        swapped.swap(50, 51);
        check(&swapped, 0, 0, 1);
        let mut altered = good.clone();
        let mut data = [0; 8];
        data.copy_from_slice(altered[35].data());
        data[3] ^= 0x10;
        altered[35] = CanFrame::new(altered[35].id(), &data).unwrap();
        check(&altered, 0, 1, 0);
        let mut twice = good.clone();
        twice.push(good[215]);
        check(&twice, 0, 0, 1);
        let mut foreign = good;
        foreign.push(CanFrame::new(CanId::Standard(0x71f), &[1, 2, 3]).unwrap());
        check(&foreign, 0, 1, 0);
    }
}
