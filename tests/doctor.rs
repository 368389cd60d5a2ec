//! `gnc-station doctor` asks a board in another process, and leaves it alone while another program uses the port.

#![expect(clippy::panic, reason = "a test says what it expected")]

use std::process::{Command, Stdio};

use gnc_tests::{Board, PARTIAL, Place, Run, functional_plan};

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");
const MOCK: &str = env!("CARGO_BIN_EXE_mock-under-test");

fn examined(place: &Place) -> Run {
    place.run(["doctor"])
}

/// The line of the doctor that begins with this word and holds this text.
fn line<'r>(run: &'r Run, health: &str, text: &str) -> &'r str {
    let found = run.stdout.lines().find(|line| line.starts_with(health) && line.contains(text));
    found.unwrap_or_else(|| panic!("no {health} line with \"{text}\" in\n{}{}", run.stdout, run.stderr))
}

#[test]
fn a_board_says_who_it_is() {
    let board = Board::start(MOCK, &["--serial-number", "SIM-0001"]);
    let place = Place::new(STATION);
    place.write("bench.toml", &board.bench_file("two"));
    for _ in 0..2 {
        let run = examined(&place);
        assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
        line(&run, "warning", "is a pseudo-terminal; runs on this bench are unproven and count for no module");
        let said = line(&run, "ok", "answers HELLO in");
        assert!(said.contains("board SIM-BOARD-1 (firmware sim 1.0.0)"), "{said}");
        assert!(
            said.contains("protocol version 1, switches the module's supply, has CAN, keeps a calibration"),
            "{said}"
        );
    }
}

#[test]
fn a_board_that_is_silent_is_bad() {
    let board = Board::start(MOCK, &["silent-board"]);
    let place = Place::new(STATION);
    place.write("bench.toml", &board.bench_file("two"));
    let run = examined(&place);
    assert_eq!(run.code, Some(1), "{}{}", run.stdout, run.stderr);
    line(&run, "BAD", "nothing came in 3.5 s; no answer to");
}

/// A program that reads the port without a lock is named, with its number; the board then hears no HELLO.
#[test]
fn another_reader_of_the_port_is_named() {
    let board = Board::start(MOCK, &["--serial-number", "SIM-0001"]);
    let place = Place::new(STATION);
    place.write("bench.toml", &board.bench_file("two"));
    let port = std::fs::File::open(&board.port).expect("the port");
    let mut reader = Command::new("sleep").arg("600").stdin(Stdio::from(port)).spawn().expect("sleep");
    let run = examined(&place);
    reader.kill().expect("alive");
    reader.wait().expect("its end");
    assert_eq!(run.code, Some(1), "{}{}", run.stdout, run.stderr);
    let said = line(&run, "BAD", "is open in another program too");
    assert!(said.contains(&format!("process {} (sleep 600)", reader.id())), "{said}");
    line(&run, "warning", "the board was not asked");
    assert!(!run.stdout.contains("HELLO in"), "{}", run.stdout);
}

/// A run holds the port: the doctor names the station and says no HELLO, and the run passes.
#[test]
fn a_run_is_not_disturbed() {
    let board = Board::start(MOCK, &["--serial-number", "SIM-0001"]);
    let place = Place::new(STATION);
    place.write("bench.toml", &board.bench_file("two"));
    let plan = functional_plan();
    let args =
        ["--auto", &plan.to_string_lossy(), "--serial-number", "SIM-0001", "--only", "identity,sdram", "--events"];
    let mut run = place.station(args).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("the station");
    let mut events = std::io::BufReader::new(run.stdout.take().expect("its output"));
    let mut event = String::new();
    while !event.contains("item_started") {
        event.clear();
        assert_ne!(std::io::BufRead::read_line(&mut events, &mut event).expect("an event"), 0, "the run ended");
    }
    let doctor = examined(&place);
    std::io::copy(&mut events, &mut std::io::sink()).expect("the rest");
    assert_eq!(run.wait().expect("its end").code(), PARTIAL, "the run was disturbed");
    line(&doctor, "warning", &format!("is in use by station-under-t (process {})", run.id()));
    line(&doctor, "warning", "the board was not asked");
}
