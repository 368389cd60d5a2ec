//! Broken or malicious input gives a clear text that says what to do, without losses and without a panic.
//!
//! The texts are kept as snapshots, so that a person reads them when they change.

#![expect(clippy::expect_used, reason = "what cannot be set up fails the test that needs it")]

use std::io::{BufRead as _, BufReader};
use std::process::{Command, Stdio};

use gnc_tests::{Board, PARTIAL, Place, functional_plan};
use insta::assert_snapshot;

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");
const MOCK: &str = env!("CARGO_BIN_EXE_mock-under-test");

/// The station's message about a command line that it refuses.
fn refusal(args: &[&str], files: &[(&str, Vec<u8>)]) -> String {
    let place = Place::new(STATION);
    for (name, bytes) in files {
        std::fs::write(place.path().join(name), bytes).expect(name);
    }
    let plan = functional_plan();
    let args = args.iter().map(|arg| if *arg == "PLAN" { plan.to_str().expect("UTF-8") } else { arg });
    let run = place.run(args);
    assert_eq!(run.code, Some(2), "{}{}", run.stdout, run.stderr);
    assert_eq!(run.stdout, "");
    assert!(place.runs().is_empty(), "a refused run leaves no record");
    assert!(run.stderr.len() < 16_000, "nobody reads {} bytes", run.stderr.len());
    assert!(!run.stderr.chars().any(|character| character.is_control() && character != '\n'), "{:?}", run.stderr);
    run.stderr
}

#[test]
fn serial_numbers_from_a_scanner() {
    let scan = |serial_number: &str| refusal(&["--auto", "PLAN", "--sim", "--serial-number", serial_number], &[]);
    assert_snapshot!("serial-empty", scan(""));
    assert_snapshot!("serial-blank", scan(" \t "));
    assert_snapshot!("serial-long", scan(&"9".repeat(10_000)));
    assert_snapshot!("serial-escape", scan("SN\u{1b}[31m-1"));
    assert_snapshot!("serial-newline", scan("SN-1\nSN-2"));
}

/// A serial number that looks like a path is not used as one: the record lies below the records folder, and holds the
/// number as scanned.
#[test]
fn a_serial_number_is_never_a_path() {
    for serial_number in ["../../x", "/etc/passwd", "..", ".hidden", "a/b\\c", "-rf"] {
        let place = Place::new(STATION);
        let plan = functional_plan();
        let serial = format!("--serial-number={serial_number}");
        let run = place.run([
            "--auto",
            plan.to_str().expect("UTF-8"),
            "--sim",
            "--sim-speed",
            "max",
            "--only",
            "io",
            &serial,
        ]);
        assert_eq!(run.code, PARTIAL, "{serial_number}: {}{}", run.stdout, run.stderr);
        let entries: Vec<_> = std::fs::read_dir(place.path()).expect("a folder").flatten().collect();
        assert_eq!(entries.len(), 1, "only records/: {entries:?}");
        assert_eq!(place.record()["serial_number"], serial_number);
    }
}

#[test]
fn plans_that_are_none() {
    let check = |bytes: Vec<u8>| refusal(&["--auto", "p.toml", "--sim", "--serial-number", "A"], &[("p.toml", bytes)]);
    assert_snapshot!("plan-empty", check(Vec::new()));
    assert_snapshot!("plan-50-mb", check(b"# comment\n".repeat(5 << 20)));
    assert_snapshot!("plan-utf-16", check("name = \"x\"\n".encode_utf16().flat_map(u16::to_le_bytes).collect()));
    assert_snapshot!("plan-binary", check((0..=255).collect()));
    assert_snapshot!("plan-deep", check(format!("x = {}{}", "[".repeat(100_000), "]".repeat(100_000)).into_bytes()));
    assert_snapshot!(
        "plan-includes-itself",
        check(b"name = \"p\"\nversion = \"1\"\ninclude = [\"p.toml\"]\n".to_vec())
    );
    assert_snapshot!(
        "plan-include-missing",
        check(b"name = \"p\"\nversion = \"1\"\ninclude = [\"../gone.toml\"]\n".to_vec())
    );
    let many = "[[item]]\nid = \"nonsense\"\n".repeat(5000);
    assert_snapshot!("plan-5000-mistakes", check(format!("name = \"p\"\nversion = \"1\"\n{many}").into_bytes()));
}

#[test]
fn bench_files_that_are_none() {
    let args = ["--auto", "PLAN", "--serial-number", "A", "--bench", "b.toml"];
    let check = |text: &str| refusal(&args, &[("b.toml", text.as_bytes().to_vec())]);
    assert_snapshot!("bench-empty", check(""));
    assert_snapshot!(
        "bench-mistakes",
        check("[station]\nid = 7\nrecord = \"x\"\n[socket]\nport = \"\"\nrate = \"fast\"\n")
    );
    assert_snapshot!(
        "bench-site",
        check("[station]\nid = \"a\"\n[site]\nlatitude = \"134 deg\"\nlongitude = \"8 m\"\n")
    );
}

/// Text from the board may hold terminal escapes; they never reach a terminal or the log for people.
#[test]
fn a_board_cannot_move_the_cursor() {
    let place = Place::new(STATION);
    let board = "description = \"speaks in escapes\"\n[module]\nfirmware = \"\\u001b[2J\\u001b]0;owned\\u0007\"\n";
    let file = place.write("board.toml", board);
    let run = place.functional(&format!("--sim={}", file.display()), &["--sim-speed", "max", "--only", "identity"]);
    assert_eq!(run.code, Some(1), "{}{}", run.stdout, run.stderr);
    let log = std::fs::read_to_string(place.runs()[0].join("log.txt")).expect("a log");
    for text in [&run.stdout, &run.stderr, &log] {
        assert!(!text.contains('\u{1b}') && !text.contains('\u{7}'), "{text:?}");
    }
    assert!(log.contains("2J"), "it is shown all the same: {log}");
}

/// A second station on the same port is refused by name, and the first one goes on.
#[test]
fn two_stations_do_not_share_a_port() {
    let board = Board::start(MOCK, &["--serial-number", "SIM-0001"]);
    let place = Place::new(STATION);
    place.write("bench.toml", &board.bench_file("two"));
    let plan = functional_plan();
    let args = ["--auto", plan.to_str().expect("UTF-8"), "--serial-number", "SIM-0001", "--only", "identity,timers"];
    let mut first = place
        .station(args.iter().copied().chain(["--events"]))
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the station");
    let mut events = BufReader::new(first.stdout.take().expect("its output")).lines();
    assert!(events.by_ref().any(|line| line.expect("a line").contains("item_started")), "the first one is at work");
    let second = place.run(args);
    assert_eq!(second.code, Some(3), "{}{}", second.stdout, second.stderr);
    let holder = format!("(process {})", first.id());
    assert!(second.stdout.contains("is in use by") && second.stdout.contains(&holder), "{}", second.stdout);
    events.for_each(drop);
    assert_eq!(first.wait().expect("its end").code(), PARTIAL);
}

/// A device that sends garbage behind the port is not a board: the run is errored within bounds, and says so.
#[test]
fn babble_behind_the_port_is_no_board() {
    let pty = nix::pty::openpty(None, None).expect("a pseudo-terminal");
    let port = nix::unistd::ttyname(&pty.slave).expect("its name");
    // It begins at the first HELLO: where noise fills a pseudo-terminal while a program opens it and sets its mode, the
    // kernel sometimes passes on nothing for ever.
    let mut babbler = Command::new("sh")
        .args(["-c", "head -c 1 > /dev/null; exec cat /dev/urandom"])
        .stdin(pty.master.try_clone().expect("the other end once more"))
        .stdout(pty.master)
        .spawn()
        .expect("a shell");
    let place = Place::new(STATION);
    place.write("bench.toml", &format!("[station]\nid = \"two\"\n[socket]\nport = \"{}\"\n", port.display()));
    let plan = functional_plan();
    let run = place.run(["--auto", plan.to_str().expect("UTF-8"), "--serial-number", "A", "--only", "io"]);
    babbler.kill().expect("alive");
    babbler.wait().expect("its end");
    assert_eq!(run.code, Some(3), "{}{}", run.stdout, run.stderr);
    assert!(run.stdout.contains("the line carries bytes but no whole frame"), "{}", run.stdout);
    assert_eq!(place.record()["selection_outcome"], "errored");
}
