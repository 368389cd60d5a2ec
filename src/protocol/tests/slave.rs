//! The board's end of the conversation against a board that does what the test tells it.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a helper of a test fails as the test does")]

use std::collections::VecDeque;
use std::time::Duration;

use gnc_protocol::error::FaultCode;
use gnc_protocol::message::*;
use gnc_protocol::serial::{FrameDecoder, encode};
use gnc_protocol::slave::{
    BoardIdentity, BoardOutput, KEPT_RESULTS, MAX_RUNNING, RequestDone, RequestFault, RequestRefusal, Slave, SlaveBoard,
};
use gnc_protocol::stream::{ImuSample, StreamFrame, StreamHead, StreamId};
use gnc_protocol::wire::{FieldReader, Wire, text};
use gnc_protocol::{Call, Flags, Frame, Header, Kind, NakCode, PROTOCOL_VERSION, Payload, Request, timing};
use proptest::prelude::*;

/// A board that notes its requests and acts as the test sets its fields.
#[derive(Default)]
struct Scripted {
    started: Vec<u16>,
    aborted: Vec<u16>,
    made_safe: u32,
    new_sessions: u32,
    refuse_next: Option<RequestRefusal>,
    outputs: VecDeque<BoardOutput>,
    state_bits: u8,
    boot_id: Option<u32>,
    serial: &'static str,
    firmware: &'static str,
}

impl SlaveBoard for Scripted {
    fn identity(&self) -> BoardIdentity {
        let boot_id = self.boot_id.unwrap_or(77);
        BoardIdentity { boot_id, capabilities: 1, serial: text(self.serial), firmware: text(self.firmware) }
    }
    fn start(&mut self, request: u16, _: Request) -> Result<u32, RequestRefusal> {
        if let Some(refusal) = self.refuse_next.take() {
            return Err(refusal);
        }
        self.started.push(request);
        Ok(u32::from(request) * 10)
    }
    fn poll(&mut self) -> Option<BoardOutput> {
        self.outputs.pop_front()
    }
    fn progress(&self, request: u16) -> Progress {
        Progress { done_permille: request, elapsed_ms: 9 }
    }
    fn abort(&mut self, request: u16) {
        self.aborted.push(request);
    }
    fn make_safe(&mut self) {
        self.made_safe += 1;
    }
    fn new_session(&mut self) {
        self.new_sessions += 1;
    }
    fn board_time_us(&self) -> u64 {
        123
    }
    fn state_bits(&self) -> u8 {
        self.state_bits
    }
}

/// A slave, its board, a clock.
#[derive(Default)]
struct Bench {
    slave: Slave,
    board: Scripted,
    now: Duration,
    host_sequence: u16,
}

impl Bench {
    /// A bench with a session, after the first heartbeat.
    fn in_session() -> Self {
        let mut bench = Self::default();
        bench.hello(1, 1, 1);
        bench.tick();
        bench.board.made_safe = 0;
        bench
    }

    fn receive(&mut self, kind: Kind, request: u16, message: u16, payload: &[u8]) -> Vec<Frame> {
        let version = if kind == Kind::Hello { 0 } else { PROTOCOL_VERSION };
        self.receive_version(version, kind, request, message, payload)
    }

    fn receive_version(&mut self, version: u8, kind: Kind, request: u16, message: u16, payload: &[u8]) -> Vec<Frame> {
        let sequence = self.host_sequence;
        self.host_sequence = sequence.wrapping_add(1);
        let header = Header { version, kind, flags: Flags::default(), request, message, sequence };
        let frame = Frame { header, payload: Payload::from_slice(payload).unwrap() };
        let mut sent = Vec::new();
        self.slave.receive(&frame, self.now, &mut self.board, &mut |frame| sent.push(frame));
        sent
    }

    fn hello(&mut self, lowest: u8, highest: u8, nonce: u32) -> BoardHello {
        let payload = HostHello { magic: MAGIC, lowest, highest, nonce }.to_payload().unwrap();
        let sent = self.receive(Kind::Hello, 9, 0, &payload);
        let [answer] = sent.as_slice() else { panic!("{sent:?}") };
        let Header { version, kind, request, message, .. } = answer.header;
        assert_eq!((version, kind, request, message), (0, Kind::Hello, 9, 0));
        BoardHello::from_payload(&answer.payload).unwrap()
    }

    fn ask<C: Call>(&mut self, request: u16, call: &C) -> Vec<Frame> {
        self.receive(Kind::Request, request, C::ID, &call.to_payload().unwrap())
    }

    fn tick(&mut self) -> Vec<Frame> {
        let mut sent = Vec::new();
        self.slave.tick(self.now, &mut self.board, &mut |frame| sent.push(frame));
        sent
    }

    fn finish(&mut self, request: u16, body: &impl Wire) -> Vec<Frame> {
        let outcome = Ok(body.to_payload().unwrap());
        self.board.outputs.push_back(BoardOutput::Done(RequestDone { request, elapsed_us: 5, outcome }));
        self.tick()
    }
}

/// Kind, request and message of each frame.
fn brief(frames: &[Frame]) -> Vec<(Kind, u16, u16)> {
    frames.iter().map(|frame| (frame.header.kind, frame.header.request, frame.header.message)).collect()
}

fn nak_code(frames: &[Frame]) -> NakCode {
    let [frame] = frames else { panic!("one frame expected: {frames:?}") };
    assert_eq!(frame.header.kind, Kind::Nak);
    NakCode::from_number(Nak::from_payload(&frame.payload).unwrap().code).unwrap()
}

fn status(frame: &Frame) -> FaultCode {
    assert_eq!(frame.header.kind, Kind::Result);
    ResultHead::get(&mut FieldReader::new(&frame.payload)).unwrap().status
}

const RAM: RamTest = RamTest { ram: 0, pattern: 0 };

#[test]
fn without_a_session_nothing_is_started() {
    let mut bench = Bench::default();
    assert_eq!(nak_code(&bench.ask(1, &Identity {})), NakCode::NoSession);
    assert_eq!(nak_code(&bench.ask(2, &MakeSafe {})), NakCode::NoSession);
    assert_eq!(bench.board.started, []);
    bench.hello(1, 1, 1);
    assert_eq!(brief(&bench.ask(1, &Identity {})), [(Kind::Accept, 1, Identity::ID)]);
}

#[test]
fn hello_names_the_board_and_the_versions() {
    let board = Scripted { serial: "SB-1", ..Scripted::default() };
    let answer = Bench { board, ..Bench::default() }.hello(0, 200, 0xABCD);
    assert_eq!((answer.chosen, answer.lowest, answer.highest), (1, 1, 1));
    assert_eq!((answer.nonce, answer.boot_id, answer.serial.as_str()), (0xABCD, 77, "SB-1"));
}

#[test]
fn the_same_nonce_keeps_the_session() {
    let mut bench = Bench::in_session();
    bench.ask(1, &RAM);
    bench.hello(1, 1, 1);
    assert!(bench.slave.is_busy());
    assert_eq!((bench.board.made_safe, bench.board.new_sessions), (0, 1));
}

#[test]
fn another_nonce_ends_the_session_before() {
    let mut bench = Bench::in_session();
    bench.ask(1, &RAM);
    bench.ask(2, &Identity {});
    bench.finish(2, &IdentityReply::default());
    bench.hello(1, 1, 2);
    assert_eq!((bench.board.aborted.as_slice(), bench.board.made_safe, bench.board.new_sessions), (&[1][..], 1, 2));
    assert!(!bench.slave.is_busy());
    // The old result is not replayed into the new session: the request is new.
    assert_eq!(brief(&bench.ask(2, &Identity {})), [(Kind::Accept, 2, Identity::ID)]);
    assert_eq!(bench.board.started, [1, 2, 2]);
}

#[test]
fn without_a_common_version_the_session_ends() {
    for (lowest, highest) in [(2, 9), (0, 0), (3, 0)] {
        let mut bench = Bench::in_session();
        bench.ask(1, &RAM);
        let answer = bench.hello(lowest, highest, 1);
        assert_eq!((answer.chosen, answer.lowest, answer.highest), (0, 1, 1));
        assert_eq!((bench.board.aborted.as_slice(), bench.board.made_safe), (&[1][..], 1));
        assert_eq!(nak_code(&bench.ask(2, &Identity {})), NakCode::NoSession);
    }
}

#[test]
fn a_hello_that_is_none_changes_nothing() {
    let mut bench = Bench::in_session();
    let good = HostHello { magic: MAGIC, lowest: 1, highest: 1, nonce: 2 }.to_payload().unwrap();
    let other = HostHello { magic: *b"GNCX", lowest: 1, highest: 1, nonce: 2 }.to_payload().unwrap();
    bench.now += Duration::from_millis(1000);
    for payload in [&good[..9], &other[..], &[]] {
        assert_eq!(bench.receive(Kind::Hello, 1, 0, payload), []);
    }
    assert!(bench.slave.has_session());
    assert_eq!(bench.board.new_sessions, 1);
    bench.now = timing::WATCHDOG;
    bench.tick();
    assert!(!bench.slave.has_session(), "rubbish fed the watchdog");
}

#[test]
fn a_running_request_is_started_once() {
    let mut bench = Bench::in_session();
    let first = bench.ask(7, &RAM);
    let again = bench.ask(7, &RAM);
    assert_eq!(brief(&first), [(Kind::Accept, 7, RamTest::ID)]);
    assert_eq!(brief(&again), brief(&first));
    assert_eq!(Accept::from_payload(&again[0].payload).unwrap(), Accept { expected_ms: 70 });
    assert_eq!(bench.board.started, [7]);
}

/// Otherwise the host would wait for the result of a request that was never started.
#[test]
fn the_id_of_a_running_request_serves_no_other_message() {
    let mut bench = Bench::in_session();
    bench.ask(7, &RAM);
    assert_eq!(nak_code(&bench.ask(7, &Identity {})), NakCode::BadParameter);
    assert_eq!((bench.board.started.as_slice(), bench.slave.is_busy()), (&[7][..], true));
    // MAKE_SAFE is never refused in a session.
    let sent = brief(&bench.ask(7, &MakeSafe {}));
    assert_eq!(
        sent,
        [(Kind::Result, 7, RamTest::ID), (Kind::Accept, 7, MakeSafe::ID), (Kind::Result, 7, MakeSafe::ID)]
    );
    assert_eq!((bench.slave.is_busy(), bench.board.made_safe), (false, 1));
}

#[test]
fn the_last_eight_results_are_replayed_and_not_the_ninth() {
    let mut bench = Bench::in_session();
    let mut results = Vec::new();
    let last = u16::try_from(KEPT_RESULTS).unwrap() + 1;
    for request in 1..=last {
        bench.ask(request, &ModulePower { on: 1 });
        let sent = bench.finish(request, &PowerReply { supply_uv: u32::from(request), supply_ua: 2 });
        assert_eq!(brief(&sent), [(Kind::Result, request, ModulePower::ID)]);
        assert!(!sent[0].header.flags.has(Flags::REPLAYED));
        results.push(sent[0].payload.clone());
    }
    for request in 2..=last {
        let sent = bench.ask(request, &ModulePower { on: 1 });
        assert_eq!(brief(&sent), [(Kind::Result, request, ModulePower::ID)]);
        assert!(sent[0].header.flags.has(Flags::REPLAYED));
        assert_eq!(sent[0].payload, results[usize::from(request) - 1], "request {request}");
    }
    assert_eq!(bench.board.started.len(), KEPT_RESULTS + 1, "a replay started the work again");
    // The same id with another message is another request.
    assert_eq!(brief(&bench.ask(last, &Identity {})), [(Kind::Accept, last, Identity::ID)]);
    assert_eq!(brief(&bench.ask(1, &ModulePower { on: 1 })), [(Kind::Accept, 1, ModulePower::ID)]);
}

/// Commands that end at once must also not run twice because an answer was lost.
#[test]
fn make_safe_and_abort_are_replayed_too() {
    let mut bench = Bench::in_session();
    bench.ask(1, &RAM);
    bench.ask(2, &Abort { request: 1 });
    let sent = bench.ask(2, &Abort { request: 1 });
    assert_eq!(brief(&sent), [(Kind::Result, 2, Abort::ID)]);
    assert_eq!(AbortReply::from_payload(&sent[0].payload[6..]).unwrap(), AbortReply { was_running: 1 });
    bench.ask(3, &MakeSafe {});
    assert_eq!(brief(&bench.ask(3, &MakeSafe {})), [(Kind::Result, 3, MakeSafe::ID)]);
    assert_eq!(bench.board.made_safe, 1);
    // The result of an aborted request is replayed too.
    assert_eq!(status(&bench.ask(1, &RAM)[0]), FaultCode::Aborted);
}

#[test]
fn refusals() {
    let mut bench = Bench::in_session();
    assert_eq!(nak_code(&bench.receive(Kind::Request, 1, 0x7777, &[])), NakCode::UnknownMessage);
    assert_eq!(nak_code(&bench.receive(Kind::Request, 1, RamTest::ID, &[0])), NakCode::BadPayload);
    assert_eq!(nak_code(&bench.receive(Kind::Request, 1, RamTest::ID, &[0, 0, 0])), NakCode::BadPayload);
    let words = [&[1, 0, 65, 0][..], &[0; 65 * 4]].concat();
    assert_eq!(nak_code(&bench.receive(Kind::Request, 1, CpuWords::ID, &words)), NakCode::BadPayload);
    let other = bench.receive_version(2, Kind::Request, 1, Identity::ID, &[]);
    assert_eq!(nak_code(&other), NakCode::UnknownMessage);
    assert_eq!(bench.board.started, []);
    for &code in NakCode::ALL {
        bench.board.refuse_next = Some(RequestRefusal::new(code, "why"));
        let sent = bench.ask(2, &RAM);
        assert_eq!(nak_code(&sent), code);
        assert_eq!(Nak::from_payload(&sent[0].payload).unwrap().text, "why");
    }
    // The board does not remember a refusal: the same request may be possible a moment later.
    assert_eq!(brief(&bench.ask(2, &RAM)), [(Kind::Accept, 2, RamTest::ID)]);
}

#[test]
fn one_request_too_many_is_busy() {
    let mut bench = Bench::in_session();
    let most = u16::try_from(MAX_RUNNING).unwrap();
    for request in 1..=most {
        assert_eq!(bench.ask(request, &RAM)[0].header.kind, Kind::Accept);
    }
    assert_eq!(nak_code(&bench.ask(most + 1, &RAM)), NakCode::Busy);
    assert_eq!(bench.ask(1, &RAM)[0].header.kind, Kind::Accept, "a resend is not one more");
    assert_eq!(status(&bench.finish(2, &MismatchReply::default())[0]), FaultCode::None);
    assert_eq!(bench.ask(most + 1, &RAM)[0].header.kind, Kind::Accept);
}

#[test]
fn abort_ends_one_request() {
    let mut bench = Bench::in_session();
    bench.ask(1, &RAM);
    bench.ask(2, &Identity {});
    let sent = bench.ask(3, &Abort { request: 1 });
    let expected = [(Kind::Result, 1, RamTest::ID), (Kind::Accept, 3, Abort::ID), (Kind::Result, 3, Abort::ID)];
    assert_eq!(brief(&sent), expected);
    assert_eq!(status(&sent[0]), FaultCode::Aborted);
    assert_eq!(AbortReply::from_payload(&sent[2].payload[6..]).unwrap(), AbortReply { was_running: 1 });
    assert_eq!(bench.board.aborted, [1]);
    // A result that the board finishes a moment too late gives no second answer.
    assert_eq!(bench.finish(1, &MismatchReply::default()), []);
    let sent = bench.ask(4, &Abort { request: 1 });
    assert_eq!(AbortReply::from_payload(&sent[1].payload[6..]).unwrap(), AbortReply { was_running: 0 });
    assert_eq!(brief(&bench.finish(2, &IdentityReply::default())), [(Kind::Result, 2, Identity::ID)]);
}

#[test]
fn make_safe_ends_everything_but_the_session() {
    let mut bench = Bench::in_session();
    for request in 1..=4 {
        bench.ask(request, &RAM);
    }
    let sent = bench.ask(5, &MakeSafe {});
    assert_eq!(sent.len(), 6, "four results, ACCEPT, RESULT: {sent:?}");
    let mut ended: Vec<_> = sent[..4].iter().map(|frame| (frame.header.request, status(frame))).collect();
    ended.sort_unstable();
    assert_eq!(ended, [1, 2, 3, 4].map(|request| (request, FaultCode::Aborted)));
    assert_eq!(brief(&sent[4..]), [(Kind::Accept, 5, MakeSafe::ID), (Kind::Result, 5, MakeSafe::ID)]);
    bench.board.aborted.sort_unstable();
    assert_eq!((bench.board.aborted.as_slice(), bench.board.made_safe), (&[1, 2, 3, 4][..], 1));
    assert_eq!(bench.ask(6, &Identity {})[0].header.kind, Kind::Accept);
}

#[test]
fn a_fault_of_the_board_is_a_result_with_a_text() {
    let mut bench = Bench::in_session();
    bench.ask(1, &RAM);
    let fault = RequestFault { code: FaultCode::DeviceTimeout, text: text("no answer") };
    bench.board.outputs.push_back(BoardOutput::Done(RequestDone { request: 1, elapsed_us: 250, outcome: Err(fault) }));
    let sent = bench.tick();
    let mut reader = FieldReader::new(&sent[0].payload);
    let head = ResultHead::get(&mut reader).unwrap();
    assert_eq!((head.status, head.elapsed_us), (FaultCode::DeviceTimeout, 250));
    assert_eq!(reader.take_rest(), b"\x09no answer");
}

#[test]
fn the_watchdog_bites_at_its_exact_time() {
    let nanosecond = Duration::from_nanos(1);
    let keep_alive = (Kind::Event, 0, event::KEEP_ALIVE, Vec::new());
    let hello = HostHello { magic: MAGIC, lowest: 1, highest: 1, nonce: 1 }.to_payload().unwrap().to_vec();
    let fed_by = [keep_alive, (Kind::Request, 1, 0x7777, Vec::new()), (Kind::Hello, 1, 0, hello)];
    for (kind, request, message, payload) in fed_by {
        let mut bench = Bench::in_session();
        bench.ask(5, &RAM);
        bench.now = Duration::from_millis(1500);
        bench.receive(kind, request, message, &payload);
        let due = bench.now + timing::WATCHDOG;
        bench.now = due - nanosecond;
        bench.tick();
        assert!(bench.slave.has_session() && bench.board.made_safe == 0, "{kind:?}: too early");
        assert_eq!(bench.slave.next_due(), due);
        bench.now = due;
        let sent = bench.tick();
        assert!(brief(&sent).contains(&(Kind::Event, 0, event::WATCHDOG)), "{kind:?}: {sent:?}");
        assert!(!bench.slave.has_session() && !bench.slave.is_busy(), "{kind:?}");
        assert_eq!((bench.board.made_safe, bench.board.aborted.as_slice()), (1, &[5][..]));
        assert_eq!(nak_code(&bench.ask(6, &Identity {})), NakCode::NoSession);
        bench.now += Duration::from_secs(10);
        assert!(!brief(&bench.tick()).contains(&(Kind::Event, 0, event::WATCHDOG)), "{kind:?}: it bites once");
    }
}

/// A simulator that stood still together with its host. Excused time is not silence, and silence never begins later
/// than now.
#[test]
fn excused_time_is_no_silence() {
    let nanosecond = Duration::from_nanos(1);
    for (excused_ms, counts_ms) in [(0, 0), (400, 400), (5000, 1000)] {
        let mut bench = Bench::in_session();
        bench.now = Duration::from_millis(1000);
        bench.slave.excuse(Duration::from_millis(excused_ms), bench.now);
        let due = timing::WATCHDOG + Duration::from_millis(counts_ms);
        bench.now = due - nanosecond;
        bench.tick();
        assert!(bench.slave.has_session(), "{excused_ms} ms: too early");
        bench.now = due;
        bench.tick();
        assert!(!bench.slave.has_session(), "{excused_ms} ms: too late");
    }
}

/// A line with joined ends, or a second board: frames of a board must not count as a living host.
#[test]
fn its_own_echo_does_not_feed_the_watchdog() {
    let mut bench = Bench::in_session();
    bench.now = Duration::from_millis(1000);
    let beat = Heartbeat::default().to_payload().unwrap();
    assert_eq!(bench.receive(Kind::Event, 0, event::HEARTBEAT, &beat), []);
    assert_eq!(bench.receive(Kind::Event, 0, event::WATCHDOG, &[]), []);
    for kind in [Kind::Accept, Kind::Progress, Kind::Result, Kind::Stream, Kind::Nak] {
        assert_eq!(bench.receive(kind, 1, 1, &[0; 8]), []);
    }
    bench.now = timing::WATCHDOG;
    bench.tick();
    assert!(!bench.slave.has_session());
}

#[test]
fn frames_of_another_version_do_not_feed_the_watchdog() {
    for version in [0, 2, 15] {
        let mut bench = Bench::in_session();
        bench.now = Duration::from_millis(1000);
        assert_eq!(bench.receive_version(version, Kind::Event, 0, event::KEEP_ALIVE, &[]), []);
        let refused = bench.receive_version(version, Kind::Request, 1, Identity::ID, &[]);
        assert_eq!(nak_code(&refused), NakCode::UnknownMessage);
        bench.now = timing::WATCHDOG;
        bench.tick();
        assert!(!bench.slave.has_session(), "version {version}");
    }
}

/// Within a version a keep-alive may grow. A HELLO is a HELLO by its kind, whatever else its header says.
#[test]
fn what_may_change_in_a_sign_of_life_still_feeds_the_watchdog() {
    let hello = HostHello { magic: MAGIC, lowest: 1, highest: 1, nonce: 1 }.to_payload().unwrap().to_vec();
    for (kind, message, payload) in [(Kind::Event, event::KEEP_ALIVE, vec![7]), (Kind::Hello, 0x7777, hello)] {
        let mut bench = Bench::in_session();
        bench.now = Duration::from_millis(1000);
        bench.receive_version(PROTOCOL_VERSION, kind, 0, message, &payload);
        bench.now = timing::WATCHDOG;
        bench.tick();
        assert!(bench.slave.has_session(), "{kind:?}");
    }
}

/// Only [`Slave::next_due`] drives the slave, as in a board's loop.
#[test]
fn progress_comes_often_enough_until_the_result() {
    let mut bench = Bench::in_session();
    bench.now = Duration::from_millis(3);
    bench.ask(1, &RAM);
    let (mut heard, mut seen) = (bench.now, 0);
    while bench.now < Duration::from_secs(20) {
        bench.receive(Kind::Event, 0, event::KEEP_ALIVE, &[]);
        let due = bench.slave.next_due();
        assert!(due > bench.now, "nothing is due at the moment of the last tick");
        bench.now = due;
        for frame in bench.tick() {
            if frame.header.kind == Kind::Progress {
                assert_eq!((frame.header.request, frame.header.message), (1, RamTest::ID));
                let expected = Progress { done_permille: 1, elapsed_ms: 9 };
                assert_eq!(Progress::from_payload(&frame.payload).unwrap(), expected);
                assert!(bench.now - heard <= timing::PROGRESS_EVERY, "{:?} without PROGRESS", bench.now - heard);
                (heard, seen) = (bench.now, seen + 1);
            }
        }
    }
    assert!((40..=51).contains(&seen), "{seen} times in 20 s");
    bench.finish(1, &MismatchReply::default());
    bench.now += Duration::from_secs(1);
    assert!(!bench.tick().iter().any(|frame| frame.header.kind == Kind::Progress));
}

#[test]
fn heartbeat_every_second_with_its_state() {
    let mut bench = Bench { board: Scripted { state_bits: 0b1010, ..Scripted::default() }, ..Bench::default() };
    let mut states = Vec::new();
    for milliseconds in (0..3500).step_by(10) {
        bench.now = Duration::from_millis(milliseconds);
        if milliseconds == 500 {
            bench.hello(1, 1, 1);
        }
        if milliseconds == 1200 {
            bench.ask(1, &RAM);
        }
        for frame in bench.tick() {
            if (frame.header.kind, frame.header.message) == (Kind::Event, event::HEARTBEAT) {
                let beat = Heartbeat::from_payload(&frame.payload).unwrap();
                assert_eq!((beat.boot_id, beat.board_time_us), (77, 123));
                states.push((milliseconds, beat.state));
            }
        }
    }
    assert_eq!(states, [(0, 0b1010), (1000, 0b1011), (2000, 0b1111), (3000, 0b1010)]);
}

#[test]
fn stream_frames_pass_with_the_stream_as_their_message() {
    let mut bench = Bench::in_session();
    let head = StreamHead { stream: 1, format: 1, count: 1, ..StreamHead::default() };
    let samples = heapless::Vec::from_slice(&ImuSample::default().to_payload().unwrap()).unwrap();
    let frame = StreamFrame { head, samples };
    bench.board.outputs.push_back(BoardOutput::Stream(StreamId::Imu, frame.clone()));
    let sent = bench.tick();
    assert_eq!(brief(&sent), [(Kind::Stream, 0, 1)]);
    assert_eq!(StreamFrame::from_payload(&sent[0].payload).unwrap(), frame);
}

#[test]
fn frames_are_numbered_without_gaps_past_the_wrap() {
    let mut bench = Bench::default();
    let mut expected = 0_u16;
    for _ in 0..70_000 {
        let sent = bench.receive(Kind::Request, 1, Identity::ID, &[]);
        assert_eq!(sent[0].header.sequence, expected);
        expected = expected.wrapping_add(1);
    }
    assert_eq!(bench.slave.sent(), 70_000);
}

/// Bytes on the wire of a frozen vector.
fn wire_of(vector: &str) -> Vec<u8> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/vectors/v1-session.txt");
    let all = std::fs::read_to_string(path).unwrap();
    let (_, tail) = all.split_once(&format!("\nvector: {vector}\n")).unwrap();
    let digits = tail.lines().find_map(|line| line.strip_prefix("  wire: ")).unwrap();
    (0..digits.len()).step_by(2).map(|at| u8::from_str_radix(&digits[at..at + 2], 16).unwrap()).collect()
}

/// From wire to wire: the request bytes of the interface document give its answer bytes.
#[test]
fn the_board_answers_a_hello_with_the_bytes_of_the_vector() {
    let mut bench = Bench {
        board: Scripted { boot_id: Some(0xB007_1DEA), serial: "SB-0042", firmware: "1.4.2", ..Scripted::default() },
        ..Bench::default()
    };
    for _ in 0..3 {
        bench.ask(1, &Identity {});
    }
    let mut answer = |bytes: &[u8]| {
        let (mut decoder, mut rest, mut wire) = (FrameDecoder::default(), bytes, Vec::new());
        while let Some(frame) = decoder.next(&mut rest) {
            let mut send = |frame: Frame| wire.extend_from_slice(&encode(&frame));
            bench.slave.receive(&frame.unwrap(), bench.now, &mut bench.board, &mut send);
        }
        wire
    };
    assert_eq!(answer(&wire_of("hello.host")), wire_of("hello.board"));
    assert_eq!(answer(&wire_of("event.keep-alive")), []);
    assert_eq!(answer(&wire_of("hello.host-newer")), wire_of("hello.board-refuses"));
}

/// One step of a storm.
#[derive(Debug, Clone)]
enum Step {
    Ask { request: u16, message: u16, payload: Vec<u8> },
    Hello { nonce: u32, highest: u8 },
    Other { kind: u8, message: u16 },
    Finish { request: u16 },
    Wait { milliseconds: u64 },
}

fn step() -> impl Strategy<Value = Step> {
    let ids: Vec<u16> = Request::IDS.iter().map(|(id, _)| *id).chain([0, 0x99]).collect();
    let ask = (1..12_u16, proptest::sample::select(ids), proptest::collection::vec(any::<u8>(), 0..8));
    prop_oneof![
        6 => ask.prop_map(|(request, message, payload)| Step::Ask { request, message, payload }),
        4 => (1..12_u16).prop_map(|request| Step::Ask { request, message: RamTest::ID, payload: vec![0, 0] }),
        1 => (1..3_u32, 0..3_u8).prop_map(|(nonce, highest)| Step::Hello { nonce, highest }),
        1 => (0..8_u8, 0..5_u16).prop_map(|(kind, message)| Step::Other { kind, message }),
        3 => (1..12_u16).prop_map(|request| Step::Finish { request }),
        2 => (0..900_u64).prop_map(|milliseconds| Step::Wait { milliseconds }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// Any requests in any order. Every request is answered at once by exactly one ACCEPT, NAK or replayed RESULT
    /// (MAKE_SAFE and ABORT: results follow). No request runs twice at a time, and frames count without gaps.
    #[test]
    fn storms(steps in proptest::collection::vec(step(), 1..200)) {
        let mut bench = Bench::default();
        bench.hello(1, 1, 1);
        let mut running: Vec<u16> = Vec::new();
        let mut sequence = 1_u16;
        for step in steps {
            let (started, aborted) = (bench.board.started.len(), bench.board.aborted.len());
            let sent = match step.clone() {
                Step::Ask { request, message, payload } => {
                    let sent = bench.receive(Kind::Request, request, message, &payload);
                    let answers = |frame: &&Frame| {
                        let header = frame.header;
                        let first = matches!(header.kind, Kind::Accept | Kind::Nak) || header.flags.has(Flags::REPLAYED);
                        first && (header.request, header.message) == (request, message)
                    };
                    prop_assert_eq!(sent.iter().filter(answers).count(), 1, "{:?}: {:?}", &step, brief(&sent));
                    prop_assert!(sent.len() <= 2 + MAX_RUNNING);
                    sent
                }
                Step::Hello { nonce, highest } => {
                    bench.hello(1, highest, nonce);
                    sequence = sequence.wrapping_add(1);
                    Vec::new()
                }
                Step::Other { kind, message } => {
                    let kind = Kind::from_number(kind).unwrap();
                    let kind = if matches!(kind, Kind::Request | Kind::Hello) { Kind::Nak } else { kind };
                    let sent = bench.receive(kind, 1, message, &[]);
                    prop_assert!(sent.is_empty());
                    sent
                }
                Step::Finish { request } => bench.finish(request, &MismatchReply::default()),
                Step::Wait { milliseconds } => {
                    bench.now += Duration::from_millis(milliseconds);
                    bench.tick()
                }
            };
            for ended in &bench.board.aborted[aborted..] {
                prop_assert!(running.contains(ended), "{ended} was not running");
                running.retain(|request| request != ended);
            }
            for frame in &sent {
                prop_assert_eq!(frame.header.sequence, sequence);
                sequence = sequence.wrapping_add(1);
                if frame.header.kind == Kind::Result && !frame.header.flags.has(Flags::REPLAYED) {
                    running.retain(|request| *request != frame.header.request);
                }
            }
            for request in &bench.board.started[started..] {
                prop_assert!(!running.contains(request), "{request} was started while it ran");
                running.push(*request);
            }
            prop_assert!(running.len() <= MAX_RUNNING);
            prop_assert_eq!(bench.slave.is_busy(), !running.is_empty());
        }
    }
}
