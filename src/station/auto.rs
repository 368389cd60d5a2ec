//! `--auto PLAN`: a plan from the shell.
//!
//! The run goes on in this thread. Another thread ([`face`]) writes the output for people and programs, so that a
//! stopped terminal never stops a test.

mod face;

use std::io::{self, IsTerminal as _};
use std::path::Path;
use std::process::ExitCode;
use std::sync::mpsc;

use gnc_bench::control::RunControl;
use gnc_bench::fixture::{Fixture, Operator};
use gnc_bench::runner::{Ending, Live};
use gnc_bench::service::{self, Observer, Rounds, RunRequest, ServiceError};
use gnc_executive::event::ProgramVersion;
use gnc_executive::outcome::Outcome;
use gnc_executive::plan::OnFail;
use gnc_records::store::Watcher;
use gnc_text::with_causes;

use crate::args::RunArgs;
use crate::refusal::{CommandRefusal, complain, refuse};
use crate::setup::{self, Setup};
use crate::{exit_code, files, records, serial_number};
use face::Face;

/// Largest number of events that wait for a blocked terminal: more than any plan yields in a day.
const UNREAD_EVENTS: usize = 1 << 16;

/// Runs the plan as often as asked. The worst outcome decides the exit code.
pub(crate) fn run(args: &RunArgs) -> ExitCode {
    match prepare(args) {
        Err(refusal) => refuse(refusal.what, &refusal.try_this),
        Ok((request, setup)) => {
            let runtime = match tokio::runtime::Builder::new_current_thread().enable_all().build() {
                Ok(runtime) => runtime,
                Err(error) => return refuse(format_args!("cannot start: {error}"), ""),
            };
            let outcome = runtime.block_on(all_rounds(args, &request, setup));
            // The thread that reads answers may wait for a line for ever.
            runtime.shutdown_background();
            match outcome {
                Ok(outcome) => exit_code::of(outcome),
                Err(refusal) => refuse(refusal.what, &refusal.try_this),
            }
        }
    }
}

/// Returns what the command line asks for, and the bench for it.
pub(crate) fn prepare(args: &RunArgs) -> Result<(RunRequest, Setup), CommandRefusal> {
    let serial_number = serial_number(args.serial_number.as_deref())?;
    let path = args.auto.as_deref().unwrap_or_else(|| Path::new(""));
    let plan = files::plan(path)?;
    let setup = setup::check(args)?.open(&serial_number, at_the_terminal)?;
    let resume = args.resume.as_deref();
    let rounds = match args.until {
        Some(time) => Rounds::For(time),
        None if args.loops > 1 => Rounds::Count(args.loops),
        None => Rounds::Once,
    };
    let request = RunRequest {
        plan,
        serial_number,
        operator: args.operator.clone(),
        selection: args.only.clone(),
        program: program(),
        on_fail: args.on_fail.map(OnFail::from),
        rounds,
        resume: resume.map(|run| records::to_resume(&setup.equipment.records, run)).transpose()?,
        one_by_one: args.one_by_one,
        nonce: None,
        began: None,
    };
    Ok((request, setup))
}

fn serial_number(given: Option<&str>) -> Result<String, CommandRefusal> {
    let Some(given) = given else {
        return Err(CommandRefusal::new("no serial number is given", "scan it after --serial-number"));
    };
    serial_number::check(given).map_err(|error| CommandRefusal::new(error, "scan the module's label again"))
}

/// Returns the operator at the terminal as the fixture, or an absent fixture without a terminal.
fn at_the_terminal() -> Result<Fixture, CommandRefusal> {
    if !io::stdin().is_terminal() {
        return Ok(Fixture::Absent);
    }
    let operator = Operator::at_the_terminal();
    operator
        .map(Fixture::Operator)
        .map_err(|error| CommandRefusal::new(format!("cannot read from the terminal: {error}"), ""))
}

/// Carries out what was prepared. Returns the worst outcome.
pub(crate) async fn all_rounds(args: &RunArgs, request: &RunRequest, setup: Setup) -> Result<Outcome, CommandRefusal> {
    let control = RunControl::from_signals()
        .map_err(|error| CommandRefusal::new(format!("cannot watch for ctrl-C: {error}"), ""))?;
    // The simulated bench ends with this scope.
    let Setup { equipment, simulation: _simulation } = setup;
    let live = Live::default();
    let mut shown = Shown { events_to_stdout: args.events, control: &control, live: &live, face: None };
    let done = service::run(request, equipment, &control, &live, &mut shown).await.map_err(|error| refusal(&error))?;
    if let Some(refused) = &done.refused {
        complain(with_causes(refused), refused.try_this());
    }
    if done.outcomes.len() > 1 {
        face::say(args.events, &format!("{} rounds: {}", done.outcomes.len(), counts(&done.outcomes)));
    }
    Ok(done.outcome())
}

/// "7 passed, 1 failed".
fn counts(ends: &[Outcome]) -> String {
    let count = |outcome: &Outcome| ends.iter().filter(|end| *end == outcome).count();
    let present = Outcome::ALL.iter().filter(|outcome| count(outcome) > 0);
    present.map(|outcome| format!("{} {outcome}", count(outcome))).collect::<Vec<_>>().join(", ")
}

/// The refusal of a request that the service does not carry out.
fn refusal(error: &ServiceError) -> CommandRefusal {
    CommandRefusal::new(with_causes(error), error.try_this())
}

/// Shows each round, on a thread of its own.
struct Shown<'a> {
    events_to_stdout: bool,
    control: &'a RunControl,
    live: &'a Live,
    face: Option<Face>,
}

impl Observer for Shown<'_> {
    fn begin(&mut self, folder: &Path) -> io::Result<Watcher> {
        let (watcher, events) = mpsc::sync_channel(UNREAD_EVENTS);
        self.face = Some(Face::start(events, self.live, self.events_to_stdout, folder.to_owned())?);
        Ok(Box::new(move |event| watcher.try_send(event.clone()).is_ok()))
    }

    async fn end(&mut self, folder: &Path, ending: &Ending) {
        if let Some(face) = self.face.take() {
            face.join(self.control).await;
        }
        if let Some(error) = &ending.store_error {
            complain(
                format_args!(
                    "ERRORED: this run is not a pass, because its record could not be written: {}; the incomplete record is in {}",
                    with_causes(error),
                    folder.display()
                ),
                error.try_this(),
            );
        }
    }
}

/// This program, as records name it.
pub(crate) fn program() -> ProgramVersion {
    ProgramVersion { name: env!("CARGO_PKG_NAME").to_owned(), version: env!("CARGO_PKG_VERSION").to_owned() }
}
