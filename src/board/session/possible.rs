//! What an answer or a frame of a stream can hold at all, whatever the module is like.
//!
//! A value outside these bounds does not come from a module, good or bad: the board reads, scales or lays it out in
//! another way than the interface document. The bounds are wide, so that no fault of a module lies beyond them.

use std::time::Duration;

use gnc_protocol::Request;
use gnc_protocol::calibration::{CalibrationCommitReply, CalibrationReadReply, CalibrationState};
use gnc_protocol::message::{
    AdReadReply, CanCountersReply, CanState, DurationReply, ErrorRecordsReply, FlashIdReply, IdentityReply,
    IoTestReply, MismatchReply, PowerReply, Ram, SpiTransferReply, StreamStart, StreamStartReply, StreamStopReply,
    TimerMeasure, TimerMeasureReply,
};
use gnc_protocol::stream::{COMPENSATED_SAMPLE, Format, IMU_SAMPLE, SATURATION, StreamId};
use gnc_protocol::wire::Wire;

use crate::breach::{Rule, rule};
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
        Request::TimerMeasure(asked) => read(body, |reply| timer(&asked, reply, elapsed_us)),
        Request::RamTest(asked) => read(body, |reply| mismatch(reply, words_of(asked.ram))),
        Request::FlashBlankCheck(_) | Request::FlashVerify(_) => read(body, |reply| mismatch(reply, None)),
        Request::FlashId(_) => read(body, |reply: &FlashIdReply| {
            can(reply.sector_bytes > 0 && reply.sector_bytes % 4 == 0, || {
                format!("sectors of {} bytes, which are no whole words", reply.sector_bytes)
            })
        }),
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
        Request::SpiTransfer(asked) => read(body, |reply: &SpiTransferReply| {
            let (seen, sent) = (reply.data.len(), asked.data.len());
            can(seen <= sent, || format!("{seen} bytes seen of {sent} that were sent"))
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
        | Request::CpuWords(_)
        | Request::CpuIntegers(_)
        | Request::CpuFloats(_)
        | Request::SciEcho(_)
        | Request::GnssRestart(_)
        | Request::CalibrationWrite(_) => Ok(()),
    }
}

fn read<T: Wire>(body: &[u8], check: impl FnOnce(&T) -> Possible) -> Possible {
    T::from_payload(body).map_or(Ok(()), |reply| check(&reply))
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
        must(!text.chars().any(char::is_control), &rule::CONTROL_CHARACTER, || {
            format!("the {name} is \"{}\"", text.escape_debug())
        })
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

fn busy(duration_us: u32, elapsed_us: u64) -> Possible {
    can(u64::from(duration_us) <= elapsed_us + ROUNDED_US, || {
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
