//! Carries out one run over pseudo-terminals: the station on one thread, the bench on another.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::thread::JoinHandle;
use std::time::Duration;

use gnc_bench::control::RunControl;
use gnc_bench::fixture::Fixture;
use gnc_bench::runner::Live;
use gnc_bench::service;
use gnc_executive::verdict::Verdict;
use gnc_link::Target;
use gnc_link::can::CanTarget;
use hw_mocks::{Cable, RunningBench, Speed};
use tokio::time::Instant;

use super::case::{Case, Link};
use super::order::{Heard, Ordered, order};
use super::run::{Act, LONGEST, Ran, SAFE_AFTER, acts, options};

/// Room for unread events: more than any run of the functional plan has.
const UNHEARD: usize = 1 << 14;

/// A message from a run to the campaign.
enum News {
    Event,
    Ended(Ended),
}

/// The verdict of a run and its folder, or the error that prevented it.
type Ended = Result<(Verdict, PathBuf), String>;

pub(super) fn run_in(case: &Case, place: &Path) -> Result<Ran, String> {
    let options = options(case, Speed::Max)?;
    let bench = RunningBench::start(&options).map_err(|error| error.to_string())?;
    // Symbolic links, as udev makes them: a cable that is plugged in again has the same name.
    let port = place.join("port");
    let adapter = place.join("adapter");
    let slcan = bench.can_port().trim_start_matches("slcan:").to_owned();
    point(&port, bench.port())?;
    point(&adapter, Path::new(&slcan))?;
    let hands = bench.control();
    let control = RunControl::default();
    let (told, news) = mpsc::sync_channel(UNHEARD);
    let began = Instant::now();
    let can = CanTarget::parse(&format!("slcan:{}", adapter.display()));
    let target = match case.link {
        Link::Rs422 => Target::Serial { port: port.clone(), rate_baud: options.rate_baud },
        Link::Can => Target::Can(can.clone()),
    };
    let fixture = Fixture::Driven(std::sync::Arc::new(hands.clone()));
    let ordered = order(case, "max", (target, can), fixture, place, None)?;
    let station = Station { control: control.clone(), told, ordered };
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
        ran.problems.push(format!("the run did not end within {LONGEST:?}"));
        // The thread is left alone: a thread that hangs cannot be ended.
        return Ok(ran);
    };
    let truth = hands.truth().map_err(|error| error.to_string())?;
    (ran.line, ran.restarts) = (truth.line, truth.restarts);
    ran.off_after = off_after(&hands);
    ran.off_since_disturbed = off.and_then(|off| off.join().ok().flatten());
    let _ = thread.join();
    let (verdict, folder) = ended?;
    Ok(ran.with_record(verdict, &folder))
}

fn point(link: &Path, port: &Path) -> Result<(), String> {
    // Moved into its place by a rename, so that the link is never missing.
    let fresh = link.with_extension("new");
    std::os::unix::fs::symlink(port, &fresh)
        .and_then(|()| std::fs::rename(&fresh, link))
        .map_err(|error| format!("{}: {error}", link.display()))
}

/// Waits for the end of the run, and disturbs it at its moment.
fn watch(
    case: &Case,
    news: &Receiver<News>,
    control: &RunControl,
    hands: &hw_mocks::BenchControl,
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
                    // The link disappears with its device.
                    std::fs::remove_file(link).map_err(|error| error.to_string())?;
                    hands.unplug(cable).map_err(|error| error.to_string())?;
                }
                Act::Suspend(_) => {}
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
            Err(RecvTimeoutError::Disconnected) => return Err("the station's thread panicked".to_owned()),
        }
    }
}

/// How a run ended, when it was disturbed, and the thread that waits for the module to be off after that.
type Watched = (Option<Ended>, Option<Instant>, Option<JoinHandle<Option<Duration>>>);

/// Time until the module is off.
fn off_after(hands: &hw_mocks::BenchControl) -> Option<Duration> {
    let began = Instant::now();
    hands.wait_off(SAFE_AFTER).is_ok_and(|off| off).then(|| began.elapsed())
}

/// The input of the station's thread.
struct Station {
    control: RunControl,
    told: SyncSender<News>,
    ordered: Ordered,
}

impl Station {
    fn run(self) {
        let told = self.told.clone();
        let ended = self.follow_plan();
        let _ = told.send(News::Ended(ended));
    }

    fn follow_plan(self) -> Ended {
        let Ordered { request, equipment } = self.ordered;
        let told = self.told;
        let mut listener = Heard::new(move || told.send(News::Event).is_ok());
        let runtime =
            tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(|error| error.to_string())?;
        let live = Live::default();
        let done = runtime.block_on(service::run(&request, equipment, &self.control, &live, &mut listener));
        runtime.shutdown_background();
        listener.ended(done)
    }
}
