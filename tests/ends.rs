//! Unplanned ends: what the next start does about them, and whether the board is safe without the station.

#![expect(clippy::expect_used, clippy::print_stdout, reason = "what cannot be set up fails the test that needs it")]

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::os::fd::AsFd as _;
use std::path::Path;
use std::process::{Child, ChildStdout, Stdio};
use std::time::Instant;

use gnc_records::store::{as_written, captures, chain};
use gnc_tests::{Board, PARTIAL, Place, functional_plan, read_json, repository};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::inotify::{AddWatchFlags, InitFlags, Inotify};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");
const MOCK: &str = env!("CARGO_BIN_EXE_mock-under-test");
/// Most looks at the board until it is safe; each takes the board some milliseconds.
const LOOKS: usize = 100_000;

/// A running station, and the lines of its events.
struct Running {
    child: Child,
    events: BufReader<ChildStdout>,
}

impl Running {
    fn start(place: &Place, more: &[&str]) -> Self {
        Self::of_plan(place, &functional_plan(), more)
    }

    fn of_plan(place: &Place, plan: &Path, more: &[&str]) -> Self {
        let args = ["--auto", &plan.to_string_lossy(), "--serial-number", "SIM-0001", "--events"].map(str::to_owned);
        let args = args.into_iter().chain(more.iter().map(|arg| (*arg).to_owned()));
        let mut child = place.station(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the station");
        let events = BufReader::new(child.stdout.take().expect("its output"));
        Self { child, events }
    }

    fn until(&mut self, event: &str) {
        let mut line = String::new();
        while !line.contains(event) {
            line.clear();
            assert_ne!(self.events.read_line(&mut line).expect("a line"), 0, "the run ended before {event}");
        }
    }

    fn signal(&self, signal: Signal) {
        kill(Pid::from_raw(i32::try_from(self.child.id()).expect("a process id")), signal).expect("alive");
    }

    /// Exit code and error output.
    fn end(mut self) -> (Option<i32>, String) {
        let mut rest = String::new();
        while self.events.read_line(&mut rest).expect("a line") > 0 {}
        let output = self.child.wait_with_output().expect("its end");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    }
}

fn board() -> Board {
    Board::start(MOCK, &["--serial-number", "SIM-0001"])
}

/// Waits until the board's watchdog has made the module safe.
fn until_safe(board: &mut Board) {
    let began = Instant::now();
    assert!((0..LOOKS).any(|_| board.truth("powered") == "false"), "the module still has power");
    println!("the module was off {:.2} s later", began.elapsed().as_secs_f64());
}

fn with_board(board: &Board) -> Place {
    let place = Place::new(STATION);
    place.write("bench.toml", &board.bench_file("ends"));
    place
}

/// Waits until a file in a run's folder is longer than this. The folder must exist; the file may come later.
fn until_longer(file: &Path, bytes: u64) {
    let folder = file.parent().expect("a folder");
    let inotify = Inotify::init(InitFlags::IN_CLOEXEC).expect("inotify");
    let watch = |folder: &Path| inotify.add_watch(folder, AddWatchFlags::IN_CREATE | AddWatchFlags::IN_MODIFY).is_ok();
    assert!(folder.parent().is_some_and(watch), "a watch");
    // Watch before each look, so that no change is missed between a look and the wait.
    while {
        watch(folder);
        !fs::metadata(file).is_ok_and(|meta| meta.len() > bytes)
    } {
        let minute = PollTimeout::from(60_000u16);
        let ready = poll(&mut [PollFd::new(inotify.as_fd(), PollFlags::POLLIN)], minute).expect("poll");
        assert!(ready > 0, "nothing was written to {} for a minute", file.display());
        inotify.read_events().expect("events");
    }
}

fn log(run: &Path) -> String {
    fs::read_to_string(run.join("log.txt")).expect("log.txt")
}

/// The program dies: the board is made safe by its own watchdog. The next start names the interrupted run and seals it,
/// so that it can be verified like any other run and is not a pass.
#[test]
fn a_killed_run_is_sealed_by_the_next_start() {
    let mut board = board();
    let place = with_board(&board);
    let mut running = Running::start(&place, &["--only", "identity,sdram"]);
    running.until(r#""kind":"item_started","item":"sdram""#);
    running.signal(Signal::SIGKILL);
    assert_eq!(running.end().0, None);
    until_safe(&mut board);
    let killed = place.runs().pop().expect("a run");
    assert!(!as_written::verify(&killed).is_empty(), "it cannot be verified yet");

    let (code, _) = Running::start(&place, &["--only", "identity"]).end();
    assert_eq!(code, PARTIAL);
    let runs = place.runs();
    assert_eq!(runs.len(), 2, "{runs:?}");
    let said = log(&runs[1]);
    assert!(said.contains("was interrupted during sdram") && said.contains("test SIM-0001 again"), "{said}");
    assert_eq!(as_written::verify(&killed), Vec::<String>::new());
    let record = read_json(&killed.join("run.json"));
    assert_eq!((record["interrupted"].as_bool(), record["selection_outcome"].as_str()), (Some(true), Some("aborted")));
    let checked = chain::verify(&place.path().join("records")).expect("a chain");
    assert_eq!((checked.runs, checked.problems), (2, Vec::new()));
    let list = place.run(["records", "list"]).stdout;
    assert!(list.starts_with("interrupted"), "{list}");
    assert_eq!(place.run(["records", "verify"]).code, Some(0));

    // The message comes only once.
    assert_eq!(Running::start(&place, &["--only", "identity"]).end().0, PARTIAL);
    assert!(!log(&place.runs()[2]).contains("was interrupted"));
}

/// A run is killed, and the next start is killed between digests and chain: the start after that puts the run into the
/// chain. Where the chain was lost, a run that ended is left out of it, since its folder may come from elsewhere.
#[test]
fn a_sealed_run_that_missed_the_chain_is_put_into_it() {
    let place = Place::new(STATION);
    let mut running = Running::start(&place, &["--sim", "--only", "identity,sdram"]);
    running.until(r#""kind":"item_started","item":"sdram""#);
    running.signal(Signal::SIGKILL);
    assert_eq!(running.end().0, None);
    let start = || Running::start(&place, &["--sim", "--sim-speed", "max", "--only", "identity"]).end().0;
    assert_eq!(start(), PARTIAL);
    let runs = place.runs();
    let (killed, ended) = (&runs[0], &runs[1]);
    let records = place.path().join("records");
    let without_chain = || {
        fs::remove_file(records.join("COUNTER")).expect("a counter");
        let days = records.read_dir().expect("records").map(|day| day.expect("a day").path());
        days.for_each(|day| fs::remove_file(day.join("CHAIN")).expect("a chain"));
    };
    without_chain();
    fs::remove_dir_all(ended).expect("a run");
    assert_eq!(start(), PARTIAL);
    let said = log(&place.runs()[1]);
    assert!(said.contains("was interrupted while the station sealed it; the sealing is complete now"), "{said}");
    let checked = chain::verify(&records).expect("a chain");
    assert_eq!((checked.runs, checked.problems), (2, Vec::new()));
    assert_eq!(as_written::verify(killed), Vec::<String>::new());

    without_chain();
    assert_eq!(start(), PARTIAL);
    let problems = chain::verify(&records).expect("a chain").problems;
    assert!(problems.len() == 1 && problems[0].contains("is not in the chain"), "{problems:?}");
}

/// A run is killed in a capture: the next start writes the missing end of the raw file and says so in the record. The
/// samples captured before are unchanged.
#[test]
fn a_raw_file_that_a_kill_cut_off_gets_its_end() {
    let place = Place::new(STATION);
    let plan = repository().join("tests/raw/short.toml");
    let mut running = Running::of_plan(&place, &plan, &["--sim", "--sim-speed", "20"]);
    running.until(r#""kind":"item_started","item":"rotation""#);
    let killed = place.runs().pop().expect("a run");
    let [whole, cut] = ["01-six-position", "02-rotation"].map(|item| killed.join(item).join("attempt-1.mcap"));
    let before = fs::read(&whole).expect("positions");
    // Captured samples are flushed to disk once a second.
    until_longer(&cut, 20_000);
    running.signal(Signal::SIGKILL);
    assert_eq!(running.end().0, None);
    let original = fs::read(&cut).expect("turns");
    assert!(captures::read(&cut).expect("it is read as far as it goes").cut_off);

    assert_eq!(Running::start(&place, &["--sim", "--sim-speed", "max", "--only", "identity"]).end().0, PARTIAL);
    let said = log(&place.runs()[1]);
    assert!(said.contains("02-rotation/attempt-1.mcap was cut off and has its end now"), "{said}");
    assert_eq!(as_written::verify(&killed), Vec::<String>::new());
    assert!(log(&killed).contains("its end was written when the run was sealed"), "{}", log(&killed));
    let told = read_json(&killed.join("cut-off.json"));
    assert_eq!(told["files"].as_array().map(Vec::len), Some(1), "{told}");
    let told = &told["files"][0];
    assert_eq!(
        (&told["file"], &told["original_bytes"]),
        (&"02-rotation/attempt-1.mcap".into(), &original.len().into())
    );
    let report = fs::read_to_string(killed.join("report.html")).expect("a report");
    assert!(report.contains(told["original_sha256"].as_str().expect("a digest")), "the report has it too");

    assert_eq!(fs::read(&whole).expect("positions"), before, "what had an end was left alone");
    let ended = fs::read(&cut).expect("turns");
    let kept = usize::try_from(told["kept_bytes"].as_u64().expect("a length")).expect("short");
    let torn = fs::read(killed.join("02-rotation/attempt-1.mcap.torn")).unwrap_or_default();
    assert_eq!([&ended[..kept], &torn].concat(), original, "nothing was lost");
    assert_ne!(&ended[ended.len() - 8..], &original[original.len() - 8..]);
    assert_eq!(&ended[ended.len() - 8..], b"\x89MCAP0\r\n");
    assert!(captures::read(&cut).expect("a capture").cut_off, "it still says so");
    let run = place.run(["recompute".as_ref(), killed.as_os_str()]);
    assert!(run.code == Some(0) && run.stdout.contains("the same, bit for bit"), "{}{}", run.stdout, run.stderr);
}

/// A second station on the same folder leaves a running run alone.
#[test]
fn a_run_that_goes_on_is_not_sealed() {
    let place = Place::new(STATION);
    let mut long = Running::start(&place, &["--sim", "--only", "identity,sdram"]);
    long.until(r#""kind":"item_started","item":"sdram""#);
    assert_eq!(Running::start(&place, &["--sim", "--sim-speed", "max", "--only", "identity"]).end().0, PARTIAL);
    let runs = place.runs();
    assert!(!runs[0].join("SHA256SUMS").exists(), "it goes on");
    assert!(!log(&runs[1]).contains("interrupted"));
    let run = runs[0].to_str().expect("UTF-8");
    let (code, said) = Running::start(&place, &["--sim", "--resume", run]).end();
    assert!(code == Some(2) && said.contains("the run to resume is still running"), "{code:?}: {said}");
    assert_eq!(long.end().0, PARTIAL);
    assert_eq!(place.run(["records", "verify"]).code, Some(0));
}

/// Somebody removed the digests of a run that the chain names: no start makes them anew.
#[test]
fn a_run_that_lost_its_digests_stays_unsealed() {
    let place = Place::new(STATION);
    let one = || Running::start(&place, &["--sim", "--sim-speed", "max", "--only", "identity"]).end().0;
    assert_eq!(one(), PARTIAL);
    let run = place.runs().pop().expect("a run");
    fs::remove_file(run.join("SHA256SUMS")).expect("digests");
    assert_eq!(one(), PARTIAL);
    assert!(!run.join("SHA256SUMS").exists());
}

/// The power fails between the end of a run and its line in the chain. The next start closes it late, says so, and
/// `records verify` and the list say it from then on. The run is no pass, and nothing is called changed.
#[test]
fn a_run_that_ended_before_it_was_closed_is_closed_late() {
    let place = Place::new(STATION);
    let one = || Running::start(&place, &["--sim", "--sim-speed", "max"]).end().0;
    assert_eq!((one(), one()), (Some(0), Some(0)));
    let run = place.runs().pop().expect("a run");
    let records = place.path().join("records");
    let chain = run.ancestors().nth(2).expect("a day").join("CHAIN");
    let text = fs::read_to_string(&chain).expect("a chain");
    let first = text.lines().next().expect("a line");
    // As the disk was after the first run, with half of the next line.
    let words: Vec<&str> = first.split(' ').collect();
    fs::write(records.join("COUNTER"), format!("{} {}\n", words[0], words[3])).expect("a counter");
    fs::write(&chain, &text[..text.len() - 9]).expect("a chain");
    for file in ["SHA256SUMS", "run.json", "report.html"] {
        fs::remove_file(run.join(file)).expect("a file of the end");
    }
    let before = place.run(["records", "verify"]);
    assert!(before.stdout.contains("ended and not closed"), "{}", before.stdout);

    assert_eq!(one(), Some(0));
    let said = log(place.runs().last().expect("a run"));
    assert!(said.contains("it is closed late now and never counts as a pass; test SIM-0001 again"), "{said}");
    let verified = place.run(["records", "verify"]);
    assert_eq!(verified.code, Some(0), "{}{}", verified.stdout, verified.stderr);
    assert!(
        verified.stdout.contains(": closed late at ")
            && verified.stdout.contains("its files are as the journal left them")
    );
    assert!(
        verified.stdout.contains("1 run of the chain was closed late and never counts as a pass"),
        "{}",
        verified.stdout
    );
    let shown = place.run(["records".as_ref(), "show".as_ref(), run.as_os_str()]).stdout;
    assert!(shown.starts_with("CLOSED LATE: closed late at "), "{shown}");
    assert!(shown.contains("until then its journal could be edited; it never counts as a pass"), "{shown}");
    let name = run.strip_prefix(&records).expect("below").to_str().expect("UTF-8");
    let list = place.run(["records", "list"]).stdout;
    assert_eq!(list.lines().filter(|line| line.contains("closed late")).count(), 1, "{list}");
    let json: serde_json::Value = serde_json::from_str(&place.run(["records", "list", "--json"]).stdout).expect("JSON");
    let seals: Vec<_> = json.as_array().into_iter().flatten().map(|one| (one["run"] == *name, &one["seal"])).collect();
    assert_eq!(seals, [(false, &"held".into()), (true, &"closed_late".into()), (false, &"held".into())]);

    let table = place.run(["records", "list", "--csv"]).stdout;
    let column =
        table.lines().next().and_then(|head| head.split(',').position(|name| name == "seal")).expect("a column");
    let seals: Vec<_> = table.lines().skip(1).filter_map(|line| line.split(',').nth(column)).collect();
    assert_eq!(seals, ["held", "closed_late", "held"], "{table}");

    fs::write(run.join("log.txt"), "all is well").expect("a log");
    let changed = place.run(["records", "verify", run.to_str().expect("UTF-8")]);
    assert_eq!(changed.code, Some(1), "{}", changed.stdout);
    assert!(changed.stdout.contains("its files were changed after that"), "{}", changed.stdout);
}

/// The computer stands still for longer than the board waits, as in a suspend: the module is made safe, the item in
/// flight is errored and repeated, and the run goes on.
#[test]
fn a_computer_that_stood_still_charges_nobody() {
    let mut board = board();
    let place = with_board(&board);
    let mut running = Running::start(&place, &["--only", "identity,sdram"]);
    running.until(r#""kind":"item_started","item":"sdram""#);
    running.signal(Signal::SIGSTOP);
    until_safe(&mut board);
    running.signal(Signal::SIGCONT);
    assert_eq!(running.end().0, PARTIAL, "{}", log(&place.runs()[0]));
    let items = place.record()["items"].clone();
    let sdram = items.as_array().into_iter().flatten().find(|item| item["id"] == "sdram").expect("sdram");
    let outcomes: Vec<_> = sdram["attempts"].as_array().into_iter().flatten().map(|one| &one["outcome"]).collect();
    assert_eq!(outcomes, ["errored", "passed"], "{}", log(&place.runs()[0]));
}

/// The records are removed during the run: the run is errored and says why, and the module is off.
#[test]
fn records_that_are_removed_end_the_run_as_errored() {
    let mut board = board();
    let place = with_board(&board);
    let mut running = Running::start(&place, &["--only", "identity,sdram,io"]);
    running.until(r#""kind":"item_started","item":"sdram""#);
    fs::remove_dir_all(place.path().join("records")).expect("records");
    let (code, complaint) = running.end();
    assert_eq!(code, Some(3), "{complaint}");
    assert!(complaint.contains("its record could not be written"), "{complaint}");
    until_safe(&mut board);
    assert_eq!(Running::start(&place, &["--only", "identity"]).end().0, PARTIAL);
    assert_eq!(place.run(["records", "verify"]).code, Some(0));
}

/// A bench with a key signs the runs that it closes. With the public half any later change is found, even if all
/// digests were made again.
#[test]
fn a_run_is_signed_where_the_bench_names_a_key() {
    let board = board();
    let place = with_board(&board);
    assert_eq!(place.run(["records", "key", "station.key"]).code, Some(0));
    assert_eq!(place.run(["records", "key", "station.key"]).code, Some(2), "never written over");
    let bench = fs::read_to_string(place.path().join("bench.toml")).expect("a bench file");
    place.write("bench.toml", &bench.replace("id = \"ends\"\n", "id = \"ends\"\nkey = \"station.key\"\n"));
    assert_eq!(Running::start(&place, &["--only", "identity"]).end().0, PARTIAL);
    let verify = || place.run(["records", "verify", "--key", "station.key.pub"]);
    assert_eq!(verify().code, Some(0), "{}", verify().stdout);

    let run = &place.runs()[0];
    let sums = fs::read_to_string(run.join("SHA256SUMS")).expect("digests");
    fs::write(run.join("SHA256SUMS"), sums.lines().rev().map(|line| format!("{line}\n")).collect::<String>())
        .expect("digests");
    assert!(as_written::verify(run).is_empty(), "as digests they are as good as before");
    assert_eq!(verify().code, Some(1));
    assert!(verify().stdout.contains("is not the signature of SHA256SUMS with this key"), "{}", verify().stdout);
    fs::write(run.join("SHA256SUMS"), sums).expect("digests");
    fs::remove_file(run.join("SHA256SUMS.sig")).expect("a signature");
    assert!(verify().stdout.contains("the run is not signed"), "{}", verify().stdout);

    // A key file that others can read is refused before power is switched on.
    let open = std::os::unix::fs::PermissionsExt::from_mode(0o644);
    fs::set_permissions(place.path().join("station.key"), open).expect("rights");
    let (code, complaint) = Running::start(&place, &["--only", "identity"]).end();
    assert_eq!(code, Some(2), "{complaint}");
    assert!(complaint.contains("other users may use the key") && complaint.contains("chmod 600"), "{complaint}");
    assert_eq!(place.runs().len(), 1);
}

/// The station is held in the middle of a capture, as by a sleeping computer, until the board's watchdog has made the module
/// safe. The attempt says that, and not that a cable has lost samples; the next one passes.
#[test]
fn a_station_that_stood_still_says_so() {
    let mut board = board();
    let place = with_board(&board);
    let mut station = Running::start(&place, &["--only", "imu"]);
    station.until("\"item_started\"");
    station.signal(Signal::SIGSTOP);
    until_safe(&mut board);
    station.signal(Signal::SIGCONT);
    let (code, said) = station.end();
    assert_eq!(code, Some(5), "{said}");
    let record = place.record();
    let mut items = record["items"].as_array().expect("items").iter();
    let attempts = &items.find(|item| item["name"] == "imu").expect("the item")["attempts"];
    let text = attempts[0]["error"]["text"].as_str().unwrap_or_default();
    assert!(text.starts_with("the station itself stood still for "), "{record:#}");
    assert_eq!(attempts[0]["outcome"], "errored");
    assert_eq!(attempts[1]["outcome"], "passed");
}
