//! The CAN bus of the bench with frames in memory, without an adapter.

use std::time::Duration;

use gnc_protocol::can::endpoint::{Endpoint, EndpointRole};
use gnc_protocol::can::{CanFrame, CanId};
use gnc_protocol::frame::{Flags, Frame, Header, Kind, Payload};
use gnc_protocol::message::{
    CanCounters, CanCountersReply, HostHello, Identity, IdentityReply, MAGIC, ModulePower, Nak, ResultHead,
    StreamStart, StreamStartReply, event,
};
use gnc_protocol::stream::StreamFrame;
use gnc_protocol::wire::Wire;
use gnc_protocol::{Call, NakCode};
use hw_mocks::{SimulatedBench, Speed};

use crate::host::options;

/// Number of looks at the bench after which a test gives up.
const PATIENCE: u32 = 200_000;

struct CanHost {
    bench: SimulatedBench,
    now: Duration,
    endpoint: Endpoint,
    frames: Vec<Frame>,
    echoes: Vec<CanFrame>,
    keep_alive_at: Duration,
    request: u16,
}

impl CanHost {
    fn new(personality: &str, speed: Speed) -> Self {
        let mut host = Self {
            bench: SimulatedBench::new(&options(personality, speed)),
            now: Duration::ZERO,
            endpoint: Endpoint::new(EndpointRole::Host),
            frames: Vec::new(),
            echoes: Vec::new(),
            keep_alive_at: Duration::ZERO,
            request: 0,
        };
        let hello = HostHello { magic: MAGIC, lowest: 1, highest: 1, nonce: 1 };
        host.send(Kind::Hello, 0, 0, hello.to_payload().unwrap());
        host.run_until(|frame| frame.header.kind == Kind::Hello);
        host
    }

    fn powered(personality: &str, speed: Speed) -> Self {
        let mut host = Self::new(personality, speed);
        host.ask(&ModulePower { on: 1 });
        host
    }

    fn send(&mut self, kind: Kind, request: u16, message: u16, payload: Payload) {
        let version = u8::from(kind != Kind::Hello);
        let header = Header { version, kind, flags: Flags::default(), request, message, sequence: 0 };
        let (bench, now) = (&mut self.bench, self.now);
        self.endpoint.send(&Frame { header, payload }, &mut |raw| bench.receive_can(raw, now));
    }

    fn turn(&mut self) {
        let due = self.bench.next_due(self.now).min(self.keep_alive_at);
        self.now = self.now.max(due);
        if self.now >= self.keep_alive_at {
            self.keep_alive_at = self.now + Duration::from_millis(500);
            self.send(Kind::Event, 0, event::KEEP_ALIVE, Payload::new());
        }
        while let Some(frame) = self.endpoint.poll(self.now) {
            self.bench.receive_can(frame, self.now);
        }
        self.bench.advance(self.now);
        // RS-422 is not read, but the board sends its heartbeat there too.
        let unheard = self.bench.output(self.now).len();
        self.bench.consume(unheard);
        while let Some(frame) = self.bench.output_can() {
            if gnc_protocol::can::id::is_echo(frame.id()) {
                self.echoes.push(frame);
            } else if let Some(frame) = self.endpoint.receive(&frame, self.now) {
                self.frames.push(frame.unwrap());
            }
        }
    }

    fn run_until(&mut self, wanted: impl Fn(&Frame) -> bool) -> Frame {
        let mut seen = self.frames.len();
        for _ in 0..PATIENCE {
            self.turn();
            if let Some(at) = self.frames[seen..].iter().position(&wanted) {
                return self.frames[seen + at].clone();
            }
            seen = self.frames.len();
        }
        panic!("nothing came in {PATIENCE} looks");
    }

    fn post<C: Call>(&mut self, call: &C) -> Frame {
        self.request += 1;
        let request = self.request;
        self.send(Kind::Request, request, C::ID, call.to_payload().unwrap());
        self.run_until(move |frame| {
            frame.header.request == request && matches!(frame.header.kind, Kind::Result | Kind::Nak)
        })
    }

    fn ask<C: Call>(&mut self, call: &C) -> C::Reply {
        let frame = self.post(call);
        assert_eq!(frame.header.kind, Kind::Result, "{:?}", frame.payload);
        let (head, body) = frame.payload.split_at(6);
        assert_eq!(ResultHead::from_payload(head).unwrap().status as u16, 0);
        C::Reply::from_payload(body).unwrap()
    }

    fn refusal<C: Call>(&mut self, call: &C) -> Nak {
        let frame = self.post(call);
        assert_eq!(frame.header.kind, Kind::Nak);
        Nak::from_payload(&frame.payload).unwrap()
    }

    /// Sends test frames one after the other and returns those that came back within 50 ms.
    fn echo(&mut self, frames: &[CanFrame]) -> Vec<CanFrame> {
        for frame in frames {
            self.bench.receive_can(*frame, self.now);
            self.turn();
        }
        let end = self.now + Duration::from_millis(50);
        while self.now < end {
            self.turn();
            self.now += Duration::from_millis(1);
        }
        std::mem::take(&mut self.echoes)
    }
}

fn frame(id: CanId, data: &[u8]) -> CanFrame {
    CanFrame::new(id, data).unwrap()
}

fn tests(count: u16) -> Vec<CanFrame> {
    (0..count).map(|number| frame(CanId::Standard(0x700 + number % 16), &number.to_le_bytes())).collect()
}

fn echoes(count: u16) -> Vec<CanFrame> {
    (0..count).map(|number| frame(CanId::Standard(0x710 + number % 16), &number.to_le_bytes())).collect()
}

#[test]
fn requests_are_answered_over_can() {
    for speed in [Speed::Max, Speed::Times(1.0), Speed::Times(20.0)] {
        let mut host = CanHost::powered("good", speed);
        let IdentityReply { serial_number, .. } = host.ask(&Identity {});
        assert_eq!(serial_number.as_str(), "SIM-0001");
    }
}

#[test]
fn the_module_sends_test_frames_back_while_it_has_power() {
    let mut host = CanHost::new("good", Speed::Max);
    assert_eq!(host.echo(&tests(4)), []);
    host.ask(&ModulePower { on: 1 });
    let sent = [
        frame(CanId::Standard(0x70f), &[]),
        frame(CanId::Extended(0x1abc_1234), &[1, 2, 3, 4, 5, 6, 7, 8]),
        frame(CanId::Extended(0x700), &[1]),
        frame(CanId::Standard(0x6ff), &[1]),
    ];
    let back = [frame(CanId::Standard(0x71f), &[]), frame(CanId::Extended(0x1abd_1234), &[1, 2, 3, 4, 5, 6, 7, 8])];
    assert_eq!(host.echo(&sent), back);
    let counters = CanCountersReply { received: 2, echoed: 2, ..CanCountersReply::default() };
    assert_eq!(host.ask(&CanCounters {}), counters);
}

#[test]
fn faults_of_the_controller() {
    let mut host = CanHost::powered("[can]\nflip_every = 3\n", Speed::Max);
    let back = host.echo(&tests(6));
    let altered: Vec<usize> = (0..6).filter(|at| back[*at] != echoes(6)[*at]).collect();
    assert_eq!(altered, [2, 5]);
    assert_eq!(host.ask(&CanCounters {}).tx_errors, 0, "it knows nothing of it");

    let mut host = CanHost::powered("[can]\nswap_every = 3\n", Speed::Max);
    let expected = [0, 1, 3, 2, 4].map(|at| echoes(5)[at]);
    assert_eq!(host.echo(&tests(5)), expected);

    let mut host = CanHost::powered("[can]\nbus_off_after = 3\n", Speed::Max);
    assert_eq!(host.echo(&tests(5)), echoes(3));
    let counters = host.ask(&CanCounters {});
    assert_eq!((counters.state, counters.received, counters.echoed), (2, 4, 3));

    let mut host = CanHost::powered("[can]\ntx_error_every = 2\n", Speed::Max);
    assert_eq!(host.echo(&tests(4)), echoes(4), "sent again, all of them arrive");
    // 8 - 1 at the second, - 1 at the third, + 8 - 1 at the fourth.
    assert_eq!(host.ask(&CanCounters {}).tx_errors, 13);
}

/// 216 test frames both ways at 500 kbit/s cannot be faster than the bus.
#[test]
fn the_bus_keeps_its_pace() {
    let mut host = CanHost::powered("good", Speed::Times(1.0));
    let start = host.now;
    for test in tests(100) {
        while host.bench.can_room() == 0 {
            host.turn();
        }
        host.bench.receive_can(test, host.now);
    }
    while host.echoes.len() < 100 {
        host.turn();
    }
    // Two bytes: 63 bits without stuffing, 75 with the most stuffing.
    let took_us = (host.now - start).as_micros();
    assert!((200 * 126..200 * 150 + 5000).contains(&took_us), "{took_us} us");
}

#[test]
fn an_imu_stream_fits_at_1_khz_and_not_twice_over() {
    for speed in [Speed::Max, Speed::Times(1.0)] {
        let mut host = CanHost::powered("good", speed);
        let start = StreamStart { stream: 1, rate_hz: 1000, count: 500, samples_per_frame: 0 };
        let reply: StreamStartReply = host.ask(&start);
        assert_eq!((reply.format, reply.samples_per_frame, reply.load_permille), (1, 1, 716));
        let number = |frame: &Frame| {
            let stream = frame.header.kind == Kind::Stream;
            stream.then(|| StreamFrame::from_payload(&frame.payload).unwrap().head.first)
        };
        host.run_until(move |frame| number(frame) == Some(499));
        let got: Vec<u32> = host.frames.iter().filter_map(number).collect();
        assert_eq!(got, (0..500).collect::<Vec<u32>>());
    }
    let mut host = CanHost::powered("good", Speed::Max);
    let two = StreamStart { stream: 1, rate_hz: 1000, count: 0, samples_per_frame: 2 };
    assert_eq!(host.refusal(&two).code, NakCode::BadParameter as u16);
}

/// HELLO on one link ends the session on the other link, which learns it at its next request.
#[test]
fn the_session_belongs_to_the_link_of_its_hello() {
    let mut host = CanHost::powered("good", Speed::Max);
    let hello = HostHello { magic: MAGIC, lowest: 1, highest: 1, nonce: 2 };
    let header = Header { version: 0, kind: Kind::Hello, flags: Flags::default(), request: 0, message: 0, sequence: 0 };
    let bytes = gnc_protocol::serial::encode(&Frame { header, payload: hello.to_payload().unwrap() });
    host.bench.receive(&bytes, host.now);
    host.turn();
    assert!(!host.bench.truth().powered, "a new session makes the board safe");
    assert_eq!(host.refusal(&Identity {}).code, NakCode::NoSession as u16);
}

/// RS-422 is not read and no host sends keep-alives: the watchdog ends the session on CAN too.
#[test]
fn the_watchdog_watches_can() {
    let mut host = CanHost::powered("good", Speed::Times(1.0));
    host.keep_alive_at = Duration::MAX;
    let before = host.now;
    host.run_until(|frame| frame.header.kind == Kind::Event && frame.header.message == event::WATCHDOG);
    let after_ms = (host.now - before).as_millis();
    assert!((1200..=1800).contains(&after_ms), "{after_ms} ms");
    assert!(!host.bench.truth().powered);
}
