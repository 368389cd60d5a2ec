//! The frozen vectors of `tests/vectors/v1-can.txt` and `v1-can-compensated.txt`, which must not change.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use gnc_protocol::can::endpoint::{Endpoint, EndpointRole};
use gnc_protocol::can::id::{echo_of, is_echo};
use gnc_protocol::can::stream::{Packer, Unpacker};
use gnc_protocol::can::{CanFrame, CanId, slcan};
use gnc_protocol::message::{Heartbeat, StreamStart, event};
use gnc_protocol::stream::{Format, ImuSample, PpsCapture, StreamFrame, StreamHead, StreamId};
use gnc_protocol::wire::Wire;
use gnc_protocol::{Flags, Frame, Header, Kind, PROTOCOL_VERSION, Payload};

type Bus = Vec<(char, CanFrame)>;

#[derive(Default)]
struct Vector {
    message: Option<Frame>,
    bus: Bus,
    lines: Vec<(CanFrame, Vec<u8>)>,
}

fn hex(digits: &str) -> Vec<u8> {
    let digits = if digits == "-" { "" } else { digits };
    (0..digits.len()).step_by(2).map(|at| u8::from_str_radix(&digits[at..at + 2], 16).unwrap()).collect()
}

fn can(id: &str, data: &str) -> CanFrame {
    let number = u32::from_str_radix(id, 16).unwrap();
    let id = if id.len() == 3 { CanId::Standard(number as u16) } else { CanId::Extended(number) };
    CanFrame::new(id, &hex(data)).unwrap()
}

fn read() -> BTreeMap<String, Vector> {
    read_file("v1-can.txt")
}

fn read_file(file: &str) -> BTreeMap<String, Vector> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/vectors").join(file);
    let all = std::fs::read_to_string(path).unwrap();
    let mut vectors = BTreeMap::new();
    for block in all.split("\nvector: ").skip(1) {
        let (name, lines) = block.split_once('\n').unwrap();
        let mut vector = Vector::default();
        for line in lines.lines() {
            match *line.split_whitespace().collect::<Vec<_>>() {
                ["message:", bytes] => vector.message = Some(Frame::from_bytes(&hex(bytes)).unwrap()),
                ["can:", way, id, data] => vector.bus.push((way.chars().next().unwrap(), can(id, data))),
                ["slcan:", id, data, text] => vector.lines.push((can(id, data), text.as_bytes().to_vec())),
                ["why:", ..] | [] => {}
                _ => panic!("{name}: {line}"),
            }
        }
        assert!(vectors.insert(name.to_owned(), vector).is_none(), "{name} stands there twice");
    }
    vectors
}

/// Sends a frame of the conversation from one end to the other. Returns the frames on the bus and the frames that
/// arrived.
fn carry(frame: &Frame, from_host: bool) -> (Bus, Vec<Frame>) {
    let (mut host, mut board) = (Endpoint::new(EndpointRole::Host), Endpoint::new(EndpointRole::Board));
    let (mut bus, mut arrived) = (Bus::new(), Vec::new());
    let way = if from_host { '>' } else { '<' };
    let sender = if from_host { &mut host } else { &mut board };
    sender.send(frame, &mut |raw| bus.push((way, raw)));
    let receiver = if from_host { &mut board } else { &mut host };
    for (_, raw) in &bus {
        arrived.extend(receiver.receive(raw, Duration::ZERO).map(Result::unwrap));
    }
    while !(host.is_idle() && board.is_idle()) {
        while let Some(frame) = host.poll(Duration::ZERO) {
            bus.push(('>', frame));
            arrived.extend(board.receive(&frame, Duration::ZERO).map(Result::unwrap));
        }
        while let Some(frame) = board.poll(Duration::ZERO) {
            bus.push(('<', frame));
            arrived.extend(host.receive(&frame, Duration::ZERO).map(Result::unwrap));
        }
    }
    (bus, arrived)
}

fn event_frame(message: u16, payload: Payload) -> Frame {
    let (kind, flags) = (Kind::Event, Flags::default());
    Frame { header: Header { version: PROTOCOL_VERSION, kind, flags, request: 0, message, sequence: 0 }, payload }
}

#[test]
fn messages_travel_as_in_the_vectors() {
    let vectors = read();
    let messages: Vec<_> = vectors.iter().filter(|(_, vector)| vector.message.is_some()).collect();
    assert_eq!(messages.len(), 5);
    for (name, vector) in messages {
        let frame = vector.message.as_ref().unwrap();
        let (bus, arrived) = carry(frame, vector.bus[0].0 == '>');
        assert_eq!(bus, vector.bus, "{name}");
        assert_eq!(arrived, std::slice::from_ref(frame), "{name}");
    }
}

#[test]
fn signs_of_life_are_raw_frames() {
    let vectors = read();
    let beat = Heartbeat { boot_id: 0xB007_1DEA, board_time_us: 0x0102_0304_0506, state: 7 };
    for (name, from_host, frame) in [
        ("keep-alive", true, event_frame(event::KEEP_ALIVE, Payload::new())),
        ("heartbeat", false, event_frame(event::HEARTBEAT, beat.to_payload().unwrap())),
        ("watchdog", false, event_frame(event::WATCHDOG, Payload::new())),
    ] {
        let (bus, arrived) = carry(&frame, from_host);
        assert_eq!(bus, vectors[name].bus, "{name}");
        assert_eq!(arrived, [frame], "{name}");
    }
}

fn start(stream: StreamId) -> StreamStart {
    let rate_hz = if stream == StreamId::Imu { 1000 } else { 0 };
    StreamStart { stream: stream as u8, rate_hz, count: 0, samples_per_frame: 0 }
}

fn frame_of(stream: StreamId, format: Format, first: u32, time_us: u64, count: usize, samples: &[u8]) -> StreamFrame {
    let head = StreamHead {
        stream: stream as u8,
        format: format as u8,
        count: count as u16,
        first,
        board_time_us: time_us,
        dropped: 0,
    };
    StreamFrame { head, samples: samples.iter().copied().collect() }
}

fn packed(stream: StreamId, frames: &[StreamFrame]) -> Bus {
    let mut packer = Packer::default();
    packer.start(&start(stream));
    let mut bus = Bus::new();
    frames.iter().for_each(|frame| packer.pack(frame, &mut |raw| bus.push(('<', raw))));
    bus
}

fn unpacked(stream: StreamId, bus: &Bus) -> Vec<StreamFrame> {
    let mut unpacker = Unpacker::default();
    unpacker.start(&start(stream));
    let number = |frame: &CanFrame| match frame.id() {
        CanId::Standard(id) => id,
        CanId::Extended(id) => panic!("{id:x}"),
    };
    bus.iter().filter_map(|(_, frame)| unpacker.receive(number(frame), frame.data())).collect()
}

/// 18 bits: the received value is the middle of the sent step of 64 counts; saturation stays saturation.
#[test]
fn imu_samples() {
    let bus = &read()["imu"].bus;
    let sent = [
        ImuSample {
            gyro: [20_000, -20_000, 0],
            accel: [0, -64, 160_000],
            mag: [8_388_607, -8_388_608, -1],
            gyro_temperature: 2364,
            accel_temperature: -500,
        },
        ImuSample {
            gyro: [63, 64, 0],
            accel: [8_388_606, -8_388_607, 160_063],
            mag: [1, 2, 3],
            gyro_temperature: 2364,
            accel_temperature: -500,
        },
    ];
    let bytes: Vec<u8> = sent.iter().flat_map(|sample| sample.to_payload().unwrap()).collect();
    let mut frame = frame_of(StreamId::Imu, Format::Imu, 1088, 1_088_000, 2, &bytes);
    frame.head.dropped = 3;
    assert_eq!(&packed(StreamId::Imu, &[frame]), bus);

    let got = unpacked(StreamId::Imu, bus);
    let samples: Vec<_> = got.iter().map(|frame| ImuSample::from_payload(&frame.samples).unwrap()).collect();
    assert_eq!(samples[0].gyro, [20_000, -20_000, 32], "both lie in the middle of a step");
    assert_eq!(samples[0].accel, [32, -32, 160_032]);
    assert_eq!(samples[0].mag, [8_388_607, -8_388_608, -32]);
    assert_eq!((samples[0].gyro_temperature, samples[0].accel_temperature), (2364, -500));
    assert_eq!(samples[1].gyro, [32, 96, 32]);
    assert_eq!(samples[1].accel, [8_388_480 + 32, -8_388_544 + 32, 160_032], "near the ends, not at them");
    let heads: Vec<_> =
        got.iter().map(|frame| (frame.head.first, frame.head.board_time_us, frame.head.dropped)).collect();
    assert_eq!(heads, [(1088, 1_088_000, 3), (1089, 1_089_000, 3)]);
}

/// Bytes 40 and 41 of the two samples hold the saturated channels: 0 and 17.
#[test]
fn compensated_samples() {
    let bus = &read_file("v1-can-compensated.txt")["compensated"].bus;
    assert_eq!(bus.len(), 2 + 8 + 8);
    let bytes: Vec<u8> = bus[2..].iter().flat_map(|(_, frame)| frame.data()[2..].to_vec()).collect();
    assert_eq!((bytes.len(), bytes[40], bytes[46 + 40]), (92, 0, 17));
    let start = StreamStart { stream: 4, rate_hz: 200, count: 0, samples_per_frame: 1 };
    let mut frame = frame_of(StreamId::Compensated, Format::Compensated, 8256, 41_285_000, 2, &bytes);
    frame.head.dropped = 2;
    let (mut packer, mut sent) = (Packer::default(), Bus::new());
    packer.start(&start);
    packer.pack(&frame, &mut |raw| sent.push(('<', raw)));
    assert_eq!(&sent, bus);

    let mut unpacker = Unpacker::default();
    unpacker.start(&start);
    let number = |frame: &CanFrame| if let CanId::Standard(id) = frame.id() { id } else { panic!("{frame:?}") };
    let got: Vec<_> = bus.iter().filter_map(|(_, frame)| unpacker.receive(number(frame), frame.data())).collect();
    let heads: Vec<_> =
        got.iter().map(|frame| (frame.head.first, frame.head.board_time_us, frame.head.dropped)).collect();
    assert_eq!(heads, [(8256, 41_285_000, 2), (8257, 41_290_000, 2)]);
    assert_eq!((&got[0].samples[..], &got[1].samples[..]), (&bytes[..46], &bytes[46..]));
}

#[test]
fn bytes_and_captures() {
    let vectors = read();
    let bytes = frame_of(StreamId::Gnss, Format::Bytes, 65_530, 1_000_000, 9, b"$GPGGA,1\r");
    assert_eq!(packed(StreamId::Gnss, &[bytes]), vectors["gnss"].bus);
    let got = unpacked(StreamId::Gnss, &vectors["gnss"].bus);
    let expected = [
        frame_of(StreamId::Gnss, Format::Bytes, 65_530, 1_000_000, 6, b"$GPGGA"),
        frame_of(StreamId::Gnss, Format::Bytes, 65_536, 1_000_000, 3, b",1\r"),
    ];
    assert_eq!(got, expected);

    let pulse = |first: u32, board_time_ns: u64| {
        let capture = PpsCapture { board_time_ns }.to_payload().unwrap();
        frame_of(StreamId::Pps, Format::Pps, first, board_time_ns / 1000, 1, &capture)
    };
    let pulses = [pulse(0, 1_234_567_890), pulse(1, 2_234_567_880)];
    assert_eq!(packed(StreamId::Pps, &pulses), vectors["pps"].bus);
    assert_eq!(unpacked(StreamId::Pps, &vectors["pps"].bus), pulses);
}

#[test]
fn test_frames_go_back_under_another_id() {
    for pair in read()["echo"].bus.chunks(2) {
        let [('>', sent), ('<', back)] = pair else { panic!("{pair:?}") };
        assert_eq!(echo_of(sent.id()), Some(back.id()));
        assert!(is_echo(back.id()) && !is_echo(sent.id()));
        assert_eq!(echo_of(back.id()), None, "an echo must not be echoed");
    }
}

#[test]
fn lines_of_slcan() {
    let lines = &read()["slcan"].lines;
    assert_eq!(lines.len(), 5);
    for (frame, line) in lines {
        let whole: Vec<u8> = line.iter().copied().chain(*b"\r").collect();
        assert_eq!(slcan::encode(frame).as_slice(), whole);
        let mut rest = whole.as_slice();
        assert_eq!(slcan::SlcanDecoder::default().next(&mut rest), Some(slcan::SlcanEvent::Frame(*frame)));
        let mut lower = whole.clone();
        lower[1..].make_ascii_lowercase();
        assert_eq!(slcan::SlcanDecoder::default().next(&mut lower.as_slice()), Some(slcan::SlcanEvent::Frame(*frame)));
    }
}
