//! What people do at the bench, and what it says of the module: a switch that nobody moved, a table that is turned too fast.

#![cfg(feature = "sim")]
#![expect(clippy::expect_used, clippy::panic, reason = "a test says what it expected")]

#[path = "played/played.rs"]
mod played;

use std::sync::{Arc, Mutex};

use gnc_executive::event::EventKind;
use gnc_executive::outcome::Outcome;
use gnc_executive::state::{Attempt, RunState};
use hw_mocks::{BenchOptions, Personality, Speed};
use played::{outcomes, run_plan};

const SWITCHES: &str = r#"
name = "switches"
version = "1"
[[item]]
id = "ad"
[item.limits]
ad4_on = "5 V +- 2 %"
ad5_on = "3.3 V +- 2 %"
ad6_on = "1.2 V +- 2 %"
ad7_on = "0 +- 20 mV"
ad8_on = "0 +- 100 mV"
"ad*_off" = "2 V +- 5 %"
crosstalk = "<= 20 mV"
"#;

const TURNS: &str = r#"
name = "turns"
version = "1"
[[item]]
id = "rotation"
params = { angle = "1080 deg", span = "5 s", ramp = "0.5 s", settle = "0 s", rest = "1 s" }
limits.scale_error_x = "0 +- 50000 ppm"
"#;

/// Runs the only item of a plan. Returns its attempt, and what the operator was asked for.
fn run(plan: &str, faults: &str) -> (Attempt, Vec<String>) {
    let text = format!("description = \"operator\"\n{faults}");
    let personality = Personality::from_toml("operator", &text).unwrap_or_else(|error| panic!("{error}"));
    let options = BenchOptions { personality, speed: Speed::Max, ..BenchOptions::default() };
    let asked = Arc::new(Mutex::new(Vec::new()));
    let told = Arc::clone(&asked);
    let state: RunState = run_plan(plan, &options, move |event, _| {
        if let EventKind::Prompted { text, .. } = &event.kind {
            told.lock().expect("a list").push(text.clone());
        }
    });
    let attempts = &state.rows()[0].attempts;
    assert_eq!((outcomes(&state).len(), attempts.len()), (1, 1));
    let asked = asked.lock().expect("a list").clone();
    (attempts[0].clone(), asked)
}

/// Requests that were repeated, by what they say of the switches.
fn again(asked: &[String]) -> Vec<&str> {
    asked.iter().filter(|text| text.starts_with("DIP switch")).map(String::as_str).collect()
}

#[track_caller]
fn check_switches(faults: &str, outcome: Outcome, repeated: &[&str], measured: usize, why: &str) {
    let (attempt, asked) = run(SWITCHES, faults);
    let error = attempt.error.as_ref().map(|error| error.text.as_str()).unwrap_or_default();
    assert_eq!(attempt.outcome, Some(outcome), "{faults}: {error}");
    let repeats = again(&asked);
    assert_eq!(repeats.len(), repeated.len(), "{faults}: {repeats:?}");
    for (text, expected) in repeats.iter().zip(repeated) {
        assert!(text.starts_with(expected), "{faults}: {text}");
    }
    assert!(error.starts_with(why) && error.is_empty() == why.is_empty(), "{faults}: {error}");
    let switches = attempt.measurements.iter().filter(|measured| measured.name.starts_with("ad")).count();
    assert_eq!(switches, measured, "{faults}");
}

/// A person who forgets a switch once is asked once more, and the module passes.
#[test]
fn a_forgotten_switch_is_asked_for_again() {
    use Outcome::Passed;
    let all_on = "[operator]\nswitches_on = [1, 2, 3, 4, 5]\nforgets = 1\n";
    check_switches("", Passed, &[], 10, "");
    check_switches(all_on, Passed, &["DIP switch 1 still reads ON (4.98"], 10, "");
    let first = "[operator]\nforgets_from = 2\nforgets = 1\n";
    check_switches(first, Passed, &["DIP switch 1 still reads OFF (2.008 V). Set DIP switch 1 to ON"], 10, "");
    let third = "[operator]\nforgets_from = 4\nforgets = 2\n";
    let still = "DIP switch 2 still reads ON (3.306 V). DIP switch 3 still reads OFF (2.008 V). Set DIP switch 3 to ON";
    check_switches(third, Passed, &[still, still], 10, "");
}

/// A person who moves no switch says nothing of the module.
#[test]
fn switches_that_nobody_moves_are_no_fault_of_the_module() {
    use Outcome::Errored;
    let not_moved = "the switches were not moved: asked 3 times. ";
    let on = "[operator]\nswitches_on = [1, 2, 3, 4, 5]\nforgets = 100\n";
    check_switches(
        on,
        Errored,
        &["DIP switch 1 still reads ON"; 2],
        0,
        &format!("{not_moved}DIP switch 1 still reads ON (4.98"),
    );
    // Twice for each switch: until the last of them the channels might be at fault.
    let off = [1, 1, 2, 2, 3, 3, 4, 4, 5, 5].map(|switch| format!("DIP switch {switch} still reads OFF (2.00"));
    let off = off.each_ref().map(String::as_str);
    check_switches(
        "[operator]\nforgets = 100\n",
        Errored,
        &off,
        0,
        &format!("{not_moved}DIP switch 5 still reads OFF"),
    );
    // The switches before were moved and measured.
    let later = "[operator]\nforgets_from = 4\nforgets = 100\n";
    check_switches(
        later,
        Errored,
        &["DIP switch 2 still reads ON"; 2],
        4,
        &format!("{not_moved}DIP switch 2 still reads ON (3.306 V)"),
    );
}

/// A channel that does not follow its switch fails: at once where another channel shows that the switches are moved.
#[test]
fn a_channel_that_does_not_follow_fails() {
    use Outcome::Failed;
    check_switches("[ad]\nunwired_switches = [2]\n", Failed, &[], 10, "");
    check_switches("[ad]\nunwired_switches = [5]\n", Failed, &[], 10, "");
    check_switches("[ad]\nunwired_switches = [1]\n", Failed, &["DIP switch 1 still reads OFF"; 2], 10, "");
    check_switches("[ad]\nunwired_switches = [2, 3]\n", Failed, &["DIP switch 3 still reads OFF"; 2], 10, "");
}

#[track_caller]
fn check_turn(faults: &str, outcome: Outcome, why: &str) {
    let (attempt, _) = run(TURNS, faults);
    let error = attempt.error.as_ref().map(|error| error.text.as_str()).unwrap_or_default();
    assert_eq!(attempt.outcome, Some(outcome), "{faults}: {error}");
    assert!(error.contains(why), "{faults}: {error}");
}

/// A turn by 1080 deg in 5 s with long ramps peaks at 432 deg/s: the table is at fault, as the samples show. A sensor that
/// ends at 200 deg/s is at fault whatever the table does.
#[test]
fn a_table_that_is_too_fast_is_no_fault_of_the_module() {
    check_turn("", Outcome::Passed, "");
    let fast = "[turntable]\nramp_share = 0.5\n";
    check_turn(fast, Outcome::Errored, "the table turned faster than 400 deg/s: gyro_x rose to 41");
    let short = "[gyro]\nrange_dps = [200.0, 0.0, 0.0]\n";
    check_turn(short, Outcome::Failed, "gyro_x is saturated");
    check_turn(&format!("{fast}{short}"), Outcome::Failed, "gyro_x is saturated");
}
