//! The session behind the screen. It carries out the screen's commands, one run at a time, and never waits for the
//! screen.

mod archive;
mod files;
pub(in crate::tui) mod jpeg;
pub(in crate::tui) mod pictures;
mod prepare;
mod rounds;
mod scanner;
mod told;

use std::collections::VecDeque;
use std::future::pending;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use futures_util::future::{FutureExt as _, LocalBoxFuture};
use gnc_bench::control::RunControl;
use gnc_bench::fixture::OperatorQuestion;
use gnc_bench::runner::Live;
use gnc_executive::verdict::Verdict;
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::{mpsc, oneshot};

use super::update::{Effect, Msg};
use crate::args::RunArgs;
use crate::tui::model::Loaded;
use files::{Held, HeldPlan, Looked};
use rounds::{Finished, Handles};
use scanner::ScannerPort;
use told::{Counter, Told};

/// Largest number of questions that wait: one of each item that runs.
const QUESTIONS: usize = 8;
/// Largest number of results that wait from checks of bench and plan.
const LOOKS: usize = 8;

/// How often the shift is counted while nothing is tested.
const COUNT_EVERY: Duration = Duration::from_secs(60);

/// The signal of a terminal that hangs up.
const HANGUP: &str = "SIGHUP";

/// Signals that end the program.
#[derive(Debug)]
pub(crate) struct Signals {
    interrupt: Signal,
    terminate: Signal,
    hangup: Signal,
    heard: Arc<AtomicU32>,
}

impl Signals {
    /// Takes over the signals.
    pub(crate) fn new() -> std::io::Result<Self> {
        Ok(Self {
            interrupt: signal(SignalKind::interrupt())?,
            terminate: signal(SignalKind::terminate())?,
            hangup: signal(SignalKind::hangup())?,
            heard: Arc::default(),
        })
    }

    /// How many of them the session has heard. Copies share the number.
    pub(crate) fn heard(&self) -> Arc<AtomicU32> {
        Arc::clone(&self.heard)
    }

    /// Waits for the next signal and returns its name.
    pub(crate) async fn next(&mut self) -> &'static str {
        let by = tokio::select! {
            _ = self.interrupt.recv() => "SIGINT",
            _ = self.terminate.recv() => "SIGTERM",
            _ = self.hangup.recv() => HANGUP,
        };
        self.heard.fetch_add(1, Ordering::SeqCst);
        by
    }
}

/// What the session needs.
#[derive(Debug)]
pub(crate) struct ScreenSession {
    args: RunArgs,
    /// The chosen plan; `None` for that of the bench file.
    plan: Option<PathBuf>,
    screen: mpsc::Sender<Msg>,
    commands: mpsc::Receiver<Effect>,
    signals: Signals,
    live: Live,
    told: Told,
    /// The counters of the bench's shift.
    counter: Option<Counter>,
    /// Bench and plan as they were checked.
    held: Held,
    /// Number of the latest check of bench and plan. Results of earlier checks are dropped.
    look: u64,
    tell_look: mpsc::Sender<(u64, Looked)>,
    looks: mpsc::Receiver<(u64, Looked)>,
    scanner: ScannerPort,
}

/// What goes on at the board: a run, or a look at raw values.
struct Running {
    done: LocalBoxFuture<'static, Finished>,
    control: RunControl,
}

impl ScreenSession {
    /// A session that has read nothing yet.
    pub(crate) fn new(
        (args, plan): (RunArgs, Option<PathBuf>),
        screen: mpsc::Sender<Msg>,
        commands: mpsc::Receiver<Effect>,
        signals: Signals,
        live: Live,
    ) -> Self {
        let (tell_look, looks) = mpsc::channel(LOOKS);
        let told = Told::new(screen.clone());
        Self {
            args,
            plan,
            screen,
            commands,
            signals,
            live,
            told,
            counter: None,
            held: Held::default(),
            look: 0,
            tell_look,
            looks,
            scanner: ScannerPort::none(),
        }
    }

    /// Who else learns of verdicts.
    pub(crate) fn told(&self) -> Told {
        self.told.clone()
    }

    /// Serves the screen until the operator leaves. Returns the verdict of a run that the end of the program stopped, and
    /// the signals, so that none is lost that comes afterwards.
    pub(crate) async fn serve(mut self) -> (Option<Verdict>, Signals) {
        let verdict = self.serve_to_end().await;
        (verdict, self.signals)
    }

    async fn serve_to_end(&mut self) -> Option<Verdict> {
        let (ask, mut questions) = mpsc::channel::<OperatorQuestion>(QUESTIONS);
        let mut waiting: VecDeque<OperatorQuestion> = VecDeque::new();
        let mut running: Option<Running> = None;
        let mut ending = false;
        let mut terminal_is_there = true;
        // The operator leaves as soon as the run has stopped; then its verdict.
        let (mut leaving, mut left) = (false, None);
        self.choose(None);
        // A shift may end while nothing is tested.
        let mut minute = tokio::time::interval(COUNT_EVERY);
        loop {
            if ending && running.is_none() {
                return left;
            }
            tokio::select! {
                biased;
                by = self.signals.next() => {
                    ending = true;
                    let _ = self.screen.try_send(Msg::EndAsked);
                    match by {
                        HANGUP => stop_in_order(running.as_ref(), by),
                        _ => stop(running.as_ref(), by),
                    }
                }
                finished = run_of(&mut running) => {
                    running = None;
                    waiting.clear();
                    if ending {
                        return finished.verdict();
                    }
                    left = finished.verdict().filter(|_| leaving);
                    self.tell(finished.into_msg());
                }
                () = self.told.next_end() => self.count_shift(),
                _ = minute.tick() => self.count_shift(),
                Some((look, looked)) = self.looks.recv() => {
                    if look == self.look {
                        self.take(looked);
                    }
                }
                scanned = self.scanner.next() => self.tell(scanned),
                Some(question) = questions.recv() => {
                    waiting.push_back(question);
                    if waiting.len() == 1 {
                        self.show_question(&waiting);
                    }
                }
                () = given_up(&mut waiting) => {
                    waiting.pop_front();
                    self.tell(Msg::AskedNoMore);
                    self.show_question(&waiting);
                }
                command = self.commands.recv(), if terminal_is_there => match command {
                    None => {
                        (ending, terminal_is_there) = (true, false);
                        stop_in_order(running.as_ref(), "the end of the terminal");
                    }
                    Some(Effect::Leave) => {
                        ending = true;
                        stop_in_order(running.as_ref(), "the operator");
                    }
                    Some(Effect::Answer(reply)) => {
                        if let Some(question) = waiting.pop_front() {
                            let _ = question.answer.send(reply);
                        }
                        self.show_question(&waiting);
                    }
                    Some(Effect::Stop) => stop(running.as_ref(), "the operator"),
                    Some(Effect::StopAndLeave) => {
                        leaving = true;
                        stop_in_order(running.as_ref(), "the operator");
                    }
                    Some(Effect::Pause(pause)) => {
                        running.iter().for_each(|running| running.control.pause(pause));
                    }
                    Some(Effect::AbortItem(item)) => {
                        running.iter().for_each(|running| running.control.give_up(&item));
                    }
                    Some(Effect::Start(start)) if running.is_none() => {
                        let handles = self.handles(&ask);
                        let control = handles.control.clone();
                        let done = rounds::run(self.held.clone(), start, self.args.one_by_one, handles).boxed_local();
                        running = Some(Running { done, control });
                    }
                    Some(Effect::Watch) if running.is_none() => {
                        let handles = self.handles(&ask);
                        let control = handles.control.clone();
                        let done = rounds::watch(self.held.clone(), handles).boxed_local();
                        running = Some(Running { done, control });
                    }
                    Some(command) => self.other(command),
                },
            }
        }
    }

    fn handles(&self, ask: &mpsc::Sender<OperatorQuestion>) -> Handles {
        Handles {
            control: RunControl::default(),
            screen: self.screen.clone(),
            live: self.live.clone(),
            questions: ask.clone(),
            told: self.told.clone(),
        }
    }

    /// Carries out a command that needs no run.
    fn other(&mut self, command: Effect) {
        match command {
            Effect::LookUp(serial_number) => {
                let (held, records) = (self.held.clone(), self.records());
                let number = serial_number.clone();
                let look =
                    prepare::Look { held: held.clone(), records: records.clone(), serial_number, selection: None };
                self.aside(move || look.broke_off());
                self.aside_if(move || {
                    let standing = archive::standing(&held, &records, &number);
                    standing.map(|standing| Msg::Standing { serial_number: number, standing })
                });
            }
            Effect::Prepare { serial_number, selection, resume } => {
                let look = prepare::Look { held: self.held.clone(), records: self.records(), serial_number, selection };
                self.aside(move || Msg::Prepared(Box::new(look.prepare(resume))));
            }
            Effect::Choose { plan, bench } => self.choose(Some((plan, bench))),
            Effect::Look { plan, bench } => {
                let mut args = self.args.clone();
                files::set_bench(&mut args, &bench);
                self.aside(move || Msg::LookedAt(Box::new(files::look_for_form(&args, plan, bench))));
            }
            Effect::ListChoices => {
                let held = self.held.plan.as_ref().map(|held| held.path.clone());
                let plan = held.or_else(|| self.plan.clone()).unwrap_or_default();
                self.aside(move || Msg::Choices(files::choices(&plan)));
            }
            Effect::ListDays => {
                let records = self.records();
                self.aside(move || Msg::Days(archive::days(&records)));
            }
            Effect::ListRuns(day) => {
                let records = self.records();
                self.aside(move || Msg::Runs(archive::runs(&records, day)));
            }
            Effect::Draw(wanted) => self.aside(move || {
                let made = pictures::make(&wanted);
                Msg::Drawn { wanted, made }
            }),
            Effect::OpenRun(path) => self.aside(move || Msg::Opened(archive::open(path))),
            Effect::Verify(path) => self.aside(move || archive::verify(path)),
            Effect::Refold(path) => self.aside(move || archive::refold(path)),
            // The command belongs to a run, and no run is on.
            _ => {}
        }
    }

    fn choose(&mut self, chosen: Option<(String, String)>) {
        if let Some((plan, bench)) = chosen {
            self.plan = Some(plan.into());
            files::set_bench(&mut self.args, &bench);
        }
        // Drop the old bench and plan, so that they cannot be started any more.
        (self.held, self.look) = (Held::default(), self.look + 1);
        let (args, plan, look, looks) = (self.args.clone(), self.plan.clone(), self.look, self.tell_look.clone());
        tokio::task::spawn_blocking(move || {
            files::look(&args, plan.as_deref(), |looked| {
                // Ignore the error: the session has ended.
                let _ = looks.blocking_send((look, looked));
            });
        });
    }

    /// Holds what was read, and shows it.
    fn take(&mut self, looked: Looked) {
        let msg = match looked {
            Looked::Bench { path, bench: Ok(looked) } => {
                let (checked, view) = *looked;
                let bench = Loaded::Ready(view);
                self.scanner.set(checked.scanner.as_ref());
                self.told.take(&checked);
                self.counter = Some(Counter::of(&checked));
                self.count_shift();
                self.held.bench = Some(Arc::new(checked));
                Msg::Bench { path, bench }
            }
            Looked::Bench { path, bench: Err(refusal) } => {
                Msg::Bench { path, bench: Loaded::Refused(files::lines(&refusal)) }
            }
            Looked::Plan { path, plan: Ok(checked) } => {
                let (held, view): (HeldPlan, _) = *checked;
                self.held.plan = Some(Arc::new(held));
                let (held, records) = (self.held.clone(), self.records());
                self.aside(move || prepare::newest_that_broke_off(&held, &records));
                Msg::Plan { path, plan: Loaded::Ready(view) }
            }
            Looked::Plan { path, plan: Err(refusal) } => {
                Msg::Plan { path, plan: Loaded::Refused(files::lines(&refusal)) }
            }
            Looked::Expected(expected_s) => Msg::Expected(expected_s),
        };
        self.tell(msg);
    }

    fn count_shift(&self) {
        if let Some(counter) = self.counter.clone() {
            self.aside(move || Msg::Shift(Box::new(counter.count())));
        }
    }

    /// The records folder of the bench on the screen; without a bench, the folder as far as it is known.
    fn records(&self) -> PathBuf {
        self.held.bench.as_ref().map_or_else(|| files::records(&self.args), |bench| bench.records.clone())
    }

    /// Works on files on another thread, beside the run.
    fn aside(&self, work: impl FnOnce() -> Msg + Send + 'static) {
        self.aside_if(|| Some(work()));
    }

    /// The same for work that may have nothing to say.
    fn aside_if(&self, work: impl FnOnce() -> Option<Msg> + Send + 'static) {
        let screen = self.screen.clone();
        tokio::task::spawn_blocking(move || work().map(|msg| screen.blocking_send(msg)));
    }

    /// Sends a message to the screen without waiting, since the screen may be far behind.
    fn tell(&self, msg: Msg) {
        let screen = self.screen.clone();
        tokio::spawn(async move { screen.send(msg).await });
    }

    fn show_question(&self, waiting: &VecDeque<OperatorQuestion>) {
        if let Some(question) = waiting.front() {
            self.tell(Msg::Asked { item: question.item.clone(), ask: question.ask.clone() });
        }
    }
}

fn stop(running: Option<&Running>, by: &'static str) {
    if let Some(running) = running {
        running.control.stop(by);
    }
}

fn stop_in_order(running: Option<&Running>, by: &'static str) {
    if let Some(running) = running {
        running.control.stop_in_order(by);
    }
}

async fn run_of(running: &mut Option<Running>) -> Finished {
    match running {
        Some(running) => (&mut running.done).await,
        None => pending().await,
    }
}

/// Returns when the item no longer waits for the answer to the first question.
async fn given_up(waiting: &mut VecDeque<OperatorQuestion>) {
    match waiting.front_mut() {
        Some(OperatorQuestion { answer, .. }) => oneshot::Sender::closed(answer).await,
        None => pending().await,
    }
}
