//! Every simulated board ends as its file says, over a pseudo-terminal, at full speed and at true speed.

#![expect(clippy::expect_used, reason = "what cannot be set up fails the test that needs it")]

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use gnc_tests::{Place, bad_items, boards};

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");
/// Number of concurrent runs: at true speed they mostly wait for the board.
const AT_ONCE: usize = 6;

/// Runs the functional plan on a board; returns the differences from its file's expectation.
fn check(board: &Path, speed: &str) -> Result<(), String> {
    let name = board.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let text = std::fs::read_to_string(board).map_err(|error| error.to_string())?;
    let personality = hw_mocks::Personality::from_toml(&name, &text).map_err(|error| error.to_string())?;
    let expected =
        personality.expect.get("functional").ok_or(format!("board {name} has no expectation for the plan"))?;
    let place = Place::new(STATION);
    let run = place.functional(&format!("--sim={}", board.display()), &["--sim-speed", speed]);
    let context = format!("{name} at speed {speed}\n{}{}", run.stdout, run.stderr);
    let code = match expected.outcome.as_str() {
        "passed" | "marginal" => 0,
        "failed" => 1,
        "errored" => 3,
        other => return Err(format!("{name} expects the unknown outcome {other}")),
    };
    if run.code != Some(code) {
        return Err(format!("exit code {:?} instead of {code}: {context}", run.code));
    }
    let record = place.record();
    let mut items = expected.items.clone();
    items.sort();
    let mut bad = bad_items(&record);
    bad.sort();
    if record["outcome"] != expected.outcome || bad != items {
        return Err(format!("{} {bad:?} instead of {} {items:?}: {context}", record["outcome"], expected.outcome));
    }
    Ok(())
}

fn check_all(boards: Vec<PathBuf>, speed: &str) {
    assert!(boards.len() > 10, "at least one good board and ten faults: {boards:?}");
    let left = Mutex::new(boards);
    let wrong = Mutex::new(Vec::new());
    let next = || -> Option<PathBuf> { left.lock().expect("boards").pop() };
    std::thread::scope(|scope| {
        for _ in 0..AT_ONCE {
            scope.spawn(|| {
                while let Some(board) = next() {
                    if let Err(why) = check(&board, speed) {
                        wrong.lock().expect("results").push(why);
                    }
                }
            });
        }
    });
    let wrong = wrong.into_inner().expect("results");
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

#[test]
fn every_board_ends_as_expected_at_full_speed() {
    check_all(boards(), "max");
}

/// Every third board; every board where `GNC_LONG` is set, as in the step `coverage` of `.ci/run`.
#[test]
fn boards_end_as_expected_at_true_speed() {
    let every = if std::env::var_os("GNC_LONG").is_some() { 1 } else { 3 };
    check_all(boards().into_iter().step_by(every).collect(), "1");
}

/// A fault with a size: half of the plan's limit passes and twice the limit fails, on either side. All other items are
/// unaffected.
#[test]
fn faults_count_from_their_limit_on() {
    type Sized = (&'static str, &'static str, fn(f64) -> String);
    let boards: [Sized; 3] = [
        // 0.5 % of the interval: a timer that is slow by this many ppm.
        ("timers", "timers", |share| format!("[timers]\nrate_error_ppm = {:.1}\n", share * 5000.0)),
        // 0.05 g along X and Y.
        ("imu", "imu", |share| format!("[accel]\noffset_g = [{:.4}, 0.0, 0.0]\n", share * 0.05)),
        // 2 % of 3.3 V.
        ("ad", "rails", |share| format!("[rails]\nv3v3_v = {:.4}\n", 3.3 + share * 0.066)),
    ];
    for (item, name, board) in boards {
        for (share, code) in [(-2.0, 1), (-0.5, 0), (0.5, 0), (2.0, 1)] {
            let place = Place::new(STATION);
            let text = format!("description = \"{name} at {share} of the limit\"\n{}", board(share));
            let file = place.write("board.toml", &text);
            let run = place.functional(&format!("--sim={}", file.display()), &["--sim-speed", "max"]);
            assert_eq!(run.code, Some(code), "{text}{}{}", run.stdout, run.stderr);
            let expected: &[&str] = if code == 0 { &[] } else { &[item] };
            assert_eq!(bad_items(&place.record()), expected, "{text}{}", run.stdout);
        }
    }
}
