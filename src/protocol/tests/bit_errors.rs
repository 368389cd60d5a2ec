//! Every frame with one or two flipped bits is detected, before stuffing and on the wire. On the wire a flipped bit can
//! create or destroy a delimiter.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a helper of a test fails as the test does")]

use gnc_protocol::frame::{CRC, checksum};
use gnc_protocol::pattern::Xorshift32;
use gnc_protocol::serial::{FrameDecoder, encode};
use gnc_protocol::{Flags, Frame, Header, Kind, MAX_PAYLOAD, Payload};

fn frame(kind: Kind, payload: &[u8]) -> Frame {
    let header = Header { version: 1, kind, flags: Flags::default(), request: 0x0102, message: 0x0010, sequence: 7 };
    Frame { header, payload: Payload::from_slice(payload).unwrap() }
}

fn short() -> Frame {
    frame(Kind::Result, &[0x47, 0, 0xff, 1, 0, 0x12])
}

/// A long frame with some zeros and one full run.
fn long() -> Frame {
    let payload: Vec<u8> =
        (0..MAX_PAYLOAD).map(|at| if at % 53 == 0 && at < 230 { 0 } else { (at % 256) as u8 | 1 }).collect();
    frame(Kind::Stream, &payload)
}

fn flip(bytes: &mut [u8], bit: usize) {
    bytes[bit / 8] ^= 1 << (bit % 8);
}

fn reads(bytes: &[u8]) -> bool {
    Frame::from_bytes(bytes).is_ok()
}

/// Two different bit numbers below `bits`.
fn pair(random: &mut Xorshift32, bits: usize) -> (usize, usize) {
    let first = random.next().unwrap() as usize % bits;
    (first, (first + 1 + random.next().unwrap() as usize % (bits - 1)) % bits)
}

#[test]
fn all_pairs_in_a_short_frame() {
    let mut bytes = short().to_bytes();
    let bits = bytes.len() * 8;
    for first in 0..bits {
        flip(&mut bytes, first);
        assert!(!reads(&bytes), "bit {first}");
        for second in first + 1..bits {
            flip(&mut bytes, second);
            assert!(!reads(&bytes), "bits {first} and {second}");
            flip(&mut bytes, second);
        }
        flip(&mut bytes, first);
    }
    assert!(reads(&bytes));
}

/// The checksum is linear: flipping bit i changes "computed exclusive-or received" by a fixed word, whatever else is
/// flipped. Two flips stay undetected only if their words are equal. So 4,192 different words prove all 8,784,336
/// pairs.
#[test]
fn all_pairs_in_the_longest_frame() {
    let mut bytes = long().to_bytes();
    let bits = bytes.len() * 8;
    let content = bytes.len() - CRC;
    let syndrome = |bytes: &[u8]| {
        checksum(&bytes[..content])
            ^ u32::from_le_bytes([bytes[content], bytes[content + 1], bytes[content + 2], bytes[content + 3]])
    };
    assert_eq!(syndrome(&bytes), 0);
    let mut words = Vec::new();
    for bit in 0..bits {
        flip(&mut bytes, bit);
        assert!(!reads(&bytes), "bit {bit}");
        words.push(syndrome(&bytes));
        flip(&mut bytes, bit);
    }
    assert!(!words.contains(&0));
    words.sort_unstable();
    words.dedup();
    assert_eq!((bits, words.len()), (4192, 4192));
}

/// All pairs again, one by one: this takes three seconds.
#[test]
fn all_pairs_in_the_longest_frame_one_by_one() {
    let mut bytes = long().to_bytes();
    let bits = bytes.len() * 8;
    for first in 0..bits {
        flip(&mut bytes, first);
        for second in first + 1..bits {
            flip(&mut bytes, second);
            assert!(!reads(&bytes), "bits {first} and {second}");
            flip(&mut bytes, second);
        }
        flip(&mut bytes, first);
    }
    assert!(reads(&bytes));
}

/// The line fails for up to 32 bits in a row.
#[test]
fn bursts_in_the_longest_frame() {
    let original = long().to_bytes();
    let bits = original.len() * 8;
    let mut random = Xorshift32::new(32);
    for _ in 0..50_000 {
        let mut bytes = original.clone();
        let start = random.next().unwrap() as usize % (bits - 32);
        let burst = random.next().unwrap();
        (0..32).filter(|bit| burst >> bit & 1 == 1).for_each(|bit| flip(&mut bytes, start + bit));
        assert!(!reads(&bytes), "{burst:08x} from bit {start}");
    }
}

/// A good frame, the damaged one, a good frame. Both neighbours arrive; the middle one arrives unchanged or not at all.
/// (Unchanged: a delimiter that turns into the code 01 after a full run changes nothing.)
struct Line {
    before: Frame,
    damaged: Frame,
    after: Frame,
    wire: Vec<u8>,
    start: usize,
    bits: usize,
}

impl Line {
    fn new(damaged: Frame) -> Self {
        let (before, after) = (frame(Kind::Event, &[1, 2, 3]), frame(Kind::Nak, &[0, 9]));
        let mut wire = encode(&before).to_vec();
        let start = wire.len() * 8;
        wire.extend_from_slice(&encode(&damaged));
        let bits = wire.len() * 8 - start;
        wire.extend_from_slice(&encode(&after));
        Self { before, damaged, after, wire, start, bits }
    }

    fn check(&mut self, flips: &[usize]) {
        flips.iter().for_each(|bit| flip(&mut self.wire, self.start + bit));
        let (mut decoder, mut rest, mut found) = (FrameDecoder::default(), self.wire.as_slice(), Vec::new());
        while let Some(outcome) = decoder.next(&mut rest) {
            found.extend(outcome.ok());
        }
        let arrived = match found.as_slice() {
            [first, last] => *first == self.before && *last == self.after,
            [first, between, last] => *first == self.before && *between == self.damaged && *last == self.after,
            _ => false,
        };
        assert!(arrived, "bits {flips:?}: {found:?}");
        flips.iter().for_each(|bit| flip(&mut self.wire, self.start + bit));
    }
}

#[test]
fn all_pairs_in_a_short_frame_on_the_wire() {
    let mut line = Line::new(short());
    for first in 0..line.bits {
        line.check(&[first]);
        for second in first + 1..line.bits {
            line.check(&[first, second]);
        }
    }
}

#[test]
fn all_single_bits_and_many_pairs_in_the_longest_frame_on_the_wire() {
    let mut line = Line::new(long());
    (0..line.bits).for_each(|bit| line.check(&[bit]));
    let mut random = Xorshift32::new(7);
    for _ in 0..100_000 {
        let (first, second) = pair(&mut random, line.bits);
        line.check(&[first, second]);
    }
}
