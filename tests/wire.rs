//! Good and bad modules behind a line that loses, doubles, reorders, delays, damages and invents frames. The line never
//! makes a good module fail or a bad one pass, and never blocks a run forever.
//!
//! A run with a wrong result is named with its board file and seed; `--sim=FILE --seed N` repeats it as far as wall
//! time allows: which frames are hit depends on the number of frames. `GNC_WIRE_SEEDS=20` runs this many seeds of each.

#![expect(clippy::expect_used, reason = "what cannot be set up fails the test that needs it")]

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::process::Stdio;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use gnc_tests::{Place, functional_plan, repository};
use serde_json::Value;

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");
/// Number of concurrent runs: those with delays wait more than they work.
const AT_ONCE: usize = 8;
/// Longest time of a run. A run on a clean line takes a second. If every item meets a dead line twice, it takes some
/// forty. Over CAN it takes some eighty, since each broken-off message takes a second more.
const LONGEST: Duration = Duration::from_secs(150);

/// A fault of the wire: its name, and its rates for a mild and a harsh line.
struct Fault {
    name: &'static str,
    mild: &'static str,
    harsh: &'static str,
}

const FAULTS: [Fault; 11] = [
    Fault { name: "bytes lost", mild: "lost_bytes_per_million = 10.0", harsh: "lost_bytes_per_million = 300.0" },
    Fault { name: "frames lost", mild: "lost_frames_per_million = 1e3", harsh: "lost_frames_per_million = 3e4" },
    Fault { name: "bits flipped", mild: "flipped_bits_per_million = 1.0", harsh: "flipped_bits_per_million = 30.0" },
    Fault { name: "frames cut", mild: "cut_frames_per_million = 1e3", harsh: "cut_frames_per_million = 3e4" },
    Fault {
        name: "frames doubled",
        mild: "doubled_frames_per_million = 1e4",
        harsh: "doubled_frames_per_million = 5e5",
    },
    Fault {
        name: "frames overtaken",
        mild: "overtaken_frames_per_million = 1e4",
        harsh: "overtaken_frames_per_million = 3e5",
    },
    Fault {
        name: "frames delayed",
        mild: "delayed_frames_per_million = 3e3\ndelay_ms = 80.0",
        harsh: "delayed_frames_per_million = 3e4\ndelay_ms = 300.0",
    },
    Fault {
        name: "line stalled",
        mild: "stalled_frames_per_million = 1e3\nstall_ms = 300.0",
        harsh: "stalled_frames_per_million = 5e3\nstall_ms = 2500.0",
    },
    Fault { name: "babble", mild: "babbled_frames_per_million = 1e4", harsh: "babbled_frames_per_million = 3e5" },
    Fault { name: "echo", mild: "echoed_frames_per_million = 1e4", harsh: "echoed_frames_per_million = 1e6" },
    Fault {
        name: "everything",
        mild: "lost_bytes_per_million = 2.0\nlost_frames_per_million = 200.0\nflipped_bits_per_million = 0.2\n\
               cut_frames_per_million = 200.0\ndoubled_frames_per_million = 2e3\novertaken_frames_per_million = 2e3\n\
               delayed_frames_per_million = 500.0\ndelay_ms = 80.0\nstalled_frames_per_million = 200.0\n\
               stall_ms = 300.0\nbabbled_frames_per_million = 2e3\nechoed_frames_per_million = 2e3",
        harsh: "lost_bytes_per_million = 100.0\nlost_frames_per_million = 1e4\nflipped_bits_per_million = 10.0\n\
                cut_frames_per_million = 1e4\ndoubled_frames_per_million = 1e5\novertaken_frames_per_million = 1e5\n\
                delayed_frames_per_million = 1e4\ndelay_ms = 80.0\nstalled_frames_per_million = 1e3\n\
                stall_ms = 1000.0\nbabbled_frames_per_million = 1e5\nechoed_frames_per_million = 1e5",
    },
];

/// The same between station and CAN bus. Controllers discard frames that are damaged there; the checksum of the
/// messages finds other alterations.
const CAN_FAULTS: [Fault; 9] = [
    Fault { name: "frames lost", mild: "lost_frames_per_million = 100.0", harsh: "lost_frames_per_million = 5e3" },
    Fault { name: "bursts lost", mild: "lost_bursts_per_million = 30.0", harsh: "lost_bursts_per_million = 1e3" },
    Fault {
        name: "bits flipped",
        mild: "flipped_frames_per_million = 100.0",
        harsh: "flipped_frames_per_million = 5e3",
    },
    Fault {
        name: "frames doubled",
        mild: "doubled_frames_per_million = 100.0",
        harsh: "doubled_frames_per_million = 5e4",
    },
    Fault {
        name: "frames overtaken",
        mild: "overtaken_frames_per_million = 100.0",
        harsh: "overtaken_frames_per_million = 2e4",
    },
    Fault {
        name: "frames delayed",
        mild: "delayed_frames_per_million = 300.0\ndelay_ms = 80.0",
        harsh: "delayed_frames_per_million = 3e3\ndelay_ms = 300.0",
    },
    Fault {
        name: "bus stalled",
        mild: "stalled_frames_per_million = 100.0\nstall_ms = 300.0",
        harsh: "stalled_frames_per_million = 500.0\nstall_ms = 2500.0",
    },
    Fault { name: "babble", mild: "babbled_frames_per_million = 100.0", harsh: "babbled_frames_per_million = 5e4" },
    Fault {
        name: "everything",
        mild: "lost_frames_per_million = 30.0\nlost_bursts_per_million = 3.0\nflipped_frames_per_million = 30.0\n\
               doubled_frames_per_million = 30.0\novertaken_frames_per_million = 30.0\n\
               delayed_frames_per_million = 100.0\ndelay_ms = 80.0\nstalled_frames_per_million = 30.0\n\
               stall_ms = 300.0\nbabbled_frames_per_million = 30.0",
        harsh: "lost_frames_per_million = 1e3\nlost_bursts_per_million = 100.0\nflipped_frames_per_million = 1e3\n\
                doubled_frames_per_million = 1e3\novertaken_frames_per_million = 1e3\n\
                delayed_frames_per_million = 1e3\ndelay_ms = 80.0\nstalled_frames_per_million = 100.0\n\
                stall_ms = 1000.0\nbabbled_frames_per_million = 1e4",
    },
];

/// A good module, and bad ones that show their faults in results, in a stream and by restarts.
const BOARDS: [&str; 4] = ["good", "pps-missing", "spi-flips-bits", "reboots-in-sdram"];

/// The same for CAN: one module alters test frames, another swaps them.
const CAN_BOARDS: [&str; 4] = ["good", "can-flips-bits", "can-swaps-frames", "pps-missing"];

/// Harsh faults that affect every run.
const LOSSY: [&str; 3] = ["frames lost", "frames cut", "bits flipped"];

/// A run to be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Case {
    link: Link,
    fault: &'static str,
    harsh: bool,
    rates: &'static str,
    board: &'static str,
    seed: u64,
}

/// The link of the commands, and which link is faulty.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Link {
    /// Commands over RS-422, which is faulty.
    Serial,
    /// Commands over RS-422, a faulty CAN bus beside it.
    CanBeside,
    /// Everything over a faulty CAN bus.
    CanAlone,
}

impl Link {
    /// The station's option and the table in the board's file.
    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Serial => ("rs422", "wire"),
            Self::CanBeside => ("rs422", "can_wire"),
            Self::CanAlone => ("can", "can_wire"),
        }
    }
}

/// The end of a run.
#[derive(Debug)]
struct Ended {
    outcome: String,
    noted: bool,
    took: Duration,
}

impl Ended {
    fn is_verdict(&self) -> bool {
        self.outcome != "errored"
    }
}

fn run(case: Case) -> Result<Ended, String> {
    let place = Place::new(STATION);
    let board = std::fs::read_to_string(repository().join(format!("hw-mocks/boards/{}.toml", case.board)));
    let (link, table) = case.link.words();
    let text = format!("{}\n[{table}.both]\n{}\n", board.map_err(|error| error.to_string())?, case.rates);
    let file = place.write("board.toml", &text).display().to_string();
    let (plan, seed) = (functional_plan().display().to_string(), case.seed.to_string());
    let sim = format!("--sim={file}");
    let args =
        ["--auto", &plan, &sim, "--sim-link", link, "--serial-number", "T-1", "--sim-speed", "max", "--seed", &seed];
    let began = Instant::now();
    let mut command = place.station(args);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().map_err(|error| error.to_string())?;
    let killer = Killer::after(LONGEST, child.id());
    let output = child.wait_with_output().map_err(|error| error.to_string())?;
    drop(killer);
    let took = began.elapsed();
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let wrong = |why: &str| Err(format!("{case:?} after {took:.1?}: {why}\n{text}\n{said}"));
    let Some(code) = output.status.code() else { return wrong("it did not come to an end") };
    let record = place.record();
    let outcome = record["outcome"].as_str().unwrap_or_default().to_owned();
    let expected_code = match outcome.as_str() {
        "passed" | "marginal" => 0,
        "failed" => 1,
        "errored" => 3,
        _ => return wrong("its outcome is none of these"),
    };
    if code != expected_code {
        return wrong(&format!("exit code {code} with the outcome {outcome}"));
    }
    if case.board == "good" {
        let items = record["items"].as_array().into_iter().flatten();
        let attempts = items.flat_map(|item| item["attempts"].as_array().into_iter().flatten());
        if attempts.clone().any(|attempt| attempt["outcome"] == "failed") || outcome == "failed" {
            return wrong("a good module was failed");
        }
    } else if code == 0 {
        return wrong("a bad module passed");
    }
    let verified = place.run(["records", "verify"]);
    if verified.code != Some(0) {
        return wrong(&format!("its record does not agree with itself: {}{}", verified.stdout, verified.stderr));
    }
    Ok(Ended { outcome, noted: said_of_the_line(&record), took })
}

fn said_of_the_line(record: &Value) -> bool {
    let notes = record["notes"].as_array().into_iter().flatten();
    notes.filter_map(|note| note["text"].as_str()).any(|text| text.starts_with("the line was not clean"))
}

/// Kills a process that does not end in time.
struct Killer {
    ended: std::sync::mpsc::Sender<()>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Killer {
    fn after(span: Duration, process: u32) -> Self {
        let (ended, waits) = std::sync::mpsc::channel::<()>();
        let thread = std::thread::spawn(move || {
            if waits.recv_timeout(span) == Err(std::sync::mpsc::RecvTimeoutError::Timeout) {
                let process = nix::unistd::Pid::from_raw(process.cast_signed());
                let _ = nix::sys::signal::kill(process, nix::sys::signal::Signal::SIGKILL);
            }
        });
        Self { ended, thread: Some(thread) }
    }
}

impl Drop for Killer {
    fn drop(&mut self) {
        let _ = self.ended.send(());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Runs all cases; fails with all errors.
fn run_all(cases: Vec<Case>) -> Vec<(Case, Ended)> {
    let total = cases.len();
    let (left, results) = (Mutex::new(cases), Mutex::new(Vec::new()));
    let next = || left.lock().expect("cases").pop();
    std::thread::scope(|scope| {
        for _ in 0..AT_ONCE {
            scope.spawn(|| {
                while let Some(case) = next() {
                    let ended = run(case);
                    results.lock().expect("results").push((case, ended));
                }
            });
        }
    });
    let (mut right, mut wrong) = (Vec::new(), Vec::new());
    for (case, ended) in results.into_inner().expect("results") {
        match ended {
            Ok(ended) => right.push((case, ended)),
            Err(why) => wrong.push(why),
        }
    }
    assert!(wrong.is_empty(), "{} of {total} runs:\n\n{}", wrong.len(), wrong.join("\n\n"));
    right
}

/// The results by line and fault, for a reader of the output.
fn table(ended: &[(Case, Ended)]) -> String {
    let mut by_fault: BTreeMap<(bool, &str), (usize, usize, usize, Duration)> = BTreeMap::new();
    for (case, ended) in ended {
        let row = by_fault.entry((case.harsh, case.fault)).or_default();
        row.0 += 1;
        row.1 += usize::from(ended.is_verdict());
        row.2 += usize::from(ended.noted);
        row.3 = row.3.max(ended.took);
    }
    let mut text = String::new();
    for ((harsh, fault), (runs, verdicts, noted, longest)) in by_fault {
        let line = if harsh { "harsh" } else { "mild" };
        let _ = writeln!(
            text,
            "{line:5} {fault:17} {verdicts:3} of {runs:3} reached a verdict, {noted:3} noted, at most {longest:.1?}"
        );
    }
    text
}

fn cases(link: Link, harsh: bool, boards: &[&'static str]) -> Vec<Case> {
    let seeds = std::env::var("GNC_WIRE_SEEDS").ok().and_then(|seeds| seeds.parse().ok()).unwrap_or(1);
    let mut cases = Vec::new();
    for seed in 1..=seeds {
        let faults: &[Fault] = if link == Link::Serial { &FAULTS } else { &CAN_FAULTS };
        for Fault { name, mild, harsh: worse } in faults {
            let rates = if harsh { worse } else { mild };
            cases.extend(boards.iter().map(|board| Case { link, fault: name, harsh, rates, board, seed }));
        }
    }
    cases
}

/// On a harsh line the station must report the losses. On a mild one, asking again may repair them without a report.
#[test]
fn no_fault_of_the_line_makes_a_verdict() {
    let all =
        cases(Link::Serial, false, &["good", "spi-flips-bits"]).into_iter().chain(cases(Link::Serial, true, &BOARDS));
    let ended = run_all(all.collect());
    eprint!("{}", table(&ended));
    for (case, ended) in ended.iter().filter(|(case, _)| case.harsh && LOSSY.contains(&case.fault)) {
        assert!(ended.noted, "{case:?} lost frames without a word");
    }
    most_reach_a_verdict(&ended);
}

fn most_reach_a_verdict(ended: &[(Case, Ended)]) {
    let mild: Vec<&Ended> = ended.iter().filter(|(case, _)| !case.harsh).map(|(_, ended)| ended).collect();
    let verdicts = mild.iter().filter(|ended| ended.is_verdict()).count();
    assert!(verdicts * 4 >= mild.len() * 3, "{verdicts} of {} runs on a mild line reached a verdict", mild.len());
}

/// The same on CAN, for commands and for the item that tests the bus.
#[test]
fn no_fault_of_the_can_bus_makes_a_verdict() {
    for (link, boards) in [(Link::CanBeside, &CAN_BOARDS[..3]), (Link::CanAlone, &CAN_BOARDS[..])] {
        let all = cases(link, false, &["good", "can-flips-bits"]).into_iter().chain(cases(link, true, boards));
        let ended = run_all(all.collect());
        eprint!("{link:?}\n{}", table(&ended));
        most_reach_a_verdict(&ended);
    }
}
