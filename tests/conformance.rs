//! `gnc-station board check` as a program: what it says, its exit codes, its JSON.

#![expect(clippy::expect_used, reason = "what cannot be set up fails the test that needs it")]

use gnc_tests::{Place, Run};
use insta::assert_snapshot;
use serde_json::Value;

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");

/// Checks of the simulated board that compare no time with the wall clock.
fn check(args: &[&str]) -> Run {
    Place::new(STATION).run([&["board", "check"], args].concat())
}

/// What was said, without the name of the pseudo-terminal.
fn said(run: &Run) -> String {
    let cut = |line: &str| match line.split_once("over ") {
        Some((begin, end)) if line.contains(" checks against ") => {
            format!("{begin}over PORT{}", end.find(" at ").map_or("", |place| &end[place..]))
        }
        _ => line.to_owned(),
    };
    run.stdout.lines().map(cut).collect::<Vec<_>>().join("\n")
}

#[test]
fn a_good_board_passes() {
    let run = check(&["--sim", "--only", "5"]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""), "{}", run.stdout);
    assert_snapshot!(said(&run), @"");
}

#[test]
fn a_failure_says_what_came_and_what_is_demanded() {
    let run = check(&["--sim=core-2-multiplier", "--only", "cpu"]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(1), ""), "{}", run.stdout);
    assert_snapshot!(said(&run), @"");
}

#[test]
fn the_board_is_checked_over_can() {
    let run = check(&["--sim", "--sim-link", "can", "--only", "can.f"]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""), "{}", run.stdout);
    assert_snapshot!(said(&run), @"");
}

#[test]
fn programs_read_the_findings_as_json() {
    let run = check(&["--sim=core-2-multiplier", "--only", "cpu", "--json"]);
    assert_eq!(run.code, Some(1), "{}", run.stderr);
    let found: Value = serde_json::from_str(&run.stdout).expect("JSON");
    let found = found.as_array().expect("an array");
    let outcomes: Vec<_> = found.iter().map(|one| (one["id"].as_str(), one["outcome"].as_str())).collect();
    assert_eq!(
        outcomes,
        [("cpu.words", "pass"), ("cpu.integers", "fail"), ("cpu.floats", "pass")]
            .map(|(id, outcome)| (Some(id), Some(outcome)))
    );
    for one in found {
        assert_eq!(one["section"], 11);
        assert!(one["demand"].is_string() && one["measured"].is_string(), "{one}");
    }
    assert!(run.stderr.contains("2 passed, 1 failed, 0 not applicable"), "{}", run.stderr);
}

#[test]
fn no_board_is_no_failed_check() {
    let run = check(&["--sim=silent-board"]);
    assert_eq!(run.code, Some(3), "{}{}", run.stdout, run.stderr);
    assert_snapshot!(run.stderr, @"");
}

#[test]
fn what_cannot_be_checked_is_refused() {
    let run = check(&["--sim", "--only", "watchdogs"]);
    assert_eq!((run.code, run.stdout.as_str()), (Some(2), ""), "{}", run.stderr);
    assert_snapshot!(run.stderr, @"");
    // Neither a bench file nor the simulated board.
    let run = check(&[]);
    assert_eq!((run.code, run.stdout.as_str()), (Some(2), ""), "{}", run.stderr);
    let place = Place::new(STATION);
    place.write("bench.toml", "[station]\nid = \"here\"\n[socket]\nport = \"/dev/no-such-port\"\n");
    let run = place.run(["board", "check"]);
    assert_eq!(run.code, Some(3), "{}", run.stdout);
    assert!(run.stderr.contains("/dev/no-such-port"), "{}", run.stderr);
}
