//! Boards whose streams break a rule.

use gnc_protocol::Kind;

use super::breaches::{as_it_is, edits, fails, is};
use super::failed;
use super::rig::{Breach, Wire, check};

#[test]
fn a_code_of_more_than_24_bits() {
    fails(samples(|payload| payload[23] = 0x40), &["stream.codes"]);
}

#[test]
fn readings_that_repeat() {
    // Every sample of a frame is the first one.
    let standing = samples(|payload| {
        let first: [u8; 40] = payload[20..60].try_into().unwrap();
        payload[20..].chunks_mut(40).for_each(|sample| sample.copy_from_slice(&first[..sample.len()]));
    });
    fails(standing, &["stream.repeats"]);
}

#[test]
fn a_load_that_is_rounded_up() {
    fails(
        edits(Kind::Result, 0x20, |payload| {
            if payload.len() == 10 {
                payload[8] += 1;
            }
        }),
        &["stream.load", "calibration.stream"],
    );
}

/// Changes the head of STREAM frames of the IMU.
fn samples(edit: impl Fn(&mut [u8]) + 'static) -> Breach {
    edits(Kind::Stream, 1, edit)
}

#[test]
fn samples_off_the_grid() {
    let drifting = samples(|payload| {
        let first = u32::from_le_bytes(payload[4..8].try_into().unwrap());
        let board_us = u64::from_le_bytes(payload[8..16].try_into().unwrap());
        payload[8..16].copy_from_slice(&(board_us + u64::from(first) / 10).to_le_bytes());
    });
    fails(drifting, &["stream.grid"]);
}

#[test]
fn samples_that_count_from_one() {
    let from_one = samples(|payload| {
        let first = u32::from_le_bytes(payload[4..8].try_into().unwrap());
        payload[4..8].copy_from_slice(&(first + 1).to_le_bytes());
    });
    fails(from_one, &["stream.numbers", "stream.stop"]);
}

#[test]
fn an_account_that_does_not_add_up() {
    let short = edits(Kind::Result, 0x21, |payload| {
        let produced = u32::from_le_bytes(payload[6..10].try_into().unwrap());
        payload[6..10].copy_from_slice(&produced.saturating_sub(1).to_le_bytes());
    });
    let ended = check("", Wire::Rs422, Some("stream"), short).unwrap();
    let expected =
        ["stream.count", "stream.stop", "stream.account", "stream.make-safe", "stream.power-off", "stream.gnss"];
    assert_eq!(failed(&ended), expected);
}

#[test]
fn samples_before_the_result() {
    let mut held = None;
    let early = Breach::to_host(move |frame, _| {
        // The RESULT of StreamStart waits for the first frame.
        if is(&frame, Kind::Result) && frame.header.message == 0x20 && frame.payload[..2] == [0, 0] {
            held = Some(frame);
            return Vec::new();
        }
        let mut passing = as_it_is(&frame);
        if let Some(result) = held.take_if(|_| !is(&frame, Kind::Event)) {
            passing.extend(as_it_is(&result));
        }
        passing
    });
    let ended = check("", Wire::Rs422, Some("stream.result-first"), early).unwrap();
    assert_eq!(failed(&ended), ["stream.result-first"]);
}

#[test]
fn samples_that_are_lost() {
    for id in ["stream.numbers", "stream.account"] {
        let mut frames = 0;
        let lossy = Breach::to_host(move |frame, _| {
            frames += u32::from(is(&frame, Kind::Stream));
            let lost = is(&frame, Kind::Stream) && frames % 3 == 0;
            if lost { Vec::new() } else { as_it_is(&frame) }
        });
        let ended = check("", Wire::Rs422, Some(id), lossy).unwrap();
        assert_eq!(failed(&ended), [id]);
    }
}
