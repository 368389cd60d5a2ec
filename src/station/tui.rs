//! The operator's screen.
//!
//! Three threads: this one runs the tests on its own runtime, one draws, one reads keys. They exchange messages over
//! channels, so a blocked terminal delays drawing and typing, but never a test.

mod decode;
mod field;
mod fields;
pub(crate) mod framing;
mod graphics;
mod input;
mod keymap;
mod lang;
mod live;
mod look;
mod model;
mod numbers;
mod pending;
mod pictures;
mod prompt;
mod records;
mod scene;
mod session;
mod setup_form;
mod show;
mod terminal;
mod update;
mod view;

#[cfg(test)]
mod tests;

use std::io::{self, IsTerminal as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use gnc_bench::runner::Live;
use gnc_executive::verdict::Verdict;
use gnc_records::resume::ResumeError;
use gnc_records::store::reader;
use gnc_text::{printable, with_causes};
use tokio::sync::{mpsc, watch};

use crate::args::{OnFailArg, RunArgs};
use crate::phrases::in_language;
use crate::refusal::{CommandRefusal, complain, refuse};
use crate::serial_number::SerialNumberError;
use crate::{exit_code, files, serial_number, setup, threads, umask};
use model::{AfterFailure, Loaded, RoundsSetting, ScreenModel};
use session::{ScreenSession, Signals};
use show::{Inbox, ScreenClock};
use terminal::Guard;

pub use lang::Lang;
pub use scene::Scene;

/// Largest number of events and answers that wait for a blocked terminal: more than any plan yields in a day.
const MESSAGES: usize = 1 << 16;
/// Largest number of key batches that wait. When the queue is full, the thread that reads keys waits.
const KEYS: usize = 16;
/// Largest number of commands that wait: as many as an operator can press in a moment.
const COMMANDS: usize = 64;
/// Longest wait for the last drawing and for the return of the terminal. A blocked terminal never finishes either.
const GIVE_BACK_WITHIN: Duration = Duration::from_secs(1);

/// Opens the screen.
pub(crate) fn run(args: &RunArgs) -> ExitCode {
    let began = Instant::now();
    if !io::stdin().is_terminal() || !io::stdout().is_terminal() {
        return refuse("the screen needs a terminal", "run a plan without one: --auto PLAN --serial-number SN");
    }
    if std::env::var("TERM").is_ok_and(|term| term == "dumb") {
        let what = "this terminal says that it can move no cursor (TERM=dumb), and the screen needs that";
        return refuse(
            what,
            "open another terminal, set TERM to its real name, or run a plan without the screen: --auto PLAN --serial-number SN",
        );
    }
    match open(args, began) {
        Ok(verdict) => verdict.map_or(ExitCode::SUCCESS, |verdict| exit_code::of(verdict, args.strictness())),
        Err(refusal) => refuse(refusal.what, &refusal.try_this),
    }
}

/// The serial number of the command line, as a scan on the screen is read.
fn number_given(args: &RunArgs, given: &str) -> Result<String, SerialNumberError> {
    let number = framing::given(given)?;
    if serial_number::check_signs(&number, []).is_err() && !crate::records::is_resumed(args, &number) {
        // The screen tells what is wrong with bench and plan. A pattern that cannot be read names no other signs.
        let of_bench = setup::check(args).ok().and_then(|bench| bench.serial_number);
        let plan = args.plan.as_deref().and_then(|plan| files::plan(plan, args.reach()).ok());
        let of_plan = plan.and_then(|plan| plan.plan().serial_number.clone());
        serial_number::check_signs(&number, [&of_bench, &of_plan].into_iter().flatten())?;
    }
    Ok(number)
}

fn open(args: &RunArgs, began: Instant) -> Result<Option<Verdict>, CommandRefusal> {
    let cannot = |error: io::Error| CommandRefusal::new(format!("cannot start the screen: {error}"), "");
    let runtime = threads::runtime()?;
    // This one hears interrupts when the first one has ended.
    let ending = threads::beside().map_err(cannot)?;
    let signals = {
        let _inside = runtime.enter();
        Signals::new().map_err(cannot)?
    };
    let guard = Guard::new();
    let (heard, held) = (signals.heard(), guard.clone());
    // A line on standard error would stand in the middle of the screen, which says itself that the run is being stopped.
    crate::ending::at_second_signal(move || heard.load(Ordering::SeqCst) >= 2, || {}, move || held.give_back())
        .map_err(cannot)?;
    let clock = ScreenClock { began };
    let plan = args.plan.clone();
    let serial_number = args.serial_number.as_deref().map(|given| number_given(args, given)).transpose();
    let serial_number = serial_number.map_err(|error| CommandRefusal::new(&error, error.try_this()))?;
    let resume = args.resume.as_deref().map(|run| to_resume(args, run)).transpose()?;
    let model = first_model(args, plan.as_deref(), serial_number, resume, clock);

    let live = Live::default();
    let (screen, messages) = mpsc::channel(MESSAGES);
    let (keys_in, keys) = mpsc::channel(KEYS);
    let (commands_in, commands) = mpsc::channel(COMMANDS);
    let (resized_in, resized) = watch::channel(0);
    let inbox = Inbox {
        messages,
        keys,
        resized,
        doing: live.doing.subscribe(),
        readings: live.readings.subscribe(),
        line_lost: live.line_lost.subscribe(),
    };

    let (gone_in, gone) = std::sync::mpsc::channel();
    let drawing = Drawing { guard: guard.clone(), model, inbox, commands: commands_in, clock };
    spawn("screen", move || {
        let _ = gone_in.send(drawing.run());
    })?;
    spawn("keys", move || terminal::read_keys(&keys_in))?;

    let session = ScreenSession::new((args.clone(), plan), screen, commands, signals, live);
    let told = session.told();
    let (verdict, mut signals) = runtime.block_on(async {
        let resizes = tokio::spawn(terminal::watch_size(resized_in));
        let served = session.serve().await;
        resizes.abort();
        served
    });
    // What is still under way, as a read of records, is not waited for. As long as it could tell the screen something, the
    // drawing thread would not end.
    runtime.shutdown_background();
    // The session has ended, so the drawing thread ends by itself, unless its terminal is blocked.
    match gone.recv_timeout(GIVE_BACK_WITHIN) {
        Ok(Ok(())) => {}
        Ok(Err(error)) => complain(format_args!("the screen ended: {error}"), "check the terminal, and open it again"),
        Err(_) => drop(guard.give_back_modes()),
    }
    // The last verdicts are told while the terminal is the operator's again.
    ending.block_on(told.finish(async {
        // An interrupt from now on is meant for the hook.
        signals.next().await;
    }));
    Ok(verdict)
}

fn spawn(name: &str, work: impl FnOnce() + Send + 'static) -> Result<(), CommandRefusal> {
    let spawned = std::thread::Builder::new().name(name.into()).spawn(work);
    spawned.map(drop).map_err(|error| CommandRefusal::new(format!("cannot start the screen: {error}"), ""))
}

/// Returns the run to take up, and the serial number of its module.
fn to_resume(args: &RunArgs, run: &Path) -> Result<(PathBuf, String), CommandRefusal> {
    let folder = crate::records::to_resume(&setup::records_folder(args), run)?;
    match reader::read(&folder) {
        Ok(run) => Ok((folder, run.serial_number)),
        Err(error) => {
            let error = ResumeError::Unreadable(error);
            Err(CommandRefusal::new(with_causes(&error), error.try_this()))
        }
    }
}

fn first_model(
    args: &RunArgs,
    plan: Option<&Path>,
    serial_number: Option<String>,
    resume: Option<(PathBuf, String)>,
    clock: ScreenClock,
) -> ScreenModel {
    let (lang, look) = look::choose(&crate::locale::Environment::read(), args.lang);
    let mut model = ScreenModel::new(lang, look, clock.now());
    model.pictures.terminal = graphics::of_terminal(|name| std::env::var(name).ok());
    model.numbers = numbers::Numbers::new(args.numbers.clone(), serial_number.is_none() && resume.is_none());
    model.part = [&args.part, &args.revision].map(|text| text.clone().unwrap_or_default());
    model.operator = args.operator.clone().unwrap_or_default();
    model.plan_path = plan.map(|plan| plan.display().to_string()).unwrap_or_default();
    model.plan = Loaded::Loading;
    if args.loops > 1 {
        model.rounds = RoundsSetting::Count(args.loops);
    }
    if let Some(time) = args.until {
        let minutes = u32::try_from(time.as_secs() / 60).unwrap_or(u32::MAX);
        let whole =
            (1..=setup_form::MAX_ROUNDS).contains(&minutes) && time == Duration::from_secs(60 * u64::from(minutes));
        model.rounds = if whole { RoundsSetting::Minutes(minutes) } else { RoundsSetting::For(time) };
    }
    model.after_failure = match args.on_fail {
        Some(OnFailArg::Stop) => AfterFailure::Stop,
        Some(OnFailArg::Continue) => AfterFailure::GoOn,
        None => AfterFailure::AsPlanned,
    };
    model.only.clone_from(&args.only);
    model.scan.current = serial_number;
    if let Some((folder, of)) = resume {
        let run = folder.file_name().unwrap_or_default().to_string_lossy();
        model.resume_of.clone_from(&of);
        let number = model.scan.current.get_or_insert(of);
        let said = lang::fill(model.texts.resume_asked, &[&printable(number), &printable(&run)]);
        model.say(model::MessageWeight::Info, said);
        model.resume = Some(folder);
    }
    warn_of_umask(&mut model, umask::doubt());
    model
}

/// That other users may change records is a warning and not news. What the line of messages says already stays beside it.
fn warn_of_umask(model: &mut ScreenModel, doubt: Option<(String, &str)>) {
    let Some((what, try_this)) = doubt else { return };
    let warning = in_language(&format!("{what}; {try_this}"), model.lang).into_owned();
    let before = model.message.take().map(|(_, before)| format!(" {before}")).unwrap_or_default();
    model.say(model::MessageWeight::Warning, format!("{warning}{before}"));
}

/// The thread that draws.
struct Drawing {
    guard: Guard,
    model: ScreenModel,
    inbox: Inbox,
    commands: mpsc::Sender<update::Effect>,
    clock: ScreenClock,
}

impl Drawing {
    /// Draws until the operator leaves or the terminal is gone. Then the command channel closes, and the session ends.
    fn run(mut self) -> io::Result<()> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build()?;
        let shown = self.guard.take().and_then(|mut terminal| {
            let ours = || self.guard.is_taken();
            runtime.block_on(show::show(
                &mut terminal,
                &mut self.model,
                self.inbox,
                &self.commands,
                self.clock,
                ours,
                terminal::ring,
            ))
        });
        self.guard.give_back();
        shown.map(drop)
    }
}
