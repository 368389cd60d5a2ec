//! Streams as raw frames: every loss is seen, and nothing is delivered that was not sent.

use gnc_protocol::can::stream::{Packer, Unpacker, compensated_bits, gnss_bits, imu_bits, load_permille, pps_bits};
use gnc_protocol::can::{BIT_RATE, CanFrame, CanId, bits, worst_bits};
use gnc_protocol::message::StreamStart;
use gnc_protocol::stream::{Format, ImuSample, StreamFrame, StreamHead, StreamId};
use gnc_protocol::wire::Wire;
use proptest::prelude::*;

const START: StreamStart = StreamStart { stream: StreamId::Imu as u8, rate_hz: 200, count: 0, samples_per_frame: 1 };

fn sample(number: u32) -> ImuSample {
    let value = number as i32 * 64;
    ImuSample {
        gyro: [value; 3],
        accel: [-value; 3],
        mag: [value, 0, -value],
        gyro_temperature: 7,
        accel_temperature: -7,
    }
}

fn sent(count: u32) -> Vec<CanFrame> {
    let (mut packer, mut frames) = (Packer::default(), Vec::new());
    packer.start(&START);
    for number in 0..count {
        let head = StreamHead {
            stream: StreamId::Imu as u8,
            format: Format::Imu as u8,
            count: 1,
            first: number,
            board_time_us: 1_000_000 + u64::from(number) * 5000,
            dropped: 0,
        };
        let samples = sample(number).to_payload().unwrap().iter().copied().collect();
        packer.pack(&StreamFrame { head, samples }, &mut |frame| frames.push(frame));
    }
    frames
}

fn received(frames: &[CanFrame]) -> Vec<StreamFrame> {
    let mut unpacker = Unpacker::default();
    unpacker.start(&START);
    let number = |frame: &CanFrame| if let CanId::Standard(id) = frame.id() { id } else { panic!("{frame:?}") };
    frames.iter().filter_map(|frame| unpacker.receive(number(frame), frame.data())).collect()
}

/// A sample takes three frames; each 64 samples take two more.
#[test]
fn frames_of_a_stream() {
    assert_eq!(sent(1).len(), 5);
    assert_eq!(sent(64).len(), 64 * 3 + 2);
    assert_eq!(sent(65).len(), 65 * 3 + 4);
}

/// The numbers go beyond the ten bits of the counter.
#[test]
fn numbers_and_times_go_on() {
    let got = received(&sent(3000));
    assert_eq!(got.len(), 3000);
    for (number, frame) in got.iter().enumerate() {
        assert_eq!((frame.head.first as usize, frame.head.board_time_us), (number, 1_000_000 + 5000 * number as u64));
        let sample = ImuSample::from_payload(&frame.samples).unwrap();
        assert_eq!(sample.gyro, [number as i32 * 64 + 32; 3]);
        assert_eq!((sample.gyro_temperature, sample.accel_temperature), (7, -7));
    }
}

/// If any of its frames is lost, a sample is missing, and its number shows this.
#[test]
fn a_lost_frame_costs_its_sample() {
    let all = sent(100);
    for lost in 2..all.len() {
        let mut frames = all.clone();
        let gone = frames.remove(lost);
        let mark = matches!(gone.id(), CanId::Standard(0x203 | 0x204));
        let got = received(&frames);
        assert_eq!(got.len(), if mark { 100 } else { 99 }, "frame {lost}");
        let time = |frame: &StreamFrame| frame.head.board_time_us == 1_000_000 + 5000 * u64::from(frame.head.first);
        assert!(got.iter().all(time), "frame {lost}");
    }
}

#[test]
fn nothing_is_delivered_before_its_number_is_known() {
    let all = sent(100);
    let got = received(&all[1..]);
    assert_eq!(got[0].head.first, 64, "the first mark was lost, the next one stands before sample 64");
}

/// The figures of the interface document: the bits of ISO 11898-1 and the load of 1 kHz.
#[test]
fn what_fits_on_the_bus() {
    assert_eq!((bits(false, 0), bits(false, 8), bits(true, 8)), (47, 111, 131));
    assert_eq!((worst_bits(false, 0), worst_bits(false, 8), worst_bits(true, 8)), (55, 135, 160));
    assert_eq!(BIT_RATE, 500_000);
    let loads = [1000, 500, 200].map(|rate_hz| load_permille(imu_bits(rate_hz)));
    assert_eq!(loads, [716, 358, 143]);
    assert_eq!((load_permille(gnss_bits()), load_permille(pps_bits())), (140, 0));
    assert_eq!(imu_bits(1000), (3032 * 111, 3032 * 135));
    // A sample takes seven frames of 8 bytes and one of 6; each 64 samples take two more. A frame of 6 bytes has 95 to
    // 115 bits.
    assert_eq!(compensated_bits(200), (1408 * 111 + 200 * 95, 1408 * 135 + 200 * 115));
    assert_eq!([200, 483, 484].map(|rate_hz| load_permille(compensated_bits(rate_hz))), [373, 900, 902]);
}

/// If any of its eight frames is lost or comes twice, a compensated sample is missing or whole, never mixed. Its time
/// and number are right even if marks and clocks are lost.
#[test]
fn a_compensated_sample_is_whole_or_missing() {
    let start = StreamStart { stream: 4, rate_hz: 200, count: 0, samples_per_frame: 1 };
    let (mut packer, mut all) = (Packer::default(), Vec::new());
    packer.start(&start);
    for number in 0..200_u32 {
        let head = StreamHead {
            stream: 4,
            format: Format::Compensated as u8,
            count: 1,
            first: number,
            board_time_us: 1_000_000 + u64::from(number) * 5000,
            dropped: 0,
        };
        let samples = [number as u8; 46].into_iter().collect();
        packer.pack(&StreamFrame { head, samples }, &mut |frame| all.push(frame));
    }
    assert_eq!(all.len(), 200 * 8 + 4 * 2);
    let run = |frames: &[CanFrame]| {
        let mut unpacker = Unpacker::default();
        unpacker.start(&start);
        let number = |frame: &CanFrame| if let CanId::Standard(id) = frame.id() { id } else { panic!("{frame:?}") };
        frames.iter().filter_map(|frame| unpacker.receive(number(frame), frame.data())).collect::<Vec<_>>()
    };
    let check = |got: &[StreamFrame]| {
        for frame in got {
            assert_eq!(frame.head.board_time_us, 1_000_000 + u64::from(frame.head.first) * 5000);
            assert!(frame.samples.iter().all(|byte| *byte == frame.head.first as u8));
        }
    };
    assert_eq!(run(&all).len(), 200);
    for at in 2..all.len() {
        let mut frames = all.clone();
        let gone = frames.remove(at);
        let marks = matches!(gone.id(), CanId::Standard(0x221 | 0x222));
        let got = run(&frames);
        assert_eq!(got.len(), if marks { 200 } else { 199 }, "frame {at}");
        check(&got);
        frames.insert(at, gone);
        frames.insert(at, gone);
        check(&run(&frames));
    }
}

proptest! {
    /// Losses anywhere: the samples that arrive are right and in order, and the rest is missing.
    #[test]
    fn what_arrives_is_true(lost in proptest::collection::hash_set(0..1000_usize, 0..200)) {
        let all = sent(300);
        let frames: Vec<CanFrame> =
            all.iter().enumerate().filter(|(at, _)| !lost.contains(at)).map(|(_, frame)| *frame).collect();
        let got = received(&frames);
        prop_assert!(got.windows(2).all(|pair| pair[0].head.first < pair[1].head.first));
        for frame in got {
            let arrived = ImuSample::from_payload(&frame.samples).unwrap();
            prop_assert_eq!(arrived.gyro, [frame.head.first as i32 * 64 + 32; 3]);
            prop_assert_eq!(arrived.accel, [-(frame.head.first as i32) * 64 + 32; 3]);
        }
    }

    #[test]
    fn any_frames_are_survived(frames in proptest::collection::vec((0x1f0..0x230_u16, proptest::collection::vec(any::<u8>(), 0..=8)), 0..100)) {
        let mut unpacker = Unpacker::default();
        for (id, data) in frames {
            if let Some(frame) = unpacker.receive(id, &data) {
                prop_assert!(frame.to_payload().is_ok());
            }
        }
    }
}
