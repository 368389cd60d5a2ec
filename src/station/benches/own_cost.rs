//! Measures what the station itself costs: time and memory of an item and of a 1 kHz stream, a day of that stream in
//! board time at full speed, and how late a wait ends beside one. Prints figures with their bounds.
//!
//!     cargo bench -p gnc-station --bench own_cost [-- cost | items N | stream SECONDS | day HOURS | waits N]
//!
//! `openhtf_peer.py` beside this file runs OpenHTF on the same task and prints both.

#![expect(clippy::expect_used, clippy::print_stdout, reason = "a benchmark prints, and ends where it cannot go on")]

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use chrono::Local;
use gnc_bench::journal::RunJournal;
use gnc_board::stream::{SampleFrame, Stream};
use gnc_board::{Advance, BoardClient, BoardError, BoardLease};
use gnc_executive::event::{BenchInfo, EVENTS_SCHEMA, EventKind, PlanInfo, ProgramVersion, RunHeader};
use gnc_executive::job::{BenchAbilities, Job, Next};
use gnc_executive::measurement::Value;
use gnc_executive::plan::Plan;
use gnc_link::{Link, Target};
use gnc_protocol::message::{ModulePower, StreamStart};
use gnc_protocol::stream::StreamId;
use gnc_records::store::{RecordWriter, RunFolder};
use hw_mocks::{BenchOptions, RunningBench, Speed};
use tokio::sync::watch;

/// Time that a trivial item costs, journal and record included.
const ITEM_MS: f64 = 0.1;
/// Memory of one item, measured between plans of 200 and of 20,000 items.
const ITEM_BYTES: f64 = 1000.0;
/// Share of a core for a stream of 1 kHz.
const STREAM_SHARE: f64 = 0.05;
/// Shortest and longest duration of a wait of half a second, milliseconds.
const WAIT_MS: (f64, f64) = (500.0, 520.0);
/// Memory that a stream of a day may hold at its end beyond that after its first hour: what the allocator keeps by
/// chance.
const DAY_BYTES: f64 = 1e6;
const RATE_HZ: u16 = 1000;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|arg| arg != "--bench").collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    match args.as_slice() {
        ["items", count] => items(count.parse().expect("a number")),
        ["cost"] => cost(),
        ["stream", seconds] => stream(seconds.parse().expect("a number")),
        ["day", hours] => day(hours.parse().expect("a number")),
        ["waits", count] => waits(count.parse().expect("a number")),
        _ => all(),
    }
}

fn all() {
    cost();
    let [share, lost] = child(&["stream", "60"])[..] else { return };
    verdict("1 kHz stream for 60 s, share of a core", share, STREAM_SHARE, "");
    verdict("1 kHz stream for 60 s, samples lost", lost, 0.0, "");
    let [shortest, longest] = child(&["waits", "60"])[..] else { return };
    verdict("60 waits of 500 ms beside a 1 kHz stream, longest", longest, WAIT_MS.1, "ms");
    verdict("the same, 500 ms less the shortest", WAIT_MS.0 - shortest, 0.0, "ms");
    let [lost, grown, rate] = child(&["day", "24"])[..] else { return };
    verdict("24 h of 1 kHz in board time, samples lost", lost, 0.0, "");
    verdict("the same, memory grown after the first hour", grown, DAY_BYTES, "bytes");
    println!("the same, {:.2} million samples a second of wall time", rate * 1e-6);
}

fn cost() {
    let few = child(&["items", "200"]);
    let many = child(&["items", "20000"]);
    let per_item_ms = (many[0] - few[0]) / 19_800.0 * 1e3;
    let per_item_bytes = (many[1] - few[1]) / 19_800.0;
    verdict("own cost of a trivial item", per_item_ms, ITEM_MS, "ms");
    verdict("memory of an item", per_item_bytes, ITEM_BYTES, "bytes");
}

fn verdict(what: &str, value: f64, bound: f64, unit: &str) {
    let word = if value <= bound { "within" } else { "ABOVE" };
    println!("{what:<42} {value:>10.4} {unit:<6} {word} the bound of {bound} {unit}");
}

/// Runs this program again in a process of its own, so that its memory is measured alone. The last line of output holds
/// the figures.
fn child(args: &[&str]) -> Vec<f64> {
    let program = std::env::current_exe().expect("this program");
    let output = Command::new(program).args(args).output().expect("this program again");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8_lossy(&output.stdout);
    let figures = text.lines().last().unwrap_or_default().split_whitespace();
    figures.map(|figure| figure.parse().expect("a number")).collect()
}

/// Runs a plan of trivial items, each with one measurement, through job, journal and record. Prints seconds and bytes.
fn items(count: usize) {
    use std::fmt::Write as _;
    let mut text = "name = \"many\"\nversion = \"1\"\n".to_owned();
    for item in 0..count {
        writeln!(text, "[[item]]\nid = \"io\"\nname = \"io-{item}\"\nlimits.wrong_reads = \"<= 0\"").expect("room");
    }
    let plan = Plan::read("many.toml", text.into_bytes(), &mut |_| Err(String::new())).expect("a plan");
    let bench = BenchAbilities { rs422: true, can: false, operator: false };
    let job = Job::new(plan, bench, None).expect("a job");
    // A folder in memory, so that the speed of the disk does not count.
    let folder = tempfile::TempDir::new_in("/dev/shm").expect("a folder in memory");
    let before = resident_bytes();
    let began = Instant::now();
    let runtime = tokio::runtime::Builder::new_current_thread().build().expect("a runtime");
    runtime.block_on(run(&job, folder.path()));
    println!("{} {}", began.elapsed().as_secs_f64(), resident_bytes() - before);
}

async fn run(job: &Job, records: &Path) {
    let folder = RunFolder::create(records, Local::now().fixed_offset(), "BENCH", "many").expect("a folder");
    let writer = RecordWriter::start(folder, job.plan(), Vec::new()).expect("a writer");
    let journal = RunJournal::new(writer);
    let header = Box::new(header());
    journal.emit(EventKind::RunStarted { header, items: job.planned() }).await.expect("written");
    loop {
        match journal.look(|state| job.next(state)) {
            Next::Run { item, attempt } => {
                let planned = job.item(item).expect("an item");
                let item = planned.name.clone();
                journal.emit(EventKind::ItemStarted { item: item.clone(), attempt }).await.expect("written");
                let measurement = planned.judge("wrong_reads", &Value::count(0), 1, "BENCH");
                let outcome = planned.attempt_outcome(std::slice::from_ref(&measurement));
                let measured = EventKind::Measured { item: item.clone(), attempt, measurement };
                journal.emit(measured).await.expect("written");
                let ended = EventKind::AttemptEnded { item, attempt, outcome, error: None };
                journal.emit(ended).await.expect("written");
            }
            Next::End { item, outcome } => {
                let item = job.item(item).expect("an item").name.clone();
                journal.emit(EventKind::ItemEnded { item, outcome, cause: None }).await.expect("written");
            }
            Next::Done { verdict } => {
                journal.emit(EventKind::RunEnded(verdict)).await.expect("written");
                break;
            }
            Next::Skip { .. } | Next::Wait => unreachable!("nothing is skipped and nothing overlaps"),
        }
    }
    journal.close().await.expect("closed");
}

fn header() -> RunHeader {
    RunHeader {
        schema: EVENTS_SCHEMA.to_owned(),
        serial_number: "BENCH".to_owned(),
        part: None,
        numbers: Vec::new(),
        operator: None,
        station: "bench".to_owned(),
        program: ProgramVersion { name: "own_cost".to_owned(), version: "0".to_owned(), build: None },
        bench: BenchInfo::real(),
        plan: PlanInfo { name: "many".to_owned(), version: "1".to_owned(), sha256: "0".repeat(64) },
        site: None,
        recomputed: None,
        resumed: None,
        selection: None,
        looped: None,
    }
}

/// Reads a 1 kHz stream of the IMU from the simulated board. Prints the share of a core that this end took, and the
/// samples lost.
fn stream(seconds: u32) {
    let wanted = seconds * u32::from(RATE_HZ);
    let (lost, busy) = beside_a_board(Speed::Times(1.0), async |lease| {
        let mut stream = started(lease, wanted).await;
        let before = thread_time();
        while !is_last(stream.next().await, wanted) {}
        (wanted - stream.losses().received, thread_time() - before)
    });
    println!("{} {lost}", busy.as_secs_f64() / f64::from(seconds));
}

/// Reads the same stream at full speed. Prints the samples lost, the memory held at the end beyond that after an hour
/// of board time, and samples a second.
fn day(hours: u32) {
    let hour = 3600 * u32::from(RATE_HZ);
    let wanted = hours * hour;
    let began = Instant::now();
    let (lost, grown) = beside_a_board(Speed::Max, async |lease| {
        let mut stream = started(lease, wanted).await;
        let mut after_an_hour = None;
        loop {
            let frame = stream.next().await;
            if stream.losses().received >= hour && after_an_hour.is_none() {
                after_an_hour = Some(held_bytes());
            }
            if is_last(frame, wanted) {
                break;
            }
        }
        (wanted - stream.losses().received, held_bytes() - after_an_hour.unwrap_or_default())
    });
    println!("{lost} {grown} {}", f64::from(wanted) / began.elapsed().as_secs_f64());
}

/// Waits half a second again and again, on the thread that reads a 1 kHz stream. Prints the shortest and the longest
/// wait in milliseconds.
fn waits(count: u32) {
    let wait = Duration::from_millis(WAIT_MS.0 as u64);
    let lasted = beside_a_board(Speed::Times(1.0), async |lease| {
        let mut stream = started(lease, 0).await;
        let mut lasted = Vec::new();
        for _ in 0..count {
            let began = Instant::now();
            let read = async { while !is_last(stream.next().await, u32::MAX) {} };
            let _ = tokio::time::timeout(wait, read).await;
            lasted.push(began.elapsed().as_secs_f64() * 1e3);
        }
        lasted
    });
    let shortest = lasted.iter().copied().fold(f64::INFINITY, f64::min);
    println!("{shortest} {}", lasted.iter().copied().fold(0.0, f64::max));
}

/// Works at a board whose module is switched on, in the way of an item.
fn beside_a_board<T>(speed: Speed, work: impl AsyncFnOnce(&BoardLease<'_>) -> T) -> T {
    let options = BenchOptions { speed, ..BenchOptions::default() };
    let bench = RunningBench::start(&options).expect("a simulated bench");
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    runtime.block_on(async {
        let target = Target::Serial { port: bench.port().to_owned(), rate_baud: options.rate_baud };
        let link = Link::open(&target).expect("a port");
        let board = BoardClient::connect(link, 1, Default::default()).await.expect("a board");
        let lease = BoardLease::new(&board, watch::channel(Advance::default()).0);
        lease.call(&ModulePower { on: 1 }).await.expect("power");
        work(&lease).await
    })
}

/// Starts the stream of the IMU with `count` samples; without end for 0.
async fn started(lease: &BoardLease<'_>, count: u32) -> Stream {
    let stream = lease.listen(StreamId::Imu).await.expect("a stream");
    let start = StreamStart { stream: StreamId::Imu as u8, rate_hz: RATE_HZ, count, samples_per_frame: 0 };
    lease.call(&start).await.expect("started");
    stream
}

fn is_last(frame: Result<Option<SampleFrame>, BoardError>, wanted: u32) -> bool {
    let frame = frame.expect("a live board");
    frame.is_some_and(|frame| frame.head.first + u32::from(frame.head.count) >= wanted)
}

/// Processor time of this thread alone: the simulated board runs on another one.
fn thread_time() -> Duration {
    let time = nix::time::clock_gettime(nix::time::ClockId::CLOCK_THREAD_CPUTIME_ID).expect("a clock");
    Duration::from(time)
}

/// Largest memory that this process has held.
fn resident_bytes() -> f64 {
    memory("VmHWM:")
}

/// Memory that this process holds now.
fn held_bytes() -> f64 {
    memory("VmRSS:")
}

fn memory(what: &str) -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let line = status.lines().find(|line| line.starts_with(what)).expect("a figure of memory");
    line.split_whitespace().nth(1).and_then(|kb| kb.parse::<f64>().ok()).expect("kilobytes") * 1024.0
}
