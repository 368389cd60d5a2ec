//! The frozen wire vectors of `tests/vectors/`: each decodes to the expected value and encodes to the exact bytes.
//!
//! A failure means that this crate no longer speaks the protocol of the boards in the field. The vectors must not
//! change.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a helper of a test fails as the test does")]

use std::collections::BTreeMap;
use std::fmt::Debug;
use std::path::Path;

use gnc_protocol::calibration::*;
use gnc_protocol::error::FaultCode;
use gnc_protocol::message::*;
use gnc_protocol::pattern::Xorshift32;
use gnc_protocol::serial::{self, FrameDecoder};
use gnc_protocol::stream::*;
use gnc_protocol::wire::{FieldReader, List, Wire, text};
use gnc_protocol::{Call, Flags, Frame, Header, Kind, NakCode, Payload, Request};

/// A vector as written in the file.
struct Vector {
    frame: Frame,
    unstuffed: Vec<u8>,
    wire: Vec<u8>,
}

fn hex(digits: &str) -> Vec<u8> {
    assert!(digits.len().is_multiple_of(2), "odd number of digits: {digits}");
    (0..digits.len()).step_by(2).map(|at| u8::from_str_radix(&digits[at..at + 2], 16).unwrap()).collect()
}

fn read(file: &str) -> BTreeMap<String, Vector> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/vectors").join(file);
    let all = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut vectors = BTreeMap::new();
    for block in all.split("\nvector: ").skip(1) {
        let (name, lines) = block.split_once('\n').unwrap();
        let value = |key: &str| {
            let start = format!("  {key}:");
            let line = lines.lines().find_map(|line| line.strip_prefix(&start));
            line.unwrap_or_else(|| panic!("{name} has no {key}")).trim()
        };
        let number = |key: &str| u16::from_str_radix(value(key), 16).unwrap();
        let kind = value("kind").split(' ').next().unwrap().parse().unwrap();
        let frame = Frame {
            header: Header {
                version: value("version").parse().unwrap(),
                kind: Kind::from_number(kind).unwrap(),
                flags: Flags(u8::from_str_radix(value("flags"), 16).unwrap()),
                request: number("request"),
                message: number("message"),
                sequence: number("sequence"),
            },
            payload: Payload::from_slice(&hex(value("payload"))).unwrap(),
        };
        let vector = Vector { frame, unstuffed: hex(value("frame")), wire: hex(value("wire")) };
        assert!(vectors.insert(name.to_owned(), vector).is_none(), "{name} stands there twice");
    }
    assert!(!vectors.is_empty(), "{file} holds no vector");
    vectors
}

const FILES: [&str; 7] = [
    "v1-session.txt",
    "v1-calls.txt",
    "v1-calls-can.txt",
    "v1-calls-calibration.txt",
    "v1-streams.txt",
    "v1-streams-compensated.txt",
    "v1-stuffing.txt",
];

/// Header, checksum and stuffing of every vector, both ways.
#[test]
fn frames_encode_to_the_bytes_and_decode_to_the_values() {
    for file in FILES {
        for (name, vector) in read(file) {
            assert_eq!(vector.frame.to_bytes().as_slice(), vector.unstuffed, "{file} {name}: frame");
            assert_eq!(serial::encode(&vector.frame).as_slice(), vector.wire, "{file} {name}: wire");
            assert!(vector.wire.len() <= serial::on_wire(vector.frame.payload.len()), "{file} {name}: length");
            let mut decoder = FrameDecoder::default();
            let mut rest = vector.wire.as_slice();
            assert_eq!(decoder.next(&mut rest), Some(Ok(vector.frame)), "{file} {name}: decoded");
            assert!(rest.is_empty(), "{file} {name}: bytes left");
        }
    }
}

/// The vectors of one file, ticked off one by one.
struct Checklist(BTreeMap<String, Vector>);

impl Checklist {
    fn check<M: Wire + PartialEq + Debug>(&mut self, name: &str, kind: Kind, message: u16, expected: &M) {
        let vector = self.0.remove(name).unwrap_or_else(|| panic!("no vector {name}"));
        assert_eq!((vector.frame.header.kind, vector.frame.header.message), (kind, message), "{name}: header");
        assert_eq!(&M::from_payload(&vector.frame.payload).unwrap(), expected, "{name}: decoded");
        assert_eq!(expected.to_payload().unwrap(), vector.frame.payload, "{name}: encoded");
    }

    fn result(&mut self, name: &str, message: u16, expected: ResultHead, body: &impl Wire) {
        let vector = self.0.remove(name).unwrap_or_else(|| panic!("no vector {name}"));
        assert_eq!((vector.frame.header.kind, vector.frame.header.message), (Kind::Result, message), "{name}: header");
        let mut reader = FieldReader::new(&vector.frame.payload);
        assert_eq!(ResultHead::get(&mut reader).unwrap(), expected, "{name}: head");
        assert_eq!(reader.take_rest(), body.to_payload().unwrap().as_slice(), "{name}: body");
        assert_eq!(expected.to_payload().unwrap().as_slice(), &vector.frame.payload[..6], "{name}: head encoded");
    }

    /// A request, as its own type and through [`Request::decode`], and its result.
    fn call<C: Call + PartialEq + Debug>(&mut self, wrap: fn(C) -> Request, asked: C, elapsed_us: u32, reply: &C::Reply)
    where
        C::Reply: PartialEq + Debug,
    {
        let (request, result) = (format!("{}.request", C::NAME), format!("{}.result", C::NAME));
        let payload = self.0[&request].frame.payload.clone();
        self.check(&request, Kind::Request, C::ID, &asked);
        let whole = wrap(asked);
        assert_eq!(whole.id(), C::ID);
        assert_eq!(Request::decode(C::ID, &payload).unwrap().unwrap(), whole, "{request}");
        let body = &self.0[&result].frame.payload[6..];
        assert_eq!(&C::Reply::from_payload(body).unwrap(), reply, "{result}: decoded");
        self.result(&result, C::ID, ResultHead { status: FaultCode::None, elapsed_us }, reply);
    }

    fn all_seen(self) {
        assert!(self.0.is_empty(), "never checked: {:?}", self.0.keys());
    }
}

fn host_hello(lowest: u8, highest: u8) -> HostHello {
    HostHello { magic: MAGIC, lowest, highest, nonce: 0x1234_5678 }
}

fn board_hello(chosen: u8) -> BoardHello {
    BoardHello {
        magic: MAGIC,
        chosen,
        lowest: 1,
        highest: 1,
        nonce: 0x1234_5678,
        boot_id: 0xB007_1DEA,
        capabilities: capability::POWER,
        serial: text("SB-0042"),
        firmware: text("1.4.2"),
    }
}

#[test]
fn session_messages() {
    let mut list = Checklist(read("v1-session.txt"));
    list.check("hello.host", Kind::Hello, 0, &host_hello(1, 1));
    list.check("hello.host-newer", Kind::Hello, 0, &host_hello(2, 3));
    list.check("hello.board", Kind::Hello, 0, &board_hello(1));
    list.check("hello.board-refuses", Kind::Hello, 0, &board_hello(0));
    list.check("accept", Kind::Accept, FlashErase::ID, &Accept { expected_ms: 350 });
    list.check("progress", Kind::Progress, FlashErase::ID, &Progress { done_permille: 417, elapsed_ms: 146 });
    let nak = Nak { code: NakCode::Busy as u16, text: text("four requests are running") };
    list.check("nak.busy", Kind::Nak, RamTest::ID, &nak);
    let aborted = ResultHead { status: FaultCode::Aborted, elapsed_us: 0 };
    list.result("result.aborted", RamTest::ID, aborted, &text::<160>(""));
    let late = ResultHead { status: FaultCode::DeviceTimeout, elapsed_us: 250_000 };
    list.result("result.device-timeout", FlashId::ID, late, &text::<160>("no answer on the µSPI bus"));
    assert!(list.0["request.resent"].frame.header.flags.has(Flags::RESENT));
    list.check("request.resent", Kind::Request, Identity::ID, &Identity {});
    assert!(list.0["result.replayed"].frame.header.flags.has(Flags::REPLAYED));
    list.result("result.replayed", MakeSafe::ID, ResultHead { status: FaultCode::None, elapsed_us: 0 }, &());
    let beat = Heartbeat { boot_id: 0xB007_1DEA, board_time_us: 0x1_0203_0405, state: 7 };
    list.check("event.heartbeat", Kind::Event, event::HEARTBEAT, &beat);
    let first = Heartbeat { boot_id: 0xB007_1DEB, board_time_us: 12, state: 0 };
    list.check("event.board-started", Kind::Event, event::HEARTBEAT, &first);
    list.check("event.keep-alive", Kind::Event, event::KEEP_ALIVE, &());
    list.check("event.watchdog", Kind::Event, event::WATCHDOG, &());
    list.all_seen();
}

fn list<T: Clone, const N: usize>(elements: &[T]) -> List<T, N> {
    List::from_slice(elements).unwrap()
}

fn record(index: u16, request: u16, message: u16, kind: ErrorKind) -> ErrorRecord {
    ErrorRecord { index, request, message, kind: kind as u16, ..ErrorRecord::default() }
}

/// The coefficients of the vectors, written a third time.
fn calibration() -> Calibration {
    Calibration {
        id: 7001,
        accel_matrix: [[6.12e-05, -5e-08, 3e-08], [7e-08, 6.15e-05, -2e-08], [-4e-08, 6e-08, 6.14e-05]],
        accel_offset: [-0.049, 0.078, -0.059],
        gyro_matrix: [[8.71e-07, 1e-09, -2e-09], [-1.5e-09, 8.74e-07, 5e-10], [1e-09, 2e-09, 8.72e-07]],
        gyro_offset: [0.0014, -0.00087, 0.00105],
        gyro_per_force: [[2.1e-05, -7e-06, 5e-06], [3e-06, -1.6e-05, 9e-06], [-5e-06, 7e-06, 1.8e-05]],
        mag_dx: 0.02,
        mag_dy: -0.014,
        mag_ky: 1.021,
        mag_sin_alpha: 0.0125,
    }
}

fn calibration_calls(vectors: &mut Checklist) {
    let checksum = calibration().checksum();
    let written = CalibrationWrite { calibration: calibration() };
    vectors.call(Request::CalibrationWrite, written, 1_000, &());
    let stored = CalibrationCommitReply { counter: 3, duration_us: 121_345 };
    vectors.call(Request::CalibrationCommit, CalibrationCommit { checksum }, 121_345, &stored);
    let valid = CalibrationState::Valid as u8;
    let read = CalibrationReadReply { state: valid, counter: 3, checksum, calibration: list(&[calibration()]) };
    vectors.call(Request::CalibrationRead, CalibrationRead {}, 1_000, &read);
    let head = ResultHead { status: FaultCode::None, elapsed_us: 1_000 };
    let none = CalibrationReadReply::default();
    vectors.result("CalibrationRead.uncalibrated", CalibrationRead::ID, head, &none);
    let nak = Nak { code: NakCode::NotCalibrated as u16, text: text("write and commit a calibration first") };
    vectors.check("nak.not-calibrated", Kind::Nak, StreamStart::ID, &nak);
}

#[test]
fn every_call() {
    let mut vectors = Checklist(read("v1-calls.txt"));
    vectors.0.extend(read("v1-calls-can.txt"));
    vectors.0.extend(read("v1-calls-calibration.txt"));
    let named: Vec<_> = Request::IDS.iter().map(|(_, name)| format!("{name}.request")).collect();
    assert!(named.iter().all(|name| vectors.0.contains_key(name)), "a request without a vector");

    vectors.call(Request::MakeSafe, MakeSafe {}, 0, &());
    calibration_calls(&mut vectors);
    let state = CanState::ErrorPassive as u8;
    let counters = CanCountersReply { state, tx_errors: 136, rx_errors: 7, received: 216, echoed: 215 };
    vectors.call(Request::CanCounters, CanCounters {}, 1_000, &counters);
    vectors.call(Request::Abort, Abort { request: 0x2015 }, 0, &AbortReply { was_running: 1 });
    let power = PowerReply { supply_uv: 5_012_345, supply_ua: 491_234 };
    vectors.call(Request::ModulePower, ModulePower { on: 1 }, 20_000, &power);
    let memory = ErrorRecord {
        board_time_us: 81_000_123,
        place: 0x12345,
        expected: 0xAAAA,
        got: 0xAAA8,
        ..record(3, 0x2015, RamTest::ID, ErrorKind::MemoryMismatch)
    };
    let sci = ErrorRecord {
        board_time_us: 82_000_456,
        place: 17,
        expected: 0x5A,
        got: 0x100,
        ..record(4, 0x201E, SciEcho::ID, ErrorKind::SciMismatch)
    };
    let records = ErrorRecordsReply { total: 5, records: list(&[memory, sci]) };
    vectors.call(Request::ErrorRecords, ErrorRecords { from: 3 }, 0, &records);
    let counters = LinkCountersReply { frames: 1001, bad_checksum: 2, malformed: 3, missing: 4, sent: 70_005 };
    vectors.call(Request::LinkCounters, LinkCounters {}, 0, &counters);
    let identity = IdentityReply {
        serial_number: text("GNC-2026-000123"),
        part: text("GNC-POP-26"),
        hardware: text("C"),
        firmware: text("2.1.0"),
        protocol: 1,
    };
    vectors.call(Request::Identity, Identity {}, 1500, &identity);
    let words: List<u32, 64> = list(&[0, 0xFFFF_FFFF, 0x5555_5555, 0x1234_5678]);
    let asked = CpuWords { core: 2, target: WordTarget::Memory as u8, words: words.clone() };
    vectors.call(Request::CpuWords, asked, 40, &CpuWordsReply { words });
    let pairs = list(&[[7, -2], [-7, 2], [i32::MIN, -1], [i32::MAX, i32::MAX]]);
    let results = list(&[
        [5, 9, -14, -3, 1],
        [-5, -9, -14, -3, -1],
        [i32::MAX, -i32::MAX, i32::MIN, i32::MIN, 0],
        [-2, 0, 1, 1, 0],
    ]);
    vectors.call(Request::CpuIntegers, CpuIntegers { core: 1, pairs }, 12, &CpuIntegersReply { results });
    let results = list(&[[4.0, -2.0, 3.0, 1.0 / 3.0], [-2.5 + 0.1, -2.5 - 0.1, -2.5 * 0.1, -2.5 / 0.1]]);
    let asked = CpuFloats { core: 2, pairs: list(&[[1.0, 3.0], [-2.5, 0.1]]) };
    vectors.call(Request::CpuFloats, asked, 12, &CpuFloatsReply { results });
    let intervals = TimerMeasureReply { interrupts: 3, intervals_ns: list(&[500_010, 499_990, 500_020]) };
    vectors.call(Request::TimerMeasure, TimerMeasure { timer: 2, period_us: 500, count: 3 }, 1502, &intervals);
    let ram = RamTest { ram: Ram::Sdram as u8, pattern: RamPattern::MarchC as u8 };
    let found = MismatchReply {
        words: 1_048_576,
        mismatches: 3,
        first_place: 0x54321,
        expected: 0xFFFF_FFFF,
        got: 0xFFFF_FFEF,
    };
    vectors.call(Request::RamTest, ram, 1_800_000, &found);
    let id = FlashIdReply { jedec: [0xEF, 0x40, 0x18], sector_bytes: 4096, scratch_sectors: 4 };
    vectors.call(Request::FlashId, FlashId { flash: Flash::Spi as u8 }, 90, &id);
    vectors.call(
        Request::FlashErase,
        FlashErase { flash: 0, sector: 3 },
        45_230,
        &DurationReply { duration_us: 45_200 },
    );
    let blank = MismatchReply { words: 4096, ..MismatchReply::default() };
    let asked = FlashBlankCheck { flash: Flash::Internal as u8, sector: 2 };
    vectors.call(Request::FlashBlankCheck, asked, 5000, &blank);
    let seed = 2_463_534_242;
    let asked = FlashWrite { flash: 0, sector: 3, seed };
    vectors.call(Request::FlashWrite, asked, 11_340, &DurationReply { duration_us: 11_300 });
    let expected = Xorshift32::new(seed).nth(2).unwrap();
    let found = MismatchReply { words: 1024, mismatches: 1, first_place: 2, expected, got: expected + 1 };
    vectors.call(Request::FlashVerify, FlashVerify { flash: 0, sector: 3, seed }, 5000, &found);
    let channels = list(&[
        AdChannel { channel: 1, mean_uv: 2_612_000, min_uv: 2_611_000, max_uv: 2_613_100 },
        AdChannel { channel: 8, mean_uv: -150, min_uv: -900, max_uv: 600 },
    ]);
    vectors.call(Request::AdRead, AdRead { channels: 0x81, samples: 100 }, 10_000, &AdReadReply { channels });
    vectors.call(Request::IoTest, IoTest { driver: 0, reader: 3, level: 1 }, 60, &IoTestReply { levels: 0b1001 });
    let data: List<u8, 256> = list(&[0x00, 0x01, 0xFE, 0xFF]);
    let asked = SpiTransfer { direction: SpiDirection::ToModule as u8, clock_hz: 1_000_000, data: data.clone() };
    vectors.call(Request::SpiTransfer, asked, 33, &SpiTransferReply { data });
    let data: List<u8, 256> = (0..=255).collect();
    let echo = SciEchoReply { framing_errors: 1, parity_errors: 2, overruns: 3, data: data.clone() };
    vectors.call(Request::SciEcho, SciEcho { rate_baud: 115_200, data }, 22_300, &echo);
    vectors.call(Request::GnssRestart, GnssRestart { start: GnssStart::Cold as u8 }, 800, &());
    let start = StreamStart { stream: StreamId::Imu as u8, rate_hz: 1000, count: 100_000, samples_per_frame: 10 };
    let load = u16::try_from(imu_load_permille(1000, 10, 921_600)).unwrap();
    let started = StreamStartReply { format: Format::Imu as u8, samples_per_frame: 10, load_permille: load };
    vectors.call(Request::StreamStart, start, 0, &started);
    let stopped = StreamStopReply { produced: 100_000, dropped: 24 };
    vectors.call(Request::StreamStop, StreamStop { stream: 1 }, 0, &stopped);
    vectors.all_seen();
}

fn stream_frame(head: StreamHead, samples: &[impl Wire]) -> StreamFrame {
    let mut bytes = heapless::Vec::new();
    for sample in samples {
        bytes.extend_from_slice(&sample.to_payload().unwrap()).unwrap();
    }
    StreamFrame { head, samples: bytes }
}

#[test]
fn stream_frames() {
    let mut list = Checklist(read("v1-streams.txt"));
    let streams =
        [("imu.two-samples", StreamId::Imu), ("gnss.bytes", StreamId::Gnss), ("pps.one-capture", StreamId::Pps)];
    for (name, stream) in streams {
        let header = Header { sequence: list.0[name].frame.header.sequence, ..stream_header(stream) };
        assert_eq!(header, list.0[name].frame.header);
    }
    let head = StreamHead { stream: 1, format: 1, count: 2, first: 70_000, board_time_us: 123_456_789, dropped: 24 };
    let one = ImuSample {
        gyro: [100, -200, 300],
        accel: [-1600, 800, 160_000],
        mag: [250_000, -125_000, 500_000],
        gyro_temperature: 2345,
        accel_temperature: 2301,
    };
    let two = ImuSample {
        gyro: [101, -201, 299],
        accel: [-1599, 801, 159_998],
        mag: [250_010, -125_020, 500_030],
        gyro_temperature: 2345,
        accel_temperature: -4000,
    };
    assert_eq!((one.to_payload().unwrap().len(), head.to_payload().unwrap().len()), (IMU_SAMPLE, STREAM_HEAD));
    list.check("imu.two-samples", Kind::Stream, 1, &stream_frame(head, &[one, two]));
    let ends = [SATURATION, -SATURATION - 1, 0];
    let saturated =
        ImuSample { gyro: ends, accel: ends, mag: [0; 3], gyro_temperature: i16::MAX, accel_temperature: i16::MIN };
    let head = StreamHead { stream: 1, format: 1, count: 1, first: 0, board_time_us: 5_000_000, dropped: 0 };
    list.check("imu.saturated", Kind::Stream, 1, &stream_frame(head, &[saturated]));
    let line = b"$GNGGA,063000.00,3957.0000,N,11619.0000,E,1,12,0.8,50.0,M,-9.0,M,,*7D\r\n";
    let head = StreamHead { stream: 2, format: 2, count: 71, first: 4096, board_time_us: 6_000_000, dropped: 0 };
    list.check("gnss.bytes", Kind::Stream, 2, &stream_frame(head, line));
    let head = StreamHead { stream: 3, format: 3, count: 1, first: 7, board_time_us: 7_000_001, dropped: 0 };
    let edge = PpsCapture { board_time_ns: 7_000_001_230 };
    list.check("pps.one-capture", Kind::Stream, 3, &stream_frame(head, &[edge]));
    list.all_seen();
}

#[test]
fn compensated_samples() {
    let mut list = Checklist(read("v1-streams-compensated.txt"));
    let head =
        StreamHead { stream: 4, format: 4, count: 2, first: 40, board_time_us: 123_456_789, ..StreamHead::default() };
    let one = CompensatedSample {
        rate: [104_403_284, -1_472_552, 14_900],
        force: [31_614, -274_317, 9_784_319],
        field: [2_317_538, -1_388_560, 4_120_000],
        roll: 53_979_651,
        saturated: 0,
        gyro_temperature: 2364,
        accel_temperature: 2301,
    };
    let two = CompensatedSample {
        rate: [730_139_395, -3_377_268, 1_092_759],
        force: [451_127, -515_824_511, 9_280_054],
        field: [-2_721_143, 1_674_440, 4_120_000],
        roll: -258_996_689,
        saturated: 0b1_0001,
        gyro_temperature: 2364,
        accel_temperature: -4000,
    };
    assert_eq!(one.to_payload().unwrap().len(), COMPENSATED_SAMPLE);
    list.check("compensated", Kind::Stream, 4, &stream_frame(head, &[one, two]));
    // The raw samples are for the other end: see the tests of the simulated bench.
    list.0.remove("raw").unwrap();
    list.all_seen();
}

/// A coefficient outside its range is found and named; NaN is in no range.
#[test]
fn coefficients_have_ranges() {
    assert_eq!(calibration().bad_field(), None);
    type Spoil = fn(&mut Calibration);
    let spoilt: [(&str, Spoil); 8] = [
        ("id", |c| c.id = 0),
        ("accel_matrix", |c| c.accel_matrix[2][1] = f64::NAN),
        ("gyro_offset", |c| c.gyro_offset[2] = f64::INFINITY),
        ("gyro_per_force", |c| c.gyro_per_force[0][2] = f64::NEG_INFINITY),
        ("mag_dy", |c| c.mag_dy = f64::NAN),
        ("mag_ky", |c| c.mag_ky = 0.0),
        ("mag_sin_alpha", |c| c.mag_sin_alpha = 1.0),
        ("mag_sin_alpha", |c| c.mag_sin_alpha = f64::NAN),
    ];
    for (field, spoil) in spoilt {
        let mut bad = calibration();
        spoil(&mut bad);
        assert_eq!(bad.bad_field(), Some(field));
    }
}

/// Encoders differ: some add a 01 after a full run at the very end. Receivers take both forms.
#[test]
fn a_full_run_at_the_end_may_be_followed_by_a_code_of_its_own() {
    for length in [242, 496] {
        let vector = read("v1-stuffing.txt").remove(&format!("no-zero-{length}")).unwrap();
        let mut wire = vector.wire;
        let delimiter = wire.pop();
        wire.extend([1, delimiter.unwrap()]);
        assert_eq!(FrameDecoder::default().next(&mut wire.as_slice()), Some(Ok(vector.frame)), "payload of {length}");
    }
}

/// The check value of CRC-32C in the catalogues.
#[test]
fn checksum_of_the_nine_digits() {
    assert_eq!(gnc_protocol::frame::checksum(b"123456789"), 0xE306_9283);
}

fn icd() -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/ICD.md")).unwrap()
}

/// The frames shown in the interface document are vectors, so that a mistake there is found.
#[test]
fn frames_in_the_interface_document_are_vectors() {
    let wires: Vec<Vec<u8>> =
        FILES.iter().flat_map(|file| read(file).into_values().map(|vector| vector.wire)).collect();
    let document = icd();
    let mut shown: Vec<Vec<u8>> = Vec::new();
    let mut open: Option<Vec<u8>> = None;
    for word in document.split_whitespace().map(|word| word.trim_matches(['`', '.', ',', ';'])) {
        let byte = if word.len() == 2 { u8::from_str_radix(word, 16).ok() } else { None };
        match (byte, open.as_mut()) {
            (Some(byte), Some(bytes)) => {
                bytes.push(byte);
                if byte == 0 {
                    shown.extend(open.take().filter(|bytes| bytes.len() >= 14));
                }
            }
            (Some(0), None) => open = Some(vec![0]),
            _ => open = None,
        }
    }
    assert!(shown.len() >= 12, "only {} frames were found in the document", shown.len());
    for bytes in shown {
        assert!(wires.contains(&bytes), "in the interface document, but no vector: {bytes:02x?}");
    }
}

/// Every message, code and kind has a row.
#[test]
fn the_interface_document_names_everything() {
    let document = icd();
    let find = |row: String| assert!(document.contains(&row), "no row {row:?} in the interface document");
    for (id, name) in Request::IDS {
        find(format!("| 0x{id:04X} | [{name}]"));
        find(format!("\n### 0x{id:04X} {name}\n"));
    }
    let section = |from: &str, to: &str| document.split_once(from).unwrap().1.split_once(to).unwrap().0.to_owned();
    let naks = section("**NAK**", "**Status");
    assert!(NakCode::ALL.iter().all(|code| naks.contains(&format!("\n| {} |", *code as u16))));
    assert_eq!(naks.matches("\n| ").count(), NakCode::ALL.len() + 2, "a code too many");
    let statuses = section("**Status", "A host takes");
    assert!(FaultCode::ALL.iter().all(|code| statuses.contains(&format!("\n| {} |", *code as u16))));
    assert_eq!(statuses.matches("\n| ").count(), FaultCode::ALL.len() + 2, "a status too many");
    let kinds = section("**Kinds of error records**", "## 13");
    assert!(ErrorKind::ALL.iter().all(|kind| kinds.contains(&format!("\n| {} |", *kind as u16))));
    assert_eq!(kinds.matches("\n| ").count(), ErrorKind::ALL.len() + 2, "a kind too many");
}

/// The numbers are written out, since a board in the field has these numbers and not our names for them.
#[test]
fn the_numbers_of_the_interface_document() {
    use gnc_protocol::{frame, slave, timing};
    let milliseconds = [
        timing::ACCEPT_WITHIN,
        timing::PROGRESS_EVERY,
        timing::PROGRESS_LOST_AFTER,
        timing::HEARTBEAT_EVERY,
        timing::KEEP_ALIVE_EVERY,
        timing::WATCHDOG,
    ];
    assert_eq!(milliseconds.map(|time| time.as_millis()), [50, 500, 1500, 1000, 500, 1750]);
    assert_eq!((timing::RESENDS, slave::MAX_RUNNING, slave::KEPT_RESULTS), (3, 4, 8));
    assert_eq!((gnc_protocol::PROTOCOL_VERSION, frame::MAX_PAYLOAD, frame::MAX_FRAME), (1, 512, 524));
    assert_eq!(
        (serial::MAX_STUFFED, serial::MAX_ON_WIRE, serial::on_wire(512), serial::on_wire(0)),
        (527, 529, 529, 15)
    );
    let microseconds = |bytes, rate| timing::wire_time(bytes, rate).as_micros();
    assert_eq!(
        (microseconds(529, 115_200), microseconds(529, 921_600), microseconds(15, 460_800)),
        (45_921, 5_741, 326)
    );
    assert_eq!((MAX_SAMPLE_BYTES, MAX_IMU_SAMPLES, MAX_LOAD_PERMILLE), (492, 12, 900));
    assert_eq!((COMPENSATED_SAMPLE, MAX_COMPENSATED_SAMPLES), (46, 10));
    assert_eq!((RATE_PER_RPS, FORCE_PER_MPS2, FIELD_PER_GAUSS, ROLL_PER_RAD), (1e8, 1e6, 1e7, 1e8));
    let compensated = |rate_hz, per_frame, baud| load_permille(COMPENSATED_SAMPLE, rate_hz, per_frame, baud);
    let table = [(200, 1), (200, 10), (1000, 1), (1000, 10)];
    let row = |(rate_hz, n)| [115_200, 460_800, 921_600].map(|baud| compensated(rate_hz, n, baud));
    let expected = [[1406, 351, 175], [861, 215, 107], [7031, 1757, 878], [4305, 1076, 538]];
    assert_eq!(table.map(row), expected);
    assert_eq!((GYRO_LSB_PER_DPS, ACCEL_LSB_PER_G, MAG_LSB_PER_GAUSS), (20_000.0, 160_000.0, 1_250_000.0));
    assert_eq!(SATURATION, (1 << 23) - 1);
    let first: Vec<u32> = Xorshift32::new(1).take(4).collect();
    assert_eq!(first, [0x0004_2021, 0x0408_0601, 0x9DCC_A8C5, 0x1255_994F]);
}
