//! Carries out one run in memory: station, bench and disturbance in one task, on one clock that moves when all of them
//! wait. The same case gives the same run, to the byte of its journal.

use std::convert::Infallible;
use std::path::Path;
use std::time::Duration;

use chrono::DateTime;
use gnc_bench::control::RunControl;
use gnc_bench::fixture::{Ask, Fixture, OperatorQuestion, Reply};
use gnc_bench::runner::Live;
use gnc_bench::service;
use gnc_link::Target;
use gnc_link::can::CanTarget;
use gnc_link::memory::MemoryPort;
use hw_mocks::{Adapter, BenchOptions, SimulatedBench, Speed};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, DuplexStream, ReadHalf, WriteHalf};
use tokio::sync::{mpsc, watch};
use tokio::time::{Instant, sleep_until, timeout};

use super::case::{Case, Link};
use super::order::{Heard, Ordered, order};
use super::run::{Act, LONGEST, Ran, SAFE_AFTER, acts, options};

/// The date on which every run begins, by its own calendar.
const BEGAN: &str = "2026-11-22T06:30:15+00:00";
/// Most bytes taken at once.
const AT_ONCE: usize = 4096;
/// Least step of the clock between two looks of the bench. The bench does at a look what became due before, and the
/// clock's own ticks are a millisecond.
const LOOK: Duration = Duration::from_micros(100);
/// Time between two looks of the bench while the computer is suspended, equal to a tick of its clock.
const SUSPENDED_STEP: Duration = Duration::from_millis(1);
/// Most open questions: a question is asked when the one before is answered.
const QUESTIONS: usize = 1;

/// Rate of an slcan adapter; the adapter itself has no pace.
const ADAPTER_BAUD: u32 = 2_000_000;

pub(super) fn run_in(case: &Case, place: &Path) -> Result<Ran, String> {
    let said = |error: &dyn std::fmt::Display| error.to_string();
    let options = options(case, Speed::Times(1.0))?;
    let port = MemoryPort::new("port", options.rate_baud);
    let adapter = MemoryPort::new("adapter", ADAPTER_BAUD);
    let can = CanTarget::Memory(adapter.clone());
    let target = match case.link {
        Link::Rs422 => Target::Memory(port.clone()),
        Link::Can => Target::Can(can.clone()),
    };
    let (asks, questions) = mpsc::channel(QUESTIONS);
    let began = DateTime::parse_from_rfc3339(BEGAN).map_err(|error| said(&error))?;
    let Ordered { request, equipment } = order(case, "1", (target, can), Fixture::Screen(asks), place, Some(began))?;
    let (told, heard) = watch::channel(0);
    let mut listener = Heard::new(move || {
        told.send_modify(|events| *events += 1);
        true
    });
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .start_paused(true)
        .build()
        .map_err(|error| said(&error))?;
    runtime.block_on(async {
        let control = RunControl::default();
        let mut world = World::new(case, &options, (port, adapter), control.clone(), questions, heard);
        let live = Live::default();
        let station = timeout(LONGEST, service::run(&request, equipment, &control, &live, &mut listener));
        let ended = tokio::select! {
            biased;
            ended = station => ended,
            never = world.go_on() => match never {},
        };
        let at = Instant::now();
        let mut ran = Ran { took: at - world.began, in_memory: true, ..Ran::default() };
        ran.since_disturbed = world.disturbed.map(|disturbed| at - disturbed);
        let Ok(done) = ended else {
            ran.problems.push(format!("the run did not end within {LONGEST:?}"));
            return Ok(ran);
        };
        let truth = world.bench.truth();
        (ran.line, ran.restarts) = (truth.line, truth.restarts);
        // A run that has ended is no longer disturbed.
        world.due.clear();
        ran.off_after = timeout(SAFE_AFTER, world.off()).await.ok().map(|off| off.saturating_duration_since(at));
        ran.off_since_disturbed = world.disturbed.zip(world.off_since_disturbed).map(|(from, to)| to - from);
        let (verdict, folder) = listener.ended(done)?;
        Ok(ran.with_record(verdict, &folder))
    })
}

/// The bench's end of a cable; empty if no cable is plugged in.
#[derive(Default)]
struct CableEnd {
    reader: Option<ReadHalf<DuplexStream>>,
    writer: Option<WriteHalf<DuplexStream>>,
}

impl CableEnd {
    fn plugged_into(port: &MemoryPort) -> Self {
        let (reader, writer) = tokio::io::split(port.plug_in());
        Self { reader: Some(reader), writer: Some(writer) }
    }
}

/// Reads bytes; returns their number.
async fn read(reader: &mut Option<ReadHalf<DuplexStream>>, buffer: &mut [u8]) -> usize {
    let Some(end) = reader else { return std::future::pending().await };
    let count = end.read(buffer).await.unwrap_or(0);
    if count == 0 {
        *reader = None;
    }
    count
}

/// Writes bytes; returns the number of bytes that are gone. Without a cable all are gone, since they are lost.
async fn write(writer: &mut Option<WriteHalf<DuplexStream>>, bytes: &[u8]) -> usize {
    let Some(end) = writer else { return bytes.len() };
    match end.write(bytes).await {
        Ok(count @ 1..) => count,
        Ok(_) | Err(_) => {
            *writer = None;
            bytes.len()
        }
    }
}

/// The event that happened first.
enum Happened {
    Asked(OperatorQuestion),
    /// The moment of the case has come.
    Moment,
    Said(usize),
    CanSaid(usize),
    Heard(usize),
    CanHeard(usize),
    TimePassed,
}

/// Everything except the station.
struct World<'a> {
    case: &'a Case,
    bench: SimulatedBench,
    began: Instant,
    port: MemoryPort,
    line: CableEnd,
    adapter_port: MemoryPort,
    adapter_line: CableEnd,
    adapter: Adapter,
    control: RunControl,
    questions: mpsc::Receiver<OperatorQuestion>,
    /// Events of the run so far.
    heard: watch::Receiver<u64>,
    /// The moment of the case has come.
    scheduled: bool,
    due: Vec<(Instant, Act)>,
    /// How long the computer was suspended.
    suspended: Duration,
    /// Time of the first disturbance.
    disturbed: Option<Instant>,
    /// Time at which the module was first off after that.
    off_since_disturbed: Option<Instant>,
}

impl<'a> World<'a> {
    fn new(
        case: &'a Case,
        options: &BenchOptions,
        (port, adapter_port): (MemoryPort, MemoryPort),
        control: RunControl,
        questions: mpsc::Receiver<OperatorQuestion>,
        heard: watch::Receiver<u64>,
    ) -> Self {
        Self {
            case,
            bench: SimulatedBench::new(options),
            began: Instant::now(),
            line: CableEnd::plugged_into(&port),
            port,
            adapter_line: CableEnd::plugged_into(&adapter_port),
            adapter_port,
            adapter: Adapter::default(),
            control,
            questions,
            heard,
            scheduled: false,
            due: Vec::new(),
            suspended: Duration::ZERO,
            disturbed: None,
            off_since_disturbed: None,
        }
    }

    async fn go_on(&mut self) -> Infallible {
        loop {
            self.turn().await;
        }
    }

    /// Goes on until the module is off; returns that time.
    async fn off(&mut self) -> Instant {
        while self.bench.is_powered() {
            self.turn().await;
        }
        Instant::now()
    }

    /// Does what is due now, and then waits for the next event.
    async fn turn(&mut self) {
        self.act();
        let at = Instant::now();
        let now = self.link_time(at);
        self.bench.advance(now);
        if self.disturbed.is_some() && !self.bench.is_powered() {
            self.off_since_disturbed.get_or_insert(at);
        }
        let said = self.bench.output(now).to_vec();
        while self.adapter.output().len() < AT_ONCE
            && let Some(frame) = self.bench.output_can()
        {
            self.adapter.send(&frame);
        }
        let lines = self.adapter.output().to_vec();
        let (mut bytes, mut can_bytes) = ([0; AT_ONCE], [0; AT_ONCE]);
        let room = self.bench.room().min(AT_ONCE);
        // Read no more bytes than the shortest frames need.
        let can_room = (self.bench.can_room() * 5).min(AT_ONCE);
        let due = self.due.iter().map(|(due, _)| *due);
        let next = due.fold(at + self.bench.next_due(now).saturating_sub(now), Instant::min).max(at + LOOK);
        let moment = self.case.moment.0;
        let (line, adapter_line) = (&mut self.line, &mut self.adapter_line);
        let happened = tokio::select! {
            biased;
            Some(question) = self.questions.recv() => Happened::Asked(question),
            Ok(_) = self.heard.wait_for(|events| *events >= moment), if !self.scheduled => Happened::Moment,
            count = write(&mut line.writer, &said), if !said.is_empty() => Happened::Said(count),
            count = write(&mut adapter_line.writer, &lines), if !lines.is_empty() => Happened::CanSaid(count),
            count = read(&mut line.reader, &mut bytes[..room]), if room > 0 => Happened::Heard(count),
            count = read(&mut adapter_line.reader, &mut can_bytes[..can_room]), if can_room > 0 => Happened::CanHeard(count),
            () = sleep_until(next) => Happened::TimePassed,
        };
        let now = self.link_time(Instant::now());
        match happened {
            Happened::Asked(question) => self.answer(question, now),
            Happened::Moment => (self.scheduled, self.due) = (true, acts(self.case)),
            Happened::Said(count) => self.bench.consume(count),
            Happened::CanSaid(count) => self.adapter.consume(count),
            Happened::Heard(count) => self.bench.receive(&bytes[..count], now),
            Happened::CanHeard(count) => {
                let frames = self.adapter.receive(&can_bytes[..count]);
                frames.into_iter().for_each(|frame| self.bench.receive_can(frame, now));
            }
            Happened::TimePassed => {}
        }
    }

    /// Does what an operator is asked to do at this bench.
    fn answer(&mut self, question: OperatorQuestion, now: Duration) {
        self.bench.pass_time(now);
        let done = match question.ask {
            Ask::Switches(on) | Ask::SwitchesAgain { on, .. } => {
                self.bench.only_switch(on);
                Reply::Done
            }
            Ask::Heading { deg } => {
                self.bench.set_heading_deg(deg);
                Reply::Done
            }
            // The functional plan asks for no other action.
            _ => Reply::NotPossible,
        };
        // An item that was stopped meanwhile no longer waits.
        let _ = question.answer.send(done);
    }

    /// Lets the bench go on while the station's clock stands still.
    fn suspend(&mut self, span: Duration) {
        let until = self.suspended + span;
        while self.suspended < until {
            self.suspended += SUSPENDED_STEP;
            let now = self.link_time(Instant::now());
            self.bench.advance(now);
            let unheard = self.bench.output(now).len();
            self.bench.consume(unheard);
            while self.bench.output_can().is_some() {}
        }
    }

    /// The bench's time.
    fn link_time(&self, at: Instant) -> Duration {
        at - self.began + self.suspended
    }

    fn act(&mut self) {
        let now = Instant::now();
        while let Some(index) = self.due.iter().position(|(due, _)| *due <= now) {
            let (_, act) = self.due.remove(index);
            self.disturbed.get_or_insert(now);
            let (port, line) = match self.case.link {
                Link::Rs422 => (&self.port, &mut self.line),
                Link::Can => (&self.adapter_port, &mut self.adapter_line),
            };
            match act {
                Act::Stop => self.control.stop("SIGTERM"),
                Act::Unplug => {
                    port.unplug();
                    *line = CableEnd::default();
                }
                Act::PlugIn => *line = CableEnd::plugged_into(port),
                Act::Suspend(span) => self.suspend(span),
            }
            if matches!(act, Act::Unplug | Act::PlugIn) && self.case.link == Link::Can {
                self.adapter = Adapter::default();
            }
        }
    }
}
