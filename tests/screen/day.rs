//! An operator's day: the bench file names plan and operator, the terminal rings, a program is told each verdict, and
//! the modules of the shift are counted.

use std::os::unix::fs::PermissionsExt as _;

use gnc_tests::{Place, read_json};

use crate::{F2, F5, F9, F10, MOCK, STATION, mock, open, wait_for_file};

const PLAN: &str =
    "name = \"short\"\nversion = \"1\"\n[[item]]\nid = \"cpu\"\nlimits.core1_register_errors = \"<= 0\"\n";
const IO_PLAN: &str = "name = \"short\"\nversion = \"1\"\n[[item]]\nid = \"io\"\nprompt = \"Close the lid.\"\n\
                       limits.wrong_reads = \"<= 0\"\n";

/// A program for the bench file.
fn program(place: &Place, name: &str, text: &str) {
    let path = place.write(name, text);
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).expect("permissions");
}

#[test]
fn a_bench_names_plan_and_operator_and_a_program_is_told_the_verdict() {
    let place = Place::new(STATION);
    let board = mock("good");
    place.write("p.toml", PLAN);
    program(&place, "light.sh", "#!/bin/sh\ncat > \"told-$1.part\"\nmv \"told-$1.part\" \"told-$1\"\n");
    let habits = "plan = \"p.toml\"\n[operator]\nrequired = true\n[verdict]\nbell = true\nhook = [\"./light.sh\", \"socket 1\"]\n[socket]";
    place.write("bench.toml", &board.bench_file("line-2").replace("[socket]", habits));
    let mut terminal = open(&place, &[], 80, 24);
    terminal.wait_for("short 1");
    terminal.types(b"T-1\r");
    terminal.wait_for("T-1: F5 starts the test.");
    // No run begins without a name.
    terminal.types(F5);
    terminal.wait_for("requires the operator's name");
    assert_eq!(terminal.bells(), 0);
    // Pasted: a name that a program types at once is a scan and does not fall into the form.
    terminal.types(b"\x1b[200~A. Chen\x1b[201~");
    terminal.wait_for("A. Chen_");
    terminal.types(b"\r");
    terminal.wait_until("the form is taken", |screen| !screen.contents().contains("A. Chen_"));
    terminal.types(F5);
    wait_for_file(place.path(), "told-socket 1");
    terminal.wait_for("passed · T-1");
    // The verdict stands, and says that a pseudo-terminal proves no board; no shift counts it.
    let screen = terminal.text();
    assert!(screen.contains(" UNPROVEN ┐"), "{screen}");
    assert!(screen.lines().next().is_some_and(|head| head.contains("UNPROVEN")), "{screen}");
    assert_eq!(terminal.bells(), 1);
    terminal.types(F9);
    terminal.types(F9);
    terminal.wait_for("2026-");
    assert!(!terminal.text().contains("Shift") && !terminal.text().contains("first-pass yield"), "{}", terminal.text());
    terminal.types(F10);
    let (status, restored) = terminal.end();
    assert!(restored && status.code() == Some(0), "{status}");

    let told = read_json(&place.path().join("told-socket 1"));
    assert_eq!(told["schema"], "gnc-verdict/1");
    // A program of before, which asks for `outcome` alone, switches no green light on.
    assert_eq!((&told["serial_number"], &told["outcome"]), (&"T-1".into(), &serde_json::Value::Null));
    assert_eq!((told.get("selection_outcome"), &told["simulated"]), (None, &false.into()));
    assert_eq!((&told["unproven"], &told["unproven_outcome"]), (&true.into(), &"passed".into()));
    assert_eq!(told["run"]["plan"]["name"], "short");
    assert_eq!(told["run"]["operator"], "A. Chen");
    assert_eq!(told["run"]["not_passed"], serde_json::json!([]));
    let runs = place.runs();
    let folder = told["record"].as_str().expect("a path");
    assert_eq!(std::path::Path::new(folder).canonicalize().expect("the record"), runs[0].canonicalize().expect("it"));

    // The next time the station remembers who tested, and says so.
    let mut terminal = open(&place, &[], 80, 24);
    terminal.wait_for("Operator A. Chen, as in the last run. F2 changes it.");
    terminal.types(F10);
    terminal.end();
}

/// A module that fails first and passes then is done and passed, but not at the first try. A simulated bench counts its own runs.
#[test]
fn a_second_try_is_no_first_pass() {
    let place = Place::new(STATION);
    place.write("p.toml", &IO_PLAN.replace("prompt = \"Close the lid.\"\n", ""));
    let mut terminal = open(&place, &["--plan", "p.toml", "--sim=io-open"], 80, 24);
    terminal.wait_for("short 1");
    terminal.types(b"T-1\r");
    terminal.types(F5);
    terminal.wait_for("Shift 1: ✓0 ✗1 ?0 · FPY 0 %");
    terminal.types(F10);
    terminal.end();

    // The shift is counted from the records, so the station may be started anew.
    let mut terminal = open(&place, &["--plan", "p.toml", "--sim"], 160, 50);
    terminal.wait_for("Shift 1: ✓0 ✗1 ?0 · FPY 0 %");
    terminal.types(b"T-1\r");
    terminal.wait_for("short failed");
    terminal.types(F5);
    terminal.wait_for("again?");
    terminal.types(F2);
    terminal.wait_for("Shift 1: ✓1 ✗0 ?0 · FPY 0 %");
    terminal.types(F9);
    terminal.types(F9);
    terminal.wait_for("1 passed · 0 failed · 0 without a verdict · first-pass yield 0 % (0 of 1)");
    terminal.types(F10);
    terminal.end();
}

/// A question rings, and so does a verdict. What an earlier run said is told, also on a bench whose runs do not count.
#[test]
fn questions_ring_and_an_earlier_failure_is_told() {
    let place = Place::new(STATION);
    let mut board = mock("io-open");
    let board_file = |port: &str| {
        let habits = format!("[station]\nid = \"line-2\"\n[verdict]\nbell = true\n[socket]\nport = \"{port}\"\n");
        place.write("bench.toml", &habits)
    };
    place.write("p.toml", IO_PLAN);
    board_file(&board.port);
    let mut terminal = open(&place, &["--plan", "p.toml"], 80, 24);
    terminal.wait_for("short 1");
    terminal.types(b"T-1\r");
    terminal.types(F5);
    terminal.wait_for("Close the lid.");
    terminal.types(F2);
    terminal.wait_for("failed · T-1");
    assert_eq!(terminal.bells(), 2);
    terminal.types(F10);
    terminal.end();

    board.kill();
    let board = gnc_tests::Board::start(MOCK, &["good", "--speed", "max", "--serial-number", "T-1"]);
    board_file(&board.port);
    let mut terminal = open(&place, &["--plan", "p.toml"], 160, 50);
    terminal.wait_for("short 1");
    terminal.types(b"T-1\r");
    terminal.wait_for("short failed");
    terminal.types(F5);
    terminal.wait_for("again?");
    terminal.types(F2);
    terminal.wait_for("Close the lid.");
    terminal.types(F2);
    terminal.wait_for("passed · T-1");
    terminal.types(F10);
    terminal.end();
}

/// A program that hangs, fails or does not exist is told to the operator, and the verdict stands.
#[test]
fn a_program_that_does_not_work_is_told_and_changes_nothing() {
    let place = Place::new(STATION);
    let board = mock("good");
    place.write("p.toml", PLAN);
    program(&place, "hangs.sh", "#!/bin/sh\ntail -f /dev/null & wait\n");
    // More than a pipe holds, so that a station that does not listen would block it.
    program(&place, "fails.sh", "#!/bin/sh\nyes no paper | head -c 200000 >&2\nexit 7\n");
    for (hook, told) in [
        ("[\"./hangs.sh\"]\nhook_time = \"0.3 s\"", "still ran after 0.3 s and was killed; the verdict of T-1 stands"),
        ("[\"./fails.sh\"]", "ended with code 7 and says \"no paper\"; the verdict of T-1 stands"),
        ("[\"./missing.sh\"]", "cannot be started"),
    ] {
        let habits = format!("[verdict]\nhook = {hook}\n[socket]");
        place.write("bench.toml", &board.bench_file("line-2").replace("[socket]", &habits));
        let run = place.run(["--auto", "p.toml", "--serial-number", "T-1", "--loops", "2"]);
        assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
        assert_eq!(run.stderr.matches(told).count(), 2, "{hook}: {}", run.stderr);
    }
}

/// Whoever leaves waits for a printer that hangs, unless ctrl-C says that this takes too long.
#[test]
fn an_interrupt_ends_the_wait_for_a_hook() {
    let place = Place::new(STATION);
    let board = mock("good");
    place.write("p.toml", PLAN);
    program(&place, "hangs.sh", "#!/bin/sh\n: > began\ntail -f /dev/null & wait\n");
    let habits = "plan = \"p.toml\"\n[verdict]\nhook = [\"./hangs.sh\"]\nhook_time = \"10 min\"\n[socket]";
    place.write("bench.toml", &board.bench_file("line-2").replace("[socket]", habits));
    let mut terminal = open(&place, &[], 80, 24);
    terminal.wait_for("short 1");
    terminal.types(b"T-1\r");
    terminal.wait_for("T-1: F5 starts the test.");
    terminal.types(F5);
    wait_for_file(place.path(), "began");
    terminal.types(F10);
    terminal.wait_until("the terminal is given back", |screen| !screen.alternate_screen());
    terminal.types(b"\x03");
    terminal.wait_for("was killed by ctrl-C; verdicts that it was not told or did not finish: 1");
    let (status, restored) = terminal.end();
    assert!(restored && status.code() == Some(0), "{status}");
}

/// Without a screen the same file names the operator, or the run is refused.
#[test]
fn a_bench_requires_an_operator_without_a_screen_too() {
    let place = Place::new(STATION);
    let board = mock("good");
    place.write("p.toml", PLAN);
    let bench = |habits: &str| {
        place.write(
            "bench.toml",
            &board.bench_file("line-2").replace("[socket]", &format!("[operator]\n{habits}\n[socket]")),
        );
    };
    let auto = |more: &[&str]| place.run([&["--auto", "p.toml", "--serial-number", "T-1"], more].concat());
    bench("required = true");
    let refused = auto(&[]);
    assert_eq!(refused.code, Some(2), "{}", refused.stderr);
    assert!(refused.stderr.contains("--operator NAME"), "{}", refused.stderr);
    assert_eq!(auto(&["--operator", " "]).code, Some(2));
    assert!(place.runs().is_empty());
    assert_eq!(auto(&["--operator", "B"]).code, Some(0));
    bench("required = true\nname = \"A. Chen\"");
    assert_eq!(auto(&[]).code, Some(0));
    assert_eq!(auto(&["--operator", "C"]).code, Some(0));
    let operator = |run: &std::path::PathBuf| read_json(&run.join("run.json"))["operator"].clone();
    let operators: Vec<serde_json::Value> = place.runs().iter().map(operator).collect();
    assert_eq!(operators, ["B", "A. Chen", "C"]);
}

/// Without the screen a scan answers no question either, whatever the scanner sends behind it: the station asks again, and
/// Enter alone is not "done".
#[test]
fn a_scan_answers_no_question_without_a_screen() {
    let place = Place::new(STATION);
    let board = mock("good");
    place.write("p.toml", IO_PLAN);
    place.write("bench.toml", &board.bench_file("line-2"));
    let mut terminal = open(&place, &["--auto", "p.toml", "--serial-number", "T-1"], 100, 60);
    let asked = |screen: &vt100::Screen, times| screen.contents().matches(">> Close the lid.").count() == times;
    let mut times = 1;
    terminal.wait_until("the question", |screen| asked(screen, times));
    // CR, LF, both in either order, each twice, a Tab that leaves the code to the next line end, STX and CR before the code.
    for scan in
        ["SN-2\r", "SN-2\n", "SN-2\r\n", "SN-2\n\r", "SN-2\r\r", "SN-2\t", "SN-2\r\n\r\n", "\u{2}\rSN-2\r", "\r"]
    {
        terminal.types(scan.as_bytes());
        // The terminal makes a line of each.
        times += scan.matches(['\r', '\n']).count();
        terminal.wait_until(&format!("the question again behind {scan:?}"), |screen| asked(screen, times));
    }
    terminal.types(b"y\r");
    terminal.wait_for("PASSED");
    let (status, _) = terminal.end();
    assert_eq!(status.code(), Some(0));
}
