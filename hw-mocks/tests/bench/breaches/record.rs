//! A scripted host that keeps what a board says, with its times.

use std::time::Duration;

use gnc_protocol::Call;
use gnc_protocol::can::CanFrame;
use gnc_protocol::can::endpoint::{Endpoint, EndpointRole};
use gnc_protocol::frame::{Flags, Frame, Header, Kind, Payload};
use gnc_protocol::message::{Heartbeat, HostHello, MAGIC, event};
use gnc_protocol::serial::{FrameDecoder, encode};
use gnc_protocol::wire::Wire;
use hw_mocks::{SimulatedBench, Speed};

use crate::host::options;

/// A link between host and board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Link {
    Serial,
    Can,
}

pub(crate) const BOTH: [Link; 2] = [Link::Serial, Link::Can];

/// What a host allows for the way of a short frame: on CAN a message shares the bus with samples.
pub(crate) const WAY: Duration = Duration::from_millis(10);

pub(crate) const fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

/// A frame and the link time at which it was sent or came.
#[derive(Debug, Clone)]
pub(crate) struct Noted {
    pub(crate) at: Duration,
    pub(crate) frame: Frame,
}

/// A host at a board at true speed, and its record.
pub(crate) struct Record {
    pub(crate) link: Link,
    bench: SimulatedBench,
    pub(crate) now: Duration,
    endpoint: Endpoint,
    decoder: FrameDecoder,
    keep_alive_at: Option<Duration>,
    /// The last time at which the host let the board know that it lives.
    pub(crate) alive_at: Duration,
    pub(crate) sent: Vec<Noted>,
    pub(crate) came: Vec<Noted>,
    /// Bytes between delimiters, or transfers on CAN, that are no frames.
    pub(crate) broken: u32,
    /// All bytes of RS-422.
    pub(crate) bytes: Vec<u8>,
    /// All frames of CAN.
    pub(crate) can_frames: Vec<CanFrame>,
    /// When the module's supply changed, and to what.
    pub(crate) power: Vec<(Duration, bool)>,
    request: u16,
}

impl Record {
    pub(crate) fn new(personality: &str, link: Link) -> Self {
        Self {
            link,
            bench: SimulatedBench::new(&options(personality, Speed::Times(1.0))),
            now: Duration::ZERO,
            endpoint: Endpoint::new(EndpointRole::Host),
            decoder: FrameDecoder::default(),
            keep_alive_at: None,
            alive_at: Duration::ZERO,
            sent: Vec::new(),
            came: Vec::new(),
            broken: 0,
            bytes: Vec::new(),
            can_frames: Vec::new(),
            power: Vec::new(),
            request: 0,
        }
    }

    pub(crate) fn hello(&mut self, nonce: u32) {
        let hello = HostHello { magic: MAGIC, lowest: 1, highest: 1, nonce };
        self.keep_alive_at = Some(self.now + ms(500));
        self.send(Kind::Hello, 1, 0, hello.to_payload().unwrap());
    }

    /// Sends a request under a new id and returns the id.
    pub(crate) fn post<C: Call>(&mut self, call: &C) -> u16 {
        self.request += 1;
        self.again(self.request, call);
        self.request
    }

    /// Sends a request under an id that was used before.
    pub(crate) fn again<C: Call>(&mut self, request: u16, call: &C) {
        self.send(Kind::Request, request, C::ID, call.to_payload().unwrap());
    }

    pub(crate) fn send(&mut self, kind: Kind, request: u16, message: u16, payload: Payload) {
        let version = u8::from(kind != Kind::Hello);
        let header = Header { version, kind, flags: Flags::default(), request, message, sequence: 0 };
        let frame = Frame { header, payload };
        let (bench, now) = (&mut self.bench, self.now);
        match self.link {
            Link::Serial => bench.receive(&encode(&frame), now),
            Link::Can => self.endpoint.send(&frame, &mut |raw| bench.receive_can(raw, now)),
        }
        self.alive_at = now;
        self.sent.push(Noted { at: now, frame });
    }

    /// Falls silent.
    pub(crate) fn fall_silent(&mut self) {
        self.keep_alive_at = None;
    }

    /// Lets link time pass.
    pub(crate) fn run(&mut self, span: Duration) {
        let end = self.now + span;
        loop {
            let own = [self.keep_alive_at, self.endpoint.next_due()].into_iter().flatten().min().unwrap_or(end);
            let due = self.bench.next_due(self.now).min(own);
            self.now = due.max(self.now + Duration::from_micros(20)).min(end);
            if self.keep_alive_at.is_some_and(|at| at <= self.now) {
                self.keep_alive_at = Some(self.now + ms(500));
                self.send(Kind::Event, 0, event::KEEP_ALIVE, Payload::new());
            }
            self.look();
            if self.now >= end {
                return;
            }
        }
    }

    fn look(&mut self) {
        while let Some(frame) = self.endpoint.poll(self.now) {
            self.bench.receive_can(frame, self.now);
        }
        self.bench.advance(self.now);
        let bytes = self.bench.output(self.now).to_vec();
        self.bench.consume(bytes.len());
        let mut rest = bytes.as_slice();
        while let Some(frame) = self.decoder.next(&mut rest) {
            if self.link == Link::Serial {
                self.note(frame.ok());
            }
        }
        self.bytes.extend(bytes);
        while let Some(frame) = self.bench.output_can() {
            self.can_frames.push(frame);
            if let Some(frame) = self.endpoint.receive(&frame, self.now)
                && self.link == Link::Can
            {
                self.note(frame.ok());
            }
        }
        let powered = self.bench.is_powered();
        if self.power.last().is_some_and(|(_, last)| *last) != powered {
            self.power.push((self.now, powered));
        }
    }

    fn note(&mut self, frame: Option<Frame>) {
        match frame {
            Some(frame) => self.came.push(Noted { at: self.now, frame }),
            None => self.broken += 1,
        }
    }

    /// Frames of a kind that came.
    pub(crate) fn of(&self, kind: Kind) -> impl Iterator<Item = &Noted> {
        self.came.iter().filter(move |noted| noted.frame.header.kind == kind)
    }

    /// What came for a request.
    pub(crate) fn answers(&self, request: u16) -> Vec<&Noted> {
        let answers = |noted: &&Noted| {
            let header = noted.frame.header;
            header.request == request && !matches!(header.kind, Kind::Hello | Kind::Event | Kind::Stream)
        };
        self.came.iter().filter(answers).collect()
    }

    /// The heartbeats that came.
    pub(crate) fn beats(&self) -> Vec<(Duration, Heartbeat)> {
        let events = self.of(Kind::Event).filter(|noted| noted.frame.header.message == event::HEARTBEAT);
        events.filter_map(|noted| Some((noted.at, Heartbeat::from_payload(&noted.frame.payload).ok()?))).collect()
    }

    /// The requests that were sent, without those sent again: time, id and message.
    pub(crate) fn requests(&self) -> Vec<(Duration, u16, u16)> {
        let mut requests: Vec<(Duration, u16, u16)> = Vec::new();
        for Noted { at, frame } in &self.sent {
            let header = frame.header;
            if header.kind == Kind::Request && !requests.iter().any(|(_, id, _)| *id == header.request) {
                requests.push((*at, header.request, header.message));
            }
        }
        requests
    }
}
