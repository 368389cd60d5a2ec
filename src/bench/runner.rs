//! The runner follows a plan on a bench and emits what happens. It alone acts. Items that share no resource run at
//! once.

mod attempt;
mod breaches;
mod connection;
mod error_records;

mod limits;

pub mod looking;
mod recovery;

mod standstill;
mod verdict;

use std::cell::{Cell, OnceCell, RefCell};
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use futures_util::future::{FutureExt as _, LocalBoxFuture};
use futures_util::stream::{FuturesUnordered, StreamExt as _};
use gnc_board::{Advance, BoardClient, BoardError, BoardLease, Readings};
use gnc_executive::bench::BenchSite;
use gnc_executive::event::{AttemptError, BenchKind, EventKind, NoteLevel, RunHeader, StopHow};
use gnc_executive::job::{BoardAbilities, Job, Next};
use gnc_executive::outcome::{Cause, Outcome};
use gnc_executive::plan::PlanItem;
use gnc_executive::state::RunState;
use gnc_executive::verdict::Verdict;
use gnc_link::Target;
use gnc_link::can::CanTarget;
use gnc_protocol::message::ErrorRecord;
use gnc_protocol::stream::StreamId;
use gnc_records::resume::Resumed;
use gnc_records::store::StoreError;
use gnc_text::with_causes;
use tokio::sync::watch;
use tokio::time::{Instant, timeout};

use crate::control::{Asked, RunControl};
use crate::fixture::Fixture;
use crate::guidance::Guidance;
use crate::journal::RunJournal;
use crate::procedure::{Heat, ModuleSeen, ProcedureError};
use crate::questions::Answers;
use crate::turntable;
use connection::{ConnectError, connect};
use recovery::{session_lives, spoilt};
use verdict::{judge, other_temperature};

/// Items that run at once. A board takes four requests at once. One of them is left for a second request of an item, or
/// for reading error records.
const AT_ONCE: usize = 3;

/// Longest wait for the heartbeat after a failed attempt.
const HEARTBEAT_WITHIN: Duration = Duration::from_millis(1250);

/// An order for a run.
#[derive(Debug)]
pub(crate) struct RunOrder {
    /// The plan on this bench.
    pub job: Job,
    /// Who tests what, where, with what.
    pub header: RunHeader,
    /// The way to the slave board.
    pub target: Target,
    /// The bench's CAN bus, if it has one.
    pub can: Option<CanTarget>,
    /// Turns the module and flips switches.
    pub fixture: Fixture,
    /// Who answers the questions of the plan.
    pub answers: Answers,
    /// Where the bench stands.
    pub site: Option<BenchSite>,
    /// The earlier run that is taken up again.
    pub resumed: Option<Resumed>,
    /// Runs one item after the other, even if they could run at once.
    pub one_by_one: bool,
    /// The number of the first session with the board; the next ones count on from there, so that a run repeats. Random
    /// if not given.
    pub nonce: Option<u32>,
    /// What was found in the records folder before the run began, for its log.
    pub found: Vec<String>,
}

/// What people watch while a run is under way; some of it may be skipped.
#[derive(Debug, Clone, Default)]
pub struct Live {
    /// The items that run.
    pub doing: watch::Sender<Vec<Doing>>,
    /// The newest raw values.
    pub readings: watch::Sender<Readings>,
    /// The session with the board is lost, and the runner asks for the board again.
    pub line_lost: watch::Sender<bool>,
}

/// An item that runs.
#[derive(Debug, Clone)]
pub struct Doing {
    /// Its name in the plan.
    pub item: String,
    /// Attempt, from 1.
    pub attempt: u32,
    /// When it began.
    pub began: Instant,
    /// How far it is.
    pub advance: watch::Receiver<Advance>,
    /// The way through its captures, if it captures.
    pub guidance: watch::Receiver<Option<Arc<Guidance>>>,
}

/// How a run ended.
#[derive(Debug)]
pub struct Ending {
    /// Its verdict; errored if the record could not be written, whatever the items said.
    pub verdict: Verdict,
    /// Why the record could not be written.
    pub store_error: Option<StoreError>,
    /// Whether any item of the scanned module was begun: without a board, the next round would not be better.
    pub begun: bool,
}

/// Carries out an order.
pub(crate) async fn run(order: &RunOrder, journal: RunJournal, control: &RunControl, live: &Live) -> Ending {
    let run = Run {
        order,
        journal: &journal,
        on_board: OnceCell::new(),
        board_can: Cell::new(None),
        by_part: OnceCell::new(),
        is_other_part: Cell::new(false),
        control,
        live,
        sessions: Cell::new(0),
        records_read: Cell::new(0),
        unfiled: RefCell::new(Vec::new()),
        link_lost: Cell::new(false),
        one_by_one: Cell::new(order.one_by_one),
        unexplained_restart: Cell::new(false),
        cannot_be_powered: Cell::new(false),
        records_refused: Cell::new(false),
        busy: RefCell::new(HashMap::new()),
        paused_since: Cell::new(None),
        module: ModuleSeen::asked(&order.header.serial_number, order.header.part.as_ref()),
        heat: Heat::new(order.job.plan().resume),
    };
    live.line_lost.send_replace(false);
    let ended = run.whole().await;
    live.doing.send_replace(Vec::new());
    // Another round would find the same other module.
    let begun =
        journal.look(|state| state.other_module().is_none() && state.rows().iter().any(|row| !row.attempts.is_empty()));
    let closed = journal.close().await;
    // If both fail, the error of the writing thread is the cause.
    match closed.and(ended) {
        Ok(verdict) => Ending { verdict, store_error: None, begun },
        Err(error) => {
            let verdict = Verdict::new(Outcome::Errored, order.job.selection().is_some());
            Ending { verdict, store_error: Some(error), begun }
        }
    }
}

struct Run<'a> {
    order: &'a RunOrder,
    journal: &'a RunJournal,
    /// The job on the board that answered first.
    on_board: OnceCell<Job>,
    /// What that board can do.
    board_can: Cell<Option<BoardAbilities>>,
    /// That job by the limits for the module's part number, if the plan has such.
    by_part: OnceCell<Job>,
    /// Whether the module is not the part that was asked for.
    is_other_part: Cell<bool>,
    control: &'a RunControl,
    live: &'a Live,
    /// Number of sessions that were begun with the board.
    sessions: Cell<u32>,
    /// Error records of the board's session that were read already.
    records_read: Cell<u16>,
    /// Error records of items that still run.
    unfiled: RefCell<Vec<ErrorRecord>>,
    link_lost: Cell<bool>,
    /// Set by the order, or as soon as it is unclear whose request restarts the board.
    one_by_one: Cell<bool>,
    /// The board restarted while several requests ran, and the cause was not found.
    unexplained_restart: Cell<bool>,
    /// The board could not switch the module on: its supply is shorted, or pulls the board down.
    cannot_be_powered: Cell<bool>,
    /// The board refused to tell its error records, and the record says so.
    records_refused: Cell<bool>,
    /// Board time of each item by its position, for the critical path.
    busy: RefCell<HashMap<usize, Duration>>,
    /// Time since which a pause keeps all items from running.
    paused_since: Cell<Option<Instant>>,
    module: ModuleSeen,
    /// What a resumed run owes the module.
    heat: Heat,
}

/// How an attempt ended.
enum End {
    Done(Result<(), ProcedureError>),
    Stopped(Asked),
    /// The operator gave this item up and wants the run to go on.
    GivenUp,
}

/// An attempt that has ended.
struct Landed {
    position: usize,
    attempt: u32,
    end: End,
    requests: Vec<u16>,
    /// The streams that it listened to, and the number of refused values before.
    streams: Vec<StreamId>,
    refusals: u64,
    busy: Duration,
    /// Whether some of its captures are taken over and others are new.
    mixed: bool,
    /// How long the station itself stood still meanwhile.
    stood: Option<Duration>,
}

type Flight<'a> = FuturesUnordered<LocalBoxFuture<'a, Landed>>;

impl Run<'_> {
    /// The plan on this bench, on the board as soon as it has answered, and by the limits for the module as soon as they are known.
    fn job(&self) -> &Job {
        self.by_part.get().or(self.on_board.get()).unwrap_or(&self.order.job)
    }

    async fn whole(&self) -> Result<Verdict, StoreError> {
        let header = Box::new(self.order.header.clone());
        self.journal.emit(EventKind::RunStarted { header, items: self.job().planned() }).await?;
        for found in &self.order.found {
            self.note(NoteLevel::Warning, found.clone(), None).await?;
        }
        let body = tokio::select! {
            biased;
            asked = self.control.asked_times(2) => Err(asked),
            body = self.body() => Ok(body),
        };
        match body {
            Ok(body) => body?,
            Err(asked) => self.end_at_once(asked).await?,
        }
        let mut verdict = self.journal.look(RunState::verdict_so_far);
        if self.unexplained_restart.get() {
            // Something in this module or this bench restarts the board now and then: that must not pass.
            let text = "the board restarted, and the station could not find the item that caused it, so the module cannot be judged; \
                        run the plan again with --one-by-one";
            self.note(NoteLevel::Error, text.into(), None).await?;
            verdict = verdict.at_least(Outcome::Errored);
        }
        if self.cannot_be_powered.get() && verdict.of_items() != Outcome::Aborted {
            // Items that were not run are no reason to doubt.
            verdict = Verdict::new(Outcome::Failed, self.order.job.selection().is_some());
        }
        if (self.is_other_module() || self.is_other_part.get()) && verdict.of_items() != Outcome::Aborted {
            verdict = Verdict::new(Outcome::Errored, self.order.job.selection().is_some());
        }
        // The digests cover complete files only.
        self.journal.raw_files_ended().await;
        self.journal.emit(EventKind::RunEnded(verdict)).await?;
        Ok(verdict)
    }

    /// Whether the module in the socket was seen not to be the one that was scanned.
    fn is_other_module(&self) -> bool {
        self.journal.look(|state| state.other_module().is_some())
    }

    /// Everything but the first and the last event. Teardown is always reached, even if the record fails.
    async fn body(&self) -> Result<(), StoreError> {
        let Some(board) = self.find_board().await? else { return Ok(()) };
        let worked = match self.begin(&board).await {
            Ok(true) => self.items(&board).await,
            Ok(false) => Ok(()),
            Err(error) => Err(error),
        };
        let safe = self.make_safe(board).await;
        worked.and(safe)
    }

    /// Whether the record says that the bench is real.
    fn is_real(&self) -> bool {
        self.order.header.bench.kind == BenchKind::Real
    }

    /// Returns the board; `None`: there is no board, or a stop was asked for.
    async fn find_board(&self) -> Result<Option<BoardClient>, StoreError> {
        let connected = tokio::select! {
            biased;
            asked = self.control.asked_times(1) => Err(asked),
            connected = connect(&self.order.target, self.is_real(), self.nonce(), &self.live.readings) => Ok(connected),
        };
        match connected {
            Ok(Ok(board)) => return Ok(Some(board)),
            Ok(Err(error)) => {
                if let ConnectError::Board(error) = &error
                    && let Some(breach) = error.breach()
                {
                    self.breached(&breach).await?;
                }
                self.note(NoteLevel::Error, format!("{}; {}", with_causes(&error), error.try_this()), None).await?;
            }
            Err(asked) => self.stop_in_order(asked).await?,
        }
        Ok(None)
    }

    /// Files who the board is and switches the module on. `false`: it could not, or a stop was asked for.
    async fn begin(&self, board: &BoardClient) -> Result<bool, StoreError> {
        self.found(board).await?;
        if let Err(lacks) = self.fit(board) {
            let text = format!("the module was not switched on: {lacks}; {}", lacks.try_this());
            self.note(NoteLevel::Error, text, None).await?;
            return Ok(false);
        }
        self.power_on(board, None).await
    }

    /// Starts the items that may start and files the attempts that have ended, until all are done.
    async fn items(&self, board: &BoardClient) -> Result<(), StoreError> {
        let mut flight = Flight::new();
        loop {
            let held = self.launch(board, &mut flight).await?;
            let landed = tokio::select! {
                biased;
                Some(landed) = flight.next() => landed,
                Some(absent) = board.absence(), if !flight.is_empty() => {
                    self.was_away(&absent).await?;
                    continue;
                }
                breach = board.breach(), if !flight.is_empty() => {
                    self.breached(&breach).await?;
                    continue;
                }
                () = self.control.resumed(), if held => continue,
                else => break,
            };
            self.land(board, landed, &mut flight).await?;
            if self.is_other_module() {
                self.end_open_items().await?;
                let text = "the module is not the one that was scanned, so the rest of the plan is not run";
                return self.note(NoteLevel::Error, text.into(), None).await;
            }
            if self.is_other_part.get() {
                self.end_open_items().await?;
                let text = "the module is not the part that was asked for, so the rest of the plan is not run";
                return self.note(NoteLevel::Error, text.into(), None).await;
            }
            if self.link_lost.get() {
                self.end_open_items().await?;
                let text = "the link is lost, so the rest of the plan is not run";
                return self.note(NoteLevel::Error, text.into(), None).await;
            }
        }
        self.critical_path().await
    }

    /// Starts the items that may start. `true`: a pause holds the next item back.
    async fn launch<'b>(&'b self, board: &'b BoardClient, flight: &mut Flight<'b>) -> Result<bool, StoreError> {
        loop {
            let asked = self.control.asked();
            if asked.times > 0 {
                self.stop_in_order(asked).await?;
            }
            let alone = self.one_by_one.get();
            let job = self.job();
            let next = self.journal.look(|state| if alone { job.next(state) } else { job.next_overlapping(state) });
            match next {
                Next::Run { .. } if flight.len() >= AT_ONCE => return Ok(false),
                Next::Run { .. } if self.control.is_paused() => {
                    self.paused(flight.is_empty()).await?;
                    return Ok(true);
                }
                Next::Run { item: position, attempt } => {
                    let Some(item) = job.item(position) else { return Ok(false) };
                    self.go_on().await?;
                    self.control.begin(&item.name);
                    self.journal.emit(EventKind::ItemStarted { item: item.name.clone(), attempt }).await?;
                    // Findings count if they ended by now; those that end before the attempt is first polled do not. A
                    // recomputation of the run follows the same rule.
                    let earlier = self.earlier();
                    flight.push(self.attempt(board, position, item, attempt, earlier).boxed_local());
                }
                Next::End { item, outcome } => self.end_item(item, outcome, None).await?,
                Next::Skip { item, cause } => self.end_item(item, Outcome::Skipped, Some(cause)).await?,
                Next::Wait | Next::Done { .. } => return Ok(false),
            }
        }
    }

    /// Files once that a pause keeps all items from running.
    async fn paused(&self, nothing_runs: bool) -> Result<(), StoreError> {
        if !nothing_runs || self.paused_since.get().is_some() {
            return Ok(());
        }
        self.paused_since.set(Some(Instant::now()));
        self.note(NoteLevel::Info, "paused: no further item begins until the operator continues the run".into(), None)
            .await
    }

    /// Files how long a pause was.
    async fn go_on(&self) -> Result<(), StoreError> {
        let Some(since) = self.paused_since.take() else { return Ok(()) };
        self.note(
            NoteLevel::Info,
            format!("the run continued after a pause of {:.1} s", since.elapsed().as_secs_f64()),
            None,
        )
        .await
    }

    async fn end_item(&self, position: usize, outcome: Outcome, cause: Option<Cause>) -> Result<(), StoreError> {
        let Some(item) = self.job().item(position) else { return Ok(()) };
        self.journal.emit(EventKind::ItemEnded { item: item.name.clone(), outcome, cause }).await
    }

    /// Files an attempt that has ended, and handles its error.
    async fn land<'b>(
        &'b self,
        board: &'b BoardClient,
        landed: Landed,
        flight: &mut Flight<'b>,
    ) -> Result<(), StoreError> {
        match landed.end {
            End::Done(Err(ProcedureError::Store(error))) => Err(error),
            End::Stopped(asked) => {
                self.stop_in_order(asked).await?;
                let text = format!("stopped by {}", asked.by);
                let error = AttemptError { text, hint: String::new(), again: false };
                self.end_attempt(&landed, Outcome::Aborted, Some(error)).await
            }
            End::GivenUp => {
                self.file_error_records(board, &landed).await?;
                let error = AttemptError { text: "given up by the operator".into(), hint: String::new(), again: false };
                self.end_attempt(&landed, Outcome::Aborted, Some(error)).await
            }
            End::Done(Err(ref trouble)) if !session_lives(trouble) => self.lost_session(board, landed, flight).await,
            End::Done(Err(ProcedureError::Board(ref error))) if error.is_crowded() && !flight.is_empty() => {
                // The line can carry each item alone, but not both at once.
                self.one_by_one.set(true);
                let name = self.job().item(landed.position).map(|item| item.name.as_str());
                let text =
                    "the item did not fit on the line beside the others: from here on the items run one at a time";
                self.note(NoteLevel::Info, text.into(), name).await?;
                let error = spoilt(Some(&error.to_string()));
                self.end_attempt(&landed, Outcome::Errored, Some(error)).await
            }
            End::Done(ref done) => {
                if let Err(error) = done {
                    self.file_other_module(error).await?;
                }
                if let Err(ProcedureError::OtherPart { .. }) = done {
                    self.is_other_part.set(true);
                }
                self.file_error_records(board, &landed).await?;
                let Some(item) = self.job().item(landed.position) else { return Ok(()) };
                let (mut outcome, mut error) = self.judged(&landed, item, done.as_ref().err());
                if outcome == Outcome::Failed
                    && let Some(doubt) = self.doubt(board, &landed).await
                {
                    (outcome, error) = self.judged(&landed, item, Some(&doubt.into()));
                }
                self.end_attempt(&landed, outcome, error).await
            }
        }
    }

    /// Files that another module than was scanned is in the socket, once: the run is then of neither.
    async fn file_other_module(&self, error: &ProcedureError) -> Result<(), StoreError> {
        let (ProcedureError::OtherModule(other) | ProcedureError::ModuleChanged { other: Some(other), .. }) = error
        else {
            return Ok(());
        };
        if self.journal.look(|state| state.other_module().is_some()) {
            return Ok(());
        }
        self.journal.emit(EventKind::OtherModule(other.clone())).await
    }

    /// Why a failed attempt says nothing of the module: it lost its power, or the times of its samples do not fit the
    /// board's clock, which the next heartbeat shows.
    async fn doubt(&self, board: &BoardClient, landed: &Landed) -> Option<BoardError> {
        let look = async {
            if self.lost_power(board).await {
                return Some(BoardError::PowerLost);
            }
            if !landed.streams.is_empty() {
                let _ = timeout(HEARTBEAT_WITHIN, board.board_time().changed()).await;
            }
            board.broken_stream(landed.refusals, &landed.streams)
        };
        tokio::select! {
            biased;
            // After a stop the module must be off soon.
            _ = self.control.asked_times(1) => board.broken_stream(landed.refusals, &landed.streams),
            doubt = look => doubt,
        }
    }

    /// Judges an attempt that has ended by what the journal has of it.
    fn judged(
        &self,
        landed: &Landed,
        item: &PlanItem,
        trouble: Option<&ProcedureError>,
    ) -> (Outcome, Option<AttemptError>) {
        self.journal.look(|state| {
            let attempt = state.rows().get(landed.position).and_then(|row| row.attempts.last());
            let measured = attempt.map_or(&[][..], |attempt| attempt.measurements.as_slice());
            let resumed = trouble.is_none().then(|| other_temperature(measured)).flatten().filter(|_| landed.mixed);
            judge(item, measured, trouble.or(resumed.as_ref()), landed.stood)
        })
    }

    async fn end_attempt(
        &self,
        landed: &Landed,
        outcome: Outcome,
        error: Option<AttemptError>,
    ) -> Result<(), StoreError> {
        let Some(item) = self.job().item(landed.position) else { return Ok(()) };
        self.busy.borrow_mut().insert(landed.position, landed.busy);
        let (item, attempt) = (item.name.clone(), landed.attempt);
        self.journal.emit(EventKind::AttemptEnded { item, attempt, outcome, error }).await
    }

    /// Files the least time that the table could take, by the board's own durations, beside the time that it took.
    async fn critical_path(&self) -> Result<(), StoreError> {
        if self.one_by_one.get() {
            return Ok(());
        }
        let path = {
            let busy = self.busy.borrow();
            self.job().critical_path(&|position| busy.get(&position).map(Duration::as_secs_f64))
        };
        let Some(path) = path else { return Ok(()) };
        let took_s = self.journal.look(|state| {
            let began = state.rows().iter().filter_map(|row| row.started).map(|stamp| stamp.elapsed_us).min();
            let ended = state.rows().iter().filter_map(|row| row.ended).map(|stamp| stamp.elapsed_us).max();
            began.zip(ended).map_or(0.0, |(began, ended)| ended.saturating_sub(began) as f64 * 1e-6)
        });
        let items = path.items.iter().filter_map(|position| self.job().item(*position)).map(|item| item.name.as_str());
        let text = format!(
            "critical path {:.2} s of board time ({}), the items took {took_s:.2} s",
            path.span_s,
            items.collect::<Vec<_>>().join(" > "),
        );
        self.note(NoteLevel::Info, text, None).await
    }

    /// A lease for requests of the runner itself.
    fn own_desk<'b>(&self, board: &'b BoardClient) -> BoardLease<'b> {
        BoardLease::new(board, watch::channel(Advance::default()).0)
    }

    async fn stop_in_order(&self, asked: Asked) -> Result<(), StoreError> {
        if self.journal.look(|state| state.stop().is_some()) {
            return Ok(());
        }
        self.journal.emit(EventKind::StopRequested { how: StopHow::InOrder, by: asked.by.into() }).await
    }

    async fn end_at_once(&self, asked: Asked) -> Result<(), StoreError> {
        turntable::stop_at_once(&self.order.fixture);
        self.journal.emit(EventKind::StopRequested { how: StopHow::AtOnce, by: asked.by.into() }).await?;
        self.end_open_items().await
    }

    /// Gives every item that was begun an end in the record.
    async fn end_open_items(&self) -> Result<(), StoreError> {
        let open: Vec<(String, u32, Option<Outcome>)> = self.journal.look(|state| {
            let begun = state.rows().iter().filter(|row| !row.is_over() && !row.attempts.is_empty());
            begun
                .map(|row| {
                    let last = row.attempts.last().and_then(|attempt| attempt.outcome);
                    (row.planned.name.clone(), row.attempts.len() as u32, last)
                })
                .collect()
        });
        for (item, attempt, last) in open {
            let outcome = match last {
                Some(outcome) => outcome,
                None => {
                    let error = AttemptError { text: "stopped at once".into(), hint: String::new(), again: false };
                    let (item, outcome) = (item.clone(), Outcome::Aborted);
                    self.journal.emit(EventKind::AttemptEnded { item, attempt, outcome, error: Some(error) }).await?;
                    Outcome::Aborted
                }
            };
            self.journal.emit(EventKind::ItemEnded { item, outcome, cause: None }).await?;
        }
        Ok(())
    }

    async fn note(&self, level: NoteLevel, text: String, item: Option<&str>) -> Result<(), StoreError> {
        self.journal.emit(EventKind::Note { level, text, item: item.map(str::to_owned) }).await
    }
}
