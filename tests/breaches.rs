//! Boards that break one rule of the interface document each.

use std::time::Duration;

use gnc_tests::campaign::{Case, Disturbance, Link, Over, run, violations};

const KEYS: &[&str] = &[
    "accept_after_ms = 80.0",
    "accept_after_ms = 200.0",
    "accept_after_ms = 600.0\naccept_late_every = 3",
    "hello_after_ms = 80.0",
    "hello_after_ms = 3000.0",
    "progress_every_ms = 900.0",
    "progress_every_ms = 0.0",
    "heartbeat_every_ms = 1500.0",
    "heartbeat_every_ms = 300.0",
    "heartbeat_every_ms = 0.0",
    "lost_first_heartbeats = 2",
    "watchdog_ms = 300.0",
    "watchdog_ms = 800.0",
    "watchdog_ms = 0.0",
    "make_safe_after_ms = 400.0",
    "no_accept = true",
    "answers_nobody = \"result\"",
    "answers_nobody = \"accept\"",
    "swaps_request_ids = true",
    "wrong_message_id = true",
    "header_version = 2",
    "sequence_stands_every = 20",
    "sequence_stands_every = 1",
    "sequence_back_every = 20",
    "stream_request_id = 7",
    "double_result = true",
    "elapsed_us_times = 100.0",
    "elapsed_us_times = 0.001",
    "progress_permille = 1100",
    "progress_after_result = true",
    "result_status = 77",
    "result_status = 77\nresult_status_every = 5",
    "nak_code = 99",
    "replay_runs_again = true",
    "replay_without_flag = true",
    "wrong_nonce = true",
    "other_boot_id_in_hello = true",
    "hello_extra_bytes = 1",
    "hello_versions = [2, 1]",
    "hello_versions = [2, 3]",
    "deaf_to_hello = true",
    "no_power_switch = true",
    "no_can = true",
    "no_calibration = true",
    "clock_back_at_s = 5.0\nclock_back_s = 2.0",
    "state_bits_set = [1]",
    "state_bits_cleared = [0]",
    "state_bits_cleared = [1]",
    "state_bits_cleared = [2, 3]",
    "safe_keeps_power = true",
    "powers_off_after_s = 0.3",
    "powers_off_after_s = 3.0",
    "over_current_at_power_on = true",
    "supply_uv_times = 1000.0",
    "supply_uv_times = 0.001",
    "supply_ua_times = 1000.0",
    "supply_ua_times = 0.001",
    "timer_intervals_times = 0.1",
    "timer_intervals_times = 0.001",
    "flash_durations_times = 1000.0",
    "flash_durations_times = 0.001",
    "pps_times = 0.001",
    "pps_times = 1000.0",
    "imu_shift_bits = 8",
    "ad_channels = \"falling\"",
    "ad_channels = \"from-zero\"",
    "extra_words = 1",
    "stream_numbers_from = 1",
    "produced_off = -3",
    "produced_off = 3",
    "drops_frame_every = 10",
    "stream_times_times = 0.001",
    "stream_times_times = 1000.0",
    "streams_go_on = true",
    "samples_before_result = true",
    "samples_a_frame = 3",
    "extra_samples = 5",
    "repeats = { samples = 50, of = 200 }",
    "checksum = \"big-endian\"",
    "checksum = \"crc32\"",
    "checksum = \"not-inverted\"",
    "debug_text = \"adc ok\\r\\n\"\ndebug_every_ms = 200.0",
    "stray_zero_every = 20",
    "no_leading_delimiter = true",
    "padding_bytes = 3",
    "heartbeat_halved = true",
    "can_order = \"samples\"",
    "can_order = \"messages\"",
    "serial = \"B\\u00001\"",
];

#[test]
fn explore() {
    let only = std::env::var("ONLY").unwrap_or_default();
    let board = std::env::var("BOARD").unwrap_or_else(|_| "good".into());
    let board: &'static str = board.leak();
    let work: Vec<(Link, &str)> = [Link::Rs422, Link::Can]
        .into_iter()
        .flat_map(|link| KEYS.iter().map(move |key| (link, *key)))
        .filter(|(_, key)| key.contains(&only))
        .collect();
    for (link, key) in work {
        let extra = if key.starts_with("serial") { format!("[board]\n{key}\n") } else { format!("[board]\n{key}\n") };
        let case = Case {
            seed: 7,
            number: 0,
            board,
            link,
            faults: extra,
            kinds: vec!["breach"],
            disturbance: Disturbance::None,
            moment: (1, Duration::ZERO),
        };
        let ran = run(&case, Over::Memory, None);
        println!(
            "=== {link:?} {} -> {:?} took {:?}",
            key.replace('\n', " "),
            ran.outcome.map(|o| o.to_string()),
            ran.took
        );
        for violation in violations(&case, &ran) {
            println!("   VIOLATION {violation}");
        }
        let Some(record) = &ran.record else { continue };
        for breach in &record.board_breaches {
            println!("   §{} {} x{} {:?}", breach.section, breach.what, breach.count, breach.worst);
        }
        for item in record.items.iter().filter(|item| !item.outcome.is_good()) {
            println!("   item {} {}: {}", item.name, item.outcome, gnc_executive::text::reason(item));
        }
        for note in record.notes.iter().filter(|note| note.level > gnc_executive::event::NoteLevel::Info) {
            println!("   note {}", note.text);
        }
    }
}
