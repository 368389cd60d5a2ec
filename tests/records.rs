//! The files of a run on disk: complete, believable, and readable even after a crash.

#![expect(clippy::expect_used, reason = "what cannot be set up fails the test that needs it")]

use std::fs::{self, OpenOptions};
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};

use gnc_executive::event::Event;
use gnc_executive::journal;
use gnc_executive::state::RunState;
use gnc_records::store::as_written;
use gnc_records::store::reader;
use gnc_tests::{PARTIAL, Place, functional_plan, read_json};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rand::{RngExt as _, SeedableRng as _};

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");
/// The moments at which runs are killed; another seed gives other moments.
const KILL_SEED: u64 = 20_261_122;
const KILLS: usize = 100;

fn args<'a>(plan: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let mut args = vec!["--auto", plan, "--sim", "--serial-number", "T-1"];
    args.extend(more);
    args
}

#[test]
fn a_run_leaves_everything_that_proves_it() {
    let place = Place::new(STATION);
    let run = place.functional("--sim", &["--sim-speed", "max", "--operator", "Zhang Wei", "--station", "line-7"]);
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    let folder = &place.runs()[0];
    let below = folder.strip_prefix(place.path().join("records")).expect("below the records");
    let parts: Vec<String> = below.iter().map(|part| part.to_string_lossy().into_owned()).collect();
    let [day, serial, name] = parts.as_slice() else { panic!("{parts:?}") };
    assert!(chrono_like(day, "dddd-dd-dd") && serial == "T-1", "{parts:?}");
    assert!(chrono_like(&name[..6], "dddddd") && &name[6..] == "-functional", "{name}");

    let record = place.record();
    for key in ["schema", "started", "finished"] {
        assert!(record[key].is_string(), "{key}: {}", record[key]);
    }
    assert_eq!(record["outcome"], "passed");
    assert_eq!(record["serial_number"], "T-1");
    assert_eq!(record["operator"], "Zhang Wei");
    assert_eq!(record["station"], "line-7");
    assert_eq!(record["bench"]["kind"], "simulated");
    assert_eq!(record["plan"]["sha256"].as_str().map(str::len), Some(64));
    let items = record["items"].as_array().expect("items");
    let ids: Vec<&str> = items.iter().filter_map(|item| item["id"].as_str()).collect();
    let all = "identity gnss cpu timers internal-ram sdram spi-flash internal-flash imu ad io spi sci can";
    assert_eq!(ids.join(" "), all);
    for item in items.iter().filter(|item| item["id"] != "can") {
        assert_eq!(item["outcome"], "passed", "{item}");
        let measurements = item["attempts"][0]["measurements"].as_array().expect("measurements");
        for measurement in measurements {
            for key in ["name", "value", "unit", "low", "high", "expected", "outcome"] {
                assert!(measurement.get(key).is_some(), "{key} is missing in {measurement}");
            }
        }
        assert!(measurements.iter().any(|measurement| measurement["outcome"] == "passed"), "{item}");
    }
    let log = fs::read_to_string(folder.join("log.txt")).expect("log.txt");
    assert!(log.contains("SIMULATED BENCH"), "{log}");
    assert!(folder.join("01-identity/item.json").exists());
    assert!(folder.join("plan/01-functional.toml").exists());
    assert_eq!(fs::read(folder.join("plan/01-functional.toml")).ok(), fs::read(functional_plan()).ok());
    assert_eq!(as_written::verify(folder), Vec::<String>::new());
}

/// Whether a text matches a pattern in which `d` stands for a digit.
fn chrono_like(text: &str, pattern: &str) -> bool {
    text.len() == pattern.len()
        && text.chars().zip(pattern.chars()).all(|(a, b)| if b == 'd' { a.is_ascii_digit() } else { a == b })
}

/// One change in one file of a finished run is found and named.
#[test]
fn verify_finds_what_was_changed() {
    let place = Place::new(STATION);
    assert_eq!(place.functional("--sim", &["--sim-speed", "max", "--only", "identity,cpu"]).code, PARTIAL);
    let folder = &place.runs()[0];
    let whole = |file: &str| fs::read(folder.join(file)).expect(file);
    type Spoil = fn(&Path);
    let spoilers: [(&str, Spoil, &str); 5] = [
        ("run.json", |path| replace(path, "\"passed\"", "\"failed\""), "run.json was changed"),
        ("events.jsonl", |path| replace(path, "\"elapsed_us\":", "\"elapsed_us\":1"), "events.jsonl was changed"),
        ("log.txt", |path| fs::remove_file(path).expect("log.txt"), "log.txt is missing"),
        ("SHA256SUMS", |path| fs::remove_file(path).expect("SHA256SUMS"), "SHA256SUMS is missing"),
        ("03-cpu/item.json", |path| fs::write(path, "{}").expect("item.json"), "03-cpu/item.json was changed"),
    ];
    for (file, spoil, expected) in spoilers {
        let before = whole(file);
        spoil(&folder.join(file));
        let problems = as_written::verify(folder);
        assert!(problems.iter().any(|problem| problem.contains(expected)), "{file}: {problems:?}");
        let run = place.run(["records", "verify"]);
        assert_eq!(run.code, Some(1), "{}{}", run.stdout, run.stderr);
        fs::write(folder.join(file), before).expect(file);
    }
    fs::write(folder.join("extra.txt"), "x").expect("extra.txt");
    assert_eq!(as_written::verify(folder), ["extra.txt was added"]);
    fs::remove_file(folder.join("extra.txt")).expect("extra.txt");
    assert_eq!(place.run(["records", "verify"]).code, Some(0));
}

fn replace(path: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(path).expect("a text");
    assert!(text.contains(from), "{from} is not in {}", path.display());
    fs::write(path, text.replacen(from, to, 1)).expect("writable");
}

/// The events of `--events` and the journal fold to the same state.
#[test]
fn the_live_run_and_the_stored_one_agree() {
    let place = Place::new(STATION);
    let run = place.functional("--sim", &["--sim-speed", "max", "--events"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let mut live = RunState::new();
    for line in run.stdout.lines() {
        let event: Event = serde_json::from_str(line).expect("an event");
        live.apply(&event).expect("in order");
    }
    let stored = reader::fold(&place.runs()[0]).expect("a journal");
    assert_eq!(live, stored);
    assert!(run.stderr.contains("PASSED"), "people read standard error then: {}", run.stderr);
}

/// A run is killed after a random number of events: all shown events are in the journal, and the run reads as
/// interrupted.
#[test]
fn sigkill_at_any_moment_leaves_a_readable_journal() {
    println!("seed {KILL_SEED}");
    let whole = Place::new(STATION);
    let events = whole.functional("--sim", &["--sim-speed", "max", "--events"]).stdout.lines().count();
    let mut dice = rand_chacha::ChaCha8Rng::seed_from_u64(KILL_SEED);
    let moments: Vec<usize> = (0..KILLS).map(|_| dice.random_range(1..events)).collect();
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                while let Some(&moment) = moments.get(next.fetch_add(1, Ordering::Relaxed)) {
                    killed_after(moment);
                }
            });
        }
    });
}

fn killed_after(moment: usize) {
    let place = Place::new(STATION);
    let plan = functional_plan();
    let plan = plan.to_string_lossy();
    let mut child = place
        .station(args(&plan, &["--sim-speed", "max", "--events"]))
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the station");
    let mut lines = BufReader::new(child.stdout.take().expect("its output")).lines();
    let shown: Vec<String> = lines.by_ref().take(moment).map(|line| line.expect("a line")).collect();
    child.kill().expect("kill");
    child.wait().expect("its end");
    let folder = place.runs().pop().expect("a run");
    let journal = fs::read(folder.join("events.jsonl")).expect("a journal");
    let stored = String::from_utf8_lossy(&journal);
    let stored: Vec<&str> = stored.lines().collect();
    assert!(shown.len() == moment && stored.len() >= moment, "killed after event {moment}");
    for (shown, stored) in shown.iter().zip(&stored) {
        assert_eq!(shown, stored, "killed after event {moment}");
    }
    let state = journal::fold(&journal).expect("a readable journal").state;
    let list = place.run(["records", "list"]);
    assert_eq!(list.code, Some(0), "{}", list.stderr);
    // The last event may not have reached the disk before the kill.
    let sealed = folder.join("SHA256SUMS").exists();
    let expected = match state.verdict() {
        None => "interrupted",
        Some(_) if !sealed => "unsealed",
        Some(_) => "passed",
    };
    assert!(list.stdout.starts_with(expected), "killed after event {moment}: {}", list.stdout);
    if expected != "passed" {
        assert_eq!(place.run(["records", "verify"]).code, Some(3), "killed after event {moment}");
    }
}

/// A journal whose last line is cut at any place is read up to the last complete event.
#[test]
fn a_journal_cut_anywhere_is_read_up_to_its_last_whole_event() {
    let place = Place::new(STATION);
    assert_eq!(place.functional("--sim", &["--sim-speed", "max", "--only", "io"]).code, PARTIAL);
    let path = place.runs()[0].join("events.jsonl");
    let whole = fs::read(&path).expect("a journal");
    let ends: Vec<usize> = (0..whole.len()).filter(|at| whole[*at] == b'\n').collect();
    for cut in 0..whole.len() {
        let journal = journal::fold(&whole[..cut]).unwrap_or_else(|error| panic!("cut at {cut}: {error}"));
        // An event with a complete text counts, even if its line end is missing.
        let complete = ends.iter().filter(|end| **end <= cut).count();
        assert_eq!(journal.state.next_seq(), complete as u64, "cut at {cut}");
    }
}

/// The first ctrl-C ends the run in order, with teardown; the module is off and the record says who stopped the run.
#[test]
fn the_first_signal_ends_in_order() {
    for signal in [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP] {
        let place = Place::new(STATION);
        let (code, events) = stopped(&place, &[signal]);
        assert_eq!(code, Some(4), "{signal}");
        let record = place.record();
        assert_eq!(record["outcome"], "aborted", "{signal}");
        assert_eq!(record["stop"]["how"], "in_order", "{signal}");
        let items = record["items"].as_array().expect("items");
        let outcome = |id: &str| items.iter().find(|item| item["id"] == id).and_then(|item| item["outcome"].as_str());
        assert_eq!(outcome("identity"), Some("passed"), "{signal}");
        // Items in flight are aborted; items that had not begun are not run.
        assert_eq!((outcome("sdram"), outcome("sci")), (Some("aborted"), Some("not_run")), "{signal}");
        assert!(events.contains(r#""kind":"power","on":false"#), "the module is off: {events}");
        assert_eq!(as_written::verify(&place.runs()[0]), Vec::<String>::new());
    }
}

/// The second ctrl-C ends the run at once: without teardown, but with a complete record.
#[test]
fn the_second_signal_ends_at_once() {
    let place = Place::new(STATION);
    let (code, _) = stopped(&place, &[Signal::SIGINT, Signal::SIGINT]);
    assert_eq!(code, Some(4));
    let record = place.record();
    assert_eq!(record["outcome"], "aborted");
    assert_eq!(as_written::verify(&place.runs()[0]), Vec::<String>::new());
}

/// Starts a run at true speed and sends signals as soon as the SDRAM test is under way.
fn stopped(place: &Place, signals: &[Signal]) -> (Option<i32>, String) {
    let plan = functional_plan();
    let plan = plan.to_string_lossy();
    let mut child = place
        .station(args(&plan, &["--events"]))
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the station");
    let mut reader = BufReader::new(child.stdout.take().expect("its output"));
    let mut seen = String::new();
    while !seen.contains(r#""kind":"item_started","item":"sdram""#) {
        assert_ne!(reader.read_line(&mut seen).expect("a line"), 0, "{seen}");
    }
    let pid = Pid::from_raw(i32::try_from(child.id()).expect("a process id"));
    for signal in signals {
        kill(pid, *signal).expect("alive");
    }
    std::io::Read::read_to_string(&mut reader, &mut seen).expect("the rest");
    (child.wait().expect("its end").code(), seen)
}

/// A folder that cannot be written is refused before the module gets power.
#[test]
fn an_unwritable_records_folder_is_refused_before_power_on() {
    let place = Place::new(STATION);
    let file = place.write("taken", "a file, not a folder");
    let run = place.functional("--sim", &["--records", &file.to_string_lossy(), "--events"]);
    assert_eq!(run.code, Some(2), "{}", run.stderr);
    assert!(run.stdout.is_empty(), "no event, so no power: {}", run.stdout);
    assert!(run.stderr.contains("cannot create") && run.stderr.contains("--records"), "{}", run.stderr);
}

/// The disk fills during the run: items shown as passed are on disk, the run is errored, and it says why.
#[test]
fn a_write_that_fails_in_mid_run_turns_the_outcome_to_errored() {
    let place = Place::new(STATION);
    let plan = functional_plan();
    let plan = plan.to_string_lossy();
    // A file may grow to 16 kB; the signal that comes with the error is ignored, as on a full disk.
    let script = "trap '' XFSZ; ulimit -f 16; exec \"$@\"";
    let output = Command::new("bash")
        .args(["-c", script, "bash", STATION])
        .args(args(&plan, &["--sim-speed", "max"]))
        .current_dir(place.path())
        .stdin(Stdio::null())
        .output()
        .expect("bash");
    let stdout = String::from_utf8_lossy(&output.stdout);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{stdout}{stderr}");
    assert!(!stdout.contains("PASSED"), "{stdout}");
    assert!(stderr.contains("ERRORED") && stderr.contains("could not be written"), "{stderr}");
    let state = reader::fold(&place.runs()[0]).expect("a readable journal");
    let shown = stdout.lines().filter(|line| line.starts_with("passed")).count();
    let stored = state.rows().iter().filter(|row| row.outcome.is_good()).count();
    assert!(shown > 0 && shown <= stored, "{shown} shown, {stored} stored: {stdout}");
    assert!(state.is_interrupted());
}

/// Two runs in the same second have separate folders.
#[test]
fn runs_in_one_second_do_not_share_a_folder() {
    let place = Place::new(STATION);
    let run = place.functional("--sim", &["--sim-speed", "max", "--only", "io", "--loops", "3"]);
    assert_eq!(run.code, PARTIAL, "{}{}", run.stdout, run.stderr);
    let runs = place.runs();
    assert_eq!(runs.len(), 3, "{runs:?}");
    for (index, run) in runs.iter().enumerate() {
        let record = read_json(&run.join("run.json"));
        assert_eq!(record["loop"]["index"], index + 1);
        assert_eq!(record["selection"][0], "io");
        assert_eq!((record["outcome"].as_str(), record["selection_outcome"].as_str()), (None, Some("passed")));
    }
}

/// The folder of a run that had only begun is listed and causes no error.
#[test]
fn a_run_cut_off_at_its_very_start_is_listed() {
    let place = Place::new(STATION);
    let folder = place.path().join("records/2026-11-22/T-1/143015-functional");
    fs::create_dir_all(&folder).expect("a folder");
    let mut journal = OpenOptions::new().create(true).append(true).open(folder.join("events.jsonl")).expect("a file");
    journal.write_all(b"{\"seq\":0,\"at").expect("half a line");
    let run = place.run(["records", "list"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stdout.contains("143015-functional"), "{}", run.stdout);
    let run = place.run(["records", "show", "2026-11-22/T-1/143015-functional"]);
    assert_eq!(run.code, Some(2), "{}", run.stdout);
    assert!(run.stderr.contains("cut off at its start"), "{}", run.stderr);
}

/// Runs are found by folder and by serial number; a missing run is named in the user's words.
#[test]
fn a_run_is_found_by_its_serial_number() {
    let place = Place::new(STATION);
    assert_eq!(place.functional("--sim", &["--sim-speed", "max", "--only", "cpu"]).code, PARTIAL);
    let record = fs::read_to_string(place.runs()[0].join("run.json")).expect("run.json");
    let record: serde_json::Value = serde_json::from_str(&record).expect("JSON");
    let serial_number = record["serial_number"].as_str().expect("a text");
    let run = place.run(["records", "show", serial_number]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stdout.contains(serial_number), "{}", run.stdout);
    let run = place.run(["records", "verify", serial_number]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stdout.contains("1 of 1 runs are as written"), "{}", run.stdout);
    for what in ["show", "verify"] {
        let run = place.run(["records", what, "SN-NEVER"]);
        assert_eq!(run.code, Some(2), "{}", run.stdout);
        assert!(run.stderr.contains("there is no run SN-NEVER"), "{}", run.stderr);
    }
}

/// A whole run is removed from the folder: the remaining files are all right, but the removal is still found.
#[test]
fn a_run_that_was_taken_away_is_missed() {
    let place = Place::new(STATION);
    for _ in 0..2 {
        assert_eq!(place.functional("--sim", &["--sim-speed", "max", "--only", "cpu"]).code, PARTIAL);
    }
    let run = place.run(["records", "verify"]);
    assert!(run.stdout.contains("the chain of 2 closed runs is whole"), "{}", run.stdout);
    fs::remove_dir_all(&place.runs()[1]).expect("a run");
    let run = place.run(["records", "verify"]);
    assert_eq!(run.code, Some(1), "{}", run.stderr);
    assert!(run.stdout.contains("was closed, and its folder is missing"), "{}", run.stdout);
}

/// A module that is exchanged half way: the run is of neither, and what followed was not run.
#[test]
fn a_module_that_is_exchanged_in_mid_run_is_filed_against_neither() {
    let place = Place::new(STATION);
    place.write("swapped.toml", "description = \"swapped\"\n[module]\nswapped_after = 3\n");
    let plan = "name = \"cycles\"\nversion = \"1\"\non_fail = \"continue\"\n[[item]]\nid = \"power-cycle\"\nparams = { cycles = 5 }\n\
                limits.starts_missed = \"<= 0\"\n[[item]]\nid = \"cpu\"\nlimits.core1_register_errors = \"<= 0\"\n";
    place.write("p.toml", plan);
    let more = ["--sim=swapped.toml", "--sim-speed", "max", "--serial-number", "SN-1", "--loops", "2"];
    let errored = place.run(["--auto", "p.toml"].iter().chain(&more));
    assert_eq!(errored.code, Some(3), "{}{}", errored.stdout, errored.stderr);
    assert!(errored.stdout.contains("NOT THE SCANNED MODULE: SN-1 was scanned, SIM-OTHER is in the socket"));
    // Another round would test a stranger.
    let runs = place.runs();
    assert_eq!(runs.len(), 1, "{runs:?}");
    assert_eq!(runs[0].parent().and_then(std::path::Path::file_name), Some("_unassigned".as_ref()));
    let record = gnc_tests::read_json(&runs[0].join("run.json"));
    let exchanged = serde_json::json!({ "scanned": "SN-1", "found": "SIM-OTHER", "exchanged": true });
    assert_eq!(record["other_module"], exchanged);
    let ends: Vec<&serde_json::Value> =
        record["items"].as_array().expect("items").iter().map(|item| &item["outcome"]).collect();
    assert_eq!(ends, ["errored", "not_run"]);
    assert_eq!(place.run(["records", "show", "SN-1"]).code, Some(2));
    assert_eq!(place.run(["records", "verify"]).code, Some(0));
    let again = place.run(["recompute", &runs[0].display().to_string()]);
    assert_eq!(again.code, Some(0), "{}{}", again.stdout, again.stderr);
}

/// Another module in the socket than was scanned: errored, never failed; filed against neither number, with both inside.
#[test]
fn another_module_than_was_scanned_is_filed_against_neither() {
    let place = Place::new(STATION);
    let plan = functional_plan().display().to_string();
    let run = |number: &str, more: &[&str]| {
        let sim = ["--auto", &plan, "--sim=wrong-serial-number", "--sim-speed", "max", "--serial-number", number];
        place.run(sim.iter().chain(more))
    };
    for (more, rounds) in [(&[][..], 1), (&["--only", "io"], 2), (&["--loops", "3"], 3)] {
        let errored = run("SN-1", more);
        assert_eq!(errored.code, Some(3), "{}{}", errored.stdout, errored.stderr);
        let told = "this is not the module that was scanned: \"SN-1\" was scanned, and the module in the socket says that it is \"GNC-0666\"";
        assert!(errored.stdout.contains(told), "{}", errored.stdout);
        assert!(errored.stdout.contains("NOT THE SCANNED MODULE: SN-1 was scanned, GNC-0666 is in the socket"));
        // Another round would find the same.
        let runs = place.runs();
        assert_eq!(runs.len(), rounds);
        let folder = runs.last().expect("a run");
        assert_eq!(folder.parent().and_then(std::path::Path::file_name), Some("_unassigned".as_ref()));
        assert!(
            errored
                .stdout
                .contains(&format!("record: {}", folder.strip_prefix(place.path()).expect("below").display()))
        );
        let record = gnc_tests::read_json(&folder.join("run.json"));
        assert_eq!(record["other_module"], serde_json::json!({ "scanned": "SN-1", "found": "GNC-0666" }));
        let ended = record["outcome"].as_str().or(record["selection_outcome"].as_str());
        assert_eq!(ended, Some("errored"));
        assert!(
            record["items"].as_array().expect("items").iter().all(|item| item["outcome"] == "not_run"),
            "nothing was run"
        );
        assert!(
            !folder.parent().expect("a folder").with_file_name("SN-1").exists(),
            "it stands with the scanned module"
        );
    }
    for number in ["SN-1", "GNC-0666"] {
        let shown = place.run(["records", "show", number]);
        assert_eq!(shown.code, Some(2), "{number} has a run: {}", shown.stdout);
    }
    let verified = place.run(["records", "verify"]);
    assert_eq!(verified.code, Some(0), "{}", verified.stdout);
    assert!(verified.stdout.contains("the chain of 3 closed runs is whole"), "{}", verified.stdout);
    let listed = place.run(["records", "list"]);
    assert_eq!(listed.stdout.matches("other module").count(), 3, "{}", listed.stdout);
    // Programs find it under neither number, and read both.
    let listed = place.run(["records", "list", "--json"]);
    let listed: serde_json::Value = serde_json::from_str(&listed.stdout).expect("JSON");
    for line in listed.as_array().expect("runs") {
        assert!(line["serial_number"].is_null(), "{line}");
        assert_eq!(line["other_module"], "SN-1 was scanned, GNC-0666 is in the socket");
    }
    // It is not taken up again, not even by the module that was in the socket.
    let folder = place.runs().remove(0).display().to_string();
    for number in ["SN-1", "GNC-0666"] {
        let resumed = run(number, &["--resume", &folder]);
        assert_eq!(resumed.code, Some(2), "{}", resumed.stdout);
    }
    let again = place.run(["recompute", &folder]);
    assert_eq!(again.code, Some(0), "{}{}", again.stdout, again.stderr);
    // The scanned module itself is filed as ever.
    let good = run("GNC-0666", &["--only", "cpu"]);
    assert_eq!(good.code, Some(5), "{}{}", good.stdout, good.stderr);
    assert!(good.stdout.contains("/GNC-0666/"), "{}", good.stdout);
}
