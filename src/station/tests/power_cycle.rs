//! Power cycles on the simulated bench: a good module passes, each fault has its verdict, and the module is left
//! without power.

#![cfg(feature = "sim")]
#![expect(clippy::expect_used, clippy::panic, reason = "a test says what it expected")]

#[path = "played/played.rs"]
mod played;

use gnc_bench::control::RunControl;
use gnc_executive::event::{Event, EventKind};
use gnc_executive::measurement::Reading;
use gnc_executive::outcome::Outcome;
use gnc_executive::state::{Attempt, RunState};
use gnc_executive::verdict::Verdict;
use hw_mocks::{BenchOptions, Personality, Speed};
use played::{outcomes, run_plan};

/// The plan of the repository, without its limit on the serial number.
fn plan() -> String {
    include_str!("../../../test-plans/power-cycle.toml").replace("serial_number = \"== $serial_number\"\n", "")
}

fn options(faults: &str) -> BenchOptions {
    let text = format!("description = \"power\"\n{faults}");
    let personality = Personality::from_toml("power", &text).unwrap_or_else(|error| panic!("{error}"));
    BenchOptions { personality, speed: Speed::Max, ..BenchOptions::default() }
}

fn run(faults: &str) -> RunState {
    run_plan(&plan(), &options(faults), |_, _| {})
}

fn attempt(state: &RunState) -> &Attempt {
    state.rows()[1].attempts.first().expect("an attempt")
}

fn value(attempt: &Attempt, name: &str) -> f64 {
    let measured = attempt.measurements.iter().find(|measured| measured.name == name);
    match measured.map(|measured| &measured.value) {
        Some(Reading::Number(number)) => *number,
        other => panic!("{name}: {other:?}"),
    }
}

/// Names of the measurements outside their limits.
fn failed(attempt: &Attempt) -> Vec<&str> {
    let failed = attempt.measurements.iter().filter(|measured| measured.outcome == Some(Outcome::Failed));
    failed.map(|measured| measured.name.as_str()).collect()
}

/// Checks that such cycles are no evidence: the item is errored, says why, and says nothing about the module.
#[track_caller]
fn check_no_evidence(faults: &str, why: &str) {
    let state = run(faults);
    assert_eq!(outcomes(&state), [Outcome::Passed, Outcome::Errored]);
    let attempt = attempt(&state);
    let error = attempt.error.as_ref().expect("an error");
    assert!(error.text.contains(why) && !error.hint.is_empty(), "{error:?}");
    assert!(attempt.measurements.is_empty(), "{:?}", attempt.measurements);
}

/// By the interface document, switching on takes 150 ms and the request for the identity 20 ms. The meter shows 5.012 V
/// and 0.487 A, and scatters by 1 mV and 0.5 mA; the bounds are six deviations.
#[test]
fn a_good_module_starts_each_time() {
    let state = run("");
    assert_eq!(outcomes(&state), [Outcome::Passed; 2]);
    let attempt = attempt(&state);
    assert_eq!((value(attempt, "cycles_done"), value(attempt, "starts_missed")), (10.0, 0.0));
    assert!((value(attempt, "time_to_identity") - 0.170).abs() < 1e-6, "{}", value(attempt, "time_to_identity"));
    for end in ["min", "max"] {
        assert!((value(attempt, &format!("supply_voltage_{end}")) - 5.012).abs() < 0.006);
        assert!((value(attempt, &format!("supply_current_{end}")) - 0.487).abs() < 0.003);
    }
    assert!(value(attempt, "supply_voltage_min") < value(attempt, "supply_voltage_max"));
    assert!((value(attempt, "off_voltage") - 3.0).abs() < 6.0 && value(attempt, "off_current") < 0.003);
    let rows = attempt.details[0]["cycles"].as_array().expect("a row for each cycle");
    assert_eq!(rows.len(), 10);
    assert!(rows.iter().all(|row| row["time_to_identity_s"].as_f64().is_some_and(|time_s| time_s < 0.2)), "{rows:?}");
}

/// The run's own power-on is the first, so cycles 2, 5 and 8 have every third one. The module is up 750 ms after it and
/// is asked every 120 ms. It answers the eighth time, 0.150 + 7 x 0.120 + 0.020 s after the request for power.
#[test]
fn a_module_that_is_late_once_in_three_fails_by_its_limit() {
    let state = run("[start]\nlate_every = 3\nlate_ms = 750\n");
    assert_eq!(outcomes(&state), [Outcome::Passed, Outcome::Failed]);
    let attempt = attempt(&state);
    assert_eq!(failed(attempt), ["time_to_identity"]);
    let late: Vec<u64> = attempt.details[0]["cycles"]
        .as_array()
        .expect("a row for each cycle")
        .iter()
        .filter(|row| (row["time_to_identity_s"].as_f64().expect("a time") - 1.010).abs() < 1e-6)
        .map(|row| row["cycle"].as_u64().expect("a number"))
        .collect();
    assert_eq!(late, [2, 5, 8]);
}

/// A module that sometimes needs a second power-on fails, with or without a limit, and the other cycles are still done.
#[test]
fn a_module_that_needs_two_tries_fails() {
    let starts = "[start]\nhangs_every = 3\n";
    let state = run(starts);
    assert_eq!(outcomes(&state), [Outcome::Passed, Outcome::Failed]);
    let judged = attempt(&state);
    assert_eq!(failed(judged), ["starts_missed"]);
    assert_eq!((value(judged, "cycles_done"), value(judged, "starts_missed")), (10.0, 3.0));
    let unlimited = plan().replace("starts_missed = \"<= 0\"\n", "");
    let state = run_plan(&unlimited, &options(starts), |_, _| {});
    assert_eq!(outcomes(&state), [Outcome::Passed, Outcome::Failed]);
    let error = attempt(&state).error.as_ref().expect("an error");
    assert!(error.text.contains("does not answer"), "{error:?}");
}

#[test]
fn a_limit_is_for_the_worst_cycle() {
    let strict = plan().replace("\"supply_current_*\" = \"0.49 A +- 5 %\"", "supply_current_max = \"<= 0.4 A\"");
    let state = run_plan(&strict, &options(""), |_, _| {});
    assert_eq!(outcomes(&state), [Outcome::Passed, Outcome::Failed]);
    assert_eq!(failed(attempt(&state)), ["supply_current_max"]);
}

#[test]
fn a_module_that_is_not_off_is_no_evidence() {
    check_no_evidence(
        "[supply]\noff_voltage_v = 5.012\noff_current_a = 0.487\n",
        "cycle 1: the supply is switched off",
    );
    // The module is fed through a signal line, past the current meter.
    check_no_evidence("[supply]\noff_voltage_v = 1.9\n", "still has 1.");
}

#[test]
fn a_board_that_answers_for_the_module_is_no_evidence() {
    check_no_evidence("[board]\ncaches_identity = true\n", "the board gives an identity, but the module has no supply");
}

#[test]
fn a_meter_that_stands_is_no_evidence() {
    check_no_evidence("[supply]\nmeter_holds = true\n", "20 readings of the supply are");
}

#[test]
fn another_module_is_no_evidence() {
    check_no_evidence("[module]\nswapped_after = 3\n", "cycle 3: the module says that it is SIM-OTHER");
}

/// The numbers that the run is of neither of.
fn other(state: &RunState) -> Option<(&str, &str)> {
    state.other_module().map(|other| (other.scanned.as_str(), other.found.as_str()))
}

/// A module that is exchanged in mid-run makes the run one of neither module, told once.
#[test]
fn a_run_with_two_modules_is_of_neither() {
    let patient = plan().replace("id = \"power-cycle\"", "id = \"power-cycle\"\nattempts = 3");
    let state = run_plan(&patient, &options("[module]\nswapped_after = 3\n"), |_, _| {});
    assert_eq!(other(&state), Some(("SN", "SIM-OTHER")));
    assert!(state.other_module().is_some_and(|other| other.exchanged), "the scanned one was there before");
    assert_eq!(other(&run("")), None);
    // A module with the scanned number and another part is still the scanned one, whatever its memory says.
    assert_eq!(other(&run("[board]\ncaches_identity = true\n")), None);
}

/// A module that says nothing at the power-on is found by a later item. What came before says nothing of the scanned module.
#[test]
fn another_module_that_starts_late_is_found_by_an_item() {
    let late = "[module]\nserial_number = \"GNC-0666\"\n[start]\nlate_every = 1\nlate_ms = 1000.0\n";
    let items = (1..=9).map(|number| format!("[[item]]\nid = \"identity\"\nname = \"identity-{number}\"\n"));
    let limited = items.map(|item| format!("{item}limits.serial_number = \"== $serial_number\"\n")).collect::<String>();
    let plan = format!("name = \"late\"\nversion = \"1\"\non_fail = \"continue\"\n{limited}");
    let state = run_plan(&plan, &options(late), |_, _| {});
    let ends = outcomes(&state);
    assert_eq!(ends[0], Outcome::Failed, "it does not answer yet");
    let at = ends.iter().position(|outcome| *outcome == Outcome::Errored).unwrap_or_else(|| panic!("{ends:?}"));
    let error = state.rows()[at].attempts[0].error.as_ref().expect("an error");
    assert!(error.text.contains("this is not the module that was scanned"), "{error:?}");
    assert!(ends[at + 1..].iter().all(|outcome| *outcome == Outcome::NotRun), "{ends:?}");
    assert_eq!(other(&state), Some(("SN", "GNC-0666")));
    assert!(state.other_module().is_some_and(|other| !other.exchanged), "nothing was measured of the scanned one");
    assert_eq!(state.verdict().map(Verdict::of_items), Some(Outcome::Errored), "and not failed");
}

/// The other module does not become the module of the run because the item is tried again.
#[test]
fn another_module_is_no_evidence_in_any_attempt() {
    let patient = plan().replace("id = \"power-cycle\"", "id = \"power-cycle\"\nattempts = 3");
    let state = run_plan(&patient, &options("[module]\nswapped_after = 3\n"), |_, _| {});
    assert_eq!(outcomes(&state), [Outcome::Passed, Outcome::Errored]);
    let errors: Vec<&str> =
        state.rows()[1].attempts.iter().map(|attempt| attempt.error.as_ref().map_or("", |error| &error.text)).collect();
    // The run is over: no attempt finds the other module to be its own.
    assert!(errors.len() == 1 && errors[0].contains("says that it is SIM-OTHER"), "{errors:?}");
}

/// Samples from before and after a power cycle are of one module, also where no item has asked who it is.
#[test]
fn captures_over_power_cycles_are_of_one_module() {
    let plan = r#"
name = "repeated"
version = "1"
[[item]]
id = "six-position"
params = { dwell = "10 s" }
limits.residual_rms = "<= 5 mg"
[[item]]
id = "gyro-still"
params = { dwell = "10 s" }
limits.residual_rms = "<= 1 deg/s"
[[item]]
id = "rotation"
params = { rest = "2 s", settle = "1 s" }
limits."scale_error_*" = "-5 % .. 5 %"
[[item]]
id = "bias-repeatability"
params = { runs = 3, dwell = "10 s", gap = "10 s" }
limits."bias_repeatability_gyro_*" = "<= 1000 deg/h"
"#;
    let state = run_plan(plan, &options("[module]\nswapped_after = 2\n"), |_, _| {});
    assert_eq!(outcomes(&state).last(), Some(&Outcome::Errored), "{:?}", outcomes(&state));
    let error = state.rows()[3].attempts[0].error.as_ref().expect("an error");
    assert!(error.text.contains("after the power cycle: the module says that it is SIM-OTHER"), "{error:?}");
}

/// Request for power 4: the run's own, then in cycle 1 off, the second look, and on. The restart belongs to the item,
/// since nothing runs beside it.
#[test]
fn a_board_that_restarts_in_a_cycle_fails_the_item() {
    let state = run("[reboot]\non = \"power\"\nnth = 4\nafter_ms = 50\n");
    assert_eq!(outcomes(&state), [Outcome::Passed, Outcome::Failed]);
    let error = attempt(&state).error.as_ref().expect("an error");
    assert!(error.text.contains("the board restarted"), "{error:?}");
}

/// Asks for something while the module of the first cycle has no supply.
fn when_off(event: &Event, control: &RunControl, ask: impl Fn(&RunControl)) {
    if matches!(&event.kind, EventKind::Power(power) if !power.on) {
        ask(control);
    }
}

/// A run checks whether the module is left without power, whatever ends the run.
#[test]
fn a_stop_in_the_middle_leaves_the_module_off() {
    let long = plan().replace("off_time = \"2 s\"", "off_time = \"600 s\"");
    for speed in [Speed::Max, Speed::Times(20.0)] {
        let options = BenchOptions { speed, ..options("") };
        let state = run_plan(&long, &options, |event, control| when_off(event, control, |asked| asked.stop("a test")));
        assert_eq!(outcomes(&state)[1], Outcome::Aborted);
    }
}

/// If an item without supply is given up, the next item gets a module under power.
#[test]
fn the_next_item_after_one_that_is_given_up_has_power() {
    let more = "[[item]]\nid = \"cpu\"\n[item.limits]\ncore1_register_errors = \"<= 0\"\n";
    let long = plan().replace("off_time = \"2 s\"", "off_time = \"600 s\"") + more;
    let options = BenchOptions { speed: Speed::Times(20.0), ..options("") };
    let state =
        run_plan(&long, &options, |event, control| when_off(event, control, |asked| asked.give_up("power-cycle")));
    assert_eq!(outcomes(&state), [Outcome::Passed, Outcome::Aborted, Outcome::Passed]);
}
