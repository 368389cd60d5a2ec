//! Runs within this process, on a module that stays in its socket from run to run.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use gnc_bench::control::RunControl;
use gnc_bench::fixture::Fixture;
use gnc_bench::guidance::Guidance;
use gnc_bench::runner::{Ending, Live};
use gnc_bench::service::{self, CheckedPlan, Equipment, Observer, Rounds, RunRequest, ServiceError};
use gnc_executive::bench::BenchFile;
use gnc_executive::event::{BenchInfo, ProgramVersion};
use gnc_executive::job::BenchAbilities;
use gnc_executive::plan::Plan;
use gnc_link::Target;
use gnc_records::store::{RunFolder, Watcher};
use hw_mocks::{BenchControl, BenchOptions, Cable, Personality, RunningBench, Speed};
use tempfile::TempDir;

/// How fast bench time runs: a capture of 20 s takes long enough to be interrupted.
const SPEED: f64 = 100.0;

/// What happens at a moment of a run.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Deed {
    /// The plug is pulled.
    Unplug,
    /// The operator stops the run.
    Stop,
    /// The operator stops the run when this round of the item is so far.
    StopInRound(u32),
}

/// A request for one run of a plan.
pub(crate) fn request(plan: &str) -> RunRequest {
    let plan = Plan::read("p.toml", plan.into(), &mut |_| Err("no includes".to_owned()));
    RunRequest {
        plan: plan.and_then(CheckedPlan::new).unwrap_or_else(|mistakes| panic!("{mistakes}")),
        serial_number: "C-1".to_owned(),
        part: None,
        numbers: Vec::new(),
        operator: None,
        selection: None,
        answers: gnc_bench::questions::Answers::default(),
        program: ProgramVersion { name: "resume".to_owned(), version: "0".to_owned(), build: None },
        on_fail: None,
        rounds: Rounds::Once,
        resume: None,
        one_by_one: false,
        nonce: None,
        began: None,
    }
}

/// A run that has ended.
pub(crate) struct Ended {
    pub(crate) folder: PathBuf,
    pub(crate) outcome: String,
    _records: Arc<TempDir>,
}

impl Ended {
    pub(crate) fn log(&self) -> String {
        std::fs::read_to_string(self.folder.join("log.txt")).unwrap_or_default()
    }
}

/// A bench with a module.
pub(crate) struct Bench {
    bench: RunningBench,
    port: PathBuf,
    rate_baud: u32,
    records: Arc<TempDir>,
}

impl Bench {
    pub(crate) fn start(module: &str, seed: u64) -> Self {
        Self::with(module, seed, Arc::new(tempfile::tempdir().expect("a folder")))
    }

    /// The bench on another day: another room and other chance, and the same records.
    pub(crate) fn of(module: &str, seed: u64, before: &Self) -> Self {
        Self::with(module, seed, Arc::clone(&before.records))
    }

    fn with(module: &str, seed: u64, records: Arc<TempDir>) -> Self {
        let personality = Personality::from_toml("module", module).unwrap_or_else(|mistakes| panic!("{mistakes}"));
        let speed = Speed::Times(SPEED);
        let options =
            BenchOptions { personality, seed, speed, serial_number: Some("C-1".into()), ..BenchOptions::default() };
        let bench = RunningBench::start(&options).expect("a simulated bench");
        let port = bench.port().to_owned();
        Self { bench, port, rate_baud: options.rate_baud, records }
    }

    /// The plug is put back.
    pub(crate) fn plug_in(&mut self) {
        self.port = self.bench.control().plug_in(Cable::Serial).expect("a port");
    }

    /// Carries out a request. The deed is done when the item has this share of its program.
    pub(crate) fn run(&self, request: &RunRequest, deed: Option<(&str, f64, Deed)>) -> Ended {
        self.ask(request, deed).expect("a run")
    }

    /// Why a request is refused.
    pub(crate) fn refused(&self, request: &RunRequest) -> String {
        match self.ask(request, None) {
            Ok(ended) => panic!("it was run: {}", ended.log()),
            Err(refused) => refused.to_string(),
        }
    }

    fn ask(&self, request: &RunRequest, deed: Option<(&str, f64, Deed)>) -> Result<Ended, ServiceError> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
        let file = BenchFile::read("bench.toml", hw_mocks::BENCH_FILE.into()).expect("the bench's file");
        let equipment = Equipment {
            station: "test".to_owned(),
            records: self.records.path().to_owned(),
            key: None,
            trusted_keys: Vec::new(),
            bench: BenchInfo::simulated("module", "100", 1),
            target: Target::Serial { port: self.port.clone(), rate_baud: self.rate_baud },
            can: None,
            abilities: BenchAbilities { rs422: true, can: false, operator: true },
            fixture: Fixture::Driven(Arc::new(self.bench.control())),
            site: file.site,
            serial_number: None,
            numbers: Vec::new(),
            plans: Default::default(),
            clock_is_right: false,
        };
        let (live, control) = (Live::default(), RunControl::default());
        let mut only = Only::default();
        runtime.block_on(async {
            let run = service::run(request, equipment, &control, &live, &mut only);
            tokio::pin!(run);
            if let Some((item, share, deed)) = deed {
                tokio::select! {
                    biased;
                    done = &mut run => panic!("the run ended before the deed: {done:?}"),
                    () = at(&live, item, share, deed) => done(deed, &control, &self.bench.control()),
                }
            }
            run.await
        })?;
        let folder = only.folder.expect("a round");
        let record = gnc_tests::read_json(&folder.join("run.json"));
        Ok(Ended {
            folder,
            outcome: record["outcome"].as_str().unwrap_or_default().to_owned(),
            _records: Arc::clone(&self.records),
        })
    }
}

fn done(deed: Deed, control: &RunControl, bench: &BenchControl) {
    match deed {
        Deed::Unplug => bench.unplug(Cable::Serial).expect("a bench"),
        Deed::Stop | Deed::StopInRound(_) => control.stop("the operator"),
    }
}

/// Returns when an item has this share of its program.
async fn at(live: &Live, item: &str, share: f64, deed: Deed) {
    let mut doing = live.doing.subscribe();
    let runs = doing.wait_for(|doing| doing.iter().any(|doing| doing.item == item)).await.expect("a run");
    if share == 0.0 {
        return;
    }
    let found = runs.iter().find(|doing| doing.item == item);
    let mut guidance = found.map(|doing| doing.guidance.clone()).expect("it runs");
    drop(runs);
    let part = |now: &Option<Arc<Guidance>>| now.as_ref().map(|now| (now.done_s + now.captured_s) / now.whole_s);
    let round = if let Deed::StopInRound(round) = deed { round } else { 1 };
    for _ in 1..round {
        let _ = guidance.wait_for(|now| part(now).is_some_and(|part| part > 0.9)).await;
        let _ = guidance.wait_for(|now| part(now).is_some_and(|part| part < 0.5)).await;
    }
    let _ = guidance.wait_for(|now| part(now).is_some_and(|part| part >= share)).await;
}

/// The only round.
#[derive(Default)]
struct Only {
    folder: Option<PathBuf>,
}

impl Observer for Only {
    fn begin(&mut self, folder: &RunFolder) -> std::io::Result<Watcher> {
        self.folder = Some(folder.path().to_owned());
        Ok(Box::new(|_| true))
    }

    async fn end(&mut self, _: &Path, ending: &Ending) {
        assert!(ending.store_error.is_none(), "{:?}", ending.store_error);
    }
}
