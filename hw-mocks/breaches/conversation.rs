//! The filter of frames between the board's end of the conversation and the wire, one for each link.

use std::collections::VecDeque;
use std::time::Duration;

use gnc_protocol::Call as _;
use gnc_protocol::frame::{Flags, Frame, Kind, PROTOCOL_VERSION};
use gnc_protocol::message::{Heartbeat, HostHello, MAGIC, MakeSafe, Progress, StreamStart, event};
use gnc_protocol::slave::{KEPT_RESULTS, Slave, SlaveBoard};
use gnc_protocol::timing::WATCHDOG;
use gnc_protocol::wire::Wire;

use super::answers::{frame_of, spoil};
use super::wire::Numbers;
use super::{Breaches, StrangeAnswer, is_nth};

/// Ids under which requests run again that ended before: a host that counts up from 1 does not come so far.
const AGAIN: u16 = 0xf000;
const AGAIN_COUNT: u16 = 0x0f00;
/// Such ids that are kept. As many requests run at once at most, and some that ended may still be asked for.
const KEPT_AGAIN: usize = 32;

/// How long a RESULT that comes behind the first samples waits: on CAN they have left by then.
const BEHIND_SAMPLES: Duration = Duration::from_millis(30);
/// How long it waits for them: a stream without samples begins all the same.
const WITHOUT_SAMPLES: Duration = Duration::from_secs(2);

/// A request that the board accepted and has not ended.
#[derive(Debug)]
struct Running {
    request: u16,
    message: u16,
    progress_due: Duration,
}

/// The filter of one link.
#[derive(Debug)]
pub(crate) struct TalkFilter {
    breaches: Breaches,
    active: bool,
    /// Frames that wait for their time, in their order.
    held: VecDeque<(Duration, Frame)>,
    running: Vec<Running>,
    /// Requests whose RESULT goes out under another id.
    swapped: Vec<(u16, u16)>,
    /// Id and message of the last requests that ended.
    ended: VecDeque<(u16, u16)>,
    /// Ids under which the board knows requests that came again, and their own ids.
    again: VecDeque<(u16, u16)>,
    again_next: u16,
    /// The RESULT of a StreamStart that waits for the stream's first frame, and until when.
    awaits: Option<(Duration, Frame)>,
    nonce: Option<u32>,
    in_session: bool,
    /// The host's last sign of life.
    heard: Duration,
    beat_due: Duration,
    beats: u32,
    accepts: u32,
    results: u32,
    numbers: Numbers,
    sent: u32,
}

impl TalkFilter {
    pub(crate) fn new(breaches: &Breaches) -> Self {
        Self {
            breaches: breaches.clone(),
            active: !breaches.none_of_the_conversation(),
            held: VecDeque::new(),
            running: Vec::new(),
            swapped: Vec::new(),
            ended: VecDeque::new(),
            again: VecDeque::new(),
            again_next: 0,
            awaits: None,
            nonce: None,
            in_session: false,
            heard: Duration::ZERO,
            beat_due: Duration::ZERO,
            beats: 0,
            accepts: 0,
            results: 0,
            numbers: Numbers::new(&breaches.talk),
            sent: 0,
        }
    }

    /// Whether any frame may pass it other than it came.
    pub(crate) fn is_active(&self) -> bool {
        self.active
    }

    /// Frames sent since the board's start.
    pub(crate) fn sent(&self) -> u32 {
        self.sent
    }

    /// Whether no frame waits for its time.
    pub(crate) fn is_empty(&self) -> bool {
        self.held.is_empty()
    }

    /// The board restarted: it knows nothing any more.
    pub(crate) fn restart(&mut self) {
        *self = Self { active: self.active, ..Self::new(&self.breaches) };
    }

    /// Does not count `span` before `now` as silence of the host.
    pub(crate) fn excuse(&mut self, span: Duration, now: Duration) {
        self.heard = (self.heard + span).min(now).max(self.heard);
    }

    /// Whether the module keeps its power after this request until its RESULT leaves.
    pub(crate) fn is_safe_late(&self, frame: &Frame) -> bool {
        let is_make_safe = frame.header.kind == Kind::Request && frame.header.message == MakeSafe::ID;
        is_make_safe && !self.breaches.timing.make_safe_after.is_zero()
    }

    /// Takes a frame from the host; `None` if the board does not hear it.
    pub(crate) fn hear(&mut self, frame: &Frame, now: Duration) -> Option<Frame> {
        if !self.active {
            return Some(frame.clone());
        }
        let mut frame = frame.clone();
        let in_force = frame.header.version == PROTOCOL_VERSION;
        match frame.header.kind {
            Kind::Hello => {
                if self.breaches.hello.deaf_to_hello {
                    return None;
                }
                if let Ok(hello) = HostHello::from_payload(&frame.payload)
                    && hello.magic == MAGIC
                {
                    self.heard = now;
                    if self.nonce.replace(hello.nonce) != Some(hello.nonce) || !self.in_session {
                        self.forget();
                    }
                }
            }
            Kind::Request if in_force => {
                self.heard = now;
                self.run_again(&mut frame);
            }
            Kind::Event if in_force && frame.header.message == event::KEEP_ALIVE => self.heard = now,
            _ => {}
        }
        Some(frame)
    }

    /// Forgets what belongs to a session.
    pub(crate) fn forget(&mut self) {
        self.held.clear();
        self.running.clear();
        self.swapped.clear();
        self.ended.clear();
        self.again.clear();
        self.awaits = None;
    }

    /// Gives a request that ended before a new id, so that the board does not know it.
    fn run_again(&mut self, frame: &mut Frame) {
        let known = (frame.header.request, frame.header.message);
        if !self.breaches.talk.replay_runs_again || !self.ended.contains(&known) {
            return;
        }
        self.ended.retain(|ended| *ended != known);
        let id = AGAIN + self.again_next % AGAIN_COUNT;
        self.again_next = self.again_next.wrapping_add(1);
        if self.again.len() == KEPT_AGAIN {
            self.again.pop_front();
        }
        self.again.push_back((id, frame.header.request));
        frame.header.request = id;
    }

    /// Ends the session of a host that fell silent, at the time of this board; returns the event that tells it.
    pub(crate) fn watch(&mut self, slave: &mut Slave, board: &mut impl SlaveBoard, now: Duration) -> Option<Frame> {
        self.in_session = slave.has_session();
        let limit = self.breaches.timing.watchdog?;
        // The watchdog of the conversation itself never fires.
        slave.excuse(WATCHDOG, now);
        if limit.is_zero() || !self.in_session || now.saturating_sub(self.heard) < limit {
            return None;
        }
        // No version is in common with this HELLO, which ends a session as the watchdog does. Its answer is not sent.
        let none = HostHello { magic: MAGIC, lowest: 0, highest: 0, nonce: 0 };
        slave.receive(&frame_of(Kind::Hello, 0, 0, &none)?, now, board, &mut |_| {});
        self.in_session = false;
        self.forget();
        frame_of(Kind::Event, 0, event::WATCHDOG, &())
    }

    /// Takes the frames of the board's end of the conversation.
    pub(crate) fn push(&mut self, frames: Vec<Frame>, now: Duration) {
        for frame in frames {
            self.take(frame, now);
        }
    }

    /// Sends by itself what the board's end of the conversation sends at other times.
    pub(crate) fn tick(&mut self, slave: &Slave, board: &impl SlaveBoard, now: Duration) {
        if let Some((_, result)) = self.awaits.take_if(|(until, _)| *until <= now) {
            self.emit(Some(result), now);
        }
        let every = |span: Option<Duration>| span.filter(|span| !span.is_zero());
        if let Some(every) = every(self.breaches.timing.progress_every) {
            let mut due = Vec::new();
            for running in self.running.iter_mut().filter(|running| running.progress_due <= now) {
                running.progress_due = now + every;
                due.push((running.request, running.message));
            }
            for (request, message) in due {
                let progress = board.progress(self.again_id(request));
                self.emit(frame_of(Kind::Progress, request, message, &progress), now);
            }
        }
        if let Some(every) = every(self.breaches.timing.heartbeat_every)
            && self.beat_due <= now
        {
            self.beat_due = now + every;
            let state = board.state_bits() | u8::from(slave.has_session()) | u8::from(slave.is_busy()) << 2;
            let beat = Heartbeat { boot_id: board.identity().boot_id, board_time_us: board.board_time_us(), state };
            self.beat(frame_of(Kind::Event, 0, event::HEARTBEAT, &beat), now);
        }
    }

    /// The next frame whose time has come.
    pub(crate) fn pop(&mut self, now: Duration) -> Option<Frame> {
        let at = self.held.iter().position(|(due, _)| *due <= now)?;
        let (_, mut frame) = self.held.remove(at)?;
        frame.header.sequence = self.numbers.next();
        self.sent = self.sent.wrapping_add(1);
        Some(frame)
    }

    /// When it has something to do.
    pub(crate) fn next_due(&self) -> Option<Duration> {
        if !self.active {
            return None;
        }
        let timing = &self.breaches.timing;
        let goes = |span: &Duration| !span.is_zero();
        let held = self.held.iter().map(|(due, _)| *due).min();
        let watchdog = timing.watchdog.filter(goes).filter(|_| self.in_session).map(|limit| self.heard + limit);
        let beat = timing.heartbeat_every.filter(goes).map(|_| self.beat_due);
        let progress = self.running.iter().map(|running| running.progress_due).min();
        let progress = progress.filter(|_| timing.progress_every.is_some_and(|every| goes(&every)));
        let awaits = self.awaits.as_ref().map(|(until, _)| *until);
        [held, awaits, watchdog, beat, progress].into_iter().flatten().min()
    }

    fn take(&mut self, mut frame: Frame, now: Duration) {
        if let Some((_, own)) = self.again.iter().find(|(id, _)| *id == frame.header.request) {
            frame.header.request = *own;
        }
        let (request, message) = (frame.header.request, frame.header.message);
        let timing = self.breaches.timing;
        match frame.header.kind {
            Kind::Hello => self.emit(Some(frame), now + timing.hello_after),
            Kind::Accept => {
                if !self.running.iter().any(|running| running.request == request) {
                    let progress_due = now + timing.progress_every.unwrap_or_default();
                    self.running.push(Running { request, message, progress_due });
                }
                let due = now + self.answer_late();
                if self.breaches.talk.answers_nobody == Some(StrangeAnswer::Accept) {
                    self.emit(Some(to_nobody(&frame)), now);
                }
                if !self.breaches.talk.no_accept {
                    self.emit(Some(frame), due);
                }
            }
            Kind::Nak => {
                let due = now + self.answer_late();
                self.emit(Some(frame), due);
            }
            Kind::Progress if timing.progress_every.is_some() => {}
            Kind::Result => self.take_result(frame, now),
            Kind::Event if message == event::HEARTBEAT && timing.heartbeat_every.is_some() => {}
            Kind::Event if message == event::HEARTBEAT => self.beat(Some(frame), now),
            Kind::Stream => {
                self.emit(Some(frame), now);
                if let Some((_, result)) = self.awaits.take() {
                    self.emit(Some(result), now + BEHIND_SAMPLES);
                }
            }
            Kind::Progress | Kind::Event | Kind::Request => self.emit(Some(frame), now),
        }
    }

    fn take_result(&mut self, mut frame: Frame, now: Duration) {
        let (request, message) = (frame.header.request, frame.header.message);
        let talk = self.breaches.talk;
        let is_new = !frame.header.flags.has(Flags::REPLAYED);
        if is_new {
            self.results = self.results.wrapping_add(1);
            self.running.retain(|running| running.request != request);
            if self.ended.len() == KEPT_RESULTS {
                self.ended.pop_front();
            }
            self.ended.push_back((request, message));
        }
        if self.breaches.streams.before_result && is_new && message == StreamStart::ID {
            self.awaits = Some((now + WITHOUT_SAMPLES, frame));
            return;
        }
        if talk.swaps_request_ids && is_new {
            frame.header.request = self.swap(request);
        }
        if talk.answers_nobody == Some(StrangeAnswer::Result) {
            self.emit(Some(to_nobody(&frame)), now);
        }
        let late = if message == MakeSafe::ID { self.breaches.timing.make_safe_after } else { Duration::ZERO };
        let again = talk.double_result.then(|| frame.clone());
        let (request, after) = (frame.header.request, talk.progress_after_result);
        self.emit(Some(frame), now + late);
        self.emit(again, now + late);
        if after {
            let progress = Progress { done_permille: 1000, elapsed_ms: 0 };
            self.emit(frame_of(Kind::Progress, request, message, &progress), now + late);
        }
    }

    /// The id under which the RESULT of a request goes out while another request runs: that of the other one.
    fn swap(&mut self, request: u16) -> u16 {
        if let Some(at) = self.swapped.iter().position(|(of, _)| *of == request) {
            return self.swapped.swap_remove(at).1;
        }
        let Some(other) = self.running.first().map(|running| running.request) else { return request };
        self.swapped.push((other, request));
        other
    }

    /// How late the next ACCEPT or NAK is.
    fn answer_late(&mut self) -> Duration {
        self.accepts = self.accepts.wrapping_add(1);
        let every = self.breaches.timing.accept_late_every.max(1);
        if is_nth(self.accepts, every) { self.breaches.timing.accept_after } else { Duration::ZERO }
    }

    /// The id under which the board knows a request.
    fn again_id(&self, request: u16) -> u16 {
        self.again.iter().rev().find(|(_, own)| *own == request).map_or(request, |(id, _)| *id)
    }

    fn beat(&mut self, frame: Option<Frame>, now: Duration) {
        self.beats = self.beats.saturating_add(1);
        if self.beats > self.breaches.timing.lost_first_heartbeats {
            self.emit(frame, now);
        }
    }

    /// Sends a frame at its time: behind all earlier frames of its request, and samples behind all that waits.
    fn emit(&mut self, frame: Option<Frame>, due: Duration) {
        let Some(mut frame) = frame else { return };
        let (kind, request) = (frame.header.kind, frame.header.request);
        spoil(&self.breaches, &mut frame, self.results);
        let before = |earlier: &Frame| match kind {
            Kind::Stream => true,
            Kind::Event | Kind::Hello => false,
            _ => earlier.header.request == request,
        };
        let waits = self.held.iter().filter(|(_, earlier)| before(earlier)).map(|(due, _)| *due).max();
        self.held.push_back((due.max(waits.unwrap_or_default()), frame));
    }
}

/// The same answer under an id of no request.
fn to_nobody(frame: &Frame) -> Frame {
    let mut strange = frame.clone();
    // No host counts up to here within a session of some minutes, and no id is 0.
    strange.header.request = (frame.header.request ^ 0x8000).max(1);
    strange
}
