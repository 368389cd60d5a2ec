//! The host's end for checks: it sends what a check wants, keeps all that comes with its time, and waits with bounds.

mod call;
mod session;

use std::time::Duration;

use gnc_link::can::Tap;
use gnc_link::{Link, NoFrame, Tape};
use gnc_protocol::can::isotp::FlowSettings;
use gnc_protocol::can::{CanFrame, bus_time, worst_bits};
use gnc_protocol::frame::{CRC, FrameError, HEADER, MAX_PAYLOAD, PROTOCOL_VERSION};
use gnc_protocol::message::{BoardHello, Heartbeat, event};
use gnc_protocol::serial::on_wire;
use gnc_protocol::wire::Wire as _;
use gnc_protocol::{Flags, Frame, Header, Kind, Payload, timing};
use tokio::sync::watch;
use tokio::time::{Instant, sleep_until, timeout};

use crate::raw::{Ending, RawHeader, delimited, frame_bytes, stuff};
use crate::stop::{Stop, Verdict, not_applicable};

/// Bytes of a heartbeat's payload.
const BEAT_BYTES: usize = 13;

pub(crate) use call::{Answer, Asked, End, name_of};
pub(crate) use session::{Begins, HEARTBEAT_WITHIN};

/// What this computer adds to a time on the line: an FTDI adapter holds bytes back for 16 ms, a busy system wakes a
/// program some milliseconds late.
pub(crate) const HOST_ADDS: Duration = Duration::from_millis(20);
/// A board that says nothing for so long is gone: three heartbeats missed (section 9).
const SILENCE: Duration = Duration::from_millis(3500);
/// How much later than that it is noticed.
const LOOK: Duration = Duration::from_millis(1);
/// A message id that no version has; a REQUEST of it gets NAK 2 whatever its payload. Neither of its bytes is zero.
pub(crate) const NO_MESSAGE: u16 = 0x7F7F;
/// Frames that a check may hear: ten times those of the busiest one.
const MOST_HEARD: usize = 100_000;

/// Something that came, and when.
#[derive(Debug, Clone)]
pub(crate) struct Heard {
    pub(crate) at: Instant,
    pub(crate) frame: Result<Frame, FrameError>,
}

impl Heard {
    /// The frame, if it is one of this kind and message.
    pub(crate) fn is(&self, kind: Kind, message: u16) -> bool {
        self.frame.as_ref().is_ok_and(|frame| frame.header.kind == kind && frame.header.message == message)
    }

    /// The frame, if it is one of this kind.
    pub(crate) fn of(&self, kind: Kind) -> Option<&Frame> {
        self.frame.as_ref().ok().filter(|frame| frame.header.kind == kind)
    }
}

/// The host's end.
#[derive(Debug)]
pub(crate) struct Driver {
    link: Link,
    /// The way to test frames of the bus.
    tap: Option<Tap>,
    rate_bps: u32,
    /// Becomes true when a person stops the checks.
    stopped: watch::Receiver<bool>,
    /// Whether a stop ends what is awaited.
    heeds_stop: bool,
    heard: Vec<Heard>,
    last_heard: Instant,
    /// Boot id and board time of the last heartbeat, heartbeats in all, and the first time at which the clock went back.
    clock: Option<(u32, u64)>,
    beats: u32,
    clock_back: Option<(u64, u64)>,
    sequence: u16,
    request: u16,
    nonce: u32,
    /// When the next keep-alive is due; none while the host is silent.
    keep_alive: Option<Instant>,
    /// The answer to the last HELLO that opened a session.
    hello: BoardHello,
    /// Whether checks may change what the module keeps.
    may_change: bool,
    /// Whether a session is open and the module is under power and has answered.
    ready: bool,
}

impl Driver {
    pub(crate) fn new(mut link: Link, rate_bps: u32, nonce: u32, stopped: watch::Receiver<bool>) -> Self {
        let tap = match &mut link {
            Link::Can(link) => link.tap(),
            Link::Serial(_) => None,
        };
        Self {
            link,
            tap,
            rate_bps,
            stopped,
            heeds_stop: true,
            heard: Vec::new(),
            last_heard: Instant::now(),
            clock: None,
            beats: 0,
            clock_back: None,
            sequence: 0,
            request: 0,
            nonce,
            keep_alive: None,
            hello: BoardHello::default(),
            may_change: false,
            ready: false,
        }
    }

    /// Whether the link is CAN.
    pub(crate) fn is_can(&self) -> bool {
        matches!(self.link, Link::Can(_))
    }

    /// The rate of the line, bit/s.
    pub(crate) fn rate_bps(&self) -> u32 {
        self.rate_bps
    }

    /// Ends a check that is about bytes on RS-422, on any other link.
    pub(crate) fn on_rs422(&self) -> Verdict<()> {
        if self.is_can() { not_applicable("section 17 replaces section 3 on CAN") } else { Ok(()) }
    }

    /// The board's answer to the last HELLO that opened a session.
    pub(crate) fn board(&self) -> &BoardHello {
        &self.hello
    }

    /// Whether the board has a capability.
    pub(crate) fn can_do(&self, capability: u32) -> bool {
        self.hello.capabilities & capability != 0
    }

    /// Ends a check that needs a capability which the board does not have.
    pub(crate) fn needs(&self, capability: u32) -> Verdict<()> {
        if self.can_do(capability) {
            return Ok(());
        }
        not_applicable(format!("the board does not have capability bit {}", capability.trailing_zeros()))
    }

    /// Lets checks change what the module keeps: it is simulated.
    pub(crate) fn let_change_module(&mut self) {
        self.may_change = true;
    }

    /// Whether checks may change what the module keeps.
    pub(crate) fn may_change_module(&self) -> bool {
        self.may_change
    }

    /// What came since the check began.
    pub(crate) fn heard(&self) -> &[Heard] {
        &self.heard
    }

    /// Where to begin to look for what comes from now on.
    pub(crate) fn mark(&self) -> usize {
        self.heard.len()
    }

    /// Begins to keep bytes or frames of the bus as they come.
    pub(crate) fn begin_tape(&mut self) {
        self.link.begin_tape();
    }

    pub(crate) fn tape(&self) -> &Tape {
        self.link.tape()
    }

    /// Time that a frame with this payload needs on the line, `t(n)` of the document.
    pub(crate) fn line_time(&self, payload: usize) -> Duration {
        if self.is_can() {
            let frames = (HEADER + payload + CRC).div_ceil(7) as u64 + 2;
            return bus_time(frames * u64::from(worst_bits(false, 8)));
        }
        timing::wire_time(on_wire(payload), self.rate_bps)
    }

    /// Longest time from the moment a request is handed to the line to its ACCEPT or NAK here: the request, one frame
    /// that the transmitter already has, 50 ms, the answer, and what this computer adds.
    pub(crate) fn accept_limit(&self, request: usize, answer: usize) -> Duration {
        self.line_time(request)
            + self.line_time(MAX_PAYLOAD)
            + timing::ACCEPT_WITHIN
            + self.line_time(answer)
            + HOST_ADDS
    }

    /// The same where no stream runs: only a heartbeat may be in the way.
    pub(crate) fn quiet_accept_limit(&self, request: usize, answer: usize) -> Duration {
        let beat = if self.is_can() { Duration::ZERO } else { self.line_time(BEAT_BYTES) };
        self.line_time(request) + beat + timing::ACCEPT_WITHIN + self.line_time(answer) + HOST_ADDS
    }

    /// Sends a keep-alive now, so that none goes out by itself in the next half second.
    pub(crate) fn keep_alive_now(&mut self) {
        self.send_keep_alive();
        self.keep_alive = Some(Instant::now() + timing::KEEP_ALIVE_EVERY);
    }

    /// Lets no sign of life go out from now on.
    pub(crate) fn fall_silent(&mut self) {
        self.keep_alive = None;
        self.ready = false;
    }

    /// Says that the module may have lost its power or its session.
    pub(crate) fn disturb(&mut self) {
        self.ready = false;
    }

    /// A stop by a person no longer ends what is awaited: the board is to be made safe.
    pub(crate) fn heed_no_stop(&mut self) {
        self.heeds_stop = false;
    }

    /// Sends a frame of a known kind. The sequence number is the next one.
    pub(crate) fn send(&mut self, header: RawHeader, payload: &[u8]) {
        if !self.is_can() {
            let bytes = frame_bytes(header, self.take_sequence(), payload);
            self.send_bytes(&delimited(&stuff(&bytes, Ending::Bare)));
            return;
        }
        let RawHeader { version, flags, request, message, .. } = header;
        let (Some(kind), Ok(payload)) = (Kind::from_number(header.kind), Payload::from_slice(payload)) else { return };
        let header = Header { version, kind, flags: Flags(flags), request, message, sequence: 0 };
        self.link.send(&Frame { header, payload });
    }

    /// Sends an EVENT.
    pub(crate) fn send_event(&mut self, version: u8, message: u16, payload: &[u8]) {
        self.send(RawHeader { version, kind: Kind::Event as u8, flags: 0, request: 0, message }, payload);
    }

    /// Sends a keep-alive now.
    pub(crate) fn send_keep_alive(&mut self) {
        self.send_event(PROTOCOL_VERSION, event::KEEP_ALIVE, &[]);
    }

    /// Sends bytes as they stand, on RS-422.
    pub(crate) fn send_bytes(&mut self, bytes: &[u8]) {
        self.link.send_bytes(bytes);
    }

    /// Sends a frame of the bus as it stands.
    pub(crate) fn send_can(&mut self, frame: CanFrame) {
        self.link.send_can(frame);
    }

    /// The sequence number of a frame that is made by hand.
    pub(crate) fn take_sequence(&mut self) -> u16 {
        let sequence = self.sequence;
        self.sequence = self.sequence.wrapping_add(1);
        sequence
    }

    /// Numbers the next frame so.
    pub(crate) fn set_sequence(&mut self, sequence: u16) {
        self.sequence = sequence;
    }

    /// Waits until something has come, or until this moment.
    async fn turn(&mut self, until: Instant) -> Verdict<()> {
        loop {
            let now = Instant::now();
            if now.saturating_duration_since(self.last_heard) > SILENCE {
                return Err(Stop::Silent(now - self.last_heard));
            }
            if self.keep_alive.is_some_and(|due| due <= now) {
                self.send_keep_alive();
                self.keep_alive = Some(now + timing::KEEP_ALIVE_EVERY);
            }
            let wake = until.min(self.keep_alive.unwrap_or(until)).min(self.last_heard + SILENCE + LOOK);
            let event = tokio::select! {
                biased;
                _ = self.stopped.wait_for(|stopped| *stopped), if self.heeds_stop => return Err(Stop::Cancelled),
                event = self.link.next(true) => event.map_err(|error| Stop::Gone(error.to_string()))?,
                () = sleep_until(wake) => {
                    if Instant::now() >= until {
                        return Ok(());
                    }
                    continue;
                }
            };
            let at = Instant::now();
            // Bytes that are no frame are no silence: it is another fault.
            self.last_heard = at;
            let frame = match event {
                Ok(frame) => Ok(frame),
                Err(NoFrame::Damaged { error, .. }) => Err(error),
                Err(NoFrame::Away) => return Err(Stop::Gone(format!("{} went away", self.link.name()))),
                Err(NoFrame::Back { .. }) => continue,
            };
            self.look_at_clock(&frame);
            if self.heard.len() < MOST_HEARD {
                self.heard.push(Heard { at, frame });
            }
            return Ok(());
        }
    }

    /// Keeps the first case in which board time went back under one boot id.
    fn look_at_clock(&mut self, frame: &Result<Frame, FrameError>) {
        let Some(beat) =
            frame.as_ref().ok().filter(|frame| frame.header.message == event::HEARTBEAT).and_then(|frame| {
                (frame.header.kind == Kind::Event).then(|| Heartbeat::from_payload(&frame.payload).ok())?
            })
        else {
            return;
        };
        if let Some((boot_id, before_us)) = self.clock.replace((beat.boot_id, beat.board_time_us))
            && boot_id == beat.boot_id
            && beat.board_time_us < before_us
        {
            self.clock_back.get_or_insert((before_us, beat.board_time_us));
        }
        self.beats = self.beats.saturating_add(1);
    }

    /// Heartbeats since the checks began, and the board times in microseconds between which the clock went back, if it did.
    pub(crate) fn clock_of_all(&self) -> (u32, Option<(u64, u64)>) {
        (self.beats, self.clock_back)
    }

    /// Waits at most so long for something behind `from` that is wanted; its place.
    pub(crate) async fn until(
        &mut self,
        from: usize,
        within: Duration,
        mut wanted: impl FnMut(&Heard) -> bool,
    ) -> Verdict<Option<usize>> {
        let end = Instant::now() + within;
        let mut next = from;
        loop {
            while let Some(heard) = self.heard.get(next) {
                if wanted(heard) {
                    return Ok(Some(next));
                }
                next += 1;
            }
            if Instant::now() >= end {
                return Ok(None);
            }
            self.turn(end).await?;
        }
    }

    /// Keeps listening for this time.
    pub(crate) async fn listen(&mut self, span: Duration) -> Verdict<()> {
        self.until(self.mark(), span, |_| false).await.map(|_| ())
    }

    /// What came behind `from`, in words.
    pub(crate) fn came(&self, from: usize) -> String {
        let mut counts: Vec<(String, usize)> = Vec::new();
        for heard in self.heard.get(from..).unwrap_or_default() {
            let what = match &heard.frame {
                Ok(frame) if frame.header.kind == Kind::Event && frame.header.message == event::HEARTBEAT => {
                    "heartbeat".to_owned()
                }
                Ok(frame) => format!("{} of message 0x{:04X}", kind_name(frame.header.kind), frame.header.message),
                Err(FrameError::Checksum { .. }) => "frame with a wrong checksum".to_owned(),
                Err(error) => format!("bytes that are no frame ({error})"),
            };
            match counts.iter_mut().find(|(name, _)| *name == what) {
                Some((_, count)) => *count += 1,
                None => counts.push((what, 1)),
            }
        }
        if counts.is_empty() {
            return "nothing came".to_owned();
        }
        let words: Vec<String> = counts.iter().map(|(what, count)| format!("{count} x {what}")).collect();
        format!("came: {}", words.join(", "))
    }

    /// Begins to count the board's silence anew.
    pub(crate) fn forgive_silence(&mut self) {
        self.last_heard = Instant::now();
    }

    /// Asks the board for blocks of this many frames and for pauses between them, on CAN.
    pub(crate) fn ask_for(&mut self, settings: FlowSettings) {
        if let Link::Can(link) = &mut self.link {
            link.ask_for(settings);
        }
    }

    /// Sends test frames on the bus; those that came back within this time, in their order.
    pub(crate) async fn test_frames(&mut self, sent: &[CanFrame], within: Duration) -> Verdict<Vec<CanFrame>> {
        let Some(tap) = self.tap.take() else { return Ok(Vec::new()) };
        tap.drain().await;
        for frame in sent {
            // The bus takes it while this end listens.
            if tap.send(*frame).await.is_err() {
                return Err(Stop::Gone("the bus was closed".to_owned()));
            }
        }
        let listened = self.listen(within).await;
        let mut came = Vec::new();
        while let Ok(Ok(frame)) = timeout(Duration::ZERO, tap.receive()).await {
            came.push(frame);
        }
        self.tap = Some(tap);
        listened.map(|()| came)
    }

    /// Leaves the line in a clean state.
    pub(crate) async fn close(self) {
        self.link.close().await;
    }
}

/// The name of a kind of frame, as the document writes it.
pub(crate) fn kind_name(kind: Kind) -> &'static str {
    match kind {
        Kind::Hello => "HELLO",
        Kind::Request => "REQUEST",
        Kind::Accept => "ACCEPT",
        Kind::Progress => "PROGRESS",
        Kind::Result => "RESULT",
        Kind::Stream => "STREAM",
        Kind::Event => "EVENT",
        Kind::Nak => "NAK",
    }
}

/// Milliseconds for people, one digit behind the point.
pub(crate) fn ms(span: Duration) -> String {
    format!("{:.1} ms", span.as_secs_f64() * 1e3)
}
