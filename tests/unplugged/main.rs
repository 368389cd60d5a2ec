//! An adapter is unplugged and plugged in again during the run: the station takes it up again, and does not charge the
//! module with it.

#![expect(clippy::expect_used, clippy::panic, reason = "what cannot be set up fails the test that needs it")]

mod cable;

use std::io::{BufRead as _, BufReader};
use std::process::{Child, ChildStdout, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use cable::Cable;
use gnc_records::store::as_written;
use gnc_tests::{Board, PARTIAL, Place, functional_plan};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rand::{RngExt as _, SeedableRng as _};
use serde_json::Value;

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");
const MOCK: &str = env!("CARGO_BIN_EXE_mock-under-test");
/// The moments at which the plug is pulled; another seed gives other moments.
const SEED: u64 = 20_261_123;
/// Number of runs, each with so many pulls of the plug.
const RUNS: usize = 25;
const PULLS: usize = 4;
/// All items that need neither an operator nor a sky over simulated minutes.
const ITEMS: &str = "identity,cpu,timers,internal-ram,sdram,spi-flash,internal-flash,imu,io,spi,sci";

fn board(speed: &str, seed: &str) -> Board {
    Board::start(MOCK, &["--serial-number", "SIM-0001", "--speed", speed, "--seed", seed])
}

/// A bench with a plug, and a run on it.
struct Bench {
    place: Place,
    cable: Cable,
    board: Board,
    station: Child,
    events: BufReader<ChildStdout>,
}

impl Bench {
    fn start(speed: &str, only: &str) -> Self {
        let (place, board) = (Place::new(STATION), board(speed, "1"));
        let link = place.path().join("adapter");
        let cable = Cable::new(&board.port, &link);
        place.write("bench.toml", &format!("[station]\nid = \"plug\"\n[socket]\nport = \"{}\"\n", link.display()));
        let plan = functional_plan();
        let args = ["--auto", &plan.to_string_lossy(), "--serial-number", "SIM-0001", "--only", only, "--events"];
        let mut station =
            place.station(args).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("the station");
        let events = BufReader::new(station.stdout.take().expect("its output"));
        Self { place, cable, board, station, events }
    }

    /// The next event; `None` at the end.
    fn event(&mut self) -> Option<Value> {
        let mut line = String::new();
        let length = self.events.read_line(&mut line).expect("a line");
        (length > 0).then(|| serde_json::from_str(&line).expect("an event"))
    }

    /// Reads on until an event of this kind and item.
    fn until(&mut self, kind: &str, item: &str) {
        while let Some(event) = self.event() {
            if event["kind"] == kind && event["item"] == item {
                return;
            }
        }
        panic!("the run ended before {kind} of {item}");
    }

    /// Exit code, record and log of the run.
    fn end(&mut self) -> (Option<i32>, Value, String) {
        while self.event().is_some() {}
        let code = self.station.wait().expect("its end").code();
        let folder = self.place.runs().pop().expect("a run");
        assert_eq!(as_written::verify(&folder), Vec::<String>::new());
        (code, self.place.record(), std::fs::read_to_string(folder.join("log.txt")).expect("log.txt"))
    }
}

fn outcomes(record: &Value, item: &str) -> Vec<String> {
    let items = record["items"].as_array().into_iter().flatten();
    let attempts =
        items.filter(|one| one["id"] == item).flat_map(|one| one["attempts"].as_array().into_iter().flatten());
    attempts.filter_map(|attempt| attempt["outcome"].as_str().map(str::to_owned)).collect()
}

/// Away for a moment: the session survives it, and so do the requests that run at the board.
#[test]
fn a_plug_that_is_put_back_at_once_costs_nothing() {
    let mut bench = Bench::start("1", "identity,sdram");
    bench.until("item_started", "sdram");
    bench.cable.unplug();
    bench.cable.plug();
    let (code, record, log) = bench.end();
    assert_eq!(code, PARTIAL, "{log}");
    assert_eq!(outcomes(&record, "sdram"), ["passed"], "{log}");
    assert!(log.contains("adapter went away; back after 0."), "{log}");
}

/// Away until the station has given up the item: the board's watchdog made the module safe, and the item runs again
/// because the plan says so.
#[test]
fn a_plug_that_is_put_back_later_costs_an_attempt() {
    let mut bench = Bench::start("1", "identity,sdram,io");
    bench.until("item_started", "sdram");
    bench.cable.unplug();
    bench.until("attempt_ended", "sdram");
    let plugged = Instant::now();
    bench.cable.plug();
    bench.until("item_started", "sdram");
    println!("the item began again {:.3} s after the plug was back", plugged.elapsed().as_secs_f64());
    let (code, record, log) = bench.end();
    assert_eq!(code, PARTIAL, "{log}");
    assert_eq!(outcomes(&record, "sdram"), ["errored", "passed"], "{log}");
    assert!(log.contains("the run waits at most 10 s for it"), "{log}");
}

/// The adapter is not plugged in again: errored, not failed, and the rest of the plan is not run.
#[test]
fn a_plug_that_stays_out_is_the_bench_s_fault() {
    let mut bench = Bench::start("1", "identity,sdram,spi-flash");
    bench.until("item_started", "sdram");
    bench.cable.unplug();
    let (code, record, log) = bench.end();
    assert_eq!(code, Some(3), "{log}");
    assert_eq!(outcomes(&record, "sdram"), ["errored"], "{log}");
    assert!(log.contains("adapter went away and did not come back in 10 s"), "{log}");
}

/// A board that gets its power through the same plug restarts with it: no item is charged with that.
#[test]
fn a_board_that_restarts_with_the_plug_is_nobody_s_fault() {
    let mut bench = Bench::start("1", "identity,sdram");
    bench.until("item_started", "sdram");
    bench.cable.unplug();
    bench.board = board("1", "2");
    bench.cable.wire(&bench.board.port);
    bench.cable.plug();
    let (code, record, log) = bench.end();
    assert_eq!(code, PARTIAL, "{log}");
    assert_eq!(outcomes(&record, "sdram"), ["errored", "passed"], "{log}");
    // On a slow machine the board takes longer to start than the session is kept.
    assert!(log.contains("the board restarted") || log.contains("the run waits"), "{log}");
}

/// A line that damages every frame, for example at another rate, is distinguished from a silent one.
#[test]
fn bytes_that_are_no_frames_are_told_from_silence() {
    let place = Place::new(STATION);
    let text = "description = \"No frame is whole.\"\n[wire.to_host]\nflipped_bits_per_million = 1e5\n";
    let board = place.write("garbled.toml", text);
    let run = place.functional(&format!("--sim={}", board.display()), &["--only", "identity"]);
    assert_eq!(run.code, Some(3), "{}{}", run.stdout, run.stderr);
    assert!(run.stdout.contains("no whole frame") && run.stdout.contains("the same rate"), "{}", run.stdout);
}

/// The operator stops the run while the plug is out.
#[test]
fn a_stop_does_not_wait_for_the_plug() {
    let mut bench = Bench::start("1", "identity,sdram");
    bench.until("item_started", "sdram");
    bench.cable.unplug();
    bench.until("attempt_ended", "sdram");
    let stopped = Instant::now();
    kill(Pid::from_raw(i32::try_from(bench.station.id()).expect("a process id")), Signal::SIGINT).expect("alive");
    let (code, record, log) = bench.end();
    println!("the station ended {:.3} s after the stop", stopped.elapsed().as_secs_f64());
    assert_eq!(code, Some(4), "{log}");
    assert_eq!(record["stop"]["how"], "in_order", "{log}");
    assert!(log.contains("its watchdog makes it safe within 2 s"), "{log}");
    assert!(!log.contains("did not come back"), "{log}");
}

/// The plug is pulled at random moments, repeatedly: a good module never fails.
#[test]
fn a_loose_plug_never_fails_a_good_module() {
    println!("seed {SEED}");
    let next = AtomicUsize::new(0);
    let ends = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..4)
            .map(|_| {
                scope.spawn(|| {
                    let mut ends = Vec::new();
                    loop {
                        let run = next.fetch_add(1, Ordering::Relaxed);
                        if run >= RUNS {
                            return ends;
                        }
                        ends.push(pulled(SEED + run as u64));
                    }
                })
            })
            .collect();
        threads.into_iter().flat_map(|thread| thread.join().expect("a run")).collect::<Vec<_>>()
    });
    let passed = ends.iter().filter(|code| **code == PARTIAL).count();
    println!("{} runs with up to {PULLS} pulls each: {passed} passed, the others errored", ends.len());
}

fn pulled(seed: u64) -> Option<i32> {
    let mut dice = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut bench = Bench::start("max", ITEMS);
    let mut over = false;
    for _ in 0..PULLS {
        let moment = dice.random_range(1..30);
        over = over || (0..moment).any(|_| bench.event().is_none());
        if !over {
            bench.cable.unplug();
            bench.cable.plug();
        }
    }
    let (code, record, log) = bench.end();
    assert!(matches!(code, Some(5 | 3)), "seed {seed}: exit code {code:?}\n{log}");
    let items = record["items"].as_array().expect("items");
    let attempts = items.iter().flat_map(|item| item["attempts"].as_array().into_iter().flatten());
    let failed = attempts.filter(|attempt| attempt["outcome"] == "failed").count();
    assert_eq!(failed, 0, "seed {seed}\n{log}");
    code
}
