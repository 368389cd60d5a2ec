//! Runs a plan on the simulated bench, in this process.

use std::sync::{Arc, mpsc};

use chrono::Local;
use gnc_bench::control::Control;
use gnc_bench::fixture::Fixture;
use gnc_bench::journal::Journal;
use gnc_bench::runner::{self, Live, Order};
use gnc_executive::event::{Bench, EVENTS_SCHEMA, Event, PlanInfo, Program, RunHeader};
use gnc_executive::job::{BenchAbilities, Job};
use gnc_executive::outcome::Outcome;
use gnc_executive::plan::Plan;
use gnc_executive::state::RunState;
use gnc_link::Target;
use gnc_records::store::{RunFolder, Scribe, Watcher};
use hw_mocks::{Options, RunningBench};

/// Runs a plan on a simulated bench that has a turntable and no operator, and leaves the module without power. `watch` sees
/// every event and asks what it likes. Tells the run as it ended.
pub(crate) fn run_plan(plan: &str, options: &Options, watch: impl Fn(&Event, &Control) + Send + 'static) -> RunState {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    runtime.block_on(async {
        let bench = RunningBench::start(options).expect("a simulated bench");
        let records = tempfile::tempdir().expect("a folder");
        let plan = Plan::read("short.toml", plan.into(), &mut |_| Err("no includes".to_owned()));
        let plan = plan.unwrap_or_else(|mistakes| panic!("{mistakes}"));
        let abilities = BenchAbilities { rs422: true, can: false, operator: false };
        let order = Order {
            job: Job::new(plan.clone(), abilities, None).unwrap_or_else(|mistakes| panic!("{mistakes}")),
            header: header(),
            target: Target::Serial { port: bench.port().to_owned(), rate_baud: options.rate_baud },
            can: None,
            fixture: Fixture::Driven(Arc::new(bench.control())),
            site: None,
            resumed: None,
            one_by_one: false,
            nonce: None,
            found: Vec::new(),
        };
        let folder = RunFolder::create(records.path(), Local::now().fixed_offset(), "SN", "short").expect("a folder");
        let (watcher, events) = mpsc::sync_channel(1000);
        let watcher: Watcher = Box::new(move |event| watcher.try_send(event.clone()).is_ok());
        let scribe = Scribe::start(folder, &plan, vec![watcher]).expect("a store");
        let control = Control::default();
        let asks = control.clone();
        let observer = std::thread::spawn(move || {
            let mut state = RunState::new();
            for event in events {
                state.apply(&event).expect("in order");
                watch(&event, &asks);
            }
            state
        });
        let ending = runner::run(&order, Journal::new(scribe), &control, &Live::default()).await;
        assert!(ending.store_error.is_none());
        assert!(!bench.control().truth().expect("a bench").powered, "the module is left under power");
        observer.join().expect("an observer")
    })
}

fn header() -> RunHeader {
    RunHeader {
        schema: EVENTS_SCHEMA.to_owned(),
        serial_number: "SN".to_owned(),
        operator: None,
        station: "test".to_owned(),
        program: Program { name: "control".to_owned(), version: "0".to_owned() },
        bench: Bench::simulated("good", "1", 1),
        plan: PlanInfo { name: "short".to_owned(), version: "1".to_owned(), sha256: "0".repeat(64) },
        site: None,
        recomputed: None,
        resumed: None,
        selection: None,
        looped: None,
    }
}

/// The outcome of each item.
pub(crate) fn outcomes(state: &RunState) -> Vec<Outcome> {
    state.rows().iter().map(|row| row.outcome).collect()
}
