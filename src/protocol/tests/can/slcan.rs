//! Lines from adapters, from python-can, and rubbish.

use gnc_protocol::can::slcan::{CLOSE, Counters, OPEN_500K, SlcanDecoder, SlcanEvent, encode};
use gnc_protocol::can::{CanFrame, CanId};
use proptest::prelude::*;

fn items(bytes: &[u8]) -> (Vec<SlcanEvent>, Counters) {
    let (mut decoder, mut rest, mut items) = (SlcanDecoder::default(), bytes, Vec::new());
    while let Some(item) = decoder.next(&mut rest) {
        items.push(item);
    }
    assert!(rest.is_empty());
    (items, decoder.counters())
}

fn check(bytes: &[u8], expected: &[SlcanEvent], bad_lines: u32) {
    let (items, counters) = items(bytes);
    let shown = String::from_utf8_lossy(bytes).into_owned();
    assert_eq!(items, expected, "{shown:?}");
    assert_eq!(counters.bad_lines, bad_lines, "{shown:?}");
}

fn frame(id: CanId, data: &[u8]) -> SlcanEvent {
    SlcanEvent::Frame(CanFrame::new(id, data).unwrap())
}

#[test]
fn what_python_can_sends_on_opening() {
    check(b"C\rS6\r\rO\rO\r", &[SlcanEvent::Close, SlcanEvent::Rate(6), SlcanEvent::Open, SlcanEvent::Open], 0);
    check(OPEN_500K, &[SlcanEvent::Close, SlcanEvent::Rate(6), SlcanEvent::Open], 0);
    check(CLOSE, &[SlcanEvent::Close], 0);
}

#[test]
fn answers_and_timestamps_of_adapters() {
    let one = frame(CanId::Standard(0x123), &[0xab]);
    check(
        b"\r\r\rt1231AB\rz\rZ\r\x07V1013\r",
        &[one, SlcanEvent::Other(b'z'), SlcanEvent::Other(b'Z'), SlcanEvent::Refused, SlcanEvent::Other(b'V')],
        0,
    );
    check(b"t1231AB0f3C\r", &[one], 0);
    check(b"T1FFFFFFF0\r", &[frame(CanId::Extended(0x1fff_ffff), &[])], 0);
    check(
        b"r7FF8\rR000000012\r",
        &[SlcanEvent::Remote(CanId::Standard(0x7ff)), SlcanEvent::Remote(CanId::Extended(1))],
        0,
    );
    check(b"t1231ab\r\nt1231ab\r\n", &[one, one], 0);
}

#[test]
fn bad_lines_are_counted_and_harm_nothing_else() {
    let good = frame(CanId::Standard(0x100), &[1, 2]);
    for bad in [
        &b"t"[..],
        b"t12",
        b"t123",
        b"t1239",
        b"t1231",
        b"t1231A",
        b"t1231AG",
        b"t1231ABC",
        b"t8000",
        b"T20000000",
        b"T200000000",
        b"t1231AB12",
        b"S9",
        b"S",
        b"S66",
        b"OO",
        b"hello",
        b"t-121AB",
        b"\xff\xff",
        b"r8000",
        b"t1238010203040506070",
        b"T000000008000000000000000000000000000000000000000000000000000000000000000",
    ] {
        let mut bytes = b"t10020102\r".to_vec();
        bytes.extend(bad);
        bytes.extend(b"\rt10020102\r");
        check(&bytes, &[good, good], 1);
    }
}

/// A line that is too long is dropped, whole or in pieces; the next line is read.
#[test]
fn a_line_without_end_is_dropped() {
    let (mut decoder, mut seen) = (SlcanDecoder::default(), Vec::new());
    for chunk in [&[b't'; 100][..], &[b't'; 100], b"\rt10020102\r"] {
        let mut rest = chunk;
        seen.extend(std::iter::from_fn(|| decoder.next(&mut rest)));
    }
    assert_eq!(seen, [frame(CanId::Standard(0x100), &[1, 2])]);
    assert_eq!(decoder.counters(), Counters { frames: 1, bad_lines: 1 });
}

/// Found by fuzzing: in one piece this line counted as a line of set-up, in two pieces it was dropped.
#[test]
fn a_line_that_is_too_long_is_dropped_however_it_is_cut() {
    let line = [&b"s"[..], &[b'0'; 40], b"\r"].concat();
    for cut in 0..=line.len() {
        let (mut decoder, mut seen) = (SlcanDecoder::default(), Vec::new());
        for mut piece in [&line[..cut], &line[cut..]] {
            seen.extend(std::iter::from_fn(|| decoder.next(&mut piece)));
        }
        assert_eq!((seen, decoder.counters()), (Vec::new(), Counters { frames: 0, bad_lines: 1 }), "cut at {cut}");
    }
}

fn any_frame() -> impl Strategy<Value = CanFrame> {
    let id = prop_oneof![(0..=0x7ff_u16).prop_map(CanId::Standard), (0..=0x1fff_ffff_u32).prop_map(CanId::Extended)];
    (id, proptest::collection::vec(any::<u8>(), 0..=8)).prop_map(|(id, data)| CanFrame::new(id, &data).unwrap())
}

proptest! {
    #[test]
    fn frames_survive_any_cutting(frames in proptest::collection::vec(any_frame(), 0..20), piece in 1..40_usize) {
        let bytes: Vec<u8> = frames.iter().flat_map(encode).collect();
        let (mut decoder, mut seen) = (SlcanDecoder::default(), Vec::new());
        for mut chunk in bytes.chunks(piece) {
            seen.extend(std::iter::from_fn(|| decoder.next(&mut chunk)));
        }
        let expected: Vec<SlcanEvent> = frames.into_iter().map(SlcanEvent::Frame).collect();
        prop_assert_eq!(seen, expected);
    }

    #[test]
    fn rubbish_is_survived(bytes in proptest::collection::vec(prop_oneof![any::<u8>(), Just(b'\r'), Just(b't'), Just(b'0')], 0..400)) {
        let (seen, counters) = items(&bytes);
        let ends = bytes.iter().filter(|byte| matches!(byte, b'\r' | 7)).count();
        prop_assert!(seen.len() <= ends && counters.bad_lines as usize <= ends);
    }
}
