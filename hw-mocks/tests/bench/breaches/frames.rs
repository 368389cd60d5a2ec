//! Bytes and frames on the wire.

use gnc_protocol::can::id::{BOARD_EVENTS, IMU_ACCEL, IMU_GYRO, IMU_MAG};
use gnc_protocol::can::{CanFrame, CanId};
use gnc_protocol::frame::Kind;
use gnc_protocol::message::{Identity, ModulePower, StreamStart};

use super::record::{BOTH, Link, Record, ms};
use super::{Case, Rule, check};

fn session(personality: &str, link: Link) -> Record {
    let mut host = Record::new(personality, link);
    host.hello(7);
    host.run(ms(100));
    host.post(&ModulePower { on: 1 });
    host.run(ms(300));
    host.post(&Identity {});
    host.run(ms(300));
    host.post(&StreamStart { stream: 1, rate_hz: 100, count: 50, samples_per_frame: 0 });
    host.run(ms(2500));
    host
}

/// What stands between two delimiters.
fn pieces(record: &Record) -> Vec<&[u8]> {
    record.bytes.split(|byte| *byte == 0).filter(|piece| !piece.is_empty()).collect()
}

/// The bytes of a piece without the stuffing; `None` where it is broken. Written from the document.
fn unstuffed(piece: &[u8]) -> Option<Vec<u8>> {
    let (mut bytes, mut rest) = (Vec::new(), piece);
    while let Some((code, after)) = rest.split_first() {
        let (run, left) = after.split_at_checked(usize::from(*code) - 1)?;
        bytes.extend_from_slice(run);
        if *code < 255 && !left.is_empty() {
            bytes.push(0);
        }
        rest = left;
    }
    Some(bytes)
}

/// The checksum as the document has it in C.
fn crc32c(bytes: &[u8]) -> u32 {
    let mut register = u32::MAX;
    for byte in bytes {
        register ^= u32::from(*byte);
        for _ in 0..8 {
            register = (register >> 1) ^ (0x82f6_3b78 & 0_u32.wrapping_sub(register & 1));
        }
    }
    !register
}

/// The messages of ISO-TP that came whole, by the order of their consecutive frames.
fn messages(record: &Record) -> Vec<Vec<u8>> {
    let mut messages = Vec::new();
    for id in [0x021, 0x101] {
        let (mut length, mut message, mut next) = (0, Vec::new(), 1);
        for frame in record.can_frames.iter().filter(|frame| frame.id() == CanId::Standard(id)) {
            let data = frame.data();
            match data[0] >> 4 {
                1 => {
                    length = usize::from(data[0] & 15) << 8 | usize::from(data[1]);
                    (message, next) = (data[2..].to_vec(), 1);
                }
                2 if data[0] & 15 == next => {
                    message.extend_from_slice(&data[1..]);
                    next = (next + 1) & 15;
                    if message.len() >= length {
                        messages.push(message[..length].to_vec());
                    }
                }
                _ => {}
            }
        }
    }
    messages
}

fn checksums(record: &Record) -> bool {
    let frames: Vec<Vec<u8>> = match record.link {
        Link::Serial => pieces(record).into_iter().filter_map(unstuffed).filter(|bytes| bytes.len() >= 12).collect(),
        Link::Can => messages(record),
    };
    let good = |bytes: &Vec<u8>| {
        let (content, sum) = bytes.split_at(bytes.len() - 4);
        crc32c(content).to_le_bytes() == sum
    };
    // Rubbish that happens to be long enough says nothing of checksums: on RS-422 it has its own rules.
    frames.iter().filter(|bytes| good(bytes)).count() * 2 > frames.len() || frames.is_empty()
}

/// Nothing is on the wire but frames: what is too short, or broken, is none.
fn only_frames(record: &Record) -> bool {
    record.link == Link::Can
        || pieces(record).iter().all(|piece| unstuffed(piece).is_some_and(|bytes| bytes.len() >= 12))
}

/// Two delimiters stand between any two frames, and one before the first.
fn delimiters_on_both_sides(record: &Record) -> bool {
    let zeros = record.bytes.iter().filter(|byte| **byte == 0).count();
    record.link == Link::Can || zeros >= 2 * pieces(record).len()
}

/// The frames of CAN under an id.
fn under(record: &Record, id: u16) -> Vec<&CanFrame> {
    record.can_frames.iter().filter(|frame| frame.id() == CanId::Standard(id)).collect()
}

fn beats_in_two_frames(record: &Record) -> bool {
    let firsts: Vec<u8> = under(record, BOARD_EVENTS).iter().map(|frame| frame.data()[0]).collect();
    !firsts.is_empty() && firsts.chunks(2).all(|pair| pair == [0, 1])
}

fn samples_in_their_order(record: &Record) -> bool {
    let ids = [IMU_GYRO, IMU_ACCEL, IMU_MAG];
    let of_samples = record.can_frames.iter().filter_map(|frame| match frame.id() {
        CanId::Standard(id) if ids.contains(&id) => Some(id),
        _ => None,
    });
    let order: Vec<u16> = of_samples.collect();
    order.chunks(3).all(|sample| sample == ids)
}

fn messages_in_their_order(record: &Record) -> bool {
    [0x021, 0x101].into_iter().all(|id| {
        let mut next = 1;
        under(record, id).into_iter().filter(|frame| frame.data()[0] >> 4 != 3).all(|frame| {
            let first = frame.data()[0];
            if first >> 4 == 1 {
                next = 1;
                return true;
            }
            let follows = first & 15 == next;
            next = (next + 1) & 15;
            follows
        })
    })
}

const RULES: [Rule; 6] = [
    ("the checksum of the document", checksums),
    ("nothing but frames", only_frames),
    ("a delimiter before and after", delimiters_on_both_sides),
    ("a heartbeat is two frames", beats_in_two_frames),
    ("samples in their order", samples_in_their_order),
    ("messages in their order", messages_in_their_order),
];

const SERIAL: &[Link] = &[Link::Serial];
const CAN: &[Link] = &[Link::Can];

const CASES: [Case; 11] = [
    ("checksum = \"big-endian\"", &BOTH, &["the checksum of the document"]),
    ("checksum = \"crc32\"", &BOTH, &["the checksum of the document"]),
    ("checksum = \"not-inverted\"", &BOTH, &["the checksum of the document"]),
    (
        "debug_text = \"adc ok\\r\\n\"\ndebug_every_ms = 200",
        SERIAL,
        &["nothing but frames", "a delimiter before and after"],
    ),
    ("stray_zero_every = 3", SERIAL, &["nothing but frames"]),
    ("stray_zero_every = 3", SERIAL, &["a delimiter before and after"]),
    ("no_leading_delimiter = true", SERIAL, &["a delimiter before and after"]),
    ("padding_bytes = 3", SERIAL, &["nothing but frames", "a delimiter before and after"]),
    ("heartbeat_halved = true", &BOTH, &["a heartbeat is two frames"]),
    ("can_order = \"samples\"", CAN, &["samples in their order"]),
    ("can_order = \"messages\"", CAN, &["messages in their order"]),
];

#[test]
fn each_board_breaks_its_rule_of_frames_and_no_other() {
    check(&RULES, &CASES, session);
}

/// What the board says goes on behind the text that it prints: frames begin with a delimiter.
#[test]
fn a_text_between_frames_spoils_no_frame() {
    let host = session("[board]\ndebug_text = \"adc ok\\r\\n\"\ndebug_every_ms = 200\n", Link::Serial);
    assert!(host.broken >= 5, "{}", host.broken);
    let results = host.of(Kind::Result).count();
    assert_eq!(results, 3);
    let good = session("", Link::Serial);
    assert_eq!(host.came.len(), good.came.len());
    assert_eq!(good.broken, 0);
}
