//! Runs a plan on the simulated bench, in this process.

use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{self, SyncSender};

use gnc_bench::control::RunControl;
use gnc_bench::fixture::Fixture;
use gnc_bench::runner::{Ending, Live};
use gnc_bench::service::{self, CheckedPlan, Equipment, Observer, Rounds, RunRequest, RunsDone, ServiceError};
use gnc_executive::bench::BenchFile;
use gnc_executive::event::{BenchInfo, Event, ProgramVersion};
use gnc_executive::job::BenchAbilities;
use gnc_executive::outcome::Outcome;
use gnc_executive::plan::Plan;
use gnc_executive::state::RunState;
use gnc_link::Target;
use gnc_records::store::{RunFolder, Watcher, reader, was_never_begun};
use hw_mocks::{BenchControl, BenchOptions, RunningBench};

/// Runs a plan once. `watch` sees every event and may ask for anything. Returns the run as it ended.
pub(crate) fn run_plan(
    plan: &str,
    options: &BenchOptions,
    watch: impl Fn(&Event, &RunControl) + Send + 'static,
) -> RunState {
    run_request(&request(plan), options, watch, |_| {})
}

/// Carries out a request for one run. `watch` sees every event and may ask for anything, `started` hears of the bench
/// before the run. Returns the run as it ended.
pub(crate) fn run_request(
    request: &RunRequest,
    options: &BenchOptions,
    watch: impl Fn(&Event, &RunControl) + Send + 'static,
    started: impl FnOnce(BenchControl),
) -> RunState {
    let (told, events) = mpsc::sync_channel(1000);
    let control = RunControl::default();
    let asks = control.clone();
    let observer = std::thread::spawn(move || {
        let mut state = RunState::new();
        for event in events {
            state.apply(&event).expect("in order");
            watch(&event, &asks);
        }
        state
    });
    let done = serve(request, options, &control, Told { events: Some(told) }, started);
    assert_eq!(done.expect("a run").verdicts.len(), 1);
    observer.join().expect("an observer")
}

/// A request for one run of a plan.
pub(crate) fn request(plan: &str) -> RunRequest {
    let plan = Plan::read("short.toml", plan.into(), &mut |_| Err("no includes".to_owned()));
    RunRequest {
        plan: plan.and_then(CheckedPlan::new).unwrap_or_else(|mistakes| panic!("{mistakes}")),
        serial_number: "SN".to_owned(),
        part: None,
        numbers: Vec::new(),
        operator: None,
        selection: None,
        answers: gnc_bench::questions::Answers::default(),
        program: ProgramVersion { name: "control".to_owned(), version: "0".to_owned(), build: None },
        on_fail: None,
        rounds: Rounds::Once,
        resume: None,
        one_by_one: false,
        nonce: None,
        began: None,
    }
}

/// Carries out a request on a simulated bench with a driven turntable, and leaves the module without
/// power. The records are thrown away. `started` hears of the bench before the run.
pub(crate) fn serve(
    request: &RunRequest,
    options: &BenchOptions,
    control: &RunControl,
    mut observer: impl Observer,
    started: impl FnOnce(BenchControl),
) -> Result<RunsDone, ServiceError> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    runtime.block_on(async {
        // The module that is scanned is the one in the socket.
        let serial_number = options.serial_number.clone().or_else(|| Some(request.serial_number.clone()));
        let options = &BenchOptions { serial_number, ..options.clone() };
        let bench = RunningBench::start(options).expect("a simulated bench");
        started(bench.control());
        let file = BenchFile::read("bench.toml", hw_mocks::BENCH_FILE.into()).expect("the bench's file");
        let records = tempfile::tempdir().expect("a folder");
        let equipment = Equipment {
            station: "test".to_owned(),
            records: records.path().to_owned(),
            key: None,
            trusted_keys: Vec::new(),
            bench: BenchInfo::simulated("good", "1", 1),
            target: Target::Serial { port: bench.port().to_owned(), rate_baud: options.rate_baud },
            can: None,
            abilities: BenchAbilities { rs422: true, can: false, operator: true },
            fixture: Fixture::Driven(Arc::new(bench.control())),
            site: file.site,
            serial_number: None,
            numbers: Vec::new(),
            plans: Default::default(),
            clock_is_right: false,
        };
        let done = service::run(request, equipment, control, &Live::default(), &mut observer).await;
        assert!(!bench.control().truth().expect("a bench").powered, "the module is left under power");
        for run in reader::paths(records.path()).unwrap_or_default() {
            assert!(!was_never_begun(&run), "a round that could not begin left {}", run.display());
        }
        done
    })
}

/// Passes on the events of the only round.
struct Told {
    events: Option<SyncSender<Event>>,
}

impl Observer for Told {
    fn begin(&mut self, _: &RunFolder) -> std::io::Result<Watcher> {
        let events = self.events.take().expect("one round");
        Ok(Box::new(move |event| events.try_send(event.clone()).is_ok()))
    }

    async fn end(&mut self, _: &Path, ending: &Ending) {
        assert!(ending.store_error.is_none());
    }
}

/// The outcome of each item.
pub(crate) fn outcomes(state: &RunState) -> Vec<Outcome> {
    state.rows().iter().map(|row| row.outcome).collect()
}
