//! The functional table with CAN as the only link to the board, and the item `can` beside RS-422.

#![expect(clippy::expect_used, reason = "what cannot be set up fails the test that needs it")]

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use gnc_tests::{Place, bad_items, boards};
use serde_json::Value;

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");
/// Number of concurrent runs.
const AT_ONCE: usize = 4;

fn item<'a>(record: &'a Value, id: &str) -> &'a Value {
    record["items"].as_array().into_iter().flatten().find(|item| item["id"] == id).expect("an item")
}

fn measured<'a>(item: &'a Value, name: &str) -> &'a Value {
    let measurements = item["attempts"][0]["measurements"].as_array().into_iter().flatten();
    measurements.into_iter().find(|measurement| measurement["name"] == name).expect("a measurement")
}

fn good_over_can(speed: &str) {
    let place = Place::new(STATION);
    let run = place.functional("--sim", &["--sim-link", "can", "--sim-speed", speed]);
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    assert!(run.stdout.contains("on CAN slcan:/dev/pts/"), "{}", run.stdout);
    let record = place.record();
    assert_eq!(record["outcome"], "passed");
    assert_eq!(item(&record, "sci")["outcome"], "skipped");
    assert_eq!(item(&record, "sci")["cause"]["kind"], "device_missing");
    let items = record["items"].as_array().expect("items");
    assert_eq!(items.iter().filter(|item| item["outcome"] == "passed").count(), 13, "{record}");
    let can = item(&record, "can");
    assert_eq!(measured(can, "frames_sent")["value"], 216.0);
    // The station assumes nothing that slcan cannot tell.
    assert_eq!(measured(can, "adapter_errors")["value"], Value::Null);
    assert!(measured(can, "adapter_errors")["raw"].as_str().is_some_and(|raw| raw.contains("slcan")));
}

#[test]
fn a_good_module_passes_over_can_alone_at_full_speed() {
    good_over_can("max");
}

#[test]
fn a_good_module_passes_over_can_alone_at_true_speed() {
    good_over_can("1");
}

/// Every fault of a module shows over CAN as it does over RS-422, except faults of RS-422 itself.
fn check(board: &Path) -> Result<(), String> {
    let name = board.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let text = std::fs::read_to_string(board).map_err(|error| error.to_string())?;
    let personality = hw_mocks::Personality::from_toml(&name, &text).map_err(|error| error.to_string())?;
    let expected =
        personality.expect.get("functional").ok_or(format!("board {name} has no expectation for the plan"))?;
    // A fault of the RS-422 line or of the module's own SCI does not show here.
    let elsewhere = expected.items == ["sci"] || text.contains("[wire.");
    let outcome = if elsewhere { "passed" } else { expected.outcome.as_str() };
    let mut items: Vec<String> = expected.items.iter().filter(|item| !elsewhere && *item != "sci").cloned().collect();
    items.sort();
    let place = Place::new(STATION);
    let sim = format!("--sim={}", board.display());
    let run = place.functional(&sim, &["--sim-link", "can", "--sim-speed", "max"]);
    let record = place.record();
    let mut bad = bad_items(&record);
    bad.sort();
    // Lost frames may hit any item and may be repaired by sending again; they never count as the module's fault.
    let good = if name == "can-loses-frames" {
        matches!(record["outcome"].as_str(), Some("errored" | "passed"))
    } else {
        record["outcome"] == outcome && bad == items
    };
    if good {
        return Ok(());
    }
    Err(format!("{name}: {} {bad:?} instead of {outcome} {items:?}\n{}{}", record["outcome"], run.stdout, run.stderr))
}

#[test]
fn every_board_ends_as_expected_over_can() {
    let left: Mutex<Vec<PathBuf>> = Mutex::new(boards());
    let wrong = Mutex::new(Vec::new());
    let next = || left.lock().expect("boards").pop();
    std::thread::scope(|scope| {
        for _ in 0..AT_ONCE {
            scope.spawn(|| {
                while let Some(board) = next() {
                    if let Err(why) = check(&board) {
                        wrong.lock().expect("results").push(why);
                    }
                }
            });
        }
    });
    let wrong = wrong.into_inner().expect("results");
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

/// A bench file with its board on CAN: a missing interface is reported before power is switched on. A bus that cannot
/// be opened makes the run errored.
#[test]
fn bench_files_with_can() {
    let plan = gnc_tests::functional_plan();
    let plan = plan.to_str().expect("UTF-8");
    let args = ["--auto", plan, "--serial-number", "A", "--only", "io"];
    let place = Place::new(STATION);
    place.write("bench.toml", "[station]\nid = \"s\"\n[socket]\nlink = \"can\"\n");
    let run = place.run(args);
    assert_eq!(run.code, Some(2), "{}{}", run.stdout, run.stderr);
    assert!(run.stderr.contains("bench.toml:4:8: there is no CAN bus"), "{}", run.stderr);
    for (port, words) in [
        ("slcan:/dev/does-not-exist", ["there is no port", "plugged in"]),
        ("slcan:/dev/null", ["not a serial port", "gnc-station ports"]),
        ("no-such-can", ["no-such-can", "slcan"]),
    ] {
        let place = Place::new(STATION);
        let text = format!("[station]\nid = \"s\"\n[socket]\nlink = \"can\"\n[can]\nport = \"{port}\"\n");
        place.write("bench.toml", &text);
        let run = place.run(args);
        assert_eq!(run.code, Some(3), "{port}: {}{}", run.stdout, run.stderr);
        // If the kernel supports CAN the interface is missing, otherwise CAN itself.
        let said = |word: &str| run.stdout.contains(word) || run.stdout.contains("ip -br link");
        assert!(words.iter().all(|word| said(word)), "{port}: {}", run.stdout);
        assert_eq!(place.record()["selection_outcome"], "errored", "{port}");
    }
}
