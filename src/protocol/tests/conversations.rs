//! The frozen conversations of `tests/vectors/v1-conversations.txt`, said to the board's end of this crate: it must send every
//! byte that stands there, in this order, within its window, and nothing else.
//!
//! A failure means that this crate no longer speaks the protocol of the boards in the field. The file must not change.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a helper of a test fails as the test does")]

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::ops::RangeInclusive;
use std::path::Path;
use std::time::Duration;

use gnc_protocol::can::endpoint::{Endpoint, EndpointRole};
use gnc_protocol::can::{CanFrame, CanId, id};
use gnc_protocol::message::*;
use gnc_protocol::serial::{FrameDecoder, encode};
use gnc_protocol::slave::{BoardIdentity, BoardOutput, RequestDone, RequestRefusal, Slave, SlaveBoard};
use gnc_protocol::stream::{
    Format, IMU_SAMPLE, ImuSample, MAX_SAMPLE_BYTES, StreamFrame, StreamHead, StreamId, imu_load_permille,
};
use gnc_protocol::wire::{Wire, text};
use gnc_protocol::{Flags, Frame, Kind, NakCode, PROTOCOL_VERSION, Payload, Request};

/// Sections 6 and 16 of the interface document.
const BOOT_ID: u32 = 0xB007_1DEA;
const RATE_BAUD: u32 = 921_600;
/// The row of section 17 for an IMU stream of 200 Hz.
const CAN_LOAD_PERMILLE: u16 = 143;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Who {
    Host,
    Board,
    Bench,
}

/// A line of the file.
#[derive(Debug)]
struct Line {
    when_ms: RangeInclusive<u64>,
    who: Who,
    what: String,
    words: String,
}

struct Conversation {
    can: bool,
    lines: Vec<Line>,
}

fn line(text: &str) -> Line {
    let (fields, words) = text.split_once('#').unwrap();
    let fields: Vec<_> = fields.split_whitespace().collect();
    let [when, who, what @ ..] = fields.as_slice() else { panic!("{text}") };
    let (from, to) = when.split_once("..").unwrap_or((when, when));
    let who = match *who {
        "host" => Who::Host,
        "board" => Who::Board,
        "bench" => Who::Bench,
        _ => panic!("{text}"),
    };
    let words = words.split('|').next().unwrap().trim().to_owned();
    Line { when_ms: from.parse().unwrap()..=to.parse().unwrap(), who, what: what.join(" "), words }
}

fn conversations() -> BTreeMap<String, Conversation> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/vectors/v1-conversations.txt");
    let mut all = BTreeMap::new();
    for block in std::fs::read_to_string(path).unwrap().split("\nconversation: ").skip(1) {
        let (head, rest) = block.split_once('\n').unwrap();
        let (name, link) = head.split_once(' ').unwrap();
        assert!(["rs-422", "can"].contains(&link) && rest.starts_with("  why: "), "{name}");
        let lines = rest.lines().skip(1).filter(|text| !text.is_empty()).map(line).collect();
        assert!(all.insert(name.to_owned(), Conversation { can: link == "can", lines }).is_none(), "{name} twice");
    }
    all
}

fn hex(digits: &str) -> Vec<u8> {
    (0..digits.len()).step_by(2).map(|at| u8::from_str_radix(&digits[at..at + 2], 16).unwrap()).collect()
}

fn digits(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut all, byte| {
        write!(all, "{byte:02x}").unwrap();
        all
    })
}

fn can_frame(what: &str) -> CanFrame {
    let (id, data) = what.split_once(' ').unwrap();
    let data = if data == "-" { Vec::new() } else { hex(data) };
    CanFrame::new(CanId::Standard(u16::from_str_radix(id, 16).unwrap()), &data).unwrap()
}

fn can_text(frame: &CanFrame) -> String {
    let CanId::Standard(id) = frame.id() else { panic!("{frame:?}") };
    let data = if frame.data().is_empty() { "-".to_owned() } else { digits(frame.data()) };
    format!("{id:03x} {data}")
}

/// What a frame of the host says, in the words of the file.
fn words(frame: &Frame) -> String {
    let header = frame.header;
    let version = if header.kind == Kind::Hello { 0 } else { PROTOCOL_VERSION };
    assert_eq!(header.version, version);
    match header.kind {
        Kind::Hello => {
            let hello = HostHello::from_payload(&frame.payload).unwrap();
            assert_eq!((hello.magic, header.message, header.flags), (MAGIC, 0, Flags::default()));
            let HostHello { lowest, highest, nonce, .. } = hello;
            format!("HELLO {:04x}, versions {lowest} to {highest}, nonce {nonce:08x}", header.request)
        }
        Kind::Request => {
            let said = match Request::decode(header.message, &frame.payload).unwrap().unwrap() {
                Request::MakeSafe(_) => "MakeSafe".to_owned(),
                Request::Abort(ask) => format!("Abort {}", ask.request),
                Request::ModulePower(ask) => format!("ModulePower {}", ask.on),
                Request::Identity(_) => "Identity".to_owned(),
                Request::TimerMeasure(ask) => format!("TimerMeasure {} {} {}", ask.timer, ask.period_us, ask.count),
                Request::RamTest(ask) => format!("RamTest {} {}", ask.ram, ask.pattern),
                Request::FlashErase(ask) => format!("FlashErase {} {}", ask.flash, ask.sector),
                Request::AdRead(ask) => format!("AdRead {} {}", ask.channels, ask.samples),
                Request::StreamStart(StreamStart { stream, rate_hz, count, samples_per_frame }) => {
                    format!("StreamStart {stream} {rate_hz} {count} {samples_per_frame}")
                }
                Request::StreamStop(ask) => format!("StreamStop {}", ask.stream),
                other => panic!("{other:?}"),
            };
            let resent = if header.flags == Flags::RESENT { " (resent)" } else { "" };
            assert!(header.flags == Flags::default() || !resent.is_empty());
            format!("REQUEST {:04x} {said}{resent}", header.request)
        }
        Kind::Event => {
            assert_eq!((header.request, header.message, frame.payload.len()), (0, event::KEEP_ALIVE, 0));
            "EVENT keep-alive".to_owned()
        }
        kind => panic!("a host sends no {kind:?}"),
    }
}

/// Work that ends at a moment of link time.
struct Job {
    due: Duration,
    request: u16,
    elapsed: Duration,
    body: Payload,
    switches_to: Option<bool>,
}

/// A board with the values of the interface document. It takes as long as section 11 says.
struct Scripted {
    boot_id: u32,
    can: bool,
    started: Duration,
    now: Duration,
    powered: bool,
    jobs: Vec<Job>,
    frames: Vec<(Duration, StreamFrame)>,
    produced: u32,
}

fn payload(body: &impl Wire) -> Payload {
    body.to_payload().unwrap()
}

impl Scripted {
    fn new(boot_id: u32, can: bool, now: Duration) -> Self {
        let (jobs, frames) = (Vec::new(), Vec::new());
        Self { boot_id, can, started: now, now, powered: false, jobs, frames, produced: 0 }
    }

    fn next_due(&self) -> Option<Duration> {
        self.jobs.iter().map(|job| job.due).chain(self.frames.iter().map(|(due, _)| *due)).min()
    }

    /// Milliseconds that a request takes, and the body of its result.
    fn work(&mut self, what: Request) -> (u64, Payload) {
        match what {
            Request::ModulePower(_) => (150, payload(&PowerReply { supply_uv: 5_012_345, supply_ua: 491_234 })),
            Request::Identity(_) => {
                let (serial_number, part, hardware) = (text("GNC-2026-000123"), text("GNC-POP-26"), text("C"));
                (20, payload(&IdentityReply { serial_number, part, hardware, firmware: text("2.1.0"), protocol: 1 }))
            }
            Request::TimerMeasure(ask) => {
                let measured = [100_000_010, 99_999_990, 100_000_000, 100_000_000, 100_000_010];
                let intervals_ns = measured.into_iter().collect();
                let took_ms = u64::from(ask.period_us) * u64::from(ask.count) / 1000;
                (took_ms, payload(&TimerMeasureReply { interrupts: ask.count, intervals_ns }))
            }
            Request::RamTest(_) => {
                (300, payload(&MismatchReply { words: 1_048_576, mismatches: 0, first_place: 0, expected: 0, got: 0 }))
            }
            Request::FlashErase(FlashErase { flash: 0, .. }) => (60, payload(&DurationReply { duration_us: 58_000 })),
            Request::FlashErase(_) => (120, payload(&DurationReply { duration_us: 118_000 })),
            Request::AdRead(ask) => {
                let only = AdChannel { channel: 2, mean_uv: 2_500_000, min_uv: 2_499_000, max_uv: 2_501_000 };
                (1 + u64::from(ask.samples) / 10, payload(&AdReadReply { channels: [only].into_iter().collect() }))
            }
            Request::StreamStart(ask) => (1, self.stream(&ask)),
            Request::StreamStop(_) => (1, payload(&StreamStopReply { produced: self.produced, dropped: 0 })),
            other => panic!("{other:?}"),
        }
    }

    /// Plans the frames of a stream: each leaves with its last sample.
    fn stream(&mut self, ask: &StreamStart) -> Payload {
        let begins = self.now + Duration::from_millis(1);
        let at =
            |number: u32| begins + Duration::from_micros(u64::from(number + 1) * 1_000_000 / u64::from(ask.rate_hz));
        let each = u32::from(ask.samples_per_frame);
        for first in (0..ask.count).step_by(usize::from(ask.samples_per_frame)) {
            let board_time_us = (at(first) - self.started).as_micros() as u64;
            let format = Format::Imu as u8;
            let count = u16::from(ask.samples_per_frame);
            let head = StreamHead { stream: ask.stream, format, count, first, board_time_us, dropped: 0 };
            let mut samples = heapless::Vec::<u8, MAX_SAMPLE_BYTES>::new();
            for number in first..first + each {
                let sample = ImuSample {
                    gyro: [100 + number as i32, -200, 300],
                    accel: [-1600, 800, 160_000],
                    mag: [250_000, -125_000, 500_000],
                    gyro_temperature: 2345,
                    accel_temperature: 2301,
                };
                samples.extend_from_slice(&payload(&sample)).unwrap();
            }
            assert_eq!(samples.len(), IMU_SAMPLE * each as usize);
            self.frames.push((at(first + each - 1), StreamFrame { head, samples }));
        }
        self.produced = 0;
        let load_permille = if self.can {
            CAN_LOAD_PERMILLE
        } else {
            imu_load_permille(u32::from(ask.rate_hz), each, RATE_BAUD) as u16
        };
        payload(&StreamStartReply {
            format: Format::Imu as u8,
            samples_per_frame: ask.samples_per_frame,
            load_permille,
        })
    }
}

impl SlaveBoard for Scripted {
    fn identity(&self) -> BoardIdentity {
        let capabilities = capability::POWER | if self.can { capability::CAN } else { 0 };
        BoardIdentity { boot_id: self.boot_id, capabilities, serial: text("SB-0042"), firmware: text("1.4.2") }
    }
    fn start(&mut self, request: u16, what: Request) -> Result<u32, RequestRefusal> {
        let switches_to = if let Request::ModulePower(ask) = &what { Some(ask.on == 1) } else { None };
        if !self.powered && switches_to.is_none() && !matches!(what, Request::StreamStop(_)) {
            return Err(RequestRefusal::new(NakCode::NotPowered, "the module has no power"));
        }
        let (took_ms, body) = self.work(what);
        let elapsed = Duration::from_millis(took_ms);
        self.jobs.push(Job { due: self.now + elapsed, request, elapsed, body, switches_to });
        Ok(took_ms as u32)
    }
    fn poll(&mut self) -> Option<BoardOutput> {
        let now = self.now;
        if let Some(at) = self.jobs.iter().position(|job| job.due <= now) {
            let Job { request, elapsed, body, switches_to, .. } = self.jobs.remove(at);
            self.powered = switches_to.unwrap_or(self.powered);
            let elapsed_us = elapsed.as_micros() as u32;
            return Some(BoardOutput::Done(RequestDone { request, elapsed_us, outcome: Ok(body) }));
        }
        let at = self.frames.iter().position(|(due, _)| *due <= now)?;
        let (_, frame) = self.frames.remove(at);
        self.produced += u32::from(frame.head.count);
        Some(BoardOutput::Stream(StreamId::Imu, frame))
    }
    fn progress(&self, request: u16) -> Progress {
        let job = self.jobs.iter().find(|job| job.request == request).unwrap();
        let spent_ms = (self.now + job.elapsed - job.due).as_millis();
        let done_permille = (spent_ms * 1000 / job.elapsed.as_millis()) as u16;
        Progress { done_permille, elapsed_ms: spent_ms as u32 }
    }
    fn abort(&mut self, request: u16) {
        self.jobs.retain(|job| job.request != request);
    }
    fn make_safe(&mut self) {
        self.jobs.clear();
        self.frames.clear();
        self.powered = false;
    }
    fn new_session(&mut self) {
        self.produced = 0;
    }
    fn board_time_us(&self) -> u64 {
        (self.now - self.started).as_micros() as u64
    }
    fn state_bits(&self) -> u8 {
        u8::from(self.powered) << 1 | u8::from(!self.frames.is_empty()) << 3
    }
}

/// The board on its link, and what it sent.
struct Bench {
    slave: Slave,
    board: Scripted,
    decoder: FrameDecoder,
    endpoint: Endpoint,
    sent: Vec<(u64, String)>,
    /// The words of the messages that come over CAN, by the id of their frames.
    said: BTreeMap<CanId, String>,
}

impl Bench {
    fn new(boot_id: u32, can: bool, now: Duration) -> Self {
        Self {
            slave: Slave::default(),
            board: Scripted::new(boot_id, can, now),
            decoder: FrameDecoder::default(),
            endpoint: Endpoint::new(EndpointRole::Board),
            sent: Vec::new(),
            said: BTreeMap::new(),
        }
    }

    /// Lets the board work and send, with the frame that came.
    fn turn(&mut self, arrived: Option<&Frame>) {
        let Self { slave, board, endpoint, sent, .. } = self;
        let now = board.now;
        let now_ms = now.as_millis() as u64;
        let can = board.can;
        let mut send = |frame: Frame| {
            if can {
                endpoint.send(&frame, &mut |raw| sent.push((now_ms, can_text(&raw))));
            } else {
                sent.push((now_ms, digits(&encode(&frame))));
            }
        };
        if let Some(frame) = arrived {
            slave.receive(frame, now, board, &mut send);
        }
        slave.tick(now, board, &mut send);
        while let Some(raw) = endpoint.poll(now) {
            sent.push((now_ms, can_text(&raw)));
        }
    }

    /// Goes on to a moment, with all that the board does until then.
    fn pass(&mut self, to: Duration) {
        loop {
            let due = self.board.next_due().map_or(self.slave.next_due(), |due| due.min(self.slave.next_due()));
            if due > to {
                break;
            }
            self.board.now = due.max(self.board.now);
            self.turn(None);
        }
        self.board.now = to;
    }

    fn hear(&mut self, line: &Line) {
        if !self.board.can {
            let bytes = hex(&line.what);
            let mut rest = bytes.as_slice();
            let frame = self.decoder.next(&mut rest).unwrap().unwrap();
            assert!(rest.is_empty(), "{line:?}");
            assert_eq!(words(&frame), line.words, "{line:?}");
            return self.turn(Some(&frame));
        }
        let raw = can_frame(&line.what);
        let part = line.words.strip_prefix("part ").map(|number| number.parse::<u8>().unwrap());
        match part {
            Some(number) => assert_eq!(raw.data()[0], 0x20 | (number % 16), "{line:?}"),
            None if line.words == "flow control" => assert_eq!(raw.data(), [0x30, 0, 0]),
            None if raw.id() == CanId::Standard(id::KEEP_ALIVE) => assert_eq!(line.words, "keep-alive"),
            None => assert!(self.said.insert(raw.id(), line.words.clone()).is_none(), "{line:?}"),
        }
        let arrived = self.endpoint.receive(&raw, self.board.now).map(Result::unwrap);
        if let Some(frame) = arrived.as_ref().filter(|frame| frame.header.kind != Kind::Event) {
            assert_eq!(Some(words(frame)), self.said.remove(&raw.id()));
        }
        self.turn(arrived.as_ref());
    }
}

/// Says the host's lines at their times. Returns what the board sent, with its times.
fn play(conversation: &Conversation) -> Vec<(u64, String)> {
    let mut bench = Bench::new(BOOT_ID, conversation.can, Duration::ZERO);
    for line in conversation.lines.iter().filter(|line| line.who != Who::Board) {
        let now = Duration::from_millis(*line.when_ms.start());
        bench.pass(now);
        if line.who == Who::Host {
            bench.hear(line);
        } else {
            let boot_id = u32::from_str_radix(line.what.strip_prefix("restart ").unwrap(), 16).unwrap();
            let sent = std::mem::take(&mut bench.sent);
            bench = Bench { sent, ..Bench::new(boot_id, conversation.can, now) };
        }
    }
    let end_ms = conversation.lines.iter().map(|line| *line.when_ms.end()).max().unwrap();
    bench.pass(Duration::from_millis(end_ms));
    assert!(bench.said.is_empty(), "half a message: {:?}", bench.said);
    bench.sent
}

#[test]
fn the_board_says_every_byte_in_its_order_and_its_time() {
    let all = conversations();
    for (name, conversation) in &all {
        let sent = play(conversation);
        let expected: Vec<_> = conversation.lines.iter().filter(|line| line.who == Who::Board).collect();
        for (line, (at_ms, bytes)) in expected.iter().zip(&sent) {
            assert_eq!(bytes, &line.what, "{name}, {at_ms} ms: {line:?}");
            assert!(line.when_ms.contains(at_ms), "{name}: at {at_ms} ms, {line:?}");
        }
        assert_eq!(sent.len(), expected.len(), "{name}: the board says {:?}", sent.get(expected.len()));
    }
}

/// Nobody takes a conversation away.
#[test]
fn the_file_holds_every_conversation() {
    let expected = [
        "abort.running",
        "can.make-safe",
        "can.request",
        "can.stream",
        "can.watchdog",
        "make-safe.running",
        "power.first",
        "request.fifth",
        "request.lost-answer",
        "request.progress",
        "request.result",
        "request.second-copy",
        "restart.running",
        "session.new-nonce",
        "session.none",
        "session.same-nonce",
        "stream.count",
        "version.none",
        "watchdog",
    ];
    assert!(conversations().keys().eq(expected.iter()), "{:?}", conversations().keys());
}
