//! Properties that hold for any bytes, any pieces and any values.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a helper of a test fails as the test does")]

use std::fmt::Debug;

use gnc_protocol::calibration::*;
use gnc_protocol::frame::{FrameError, MAX_FRAME};
use gnc_protocol::message::*;
use gnc_protocol::serial::{self, FrameDecoder, LineCounters, MAX_ON_WIRE};
use gnc_protocol::stream::*;
use gnc_protocol::wire::{Wire, WireError};
use gnc_protocol::{Flags, Frame, Header, Kind, MAX_PAYLOAD, Payload, Request};
use proptest::prelude::*;

type Outcome = Result<Frame, FrameError>;

/// Everything that the decoder gives for `bytes` in pieces of the given lengths (the last length again and again).
fn decode(bytes: &[u8], pieces: &[usize]) -> (Vec<Outcome>, LineCounters) {
    let (mut decoder, mut outcomes, mut rest, mut at) = (FrameDecoder::default(), Vec::new(), bytes, 0);
    while !rest.is_empty() {
        let length = pieces.get(at).or(pieces.last()).copied().unwrap_or(rest.len()).clamp(1, rest.len());
        at += 1;
        let (mut piece, tail) = rest.split_at(length);
        rest = tail;
        loop {
            let before = piece.len();
            let outcome = decoder.next(&mut piece);
            let Some(outcome) = outcome else { break };
            assert!(piece.len() < before, "an outcome out of nothing: the decoder stalls");
            outcomes.push(outcome);
        }
        assert!(piece.is_empty(), "bytes left although nothing came out of them");
    }
    (outcomes, decoder.counters())
}

fn good(outcomes: &[Outcome]) -> Vec<Frame> {
    outcomes.iter().flatten().cloned().collect()
}

/// Bytes as on a wire: often zero, often like codes.
fn any_byte() -> impl Strategy<Value = u8> {
    prop_oneof![3 => any::<u8>(), 2 => Just(0_u8), 1 => Just(1_u8), 1 => Just(0xff_u8), 1 => 2..20_u8]
}

fn rubbish() -> impl Strategy<Value = Vec<u8>> {
    prop_oneof![
        4 => proptest::collection::vec(any_byte(), 0..80),
        1 => proptest::collection::vec(1..=255_u8, 0..1500),
        1 => Just(vec![0xff; 255]),
    ]
}

fn any_frame() -> impl Strategy<Value = Frame> {
    let payload = prop_oneof![
        3 => proptest::collection::vec(any_byte(), 0..40),
        1 => proptest::collection::vec(1..=255_u8, 230..260),
        1 => proptest::collection::vec(any_byte(), 480..=MAX_PAYLOAD),
        1 => proptest::collection::vec(1..=255_u8, 480..=MAX_PAYLOAD),
    ];
    let numbers = (0..16_u8, 0..8_u8, any::<u8>(), any::<u16>(), any::<u16>(), any::<u16>());
    (numbers, payload).prop_map(|((version, kind, flags, request, message, sequence), payload)| Frame {
        header: Header {
            version,
            kind: Kind::from_number(kind).unwrap(),
            flags: Flags(flags),
            request,
            message,
            sequence,
        },
        payload: Payload::from_slice(&payload).unwrap(),
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 120, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn frames_round_trip(frame in any_frame()) {
        let wire = serial::encode(&frame);
        prop_assert!(wire.len() <= serial::on_wire(frame.payload.len()) && wire.len() <= MAX_ON_WIRE);
        prop_assert!(frame.to_bytes().len() <= MAX_FRAME);
        prop_assert_eq!((wire.first(), wire.last()), (Some(&0), Some(&0)));
        prop_assert!(!wire[1..wire.len() - 1].contains(&0), "a delimiter inside");
        let (outcomes, counters) = decode(&wire, &[]);
        prop_assert_eq!(outcomes, vec![Ok(frame)]);
        prop_assert_eq!(counters, LineCounters { frames: 1, ..LineCounters::default() });
    }

    /// Every good frame is found after any rubbish, since each frame begins with a delimiter.
    #[test]
    fn resynchronises(parts in proptest::collection::vec((rubbish(), any_frame()), 1..6)) {
        let mut wire = Vec::new();
        for (rubbish, frame) in &parts {
            wire.extend_from_slice(rubbish);
            wire.extend_from_slice(&serial::encode(frame));
        }
        let (outcomes, counters) = decode(&wire, &[]);
        let frames: Vec<_> = parts.iter().map(|(_, frame)| frame.clone()).collect();
        prop_assert_eq!(good(&outcomes), frames);
        prop_assert!(outcomes.last().is_some_and(Result::is_ok));
        let counted = u64::from(counters.frames) + u64::from(counters.bad_checksum) + u64::from(counters.malformed);
        prop_assert_eq!(counted, outcomes.len() as u64, "every outcome is counted once");
    }

    #[test]
    fn any_chunking_gives_the_same(
        parts in proptest::collection::vec((rubbish(), any_frame()), 0..4),
        pieces in proptest::collection::vec(1..700_usize, 0..30),
    ) {
        let mut wire = Vec::new();
        for (rubbish, frame) in &parts {
            wire.extend_from_slice(rubbish);
            wire.extend_from_slice(&serial::encode(frame));
        }
        let at_once = decode(&wire, &[]);
        prop_assert_eq!(&decode(&wire, &pieces), &at_once);
        prop_assert_eq!(&decode(&wire, &[1]), &at_once);
    }

    /// A write that was cut off, and then the next frame.
    #[test]
    fn half_a_frame_costs_no_other(cut in any_frame(), whole in any_frame(), share in 0.0..1.0_f64) {
        let mut wire = serial::encode(&cut).to_vec();
        let kept = (wire.len() as f64 * share) as usize;
        // If only its delimiter is missing, the first frame is whole as well.
        let lost = kept < wire.len() - 1;
        wire.truncate(kept);
        wire.extend_from_slice(&serial::encode(&whole));
        let found = good(&decode(&wire, &[]).0);
        prop_assert_eq!(found, if lost { vec![whole] } else { vec![cut, whole] });
    }

    #[test]
    fn any_payload_is_read_or_refused(id in any::<u16>(), payload in proptest::collection::vec(any_byte(), 0..=512)) {
        let ids = Request::IDS.iter().map(|(id, _)| *id).chain([id]);
        for id in ids {
            let known = Request::IDS.iter().any(|(known, _)| *known == id);
            prop_assert_eq!(Request::decode(id, &payload).is_some(), known);
        }
        let _ = (BoardHello::from_payload(&payload), Nak::from_payload(&payload), StreamFrame::from_payload(&payload));
        let _ = (IdentityReply::from_payload(&payload), ErrorRecordsReply::from_payload(&payload));
    }
}

/// Frames missing by their numbers, over the wrap of the number. A step back and a HELLO count nothing.
#[test]
fn missing_frames_are_counted_by_their_numbers() {
    let frame = |kind, sequence| {
        let header = Header { version: 1, kind, flags: Flags::default(), request: 0, message: 2, sequence };
        serial::encode(&Frame { header, payload: Payload::new() }).to_vec()
    };
    let missing = |numbers: &[(Kind, u16)]| {
        let wire: Vec<u8> = numbers.iter().flat_map(|&(kind, sequence)| frame(kind, sequence)).collect();
        decode(&wire, &[]).1.missing
    };
    let event = |numbers: &[u16]| missing(&numbers.iter().map(|&number| (Kind::Event, number)).collect::<Vec<_>>());
    assert_eq!(event(&[500, 501, 502]), 0, "the first number may be any");
    assert_eq!(event(&[500, 503, 504, 506]), 3);
    assert_eq!(event(&[0xFFFE, 0xFFFF, 0, 1]), 0);
    assert_eq!(event(&[0xFFFE, 2]), 3);
    assert_eq!(event(&[500, 0, 1]), 0, "a restart is a step back");
    assert_eq!(missing(&[(Kind::Event, 40_000), (Kind::Hello, 0), (Kind::Event, 1)]), 0, "a host that restarted");
    assert_eq!(missing(&[(Kind::Event, 40_000), (Kind::Hello, 0), (Kind::Event, 3)]), 2);
}

/// A field of a layout, as in the interface document.
#[derive(Clone, Copy)]
enum Field {
    /// This many arbitrary bytes.
    Bytes(usize),
    /// A text of at most this many bytes.
    Text(usize),
    /// At most this many elements of this many bytes each.
    List(usize, usize),
}
use Field::{Bytes, List, Text};

fn longest(layout: &[Field]) -> usize {
    let length = |field: &Field| match *field {
        Bytes(count) => count,
        Text(most) => 1 + most,
        List(most, size) => 2 + most * size,
    };
    layout.iter().map(length).sum()
}

/// Bytes of the layout, with lists and texts as long as `choose` says.
fn fill(layout: &[Field], choose: &mut impl FnMut(usize) -> usize, byte: &mut impl FnMut() -> u8) -> Vec<u8> {
    let mut bytes = Vec::new();
    for field in layout {
        match *field {
            Bytes(count) => bytes.extend((0..count).map(|_| byte())),
            Text(most) => {
                let length = choose(most);
                bytes.push(u8::try_from(length).unwrap());
                bytes.extend((0..length).map(|_| byte() & 0x7f));
            }
            List(most, size) => {
                let length = choose(most);
                bytes.extend_from_slice(&u16::try_from(length).unwrap().to_le_bytes());
                bytes.extend((0..length * size).map(|_| byte()));
            }
        }
    }
    bytes
}

/// Every value of the layout is read and written back to the same bytes. A shorter or longer payload is refused.
fn round_trip<M: Wire>(name: &str, layout: &[Field]) {
    let mut random = gnc_protocol::pattern::Xorshift32::new(0xC0FFEE);
    for round in 0..200 {
        let mut lengths = random.clone();
        let mut choose = |most: usize| match round {
            0 => most,
            1 => 0,
            _ => lengths.next().unwrap() as usize % (most + 1),
        };
        let bytes = fill(layout, &mut choose, &mut || (random.next().unwrap() >> 7) as u8);
        let value = M::from_payload(&bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(value.to_payload().unwrap().as_slice(), bytes, "{name}");
        if round < 20 {
            for kept in 0..bytes.len() {
                let cut = M::from_payload(&bytes[..kept]).err();
                assert!(matches!(cut, Some(WireError::Short { .. })), "{name} cut to {kept}: {cut:?}");
            }
            let long = M::from_payload(&[&bytes[..], &[0]].concat()).err();
            assert_eq!(long, Some(WireError::Long { extra: 1 }), "{name}");
        }
    }
    for (index, field) in layout.iter().enumerate() {
        let most = match *field {
            Bytes(_) | Text(255) => continue,
            Text(most) | List(most, _) => most,
        };
        let mut at = 0;
        let mut too_many = |_: usize| {
            let lists_before = layout[..index].iter().filter(|field| !matches!(field, Bytes(_))).count();
            at += 1;
            if at == lists_before + 1 { most + 1 } else { 0 }
        };
        let refused = M::from_payload(&fill(layout, &mut too_many, &mut || 1)).err();
        assert_eq!(refused, Some(WireError::TooMany { length: most + 1, most }), "{name}");
    }
}

/// A request and its result. The longest body of the result fits after the head of a RESULT.
fn call<C: Call>(seen: &mut Vec<u16>, request: &[Field], reply: &[Field])
where
    C::Reply: Debug,
{
    round_trip::<C>(C::NAME, request);
    round_trip::<C::Reply>(&format!("{} result", C::NAME), reply);
    assert!(longest(request) <= MAX_PAYLOAD, "{} request: {} bytes", C::NAME, longest(request));
    assert!(6 + longest(reply) <= MAX_PAYLOAD, "{} result: {} bytes", C::NAME, 6 + longest(reply));
    seen.push(C::ID);
}

#[test]
fn every_message_round_trips_and_fits() {
    round_trip::<HostHello>("HostHello", &[Bytes(4 + 1 + 1 + 4)]);
    round_trip::<BoardHello>("BoardHello", &[Bytes(4 + 3 + 4 + 4 + 4), Text(32), Text(32)]);
    round_trip::<Heartbeat>("Heartbeat", &[Bytes(4 + 8 + 1)]);
    round_trip::<Accept>("Accept", &[Bytes(4)]);
    round_trip::<Progress>("Progress", &[Bytes(2 + 4)]);
    round_trip::<Nak>("Nak", &[Bytes(2), Text(160)]);
    round_trip::<StreamHead>("StreamHead", &[Bytes(STREAM_HEAD)]);
    round_trip::<ImuSample>("ImuSample", &[Bytes(IMU_SAMPLE)]);
    round_trip::<PpsCapture>("PpsCapture", &[Bytes(8)]);
    round_trip::<CompensatedSample>("CompensatedSample", &[Bytes(COMPENSATED_SAMPLE)]);

    let mut seen = Vec::new();
    let mismatch = [Bytes(5 * 4)];
    call::<MakeSafe>(&mut seen, &[], &[]);
    call::<Abort>(&mut seen, &[Bytes(2)], &[Bytes(1)]);
    call::<ModulePower>(&mut seen, &[Bytes(1)], &[Bytes(8)]);
    call::<ErrorRecords>(&mut seen, &[Bytes(2)], &[Bytes(2), List(16, 28)]);
    call::<LinkCounters>(&mut seen, &[], &[Bytes(20)]);
    call::<Identity>(&mut seen, &[], &[Text(64), Text(32), Text(32), Text(32), Bytes(1)]);
    call::<CpuWords>(&mut seen, &[Bytes(2), List(64, 4)], &[List(64, 4)]);
    call::<CpuIntegers>(&mut seen, &[Bytes(1), List(16, 8)], &[List(16, 20)]);
    call::<CpuFloats>(&mut seen, &[Bytes(1), List(15, 16)], &[List(15, 32)]);
    call::<TimerMeasure>(&mut seen, &[Bytes(1 + 4 + 2)], &[Bytes(2), List(100, 4)]);
    call::<RamTest>(&mut seen, &[Bytes(2)], &mismatch);
    call::<FlashId>(&mut seen, &[Bytes(1)], &[Bytes(3 + 4 + 2)]);
    call::<FlashErase>(&mut seen, &[Bytes(3)], &[Bytes(4)]);
    call::<FlashBlankCheck>(&mut seen, &[Bytes(3)], &mismatch);
    call::<FlashWrite>(&mut seen, &[Bytes(7)], &[Bytes(4)]);
    call::<FlashVerify>(&mut seen, &[Bytes(7)], &mismatch);
    call::<AdRead>(&mut seen, &[Bytes(3)], &[List(8, 13)]);
    call::<IoTest>(&mut seen, &[Bytes(3)], &[Bytes(1)]);
    call::<SpiTransfer>(&mut seen, &[Bytes(5), List(256, 1)], &[List(256, 1)]);
    call::<SciEcho>(&mut seen, &[Bytes(4), List(256, 1)], &[Bytes(6), List(256, 1)]);
    call::<GnssRestart>(&mut seen, &[Bytes(1)], &[]);
    call::<StreamStart>(&mut seen, &[Bytes(1 + 2 + 4 + 1)], &[Bytes(4)]);
    call::<StreamStop>(&mut seen, &[Bytes(1)], &[Bytes(8)]);
    call::<CanCounters>(&mut seen, &[], &[Bytes(1 + 2 + 2 + 4 + 4)]);
    call::<CalibrationWrite>(&mut seen, &[Bytes(300)], &[]);
    call::<CalibrationCommit>(&mut seen, &[Bytes(4)], &[Bytes(8)]);
    call::<CalibrationRead>(&mut seen, &[], &[Bytes(1 + 4 + 4), List(1, 300)]);
    let all: Vec<_> = Request::IDS.iter().map(|(id, _)| *id).collect();
    assert_eq!(seen, all, "a message without a layout here");
}

/// The worked numbers of the interface document.
#[test]
fn load_of_the_imu_stream() {
    let table = [(1000, 1, 921_600, 813), (1000, 4, 921_600, 528), (1000, 10, 921_600, 473), (1000, 12, 921_600, 467)];
    for (rate_hz, samples, rate_baud, expected) in table {
        assert_eq!(imu_load_permille(rate_hz, samples, rate_baud), expected, "{rate_hz} Hz, {samples} a frame");
    }
    assert_eq!(imu_load_permille(200, 10, 115_200), 756);
    assert!(imu_load_permille(1000, 12, 115_200) > MAX_LOAD_PERMILLE);
    assert_eq!(MAX_IMU_SAMPLES, 12);
}
