//! Frames of a CAN bus under any id and at any time: both ends of the link take them, and what they say goes to the other
//! end, damaged or not.

#![no_main]

use std::time::Duration;

use gnc_protocol::can::endpoint::{Endpoint, EndpointRole};
use gnc_protocol::can::isotp::{MAX_PDU, IsoTpReceived, IsoTpReceiver, IsoTpSender};
use gnc_protocol::can::{CanFrame, CanId};
use libfuzzer_sys::fuzz_target;

/// Link time passes in steps of this.
const STEP: Duration = Duration::from_millis(7);
/// Turns in which two ends of a link have said all that they can say of one PDU with the least of blocks.
const TURNS: usize = 3 * MAX_PDU / 7;

fuzz_target!(|script: (Vec<(u16, u8, Vec<u8>)>, &[u8])| {
    let (frames, pdu) = script;
    hostile(&frames);
    whole(pdu, &frames);
});

/// Whatever comes, no end stalls or says more than it was given.
fn hostile(frames: &[(u16, u8, Vec<u8>)]) {
    let mut now = Duration::ZERO;
    let mut ends = [Endpoint::new(EndpointRole::Host), Endpoint::new(EndpointRole::Board)];
    let mut receiver = IsoTpReceiver::<MAX_PDU>::default();
    for (id, wait, data) in frames {
        now += STEP * u32::from(*wait);
        let data = &data[..data.len().min(8)];
        if receiver.receive(data, now) == IsoTpReceived::Complete {
            assert!((1..=MAX_PDU).contains(&receiver.pdu().len()));
        }
        let _ = receiver.expire(now);
        let Some(frame) = CanFrame::new(CanId::Standard(id & CanId::MAX_STANDARD), data) else { continue };
        for end in &mut ends {
            if let Some(Ok(frame)) = end.receive(&frame, now) {
                end.send(&frame, &mut |_| {});
            }
            while end.poll(now).is_some() {}
        }
    }
}

/// A PDU arrives as it was, or not at all, whatever else is said meanwhile.
fn whole(pdu: &[u8], frames: &[(u16, u8, Vec<u8>)]) {
    let mut sender = IsoTpSender::<MAX_PDU>::default();
    if sender.start(pdu).is_err() {
        return;
    }
    let mut receiver = IsoTpReceiver::<MAX_PDU>::default();
    let mut now = Duration::ZERO;
    let mut flows = frames.iter();
    for _ in 0..TURNS {
        let Some(data) = sender.poll(now) else {
            if sender.is_idle() {
                break;
            }
            // A strange flow control now and then; then the receiver's own, which lets it go on.
            match flows.next() {
                Some((_, _, data)) => drop(sender.flow(&data[..data.len().min(8)], now)),
                None => drop(sender.flow(&[0x30, 0, 0], now)),
            }
            now += STEP;
            let _ = sender.expire(now);
            continue;
        };
        if receiver.receive(&data, now) == IsoTpReceived::Complete {
            assert_eq!(receiver.pdu(), pdu);
            return;
        }
    }
}
