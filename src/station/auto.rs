//! `--auto PLAN`: a plan from the shell.
//!
//! The run goes on in this thread; what people or programs read is written by another ([`face`]), so that a stopped
//! terminal never stops a test.

mod face;

use std::io::{self, IsTerminal as _};
use std::process::ExitCode;
use std::sync::mpsc;
use std::time::Instant;

use chrono::Local;
use gnc_bench::control::Control;
use gnc_bench::fixture::{Fixture, Operator};
use gnc_bench::journal::Journal;
use gnc_bench::runner::{self, Ending, Live, Order};
use gnc_executive::event::{EVENTS_SCHEMA, Loop, PlanInfo, Program, RunHeader};
use gnc_executive::job::Job;
use gnc_executive::outcome::Outcome;
use gnc_executive::plan::{OnFail, Plan};
use gnc_records::resume::Resumed;
use gnc_records::store::{RunFolder, Scribe, StationKey, Watcher, digest, seal_interrupted};
use gnc_text::with_causes;

use crate::args::{OnFailArg, RunArgs};
use crate::refusal::{Refusal, complain, refuse};
use crate::setup::{self, Setup};
use crate::{files, records, serial_number};
use face::Face;

/// Events that may wait for a terminal that does not take them: more than any plan yields in a day.
const UNREAD_EVENTS: usize = 1 << 16;

/// Runs the plan as often as asked. The worst outcome decides the exit code.
pub(crate) fn run(args: &RunArgs) -> ExitCode {
    match prepare(args) {
        Err(refusal) => refuse(refusal.what, &refusal.try_this),
        Ok((plan, setup, serial_number)) => {
            let runtime = match tokio::runtime::Builder::new_current_thread().enable_all().build() {
                Ok(runtime) => runtime,
                Err(error) => return refuse(format_args!("cannot start: {error}"), ""),
            };
            let outcome = runtime.block_on(all_rounds(args, &plan, setup, &serial_number));
            // The thread that reads answers may wait for a line for ever.
            runtime.shutdown_background();
            match outcome {
                Ok(outcome) => ExitCode::from(outcome.exit_code()),
                Err(refusal) => refuse(refusal.what, &refusal.try_this),
            }
        }
    }
}

fn prepare(args: &RunArgs) -> Result<(Plan, Setup, String), Refusal> {
    let serial_number = serial_number(args.serial_number.as_deref())?;
    let path = args.auto.as_deref().unwrap_or_else(|| std::path::Path::new(""));
    let mut plan = files::plan(path)?;
    match args.on_fail {
        Some(OnFailArg::Stop) => plan.on_fail = OnFail::Stop,
        Some(OnFailArg::Continue) => plan.on_fail = OnFail::Continue,
        None => {}
    }
    let setup = setup::from_args(args, &serial_number, at_the_terminal)?;
    Ok((plan, setup, serial_number))
}

fn serial_number(given: Option<&str>) -> Result<String, Refusal> {
    let Some(given) = given else {
        return Err(Refusal::new("no serial number is given", "scan it after --serial-number"));
    };
    serial_number::check(given).map_err(|error| Refusal::new(error, "scan the module's label again"))
}

/// Whoever sits at the terminal; nobody where there is none.
fn at_the_terminal() -> Result<Fixture, Refusal> {
    if !io::stdin().is_terminal() {
        return Ok(Fixture::Absent);
    }
    let operator = Operator::at_the_terminal();
    operator.map(Fixture::Operator).map_err(|error| Refusal::new(format!("cannot read from the terminal: {error}"), ""))
}

async fn all_rounds(args: &RunArgs, plan: &Plan, setup: Setup, serial_number: &str) -> Result<Outcome, Refusal> {
    let control =
        Control::from_signals().map_err(|error| Refusal::new(format!("cannot watch for ctrl-C: {error}"), ""))?;
    let job =
        Job::new(plan.clone(), setup.abilities, args.only.as_deref()).map_err(|mistakes| Refusal::new(mistakes, ""))?;
    let mut header = header(args, plan, &setup, serial_number);
    let resumed = args.resume.as_deref().map(|run| taken_up(run, &setup.records, &header)).transpose()?;
    header.resumed = resumed.as_ref().map(Resumed::earlier);
    let mut order = Order {
        job,
        header,
        target: setup.target,
        can: setup.can,
        fixture: setup.fixture,
        site: setup.site,
        resumed,
        one_by_one: args.one_by_one,
        nonce: None,
        found: seal_interrupted(&setup.records, setup.key.as_ref()),
    };
    // The simulated bench ends with this scope.
    let _simulation = setup.simulation;
    let began = Instant::now();
    let mut ends = Vec::new();
    for round in 1.. {
        let count = args.until.is_none().then_some(args.loops);
        let looped = args.until.is_some() || args.loops > 1;
        order.header.looped = looped.then_some(Loop { index: round, count });
        let ending = match one_round(args, &order, plan, (&setup.records, setup.key.as_ref()), &control).await {
            Ok(ending) => ending,
            Err(refusal) if ends.is_empty() => return Err(refusal),
            Err(refusal) => {
                complain(refusal.what, &refusal.try_this);
                ends.push(Outcome::Errored);
                break;
            }
        };
        let outcome = ending.outcome;
        ends.push(outcome);
        order.found.clear();
        let enough = match args.until {
            Some(time) => began.elapsed() >= time,
            None => round >= args.loops,
        };
        let bad = !outcome.is_good() && args.on_fail == Some(OnFailArg::Stop);
        if enough || bad || !ending.begun || control.asked().times > 0 {
            break;
        }
    }
    if ends.len() > 1 {
        face::say(args.events, &format!("{} rounds: {}", ends.len(), counts(&ends)));
    }
    Ok(Outcome::worst(ends).unwrap_or(Outcome::Errored))
}

/// "7 passed, 1 failed".
fn counts(ends: &[Outcome]) -> String {
    let count = |outcome: &Outcome| ends.iter().filter(|end| *end == outcome).count();
    let present = Outcome::ALL.iter().filter(|outcome| count(outcome) > 0);
    present.map(|outcome| format!("{} {outcome}", count(outcome))).collect::<Vec<_>>().join(", ")
}

/// The run that is taken up again, if it is like the one that is to begin.
fn taken_up(run: &std::path::Path, records: &std::path::Path, header: &RunHeader) -> Result<Resumed, Refusal> {
    let runs = records::resolve(records, run).map_err(|error| Refusal::new(with_causes(&error), error.try_this()))?;
    let [folder] = runs.as_slice() else {
        let shown = gnc_text::quoted(&run.to_string_lossy());
        let what = match runs.len() {
            0 => format!("there is no run {shown}"),
            more => format!("{shown} names {more} runs"),
        };
        return Err(Refusal::new(what, "name one by its folder; `gnc-station records list` shows them"));
    };
    Resumed::read(folder, header).map_err(|error| Refusal::new(with_causes(&error), error.try_this()))
}

async fn one_round(
    args: &RunArgs,
    order: &Order,
    plan: &Plan,
    (records, key): (&std::path::Path, Option<&StationKey>),
    control: &Control,
) -> Result<Ending, Refusal> {
    let store_refusal = |error: gnc_records::store::StoreError| Refusal::new(with_causes(&error), error.try_this());
    // Before power-on, so that no module is tested whose record cannot be kept.
    let folder = RunFolder::create(records, Local::now().fixed_offset(), &order.header.serial_number, &plan.name)
        .map_err(store_refusal)?
        .signed_with(key.cloned());
    let path = folder.path().to_owned();
    let (watcher, events) = mpsc::sync_channel(UNREAD_EVENTS);
    let live = Live::default();
    let face = Face::start(events, &live, args.events, path.clone())
        .map_err(|error| Refusal::new(format!("cannot start: {error}"), ""))?;
    let watcher: Watcher = Box::new(move |event| watcher.try_send(event.clone()).is_ok());
    let scribe = Scribe::start(folder, plan, vec![watcher]).map_err(store_refusal)?;
    let ending = runner::run(order, Journal::new(scribe), control, &live).await;
    face.join(control).await;
    if let Some(error) = &ending.store_error {
        complain(
            format_args!(
                "ERRORED: this run is no pass, since its record could not be written: {}; what there is lies in {}",
                with_causes(error),
                path.display()
            ),
            error.try_this(),
        );
    }
    Ok(ending)
}

/// Who tests what, where, with what.
pub(crate) fn header(args: &RunArgs, plan: &Plan, setup: &Setup, serial_number: &str) -> RunHeader {
    RunHeader {
        schema: EVENTS_SCHEMA.to_owned(),
        serial_number: serial_number.to_owned(),
        operator: args.operator.clone(),
        station: setup.station.clone(),
        program: Program { name: env!("CARGO_PKG_NAME").to_owned(), version: env!("CARGO_PKG_VERSION").to_owned() },
        bench: setup.bench.clone(),
        plan: PlanInfo {
            name: plan.name.clone(),
            version: plan.version.clone(),
            sha256: digest::of_plan(plan.files()),
        },
        site: setup.site.clone(),
        recomputed: None,
        resumed: None,
        selection: args.only.clone(),
        looped: None,
    }
}
