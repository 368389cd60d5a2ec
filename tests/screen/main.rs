//! The whole program on a pseudo-terminal, seen as an operator sees it.

#![expect(clippy::expect_used, clippy::panic, reason = "what cannot be set up fails the test that needs it")]

mod calibration;
mod day;
mod pictures;
mod questions;
mod scanner;
mod start;
mod terminal;

use std::process::Command;

use gnc_tests::{Board, Place, functional_plan, read_json};
use nix::sys::signal::Signal;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use terminal::Terminal;

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");
const MOCK: &str = env!("CARGO_BIN_EXE_mock-under-test");

const F1: &[u8] = b"\x1bOP";
const F2: &[u8] = b"\x1bOQ";
const F4: &[u8] = b"\x1bOS";
const F5: &[u8] = b"\x1b[15~";
const F6: &[u8] = b"\x1b[17~";
const F7: &[u8] = b"\x1b[18~";
const F9: &[u8] = b"\x1b[20~";
const F10: &[u8] = b"\x1b[21~";
const ESC: &[u8] = b"\x1b";

/// The screen of a station in this folder.
fn open(place: &Place, args: &[&str], columns: u16, rows: u16) -> Terminal {
    open_on(place, &[("TERM", "xterm-256color")], args, columns, rows)
}

/// What terminals and programs before them say of themselves.
const TERMINALS: [&str; 8] =
    ["TERM_PROGRAM", "KITTY_WINDOW_ID", "TMUX", "STY", "ZELLIJ", "VTE_VERSION", "KONSOLE_VERSION", "XTERM_VERSION"];

/// The same on a terminal with this environment.
fn open_on(place: &Place, environment: &[(&str, &str)], args: &[&str], columns: u16, rows: u16) -> Terminal {
    // A separate session, so that the terminal is its controlling one and a hang-up reaches it.
    let mut command = Command::new("setsid");
    command.arg("--ctty").arg(STATION).args(args).current_dir(place.path());
    for variable in TERMINALS {
        command.env_remove(variable);
    }
    command.env("LC_ALL", "C.UTF-8").env_remove("NO_COLOR").envs(environment.iter().copied());
    Terminal::start(command, columns, rows)
}

fn sim<'a>(plan: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["--sim", "--plan", plan], more].concat()
}

fn plan() -> String {
    functional_plan().display().to_string()
}

fn outcomes(place: &Place) -> Vec<String> {
    let outcome = |run: std::path::PathBuf| {
        let record = read_json(&run.join("run.json"));
        let of_items = record["selection_outcome"].as_str().map(|outcome| format!("items {outcome}"));
        record["outcome"].as_str().map(str::to_owned).or(of_items)
    };
    place.runs().into_iter().filter_map(outcome).collect()
}

/// A simulated board as a separate program.
fn mock(board: &str) -> Board {
    Board::start(MOCK, &[board, "--speed", "max", "--serial-number", "T-1"])
}

/// Scan, start, do what the screen asks, fail, repeat the failed items, answer "not possible", leave.
#[test]
fn an_operator_tests_a_module() {
    let place = Place::new(STATION);
    let board = mock("io-open");
    place.write("bench.toml", &board.bench_file("line-2"));
    place.write(
        "p.toml",
        "name = \"short\"\nversion = \"1\"\n[[item]]\nid = \"cpu\"\nlimits.core1_register_errors = \"<= 0\"\n\
         [[item]]\nid = \"io\"\nprompt = \"Close the lid.\"\nlimits.wrong_reads = \"<= 0\"\n",
    );
    let mut terminal = open(&place, &["--plan", "p.toml"], 80, 24);
    terminal.wait_for("short 1");
    terminal.wait_for("line-2");
    terminal.types(b"T-1\r");
    terminal.wait_for("T-1: F5 starts the test.");
    terminal.wait_for("never tested");
    terminal.types(F5);
    terminal.wait_for("Close the lid.");
    // A scanner must not answer for the operator.
    terminal.types(b"T-2\r");
    terminal.wait_for("T-2 comes next");
    assert!(terminal.text().contains("Close the lid."), "{}", terminal.text());
    terminal.types(F2);
    terminal.wait_for("look at: A line reads another level than its partner drives");
    assert!(terminal.text().contains("failed"), "{}", terminal.text());
    assert!(terminal.text().contains("wrong_reads"), "{}", terminal.text());

    // The row appears before the run has ended.
    terminal.wait_for("F4 Repeat");
    // T-2 was scanned, but the run to repeat belongs to T-1: scan the label of T-1 again first.
    terminal.types(b"T-1\r");
    terminal.wait_for("short failed 20");
    terminal.types(F5);
    terminal.wait_for("Test it again?");
    terminal.types(F2);
    terminal.wait_for("Close the lid.");
    terminal.types(F2);
    terminal.wait_for("look at: A line reads another level");
    // The row appears before the run has ended.
    terminal.wait_for("F4 Repeat");
    terminal.types(F4);
    terminal.wait_for("Close the lid.");
    terminal.types(F7);
    terminal.wait_for("the operator could not do this: Close the lid.");
    terminal.wait_for("SELECTION");
    terminal.types(F10);
    let (status, restored) = terminal.end();
    assert!(restored, "the terminal is not as it was");
    assert_eq!(status.code(), Some(0));
    assert_eq!(outcomes(&place), ["failed", "failed", "items errored"]);
    let verified = place.run(["records", "verify"]);
    assert_eq!(verified.code, Some(0), "{}", verified.stdout);
}

/// A terminal that can move no cursor is refused in words, and nothing is drawn on it.
#[test]
fn a_dumb_terminal_is_refused_in_words() {
    let place = Place::new(STATION);
    let mut command = Command::new("setsid");
    command.arg("--ctty").arg(STATION).args(["--sim"]).current_dir(place.path()).env("TERM", "dumb");
    let mut terminal = Terminal::start(command, 80, 24);
    terminal.wait_for("TERM=dumb");
    terminal.wait_for("--auto PLAN");
    let (status, restored) = terminal.end();
    assert!(restored && status.code() == Some(2), "{status}");
}

/// A signal ends a run in order: the record is complete, and the terminal is restored.
#[test]
fn a_signal_ends_the_run_and_gives_the_terminal_back() {
    for signal in [Signal::SIGTERM, Signal::SIGHUP, Signal::SIGINT] {
        let place = Place::new(STATION);
        let plan = plan();
        let mut terminal = open(&place, &sim(&plan, &[]), 80, 24);
        terminal.wait_for("functional 1.0");
        terminal.types(b"T-1\r");
        terminal.types(F5);
        terminal.wait_for("RUNNING");
        terminal.signal(signal);
        let (status, restored) = terminal.end();
        assert!(restored, "{signal}: the terminal is not as it was");
        assert_eq!(status.code(), Some(4), "{signal}");
        assert_eq!(outcomes(&place), ["aborted"], "{signal}");
        assert_eq!(place.run(["records", "verify"]).code, Some(0), "{signal}");
    }
}

/// F10 and F2 in a run stop it, and the program ends as after a signal.
#[test]
fn leaving_in_a_run_ends_as_a_signal_does() {
    let place = Place::new(STATION);
    let plan = plan();
    let mut terminal = open(&place, &sim(&plan, &[]), 80, 24);
    terminal.wait_for("functional 1.0");
    terminal.types(b"T-1\r");
    terminal.types(F5);
    terminal.wait_for("RUNNING");
    terminal.types(F10);
    terminal.wait_for("switch the module off and leave?");
    terminal.types(F2);
    let (status, restored) = terminal.end();
    assert!(restored, "the terminal is not as it was");
    assert_eq!(status.code(), Some(4));
    assert_eq!(outcomes(&place), ["aborted"]);
}

/// The same without a run and without a record.
#[test]
fn a_signal_ends_an_idle_screen() {
    let place = Place::new(STATION);
    let plan = plan();
    let mut terminal = open(&place, &sim(&plan, &[]), 80, 24);
    terminal.wait_for("functional 1.0");
    terminal.signal(Signal::SIGTERM);
    let (status, restored) = terminal.end();
    assert!(restored, "the terminal is not as it was");
    assert_eq!(status.code(), Some(0));
}

/// The line to the operator is lost: the run ends in order, with its record.
#[test]
fn a_lost_terminal_ends_the_run_with_its_record() {
    let place = Place::new(STATION);
    let plan = plan();
    let mut terminal = open(&place, &sim(&plan, &[]), 80, 24);
    terminal.wait_for("functional 1.0");
    terminal.types(b"T-1\r");
    terminal.types(F5);
    terminal.wait_for("module on");
    terminal.close();
    let (status, _) = terminal.end();
    assert_eq!(status.code(), Some(4));
    assert_eq!(outcomes(&place), ["aborted"]);
    // A terminal that is closed says so twice: by its signal and by the end of its input. The run ends in order.
    assert_eq!(place.record()["stop"]["how"], "in_order");
    let journal = std::fs::read_to_string(place.runs()[0].join("events.jsonl")).expect("a journal");
    assert!(journal.contains(r#""kind":"power","on":false"#), "the module is left on");
    assert_eq!(place.run(["records", "verify"]).code, Some(0));
}

/// The terminal takes no more output (it is stopped, or its line hangs): the run goes on and is filed, and a signal
/// still ends the program.
#[test]
fn a_stopped_terminal_does_not_stop_the_run() {
    let place = Place::new(STATION);
    let plan = plan();
    let mut terminal = open(&place, &sim(&plan, &[]), 200, 60);
    terminal.wait_for("functional 1.0");
    terminal.types(b"T-1\r");
    terminal.types(F5);
    // Curves on a large screen: a few drawings fill the system's buffer for the reader.
    terminal.types(F9);
    terminal.wait_for("gauss");
    let runs = place.runs();
    wait_for_file(&runs[0], "SHA256SUMS");
    terminal.signal(Signal::SIGTERM);
    let status = terminal.end_unread();
    assert_eq!(status.code(), Some(0));
    assert_eq!(outcomes(&place), ["passed"]);
}

/// Waits until a file is in a folder.
fn wait_for_file(folder: &std::path::Path, name: &str) {
    use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
    use nix::sys::inotify::{AddWatchFlags, InitFlags, Inotify};
    use std::os::fd::AsFd as _;
    let inotify = Inotify::init(InitFlags::IN_CLOEXEC).expect("inotify");
    inotify.add_watch(folder, AddWatchFlags::IN_CREATE | AddWatchFlags::IN_MOVED_TO).expect("a watch");
    while !folder.join(name).exists() {
        let minute = PollTimeout::try_from(60_000).expect("a minute");
        let ready = poll(&mut [PollFd::new(inotify.as_fd(), PollFlags::POLLIN)], minute).expect("poll");
        assert!(ready > 0, "{name} does not come into {}", folder.display());
        inotify.read_events().expect("events");
    }
}

/// Windows that change size all the time, down to zero, while a run is on.
#[test]
fn a_storm_of_sizes() {
    let place = Place::new(STATION);
    let plan = plan();
    let mut terminal = open(&place, &sim(&plan, &["--sim-speed", "max"]), 40, 10);
    // Too small for panels.
    terminal.wait_for("80 columns");
    terminal.resize(80, 24);
    terminal.wait_for("functional 1.0");
    terminal.types(b"T-1\r");
    terminal.types(F5);
    let seed = 5;
    println!("seed {seed}");
    let mut dice = ChaCha8Rng::seed_from_u64(seed);
    for _ in 0..300 {
        terminal.resize(dice.random_range(1..220), dice.random_range(1..70));
    }
    terminal.resize(80, 24);
    terminal.wait_until("a whole screen", |screen| {
        let rows: Vec<String> = screen.rows(0, 80).collect();
        rows[0].contains("GNC test station") && rows[23].contains("F10 Leave") && rows[1].starts_with("┌ Module")
    });
    terminal.wait_until("the verdict", |screen| screen.contents().contains("passed · T-1 ──"));
    terminal.types(F10);
    let (status, restored) = terminal.end();
    assert!(restored && status.code() == Some(0), "{status}");
    assert_eq!(outcomes(&place), ["passed"]);
}

/// A megabyte of random input: it starts nothing, and nothing is lost afterwards.
#[test]
fn a_megabyte_of_garbage() {
    let place = Place::new(STATION);
    let plan = plan();
    let mut terminal = open(&place, &sim(&plan, &["--sim-speed", "max"]), 80, 24);
    terminal.wait_for("functional 1.0");
    let seed = 11;
    println!("seed {seed}");
    let mut dice = ChaCha8Rng::seed_from_u64(seed);
    let mut garbage = vec![0u8; 1 << 20];
    dice.fill(&mut garbage[..]);
    // Function keys are commands from any source; a person does not type a thousand of them by accident.
    let garbage: Vec<u8> = garbage.into_iter().filter(|byte| *byte != 0x1b).collect();
    terminal.types(&garbage);
    // In pasted text, escape sequences are text too.
    let mut pasted = b"\x1b[200~".to_vec();
    pasted.extend(garbage.iter().take(100_000));
    pasted.extend(b"\x1b[21~\x1b[15~\x1b[201~");
    terminal.types(&pasted);
    terminal.types(ESC);
    terminal.types(ESC);
    terminal.wait_until("an empty line", |screen| {
        !screen.contents().contains('_') || screen.contents().contains("scan the label")
    });
    terminal.types(b"T-1\r");
    terminal.wait_for("T-1: F5 starts the test.");
    assert!(place.runs().is_empty(), "garbage started a run");
    terminal.types(F10);
    let (status, restored) = terminal.end();
    assert!(restored && status.code() == Some(0), "{status}");
}

/// All pages one after the other, in the language of the locale or in the requested one.
#[test]
fn pages_and_languages() {
    let place = Place::new(STATION);
    let plan = plan();
    let mut terminal = open(&place, &sim(&plan, &["--lang", "zh"]), 160, 50);
    terminal.wait_for("扫描后按 F5");
    terminal.types(F9);
    terminal.wait_for("也可按 F5 直接观察");
    terminal.types(F5);
    terminal.wait_for("正在观察");
    terminal.wait_for("IMU ");
    terminal.types(F9);
    terminal.wait_for("中没有运行记录");
    terminal.types(F1);
    terminal.wait_for("重新读取记录");
    terminal.types(F10);
    let (status, restored) = terminal.end();
    assert!(restored && status.code() == Some(0), "{status}");
    assert!(place.runs().is_empty(), "watching left a record");
}

/// Without a terminal the screen says what to do instead.
#[test]
fn no_terminal_no_screen() {
    let place = Place::new(STATION);
    let run = place.run(["--sim"]);
    assert_eq!(run.code, Some(2));
    assert!(run.stderr.contains("needs a terminal") && run.stderr.contains("--auto"), "{}", run.stderr);
}
