//! Boards that break a rule fail the check of that rule.

use std::time::Duration;

use gnc_conformance::Outcome;
use gnc_protocol::message::{ModulePower, event};
use gnc_protocol::serial::encode;
use gnc_protocol::{Call as _, Frame, Kind};
use hw_mocks::Personality;

use super::rig::{Breach, Wire, check, checked};
use super::{failed, show};

/// Checks a board that breaks a rule: exactly these checks fail.
#[track_caller]
pub(super) fn fails(breach: Breach, expected: &[&str]) {
    fails_on(Wire::Rs422, breach, expected);
}

#[track_caller]
pub(super) fn fails_on(wire: Wire, breach: Breach, expected: &[&str]) {
    let ended = check("", wire, None, breach).unwrap();
    let came = failed(&ended);
    if came != expected {
        show(&ended);
    }
    assert_eq!(came, expected);
}

/// Changes bytes of the payload, of frames of a kind and message.
pub(super) fn edits(kind: Kind, message: u16, edit: impl Fn(&mut [u8]) + 'static) -> Breach {
    Breach::of_frames(move |frame: &mut Frame| {
        if (frame.header.kind, frame.header.message) == (kind, message) {
            edit(&mut frame.payload);
        }
    })
}

pub(super) fn is(frame: &Frame, kind: Kind) -> bool {
    frame.header.kind == kind
}

pub(super) fn as_it_is(frame: &Frame) -> Vec<(Duration, Vec<u8>)> {
    vec![(Duration::ZERO, encode(frame).to_vec())]
}

#[test]
fn late_answers() {
    let late = Breach::to_host(|frame, _| vec![(Duration::from_millis(90), encode(&frame).to_vec())]);
    fails(late, &["hello.time", "request.accept-time", "request.nak-time", "stream.answers-first"]);
}

#[test]
fn hello_with_another_nonce() {
    fails(edits(Kind::Hello, 0, |payload| payload[7] ^= 1), &["hello.nonce"]);
}

#[test]
fn hello_with_another_boot_id_than_the_heartbeats() {
    fails(edits(Kind::Event, event::HEARTBEAT, |payload| payload[0] ^= 1), &["hello.boot-id"]);
}

#[test]
fn hello_with_a_byte_at_its_end() {
    let long = Breach::of_frames(|frame| {
        if is(frame, Kind::Hello) {
            frame.payload.push(0).unwrap();
        }
    });
    fails(long, &["hello.layout"]);
}

#[test]
fn hello_with_another_request_id() {
    let zero = Breach::of_frames(|frame| {
        if is(frame, Kind::Hello) {
            frame.header.request = 0;
        }
    });
    fails(zero, &["hello.request-id"]);
}

/// A module that draws too much is not switched on again and again.
#[test]
fn a_module_that_cannot_be_switched_on() {
    let mut tries = 0;
    let over = Breach::of_frames(move |frame| {
        if is(frame, Kind::Result) && frame.header.message == ModulePower::ID {
            tries += 1;
            assert!(tries <= 4, "it was switched on {tries} times");
            let text = b"over current: 2.1 A, switched off";
            frame.payload.clear();
            frame.payload.extend_from_slice(&[3, 0, 0, 0, 0, 0, text.len() as u8]).unwrap();
            frame.payload.extend_from_slice(text).unwrap();
        }
    });
    let ended = check("", Wire::Rs422, None, over).unwrap();
    let on = ended.findings.iter().find(|finding| finding.demand.id == "power.on").unwrap();
    let expected =
        "ModulePower was answered by RESULT with status 3 (over current: 2.1 A, switched off) instead of status 0";
    assert_eq!((on.outcome, on.measured.as_str()), (Outcome::Failed, expected));
    let passed = ended.findings.iter().filter(|finding| finding.outcome == Outcome::Passed).count();
    assert!(passed > 50, "{passed} checks need no power");
}

#[test]
fn hello_with_the_version_in_force() {
    let versioned = Breach::of_frames(|frame| {
        if is(frame, Kind::Hello) {
            frame.header.version = 1;
        }
    });
    fails(versioned, &["header.hello"]);
}

#[test]
fn a_sequence_that_stands() {
    fails(Breach::of_frames(|frame| frame.header.sequence = 7), &["header.sequence"]);
}

#[test]
fn a_flag_without_a_meaning() {
    fails(Breach::of_frames(|frame| frame.header.flags.0 |= 0x80), &["header.hello", "header.flags"]);
}

#[test]
fn a_heartbeat_with_a_request_id() {
    let numbered = Breach::of_frames(|frame| {
        if is(frame, Kind::Event) {
            frame.header.request = 5;
        }
    });
    fails(numbered, &["header.event"]);
}

#[test]
fn frames_of_another_version() {
    let newer = Breach::of_frames(|frame| {
        if is(frame, Kind::Accept) {
            frame.header.version = 2;
        }
    });
    fails(newer, &["header.version"]);
}

#[test]
fn capabilities_without_a_meaning() {
    fails(edits(Kind::Hello, 0, |payload| payload[18] |= 0x80), &["hello.capabilities"]);
}

#[test]
fn arithmetic_that_flushes_subnormal_numbers() {
    let flushed = edits(Kind::Result, 0x13, |payload| {
        for value in payload[8..].chunks_exact_mut(8) {
            let number = f64::from_le_bytes((&*value).try_into().unwrap());
            if number.is_subnormal() {
                value.copy_from_slice(&0f64.to_le_bytes());
            }
        }
    });
    fails(flushed, &["cpu.floats"]);
}

#[test]
fn channels_in_falling_order() {
    let falling = edits(Kind::Result, 0x1B, |payload| {
        let mut channels: Vec<Vec<u8>> = payload[8..].chunks(13).map(<[u8]>::to_vec).collect();
        channels.reverse();
        payload[8..].copy_from_slice(&channels.concat());
    });
    fails(falling, &["ad.channels"]);
}

#[test]
fn no_leading_delimiter() {
    let bare = Breach::to_host(|frame, _| vec![(Duration::ZERO, encode(&frame)[1..].to_vec())]);
    fails(bare, &["frames.delimiters"]);
}

#[test]
fn debug_text_between_frames() {
    let chatty = Breach::to_host(|frame, _| {
        let text = if is(&frame, Kind::Accept) { &b"request\r\n"[..] } else { b"" };
        vec![(Duration::ZERO, [text, &encode(&frame)].concat())]
    });
    fails(chatty, &["frames.delimiters", "frames.clean"]);
}

#[test]
fn no_progress() {
    let quiet = Breach::to_host(|frame, _| if is(&frame, Kind::Progress) { Vec::new() } else { as_it_is(&frame) });
    let ended = check("", Wire::Rs422, Some("request"), quiet).unwrap();
    show(&ended);
    // Without PROGRESS, a request of two seconds is lost after 1.5.
    assert_eq!(failed(&ended), ["request.progress", "request.progress-fields"]);
}

#[test]
fn progress_that_falls() {
    let mut permille = 900_u16;
    let falling = Breach::of_frames(move |frame| {
        if is(frame, Kind::Progress) {
            permille -= 1;
            frame.payload[..2].copy_from_slice(&permille.to_le_bytes());
        }
    });
    fails(falling, &["request.progress-fields"]);
}

#[test]
fn elapsed_in_milliseconds() {
    let in_ms = Breach::of_frames(|frame| {
        if is(frame, Kind::Result) && frame.payload[..2] == [0, 0] {
            let elapsed_us = u32::from_le_bytes(frame.payload[2..6].try_into().unwrap());
            frame.payload[2..6].copy_from_slice(&(elapsed_us / 1000).to_le_bytes());
        }
    });
    fails(in_ms, &["request.elapsed", "timer", "flash.pattern"]);
}

#[test]
fn a_second_result() {
    let twice = Breach::to_host(|frame, _| {
        let mut frames = as_it_is(&frame);
        if is(&frame, Kind::Result) {
            frames.extend(as_it_is(&frame));
        }
        frames
    });
    let ended = check("", Wire::Rs422, Some("7"), twice).unwrap();
    show(&ended);
    // The second one of a request that ended is taken for the answer to the same request sent again.
    let expected = [
        "request.once",
        "request.nothing-after-result",
        "replay.same",
        "replay.payload",
        "request.second-copy",
        "abort.running",
        "make-safe.running",
    ];
    assert_eq!(failed(&ended), expected);
}

#[test]
fn replay_without_its_flag() {
    let flagless = Breach::of_frames(|frame| frame.header.flags.0 = 0);
    let ended = check("", Wire::Rs422, Some("replay"), flagless).unwrap();
    let expected = ["replay.same", "replay.eight", "replay.payload", "replay.other-message"];
    assert_eq!(failed(&ended), expected);
}

#[test]
fn a_module_that_is_never_said_to_be_powered() {
    fails(edits(Kind::Event, event::HEARTBEAT, |payload| payload[12] &= !2), &["heartbeat.powered"]);
}

#[test]
fn a_clock_that_runs_too_fast() {
    let fast = edits(Kind::Event, event::HEARTBEAT, |payload| {
        let board_us = u64::from_le_bytes(payload[4..12].try_into().unwrap());
        payload[4..12].copy_from_slice(&(board_us * 102 / 100).to_le_bytes());
    });
    fails(fast, &["heartbeat.clock"]);
}

#[test]
fn heartbeats_that_come_late() {
    let late = Breach::to_host(|frame, now| {
        // Each is held back by up to half a second, and the next comes in its time.
        let odd = is(&frame, Kind::Event) && frame.header.message == event::HEARTBEAT && now.as_secs() % 2 == 1;
        vec![(if odd { Duration::from_millis(250) } else { Duration::ZERO }, encode(&frame).to_vec())]
    });
    let ended = check("", Wire::Rs422, Some("heartbeat"), late).unwrap();
    assert_eq!(failed(&ended), ["heartbeat.period", "heartbeat.clock"]);
}

/// The board hears a keep-alive that nobody sent.
#[test]
fn a_watchdog_that_never_fires() {
    let mut last = Duration::ZERO;
    let keeps = Breach::to_board(move |frame, now| {
        let mut passing = as_it_is(&frame);
        if now > last {
            // Whatever the host sends keeps the watchdog quiet for ten seconds.
            last = now + Duration::from_secs(2);
            for second in 1..20 {
                let mut keep_alive = frame.clone();
                keep_alive.header.kind = Kind::Event;
                keep_alive.header.version = 1;
                keep_alive.header.message = event::KEEP_ALIVE;
                keep_alive.payload.clear();
                passing.push((Duration::from_millis(500 * second), encode(&keep_alive).to_vec()));
            }
        }
        passing
    });
    let ended = check("", Wire::Rs422, Some("watchdog"), keeps).unwrap();
    show(&ended);
    let expected = ["watchdog.fires", "watchdog.once", "watchdog.safe", "watchdog.fed", "watchdog.not-fed"];
    assert_eq!(failed(&ended), expected);
}

#[test]
fn a_board_that_hears_no_keep_alive() {
    let deaf = Breach::to_board(|frame, _| {
        let keep_alive = is(&frame, Kind::Event) && frame.header.message == event::KEEP_ALIVE;
        if keep_alive { Vec::new() } else { as_it_is(&frame) }
    });
    let ended = check("", Wire::Rs422, Some("watchdog"), deaf).unwrap();
    assert_eq!(failed(&ended), ["watchdog.fed"]);
    let said = ended.findings.iter().find(|finding| finding.demand.id == "watchdog.fed").unwrap();
    assert!(said.measured.contains("a keep-alive did not feed the watchdog"), "{}", said.measured);
}

#[test]
fn a_refusal_with_another_code() {
    let coded = Breach::of_frames(|frame| {
        if is(frame, Kind::Nak) && frame.payload[0] == 4 {
            frame.payload[0] = 3;
        }
    });
    let expected = [
        "request.other-message",
        "range.fields",
        "range.streams",
        "range.calibration",
        "calibration.unwritten",
        "calibration.commit",
        "nak.running-id-first",
    ];
    fails(coded, &expected);
}

#[test]
fn a_supply_in_millivolts() {
    fails(
        edits(Kind::Result, 3, |payload| {
            if payload.len() == 14 {
                let supply_uv = u32::from_le_bytes(payload[6..10].try_into().unwrap());
                payload[6..10].copy_from_slice(&(supply_uv / 1000).to_le_bytes());
            }
        }),
        &["power.on"],
    );
}

#[test]
fn a_board_that_dies_in_the_middle() {
    let dies = Breach::to_host(|frame, now| if now.as_secs() >= 20 { Vec::new() } else { as_it_is(&frame) });
    let (ended, took) = checked(Personality::good(), Wire::Rs422, None, dies);
    let ended = ended.unwrap();
    show(&ended);
    let died = ended.findings.iter().position(|finding| finding.measured.contains("fell silent")).unwrap();
    let rest = &ended.findings[died..];
    assert!(rest.iter().all(|finding| finding.outcome != Outcome::Passed));
    assert!(rest.len() > 50 && !failed(&ended).is_empty());
    assert!(!ended.safe, "nobody said that the board is safe");
    assert!(took < Duration::from_secs(45), "{took:?}");
}

#[test]
fn a_board_that_is_deaf_to_hello() {
    let deaf = Breach::to_board(|frame, _| if is(&frame, Kind::Hello) { Vec::new() } else { as_it_is(&frame) });
    let (ended, took) = checked(Personality::good(), Wire::Rs422, None, deaf);
    let ended = ended.unwrap();
    let passed: Vec<&str> = ended
        .findings
        .iter()
        .filter(|finding| finding.outcome == Outcome::Passed)
        .map(|finding| finding.demand.id)
        .collect();
    assert_eq!(passed, ["frames.checksum", "heartbeat.layout", "heartbeat.period", "heartbeat.never-back"]);
    assert_eq!(failed(&ended), ["hello.layout"]);
    assert!(took < Duration::from_secs(30), "{took:?}");
}

#[test]
fn no_heartbeats() {
    let mute = Breach::to_host(|frame, _| {
        let beat = is(&frame, Kind::Event) && frame.header.message == event::HEARTBEAT;
        if beat { Vec::new() } else { as_it_is(&frame) }
    });
    let ended = check("", Wire::Rs422, None, mute).unwrap();
    show(&ended);
    let others = failed(&ended).into_iter().filter(|id| !id.starts_with("heartbeat."));
    // Its numbers have gaps, and the state after a watchdog and after MAKE_SAFE stands in heartbeats alone.
    assert_eq!(others.collect::<Vec<_>>(), ["header.sequence", "watchdog.safe", "make-safe.state"]);
}

#[test]
fn another_checksum() {
    let spoilt = Breach::to_host(|frame, _| {
        let mut bytes = encode(&frame).to_vec();
        let last = bytes.len() - 2;
        bytes[last] = bytes[last].wrapping_add(1).max(1);
        vec![(Duration::ZERO, bytes)]
    });
    let (ended, took) = checked(Personality::good(), Wire::Rs422, None, spoilt);
    let ended = ended.unwrap();
    let said = ended.findings.iter().find(|finding| finding.demand.id == "frames.checksum").unwrap();
    assert!(said.measured.contains("wrong checksum"), "{}", said.measured);
    assert!(took < Duration::from_secs(30), "{took:?}");
}

#[test]
fn a_status_without_a_meaning() {
    fails(edits(Kind::Result, 0x1E, |payload| payload[0] = 9), &["sci", "status.known"]);
}
