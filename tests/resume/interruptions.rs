//! A calibration is interrupted at random moments, by SIGINT, SIGKILL and a plug that is pulled.

use std::fs;
use std::os::fd::AsFd as _;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::atomic::{AtomicUsize, Ordering};

use gnc_tests::{Place, read_json};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::inotify::{AddWatchFlags, InitFlags, Inotify};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rand::{RngExt as _, SeedableRng as _};

use crate::inside::{self, Bench};
use crate::values::{self, Values};
use crate::{SHORT, STATION, WARM};

/// The moments; another seed gives other moments.
const SEED: u64 = 20_261_130;
/// Runs that are interrupted by a signal, and those whose plug is pulled.
const SIGNALS: usize = 16;
const PULLS: usize = 4;
/// Runs at the same time.
const THREADS: usize = 8;
/// Speed of the runs that are interrupted: an item takes some seconds.
pub(crate) const SPEED: &str = "50";
/// Items that capture, by their folders.
const CAPTURING: [&str; 3] = ["02-magnetometer-ellipsoid", "03-six-position", "05-rotation"];

pub(crate) fn place(module: &str) -> Place {
    let place = Place::new(STATION);
    place.write("p.toml", SHORT);
    place.write("module.toml", module);
    place
}

/// A module whose gyroscope Z has a bias of 3 deg/s.
pub(crate) fn bad() -> String {
    WARM.replace("[gyro]", "[gyro]\noffset_dps = [0.0, 0.0, 3.0]")
}

pub(crate) fn args(speed: &'static str, seed: &str) -> Vec<String> {
    let fixed =
        ["--auto", "p.toml", "--sim=module.toml", "--serial-number", "C-1", "--sim-speed", speed, "--seed", seed];
    fixed.map(str::to_owned).to_vec()
}

/// Runs that nothing interrupts, on modules with the chance of three seeds.
struct References {
    values: Vec<Values>,
    /// Raw files, and their lengths.
    files: Vec<(String, u64)>,
}

fn references() -> References {
    let places = ["1", "2", "3"].map(|seed| {
        let place = place(WARM);
        let run = place.run(args("max", seed));
        assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
        place
    });
    let file = |folder: &str| {
        let name = format!("{folder}/attempt-1.mcap");
        let bytes = fs::metadata(places[0].runs()[0].join(&name)).expect("a raw file").len();
        (name, bytes)
    };
    References {
        values: places.iter().map(|place| values::of(&place.runs()[0])).collect(),
        files: CAPTURING.map(file).into(),
    }
}

/// Carries out so many cases, some at once.
fn all(cases: usize, case: impl Fn(u64) + Sync) {
    println!("seed {SEED}");
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..THREADS {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= cases {
                        return;
                    }
                    case(SEED + index as u64);
                }
            });
        }
    });
}

/// Waits until a file below a run is longer than this; `false`: the program has ended.
fn longer(records: &Path, file: &str, bytes: u64, ended: &mut impl FnMut() -> bool) -> bool {
    let inotify = Inotify::init(InitFlags::IN_CLOEXEC | InitFlags::IN_NONBLOCK).expect("inotify");
    let tenth = PollTimeout::from(100u16);
    loop {
        let runs =
            if records.exists() { gnc_records::store::reader::list(records).expect("records") } else { Vec::new() };
        let path = runs.last().map(|run| run.path.join(file));
        if path.as_ref().is_some_and(|path| fs::metadata(path).is_ok_and(|meta| meta.len() > bytes)) {
            return true;
        }
        if ended() {
            return false;
        }
        if let Some(folder) = path.as_deref().and_then(Path::parent) {
            let _ = inotify.add_watch(folder, AddWatchFlags::IN_CREATE | AddWatchFlags::IN_MODIFY);
        }
        let _ = poll(&mut [PollFd::new(inotify.as_fd(), PollFlags::POLLIN)], tenth).expect("poll");
        let _ = inotify.read_events();
    }
}

/// Runs the station and sends it a signal at a moment. Returns the run, and whether the signal came in time.
pub(crate) fn interrupt(place: &Place, args: &[String], (file, bytes): (&str, u64), signal: Signal) -> (PathBuf, bool) {
    let before = place.runs().len();
    let mut station = place.station(args).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the station");
    let records = place.path().join("records");
    // The file of an earlier run does not count.
    let mut gone = || station.try_wait().expect("a state").is_some();
    let in_time =
        (place.runs().len() > before || begun(place, before, &mut gone)) && longer(&records, file, bytes, &mut gone);
    if in_time {
        let _ = kill(Pid::from_raw(i32::try_from(station.id()).expect("a process id")), signal);
    }
    let code = station.wait().expect("its end").code();
    (place.runs().pop().expect("a run"), !matches!(code, Some(0 | 1)))
}

/// Waits until there are more runs than before.
fn begun(place: &Place, before: usize, ended: &mut impl FnMut() -> bool) -> bool {
    loop {
        if place.runs().len() > before {
            return true;
        }
        if ended() {
            return false;
        }
        std::thread::yield_now();
    }
}

/// Sixteen runs, every fourth of a bad module, every third interrupted twice. Each ends as the run that nobody interrupts.
#[test]
fn a_calibration_that_signals_interrupt_ends_as_if_nothing_had_been() {
    let references = references();
    all(SIGNALS, |seed| {
        let mut dice = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let (is_bad, twice) = (seed % 4 == 3, seed % 3 == 0);
        let place = place(&if is_bad { bad() } else { WARM.to_owned() });
        let mut moment = || {
            let (file, bytes) = &references.files[dice.random_range(0..references.files.len())];
            let signal = if dice.random_bool(0.5) { Signal::SIGINT } else { Signal::SIGKILL };
            (file.clone(), dice.random_range(0..bytes * 9 / 10), signal)
        };
        let (file, bytes, signal) = moment();
        let (mut run, mut open) = interrupt(&place, &args(SPEED, "1"), (&file, bytes), signal);
        println!("seed {seed}: {signal} at {bytes} bytes of {file}: interrupted {open}");
        if twice && open {
            let (file, bytes, signal) = moment();
            let again = [args(SPEED, "2"), vec!["--resume".into(), run.display().to_string()]].concat();
            (run, open) = interrupt(&place, &again, (&file, bytes), signal);
            println!("seed {seed}: again {signal} at {bytes} bytes of {file}: interrupted {open}");
        }
        if open {
            let resume = ["--resume".to_owned(), run.display().to_string()];
            let ended = place.run([&args("max", "3")[..], &resume].concat());
            assert_eq!(ended.code, Some(i32::from(is_bad)), "seed {seed}: {}{}", ended.stdout, ended.stderr);
            run = place.runs().pop().expect("a run");
        }
        let record = read_json(&run.join("run.json"));
        assert_eq!(record["outcome"].as_str(), Some(if is_bad { "failed" } else { "passed" }), "seed {seed}");
        if !is_bad {
            let strange = values::strange(&values::of(&run), &references.values);
            assert!(strange.is_empty(), "seed {seed}, {}: {strange:#?}", run.display());
        }
    });
}

/// The plug is pulled for good at a random moment, and the run that it ended is taken up on the same module.
#[test]
fn a_calibration_that_loses_its_line_ends_as_if_nothing_had_been() {
    let references = references();
    all(PULLS, |seed| {
        let mut dice = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let item = ["magnetometer-ellipsoid", "six-position", "rotation"][dice.random_range(0..3)];
        let share = dice.random_range(0.1..0.9);
        println!("seed {seed}: unplugged at {share:.3} of {item}");
        let mut bench = Bench::start(WARM, 1);
        let first = bench.run(&inside::request(SHORT), Some((item, share, inside::Deed::Unplug)));
        assert_eq!(first.outcome, "errored", "seed {seed}: {}", first.log());
        bench.plug_in();
        let mut again = inside::request(SHORT);
        again.resume = Some(first.folder.clone());
        let ended = bench.run(&again, None);
        assert_eq!(ended.outcome, "passed", "seed {seed}: {}", ended.log());
        let strange = values::strange(&values::of(&ended.folder), &references.values);
        assert!(strange.is_empty(), "seed {seed}: {strange:#?}");
    });
}
