//! The only doer: it follows a plan on a bench, one item after the other, and emits what happens.

pub mod journal;
pub mod report;

use std::path::PathBuf;
use std::time::Duration;

use chrono::Utc;
use gnc_executive::event::{
    AttemptError, Board as BoardEvent, ErrorRecord as RecordEvent, EventKind, Level, Power, RunHeader, StopHow,
};
use gnc_executive::job::{Job, Next};
use gnc_executive::measurement::Measurement;
use gnc_executive::outcome::Outcome;
use gnc_executive::plan::{Phase, PlanItem};
use gnc_executive::state::RunState;
use gnc_protocol::message::{ErrorKind, ErrorRecords, MakeSafe, ModulePower};
use gnc_protocol::{FaultCode, PROTOCOL_VERSION};
use tokio::sync::watch;
use tokio::time::timeout;

use crate::board::{Advance, Board, BoardError, Pulse};
use crate::fixture::Fixture;
use crate::link::serial::{self, OpenError};
use crate::procedure::{self, Bench, Trouble};
use crate::stop::{Asked, Stop};
use crate::store::StoreError;
use journal::Journal;
use report::Report;

pub use gnc_executive::bench::Site;

/// Longest wait for the board to make itself safe over a live link; a board that does not answer has its watchdog.
const SAFE_WITHIN: Duration = Duration::from_millis(250);
/// Error records kept of one attempt: as many as the board keeps.
const MAX_RECORDS: usize = 64;

/// A run that was ordered.
#[derive(Debug)]
pub struct Order {
    /// The plan on this bench.
    pub job: Job,
    /// Who tests what, where, with what.
    pub header: RunHeader,
    /// The port to the slave board.
    pub port: PathBuf,
    /// Its rate.
    pub rate_baud: u32,
    /// Whoever turns the module.
    pub fixture: Fixture,
    /// Where the bench stands.
    pub site: Option<Site>,
}

/// What is being done, for people; some of it may be skipped.
#[derive(Debug, Clone)]
pub struct Live {
    /// The item that runs.
    pub doing: watch::Sender<Option<Doing>>,
    /// How far its request is.
    pub advance: watch::Sender<Advance>,
}

/// The item that runs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Doing {
    /// Its name in the plan.
    pub item: String,
    /// Attempt, from 1.
    pub attempt: u32,
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
    let mut run = Run { order, journal: &journal, stop, live, board: None, records_read: 0, link_lost: false };
    let ended = run.whole().await;
    live.doing.send_replace(None);
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
    board: Option<Board>,
    /// Error records of the board's session that are filed already.
    records_read: u16,
    link_lost: bool,
}

/// How an attempt came to its end.
enum End {
    Done(Result<(), Trouble>),
    Stopped(Asked),
}

impl Run<'_> {
    async fn whole(&mut self) -> Result<Outcome, StoreError> {
        let header = Box::new(self.order.header.clone());
        self.journal.emit(EventKind::RunStarted { header, items: self.order.job.planned() }).await?;
        let stop = self.stop.clone();
        let body = tokio::select! {
            biased;
            asked = stop.asked_times(2) => Err(asked),
            body = self.body() => Ok(body),
        };
        match body {
            Ok(body) => body?,
            Err(asked) => self.end_at_once(asked).await?,
        }
        let outcome = self.journal.look(RunState::outcome_so_far);
        self.journal.emit(EventKind::RunEnded { outcome }).await?;
        Ok(outcome)
    }

    /// Everything but the first and the last event. Teardown is always reached, also when the record fails.
    async fn body(&mut self) -> Result<(), StoreError> {
        let worked = match self.begin().await {
            Ok(true) => self.items().await,
            Ok(false) => Ok(()),
            Err(error) => Err(error),
        };
        let safe = self.make_safe().await;
        worked.and(safe)
    }

    /// Finds the board and switches the module on. `false`: it could not, or nobody wants it any more.
    async fn begin(&mut self) -> Result<bool, StoreError> {
        let connected = tokio::select! {
            biased;
            asked = self.stop.asked_times(1) => Err(asked),
            connected = connect(self.order, self.live) => Ok(connected),
        };
        match connected {
            Err(asked) => {
                self.stop_in_order(asked).await?;
                Ok(false)
            }
            Ok(Err(error)) => {
                self.note(Level::Error, format!("{}; {}", chain(&error), error.try_this()), None).await?;
                Ok(false)
            }
            Ok(Ok(board)) => {
                self.board = Some(board);
                self.found().await?;
                self.power_on(None).await
            }
        }
    }

    async fn items(&mut self) -> Result<(), StoreError> {
        loop {
            match self.journal.look(|state| self.order.job.next(state)) {
                Next::Run { item, attempt } => {
                    let Some(item) = self.order.job.item(item) else { return Ok(()) };
                    self.attempt(item, attempt).await?;
                    if self.link_lost {
                        self.end_open_items().await?;
                        let text = "the link is lost, so the rest of the plan is not run";
                        return self.note(Level::Error, text.into(), None).await;
                    }
                }
                Next::End { item, outcome } => self.end_item(item, outcome, None).await?,
                Next::Skip { item, cause } => self.end_item(item, Outcome::Skipped, Some(cause)).await?,
                Next::Wait | Next::Done { .. } => return Ok(()),
            }
        }
    }

    async fn end_item(
        &self,
        position: usize,
        outcome: Outcome,
        cause: Option<gnc_executive::outcome::Cause>,
    ) -> Result<(), StoreError> {
        let Some(item) = self.order.job.item(position) else { return Ok(()) };
        self.journal.emit(EventKind::ItemEnded { item: item.name.clone(), outcome, cause }).await
    }

    async fn attempt(&mut self, item: &PlanItem, attempt: u32) -> Result<(), StoreError> {
        let name = &item.name;
        self.journal.emit(EventKind::ItemStarted { item: name.clone(), attempt }).await?;
        self.live.advance.send_replace(Advance::default());
        self.live.doing.send_replace(Some(Doing { item: name.clone(), attempt }));
        let report = Report::new(self.journal, item, attempt, &self.order.header.serial_number);
        // After a stop only teardown items run, and those may be ended by a second one alone.
        let may_stop = item.phase != Phase::Teardown;
        let end = tokio::select! {
            biased;
            asked = self.stop.asked_times(1), if may_stop => End::Stopped(asked),
            done = self.procedure(item, attempt, &report) => End::Done(done),
        };
        let measured = report.into_measured();
        self.live.doing.send_replace(None);
        if let End::Stopped(asked) = end {
            self.stop_in_order(asked).await?;
            let error = AttemptError { text: format!("stopped by {}", asked.by), hint: String::new() };
            return self.end_attempt(name, attempt, Outcome::Aborted, Some(error)).await;
        }
        let trouble = match end {
            End::Done(Err(Trouble::Store(error))) => return Err(error),
            End::Done(Err(trouble)) => Some(trouble),
            _ => None,
        };
        if trouble.as_ref().is_none_or(session_lives) {
            self.file_error_records(name, attempt).await?;
        }
        let (outcome, error) = judge(item, &measured, trouble.as_ref());
        self.end_attempt(name, attempt, outcome, error).await?;
        match trouble {
            Some(trouble) if !matches!(trouble, Trouble::Fixture(_)) => self.recover(name, &trouble).await,
            _ => Ok(()),
        }
    }

    async fn end_attempt(
        &self,
        item: &str,
        attempt: u32,
        outcome: Outcome,
        error: Option<AttemptError>,
    ) -> Result<(), StoreError> {
        self.journal.emit(EventKind::AttemptEnded { item: item.to_owned(), attempt, outcome, error }).await
    }

    async fn procedure(&self, item: &PlanItem, attempt: u32, report: &Report<'_>) -> Result<(), Trouble> {
        let Some(board) = &self.board else {
            return Err(BoardError::Gone { reason: "there is no link to the board".into() }.into());
        };
        let bench =
            Bench { board, fixture: &self.order.fixture, site: self.order.site.as_ref(), advance: &self.live.advance };
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

    /// After trouble nobody knows what the board still does: a new session makes it safe and starts clean.
    async fn recover(&mut self, item: &str, trouble: &Trouble) -> Result<(), StoreError> {
        let Some(board) = &mut self.board else { return Ok(()) };
        let before = board.hello().boot_id;
        let reopened = tokio::select! {
            biased;
            asked = self.stop.asked_times(1), if self.stop.asked().times == 0 => Err(asked),
            reopened = board.reopen(nonce()) => Ok(reopened.map(|hello| hello.boot_id)),
        };
        self.records_read = 0;
        match reopened {
            Err(asked) => self.stop_in_order(asked).await,
            Ok(Err(error)) => {
                self.link_lost = true;
                self.note(Level::Error, format!("{}; {}", chain(&error), error.try_this()), None).await
            }
            Ok(Ok(boot_id)) => {
                if boot_id != before {
                    let charged = matches!(trouble, Trouble::Board(BoardError::Restarted { .. }));
                    let item = charged.then(|| item.to_owned());
                    let boot_id = format!("{boot_id:08x}");
                    self.journal.emit(EventKind::BoardRebooted { item, boot_id }).await?;
                }
                self.link_lost = !self.power_on(Some(item)).await?;
                Ok(())
            }
        }
    }

    async fn found(&self) -> Result<(), StoreError> {
        let Some(board) = &self.board else { return Ok(()) };
        let hello = board.hello();
        let link = format!("{} at {} bit/s", self.order.port.display(), self.order.rate_baud);
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

    async fn power_on(&mut self, item: Option<&str>) -> Result<bool, StoreError> {
        let Some(board) = &self.board else { return Ok(false) };
        let switched = tokio::select! {
            biased;
            asked = self.stop.asked_times(1), if self.stop.asked().times == 0 => Err(asked),
            switched = board.call(&ModulePower { on: 1 }) => Ok(switched),
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
    async fn make_safe(&mut self) -> Result<(), StoreError> {
        let Some(board) = self.board.take() else { return Ok(()) };
        let safe = if self.link_lost {
            Ok(Err(BoardError::Gone { reason: "the link was lost".into() }))
        } else {
            timeout(SAFE_WITHIN, board.call(&MakeSafe {})).await
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
    async fn file_error_records(&mut self, item: &str, attempt: u32) -> Result<(), StoreError> {
        for _ in 0..MAX_RECORDS {
            let Some(board) = &self.board else { return Ok(()) };
            let reply = match board.call(&ErrorRecords { from: self.records_read }).await {
                Ok(reply) => reply,
                Err(error) => {
                    let text = format!("the board's error records cannot be read: {}", chain(&error));
                    return self.note(Level::Warning, text, Some(item)).await;
                }
            };
            for record in &reply.records {
                self.records_read = record.index.wrapping_add(1);
                let (item, record) = (item.to_owned(), for_people(record));
                self.journal.emit(EventKind::ErrorRecord { item, attempt, record }).await?;
            }
            if reply.records.is_empty() || self.records_read >= reply.total {
                return Ok(());
            }
        }
        Ok(())
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
                    let error = AttemptError { text: "stopped at once".into(), hint: String::new() };
                    self.end_attempt(&item, attempt, Outcome::Aborted, Some(error)).await?;
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
    Open(#[from] OpenError),
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

async fn connect(order: &Order, live: &Live) -> Result<Board, ConnectError> {
    let link = serial::open(&order.port, order.rate_baud)?;
    Ok(Board::connect(link, nonce(), live.advance.clone()).await?)
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
    (outcome, Some(AttemptError { text: chain(trouble), hint: trouble.try_this().to_owned() }))
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

fn for_people(record: &gnc_protocol::message::ErrorRecord) -> RecordEvent {
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
