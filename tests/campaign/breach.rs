//! Breaches of the interface document, as keys of a simulated board.

use super::case::Link;

/// What a plan says of a good module on a board that breaks a rule.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The rule touches no value.
    Passed,
    /// Nobody can tell.
    Errored,
}
use Verdict::{Errored, Passed};

/// Keys of `[board]` that break one rule. For RS-422 and for CAN: the verdict on a good module by the functional plan, and
/// the sections that its record must name. A session of some seconds shows not every breach; `board check` asks for the
/// others.
pub type Breach = (&'static str, (Verdict, &'static [u8]), (Verdict, &'static [u8]));

/// The breaches.
pub const BREACHES: &[Breach] = &[
    // Times.
    ("accept_after_ms = 80.0", (Passed, &[7]), (Passed, &[])),
    ("accept_after_ms = 200.0", (Passed, &[7]), (Passed, &[7])),
    ("accept_after_ms = 600.0\naccept_late_every = 3", (Passed, &[7]), (Passed, &[7])),
    ("hello_after_ms = 80.0", (Passed, &[6]), (Passed, &[])),
    ("hello_after_ms = 200.0", (Passed, &[6]), (Passed, &[6])),
    ("hello_after_ms = 3000.0", (Passed, &[6]), (Passed, &[6])),
    ("progress_every_ms = 900.0", (Passed, &[]), (Passed, &[])),
    ("progress_every_ms = 0.0", (Passed, &[]), (Passed, &[])),
    ("heartbeat_every_ms = 1500.0", (Passed, &[9]), (Passed, &[])),
    ("heartbeat_every_ms = 300.0", (Passed, &[9]), (Passed, &[9])),
    ("heartbeat_every_ms = 0.0", (Passed, &[9]), (Passed, &[9])),
    ("lost_first_heartbeats = 2", (Passed, &[]), (Passed, &[])),
    ("watchdog_ms = 300.0", (Errored, &[9]), (Errored, &[9])),
    ("watchdog_ms = 0.0", (Passed, &[]), (Passed, &[])),
    ("make_safe_after_ms = 400.0", (Passed, &[9]), (Passed, &[9])),
    // The conversation.
    ("no_accept = true", (Passed, &[7]), (Passed, &[7])),
    ("answers_nobody = \"result\"", (Passed, &[7]), (Passed, &[7])),
    ("answers_nobody = \"accept\"", (Passed, &[7]), (Passed, &[7])),
    ("swaps_request_ids = true", (Errored, &[7]), (Errored, &[7])),
    ("wrong_message_id = true", (Errored, &[7]), (Errored, &[7])),
    ("header_version = 2", (Errored, &[4]), (Errored, &[4])),
    ("sequence_stands_every = 20", (Passed, &[4]), (Passed, &[4])),
    ("sequence_back_every = 20", (Passed, &[4]), (Passed, &[4])),
    ("stream_request_id = 7", (Passed, &[4]), (Passed, &[])),
    ("double_result = true", (Passed, &[7]), (Passed, &[7])),
    ("elapsed_us_times = 100.0", (Errored, &[11]), (Errored, &[11])),
    ("elapsed_us_times = 0.001", (Errored, &[11]), (Errored, &[11])),
    ("progress_permille = 1100", (Passed, &[]), (Passed, &[])),
    ("progress_after_result = true", (Passed, &[]), (Passed, &[])),
    ("result_status = 77", (Errored, &[12]), (Errored, &[12])),
    ("nak_code = 99", (Passed, &[12]), (Passed, &[12])),
    ("replay_runs_again = true", (Passed, &[]), (Passed, &[])),
    ("replay_without_flag = true", (Passed, &[]), (Passed, &[])),
    // HELLO.
    ("wrong_nonce = true", (Errored, &[6]), (Errored, &[6])),
    ("other_boot_id_in_hello = true", (Passed, &[6]), (Passed, &[6])),
    ("hello_extra_bytes = 1", (Errored, &[6]), (Errored, &[6])),
    ("hello_versions = [2, 3]", (Passed, &[6]), (Passed, &[6])),
    ("hello_chosen = 2", (Errored, &[6]), (Errored, &[6])),
    ("deaf_to_hello = true", (Errored, &[]), (Errored, &[])),
    ("serial = \"B\\u00001\"", (Passed, &[5]), (Passed, &[5])),
    // The clock, state and power.
    ("clock_back_at_s = 5.0\nclock_back_s = 2.0", (Errored, &[9]), (Passed, &[9])),
    ("state_bits_set = [1]", (Passed, &[]), (Passed, &[])),
    ("state_bits_cleared = [0]", (Passed, &[9]), (Passed, &[9])),
    ("state_bits_cleared = [1]", (Passed, &[9]), (Passed, &[9])),
    ("state_bits_cleared = [2, 3]", (Passed, &[]), (Passed, &[])),
    ("safe_keeps_power = true", (Passed, &[9]), (Passed, &[9])),
    ("powers_off_after_s = 0.3", (Errored, &[]), (Errored, &[])),
    ("powers_off_after_s = 3.0", (Errored, &[]), (Errored, &[])),
    // Values.
    ("supply_uv_times = 1000.0", (Errored, &[11]), (Errored, &[11])),
    ("supply_uv_times = 0.001", (Errored, &[11]), (Errored, &[11])),
    ("supply_ua_times = 1000.0", (Errored, &[11]), (Errored, &[11])),
    ("supply_ua_times = 0.001", (Errored, &[11]), (Errored, &[11])),
    ("timer_intervals_times = 0.1", (Errored, &[11]), (Errored, &[11])),
    ("timer_intervals_times = 0.001", (Errored, &[11]), (Errored, &[11])),
    ("flash_durations_times = 1000.0", (Errored, &[11]), (Errored, &[11])),
    ("flash_durations_times = 0.001", (Errored, &[11]), (Errored, &[11])),
    ("pps_times = 0.001", (Errored, &[10]), (Errored, &[10])),
    ("pps_times = 1000.0", (Errored, &[10]), (Errored, &[10])),
    ("imu_shift_bits = 8", (Errored, &[10]), (Passed, &[])),
    ("ad_channels = \"falling\"", (Errored, &[11]), (Errored, &[11])),
    ("ad_channels = \"from-zero\"", (Errored, &[11]), (Errored, &[11])),
    ("extra_words = 1", (Passed, &[]), (Passed, &[])),
    // Streams.
    ("stream_numbers_from = 1", (Errored, &[10]), (Errored, &[10])),
    ("produced_off = -3", (Errored, &[10]), (Errored, &[10])),
    ("produced_off = 3", (Errored, &[10]), (Errored, &[10])),
    ("drops_frame_every = 10", (Errored, &[10]), (Errored, &[])),
    ("stream_time_times = 0.001", (Errored, &[10]), (Errored, &[10])),
    ("stream_time_times = 1000.0", (Errored, &[10]), (Errored, &[10])),
    ("streams_go_on = true", (Passed, &[]), (Passed, &[])),
    ("samples_before_result = true", (Passed, &[]), (Passed, &[])),
    ("samples_a_frame = 3", (Passed, &[10]), (Passed, &[])),
    ("extra_samples = 5", (Passed, &[10]), (Passed, &[])),
    ("repeats = { samples = 50, of = 200 }", (Errored, &[10]), (Errored, &[10])),
    // Frames.
    ("checksum = \"big-endian\"", (Errored, &[3]), (Errored, &[3])),
    ("checksum = \"crc32\"", (Errored, &[3]), (Errored, &[3])),
    ("checksum = \"not-inverted\"", (Errored, &[3]), (Errored, &[3])),
    ("debug_text = \"adc ok\\r\\n\"\ndebug_every_ms = 200.0", (Passed, &[3]), (Passed, &[])),
    ("stray_zero_every = 20", (Errored, &[]), (Passed, &[])),
    ("no_leading_delimiter = true", (Passed, &[]), (Passed, &[])),
    ("padding_bytes = 3", (Passed, &[3]), (Passed, &[])),
    ("heartbeat_halved = true", (Passed, &[]), (Passed, &[9])),
    ("can_order = \"samples\"", (Passed, &[]), (Passed, &[])),
    ("can_order = \"messages\"", (Passed, &[]), (Errored, &[])),
];

/// Whether a board with these keys may leave the module under power for longer than the document allows.
pub(super) fn is_unsafe(keys: &str) -> bool {
    ["safe_keeps_power", "watchdog_ms", "make_safe_after_ms"].iter().any(|key| keys.starts_with(key))
}

/// Whether a breach makes the values of a sensor look bad: on CAN a sample has 18 bits, and a code that is shifted is cut
/// off at its end, as it is by a broken sensor.
#[must_use]
pub fn looks_like_a_bad_sensor(keys: &str, link: Link) -> bool {
    link == Link::Can && keys.starts_with("imu_shift_bits")
}
