//! A host that talks to a bench in memory, under a virtual clock.

use std::time::Duration;

use gnc_protocol::Call;
use gnc_protocol::frame::{Flags, Frame, Header, Kind, Payload};
use gnc_protocol::message::{HostHello, MAGIC, ModulePower, Nak, ResultHead, event};
use gnc_protocol::serial::{FrameDecoder, encode};
use gnc_protocol::stream::StreamFrame;
use gnc_protocol::wire::Wire;
use hw_mocks::{BenchOptions, Personality, SimulatedBench, Speed};

/// Virtual link time after which a test gives up.
const PATIENCE: Duration = Duration::from_secs(120);

pub(crate) struct Host {
    pub(crate) bench: SimulatedBench,
    pub(crate) now: Duration,
    pub(crate) frames: Vec<Frame>,
    decoder: FrameDecoder,
    keep_alive_at: Duration,
    pub(crate) request: u16,
}

/// A RESULT: its head and the bytes after it, or a NAK.
pub(crate) type Answer = Result<(ResultHead, Payload), Nak>;

pub(crate) fn options(personality: &str, speed: Speed) -> BenchOptions {
    let personality = if personality.contains('\n') || personality.is_empty() {
        Personality::from_toml("test", personality).unwrap()
    } else {
        Personality::named(personality).unwrap()
    };
    let options = BenchOptions { personality, speed, seed: 20_261_122, ..BenchOptions::default() };
    println!("seed {}", options.seed);
    options
}

impl Host {
    /// A host with a session on a bench at maximum speed.
    pub(crate) fn new(personality: &str) -> Self {
        Self::with(&options(personality, Speed::Max))
    }

    pub(crate) fn powered(personality: &str) -> Self {
        let mut host = Self::new(personality);
        host.ask(&ModulePower { on: 1 });
        host
    }

    pub(crate) fn with(options: &BenchOptions) -> Self {
        let mut host = Self::without_session(options);
        host.hello(1);
        host
    }

    pub(crate) fn without_session(options: &BenchOptions) -> Self {
        Self {
            bench: SimulatedBench::new(options),
            now: Duration::ZERO,
            frames: Vec::new(),
            decoder: FrameDecoder::default(),
            keep_alive_at: Duration::ZERO,
            request: 0,
        }
    }

    pub(crate) fn hello(&mut self, nonce: u32) {
        let hello = HostHello { magic: MAGIC, lowest: 1, highest: 1, nonce };
        self.send(Kind::Hello, 0, 0, hello.to_payload().unwrap());
        self.run_until(|frame| frame.header.kind == Kind::Hello);
    }

    pub(crate) fn send(&mut self, kind: Kind, request: u16, message: u16, payload: Payload) {
        let version = u8::from(kind != Kind::Hello);
        let header = Header { version, kind, flags: Flags::default(), request, message, sequence: 0 };
        let bytes = encode(&Frame { header, payload });
        self.bench.receive(&bytes, self.now);
    }

    /// One turn of the bench; returns the frames that came.
    pub(crate) fn turn(&mut self) -> Vec<Frame> {
        let due = self.bench.next_due(self.now).min(self.keep_alive_at);
        self.now = self.now.max(due);
        if self.now >= self.keep_alive_at {
            self.keep_alive_at = self.now + Duration::from_millis(500);
            self.send(Kind::Event, 0, event::KEEP_ALIVE, Payload::new());
        }
        self.bench.advance(self.now);
        let bytes = self.bench.output(self.now).to_vec();
        self.bench.consume(bytes.len());
        let mut rest = bytes.as_slice();
        let mut came = Vec::new();
        while let Some(frame) = self.decoder.next(&mut rest) {
            came.push(frame.unwrap());
        }
        came
    }

    /// Runs until a wanted frame comes; keeps all frames that came.
    pub(crate) fn run_until(&mut self, wanted: impl Fn(&Frame) -> bool) -> Frame {
        let end = self.now + PATIENCE;
        while self.now < end {
            let came = self.turn();
            let found = came.iter().find(|frame| wanted(frame)).cloned();
            self.frames.extend(came);
            if let Some(frame) = found {
                return frame;
            }
        }
        panic!("nothing came within {PATIENCE:?} of link time");
    }

    /// Sends a request and returns its number at once.
    pub(crate) fn post<C: Call>(&mut self, call: &C) -> u16 {
        self.request += 1;
        self.send(Kind::Request, self.request, C::ID, call.to_payload().unwrap());
        self.request
    }

    pub(crate) fn wait(&mut self, request: u16) -> Answer {
        let is_answer = move |frame: &Frame| {
            frame.header.request == request && matches!(frame.header.kind, Kind::Result | Kind::Nak)
        };
        let frame = self.run_until(is_answer);
        if frame.header.kind == Kind::Nak {
            return Err(Nak::from_payload(&frame.payload).unwrap());
        }
        let (head, body) = frame.payload.split_at(6);
        Ok((ResultHead::from_payload(head).unwrap(), Payload::from_slice(body).unwrap()))
    }

    /// Sends a request and waits for its end.
    pub(crate) fn call<C: Call>(&mut self, call: &C) -> Answer {
        let request = self.post(call);
        self.wait(request)
    }

    /// The body of a request that must succeed.
    pub(crate) fn ask<C: Call>(&mut self, call: &C) -> C::Reply {
        self.timed(call).1
    }

    /// The same, with the board time that it took, in microseconds.
    pub(crate) fn timed<C: Call>(&mut self, call: &C) -> (u32, C::Reply) {
        let (head, body) = self.call(call).unwrap();
        assert_eq!(head.status as u16, 0, "{}: {:?}", C::NAME, body);
        (head.elapsed_us, C::Reply::from_payload(&body).unwrap())
    }

    /// The refusal of a request that must be refused: number and text.
    pub(crate) fn refusal<C: Call>(&mut self, call: &C) -> (u16, String) {
        let nak = self.call(call).unwrap_err();
        (nak.code, nak.text.to_string())
    }

    /// All stream frames of a stream that came so far.
    pub(crate) fn streamed(&self, stream: u8) -> Vec<StreamFrame> {
        self.frames
            .iter()
            .filter(|frame| frame.header.kind == Kind::Stream && frame.header.message == u16::from(stream))
            .map(|frame| StreamFrame::from_payload(&frame.payload).unwrap())
            .collect()
    }
}
