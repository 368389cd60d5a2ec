//! How the board of a personality breaks the interface document: keys of `[board]`, each of which breaks one rule.
//!
//! Without a key the board keeps the rule. A key stands for both links where both have the rule. Other rules break
//! without a key of their own here:
//!
//! - a NUL in a text: write `\u0000` into `serial` of `[board]` or of `[module]`;
//! - a restart when the power comes on: `[reboot]` with `on = "power"`;
//! - samples off the grid of the board's clock: `[sampling]`.
//!
//! ```
//! # let text = r#"
//! [board]
//! ## Times. They are link time. 0 is never.
//! accept_after_ms = 80.0               # ACCEPT and NAK: more than the 50 ms of the document
//! accept_late_every = 3                # one of so many; without it all
//! hello_after_ms = 80.0
//! progress_every_ms = 900.0            # 0, or more than the 500 ms of the document
//! heartbeat_every_ms = 1500.0
//! lost_first_heartbeats = 2            # after each start of the board
//! watchdog_ms = 800.0                  # of silence of the host
//! make_safe_after_ms = 400.0           # the module has power as long: more than the 250 ms of the document
//!
//! ## The conversation.
//! no_accept = true
//! answers_nobody = "result"            # or "accept": one more goes before each, under an id of no request
//! swaps_request_ids = true             # of the RESULTs of two requests that run
//! wrong_message_id = true              # in RESULT: the next one; not of MAKE_SAFE and ABORT
//! header_version = 2                   # in all frames but HELLO
//! sequence_stands_every = 20           # frames: the number of the one before comes again
//! sequence_back_every = 20             # frames: the numbers go back by 10
//! stream_request_id = 7                # RS-422
//! double_result = true
//! elapsed_us_times = 100.0
//! progress_permille = 1100             # more than 1000
//! progress_after_result = true
//! result_status = 77                   # of all RESULTs, whatever they were; 4 and more mean nothing
//! result_status_every = 5              # of one of so many
//! nak_code = 99                        # of all NAKs; 11 and more mean nothing
//! replay_runs_again = true             # a request that comes again after its RESULT
//! replay_without_flag = true
//!
//! ## HELLO.
//! wrong_nonce = true
//! other_boot_id_in_hello = true        # than in the heartbeat
//! hello_extra_bytes = 1                # behind the last field
//! hello_versions = [2, 1]              # the lowest and the highest that the board tells; it speaks 1
//! hello_chosen = 2                     # the version that the board says is in force; it speaks 1
//! deaf_to_hello = true
//! ## Not breaches but other boards that the document knows: they clear their bit and answer NAK 9.
//! no_power_switch = true               # the module always has power
//! no_can = true
//! no_calibration = true
//!
//! ## Restarts and the clock.
//! keeps_boot_id = true
//! clock_runs_on = true                 # over a restart
//! clock_back_at_s = 5.0                # of board time, after each start ...
//! clock_back_s = 2.0                   # ... it goes back by so much
//!
//! ## State and power.
//! state_bits_set = [1]                 # bits that the heartbeat always has: it says that the module has power
//! state_bits_cleared = [0, 3]          # bits that it never has: no session, no streams
//! safe_keeps_power = true              # MAKE_SAFE, the watchdog and a new session leave the module's supply on
//! powers_off_after_s = 30.0            # after each power-on, by itself
//! over_current_at_power_on = true      # the board switches off again, status 3, error record of kind 9
//!
//! ## Values.
//! supply_uv_times = 1000.0
//! supply_ua_times = 0.001
//! timer_intervals_times = 0.1          # their sum is not elapsed_us
//! flash_durations_times = 1000.0
//! pps_times = 0.001
//! imu_shift_bits = 8                   # codes lie in the upper 24 bits; on CAN they are cut off at the ends
//! ad_channels = "falling"              # or "from-zero"
//! extra_words = 1                      # of CpuWords
//!
//! ## Streams.
//! stream_numbers_from = 1
//! produced_off = -3                    # in the account of StreamStop
//! drops_frame_every = 10               # stream frames (on CAN samples): it is lost on the board and not counted
//! stream_time_times = 0.001            # board_time_us of frames
//! streams_go_on = true                 # after StreamStop
//! samples_before_result = true         # of StreamStart
//! samples_a_frame = 3                  # RS-422: whatever was asked for
//! extra_samples = 5                    # beyond the count asked for
//! repeats = { samples = 50, of = 200 } # the last ones of so many are copies, on all channels
//!
//! ## Frames.
//! checksum = "big-endian"              # or "crc32", "not-inverted"
//! debug_text = "adc ok\r\n"            # RS-422: printed between frames ...
//! debug_every_ms = 200.0               # ... so often
//! stray_zero_every = 20                # RS-422: one of so many frames has a 00 in its middle
//! no_leading_delimiter = true          # RS-422
//! padding_bytes = 3                    # RS-422: bytes FF behind each frame
//! heartbeat_halved = true              # CAN: the second frame of each heartbeat is missing
//! can_order = "samples"                # or "messages": two frames of each leave in the wrong order
//! # "#;
//! # hw_mocks::Personality::from_toml("everything", text).unwrap();
//! ```

use std::time::Duration;

use gnc_config::{TomlEntry, TomlTable};
use gnc_protocol::stream::MAX_IMU_SAMPLES;
use gnc_protocol::timing::{ACCEPT_WITHIN, PROGRESS_EVERY};

use super::checks::{choice, count, needs, required_whole, short_text, whole};
use crate::breaches::board::{AdOrder, Repeats, RestartBreaches, StateBreaches, StreamBreaches, ValueBreaches};
use crate::breaches::wire::{CanOrder, Checksum, FrameBreaches};
use crate::breaches::{Breaches, HelloBreaches, StrangeAnswer, TalkBreaches, TimingBreaches};

/// Longest time of a key: a minute. No host waits so long.
const LONGEST_MS: f64 = 60_000.0;
/// Longest board time of a key: a day.
const DAY_S: f64 = 86_400.0;
/// Factors of a unit mistaken for another one: up to six powers of ten each way, and 0.
const FACTORS: (f64, f64) = (0.0, 1e6);
/// Bits of a field that a code of 24 bits leaves.
const SPARE_BITS: i64 = 8;
/// Words that an answer may hold.
const MOST_WORDS: i64 = 64;
/// Shortest time between two heartbeats: the line still carries them beside all else.
const SHORTEST_BEAT_MS: f64 = 10.0;
/// Time within which MAKE_SAFE ends.
const SAFE_WITHIN_MS: f64 = 250.0;
/// Most bytes behind a HELLO, or between frames: with them it still fits into a frame.
const EXTRA_BYTES: i64 = 256;
/// Longest text that is printed between frames: a line of a terminal.
const LONGEST_TEXT: usize = 80;
/// First status that means nothing.
const STRANGE_STATUS: i64 = 4;
/// First code of a NAK that means nothing.
const STRANGE_CODE: i64 = 11;

/// Reads the breaches of `[board]`.
pub(super) fn breaches(table: &TomlTable<'_, '_>) -> Breaches {
    Breaches {
        timing: timing(table),
        talk: talk(table),
        hello: hello(table),
        restarts: restarts(table),
        state: state(table),
        values: values(table),
        streams: streams(table),
        frames: frames(table),
    }
}

fn timing(table: &TomlTable<'_, '_>) -> TimingBreaches {
    needs(table, "accept_late_every", "accept_after_ms");
    let late = |key: &'static str, within_ms: f64| span(table, key, (within_ms, LONGEST_MS)).unwrap_or_default();
    let accept_within_ms = ACCEPT_WITHIN.as_secs_f64() * 1e3;
    TimingBreaches {
        accept_after: late("accept_after_ms", accept_within_ms),
        accept_late_every: count(table, "accept_late_every"),
        hello_after: late("hello_after_ms", accept_within_ms),
        progress_every: span_or_never(table, "progress_every_ms", PROGRESS_EVERY.as_secs_f64() * 1e3),
        heartbeat_every: span_or_never(table, "heartbeat_every_ms", SHORTEST_BEAT_MS),
        lost_first_heartbeats: count(table, "lost_first_heartbeats"),
        watchdog: span(table, "watchdog_ms", (0.0, LONGEST_MS)),
        make_safe_after: late("make_safe_after_ms", SAFE_WITHIN_MS),
    }
}

fn talk(table: &TomlTable<'_, '_>) -> TalkBreaches {
    needs(table, "result_status_every", "result_status");
    let strange = |entry: TomlEntry<'_, '_>| {
        Some(if choice(&entry, &["accept", "result"])? == "accept" {
            StrangeAnswer::Accept
        } else {
            StrangeAnswer::Result
        })
    };
    TalkBreaches {
        no_accept: table.flag("no_accept"),
        answers_nobody: table.entry("answers_nobody").and_then(strange),
        swaps_request_ids: table.flag("swaps_request_ids"),
        wrong_message_id: table.flag("wrong_message_id"),
        header_version: number(table, "header_version", (0, 15)),
        sequence_stands_every: every(table, "sequence_stands_every"),
        sequence_back_every: every(table, "sequence_back_every"),
        stream_request_id: number(table, "stream_request_id", (1, u16::MAX.into())).unwrap_or(0),
        double_result: table.flag("double_result"),
        elapsed_us_times: table.number("elapsed_us_times", (0.0, 1e6)),
        progress_permille: number(table, "progress_permille", (1001, u16::MAX.into())),
        progress_after_result: table.flag("progress_after_result"),
        result_status: number(table, "result_status", (STRANGE_STATUS, u16::MAX.into())),
        result_status_every: count(table, "result_status_every"),
        nak_code: number(table, "nak_code", (STRANGE_CODE, u16::MAX.into())),
        replay_runs_again: table.flag("replay_runs_again"),
        replay_without_flag: table.flag("replay_without_flag"),
    }
}

fn hello(table: &TomlTable<'_, '_>) -> HelloBreaches {
    let versions = |entry: TomlEntry<'_, '_>| {
        let [lowest, highest] = entry.array("two whole numbers, the lowest and the highest version")?;
        let (lowest, highest) = (whole(&lowest, (0, 255)), whole(&highest, (0, 255)));
        Some((lowest?, highest?))
    };
    HelloBreaches {
        wrong_nonce: table.flag("wrong_nonce"),
        other_boot_id_in_hello: table.flag("other_boot_id_in_hello"),
        hello_extra_bytes: number(table, "hello_extra_bytes", (1, EXTRA_BYTES)).unwrap_or(0),
        hello_versions: table.entry("hello_versions").and_then(versions),
        hello_chosen: number(table, "hello_chosen", (0, 255)),
        deaf_to_hello: table.flag("deaf_to_hello"),
        no_power_switch: table.flag("no_power_switch"),
        no_can: table.flag("no_can"),
        no_calibration: table.flag("no_calibration"),
    }
}

fn restarts(table: &TomlTable<'_, '_>) -> RestartBreaches {
    needs(table, "clock_back_s", "clock_back_at_s");
    needs(table, "clock_back_at_s", "clock_back_s");
    let seconds = |key: &'static str| table.number(key, (0.0, DAY_S)).map(Duration::from_secs_f64);
    RestartBreaches {
        keeps_boot_id: table.flag("keeps_boot_id"),
        clock_runs_on: table.flag("clock_runs_on"),
        clock_back: seconds("clock_back_at_s").zip(seconds("clock_back_s")),
    }
}

fn state(table: &TomlTable<'_, '_>) -> StateBreaches {
    let bits = |key: &'static str| {
        let bits = table.list(key, "a list of bits, 0 to 7");
        bits.iter().filter_map(|entry| whole::<u8>(entry, (0, 7))).fold(0, |set, bit| set | 1 << bit)
    };
    let (bits_set, bits_cleared): (u8, u8) = (bits("state_bits_set"), bits("state_bits_cleared"));
    if bits_set & bits_cleared != 0
        && let Some(entry) = table.entry("state_bits_cleared")
    {
        entry.mistake("a bit is both set and cleared", "write it into one of the two lists");
    }
    StateBreaches {
        bits_set,
        bits_cleared,
        safe_keeps_power: table.flag("safe_keeps_power"),
        powers_off_after: table.number("powers_off_after_s", (0.0, DAY_S)).map(Duration::from_secs_f64),
        over_current_at_power_on: table.flag("over_current_at_power_on"),
    }
}

fn values(table: &TomlTable<'_, '_>) -> ValueBreaches {
    let factor = |key: &'static str| table.number(key, FACTORS);
    let order = |entry: TomlEntry<'_, '_>| {
        Some(if choice(&entry, &["falling", "from-zero"])? == "falling" { AdOrder::Falling } else { AdOrder::FromZero })
    };
    ValueBreaches {
        supply_uv_times: factor("supply_uv_times"),
        supply_ua_times: factor("supply_ua_times"),
        timer_intervals_times: factor("timer_intervals_times"),
        flash_durations_times: factor("flash_durations_times"),
        pps_times: factor("pps_times"),
        imu_shift_bits: number(table, "imu_shift_bits", (1, SPARE_BITS)).unwrap_or(0),
        ad_channels: table.entry("ad_channels").and_then(order),
        extra_words: number(table, "extra_words", (1, MOST_WORDS)).unwrap_or(0),
    }
}

fn streams(table: &TomlTable<'_, '_>) -> StreamBreaches {
    let repeats = |table: &TomlTable<'_, '_>| {
        let of = required_whole::<u32>(table, "of", (2, i64::from(i32::MAX)))?;
        Some(Repeats { samples: required_whole(table, "samples", (1, i64::from(of) - 1))?, of })
    };
    StreamBreaches {
        numbers_from: count(table, "stream_numbers_from"),
        produced_off: number(table, "produced_off", (i32::MIN.into(), i32::MAX.into())).unwrap_or(0),
        drops_frame_every: every(table, "drops_frame_every"),
        time_times: table.number("stream_time_times", FACTORS),
        go_on: table.flag("streams_go_on"),
        before_result: table.flag("samples_before_result"),
        samples_a_frame: number(table, "samples_a_frame", (1, MAX_IMU_SAMPLES as i64)).unwrap_or(0),
        extra_samples: count(table, "extra_samples"),
        repeats: table.within("repeats", repeats).flatten(),
    }
}

fn frames(table: &TomlTable<'_, '_>) -> FrameBreaches {
    needs(table, "debug_text", "debug_every_ms");
    needs(table, "debug_every_ms", "debug_text");
    let sum = |entry: TomlEntry<'_, '_>| match choice(&entry, &["big-endian", "crc32", "not-inverted"])? {
        "big-endian" => Some(Checksum::BigEndian),
        "crc32" => Some(Checksum::Crc32),
        _ => Some(Checksum::NotInverted),
    };
    let order = |entry: TomlEntry<'_, '_>| {
        Some(if choice(&entry, &["samples", "messages"])? == "samples" {
            CanOrder::Samples
        } else {
            CanOrder::Messages
        })
    };
    let debug_text = short_text(table, "debug_text", LONGEST_TEXT);
    FrameBreaches {
        checksum: table.entry("checksum").and_then(sum),
        debug: debug_text.zip(span(table, "debug_every_ms", (SHORTEST_BEAT_MS, LONGEST_MS))),
        stray_zero_every: number(table, "stray_zero_every", (1, u32::MAX.into())).unwrap_or(0),
        no_leading_delimiter: table.flag("no_leading_delimiter"),
        padding_bytes: number(table, "padding_bytes", (1, EXTRA_BYTES)).unwrap_or(0),
        heartbeat_halved: table.flag("heartbeat_halved"),
        can_order: table.entry("can_order").and_then(order),
    }
}

fn number<T: TryFrom<i64>>(table: &TomlTable<'_, '_>, key: &'static str, bounds: (i64, i64)) -> Option<T> {
    table.entry(key).and_then(|entry| whole(&entry, bounds))
}

/// Frames from one breach to the next: with each frame, no number would be right.
fn every(table: &TomlTable<'_, '_>, key: &'static str) -> u32 {
    number(table, key, (2, u32::MAX.into())).unwrap_or(0)
}

fn span(table: &TomlTable<'_, '_>, key: &'static str, bounds_ms: (f64, f64)) -> Option<Duration> {
    table.number(key, bounds_ms).map(|span_ms| Duration::from_secs_f64(span_ms * 1e-3))
}

/// A span of at least so much, or 0 for never.
fn span_or_never(table: &TomlTable<'_, '_>, key: &'static str, least_ms: f64) -> Option<Duration> {
    let entry = table.entry(key)?;
    let span_ms = entry.number((0.0, LONGEST_MS))?;
    if span_ms > 0.0 && span_ms < least_ms {
        entry.mistake(format!("{key} is {span_ms}"), format!("it may be 0, for never, or {least_ms} to {LONGEST_MS}"));
        return None;
    }
    Some(Duration::from_secs_f64(span_ms * 1e-3))
}
