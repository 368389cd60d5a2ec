//! The simulated board breaks one rule of the document each by its keys: the check of that rule fails, and where the rule
//! stands alone, no other check does.

use gnc_tests::campaign::BREACHES;

use super::rig::{Breach, Wire, check};
use super::{failed, show};

/// What the checks find of a breach on one link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Found {
    /// Exactly this check fails.
    Only(&'static str),
    /// This check fails, and others that build on what it looks at.
    Among(&'static str),
    /// The rule is part of nearly everything: many checks fail.
    Many,
    /// The rule does not exist on this link, or shows in no check.
    Nothing,
}
use Found::{Among, Many, Nothing, Only};

/// Beginnings of keys, and what is found over RS-422 and over CAN. The longest beginning counts.
const FOUND: &[(&str, Found, Found)] = &[
    ("accept_after_ms", Among("request.accept-time"), Among("request.accept-time")),
    ("hello_after_ms = 80", Only("hello.time"), Only("hello.time")),
    ("hello_after_ms = 200", Only("hello.time"), Only("hello.time")),
    ("hello_after_ms = 3000", Only("hello.layout"), Only("hello.layout")),
    ("progress_every_ms = 900", Only("request.progress"), Only("request.progress")),
    ("progress_every_ms = 0", Among("request.progress"), Among("request.progress")),
    ("heartbeat_every_ms = 300", Only("heartbeat.period"), Only("heartbeat.period")),
    ("heartbeat_every_ms", Among("heartbeat.period"), Among("heartbeat.period")),
    ("lost_first_heartbeats", Nothing, Nothing),
    ("watchdog_ms", Among("watchdog.fires"), Among("watchdog.fires")),
    ("make_safe_after_ms", Only("make-safe.time"), Only("make-safe.time")),
    ("no_accept", Among("request.accept"), Among("request.accept")),
    ("answers_nobody", Among("header.ids"), Among("header.ids")),
    ("swaps_request_ids", Among("together.four"), Among("together.four")),
    ("wrong_message_id", Among("header.ids"), Among("header.ids")),
    ("header_version", Only("header.version"), Only("header.version")),
    ("sequence_", Only("header.sequence"), Only("header.sequence")),
    ("stream_request_id", Only("stream.layout"), Nothing),
    ("double_result", Among("request.once"), Among("request.once")),
    ("elapsed_us_times", Among("request.elapsed"), Among("request.elapsed")),
    ("progress_permille", Only("request.progress-fields"), Only("request.progress-fields")),
    ("progress_after_result", Among("request.nothing-after-result"), Among("request.nothing-after-result")),
    ("result_status", Many, Many),
    ("nak_code", Many, Many),
    ("replay_", Among("replay.same"), Among("replay.same")),
    ("wrong_nonce", Only("hello.nonce"), Only("hello.nonce")),
    ("other_boot_id_in_hello", Only("hello.boot-id"), Among("hello.boot-id")),
    ("hello_extra_bytes", Only("hello.layout"), Only("hello.layout")),
    ("hello_versions", Among("hello.layout"), Among("hello.layout")),
    ("hello_chosen", Only("hello.layout"), Only("hello.layout")),
    ("deaf_to_hello", Only("hello.layout"), Only("hello.layout")),
    ("serial", Only("hello.layout"), Only("hello.layout")),
    ("clock_back_at_s", Only("heartbeat.never-back"), Only("heartbeat.never-back")),
    ("state_bits_set", Among("heartbeat.powered"), Among("heartbeat.powered")),
    ("state_bits_cleared = [0]", Among("heartbeat.without-session"), Among("heartbeat.without-session")),
    ("state_bits_cleared = [1]", Only("heartbeat.powered"), Only("heartbeat.powered")),
    ("state_bits_cleared = [2", Among("heartbeat.streams"), Among("heartbeat.streams")),
    ("safe_keeps_power", Among("make-safe.state"), Among("make-safe.state")),
    ("powers_off_after_s", Many, Many),
    ("supply_", Only("power.on"), Only("power.on")),
    ("timer_intervals_times", Only("timer"), Only("timer")),
    ("flash_durations_times", Only("flash.pattern"), Only("flash.pattern")),
    ("pps_times", Only("stream.pps"), Only("stream.pps")),
    // On CAN a sample has 18 bits, and a code that is shifted is cut off.
    ("imu_shift_bits", Only("stream.codes"), Nothing),
    ("ad_channels", Only("ad.channels"), Only("ad.channels")),
    ("extra_words", Only("cpu.words"), Only("cpu.words")),
    ("stream_numbers_from", Among("stream.numbers"), Among("stream.numbers")),
    ("produced_off", Among("stream.account"), Among("stream.account")),
    ("drops_frame_every", Among("stream.account"), Among("stream.account")),
    ("stream_time_times", Among("stream.grid"), Among("stream.grid")),
    ("streams_go_on", Among("stream.stop"), Among("stream.stop")),
    ("samples_before_result", Only("stream.result-first"), Only("stream.result-first")),
    ("samples_a_frame", Among("stream.numbers"), Nothing),
    ("extra_samples", Only("stream.count"), Among("stream.count")),
    ("repeats", Only("stream.repeats"), Only("stream.repeats")),
    // All else is not tried: no frame can be read. Bytes that come are still not heartbeats.
    ("checksum", Among("frames.checksum"), Among("hello.layout")),
    ("debug_text", Among("frames.clean"), Nothing),
    ("stray_zero_every", Many, Nothing),
    ("no_leading_delimiter", Only("frames.delimiters"), Nothing),
    ("padding_bytes", Among("frames.clean"), Nothing),
    ("heartbeat_halved", Nothing, Among("can.heartbeat")),
    ("can_order = \"samples\"", Nothing, Only("can.imu")),
    ("can_order = \"messages\"", Nothing, Among("hello.layout")),
];

/// What is wrong with the findings of a breach on a link.
fn wrong(keys: &str, wire: Wire) -> Option<String> {
    let rules = FOUND.iter().filter(|(beginning, ..)| keys.starts_with(beginning));
    let (_, rs422, can) = rules.max_by_key(|(beginning, ..)| beginning.len())?;
    let expected = if wire == Wire::Can { *can } else { *rs422 };
    let ended = match check(&format!("[board]\n{keys}\n"), wire, None, Breach::default()) {
        Ok(ended) => ended,
        Err(error) => return Some(format!("{wire:?} {keys}: {error}")),
    };
    let came = failed(&ended);
    let right = match expected {
        Only(id) => came == [id],
        Among(id) => came.contains(&id),
        Many => came.len() > 3,
        Nothing => came.is_empty(),
    };
    if !right {
        show(&ended);
    }
    (!right).then(|| format!("{wire:?} {}: {expected:?}, {came:?}", keys.replace('\n', " ")))
}

/// Each breach on one of the links; with `GNC_LONG` set, on both.
#[test]
fn each_breach_fails_the_check_of_its_rule() {
    for (keys, ..) in BREACHES {
        assert!(FOUND.iter().any(|(beginning, ..)| keys.starts_with(beginning)), "{keys} is not in the list");
    }
    let long = std::env::var_os("GNC_LONG").is_some();
    let both = [Wire::Rs422, Wire::Can];
    let mut found = Vec::new();
    for (number, (keys, ..)) in BREACHES.iter().enumerate() {
        let wires = if long { &both[..] } else { &both[number % 2..][..1] };
        found.extend(wires.iter().filter_map(|wire| wrong(keys, *wire)));
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}
