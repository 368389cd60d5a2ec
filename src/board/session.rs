//! The host's end of the conversation: one task that owns the link.

mod absent;
mod answers;
mod audit;
mod greeting;
mod heard;
mod pending;
mod possible;
mod watchdog;

use std::collections::VecDeque;
use std::time::Duration;

use audit::Audit;
use gnc_link::{Link, NoFrame};
use gnc_protocol::message::{BoardHello, Call as _, ModulePower};
use gnc_protocol::serial::LineCounters;
use gnc_protocol::stream::StreamId;
use gnc_protocol::{Flags, Frame, Header, Kind, PROTOCOL_VERSION, Payload, timing};
use greeting::Greeting;
use pending::{AnswerSender, ENDED_SINCE, Ended, Pending, Sendings};
use tokio::sync::{mpsc, oneshot, watch};
use tokio::time::Instant;
use watchdog::until;

use super::{Advance, BoardError, BoardTime, LinkAbsence, Readings};
use crate::breach::Breaches;
use crate::error::Heard;
use crate::latest::Latest;
use crate::readings::Gauges;
use crate::rule::{self, Breach};
use crate::stream::{AHEAD, Newest, SampleFrame};

/// Slack added to every wait for an ACCEPT: an USB adapter's latency timer (16 ms) both ways, and a busy computer.
const HOST_SLACK: Duration = Duration::from_millis(50);
/// Silence limit: three heartbeats missed.
const SILENT_AFTER: Duration = Duration::from_millis(3500);
/// Limit without a heartbeat: six missed while other frames come. The time limits of items go by heartbeats. Without
/// heartbeats no item would ever exceed its limit.
const BEATLESS_AFTER: Duration = Duration::from_millis(6500);
/// A timer that is served this late shows that this computer was busy, so that the times of what came meanwhile say
/// nothing of the board.
const SERVED_LATE: Duration = Duration::from_millis(20);
/// A timer that is served this late shows that this computer stalled, not that the board was silent.
const STALLED: Duration = Duration::from_millis(250);
/// Time after a stall to read first what came meanwhile.
const AFTER_A_STALL: Duration = Duration::from_millis(250);

type StreamSender = mpsc::Sender<Result<SampleFrame, BoardError>>;

/// A command to the conversation.
#[derive(Debug)]
pub(super) enum SessionCommand {
    Hello {
        nonce: u32,
        answer: oneshot::Sender<Result<BoardHello, BoardError>>,
    },
    Ask {
        request: u16,
        message: u16,
        what: &'static str,
        payload: Box<Payload>,
        answer: AnswerSender,
        advance: watch::Sender<Advance>,
    },
    Listen {
        stream: StreamId,
        sender: StreamSender,
    },
}

/// A RESULT without its status.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answer {
    /// The number of the request.
    pub request: u16,
    /// Board time it took.
    pub elapsed: Duration,
    /// Times it was sent.
    pub asked: u32,
    /// The body.
    pub body: Payload,
}

/// What the line and the board were like.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct LinkReport {
    /// Frames received, damaged and missing.
    pub received: LineCounters,
    /// Frames sent.
    pub sent: u32,
    /// Requests sent again; `sent` includes them.
    pub resent: u32,
    /// Stream frames that came twice, or behind later ones, and were dropped.
    pub stale: u32,
    /// Frames of this station that came back. They carry this station's numbers, so missing frames cannot be counted
    /// then.
    pub echoed: u32,
    /// What the board did against the interface document.
    pub breaches: Vec<Breach>,
}

/// The task's state.
#[derive(Debug)]
pub(super) struct Session {
    link: Link,
    commands: mpsc::Receiver<SessionCommand>,
    board_time: Latest<BoardTime>,
    greeting: Option<Greeting>,
    /// Nonce and boot id of the open session.
    session: Option<(u32, u32)>,
    /// Boot id of the last session.
    last_boot_id: Option<u32>,
    /// A heartbeat's boot id that is not the one of HELLO, until the board's HELLO tells whether it restarted.
    other_boot_id: Option<u32>,
    /// The boot id of the heartbeats, if it is not the one of HELLO although the board did not restart.
    beats_as: Option<u32>,
    /// Board time of the session's last heartbeat, in microseconds.
    last_beat_us: Option<u64>,
    /// The last requests that ended: their results may come again.
    ended: VecDeque<Ended>,
    /// Whether each sample is a reading of its own, by the board's capabilities.
    one_reading_each: bool,
    /// When HELLO was sent again because its first answer was late, and how many answers were late in a row.
    hello_asked: Option<Instant>,
    hello_late: u32,
    /// The board said that it knows no session, and the station has asked why.
    in_doubt: bool,
    pending: Vec<Pending>,
    streams: Vec<(StreamId, StreamSender)>,
    newest: Newest,
    /// Frames for a listener that is behind. The line is not read meanwhile.
    held: VecDeque<(StreamId, SampleFrame)>,
    sequence: u16,
    keep_alive_due: Instant,
    heard: Instant,
    /// The last heartbeat of the session.
    beat: Instant,
    /// When the port or interface went away, if it is away.
    away_since: Option<Instant>,
    /// How long it was away in this session, and when it was back.
    interrupted: Option<(Duration, Instant)>,
    /// Reports absences that are over.
    absences: mpsc::Sender<LinkAbsence>,
    /// What the line counted before the first session. The middle of a frame is not damage.
    before: Option<LineCounters>,
    report: LinkReport,
    gauges: Gauges,
    audit: Audit,
    breaches: Breaches,
    /// Heartbeats since a session was last asked for.
    heartbeats: u32,
    /// Damaged frames that are no damage of the line: the board works its checksums out in another way, or sends what is
    /// no frame.
    explained: LineCounters,
    /// What came last that was no frame, and how often in a row.
    rubbish: (Box<[u8]>, u32),
}

impl Session {
    pub(super) fn new(
        link: Link,
        commands: mpsc::Receiver<SessionCommand>,
        board_time: Latest<BoardTime>,
        readings: watch::Sender<Readings>,
        absences: mpsc::Sender<LinkAbsence>,
        breaches: Breaches,
    ) -> Self {
        let now = Instant::now();
        let numbered = matches!(link, Link::Serial(_));
        Self {
            link,
            commands,
            board_time,
            greeting: None,
            session: None,
            last_boot_id: None,
            other_boot_id: None,
            beats_as: None,
            last_beat_us: None,
            ended: VecDeque::new(),
            one_reading_each: true,
            hello_asked: None,
            hello_late: 0,
            in_doubt: false,
            pending: Vec::new(),
            streams: Vec::new(),
            newest: Newest::default(),
            held: VecDeque::new(),
            sequence: 0,
            keep_alive_due: now,
            heard: now,
            beat: now,
            away_since: None,
            interrupted: None,
            absences,
            before: None,
            report: LinkReport::default(),
            gauges: Gauges::new(readings),
            audit: Audit::new(breaches.clone(), numbered),
            breaches,
            heartbeats: 0,
            explained: LineCounters::default(),
            rubbish: (Box::default(), 0),
        }
    }

    /// Runs until every handle is dropped or the port is gone.
    pub(super) async fn run(mut self) -> LinkReport {
        loop {
            let due = self.next_due();
            let behind = self.behind();
            let reads = self.reads();
            if !reads {
                self.audit.was_blind(Instant::now());
            }
            tokio::select! {
                biased;
                () = until(due) => {
                    let now = Instant::now();
                    if now > due + SERVED_LATE {
                        self.audit.was_blind(now);
                    }
                    self.overdue();
                }
                command = self.commands.recv() => match command {
                    Some(command) => self.command(command),
                    None => break,
                },
                () = async { if let Some((sender, room)) = &behind { let _ = sender.reserve_many(*room).await; } }, if behind.is_some() => {
                    self.deliver_held();
                }
                received = self.link.next(reads) => match received {
                    Ok(Ok(frame)) => self.receive(&frame),
                    // The link has counted the damaged frame. The task that misses it asks again.
                    Ok(Err(NoFrame::Damaged { error, bytes })) => self.damaged(error, bytes),
                    Ok(Err(NoFrame::Away)) => self.went_away(),
                    Ok(Err(NoFrame::Back { lasted })) => self.came_back(lasted),
                    Err(error) => {
                        self.end(&BoardError::Gone { reason: error.to_string() });
                        break;
                    }
                },
            }
        }
        let (counters, before) = (self.link.counters(), self.before.unwrap_or_default());
        self.report.received = LineCounters {
            bad_checksum: counters.bad_checksum.saturating_sub(before.bad_checksum + self.explained.bad_checksum),
            malformed: counters.malformed.saturating_sub(before.malformed + self.explained.malformed),
            ..counters
        };
        self.report.breaches = self.breaches.all();
        self.link.close().await;
        self.report
    }

    /// A listener that is behind, and the room that it needs to catch up.
    fn behind(&self) -> Option<(StreamSender, usize)> {
        if let Some(sender) = self.held.iter().find_map(|(id, _)| self.sender_of(*id)) {
            return Some((sender, 1));
        }
        let slow = |sender: &StreamSender| sender.capacity() < AHEAD && !sender.is_closed();
        self.streams.iter().find(|(_, sender)| slow(sender)).map(|(_, sender)| (sender.clone(), AHEAD))
    }

    /// Whether the station reads the line. It does not read for a listener that is behind, so that a bench at full
    /// speed waits for that listener. It does read while a task awaits an answer: the answer comes behind samples, and
    /// the task that waits for it may block the listener.
    fn reads(&self) -> bool {
        let awaited = !self.pending.is_empty() || self.greeting.is_some();
        self.held.is_empty() && (awaited || self.behind().is_none())
    }

    fn next_due(&self) -> Instant {
        if let Some(since) = self.away_since {
            return self.away_due(since);
        }
        let held_back = self.pending.iter().any(Pending::is_in_doubt);
        let sendable = self.pending.iter().filter(|pending| !(held_back && pending.can_be_held_back()));
        let requests = sendable.map(|pending| pending.due).min();
        let greeting = self.greeting.as_ref().map(|greeting| greeting.due);
        let silent = self.session.map(|_| self.silent_due());
        [requests, greeting, silent].into_iter().flatten().fold(self.keep_alive_due, Instant::min)
    }

    /// The moment from which the board counts as silent.
    fn silent_due(&self) -> Instant {
        (self.heard + SILENT_AFTER).min(self.beat + BEATLESS_AFTER)
    }

    fn command(&mut self, command: SessionCommand) {
        let now = Instant::now();
        match command {
            SessionCommand::Hello { nonce, answer } => {
                self.session = None;
                self.heartbeats = 0;
                self.greeting = Some(Greeting::new(nonce, answer, now));
            }
            SessionCommand::Ask { request, message, what, payload, answer, advance } => {
                if self.session.is_none() {
                    let _ = answer.send(Err(self.no_session()));
                    return;
                }
                self.pending.push(Pending {
                    request,
                    message,
                    what,
                    payload,
                    answer,
                    advance,
                    asked: 0,
                    since: now,
                    due: now,
                    sendings: Sendings { sent: 0, first: now, last: now, answers: 0, first_answer: None },
                    runs: None,
                    lost_before: LineCounters::default(),
                    lost_at_run: LineCounters::default(),
                    expected_ms: 0,
                    ended_since: 0,
                    inquiry: false,
                });
            }
            SessionCommand::Listen { stream, sender } => {
                self.forget(stream);
                self.streams.push((stream, sender));
            }
        }
    }

    fn overdue(&mut self) {
        let now = Instant::now();
        if let Some(since) = self.away_since {
            return self.still_away(since, now);
        }
        if !self.reads() {
            // The station does not read now, so it cannot call the board silent.
            (self.heard, self.beat) = (now, now);
        }
        if self.session.is_some() && now >= self.silent_due() {
            self.silent(now);
        }
        self.greet_again(now);
        self.ask_again(now);
        self.keep_alive(now);
    }

    fn silent(&mut self, now: Instant) {
        if now >= self.silent_due() + STALLED {
            self.heard = self.heard.max(now + AFTER_A_STALL - SILENT_AFTER);
            self.beat = self.beat.max(now + AFTER_A_STALL - BEATLESS_AFTER);
            return;
        }
        self.session = None;
        let silent = now - self.beat.min(self.heard);
        let error = match now - self.heard >= SILENT_AFTER {
            true => BoardError::Silent { silent, on_can: self.on_can() },
            false => BoardError::NoHeartbeat { silent },
        };
        self.fail_all(&error);
    }

    fn on_can(&self) -> bool {
        matches!(self.link, Link::Can(_))
    }

    /// What came instead of an answer.
    fn heard_instead(&self, since: Instant, runs: Option<Instant>, now: Instant) -> Heard {
        match (runs, self.breaches.instead_of_an_answer(since)) {
            (Some(_), Some(breach)) if breach.rule == &rule::OTHER_MESSAGE => Heard::Breach(breach),
            (Some(runs), _) => Heard::Accepted { silent: now - runs },
            (None, Some(breach)) => Heard::Breach(breach),
            (None, None) if self.heard > since => Heard::OtherFrames,
            (None, None) => Heard::Nothing { on_can: self.on_can() },
        }
    }

    /// Sends unanswered requests again, under the same id. The board replays a result that was lost.
    fn ask_again(&mut self, now: Instant) {
        let held_back = self.pending.iter().any(Pending::is_in_doubt);
        let mut index = 0;
        while index < self.pending.len() {
            let pending = &mut self.pending[index];
            if pending.answer.is_closed() {
                self.pending.swap_remove(index);
                continue;
            }
            if now < pending.due || held_back && pending.can_be_held_back() {
                index += 1;
                continue;
            }
            if pending.asked > timing::RESENDS {
                let pending = self.pending.swap_remove(index);
                let (what, asked, waited) = (pending.what, pending.asked, now - pending.since);
                let error = BoardError::NoAnswer {
                    what,
                    asked,
                    waited,
                    heard: self.heard_instead(pending.sendings.first, pending.runs, now),
                };
                let _ = pending.answer.send(Err(error));
                continue;
            }
            let flags = if pending.asked == 0 { Flags::default() } else { Flags::RESENT };
            // The first inquiry about a running request is no sign of a loss.
            let lost = pending.asked > 1 || pending.asked == 1 && !std::mem::take(&mut pending.inquiry);
            pending.asked += 1;
            if pending.sendings.sent == 0 {
                pending.lost_before = self.link.counters();
                pending.sendings.first = now;
            }
            pending.sendings.sent += 1;
            pending.sendings.last = now;
            // The answer may have to wait behind a full frame of a stream.
            let wire = self.link.exchange_time(pending.payload.len());
            pending.due = now + (timing::ACCEPT_WITHIN + wire + HOST_SLACK) * pending.asked;
            let (request, message, payload) = (pending.request, pending.message, pending.payload.clone());
            self.report.resent += u32::from(lost);
            self.audit.asks(request);
            if message == ModulePower::ID {
                self.audit.switches();
            }
            self.send(Kind::Request, flags, request, message, &payload);
            index += 1;
        }
    }

    /// Drops the stream, to which no code listens any more.
    fn forget(&mut self, id: StreamId) {
        self.streams.retain(|(other, _)| *other != id);
        self.held.retain(|(other, _)| *other != id);
    }

    fn deliver_held(&mut self) {
        while let Some((id, frame)) = self.held.pop_front() {
            match self.sender_of(id).map(|sender| sender.try_send(Ok(frame))) {
                None | Some(Ok(())) => {}
                Some(Err(mpsc::error::TrySendError::Full(Ok(frame)))) => return self.held.push_front((id, frame)),
                Some(Err(_)) => self.forget(id),
            }
        }
    }

    fn sender_of(&self, id: StreamId) -> Option<StreamSender> {
        self.streams.iter().find(|(other, _)| *other == id).map(|(_, sender)| sender.clone())
    }

    /// Takes the request that an answer ends, and counts this end for the other requests.
    fn take(&mut self, request: u16, message: u16) -> Option<Pending> {
        let matches = |pending: &Pending| pending.request == request && pending.message == message;
        let index = self.pending.iter().position(matches)?;
        let taken = self.pending.swap_remove(index);
        let now = Instant::now();
        for other in self.pending.iter_mut().filter(|other| other.asked > 0) {
            other.ended_since += 1;
            if other.ended_since == ENDED_SINCE {
                other.inquiry = other.asked == 1;
                other.due = now;
            }
        }
        Some(taken)
    }

    fn fail_all(&mut self, error: &BoardError) {
        for pending in self.pending.drain(..) {
            let _ = pending.answer.send(Err(error.clone()));
        }
        for (_, sender) in self.streams.drain(..) {
            // A listener that is behind gets no error here: it finds the end of the stream, and asks.
            let _ = sender.try_send(Err(error.clone()));
        }
        self.held.clear();
    }

    fn end(&mut self, error: &BoardError) {
        if let Some(greeting) = self.greeting.take() {
            let _ = greeting.answer.send(Err(error.clone()));
        }
        self.session = None;
        self.fail_all(error);
    }

    fn send(&mut self, kind: Kind, flags: Flags, request: u16, message: u16, payload: &Payload) {
        let version = if kind == Kind::Hello { 0 } else { PROTOCOL_VERSION };
        let header = Header { version, kind, flags, request, message, sequence: self.sequence };
        self.sequence = self.sequence.wrapping_add(1);
        self.report.sent += 1;
        self.link.send(&Frame { header, payload: payload.clone() });
    }
}
