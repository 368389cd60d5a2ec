//! The board's end of the conversation: sessions, acceptance, replay of results, progress, heartbeat, watchdog.
//!
//! [`SlaveBoard`] is the part that differs from board to board. [`Slave`] is the same on all boards, the simulated one
//! too.

use core::time::Duration;

use heapless::Vec;

use crate::error::{FaultCode, NakCode};
use crate::frame::{Flags, Frame, Header, Kind, PROTOCOL_VERSION, Payload};
use crate::message::{
    Abort, AbortReply, Accept, BoardHello, Call, Heartbeat, HostHello, MAGIC, MakeSafe, Nak, Progress, Request,
    ResultHead, event,
};
use crate::stream::{StreamFrame, StreamId, stream_header};
use crate::timing;
use crate::wire::{FieldWriter, Text, Wire, text};

/// Requests that may run at once. The board refuses one more as busy.
pub const MAX_RUNNING: usize = 4;
/// Results kept for a host that missed them.
pub const KEPT_RESULTS: usize = 8;

/// The identity of a board.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BoardIdentity {
    /// Random at each start.
    pub boot_id: u32,
    /// Bits of [`crate::message::capability`].
    pub capabilities: u32,
    /// Serial number of the board.
    pub serial: Text<32>,
    /// Firmware of the board.
    pub firmware: Text<32>,
}

/// A refusal. The request was not started.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RequestRefusal {
    /// Why.
    pub code: NakCode,
    /// For people.
    pub text: Text<160>,
}

impl RequestRefusal {
    /// Makes a refusal with its text (cut to 160 bytes).
    #[must_use]
    pub fn new(code: NakCode, why: &str) -> Self {
        Self { code, text: text(why) }
    }
}

/// A request that ended.
#[derive(Debug, Clone, PartialEq)]
pub struct RequestDone {
    /// The host's number for it.
    pub request: u16,
    /// Board time it took.
    pub elapsed_us: u32,
    /// The body of its RESULT, or why it has none.
    pub outcome: Result<Payload, RequestFault>,
}

/// Why a started request failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RequestFault {
    /// Why; never [`FaultCode::None`].
    pub code: FaultCode,
    /// For people.
    pub text: Text<160>,
}

/// An event or samples from a board.
#[derive(Debug, Clone, PartialEq)]
pub enum BoardOutput {
    /// A request ended.
    Done(RequestDone),
    /// Samples to send.
    Stream(StreamId, StreamFrame),
}

/// A slave board with a module in its socket.
pub trait SlaveBoard {
    /// The board's identity.
    fn identity(&self) -> BoardIdentity;

    /// Starts a request. Returns how long it will take in board time (ms). Its end is a [`BoardOutput::Done`].
    /// MAKE_SAFE and ABORT never come here.
    ///
    /// # Errors
    /// A [`RequestRefusal`] when it cannot be started.
    fn start(&mut self, request: u16, what: Request) -> Result<u32, RequestRefusal>;

    /// The next output, if there is one.
    fn poll(&mut self) -> Option<BoardOutput>;

    /// The progress of a running request.
    fn progress(&self, request: u16) -> Progress;

    /// Drops a running request and stops its work.
    fn abort(&mut self, request: u16);

    /// Stops all work and all streams, releases the lines, switches the module off.
    fn make_safe(&mut self);

    /// Drops data that belongs to a session: the error records.
    fn new_session(&mut self);

    /// Board time in microseconds since its start.
    fn board_time_us(&self) -> u64;

    /// Bits 1 and 3 of [`Heartbeat::state`].
    fn state_bits(&self) -> u8;
}

#[derive(Debug)]
struct Running {
    request: u16,
    message: u16,
    expected_ms: u32,
    progress_due: Duration,
}

#[derive(Debug)]
struct Kept {
    request: u16,
    message: u16,
    payload: Payload,
}

/// The board's end of the conversation. Times are link time: wall time since any fixed moment.
#[derive(Debug, Default)]
pub struct Slave {
    session: Option<u32>,
    running: Vec<Running, MAX_RUNNING>,
    kept: Vec<Kept, KEPT_RESULTS>,
    sequence: u16,
    heard: Duration,
    heartbeat_due: Duration,
    sent: u32,
}

impl Slave {
    /// Frames sent since the start.
    #[must_use]
    pub fn sent(&self) -> u32 {
        self.sent
    }

    /// Whether a host holds a session.
    #[must_use]
    pub fn has_session(&self) -> bool {
        self.session.is_some()
    }

    /// Whether requests are running.
    #[must_use]
    pub fn is_busy(&self) -> bool {
        !self.running.is_empty()
    }

    /// The host came back on another link. This end drops its session, and the other end makes the board safe.
    pub fn leave(&mut self) {
        self.running.clear();
        self.kept.clear();
        self.session = None;
    }

    /// Takes a frame from the host and sends the immediate answer.
    pub fn receive(&mut self, frame: &Frame, now: Duration, board: &mut impl SlaveBoard, send: &mut impl FnMut(Frame)) {
        let in_force = frame.header.version == PROTOCOL_VERSION;
        match frame.header.kind {
            Kind::Hello => self.hello(frame, now, board, send),
            Kind::Request => {
                // A refused request is a sign of life too. A request of another version only gets a NAK.
                if in_force {
                    self.heard = now;
                }
                self.request(frame, now, board, send);
            }
            Kind::Event if in_force && frame.header.message == event::KEEP_ALIVE => self.heard = now,
            // Only a board sends these: an echo on the line, or another board. An echo of this board's heartbeat must
            // not count as a living host.
            Kind::Event | Kind::Accept | Kind::Progress | Kind::Result | Kind::Stream | Kind::Nak => {}
        }
    }

    /// Excludes `span` of the time up to `now` from the watchdog's count. A simulator calls this after it stood still
    /// together with its host.
    pub fn excuse(&mut self, span: Duration, now: Duration) {
        self.heard = (self.heard + span).min(now).max(self.heard);
    }

    /// Sends everything that is due: results, samples, progress, heartbeat. Ends the session of a host that fell
    /// silent.
    pub fn tick(&mut self, now: Duration, board: &mut impl SlaveBoard, send: &mut impl FnMut(Frame)) {
        while self.session.is_some()
            && let Some(output) = board.poll()
        {
            match output {
                BoardOutput::Done(done) => self.finish(&done, send),
                BoardOutput::Stream(stream, frame) => {
                    if let Ok(payload) = frame.to_payload() {
                        self.send(stream_header(stream), payload, send);
                    }
                }
            }
        }
        for index in 0..self.running.len() {
            let running = &mut self.running[index];
            if now >= running.progress_due {
                running.progress_due = now + timing::PROGRESS_EVERY * 4 / 5;
                let (request, message) = (running.request, running.message);
                self.reply(Kind::Progress, request, message, &board.progress(request), send);
            }
        }
        if self.session.is_some() && now.saturating_sub(self.heard) >= timing::WATCHDOG {
            self.end_session(board);
            self.reply(Kind::Event, 0, event::WATCHDOG, &(), send);
        }
        if now >= self.heartbeat_due {
            self.heartbeat_due = now + timing::HEARTBEAT_EVERY;
            let state = board.state_bits() | u8::from(self.has_session()) | u8::from(self.is_busy()) << 2;
            let beat = Heartbeat { boot_id: board.identity().boot_id, board_time_us: board.board_time_us(), state };
            self.reply(Kind::Event, 0, event::HEARTBEAT, &beat, send);
        }
    }

    /// The next moment at which [`Slave::tick`] has something to do by itself.
    #[must_use]
    pub fn next_due(&self) -> Duration {
        let watchdog = self.session.map(|_| self.heard + timing::WATCHDOG);
        let progress = self.running.iter().map(|running| running.progress_due).min();
        [watchdog, progress].into_iter().flatten().fold(self.heartbeat_due, Duration::min)
    }

    fn hello(&mut self, frame: &Frame, now: Duration, board: &mut impl SlaveBoard, send: &mut impl FnMut(Frame)) {
        let Ok(hello) = HostHello::from_payload(&frame.payload) else { return };
        if hello.magic != MAGIC {
            return;
        }
        self.heard = now;
        let common = (hello.lowest..=hello.highest).contains(&PROTOCOL_VERSION);
        if !common {
            self.end_session(board);
        } else if self.session != Some(hello.nonce) {
            self.end_session(board);
            board.new_session();
            self.session = Some(hello.nonce);
        }
        let who = board.identity();
        let answer = BoardHello {
            magic: MAGIC,
            chosen: if common { PROTOCOL_VERSION } else { 0 },
            lowest: PROTOCOL_VERSION,
            highest: PROTOCOL_VERSION,
            nonce: hello.nonce,
            boot_id: who.boot_id,
            capabilities: who.capabilities,
            serial: who.serial,
            firmware: who.firmware,
        };
        self.reply(Kind::Hello, frame.header.request, 0, &answer, send);
    }

    fn request(&mut self, frame: &Frame, now: Duration, board: &mut impl SlaveBoard, send: &mut impl FnMut(Frame)) {
        let Header { request, message, version, .. } = frame.header;
        if self.session.is_none() {
            return self.nak(request, message, &RequestRefusal::new(NakCode::NoSession, "send HELLO first"), send);
        }
        if version != PROTOCOL_VERSION {
            return self.nak(
                request,
                message,
                &RequestRefusal::new(NakCode::UnknownMessage, "frame of another version"),
                send,
            );
        }
        match self.running.iter().find(|running| running.request == request) {
            Some(running) if running.message == message => {
                let expected_ms = running.expected_ms;
                return self.reply(Kind::Accept, request, message, &Accept { expected_ms }, send);
            }
            // MAKE_SAFE ends the other request, so its id becomes free.
            Some(_) if message != MakeSafe::ID => {
                let refusal = RequestRefusal::new(NakCode::BadParameter, "another request runs under this id");
                return self.nak(request, message, &refusal, send);
            }
            _ => {}
        }
        if let Some(kept) = self.kept.iter().find(|kept| kept.request == request && kept.message == message) {
            let (header, payload) = (header(Kind::Result, Flags::REPLAYED, request, message), kept.payload.clone());
            return self.send(header, payload, send);
        }
        let what = match Request::decode(message, &frame.payload) {
            None => return self.nak(request, message, &RequestRefusal::new(NakCode::UnknownMessage, ""), send),
            Some(Err(error)) => {
                let mut why = Text::<160>::new();
                let _ = core::fmt::write(&mut why, format_args!("{error}"));
                return self.nak(request, message, &RequestRefusal { code: NakCode::BadPayload, text: why }, send);
            }
            Some(Ok(what)) => what,
        };
        match what {
            Request::MakeSafe(_) => {
                self.abort_all(board, send);
                board.make_safe();
                self.at_once(request, MakeSafe::ID, &(), send);
            }
            Request::Abort(Abort { request: target }) => {
                let was_running = self.abort_one(target, board, send);
                self.at_once(request, Abort::ID, &AbortReply { was_running: u8::from(was_running) }, send);
            }
            _ if self.running.is_full() => {
                self.nak(request, message, &RequestRefusal::new(NakCode::Busy, "four requests are running"), send);
            }
            what => match board.start(request, what) {
                Err(refusal) => self.nak(request, message, &refusal, send),
                Ok(expected_ms) => {
                    let progress_due = now + timing::PROGRESS_EVERY * 4 / 5;
                    // There is room: `is_full` is checked above.
                    let _ = self.running.push(Running { request, message, expected_ms, progress_due });
                    self.reply(Kind::Accept, request, message, &Accept { expected_ms }, send);
                }
            },
        }
    }

    fn at_once(&mut self, request: u16, message: u16, body: &impl Wire, send: &mut impl FnMut(Frame)) {
        self.reply(Kind::Accept, request, message, &Accept::default(), send);
        let outcome = body.to_payload().map_err(|_| RequestFault { code: FaultCode::DeviceFault, text: Text::new() });
        self.result(request, message, 0, &outcome, send);
    }

    fn finish(&mut self, done: &RequestDone, send: &mut impl FnMut(Frame)) {
        let Some(index) = self.running.iter().position(|running| running.request == done.request) else { return };
        let running = self.running.swap_remove(index);
        self.result(running.request, running.message, done.elapsed_us, &done.outcome, send);
    }

    fn result(
        &mut self,
        request: u16,
        message: u16,
        elapsed_us: u32,
        outcome: &Result<Payload, RequestFault>,
        send: &mut impl FnMut(Frame),
    ) {
        let mut writer = FieldWriter::default();
        let status = outcome.as_ref().map_or_else(|fault| fault.code, |_| FaultCode::None);
        let written = ResultHead { status, elapsed_us }.put(&mut writer).and_then(|()| match outcome {
            Ok(body) => writer.bytes(body),
            Err(fault) => fault.text.put(&mut writer),
        });
        // The layouts bound the bodies to less than a payload; `docs/ICD.md` and a test check this.
        if written.is_err() {
            return;
        }
        let payload = writer.finish();
        if self.kept.is_full() {
            self.kept.remove(0);
        }
        let _ = self.kept.push(Kept { request, message, payload: payload.clone() });
        self.send(header(Kind::Result, Flags::default(), request, message), payload, send);
    }

    fn abort_one(&mut self, target: u16, board: &mut impl SlaveBoard, send: &mut impl FnMut(Frame)) -> bool {
        let Some(index) = self.running.iter().position(|running| running.request == target) else { return false };
        let running = self.running.swap_remove(index);
        board.abort(target);
        let fault = RequestFault { code: FaultCode::Aborted, text: Text::new() };
        self.result(running.request, running.message, 0, &Err(fault), send);
        true
    }

    fn abort_all(&mut self, board: &mut impl SlaveBoard, send: &mut impl FnMut(Frame)) {
        while let Some(request) = self.running.first().map(|running| running.request) {
            self.abort_one(request, board, send);
        }
    }

    /// Drops all data of the session, the results too. Aborted requests get no answer, since there is no host.
    fn end_session(&mut self, board: &mut impl SlaveBoard) {
        for running in &self.running {
            board.abort(running.request);
        }
        self.running.clear();
        self.kept.clear();
        self.session = None;
        board.make_safe();
    }

    fn nak(&mut self, request: u16, message: u16, refusal: &RequestRefusal, send: &mut impl FnMut(Frame)) {
        let nak = Nak { code: refusal.code as u16, text: refusal.text.clone() };
        self.reply(Kind::Nak, request, message, &nak, send);
    }

    fn reply(&mut self, kind: Kind, request: u16, message: u16, body: &impl Wire, send: &mut impl FnMut(Frame)) {
        if let Ok(payload) = body.to_payload() {
            self.send(header(kind, Flags::default(), request, message), payload, send);
        }
    }

    fn send(&mut self, mut header: Header, payload: Payload, send: &mut impl FnMut(Frame)) {
        header.sequence = self.sequence;
        self.sequence = self.sequence.wrapping_add(1);
        self.sent = self.sent.wrapping_add(1);
        send(Frame { header, payload });
    }
}

fn header(kind: Kind, flags: Flags, request: u16, message: u16) -> Header {
    let version = if kind == Kind::Hello { 0 } else { PROTOCOL_VERSION };
    Header { version, kind, flags, request, message, sequence: 0 }
}
