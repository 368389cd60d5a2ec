//! What an answer or a frame of a stream can hold at all, whatever the module is like.
//!
//! A value outside these bounds does not come from a module, good or bad: the board reads, scales or lays it out in
//! another way than the interface document. The bounds are wide, so that no fault of a module lies beyond them.

use std::time::Duration;

use gnc_protocol::Request;
use gnc_protocol::calibration::{CalibrationCommitReply, CalibrationReadReply, CalibrationState};
use gnc_protocol::message::{
    AdReadReply, CanCountersReply, CanState, CpuFloatsReply, CpuIntegersReply, CpuWordsReply, DurationReply,
    ErrorRecordsReply, IdentityReply, IoTestReply, MismatchReply, PowerReply, Ram, StreamStart, StreamStartReply,
    StreamStopReply, TimerMeasure, TimerMeasureReply,
};
use gnc_protocol::stream::{COMPENSATED_SAMPLE, Format, IMU_SAMPLE, SATURATION, StreamId};
use gnc_protocol::wire::Wire;

use crate::rule::{self, Rule};
use crate::stream::SampleFrame;

/// An answer that cannot be.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Impossible {
    pub rule: &'static Rule,
    pub why: String,
}

type Possible = Result<(), Impossible>;

/// Highest voltage at the socket, in microvolts: six times the module's 5 V.
const SUPPLY_MAX_UV: u32 = 30_000_000;
/// Highest current into the module, in microamperes. No board's switch carries more.
const SUPPLY_MAX_UA: u32 = 20_000_000;
/// Range of the AD converter with the tolerance of its reference, in microvolts (section 14).
const AD_UV: std::ops::RangeInclusive<i32> = -50_000..=6_250_000;
/// Times of one RESULT may differ by this much: they are rounded, and a request takes time to begin and to end.
const ROUNDED_US: u64 = 2_000;
/// The intervals of a timer fill the time of their request, apart from this much and a fifth of it.
const AROUND_INTERVALS_US: u64 = 50_000;
/// A request to a flash may take this much more than ten times its busy time.
const AROUND_BUSY_US: u64 = 20_000;
/// A capture of 1PPS and the board time of its frame differ by less than this.
const CAPTURE_US: u64 = 1_000_000;
/// Bytes of a capture of 1PPS.
const CAPTURE_BYTES: usize = 8;

fn must(holds: bool, rule: &'static Rule, why: impl FnOnce() -> String) -> Possible {
    if holds { Ok(()) } else { Err(Impossible { rule, why: why() }) }
}

fn can(holds: bool, why: impl FnOnce() -> String) -> Possible {
    must(holds, &rule::IMPOSSIBLE, why)
}

/// Checks the body of a RESULT with status 0 against its request. What cannot be read is left to the reader.
///
/// # Errors
/// [`Impossible`].
pub(super) fn check(message: u16, asked: &[u8], body: &[u8], elapsed: Duration) -> Possible {
    let Some(Ok(asked)) = Request::decode(message, asked) else { return Ok(()) };
    let elapsed_us = u64::try_from(elapsed.as_micros()).unwrap_or(u64::MAX);
    match asked {
        Request::ModulePower(_) => read(body, supply),
        Request::ErrorRecords(_) => read(body, error_records),
        Request::Identity(_) => read(body, identity),
        Request::CpuWords(asked) => read(body, |reply: &CpuWordsReply| each(asked.words.len(), reply.words.len())),
        Request::CpuIntegers(asked) => {
            read(body, |reply: &CpuIntegersReply| each(asked.pairs.len(), reply.results.len()))
        }
        Request::CpuFloats(asked) => read(body, |reply: &CpuFloatsReply| each(asked.pairs.len(), reply.results.len())),
        Request::TimerMeasure(asked) => read(body, |reply| timer(&asked, reply, elapsed_us)),
        Request::RamTest(asked) => read(body, |reply| mismatch(reply, words_of(asked.ram))),
        Request::FlashBlankCheck(_) | Request::FlashVerify(_) => read(body, |reply| mismatch(reply, None)),
        Request::FlashErase(_) | Request::FlashWrite(_) => {
            read(body, |reply: &DurationReply| busy(reply.duration_us, elapsed_us))
        }
        Request::CalibrationCommit(_) => {
            read(body, |reply: &CalibrationCommitReply| busy(reply.duration_us, elapsed_us))
        }
        Request::AdRead(asked) => read(body, |reply| analogue(asked.channels, reply)),
        Request::IoTest(_) => read(body, |reply: &IoTestReply| {
            can(reply.levels < 16, || format!("levels {:#x} of four lines", reply.levels))
        }),
        Request::StreamStart(asked) => read(body, |reply| stream_start(&asked, reply)),
        Request::StreamStop(_) => read(body, |reply: &StreamStopReply| {
            let StreamStopReply { produced, dropped } = *reply;
            must(dropped <= produced, &rule::ACCOUNT, || format!("{dropped} dropped of {produced} produced"))
        }),
        Request::CanCounters(_) => read(body, can_counters),
        Request::CalibrationRead(_) => read(body, calibration),
        Request::MakeSafe(_)
        | Request::Abort(_)
        | Request::LinkCounters(_)
        | Request::FlashId(_)
        | Request::SpiTransfer(_)
        | Request::SciEcho(_)
        | Request::GnssRestart(_)
        | Request::CalibrationWrite(_) => Ok(()),
    }
}

fn read<T: Wire>(body: &[u8], check: impl FnOnce(&T) -> Possible) -> Possible {
    T::from_payload(body).map_or(Ok(()), |reply| check(&reply))
}

/// An answer for each operand.
fn each(asked: usize, got: usize) -> Possible {
    can(got == asked, || format!("{got} results for {asked} operands"))
}

fn supply(reply: &PowerReply) -> Possible {
    let PowerReply { supply_uv, supply_ua } = *reply;
    can(supply_uv <= SUPPLY_MAX_UV && supply_ua <= SUPPLY_MAX_UA, || {
        format!("{:.1} V and {:.3} A at the socket", f64::from(supply_uv) * 1e-6, f64::from(supply_ua) * 1e-6)
    })
}

fn error_records(reply: &ErrorRecordsReply) -> Possible {
    let rises = reply.records.windows(2).all(|pair| pair[0].index < pair[1].index);
    let last = reply.records.last().map(|record| record.index);
    can(rises && last.is_none_or(|last| last < reply.total), || {
        format!("records up to number {} of {}", last.unwrap_or_default(), reply.total)
    })
}

fn identity(reply: &IdentityReply) -> Possible {
    let IdentityReply { serial_number, part, hardware, firmware, .. } = reply;
    let texts = [
        ("serial number", serial_number.as_str()),
        ("part number", part),
        ("hardware revision", hardware),
        ("firmware version", firmware),
    ];
    texts.into_iter().try_for_each(|(name, text)| {
        must(!text.contains('\0'), &rule::NUL, || format!("the {name} is \"{}\"", text.escape_debug()))
    })
}

fn timer(asked: &TimerMeasure, reply: &TimerMeasureReply, elapsed_us: u64) -> Possible {
    let intervals = reply.intervals_ns.len();
    can(intervals == usize::from(reply.interrupts), || {
        format!("{intervals} intervals for {} interrupts", reply.interrupts)
    })?;
    can(intervals <= usize::from(asked.count), || format!("{intervals} intervals of {} asked for", asked.count))?;
    let sum_us = reply.intervals_ns.iter().map(|ns| u64::from(*ns)).sum::<u64>() / 1000;
    let spread_us = AROUND_INTERVALS_US + elapsed_us / 5;
    let all = intervals == usize::from(asked.count);
    can(sum_us <= elapsed_us + ROUNDED_US && (!all || elapsed_us <= sum_us + spread_us), || {
        format!("the intervals add up to {sum_us} us, and the request took {elapsed_us} us")
    })
}

/// Words of a memory, and the largest one.
fn words_of(ram: u8) -> Option<(u32, u32)> {
    match Ram::from_number(ram)? {
        Ram::Internal => Some((65_536, 0xffff)),
        Ram::Sdram => Some((1_048_576, u32::MAX)),
    }
}

fn mismatch(reply: &MismatchReply, memory: Option<(u32, u32)>) -> Possible {
    let MismatchReply { words, mismatches, first_place, expected, got } = *reply;
    let (most_words, largest) = memory.unwrap_or((u32::MAX, u32::MAX));
    can(words <= most_words, || format!("{words} words of a memory of {most_words}"))?;
    if mismatches == 0 {
        return Ok(());
    }
    can(first_place < words, || format!("a mismatch at word {first_place} of {words}"))?;
    can(expected != got, || format!("a mismatch where {expected:#010x} was expected and read"))?;
    can(expected <= largest && got <= largest, || format!("word {expected:#x} or {got:#x} in a memory of 16 bits"))
}

/// The flash is busy for most of its request, and never longer.
fn busy(duration_us: u32, elapsed_us: u64) -> Possible {
    let duration = u64::from(duration_us);
    can(duration <= elapsed_us + ROUNDED_US && elapsed_us <= 10 * duration + AROUND_BUSY_US, || {
        format!("the flash was busy for {duration_us} us of a request that took {elapsed_us} us")
    })
}

fn analogue(asked: u8, reply: &AdReadReply) -> Possible {
    let wanted = (1..=8).filter(|channel| asked >> (channel - 1) & 1 == 1);
    let got: Vec<u8> = reply.channels.iter().map(|channel| channel.channel).collect();
    can(wanted.eq(got.iter().copied()), || format!("channels {got:?} for the bits {asked:#010b}"))?;
    reply.channels.iter().try_for_each(|channel| {
        let (mean, min, max) = (channel.mean_uv, channel.min_uv, channel.max_uv);
        can(min <= mean && mean <= max && AD_UV.contains(&min) && AD_UV.contains(&max), || {
            format!("channel {}: mean {mean} uV, from {min} to {max} uV", channel.channel)
        })
    })
}

fn stream_start(asked: &StreamStart, reply: &StreamStartReply) -> Possible {
    let Some(id) = StreamId::from_number(asked.stream) else { return Ok(()) };
    can(reply.format == format_of(id) as u8, || format!("format {} of {}", reply.format, id.name()))?;
    can(asked.samples_per_frame == 0 || asked.samples_per_frame == reply.samples_per_frame, || {
        format!("{} samples a frame where {} were asked for", reply.samples_per_frame, asked.samples_per_frame)
    })
}

fn can_counters(reply: &CanCountersReply) -> Possible {
    let CanCountersReply { state, received, echoed, .. } = *reply;
    can(CanState::from_number(state).is_some(), || format!("state {state} of a CAN controller"))?;
    can(echoed <= received, || format!("{echoed} frames sent back of {received} received"))
}

fn calibration(reply: &CalibrationReadReply) -> Possible {
    let stored = reply.calibration.len();
    can(
        match CalibrationState::from_number(reply.state) {
            Some(CalibrationState::None) => stored == 0,
            Some(CalibrationState::Valid) => stored == 1,
            Some(CalibrationState::Damaged) => true,
            None => false,
        },
        || format!("state {} with {stored} calibrations", reply.state),
    )
}

fn format_of(id: StreamId) -> Format {
    match id {
        StreamId::Imu => Format::Imu,
        StreamId::Gnss => Format::Bytes,
        StreamId::Pps => Format::Pps,
        StreamId::Compensated => Format::Compensated,
    }
}

/// Checks a frame of a stream.
///
/// # Errors
/// [`Impossible`].
pub(super) fn frame(id: StreamId, frame: &SampleFrame) -> Possible {
    let SampleFrame { head, samples } = frame;
    let sample_bytes = match id {
        StreamId::Imu => IMU_SAMPLE,
        StreamId::Gnss => 1,
        StreamId::Pps => CAPTURE_BYTES,
        StreamId::Compensated => COMPENSATED_SAMPLE,
    };
    must(head.format == format_of(id) as u8, &rule::STREAM_LAYOUT, || format!("format {}", head.format))?;
    let bytes = usize::from(head.count) * sample_bytes;
    must(samples.len() == bytes, &rule::STREAM_LAYOUT, || {
        format!("{} bytes for {} samples, which have {bytes}", samples.len(), head.count)
    })?;
    match id {
        StreamId::Imu => samples.chunks_exact(IMU_SAMPLE).try_for_each(codes),
        StreamId::Pps => captures(head.board_time_us, samples),
        StreamId::Gnss | StreamId::Compensated => Ok(()),
    }
}

/// The nine channels of an IMU sample come from converters of 24 bits.
fn codes(sample: &[u8]) -> Possible {
    let (channels, _) = sample.as_chunks::<4>();
    let far = |bytes: &[u8; 4]| !(-SATURATION - 1..=SATURATION).contains(&i32::from_le_bytes(*bytes));
    match channels.iter().take(9).find(|bytes| far(bytes)) {
        None => Ok(()),
        Some(bytes) => Err(Impossible { rule: &rule::CODE, why: format!("code {}", i32::from_le_bytes(*bytes)) }),
    }
}

fn captures(board_time_us: u64, samples: &[u8]) -> Possible {
    let (captures, _) = samples.as_chunks::<CAPTURE_BYTES>();
    let Some(first) = captures.first() else { return Ok(()) };
    let edge_us = u64::from_le_bytes(*first) / 1000;
    must(edge_us.abs_diff(board_time_us) < CAPTURE_US, &rule::CAPTURE, || {
        format!("an edge at {edge_us} us in a frame of {board_time_us} us")
    })
}

#[cfg(test)]
mod tests {
    use gnc_protocol::message::{
        AdChannel, AdRead, Call, CanCounters, ErrorRecord, ErrorRecords, FlashErase, Identity, IoTest, ModulePower,
        RamTest, StreamStop,
    };
    use gnc_protocol::stream::StreamHead;
    use gnc_protocol::wire::{List, text};

    use super::*;

    /// The section that an answer breaks, if it breaks one.
    fn broken<C: Call>(call: &C, reply: &C::Reply, elapsed_us: u64) -> Option<u8> {
        let (asked, body) = (call.to_payload().unwrap(), reply.to_payload().unwrap());
        check(C::ID, &asked, &body, Duration::from_micros(elapsed_us)).err().map(|impossible| impossible.rule.section)
    }

    fn list<T: Clone, const N: usize>(elements: &[T]) -> List<T, N> {
        List::from_slice(elements).unwrap()
    }

    #[test]
    fn a_supply_may_be_bad_but_not_two_kilovolts() {
        let power =
            |supply_uv, supply_ua| broken(&ModulePower { on: 1 }, &PowerReply { supply_uv, supply_ua }, 150_000);
        assert_eq!(power(5_012_345, 491_234), None);
        assert_eq!(power(1_200_000, 2_100_000), None, "a short");
        assert_eq!(power(0, 0), None, "no supply");
        assert_eq!(power(2_052_000_000, 491_234), Some(11));
        assert_eq!(power(5_000_000, 491_234_000), Some(11));
    }

    #[test]
    fn intervals_fill_the_time_of_their_request() {
        let asked = TimerMeasure { timer: 0, period_us: 5000, count: 4 };
        let timer = |interrupts, intervals_ns: &[u32], elapsed_us| {
            broken(&asked, &TimerMeasureReply { interrupts, intervals_ns: list(intervals_ns) }, elapsed_us)
        };
        assert_eq!(timer(4, &[5_000_010; 4], 20_001), None);
        assert_eq!(timer(4, &[10_000_000; 4], 40_000), None, "a timer of half the rate");
        assert_eq!(timer(3, &[5_000_000, 10_000_000, 5_000_000], 20_000), None, "an interrupt is missing");
        assert_eq!(timer(0, &[], 200_000), None, "a dead timer");
        assert_eq!(timer(4, &[5_000_000; 4], 2_000), Some(11), "four intervals of 5 ms in 2 ms");
        assert_eq!(timer(4, &[5_000; 4], 300_000), Some(11), "microseconds instead of nanoseconds");
        assert_eq!(timer(4, &[5_000_000; 3], 20_000), Some(11));
        assert_eq!(timer(5, &[4_000_000; 5], 20_000), Some(11));
    }

    #[test]
    fn texts_hold_no_nul() {
        let identity = |serial: &str| {
            let serial_number = text(serial);
            broken(&Identity {}, &IdentityReply { serial_number, ..IdentityReply::default() }, 20_000)
        };
        assert_eq!(identity("GNC-2026-000123"), None);
        assert_eq!(identity("Прибор № 7"), None);
        assert_eq!(identity("\u{1b}[2J"), None, "ugly, and shown without harm");
        assert_eq!(identity("GNC\0\0\0\0"), Some(5));
    }

    #[test]
    fn mismatches_lie_in_their_memory() {
        let found = |words, mismatches, first_place, expected, got| {
            let reply = MismatchReply { words, mismatches, first_place, expected, got };
            broken(&RamTest { ram: 0, pattern: 0 }, &reply, 4000)
        };
        assert_eq!(found(65_536, 0, 0, 0, 0), None);
        assert_eq!(found(65_536, 3, 65_535, 0, 0x8000), None);
        assert_eq!(found(65_537, 0, 0, 0, 0), Some(11));
        assert_eq!(found(65_536, 1, 65_536, 0, 1), Some(11));
        assert_eq!(found(65_536, 1, 7, 5, 5), Some(11));
        assert_eq!(found(65_536, 1, 7, 0, 0x1_0000), Some(11));
    }

    #[test]
    fn a_flash_is_busy_no_longer_than_its_request() {
        let erase = |duration_us, elapsed_us| {
            broken(&FlashErase { flash: 0, sector: 0 }, &DurationReply { duration_us }, elapsed_us)
        };
        assert_eq!(erase(60_000, 60_010), None);
        assert_eq!(erase(60_500, 60_000), None, "rounded");
        assert_eq!(erase(60_000_000, 60_000), Some(11), "nanoseconds");
        assert_eq!(erase(60, 60_000), Some(11), "milliseconds");
        assert_eq!(erase(0, 900), None, "a flash that does nothing");
    }

    #[test]
    fn the_converter_gives_the_channels_asked_for_within_its_range() {
        let channel = |channel, mean_uv, min_uv, max_uv| AdChannel { channel, mean_uv, min_uv, max_uv };
        let read = |channels: &[AdChannel]| {
            broken(&AdRead { channels: 0b101, samples: 16 }, &AdReadReply { channels: list(channels) }, 2600)
        };
        let first = channel(1, 2_500_000, 2_499_000, 2_501_000);
        assert_eq!(read(&[first.clone(), channel(3, 6_144_000, 6_144_000, 6_144_000)]), None);
        assert_eq!(read(&[first.clone(), channel(3, 0, -93, 93)]), None, "noise around nothing");
        for wrong in
            [channel(2, 1, 1, 1), channel(3, 5, 6, 7), channel(3, 2_500, 2_400, 2_000_000_000), channel(0, 1, 1, 1)]
        {
            assert_eq!(read(&[first.clone(), wrong.clone()]), Some(11), "{wrong:?}");
        }
        assert_eq!(read(&[first]), Some(11), "a channel is missing");
    }

    #[test]
    fn the_other_answers_fit_their_requests() {
        let io = |levels| broken(&IoTest { driver: 0, reader: 1, level: 1 }, &IoTestReply { levels }, 1000);
        assert_eq!((io(0b1001), io(0b1_0000)), (None, Some(11)));
        let account =
            |produced, dropped| broken(&StreamStop { stream: 1 }, &StreamStopReply { produced, dropped }, 1000);
        assert_eq!((account(5, 5), account(5, 6)), (None, Some(10)));
        let counters = |state, received, echoed| {
            broken(&CanCounters {}, &CanCountersReply { state, tx_errors: 0, rx_errors: 0, received, echoed }, 1000)
        };
        assert_eq!((counters(2, 9, 3), counters(3, 9, 9), counters(0, 3, 9)), (None, Some(11), Some(11)));
        let records = |total, indices: &[u16]| {
            let records: Vec<ErrorRecord> =
                indices.iter().map(|index| ErrorRecord { index: *index, ..ErrorRecord::default() }).collect();
            broken(&ErrorRecords { from: 0 }, &ErrorRecordsReply { total, records: list(&records) }, 0)
        };
        assert_eq!((records(3, &[0, 2]), records(3, &[0, 3]), records(3, &[2, 1])), (None, Some(11), Some(11)));
        let start = |format, samples_per_frame| {
            let asked = StreamStart { stream: 1, rate_hz: 1000, count: 0, samples_per_frame: 10 };
            broken(&asked, &StreamStartReply { format, samples_per_frame, load_permille: 473 }, 1000)
        };
        assert_eq!((start(1, 10), start(2, 10), start(1, 12)), (None, Some(11), Some(11)));
    }

    #[test]
    fn samples_have_24_bits_and_captures_are_of_their_time() {
        let section = |id: StreamId, format: Format, samples: &[u8], count| {
            let head = StreamHead {
                stream: id as u8,
                format: format as u8,
                count,
                board_time_us: 7_000_000,
                ..StreamHead::default()
            };
            frame(id, &SampleFrame { head, samples: samples.into() }).err().map(|impossible| impossible.rule.section)
        };
        let sample = |code: i32| [&code.to_le_bytes()[..], &[0; 36]].concat();
        let imu = |code| section(StreamId::Imu, Format::Imu, &sample(code), 1);
        assert_eq!((imu(SATURATION), imu(-SATURATION - 1)), (None, None), "the ends");
        assert_eq!((imu(SATURATION + 1), imu(i32::MIN)), (Some(10), Some(10)));
        let pulse = |ns: u64| section(StreamId::Pps, Format::Pps, &ns.to_le_bytes(), 1);
        assert_eq!((pulse(7_000_000_120), pulse(7_000_000), pulse(7_000_000_000_000)), (None, Some(10), Some(10)));
        assert_eq!(section(StreamId::Gnss, Format::Bytes, b"$GN", 3), None);
        assert_eq!(section(StreamId::Gnss, Format::Bytes, b"$GN", 4), Some(10), "a byte is missing");
        assert_eq!(section(StreamId::Gnss, Format::Imu, b"$GN", 3), Some(10));
    }
}
