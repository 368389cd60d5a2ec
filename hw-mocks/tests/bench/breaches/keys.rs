//! The keys themselves: mistakes, other keys that break rules, and a bench at maximum speed.

use gnc_protocol::frame::Kind;
use gnc_protocol::message::{
    BoardHello, Identity, IdentityReply, LinkCounters, LinkCountersReply, ModulePower, RamTest, StreamStart,
    StreamStop, TimerMeasure,
};
use gnc_protocol::wire::Wire;

use super::record::{BOTH, Record, ms};
use crate::host::Host;
use crate::personalities::refused;

#[test]
fn every_mistake_says_what_may_stand_there() {
    let board = |keys: &str, expected: &str| refused(&format!("[board]\n{keys}\n"), &[expected]);
    board("accept_after_ms = 20", "2:19: accept_after_ms is 20, and must be 50 to 60000");
    board("accept_late_every = 3", "2:1: accept_late_every changes nothing alone [write accept_after_ms beside it]");
    board("hello_after_ms = 20", "2:18: hello_after_ms is 20, and must be 50 to 60000");
    board("progress_every_ms = 300", "2:21: progress_every_ms is 300 [it may be 0, for never, or 500 to 60000]");
    board("heartbeat_every_ms = 5", "2:22: heartbeat_every_ms is 5 [it may be 0, for never, or 10 to 60000]");
    board("watchdog_ms = -1", "2:15: watchdog_ms is -1, and must be 0 to 60000");
    board("make_safe_after_ms = 200", "2:22: make_safe_after_ms is 200, and must be 250 to 60000");
    board("answers_nobody = \"nak\"", "2:18: answers_nobody cannot be \"nak\" [it may be accept, result]");
    board("header_version = 16", "2:18: header_version is 16, and must be 0 to 15");
    board("sequence_stands_every = 1", "2:25: sequence_stands_every is 1, and must be 2 to 4294967295");
    board("sequence_back_every = 1", "2:23: sequence_back_every is 1, and must be 2 to 4294967295");
    board("stream_request_id = 0", "2:21: stream_request_id is 0, and must be 1 to 65535");
    board("elapsed_us_times = -1", "2:20: elapsed_us_times is -1, and must be 0 to 1000000");
    board("progress_permille = 1000", "2:21: progress_permille is 1000, and must be 1001 to 65535");
    board("result_status = 3", "2:17: result_status is 3, and must be 4 to 65535");
    board("result_status_every = 3", "2:1: result_status_every changes nothing alone [write result_status beside it]");
    board("nak_code = 10", "2:12: nak_code is 10, and must be 11 to 65535");
    board("hello_extra_bytes = 0", "2:21: hello_extra_bytes is 0, and must be 1 to 256");
    board(
        "hello_versions = [1]",
        "2:18: \"hello_versions\" has 1 elements, and must be two whole numbers, the lowest and the highest version",
    );
    board("hello_chosen = 256", "2:16: hello_chosen is 256, and must be 0 to 255");
    board("clock_back_s = 1", "2:1: clock_back_s changes nothing alone [write clock_back_at_s beside it]");
    board("state_bits_set = [8]", "2:19: state_bits_set is 8, and must be 0 to 7");
    board(
        "state_bits_set = [1]\nstate_bits_cleared = [1]",
        "3:22: a bit is both set and cleared [write it into one of the two lists]",
    );
    board("powers_off_after_s = -1", "2:22: powers_off_after_s is -1, and must be 0 to 86400");
    board("supply_uv_times = 1e7", "2:19: supply_uv_times is 1e7, and must be 0 to 1000000");
    board("imu_shift_bits = 9", "2:18: imu_shift_bits is 9, and must be 1 to 8");
    board("ad_channels = \"random\"", "2:15: ad_channels cannot be \"random\" [it may be falling, from-zero]");
    board("extra_words = 65", "2:15: extra_words is 65, and must be 1 to 64");
    board("drops_frame_every = 1", "2:21: drops_frame_every is 1, and must be 2 to 4294967295");
    board("samples_a_frame = 13", "2:19: samples_a_frame is 13, and must be 1 to 12");
    board("repeats = { samples = 200, of = 200 }", "2:23: samples is 200, and must be 1 to 199");
    board("checksum = \"crc16\"", "2:12: checksum cannot be \"crc16\" [it may be big-endian, crc32, not-inverted]");
    board("debug_text = \"x\"", "2:1: debug_text changes nothing alone [write debug_every_ms beside it]");
    board("padding_bytes = 257", "2:17: padding_bytes is 257, and must be 1 to 256");
    board("can_order = \"all\"", "2:13: can_order cannot be \"all\" [it may be samples, messages]");
    board("no_acept = true", "2:1: unknown key \"no_acept\" [did you mean \"no_accept\"?]");
}

/// Texts with a NUL and control characters need no key of their own.
#[test]
fn texts_may_hold_a_nul() {
    let faults = "[board]\nserial = \"SB\\u0000\\u0007\"\n[module]\nserial_number = \"GNC\\u0000\"\n";
    for link in BOTH {
        let mut host = Record::new(faults, link);
        host.hello(7);
        host.run(ms(100));
        host.post(&ModulePower { on: 1 });
        host.run(ms(300));
        let who = host.post(&Identity {});
        host.run(ms(300));
        let hello = BoardHello::from_payload(&host.of(Kind::Hello).next().unwrap().frame.payload).unwrap();
        assert_eq!(hello.serial.as_str(), "SB\0\u{7}");
        let result = host.answers(who).last().unwrap().frame.payload[6..].to_vec();
        assert_eq!(IdentityReply::from_payload(&result).unwrap().serial_number.as_str(), "GNC\0");
    }
}

/// A restart at each power-on needs no key of its own either.
#[test]
fn a_board_restarts_when_the_power_comes_on() {
    for link in BOTH {
        let mut host = Record::new("[reboot]\non = \"power\"\nafter_ms = 50.0\n", link);
        host.hello(7);
        host.run(ms(100));
        let power = host.post(&ModulePower { on: 1 });
        host.run(ms(2000));
        assert_eq!(host.answers(power).len(), 1, "ACCEPT alone");
        let beats = host.beats();
        assert!(beats[0].1.boot_id != beats.last().unwrap().1.boot_id);
    }
}

/// What a board says beside its rules, or keeps to itself, stands in its own count of frames.
#[test]
fn a_board_counts_what_it_really_sent() {
    for link in BOTH {
        for key in ["", "nak_code = 99", "double_result = true", "no_accept = true", "heartbeat_every_ms = 50"] {
            let mut host = Record::new(&format!("[board]\n{key}\n"), link);
            host.run(ms(300));
            host.hello(7);
            host.run(ms(100));
            host.post(&ModulePower { on: 1 });
            host.run(ms(400));
            let counters = host.post(&LinkCounters {});
            host.run(ms(100));
            let result =
                |frame: &gnc_protocol::Frame| frame.header.request == counters && frame.header.kind == Kind::Result;
            let before = host.came.iter().position(|noted| result(&noted.frame)).unwrap();
            let reply = LinkCountersReply::from_payload(&host.came[before].frame.payload[6..]).unwrap();
            // On CAN it counts messages, and heartbeats are none (section 17).
            let raw = |frame: &gnc_protocol::Frame| frame.header.kind == Kind::Event && link == BOTH[1];
            let sent = host.came[..before].iter().filter(|noted| !raw(&noted.frame)).count();
            assert_eq!(reply.sent as usize, sent, "{link:?} {key}");
        }
    }
}

/// Frames that wait for their time keep a bench at maximum speed from running away.
#[test]
fn a_bench_at_maximum_speed_waits_for_late_answers() {
    let keys = [
        "accept_after_ms = 300",
        "progress_every_ms = 900",
        "heartbeat_every_ms = 0",
        "watchdog_ms = 0",
        "no_accept = true",
        "double_result = true",
        "replay_runs_again = true",
        "sequence_back_every = 3",
        "samples_before_result = true",
        "streams_go_on = true",
        "powers_off_after_s = 1000",
        "no_leading_delimiter = true",
        "state_bits_set = [7]",
    ];
    for key in keys {
        let mut host = Host::powered(&format!("[board]\n{key}\n"));
        assert_eq!(host.timed(&TimerMeasure { timer: 0, period_us: 10_000, count: 10 }).1.interrupts, 10);
        assert_eq!(host.ask(&RamTest { ram: 0, pattern: 0 }).mismatches, 0);
        host.ask(&StreamStart { stream: 1, rate_hz: 100, count: 100, samples_per_frame: 0 });
        while host.streamed(1).iter().map(|frame| u32::from(frame.head.count)).sum::<u32>() < 100 {
            host.run_until(|frame| frame.header.kind == Kind::Stream);
        }
        assert_eq!(host.ask(&StreamStop { stream: 1 }).produced, 100, "{key}");
    }
}
