//! The only doer: it follows a plan on a bench, several items at once where they share nothing, and emits what
//! happens.

pub mod journal;
pub mod report;

use std::cell::{Cell, RefCell};
use std::collections::HashMap;
use std::time::{Duration, Instant};

use chrono::Utc;
use futures_util::future::{FutureExt as _, LocalBoxFuture};
use futures_util::stream::{FuturesUnordered, StreamExt as _};
use gnc_executive::event::{
    AttemptError, Board as BoardEvent, ErrorRecord as RecordEvent, EventKind, Level, Power, RunHeader, StopHow,
};
use gnc_executive::job::{Job, Next};
use gnc_executive::measurement::Measurement;
use gnc_executive::outcome::{Cause, Outcome};
use gnc_executive::plan::{Phase, PlanItem};
use gnc_executive::state::RunState;
use gnc_protocol::message::{ErrorKind, ErrorRecord, ErrorRecords, MakeSafe, ModulePower};
use gnc_protocol::{FaultCode, PROTOCOL_VERSION};
use tokio::sync::watch;
use tokio::time::timeout;

use crate::board::{Advance, Board, BoardError, Desk, Pulse};
use crate::fixture::Fixture;
use crate::link::can::CanTarget;
use crate::link::{Link, LinkError, Target};
use crate::procedure::{self, Bench, Trouble};
use crate::stop::{Asked, Stop};
use crate::store::StoreError;
use journal::Journal;
use report::Report;

pub use gnc_executive::bench::Site;

/// Longest wait for the board to make itself safe over a live link; a board that does not answer has its watchdog.
const SAFE_WITHIN: Duration = Duration::from_millis(250);
/// Error records read at the end of one attempt: as many as the board keeps.
const MAX_RECORDS: usize = 64;
/// Items that run at once. Of the four requests that a board takes at once one is left for a second request of one
/// item, or for reading error records.
const AT_ONCE: usize = 3;

/// A run that was ordered.
#[derive(Debug)]
pub struct Order {
    /// The plan on this bench.
    pub job: Job,
    /// Who tests what, where, with what.
    pub header: RunHeader,
    /// The way to the slave board.
    pub target: Target,
    /// The bench's CAN bus, if it has one.
    pub can: Option<CanTarget>,
    /// Whoever turns the module.
    pub fixture: Fixture,
    /// Where the bench stands.
    pub site: Option<Site>,
    /// One item after the other, also where they could run at once.
    pub one_by_one: bool,
}

/// What is being done, for people; some of it may be skipped.
pub type Live = watch::Sender<Vec<Doing>>;

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
}

/// How a run ended.
#[derive(Debug)]
pub struct Ending {
    /// Its outcome; errored if the record could not be written, whatever the items said.
    pub outcome: Outcome,
    /// Why the record could not be written.
    pub store_error: Option<StoreError>,
}

/// Carries out an order.
pub async fn run(order: &Order, journal: Journal, stop: &Stop, live: &Live) -> Ending {
    let run = Run {
        order,
        journal: &journal,
        stop,
        live,
        records_read: Cell::new(0),
        unfiled: RefCell::new(Vec::new()),
        link_lost: Cell::new(false),
        one_by_one: Cell::new(order.one_by_one),
        unexplained_restart: Cell::new(false),
        busy: RefCell::new(HashMap::new()),
    };
    let ended = run.whole().await;
    live.send_replace(Vec::new());
    let closed = journal.close().await;
    match ended.and_then(|outcome| closed.map(|()| outcome)) {
        Ok(outcome) => Ending { outcome, store_error: None },
        Err(error) => Ending { outcome: Outcome::Errored, store_error: Some(error) },
    }
}

struct Run<'a> {
    order: &'a Order,
    journal: &'a Journal,
    stop: &'a Stop,
    live: &'a Live,
    /// Error records of the board's session that were read already.
    records_read: Cell<u16>,
    /// Those of items that still run.
    unfiled: RefCell<Vec<ErrorRecord>>,
    link_lost: Cell<bool>,
    /// Set by the order, or once nobody knows whose request restarts the board.
    one_by_one: Cell<bool>,
    /// The board restarted while several requests ran, and no item was found to be the cause.
    unexplained_restart: Cell<bool>,
    /// Board time of each item by its position, for the critical path.
    busy: RefCell<HashMap<usize, Duration>>,
}

/// How an attempt came to its end.
enum End {
    Done(Result<(), Trouble>),
    Stopped(Asked),
}

/// An attempt that came to its end.
struct Landed {
    position: usize,
    attempt: u32,
    end: End,
    measured: Vec<Measurement>,
    requests: Vec<u16>,
    busy: Duration,
}

type Flight<'a> = FuturesUnordered<LocalBoxFuture<'a, Landed>>;

impl Run<'_> {
    async fn whole(&self) -> Result<Outcome, StoreError> {
        let header = Box::new(self.order.header.clone());
        self.journal.emit(EventKind::RunStarted { header, items: self.order.job.planned() }).await?;
        let body = tokio::select! {
            biased;
            asked = self.stop.asked_times(2) => Err(asked),
            body = self.body() => Ok(body),
        };
        match body {
            Ok(body) => body?,
            Err(asked) => self.end_at_once(asked).await?,
        }
        let mut outcome = self.journal.look(RunState::outcome_so_far);
        if self.unexplained_restart.get() {
            // Something in this module or this bench restarts the board now and then: nobody can call that a pass.
            outcome = Outcome::worst([outcome, Outcome::Errored]).unwrap_or(outcome);
        }
        self.journal.emit(EventKind::RunEnded { outcome }).await?;
        Ok(outcome)
    }

    /// Everything but the first and the last event. Teardown is always reached, also when the record fails.
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

    /// `None`: there is none, or nobody wants it any more.
    async fn find_board(&self) -> Result<Option<Board>, StoreError> {
        let connected = tokio::select! {
            biased;
            asked = self.stop.asked_times(1) => Err(asked),
            connected = connect(self.order) => Ok(connected),
        };
        match connected {
            Ok(Ok(board)) => return Ok(Some(board)),
            Ok(Err(error)) => {
                self.note(Level::Error, format!("{}; {}", chain(&error), error.try_this()), None).await?;
            }
            Err(asked) => self.stop_in_order(asked).await?,
        }
        Ok(None)
    }

    /// Says who the board is and switches the module on. `false`: it could not, or nobody wants it any more.
    async fn begin(&self, board: &Board) -> Result<bool, StoreError> {
        self.found(board).await?;
        self.power_on(board, None).await
    }

    /// Starts what may start, files what came to its end, until nothing is left.
    async fn items(&self, board: &Board) -> Result<(), StoreError> {
        let mut flight = Flight::new();
        loop {
            self.launch(board, &mut flight).await?;
            let Some(landed) = flight.next().await else { break };
            self.land(board, landed, &mut flight).await?;
            if self.link_lost.get() {
                self.end_open_items().await?;
                let text = "the link is lost, so the rest of the plan is not run";
                return self.note(Level::Error, text.into(), None).await;
            }
        }
        self.critical_path().await
    }

    async fn launch<'b>(&'b self, board: &'b Board, flight: &mut Flight<'b>) -> Result<(), StoreError> {
        loop {
            let alone = self.one_by_one.get();
            let job = &self.order.job;
            let next = self.journal.look(|state| if alone { job.next(state) } else { job.next_overlapping(state) });
            match next {
                Next::Run { .. } if flight.len() >= AT_ONCE => return Ok(()),
                Next::Run { item: position, attempt } => {
                    let Some(item) = job.item(position) else { return Ok(()) };
                    self.journal.emit(EventKind::ItemStarted { item: item.name.clone(), attempt }).await?;
                    flight.push(self.attempt(board, position, item, attempt).boxed_local());
                }
                Next::End { item, outcome } => self.end_item(item, outcome, None).await?,
                Next::Skip { item, cause } => self.end_item(item, Outcome::Skipped, Some(cause)).await?,
                Next::Wait | Next::Done { .. } => return Ok(()),
            }
        }
    }

    async fn end_item(&self, position: usize, outcome: Outcome, cause: Option<Cause>) -> Result<(), StoreError> {
        let Some(item) = self.order.job.item(position) else { return Ok(()) };
        self.journal.emit(EventKind::ItemEnded { item: item.name.clone(), outcome, cause }).await
    }

    async fn attempt(&self, board: &Board, position: usize, item: &PlanItem, attempt: u32) -> Landed {
        let (sender, advance) = watch::channel(Advance::default());
        let doing = Doing { item: item.name.clone(), attempt, began: Instant::now(), advance };
        self.live.send_modify(|live| live.push(doing));
        let desk = Desk::new(board, sender);
        let report = Report::new(self.journal, item, attempt, &self.order.header.serial_number);
        // After a stop only teardown items run, and those may be ended by a second one alone.
        let may_stop = item.phase != Phase::Teardown;
        let end = tokio::select! {
            biased;
            asked = self.stop.asked_times(1), if may_stop => End::Stopped(asked),
            done = self.procedure(&desk, board, item, attempt, &report) => End::Done(done),
        };
        if let End::Done(Err(trouble)) = &end
            && session_lives(trouble)
        {
            desk.clear().await;
        }
        self.live.send_modify(|live| live.retain(|doing| doing.item != item.name));
        let (requests, busy) = (desk.requests(), desk.busy());
        Landed { position, attempt, end, measured: report.into_measured(), requests, busy }
    }

    async fn procedure(
        &self,
        desk: &Desk<'_>,
        board: &Board,
        item: &PlanItem,
        attempt: u32,
        report: &Report<'_>,
    ) -> Result<(), Trouble> {
        let bench = Bench {
            board: desk,
            fixture: &self.order.fixture,
            site: self.order.site.as_ref(),
            can: self.order.can.as_ref(),
        };
        if let (Some(prompt), 1) = (&item.prompt, attempt) {
            bench.fixture.prompt(prompt, report).await?;
        }
        for repeat in 1..=item.repeats {
            report.begin_repeat(repeat);
            tokio::select! {
                biased;
                done = procedure::run(item.id, &bench, &item.params, report) => done?,
                () = board_time(board.pulse(), item.timeout_s) => {
                    return Err(Trouble::TookTooLong { limit_s: item.timeout_s });
                }
            }
        }
        Ok(())
    }

    /// Files an attempt that came to its end, and deals with its trouble.
    async fn land<'b>(&'b self, board: &'b Board, landed: Landed, flight: &mut Flight<'b>) -> Result<(), StoreError> {
        match landed.end {
            End::Done(Err(Trouble::Store(error))) => Err(error),
            End::Stopped(asked) => {
                self.stop_in_order(asked).await?;
                let text = format!("stopped by {}", asked.by);
                let error = AttemptError { text, hint: String::new(), again: false };
                self.end_attempt(&landed, Outcome::Aborted, Some(error)).await
            }
            End::Done(Err(ref trouble)) if !session_lives(trouble) => self.lost_session(board, landed, flight).await,
            End::Done(ref done) => {
                self.file_error_records(board, &landed).await?;
                let Some(item) = self.order.job.item(landed.position) else { return Ok(()) };
                let (outcome, error) = judge(item, &landed.measured, done.as_ref().err());
                self.end_attempt(&landed, outcome, error).await
            }
        }
    }

    /// The session is gone, and with it the work of all items in flight. Whose fault was it? The item whose request
    /// was in flight when the board restarted; the others run again. If that is not one alone, all run again, one
    /// by one, so that the culprit shows.
    async fn lost_session<'b>(
        &'b self,
        board: &'b Board,
        first: Landed,
        flight: &mut Flight<'b>,
    ) -> Result<(), StoreError> {
        let mut ended = vec![first];
        while let Some(Some(landed)) = flight.next().now_or_never() {
            ended.push(landed);
        }
        flight.clear();
        self.live.send_replace(Vec::new());
        let restarted = |landed: &Landed, only_asked: bool| matches!(&landed.end, End::Done(Err(Trouble::Board(BoardError::Restarted { asked, .. }))) if *asked || !only_asked);
        let any_restart = ended.iter().any(|landed| restarted(landed, false));
        let suspects: Vec<usize> = match ended.iter().filter(|landed| restarted(landed, true)).count() {
            0 => ended.iter().filter(|landed| restarted(landed, false)).map(|landed| landed.position).collect(),
            _ => ended.iter().filter(|landed| restarted(landed, true)).map(|landed| landed.position).collect(),
        };
        let culprit = match (any_restart, suspects.as_slice()) {
            (true, [one]) => Some(*one),
            (true, _) => None,
            // Without a restart the first to notice speaks for the line.
            (false, _) => ended.first().map(|landed| landed.position),
        };
        if any_restart {
            self.unexplained_restart.set(culprit.is_none());
            self.one_by_one.set(self.one_by_one.get() || culprit.is_none());
        }
        let text = ended.first().map(|landed| match &landed.end {
            End::Done(Err(trouble)) => chain(trouble),
            _ => String::new(),
        });
        for landed in &ended {
            let Some(item) = self.order.job.item(landed.position) else { continue };
            match &landed.end {
                End::Done(Err(trouble)) if Some(landed.position) == culprit => {
                    let (outcome, error) = judge(item, &landed.measured, Some(trouble));
                    self.end_attempt(landed, outcome, error).await?;
                }
                End::Stopped(asked) => {
                    self.stop_in_order(*asked).await?;
                    self.end_attempt(landed, Outcome::Aborted, None).await?;
                }
                _ => self.end_attempt(landed, Outcome::Errored, Some(spoilt(text.as_deref()))).await?,
            }
        }
        self.end_spoilt_items(text.as_deref()).await?;
        let name = culprit.and_then(|position| self.order.job.item(position)).map(|item| item.name.clone());
        self.recover(board, name.filter(|_| any_restart)).await
    }

    async fn end_attempt(
        &self,
        landed: &Landed,
        outcome: Outcome,
        error: Option<AttemptError>,
    ) -> Result<(), StoreError> {
        let Some(item) = self.order.job.item(landed.position) else { return Ok(()) };
        self.busy.borrow_mut().insert(landed.position, landed.busy);
        let (item, attempt) = (item.name.clone(), landed.attempt);
        self.journal.emit(EventKind::AttemptEnded { item, attempt, outcome, error }).await
    }

    /// Attempts that were in flight and had not noticed yet.
    async fn end_spoilt_items(&self, text: Option<&str>) -> Result<(), StoreError> {
        let running: Vec<(String, u32)> = self.journal.look(|state| {
            let rows = state.rows().iter().filter(|row| row.running().is_some());
            rows.map(|row| (row.planned.name.clone(), row.attempts.len() as u32)).collect()
        });
        for (item, attempt) in running {
            let error = Some(spoilt(text));
            self.journal.emit(EventKind::AttemptEnded { item, attempt, outcome: Outcome::Errored, error }).await?;
        }
        Ok(())
    }

    /// After a lost session nobody knows what the board still does: a new one makes it safe and starts clean.
    async fn recover(&self, board: &Board, culprit: Option<String>) -> Result<(), StoreError> {
        let before = board.hello().boot_id;
        let reopened = tokio::select! {
            biased;
            asked = self.stop.asked_times(1), if self.stop.asked().times == 0 => Err(asked),
            reopened = board.reopen(nonce()) => Ok(reopened),
        };
        self.records_read.set(0);
        self.unfiled.borrow_mut().clear();
        match reopened {
            Err(asked) => self.stop_in_order(asked).await,
            Ok(Err(error)) => {
                self.link_lost.set(true);
                self.note(Level::Error, format!("{}; {}", chain(&error), error.try_this()), None).await
            }
            Ok(Ok(boot_id)) => {
                if boot_id != before {
                    let (item, boot_id) = (culprit.clone(), format!("{boot_id:08x}"));
                    self.journal.emit(EventKind::BoardRebooted { item, boot_id }).await?;
                }
                let on = self.power_on(board, culprit.as_deref()).await?;
                self.link_lost.set(!on && self.stop.asked().times == 0);
                Ok(())
            }
        }
    }

    /// What the table would take at least, by the board's own durations, beside what it took.
    async fn critical_path(&self) -> Result<(), StoreError> {
        if self.one_by_one.get() {
            return Ok(());
        }
        let path = {
            let busy = self.busy.borrow();
            self.order.job.critical_path(&|position| busy.get(&position).map(Duration::as_secs_f64))
        };
        let Some(path) = path else { return Ok(()) };
        let took_s = self.journal.look(|state| {
            let began = state.rows().iter().filter_map(|row| row.started).map(|stamp| stamp.elapsed_us).min();
            let ended = state.rows().iter().filter_map(|row| row.ended).map(|stamp| stamp.elapsed_us).max();
            began.zip(ended).map_or(0.0, |(began, ended)| ended.saturating_sub(began) as f64 * 1e-6)
        });
        let items =
            path.items.iter().filter_map(|position| self.order.job.item(*position)).map(|item| item.name.as_str());
        let text = format!(
            "critical path {:.2} s of board time ({}), the items took {took_s:.2} s",
            path.span_s,
            items.collect::<Vec<_>>().join(" > "),
        );
        self.note(Level::Info, text, None).await
    }

    async fn found(&self, board: &Board) -> Result<(), StoreError> {
        let hello = board.hello();
        let link = self.order.target.to_string();
        self.journal
            .emit(EventKind::BoardFound(BoardEvent {
                board_serial: hello.serial.as_str().to_owned(),
                firmware: hello.firmware.as_str().to_owned(),
                protocol: u16::from(PROTOCOL_VERSION),
                boot_id: format!("{:08x}", hello.boot_id),
                link,
            }))
            .await
    }

    async fn power_on(&self, board: &Board, item: Option<&str>) -> Result<bool, StoreError> {
        let desk = self.own_desk(board);
        let switched = tokio::select! {
            biased;
            asked = self.stop.asked_times(1), if self.stop.asked().times == 0 => Err(asked),
            switched = desk.call(&ModulePower { on: 1 }) => Ok(switched),
        };
        match switched {
            Err(asked) => {
                self.stop_in_order(asked).await?;
                Ok(false)
            }
            Ok(Ok(supply)) => {
                let power = Power {
                    on: true,
                    supply: "slave board".into(),
                    voltage_v: Some(f64::from(supply.supply_uv) * 1e-6),
                    current_a: Some(f64::from(supply.supply_ua) * 1e-6),
                };
                self.journal.emit(EventKind::Power(power)).await?;
                Ok(true)
            }
            Ok(Err(error)) => {
                let text = format!("the module cannot be switched on: {}; {}", chain(&error), error.try_this());
                self.note(Level::Error, text, item).await?;
                Ok(false)
            }
        }
    }

    /// Module off, streams stopped, lines released.
    async fn make_safe(&self, board: Board) -> Result<(), StoreError> {
        let safe = if self.link_lost.get() {
            Ok(Err(BoardError::Gone { reason: "the link was lost".into() }))
        } else {
            timeout(SAFE_WITHIN, self.own_desk(&board).call(&MakeSafe {})).await
        };
        let report = timeout(SAFE_WITHIN, board.close()).await.unwrap_or_default();
        match safe {
            Ok(Ok(())) => {
                let power = Power { on: false, supply: "slave board".into(), voltage_v: None, current_a: None };
                self.journal.emit(EventKind::Power(power)).await?;
            }
            Ok(Err(_)) | Err(_) => {
                let text = "the board did not confirm that it is safe; its watchdog makes it so within 2 s";
                self.note(Level::Warning, text.into(), None).await?;
            }
        }
        let received = report.received;
        let damaged = received.bad_checksum + received.malformed;
        if damaged + received.missing + report.resent > 0 {
            let text = format!(
                "the line was not clean: {} frames received, {damaged} damaged, {} missing, {} requests sent again",
                received.frames, received.missing, report.resent
            );
            self.note(Level::Warning, text, None).await?;
        }
        Ok(())
    }

    /// Files what the board found wrong during an attempt. That it cannot be read is worth a line, not a verdict.
    async fn file_error_records(&self, board: &Board, landed: &Landed) -> Result<(), StoreError> {
        let Some(item) = self.order.job.item(landed.position) else { return Ok(()) };
        for _ in 0..MAX_RECORDS {
            let reply = match self.own_desk(board).call(&ErrorRecords { from: self.records_read.get() }).await {
                Ok(reply) => reply,
                Err(error) => {
                    let text = format!("the board's error records cannot be read: {}", chain(&error));
                    self.note(Level::Warning, text, Some(&item.name)).await?;
                    break;
                }
            };
            if let Some(last) = reply.records.last() {
                self.records_read.set(last.index.wrapping_add(1));
            }
            let done = reply.records.is_empty() || self.records_read.get() >= reply.total;
            self.unfiled.borrow_mut().extend(reply.records);
            if done {
                break;
            }
        }
        let mine: Vec<ErrorRecord> =
            self.unfiled.borrow_mut().extract_if(.., |record| landed.requests.contains(&record.request)).collect();
        for record in &mine {
            let (item, attempt, record) = (item.name.clone(), landed.attempt, for_people(record));
            self.journal.emit(EventKind::ErrorRecord { item, attempt, record }).await?;
        }
        Ok(())
    }

    /// For what the runner itself asks of the board.
    fn own_desk<'b>(&self, board: &'b Board) -> Desk<'b> {
        Desk::new(board, watch::channel(Advance::default()).0)
    }

    async fn stop_in_order(&self, asked: Asked) -> Result<(), StoreError> {
        if self.journal.look(|state| state.stop().is_some()) {
            return Ok(());
        }
        self.journal.emit(EventKind::StopRequested { how: StopHow::InOrder, by: asked.by.into() }).await
    }

    async fn end_at_once(&self, asked: Asked) -> Result<(), StoreError> {
        self.journal.emit(EventKind::StopRequested { how: StopHow::AtOnce, by: asked.by.into() }).await?;
        self.end_open_items().await
    }

    /// Every item that was begun comes to an end in the record.
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

    async fn note(&self, level: Level, text: String, item: Option<&str>) -> Result<(), StoreError> {
        self.journal.emit(EventKind::Note { level, text, item: item.map(str::to_owned) }).await
    }
}

/// Why there is no board to work with.
#[derive(Debug, thiserror::Error)]
enum ConnectError {
    #[error(transparent)]
    Open(#[from] LinkError),
    #[error(transparent)]
    Board(#[from] BoardError),
}

impl ConnectError {
    fn try_this(&self) -> &'static str {
        match self {
            Self::Open(error) => error.try_this(),
            Self::Board(error) => error.try_this(),
        }
    }
}

async fn connect(order: &Order) -> Result<Board, ConnectError> {
    let link = Link::open(&order.target)?;
    Ok(Board::connect(link, nonce()).await?)
}

/// Another number each time, so that a board never takes a new session for the old one.
fn nonce() -> u32 {
    let now = Utc::now();
    now.timestamp().cast_unsigned() as u32 ^ now.timestamp_subsec_nanos().rotate_left(2) ^ std::process::id() << 16
}

/// Ends when the board's clock has gone on by so much.
async fn board_time(mut pulse: watch::Receiver<Pulse>, limit_s: f64) {
    let mut began_us = None;
    loop {
        if pulse.changed().await.is_err() {
            // The conversation has ended; the procedure hears of it by itself.
            return std::future::pending().await;
        }
        let now = *pulse.borrow_and_update();
        if now.beats == 0 {
            continue;
        }
        let began_us = *began_us.get_or_insert(now.board_time_us);
        if now.board_time_us.saturating_sub(began_us) as f64 * 1e-6 > limit_s {
            return;
        }
    }
}

fn session_lives(trouble: &Trouble) -> bool {
    !matches!(
        trouble,
        Trouble::Board(
            BoardError::Gone { .. }
                | BoardError::NoAnswer { .. }
                | BoardError::Silent { .. }
                | BoardError::Restarted { .. }
                | BoardError::SessionEnded
        )
    )
}

/// A restart and a device that does not work are the module's; everything else leaves the station unable to tell.
fn judge(item: &PlanItem, measured: &[Measurement], trouble: Option<&Trouble>) -> (Outcome, Option<AttemptError>) {
    let Some(trouble) = trouble else {
        let outcome = item.attempt_outcome(measured);
        let missing: Vec<&str> = item.missing(measured).collect();
        let error = (outcome == Outcome::Errored && !missing.is_empty()).then(|| AttemptError {
            text: format!("nothing was measured for {}", missing.join(", ")),
            hint: "see the notes of this item in the log".into(),
            again: false,
        });
        return (outcome, error);
    };
    let outcome = match trouble {
        Trouble::Board(BoardError::Restarted { .. }) => Outcome::Failed,
        Trouble::Board(BoardError::Fault { code: FaultCode::DeviceFault | FaultCode::DeviceTimeout, .. }) => {
            Outcome::Failed
        }
        _ => Outcome::Errored,
    };
    (outcome, Some(AttemptError { text: chain(trouble), hint: trouble.try_this().to_owned(), again: false }))
}

/// What stands at an attempt that the trouble of another one ended.
fn spoilt(text: Option<&str>) -> AttemptError {
    let text = format!("ended by the trouble of another item: {}", text.unwrap_or_default());
    AttemptError { text, hint: "it is run again".into(), again: true }
}

/// An error and its causes in one line.
pub(crate) fn chain(error: &(dyn std::error::Error + 'static)) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text.push_str(": ");
        text.push_str(&cause.to_string());
        source = cause.source();
    }
    text
}

fn for_people(record: &ErrorRecord) -> RecordEvent {
    let kind = ErrorKind::from_number(record.kind);
    let (what, location) = match kind {
        Some(ErrorKind::MemoryMismatch) => ("memory word differs".to_owned(), format!("word {:#08x}", record.place)),
        Some(ErrorKind::FlashNotBlank) => ("flash word not blank".to_owned(), format!("word {}", record.place)),
        Some(ErrorKind::FlashMismatch) => ("flash word differs".to_owned(), format!("word {}", record.place)),
        Some(ErrorKind::FlashSlow) => ("flash slower than its data sheet".to_owned(), "us".to_owned()),
        Some(ErrorKind::IoMismatch) => (
            "IO line does not follow".to_owned(),
            format!("line {} driven, {} read", record.place >> 4, record.place & 15),
        ),
        Some(ErrorKind::SpiMismatch) => ("SPI byte differs".to_owned(), format!("byte {}", record.place)),
        Some(ErrorKind::SciMismatch) => ("SCI byte differs".to_owned(), format!("byte {}", record.place)),
        Some(ErrorKind::TimerInterrupts) => ("timer interrupts missing".to_owned(), format!("timer {}", record.place)),
        Some(ErrorKind::Supply) => ("supply out of range".to_owned(), "microvolts at the socket".to_owned()),
        None => (format!("error of unknown kind {}", record.kind), format!("{}", record.place)),
    };
    let number = |value: u32| match kind {
        Some(ErrorKind::FlashSlow | ErrorKind::TimerInterrupts | ErrorKind::Supply) => value.to_string(),
        _ => format!("{value:#010x}"),
    };
    RecordEvent {
        what,
        location,
        expected: number(record.expected),
        got: number(record.got),
        board_time_us: record.board_time_us,
    }
}
