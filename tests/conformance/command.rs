//! `gnc-station board check` as a program: what it says, its exit codes, its JSON.

use std::io::{BufRead as _, BufReader};
use std::process::Stdio;

use gnc_tests::{Board, Place, Run};
use insta::assert_snapshot;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::Value;

const MOCK: &str = env!("CARGO_BIN_EXE_mock-under-test");
const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");

/// Checks of the simulated board that compare no time with the wall clock.
fn check(args: &[&str]) -> Run {
    Place::new(STATION).run([&["board", "check"], args].concat())
}

/// What was said, without the name of the pseudo-terminal.
fn said(run: &Run) -> String {
    let cut = |line: &str| match line.split_once("over ") {
        Some((begin, end)) if line.contains(" against docs/ICD.md ") => {
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
    assert_snapshot!(said(&run), @r"
    4 checks against docs/ICD.md over PORT at 921600 bit/s. Nothing else may use the board meanwhile.
    The module in the socket must be a good one. Flash checks write to its scratch sectors only, one calibration is committed to the simulated module, and at the end the board is made safe.
    Board SIM-BOARD-1, firmware sim 1.0.0, capabilities 0x7.

    5 How payloads are laid out
      pass payload.short                22 messages with a byte too few got NAK 3
      pass payload.long                 27 messages with a byte too many got NAK 3
      pass payload.count                5 messages with one element too many got NAK 3
      pass payload.count-beyond         5 messages got NAK 3

    4 passed, 0 failed, 0 not applicable
    ");
}

#[test]
fn a_failure_says_what_came_and_what_is_demanded() {
    let run = check(&["--sim=core-2-multiplier", "--only", "cpu"]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(1), ""), "{}", run.stdout);
    assert_snapshot!(said(&run), @r"
    3 checks against docs/ICD.md over PORT at 921600 bit/s. Nothing else may use the board meanwhile.
    The module in the socket must be a good one. Flash checks write to its scratch sectors only, one calibration is committed to the simulated module, and at the end the board is made safe.
    The next checks switch the module on and off.
    Board SIM-BOARD-1, firmware sim 1.0.0, capabilities 0x7.

    11 Messages
      pass cpu.words                    69 words four times
      FAIL cpu.integers                 core 2: 7 and 2 give [9, 5, 6, 3, 1] instead of [9, 5, 14, 3, 1]
           section 11 demands: CpuIntegers is 32-bit arithmetic: low 32 bits, quotient towards zero, remainder with the sign of a
      pass cpu.floats                   10 pairs on both cores, bit by bit

    2 passed, 1 failed, 0 not applicable
    ");
}

#[test]
fn the_board_is_checked_over_can() {
    let run = check(&["--sim", "--sim-link", "can", "--only", "can.stray"]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""), "{}", run.stdout);
    assert_snapshot!(said(&run), @r"
    1 check against docs/ICD.md over PORT at 500000 bit/s. Nothing else may use the board meanwhile.
    The module in the socket must be a good one. Flash checks write to its scratch sectors only, one calibration is committed to the simulated module, and at the end the board is made safe.
    Board SIM-BOARD-1, firmware sim 1.0.0, capabilities 0x7.

    17 CAN
      pass can.stray                    the next request was done

    1 passed, 0 failed, 0 not applicable
    ");
}

#[test]
fn programs_read_the_findings_as_json() {
    let run = check(&["--sim=core-2-multiplier", "--only", "cpu", "--json"]);
    assert_eq!(run.code, Some(1), "{}", run.stderr);
    let found: Value = serde_json::from_str(&run.stdout).unwrap();
    let found = found.as_array().unwrap();
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
    assert_snapshot!(run.stderr, @r"
    gnc-station: nothing came from a board within 3.0 s: no heartbeat, no answer to HELLO
      try: check the board's power, the wiring and the rate; section 16 of docs/ICD.md goes step by step
    ");
}

#[test]
fn what_cannot_be_checked_is_refused() {
    let run = check(&["--sim", "--only", "watchdogs"]);
    assert_eq!((run.code, run.stdout.as_str()), (Some(2), ""), "{}", run.stderr);
    assert_snapshot!(run.stderr, @r#"
    gnc-station: no check is named "watchdogs"
      try: name a section (3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 17) or the beginning of a check, such as hello
    "#);
    // Neither a bench file nor the simulated board.
    let run = check(&[]);
    assert_eq!((run.code, run.stdout.as_str()), (Some(2), ""), "{}", run.stderr);
    let place = Place::new(STATION);
    place.write("bench.toml", "[station]\nid = \"here\"\n[socket]\nport = \"/dev/no-such-port\"\n");
    let run = place.run(["board", "check"]);
    assert_eq!(run.code, Some(3), "{}", run.stdout);
    assert!(run.stderr.contains("/dev/no-such-port"), "{}", run.stderr);
}

/// A person stops the checks while the module is under power.
#[test]
fn a_stop_leaves_the_module_without_power() {
    let mut board = Board::start(MOCK, &[]);
    let place = Place::new(STATION);
    place.write("bench.toml", &board.bench_file("here"));
    let mut station = place
        .station(["board", "check", "--only", "11"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(station.stdout.take().unwrap()).lines().map(Result::unwrap);
    // The next check begins with the module under power.
    lines.find(|line| line.contains("power.twice")).unwrap();
    lines.find(|line| line.contains("identity")).unwrap();
    kill(Pid::from_raw(i32::try_from(station.id()).unwrap()), Signal::SIGINT).unwrap();
    let rest: Vec<String> = lines.collect();
    let said = station.wait_with_output().unwrap();
    assert_eq!((said.status.code(), said.stderr.as_slice()), (Some(4), &b""[..]), "{rest:?}");
    assert!(rest.iter().any(|line| line.starts_with("stopped; ")), "{rest:?}");
    assert_eq!(board.truth("powered"), "false");
}

/// Findings that cannot be written are no pass.
#[test]
fn a_full_disk_is_said() {
    let full = std::fs::File::create("/dev/full").unwrap();
    let place = Place::new(STATION);
    let mut station = place.station(["board", "check", "--sim", "--only", "hello.nonce", "--json"]);
    let ended = station.stdout(full).stderr(Stdio::piped()).output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(3), "{said}");
    assert!(
        said.contains("cannot write the findings: No space left on device") && said.contains("make room"),
        "{said}"
    );
}
