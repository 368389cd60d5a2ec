//! Between the check of a plan and its run: changed files, and interrupted runs.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::os::unix::process::ExitStatusExt as _;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use gnc_tests::{Place, read_json};
use nix::sys::signal::Signal;

use crate::terminal::Terminal;
use crate::{ESC, F2, F5, F10, STATION, mock, open, outcomes};

const F6: &[u8] = b"\x1b[17~";

const PLAN: &str = "name = \"short\"\nversion = \"1\"\ninclude = [\"limits.toml\"]\n";
const LIMITS: &str =
    "name = \"limits\"\nversion = \"1\"\n[[item]]\nid = \"cpu\"\nlimits.core1_register_errors = \"<= 0\"\n";

/// A screen with the plan checked and a module scanned.
fn scanned(more: &[&str]) -> (Place, Terminal) {
    let place = Place::new(STATION);
    place.write("p.toml", PLAN);
    place.write("limits.toml", LIMITS);
    let args = ["--sim", "--sim-speed", "max", "--plan", "p.toml"];
    let mut terminal = open(&place, &[&args, more].concat(), 80, 24);
    terminal.wait_for("short 1");
    terminal.types(b"T-1\r");
    (place, terminal)
}

/// Waits for the end of a run with this outcome; only then can failed items be repeated.
fn ends(terminal: &mut Terminal, outcome: &str) {
    terminal.wait_until("the verdict", |screen| {
        let text = screen.contents();
        text.contains(outcome) && text.contains("F4")
    });
}

fn leaves(mut terminal: Terminal) {
    terminal.types(F10);
    let (status, restored) = terminal.end();
    assert!(restored && status.code() == Some(0), "{status}");
}

/// The text of a file in the record's plan.
fn filed(place: &Place, name: &str) -> Option<String> {
    fs::read_to_string(place.runs()[0].join("plan").join(name)).ok()
}

/// An included file is edited between check and start: the operator is told which file, and the checked plan runs.
#[test]
fn the_checked_plan_runs_though_a_file_was_edited() {
    for (lang, told, verdict) in [
        ("en", "limits.toml was changed since it was checked.", "passed"),
        ("zh", "limits.toml 在检查后被更改。", "合格"),
        ("ru", "limits.toml изменён после проверки.", "годен"),
    ] {
        let (place, mut terminal) = scanned(&["--lang", lang]);
        terminal.wait_for("T-1");
        place.write("limits.toml", &LIMITS.replace("<= 0", "<= 1000000"));
        terminal.types(F5);
        terminal.wait_for(told);
        assert!(place.runs().is_empty(), "it was run without a word");
        terminal.types(F6);
        ends(&mut terminal, verdict);
        leaves(terminal);
        assert_eq!(outcomes(&place), ["passed"]);
        assert_eq!(filed(&place, "02-limits.toml").as_deref(), Some(LIMITS));
        let run = place.runs()[0].display().to_string();
        assert_eq!(place.run(["recompute", &run]).code, Some(0));
    }
}

/// The plan itself is edited: the screen reads, checks and shows it again, and it runs with the next F5.
#[test]
fn the_new_plan_is_shown_before_it_runs() {
    let (place, mut terminal) = scanned(&[]);
    let new = PLAN.replace("version = \"1\"", "version = \"2\"");
    place.write("p.toml", &new);
    terminal.types(F5);
    terminal.wait_for("p.toml was changed");
    terminal.types(F2);
    terminal.wait_for("short 2");
    assert!(place.runs().is_empty(), "it was not shown before");
    terminal.types(F5);
    ends(&mut terminal, "passed");
    leaves(terminal);
    assert_eq!(filed(&place, "01-p.toml"), Some(new));
    // A plan with a mistake is refused as with F2.
    let (place, mut terminal) = scanned(&[]);
    place.write("limits.toml", &LIMITS.replace("cpu", "cpo"));
    terminal.types(F5);
    terminal.wait_for("limits.toml was changed");
    terminal.types(F2);
    terminal.wait_for("unknown item \"cpo\"");
    leaves(terminal);
    assert!(place.runs().is_empty());
}

/// A bench file is treated like a plan: the one that was shown counts.
#[test]
fn the_checked_bench_is_used_though_its_file_was_edited() {
    let place = Place::new(STATION);
    let board = mock("good");
    let bench = board.bench_file("line-2");
    place.write("bench.toml", &bench);
    place.write("p.toml", LIMITS);
    let mut terminal = open(&place, &["--plan", "p.toml"], 80, 24);
    terminal.wait_for("limits 1");
    terminal.types(b"T-1\r");
    place.write("bench.toml", &bench.replace("line-2", "line-3"));
    terminal.types(F5);
    terminal.wait_for("bench.toml was changed");
    terminal.types(F6);
    ends(&mut terminal, "passed");
    leaves(terminal);
    assert_eq!(read_json(&place.runs()[0].join("run.json"))["station"], "line-2");
}

/// Missing files count as changed files. The answer may be neither of the two.
#[test]
fn a_plan_that_is_gone_is_told() {
    let (place, mut terminal) = scanned(&[]);
    fs::remove_file(place.path().join("p.toml")).expect("a plan");
    terminal.types(F5);
    terminal.wait_for("p.toml cannot be read any more: No such file");
    terminal.types(ESC);
    terminal.wait_until("the question is gone", |screen| !screen.contents().contains("cannot be read any more"));
    leaves(terminal);
    assert!(place.runs().is_empty());
}

const CAPTURES: &str = "name = \"long\"\nversion = \"1\"\n\
                        [[item]]\nid = \"six-position\"\nparams = { dwell = \"10 s\", settle = \"0 s\" }\n\
                        limits.residual_rms = \"<= 5 mg\"\n\
                        [[item]]\nid = \"imu\"\nparams = { samples = 10000, rate = \"50 Hz\" }\ntimeout = \"400 s\"\n\
                        limits.gyro_x = \"0 +- 1 deg/s\"\n";

/// A run of module C-1 that was killed after its first item.
fn broken(place: &Place) -> PathBuf {
    place.write("long.toml", CAPTURES);
    let args = ["--auto", "long.toml", "--sim", "--sim-speed", "40", "--serial-number", "C-1", "--events"];
    let mut station = place.station(args).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("the station");
    let lines = BufReader::new(station.stdout.take().expect("its output")).lines();
    let ended = "\"kind\":\"item_ended\",\"item\":\"six-position\",\"outcome\":\"passed\"";
    assert!(lines.map_while(Result::ok).any(|line| line.contains(ended)), "it did not pass");
    station.kill().expect("alive");
    station.wait().expect("dead");
    place.runs().remove(0)
}

fn open_long(place: &Place, more: &[&str]) -> Terminal {
    let args = ["--sim", "--sim-speed", "max", "--plan", "long.toml"];
    let mut terminal = open(place, &[&args, more].concat(), 80, 24);
    terminal.wait_for("long 1");
    terminal
}

/// A module with an interrupted run is scanned: the screen offers to go on, and takes over the captures.
#[test]
fn a_run_that_broke_off_is_offered() {
    let place = Place::new(STATION);
    let broken = broken(&place);
    let name = broken.file_name().expect("a name").to_str().expect("UTF-8").to_owned();

    // The screen does not offer a run that `--auto` would refuse: here another plan under the same name.
    place.write("long.toml", &CAPTURES.replace("<= 5 mg", "<= 6 mg"));
    let mut terminal = open_long(&place, &[]);
    terminal.types(b"C-1\r");
    terminal.types(F5);
    terminal.wait_for("Test it again?");
    terminal.types(ESC);
    leaves(terminal);
    // On request it is refused with the reason, and nothing runs.
    let mut terminal = open_long(&place, &["--resume", broken.to_str().expect("UTF-8")]);
    terminal.wait_for("C-1: F5 resumes");
    terminal.types(F5);
    terminal.wait_for("had the plan with the digest");
    terminal.types(ESC);
    leaves(terminal);
    assert_eq!(place.runs().len(), 1);

    place.write("long.toml", CAPTURES);
    let mut terminal = open_long(&place, &[]);
    terminal.types(b"C-1\r");
    terminal.types(F5);
    terminal.wait_for("capture the rest");
    terminal.types(F2);
    ends(&mut terminal, "passed");
    leaves(terminal);
    let runs = place.runs();
    let new = runs.iter().find(|run| **run != broken).expect("a run of its own");
    let record = read_json(&new.join("run.json"));
    assert_eq!((record["outcome"].as_str(), record["resumed"]["run"].as_str()), (Some("passed"), Some(&*name)));
    let captured = |run: &PathBuf| gnc_records::store::captures::read(&run.join("01-six-position/attempt-1.mcap"));
    assert_eq!(captured(new).expect("captures").captures, captured(&broken).expect("captures").captures);
    let again = place.run(["recompute", new.to_str().expect("UTF-8")]);
    assert_eq!(again.code, Some(0), "{}{}", again.stdout, again.stderr);

    // The module now has a complete run: the screen offers nothing, but the run sealed meanwhile can still be
    // requested.
    let mut terminal = open_long(&place, &["--resume", broken.to_str().expect("UTF-8")]);
    terminal.types(F5);
    terminal.wait_for("capture the rest");
    terminal.types(ESC);
    leaves(terminal);
    let mut terminal = open_long(&place, &[]);
    terminal.types(b"C-1\r");
    terminal.types(F5);
    terminal.wait_for("Test it again?");
    terminal.types(ESC);
    leaves(terminal);
}

/// A missing run is refused before the screen opens, as by `--auto`.
#[test]
fn a_run_to_take_up_must_be_there() {
    let place = Place::new(STATION);
    fs::create_dir(place.path().join("records")).expect("a folder");
    let mut terminal = open(&place, &["--sim", "--resume", "2026-11-22/T-1/143015-x"], 80, 24);
    terminal.wait_for("there is no run");
    let (status, restored) = terminal.end();
    assert!(restored && status.code() == Some(2), "{status}");
}

/// The screen refuses a plan whose required plan was not passed, in the words of `--auto`.
#[test]
fn a_required_plan_is_asked_for() {
    let place = Place::new(STATION);
    let plan = "name = \"second\"\nversion = \"1\"\nrequires_plan = [\"first\"]\n[[item]]\nid = \"cpu\"\n\
                limits.core1_register_errors = \"<= 0\"\n";
    place.write("second.toml", plan);
    let mut terminal = open(&place, &["--sim", "--sim-speed", "max", "--plan", "second.toml"], 160, 50);
    terminal.wait_for("second 1");
    terminal.types(b"C-1\r");
    terminal.wait_for("never tested");
    terminal.types(F5);
    terminal.wait_for("second requires a pass of first, and C-1 has none that counts: never tested");
    leaves(terminal);
    assert!(place.runs().is_empty());
}

/// Folders of this many runs of other modules on a day long ago, each with a journal that says nothing.
fn old_runs(place: &Place, count: usize) -> PathBuf {
    let day = place.path().join("records/2020-01-02");
    for number in 0..count {
        let run = day.join(format!("OLD-{number}/{:06}-long", number % 86_400));
        fs::create_dir_all(&run).expect("a folder");
        fs::write(run.join("events.jsonl"), "no event\n").expect("a journal");
        fs::write(run.join("SHA256SUMS"), "").expect("digests");
    }
    day
}

/// The power goes in mid-run. The next start tells of that run by itself, also on top of thousands of old ones, and the run
/// is taken up on the screen.
#[test]
fn a_killed_run_is_told_at_the_next_start() {
    let place = Place::new(STATION);
    old_runs(&place, 2000);
    place.write("long.toml", CAPTURES);
    let mut terminal = open(&place, &["--sim", "--sim-speed", "20", "--plan", "long.toml"], 80, 24);
    terminal.wait_for("long 1");
    terminal.types(b"C-1\r");
    terminal.wait_for("C-1: F5 starts the test.");
    terminal.types(F5);
    terminal.wait_for("✓ six-position");
    terminal.signal(Signal::SIGKILL);
    let (status, _) = terminal.end();
    assert_eq!(status.signal(), Some(Signal::SIGKILL as i32), "{status}");
    let of_module = || place.runs().into_iter().filter(|run| run.components().any(|part| part.as_os_str() == "C-1"));
    let broken = of_module().next().expect("the killed run");
    assert!(!broken.join("SHA256SUMS").exists(), "it was closed");

    let mut terminal = open_long(&place, &[]);
    terminal.wait_for("broke off: scan the module to resume it");
    assert!(terminal.text().contains("run of C-1 of "), "{}", terminal.text());
    terminal.types(b"C-1\r");
    terminal.wait_for("broke off; F5 offers to resume it");
    terminal.types(F5);
    terminal.wait_for("capture the rest");
    terminal.types(F2);
    ends(&mut terminal, "passed");
    leaves(terminal);
    let new = of_module().find(|run| *run != broken).expect("a run of its own");
    let record = read_json(&new.join("run.json"));
    let resumed = record["resumed"]["run"].as_str();
    assert_eq!(
        (record["outcome"].as_str(), resumed),
        (Some("passed"), broken.file_name().and_then(|name| name.to_str()))
    );
}

/// Lends a journal out as a file server does: who opens it waits until it is given back. It tells when it is asked for.
const HOLDER: &str = "import fcntl, os, signal, sys\n\
    held = os.open(sys.argv[1], os.O_RDWR)\n\
    signal.signal(signal.SIGIO, lambda *_: print('asked for', flush=True))\n\
    fcntl.fcntl(held, fcntl.F_SETLEASE, fcntl.F_WRLCK)\n\
    print('held', flush=True)\n\
    sys.stdin.read()\n\
    fcntl.fcntl(held, fcntl.F_SETLEASE, fcntl.F_UNLCK)\n";

/// The disk is slow: the search for a run that broke off waits for a journal, here one that another program has on loan.
/// Meanwhile the screen is drawn and takes a scan.
#[test]
fn the_search_for_a_broken_run_delays_no_picture() {
    let place = Place::new(STATION);
    place.write("short.toml", LIMITS);
    let newest = old_runs(&place, 2000).join("OLD-0/235959-long");
    fs::create_dir_all(&newest).expect("a folder");
    fs::write(newest.join("log.txt"), "a run").expect("a file");
    let journal = newest.join("events.jsonl");
    fs::write(&journal, "no event\n").expect("a journal");
    let mut holder = Command::new("python3")
        .args(["-c", HOLDER])
        .arg(&journal)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("python3");
    let (tell, told) = mpsc::channel();
    let lines = BufReader::new(holder.stdout.take().expect("its output")).lines();
    thread::spawn(move || lines.map_while(Result::ok).try_for_each(|line| tell.send(line)));
    let told = || told.recv_timeout(Duration::from_secs(60)).expect("the search does not read the newest run");
    assert_eq!(told(), "held");
    let mut terminal = open(&place, &["--sim", "--sim-speed", "max", "--plan", "short.toml"], 80, 24);
    terminal.wait_for("limits 1");
    terminal.types(b"T-1\r");
    terminal.wait_for("T-1: F5 starts the test.");
    // The search waits there now, and not before the picture.
    assert_eq!(told(), "asked for");
    drop(holder.stdin.take());
    assert!(holder.wait().expect("its end").success());
    terminal.types(F5);
    ends(&mut terminal, "passed");
    leaves(terminal);
}
