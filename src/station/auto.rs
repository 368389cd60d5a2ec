//! `--auto PLAN`: a plan from the shell.
//!
//! The run goes on in this thread. Another thread ([`face`]) writes the output for people and programs, so that a
//! stopped terminal never stops a test.

mod face;
mod junit;
mod speaker;

use std::io::{self, IsTerminal as _};
use std::path::Path;
use std::process::ExitCode;
use std::sync::{Arc, mpsc};

use gnc_bench::control::RunControl;
use gnc_bench::fixture::{Fixture, Operator};
use gnc_bench::questions::{Answers, Person};
use gnc_bench::runner::{Ending, Live};
use gnc_bench::service::{self, Observer, Rounds, RunRequest, ServiceError};
use gnc_executive::event::BenchKind;
use gnc_executive::outcome::Outcome;
use gnc_executive::plan::OnFail;
use gnc_executive::verdict::Verdict;
use gnc_records::store::{RunFolder, Watcher, as_written};
use gnc_text::{printable, with_causes};

use crate::args::RunArgs;
use crate::hook::Hooks;
use crate::lost::not_kept;
use crate::phrases::in_language;
use crate::progress::Progress;
use crate::refusal::{CommandRefusal, complain, refuse};
use crate::serial_number::SerialNumberError;
use crate::setup::{self, BenchHabits, Setup};
use crate::tui::framing;
use crate::version::program;
use crate::{ending, exit_code, files, records, serial_number, threads, umask};
use face::Face;
pub(crate) use junit::JunitFile;
use speaker::Speaker;

/// Largest number of events that wait for a blocked terminal: more than any plan yields in a day.
const UNREAD_EVENTS: usize = 1 << 16;

/// What to do after a stop left rounds undone.
const STOPPED_TRY: &str = "start the command again for the rounds that are left";

/// Runs the plan as often as asked. The worst outcome decides the exit code.
pub(crate) fn run(args: &RunArgs) -> ExitCode {
    let mut junit = match args.junit.as_deref().map(JunitFile::begin).transpose() {
        Ok(junit) => junit,
        Err(refusal) => return refuse(refusal.what, &refusal.try_this),
    };
    let verdict = carry_out(args, junit.as_mut());
    if let (Some(junit), Err(refusal)) = (&mut junit, &verdict) {
        junit.refused(&refusal.what, &refusal.try_this);
    }
    let unwritten = junit.and_then(|junit| junit.end().err());
    if let Some(refusal) = &unwritten {
        complain(format_args!("ERRORED: {}", refusal.what), &refusal.try_this);
    }
    match verdict {
        // A report that is missing is as bad as a missing record: who reads it would see the run before.
        Ok(verdict) if unwritten.is_some() => exit_code::of(verdict.at_least(Outcome::Errored), args.strictness()),
        Ok(verdict) => exit_code::of(verdict, args.strictness()),
        Err(refusal) => refuse(refusal.what, &refusal.try_this),
    }
}

fn carry_out(args: &RunArgs, junit: Option<&mut JunitFile>) -> Result<Verdict, CommandRefusal> {
    if let Some((what, try_this)) = umask::doubt() {
        complain(what, try_this);
    }
    // First of all: a simulated bench takes one of these threads.
    let runtime = threads::runtime()?;
    let (request, setup, habits) = prepare(args)?;
    let verdict = runtime.block_on(all_rounds(args, &request, setup, &habits, junit));
    // The thread that reads answers may wait for a line for ever.
    runtime.shutdown_background();
    verdict
}

/// Returns what the command line asks for, and the bench for it.
pub(crate) fn prepare(args: &RunArgs) -> Result<(RunRequest, Setup, BenchHabits), CommandRefusal> {
    let Some(scan) = args.serial_number.as_deref() else {
        return Err(CommandRefusal::new("no serial number is given", "scan it after --serial-number"));
    };
    let whole = framing::given(scan).map_err(|error| in_words(&error));
    let field = framing::field_given(scan);
    // Only bench and plan can tell whether one of several fields is meant.
    let whole = if field.is_none() { Ok(whole?) } else { whole };
    let path = args.auto.as_deref().unwrap_or_else(|| Path::new(""));
    let plan = files::plan(path, args.reach())?;
    let bench = setup::check(args)?;
    let patterns = || [&bench.serial_number, &plan.plan().serial_number].into_iter().flatten();
    let is_asked_for = |number: &String| serial_number::is_asked_for(number, patterns());
    let serial_number = match field.filter(is_asked_for) {
        Some(field) if !whole.as_ref().is_ok_and(is_asked_for) => field,
        _ => whole?,
    };
    if let Err(error) = serial_number::check_signs(&serial_number, patterns())
        && !records::is_resumed(args, &serial_number)
    {
        return Err(in_words(&error));
    }
    let operator = bench.habits.operator(args.operator.as_deref())?;
    let answers =
        Answers::given(&args.answers, plan.plan()).map_err(|wrong| CommandRefusal::new(wrong.what, &wrong.hint))?;
    let open = answers.lack(plan.plan(), args.only.as_deref());
    if !open.is_empty() && !io::stdin().is_terminal() {
        // An hour of a calibration would go before the first of them is asked.
        let what = format!("the plan asks questions, and no person is there to answer them: {}", open.join(", "));
        let hint = "answer each with --answer NAME=VALUE, or run the plan on a terminal or on the screen";
        return Err(CommandRefusal::new(what, hint));
    }
    // A simulated bench does all by itself but for answering.
    let simulated = bench.bench.kind == BenchKind::Simulated;
    let answers = match simulated && !open.is_empty() {
        true => answers.with(Person::Terminal(Arc::new(terminal()?))),
        false => answers,
    };
    let setup = bench.open(&serial_number, at_the_terminal)?;
    let resume = args.resume.as_deref().map(|run| records::to_resume(&setup.equipment.records, run)).transpose()?;
    if let Some(run) = &resume {
        records::tell_size(run);
    }
    let rounds = match args.until {
        Some(time) => Rounds::For(time),
        None if args.loops > 1 => Rounds::Count(args.loops),
        None => Rounds::Once,
    };
    let request = RunRequest {
        plan,
        serial_number,
        part: args.part()?,
        numbers: args.numbers.clone(),
        operator,
        selection: args.only.clone(),
        answers,
        program: program(),
        on_fail: args.on_fail.map(OnFail::from),
        rounds,
        resume,
        one_by_one: args.one_by_one,
        nonce: None,
        began: None,
    };
    Ok((request, setup, bench.habits))
}

fn in_words(error: &SerialNumberError) -> CommandRefusal {
    CommandRefusal::new(error, error.try_this())
}

/// The operator at the terminal.
fn terminal() -> Result<Operator, CommandRefusal> {
    let operator = Operator::at_the_terminal();
    operator.map_err(|error| CommandRefusal::new(format!("cannot read from the terminal: {error}"), ""))
}

/// Returns the operator at the terminal as the fixture, or an absent fixture without a terminal.
fn at_the_terminal() -> Result<Fixture, CommandRefusal> {
    if !io::stdin().is_terminal() {
        return Ok(Fixture::Absent);
    }
    terminal().map(Fixture::Operator)
}

/// Carries out what was prepared. Returns the worst verdict.
pub(crate) async fn all_rounds(
    args: &RunArgs,
    request: &RunRequest,
    setup: Setup,
    habits: &BenchHabits,
    junit: Option<&mut JunitFile>,
) -> Result<Verdict, CommandRefusal> {
    let cannot = |error: io::Error| CommandRefusal::new(format!("cannot watch for ctrl-C: {error}"), "");
    let control = RunControl::from_signals().map_err(cannot)?;
    let asked = control.clone();
    ending::at_second_signal(move || asked.asked().times >= 2, ending::say_that_it_closes, || {}).map_err(cannot)?;
    // The simulated bench ends with this scope.
    let Setup { equipment, simulation: _simulation } = setup;
    let live = Live::default();
    let complain_of_hook = |what: String| complain(what, "try the program by hand; docs/bench.md shows what it reads");
    let hooks = habits.hook.clone().map(|hook| Hooks::start(hook, complain_of_hook));
    let hooks =
        hooks.transpose().map_err(|error| CommandRefusal::new(format!("cannot start the hook: {error}"), ""))?;
    let speaker = Speaker::new(args.events, request.plan.plan(), &request.serial_number);
    let mut shown = Shown {
        start: Some(Progress::begin("records of earlier runs are looked at")),
        speaker: &speaker,
        bell: habits.bell,
        serial_number: &request.serial_number,
        control: &control,
        live: &live,
        hooks,
        face: None,
        junit,
    };
    let (records, bench) = (equipment.records.clone(), equipment.bench.kind);
    let trusted_keys = equipment.trusted_keys.clone();
    let done = service::run(request, equipment, &control, &live, &mut shown).await;
    // No line of it comes behind a refusal.
    drop(shown.start.take());
    let done = match done {
        // Command line, plan and bench are in order; it is this module that cannot be judged now.
        Err(error @ ServiceError::Requires { .. }) => {
            complain(with_causes(&error), &error.try_this());
            if let Some(junit) = shown.junit {
                junit.refused(&with_causes(&error), &error.try_this());
            }
            return Ok(Verdict::new(Outcome::Errored, request.selection.is_some()));
        }
        done => done.map_err(|error| refusal(&error))?,
    };
    if let Some(hooks) = shown.hooks.take() {
        let asked_again = async {
            let _ = control.asked_times(2).await;
        };
        hooks.finish(asked_again).await;
    }
    if let Some(refused) = &done.refused {
        complain(with_causes(refused), &refused.try_this());
        if let Some(junit) = &mut shown.junit {
            junit.refused(&with_causes(refused), &refused.try_this());
        }
    }
    if let Some(stopped) = &done.stopped {
        complain(stopped, STOPPED_TRY);
        if let Some(junit) = shown.junit {
            junit.refused(&stopped.to_string(), STOPPED_TRY);
        }
    }
    if done.verdicts.len() > 1 {
        speaker.say(&format!("{} rounds: {}", done.verdicts.len(), counts(&done.verdicts)));
    }
    let serial_number = printable(&request.serial_number);
    if !records.exists() {
        // A folder that is not there holds no run, also not the one that was just carried out.
        let why = format!("the records folder {} is gone", gnc_text::shown_path(&records));
        complain(
            format_args!("the standing of {serial_number} is not known: {why}"),
            "bring the records folder back to its place, or mount its disk again",
        );
        return Ok(done.verdict());
    }
    match setup::standing(&records, &request.serial_number, &request.plan, bench, &trusted_keys) {
        Ok(standing) => {
            speaker.say_as_it_is(&format!("{serial_number}: {}", in_language(&standing.to_string(), speaker.lang())));
        }
        Err(error) => complain(
            format_args!("the standing of {serial_number} is not known: {}", with_causes(&error)),
            error.try_this(),
        ),
    }
    Ok(done.verdict())
}

/// "7 passed, 1 failed".
fn counts(ends: &[Verdict]) -> String {
    let each = Verdict::counts(ends).into_iter().map(|(verdict, count)| format!("{count} {verdict}"));
    each.collect::<Vec<_>>().join(", ")
}

/// The refusal of a request that the service does not carry out.
fn refusal(error: &ServiceError) -> CommandRefusal {
    CommandRefusal::new(with_causes(error), &error.try_this())
}

/// Shows each round, on a thread of its own.
struct Shown<'a> {
    /// Tells what takes time before the first round begins.
    start: Option<Progress>,
    speaker: &'a Speaker,
    /// Whether the terminal rings at verdicts and questions.
    bell: bool,
    serial_number: &'a str,
    control: &'a RunControl,
    live: &'a Live,
    hooks: Option<Hooks>,
    face: Option<Face>,
    junit: Option<&'a mut JunitFile>,
}

impl Observer for Shown<'_> {
    fn begin(&mut self, folder: &RunFolder) -> io::Result<Watcher> {
        drop(self.start.take());
        let (watcher, events) = mpsc::sync_channel(UNREAD_EVENTS);
        self.face = Some(Face::start(events, self.live, self.speaker.clone(), self.bell, folder.clone())?);
        Ok(Box::new(move |event| watcher.try_send(event.clone()).is_ok()))
    }

    async fn end(&mut self, folder: &Path, ending: &Ending) {
        if let Some(face) = self.face.take() {
            face.join(self.control).await;
        }
        if let Some(junit) = &mut self.junit {
            junit.add(folder, ending);
        }
        if let Some(error) = &ending.store_error {
            let what = not_kept(folder, ending.begun, error).unwrap_or_else(|| {
                format!(
                    "ERRORED: this run is not a pass, because its record could not be written: {}; the incomplete record is in {}",
                    with_causes(error),
                    gnc_text::shown_path(folder)
                )
            });
            complain(what, error.try_this());
        }
        if let Some((what, hint)) = as_written::of_strangers(folder) {
            complain(what, hint);
        }
        if let Some(hooks) = &self.hooks
            && let Err(why) = hooks.tell(folder, self.serial_number, ending.verdict)
        {
            complain(why, "");
        }
    }
}
