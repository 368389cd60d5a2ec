//! Carries out one run: station and bench in this program, the pseudo-terminals between them.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use chrono::Local;
use gnc_executive::bench::BenchFile;
use gnc_executive::event::{Bench, EVENTS_SCHEMA, PlanInfo, Program, RunHeader};
use gnc_executive::job::{BenchAbilities, Job};
use gnc_executive::outcome::Outcome;
use gnc_executive::plan::Plan;
use gnc_executive::record::RunRecord;
use gnc_station::control::Control;
use gnc_station::fixture::Fixture;
use gnc_station::link::Target;
use gnc_station::link::can::CanTarget;
use gnc_station::runner::journal::Journal;
use gnc_station::runner::{self, Live, Order};
use gnc_station::store::{RunFolder, Scribe, Watcher, digest, reader};
use hw_mocks::{Cable, LineTruth, Options, Personality, RunningBench, Speed};

use super::case::{Case, Disturbance, Link};

/// A run on a clean line takes a second or two; one in which every item meets a dead line twice some forty, and over CAN,
/// where a message that breaks off takes a second more, some eighty. Twice that on a computer that is busy.
pub const LONGEST: Duration = Duration::from_secs(160);
/// The watchdog of the board switches the module off 2 s after the last word of the station; the rest is for a computer
/// with a dozen runs on it.
const SAFE_AFTER: Duration = Duration::from_secs(5);
/// More events than any run of the functional plan has.
const UNHEARD: usize = 1 << 14;

/// What came of a run.
#[derive(Debug, Default)]
pub struct Ran {
    /// Its record; `None` if it did not come to an end, or left none.
    pub record: Option<RunRecord>,
    /// What the station called it.
    pub outcome: Option<Outcome>,
    /// What is wrong with the record, or hindered the run.
    pub problems: Vec<String>,
    /// How long it took.
    pub took: Duration,
    /// From the disturbance to the end of the run; `None` if it ended before.
    pub since_disturbed: Option<Duration>,
    /// From the end of the run until the module was off; `None` if it never was.
    pub off_after: Option<Duration>,
    /// From the disturbance until the module was off; `None` if nobody disturbed it, or it never was.
    pub off_since_disturbed: Option<Duration>,
    /// What the line really did.
    pub line: LineTruth,
    /// Restarts of the board, its first start not counted.
    pub restarts: u32,
}

/// What the campaign hears of a run.
enum News {
    Event,
    Ended(Ended),
}

/// The outcome of a run and its folder, or what hindered it.
type Ended = Result<(Outcome, PathBuf), String>;

/// Runs it; a record about which something is wrong is kept in `keep`.
#[must_use]
pub fn run(case: &Case, keep: Option<&Path>) -> Ran {
    match tempfile::TempDir::new() {
        Ok(place) => {
            let ran = run_in(case, place.path()).unwrap_or_else(|why| Ran { problems: vec![why], ..Ran::default() });
            if let Some(keep) = keep.filter(|_| !super::violations(case, &ran).is_empty()) {
                // Whether it can be kept or not, the run is told of.
                let _ = std::fs::create_dir_all(keep);
                let _ = std::fs::rename(place.keep(), keep.join(format!("{}-{}", case.seed, case.number)));
            }
            ran
        }
        Err(error) => Ran { problems: vec![format!("no folder for the run: {error}")], ..Ran::default() },
    }
}

fn run_in(case: &Case, place: &Path) -> Result<Ran, String> {
    let text = case.text();
    std::fs::write(place.join("board.toml"), &text).map_err(|error| error.to_string())?;
    let personality = Personality::from_toml(case.board, &text).map_err(|error| error.to_string())?;
    let options = Options {
        serial_number: Some("T-1".to_owned()),
        seed: case.bench_seed(),
        speed: Speed::Max,
        personality,
        ..Options::default()
    };
    let bench = RunningBench::start(&options).map_err(|error| error.to_string())?;
    // By links of our own, as udev makes them: a cable that is plugged in again has the same name.
    let port = place.join("port");
    let adapter = place.join("adapter");
    let slcan = bench.can_port().trim_start_matches("slcan:").to_owned();
    point(&port, bench.port())?;
    point(&adapter, Path::new(&slcan))?;
    let hands = bench.control();
    let control = Control::default();
    let (told, news) = mpsc::sync_channel(UNHEARD);
    let began = Instant::now();
    let station = Station {
        control: control.clone(),
        told,
        records: place.join("records"),
        target: match case.link {
            Link::Rs422 => Target::Serial { port: port.clone(), rate_baud: options.rate_baud },
            Link::Can => Target::Can(CanTarget::parse(&format!("slcan:{}", adapter.display()))),
        },
        can: CanTarget::parse(&format!("slcan:{}", adapter.display())),
        rs422: case.link == Link::Rs422,
        fixture: Fixture::Simulated(hands.clone()),
        board: case.board.to_owned(),
        seed: options.seed,
    };
    let thread = std::thread::Builder::new()
        .name(format!("run {}", case.number))
        .spawn(move || station.run())
        .map_err(|error| error.to_string())?;
    let cable = match case.link {
        Link::Rs422 => (Cable::Serial, port.as_path()),
        Link::Can => (Cable::Slcan, adapter.as_path()),
    };
    let (ended, disturbed, off) = watch(case, &news, &control, &hands, cable)?;
    let took = began.elapsed();
    let mut ran = Ran { took, since_disturbed: disturbed.map(|at| at.elapsed()), ..Ran::default() };
    let Some(ended) = ended else {
        ran.problems.push(format!("it did not come to an end within {LONGEST:?}"));
        // Its thread is left to itself: nothing ends a thread that hangs.
        return Ok(ran);
    };
    let truth = hands.truth().map_err(|error| error.to_string())?;
    (ran.line, ran.restarts) = (truth.line, truth.restarts);
    ran.off_after = off_after(&hands);
    ran.off_since_disturbed = off.and_then(|off| off.join().ok().flatten());
    let _ = thread.join();
    let (outcome, folder) = ended?;
    ran.outcome = Some(outcome);
    ran.problems.extend(reader::verify(&folder));
    match reader::read(&folder) {
        Ok(record) => ran.record = Some(record),
        Err(why) => ran.problems.push(why),
    }
    Ok(ran)
}

fn point(link: &Path, port: &Path) -> Result<(), String> {
    // Moved into its place, so that nobody finds it missing.
    let fresh = link.with_extension("new");
    std::os::unix::fs::symlink(port, &fresh)
        .and_then(|()| std::fs::rename(&fresh, link))
        .map_err(|error| format!("{}: {error}", link.display()))
}

/// Waits for the end of the run, and disturbs it at its moment.
fn watch(
    case: &Case,
    news: &Receiver<News>,
    control: &Control,
    hands: &hw_mocks::Control,
    (cable, link): (Cable, &Path),
) -> Result<Watched, String> {
    let mut due: Vec<(Instant, Act)> = Vec::new();
    let (mut events, mut disturbed, mut off) = (0, None, None);
    let end = Instant::now() + LONGEST;
    loop {
        due.sort_by_key(|(at, _)| *at);
        let now = Instant::now();
        if due.first().is_some_and(|(at, _)| *at <= now) {
            let (_, act) = due.remove(0);
            disturbed.get_or_insert(now);
            off = off.or_else(|| {
                let hands = hands.clone();
                Some(std::thread::spawn(move || off_after(&hands)))
            });
            match act {
                Act::Stop => control.stop("SIGTERM"),
                Act::Unplug => {
                    // The link goes with its device.
                    std::fs::remove_file(link).map_err(|error| error.to_string())?;
                    hands.unplug(cable).map_err(|error| error.to_string())?;
                }
                Act::PlugIn => point(link, &hands.plug_in(cable).map_err(|error| error.to_string())?)?,
            }
            continue;
        }
        let until = due.first().map_or(end, |(at, _)| (*at).min(end));
        match news.recv_timeout(until.saturating_duration_since(now)) {
            Ok(News::Event) => {
                events += 1;
                if events == case.moment.0 {
                    due.extend(acts(case));
                }
            }
            Ok(News::Ended(ended)) => return Ok((Some(ended), disturbed, off)),
            Err(RecvTimeoutError::Timeout) if Instant::now() < end => {}
            Err(RecvTimeoutError::Timeout) => return Ok((None, disturbed, None)),
            Err(RecvTimeoutError::Disconnected) => return Err("the station's thread came to grief".to_owned()),
        }
    }
}

/// How a run ended, when it was disturbed, and who waits for the module to be off since then.
type Watched = (Option<Ended>, Option<Instant>, Option<JoinHandle<Option<Duration>>>);

/// What somebody does.
#[derive(Debug, Clone, Copy)]
enum Act {
    Stop,
    Unplug,
    PlugIn,
}

fn acts(case: &Case) -> Vec<(Instant, Act)> {
    let at = Instant::now() + case.moment.1;
    match case.disturbance {
        Disturbance::None => Vec::new(),
        Disturbance::Stop { again } => {
            [Some(at), again.map(|after| at + after)].into_iter().flatten().map(|at| (at, Act::Stop)).collect()
        }
        Disturbance::Unplug { back } => {
            let back = back.map(|after| (at + after, Act::PlugIn));
            [Some((at, Act::Unplug)), back].into_iter().flatten().collect()
        }
    }
}

/// How long the module is still on.
fn off_after(hands: &hw_mocks::Control) -> Option<Duration> {
    let began = Instant::now();
    hands.wait_off(SAFE_AFTER).is_ok_and(|off| off).then(|| began.elapsed())
}

/// What the station's thread needs.
struct Station {
    control: Control,
    told: SyncSender<News>,
    records: PathBuf,
    target: Target,
    can: CanTarget,
    rs422: bool,
    fixture: Fixture,
    board: String,
    seed: u64,
}

impl Station {
    fn run(self) {
        let told = self.told.clone();
        let ended = self.follow_plan();
        let _ = told.send(News::Ended(ended));
    }

    fn follow_plan(self) -> Ended {
        let said = |error: &dyn std::fmt::Display| error.to_string();
        let bytes = std::fs::read(crate::functional_plan()).map_err(|error| said(&error))?;
        let mut no_includes = |name: &str| Err(format!("{name}: the functional plan includes nothing"));
        let plan = Plan::read("functional.toml", bytes, &mut no_includes).map_err(|mistakes| said(&mistakes))?;
        let file = BenchFile::read("the simulated bench's file", hw_mocks::BENCH_FILE.as_bytes().to_vec())
            .map_err(|mistakes| said(&mistakes))?;
        let abilities = BenchAbilities { rs422: self.rs422, can: true, operator: true };
        let header = RunHeader {
            schema: EVENTS_SCHEMA.to_owned(),
            serial_number: "T-1".to_owned(),
            operator: None,
            station: "campaign".to_owned(),
            program: Program { name: env!("CARGO_PKG_NAME").to_owned(), version: env!("CARGO_PKG_VERSION").to_owned() },
            bench: Bench::simulated(self.board, "max", self.seed),
            plan: PlanInfo {
                name: plan.name.clone(),
                version: plan.version.clone(),
                sha256: digest::of_plan(plan.files()),
            },
            site: file.site.clone(),
            recomputed: None,
            resumed: None,
            selection: None,
            looped: None,
        };
        let order = Order {
            job: Job::new(plan.clone(), abilities, None).map_err(|mistakes| said(&mistakes))?,
            header,
            target: self.target,
            can: Some(self.can),
            fixture: self.fixture,
            site: file.site,
            resumed: None,
            one_by_one: false,
            found: Vec::new(),
        };
        let folder = RunFolder::create(&self.records, Local::now().fixed_offset(), "T-1", &plan.name)
            .map_err(|error| said(&error))?;
        let path = folder.path().to_owned();
        let told = self.told;
        let watcher: Watcher = Box::new(move |_| told.send(News::Event).is_ok());
        let scribe = Scribe::start(folder, &plan, vec![watcher]).map_err(|error| said(&error))?;
        let runtime =
            tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(|error| said(&error))?;
        let ending = runtime.block_on(runner::run(&order, Journal::new(scribe), &self.control, &Live::default()));
        runtime.shutdown_background();
        match ending.store_error {
            Some(error) => Err(format!("the record could not be written: {error}")),
            None => Ok((ending.outcome, path)),
        }
    }
}
