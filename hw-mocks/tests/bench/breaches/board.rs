//! Restarts, state and power, values, streams.

use std::time::Duration;

use gnc_protocol::Call;
use gnc_protocol::error::FaultCode;
use gnc_protocol::frame::Kind;
use gnc_protocol::message::{
    AdRead, AdReadReply, CpuWords, CpuWordsReply, DurationReply, ErrorKind, ErrorRecords, ErrorRecordsReply,
    FlashErase, MakeSafe, ModulePower, PowerReply, ResultHead, StreamStart, StreamStartReply, StreamStop,
    StreamStopReply, TimerMeasure, TimerMeasureReply,
};
use gnc_protocol::stream::{ImuSample, PpsCapture, StreamFrame};
use gnc_protocol::wire::{List, Wire};

use super::record::{BOTH, Link, Noted, Record, WAY, ms};
use super::{Case, Rule, check};

/// The first stream: so many samples, a hundred a second.
const COUNT: u32 = 300;
const PERIOD_US: u64 = 10_000;
/// Samples in a frame on RS-422.
const A_FRAME: u8 = 5;
const CHANNELS: u8 = 0b1011_0001;
const WORDS: usize = 3;
/// What a code of 24 bits holds.
const CODES: std::ops::RangeInclusive<i32> = -8_388_608..=8_388_607;

/// One session with each value and each stream.
fn session(personality: &str, link: Link) -> Record {
    let mut host = Record::new(personality, link);
    host.run(ms(1100));
    host.hello(7);
    host.run(ms(100));
    host.post(&ModulePower { on: 1 });
    host.run(ms(300));
    host.post(&TimerMeasure { timer: 0, period_us: 100_000, count: 20 });
    host.run(ms(2200));
    host.post(&FlashErase { flash: 0, sector: 0 });
    host.run(ms(300));
    host.post(&AdRead { channels: CHANNELS, samples: 10 });
    host.post(&CpuWords { core: 1, target: 0, words: List::from_slice(&[1; WORDS]).unwrap() });
    host.run(ms(300));
    let samples_per_frame = if link == Link::Serial { A_FRAME } else { 0 };
    host.post(&StreamStart { stream: 1, rate_hz: 100, count: COUNT, samples_per_frame });
    host.run(ms(3500));
    host.post(&StreamStop { stream: 1 });
    host.run(ms(300));
    host.post(&StreamStart { stream: 3, rate_hz: 0, count: 0, samples_per_frame: 0 });
    host.run(ms(30_000));
    host.post(&StreamStop { stream: 3 });
    host.run(ms(2500));
    host.post(&MakeSafe {});
    host.run(ms(1500));
    host
}

/// The body of the RESULT of a request: head and reply; `None` if it failed.
fn result<C: Call>(record: &Record) -> Option<(ResultHead, C::Reply)> {
    results::<C>(record).into_iter().next()?
}

fn results<C: Call>(record: &Record) -> Vec<Option<(ResultHead, C::Reply)>> {
    let of_call = record.of(Kind::Result).filter(|noted| noted.frame.header.message == C::ID);
    let read = |noted: &Noted| {
        let (head, body) = noted.frame.payload.split_at_checked(6)?;
        Some((ResultHead::from_payload(head).ok()?, C::Reply::from_payload(body).ok()?))
    };
    of_call.map(read).collect()
}

/// The moments of the requests of a message.
fn asked<C: Call>(record: &Record) -> Vec<Duration> {
    record.requests().iter().filter(|request| request.2 == C::ID).map(|request| request.0).collect()
}

/// The frames of a stream, with their times.
fn streamed(record: &Record, stream: u8) -> Vec<(Duration, StreamFrame)> {
    let of_stream = record.of(Kind::Stream).filter(|noted| noted.frame.header.message == u16::from(stream));
    of_stream.map(|noted| (noted.at, StreamFrame::from_payload(&noted.frame.payload).unwrap())).collect()
}

fn samples(record: &Record) -> Vec<ImuSample> {
    let frames = streamed(record, 1);
    let bytes = frames.iter().flat_map(|(_, frame)| frame.samples.chunks(40));
    bytes.map(|bytes| ImuSample::from_payload(bytes).unwrap()).collect()
}

/// Whether a bit of the state is right in each heartbeat; `None`: not asked for at this moment.
fn bit(record: &Record, bit: u8, right: impl Fn(Duration) -> Option<bool>) -> bool {
    record.beats().iter().all(|(at, beat)| right(*at).is_none_or(|right| right == (beat.state >> bit & 1 == 1)))
}

fn session_bit(record: &Record) -> bool {
    let hello = record.sent.iter().find(|noted| noted.frame.header.kind == Kind::Hello).unwrap().at;
    bit(record, 0, |at| (at < hello || at > hello + WAY).then_some(at > hello))
}

fn power_bit(record: &Record) -> bool {
    let change_near = |at: Duration| record.power.iter().any(|(change, _)| change.abs_diff(at) < WAY);
    let powered = |at: Duration| record.power.iter().rev().find(|(change, _)| *change <= at).is_some_and(|(_, on)| *on);
    bit(record, 1, |at| (!change_near(at)).then_some(powered(at)))
}

fn requests_bit(record: &Record) -> bool {
    let timer = asked::<TimerMeasure>(record)[0];
    if result::<TimerMeasure>(record).is_none() {
        return true;
    }
    bit(record, 2, |at| (at > timer + WAY && at < timer + ms(1900)).then_some(true))
}

fn streams_bit(record: &Record) -> bool {
    let starts = asked::<StreamStart>(record);
    let began = starts[0] + ms(20);
    if streamed(record, 1).is_empty() {
        return true;
    }
    bit(record, 3, |at| (began < at && at < began + ms(2500)).then_some(true).or((at < starts[0]).then_some(false)))
}

fn safe_takes_the_power(record: &Record) -> bool {
    record.power.last().is_none_or(|(_, on)| !on)
}

fn power_stays(record: &Record) -> bool {
    let safe = asked::<MakeSafe>(record)[0];
    record.power.iter().all(|(at, on)| *on || *at == Duration::ZERO || *at >= safe || *at < ms(1100))
}

fn power_comes(record: &Record) -> bool {
    result::<ModulePower>(record).is_some()
}

fn supply_as_measured(record: &Record) -> bool {
    result::<ModulePower>(record).is_none_or(|(_, reply): (_, PowerReply)| {
        (4_500_000..5_500_000).contains(&reply.supply_uv) && (100_000..2_000_000).contains(&reply.supply_ua)
    })
}

fn intervals_sum_to_the_time(record: &Record) -> bool {
    result::<TimerMeasure>(record).is_none_or(|(head, reply): (_, TimerMeasureReply)| {
        let sum_ns: u64 = reply.intervals_ns.iter().map(|interval| u64::from(*interval)).sum();
        (sum_ns / 1000).abs_diff(u64::from(head.elapsed_us)) < 1000
    })
}

fn flash_was_busy_within_the_time(record: &Record) -> bool {
    result::<FlashErase>(record)
        .is_none_or(|(head, reply): (_, DurationReply)| reply.duration_us <= head.elapsed_us + 1000)
}

fn channels_as_asked_for(record: &Record) -> bool {
    result::<AdRead>(record).is_none_or(|(_, reply): (_, AdReadReply)| {
        let channels: Vec<u8> = reply.channels.iter().map(|read| read.channel).collect();
        channels == [1, 5, 6, 8]
    })
}

fn words_as_asked_for(record: &Record) -> bool {
    result::<CpuWords>(record).is_none_or(|(_, reply): (_, CpuWordsReply)| reply.words.len() == WORDS)
}

fn codes_of_24_bits(record: &Record) -> bool {
    let codes = samples(record).into_iter().flat_map(|sample| [sample.gyro, sample.accel, sample.mag].concat());
    codes.into_iter().all(|code| CODES.contains(&code))
}

/// One g on the axis that points up, in counts.
fn one_g_is_160000(record: &Record) -> bool {
    samples(record).iter().all(|sample| sample.accel[2].abs_diff(160_000) < 16_000)
}

fn captures_at_their_frames_time(record: &Record) -> bool {
    let frames = streamed(record, 3);
    assert!(frames.len() > 5 || power_lost(record), "{} captures", frames.len());
    frames.iter().all(|(_, frame)| {
        let capture_us = PpsCapture::from_payload(&frame.samples).unwrap().board_time_ns / 1000;
        record.link == Link::Can || capture_us.abs_diff(frame.head.board_time_us) <= 1
    })
}

/// Captures are moments of the board's clock: a heartbeat a second, a capture a second.
fn captures_on_the_clock(record: &Record) -> bool {
    let capture_us = |frame: &StreamFrame| PpsCapture::from_payload(&frame.samples).unwrap().board_time_ns / 1000;
    let times: Vec<u64> = streamed(record, 3).iter().map(|(_, frame)| capture_us(frame)).collect();
    // A capture may be lost on the way.
    let near_a_second = |apart_us: u64| apart_us > 500_000 && (apart_us + 500) % 1_000_000 < 1000;
    times.windows(2).all(|pair| near_a_second(pair[1].abs_diff(pair[0])))
}

fn power_lost(record: &Record) -> bool {
    !power_comes(record) || !power_stays(record)
}

fn numbers_from_zero(record: &Record) -> bool {
    streamed(record, 1).first().is_none_or(|(_, frame)| frame.head.first == 0)
}

fn account_adds_up(record: &Record) -> bool {
    let Some(Some((_, reply))) = results::<StreamStop>(record).into_iter().next() else { return false };
    let StreamStopReply { produced, dropped } = reply;
    produced == samples(record).len() as u32 + dropped
}

fn none_missing_in_between(record: &Record) -> bool {
    let frames = streamed(record, 1);
    let follows = |pair: &[(Duration, StreamFrame)]| {
        let (before, after) = (&pair[0].1.head, &pair[1].1.head);
        after.first - before.first == u32::from(before.count) + (after.dropped - before.dropped)
    };
    frames.windows(2).all(follows)
}

fn no_more_than_asked_for(record: &Record) -> bool {
    samples(record).len() as u32 <= COUNT
}

fn result_before_samples(record: &Record) -> bool {
    let result = record.of(Kind::Result).find(|noted| noted.frame.header.message == StreamStart::ID);
    let place = |of: &Noted| record.came.iter().position(|noted| std::ptr::eq(noted, of)).unwrap();
    let first = record.of(Kind::Stream).next();
    first.is_none_or(|first| result.is_some_and(|result| place(result) < place(first)))
}

fn samples_per_frame_as_told(record: &Record) -> bool {
    let Some((_, reply)) = result::<StreamStart>(record) else { return true };
    let StreamStartReply { samples_per_frame, .. } = reply;
    let frames = streamed(record, 1);
    let whole = frames.split_last().map_or(&[][..], |(_, whole)| whole);
    whole.iter().all(|(_, frame)| frame.head.count == u16::from(samples_per_frame))
}

fn times_on_the_grid(record: &Record) -> bool {
    let frames = streamed(record, 1);
    let heads: Vec<_> = frames.iter().map(|(_, frame)| &frame.head).collect();
    heads.windows(2).all(|pair| {
        let due_us = u64::from(pair[1].first - pair[0].first) * PERIOD_US;
        pair[1].board_time_us.abs_diff(pair[0].board_time_us).abs_diff(due_us) <= 1
    })
}

/// Board time of a frame is that of the heartbeats, to the second between two of them.
fn times_of_the_boards_clock(record: &Record) -> bool {
    let beats = record.beats();
    streamed(record, 1).iter().all(|(at, frame)| {
        let beat = beats.iter().rev().find(|(beat, _)| beat <= at);
        beat.is_none_or(|(_, beat)| frame.head.board_time_us.abs_diff(beat.board_time_us) < 1_100_000)
    })
}

fn no_sample_twice(record: &Record) -> bool {
    !samples(record).windows(2).any(|pair| pair[0] == pair[1])
}

const RULES: [Rule; 25] = [
    ("bit 0 is the session", session_bit),
    ("bit 1 is the supply", power_bit),
    ("bit 2 is the requests", requests_bit),
    ("bit 3 is the streams", streams_bit),
    ("the safe state is without power", safe_takes_the_power),
    ("power stays until it is taken", power_stays),
    ("power comes", power_comes),
    ("the supply in its units", supply_as_measured),
    ("intervals sum to elapsed_us", intervals_sum_to_the_time),
    ("a flash is busy within elapsed_us", flash_was_busy_within_the_time),
    ("AD channels as asked for", channels_as_asked_for),
    ("words as asked for", words_as_asked_for),
    ("codes of 24 bits", codes_of_24_bits),
    ("1 g is 160,000 counts", one_g_is_160000),
    ("a capture is its frame's time", captures_at_their_frames_time),
    ("a capture a second", captures_on_the_clock),
    ("numbers from 0", numbers_from_zero),
    ("the account adds up", account_adds_up),
    ("no gap but of dropped samples", none_missing_in_between),
    ("no sample beyond the count", no_more_than_asked_for),
    ("RESULT before samples", result_before_samples),
    ("samples a frame as told", samples_per_frame_as_told),
    ("times on the grid", times_on_the_grid),
    ("times of the board's clock", times_of_the_boards_clock),
    ("no sample twice", no_sample_twice),
];

const SERIAL: &[Link] = &[Link::Serial];
const CAN: &[Link] = &[Link::Can];

const CASES: [Case; 29] = [
    ("state_bits_cleared = [0]", &BOTH, &["bit 0 is the session"]),
    ("state_bits_set = [0]", &BOTH, &["bit 0 is the session"]),
    ("state_bits_set = [1]", &BOTH, &["bit 1 is the supply"]),
    ("state_bits_cleared = [1]", &BOTH, &["bit 1 is the supply"]),
    ("state_bits_cleared = [2]", &BOTH, &["bit 2 is the requests"]),
    ("state_bits_cleared = [3]", &BOTH, &["bit 3 is the streams"]),
    ("safe_keeps_power = true", &BOTH, &["the safe state is without power"]),
    ("powers_off_after_s = 20", &BOTH, &["power stays until it is taken"]),
    ("supply_uv_times = 1000", &BOTH, &["the supply in its units"]),
    ("supply_ua_times = 0.001", &BOTH, &["the supply in its units"]),
    ("timer_intervals_times = 0.1", &BOTH, &["intervals sum to elapsed_us"]),
    ("flash_durations_times = 1000", &BOTH, &["a flash is busy within elapsed_us"]),
    ("ad_channels = \"falling\"", &BOTH, &["AD channels as asked for"]),
    ("ad_channels = \"from-zero\"", &BOTH, &["AD channels as asked for"]),
    ("extra_words = 1", &BOTH, &["words as asked for"]),
    ("imu_shift_bits = 8", SERIAL, &["codes of 24 bits", "1 g is 160,000 counts"]),
    ("imu_shift_bits = 8", CAN, &["1 g is 160,000 counts"]),
    ("pps_times = 0.001", SERIAL, &["a capture is its frame's time", "a capture a second"]),
    ("pps_times = 0.001", CAN, &["a capture a second"]),
    ("stream_numbers_from = 1", &BOTH, &["numbers from 0"]),
    ("produced_off = -3", &BOTH, &["the account adds up"]),
    ("drops_frame_every = 7", &BOTH, &["the account adds up", "no gap but of dropped samples"]),
    (
        "stream_time_times = 0.001",
        SERIAL,
        &["a capture is its frame's time", "times on the grid", "times of the board's clock"],
    ),
    ("stream_time_times = 0.001", CAN, &["times on the grid", "times of the board's clock"]),
    ("samples_before_result = true", &BOTH, &["RESULT before samples"]),
    ("samples_a_frame = 3", SERIAL, &["samples a frame as told"]),
    ("extra_samples = 5", &BOTH, &["no sample beyond the count"]),
    ("repeats = { samples = 50, of = 200 }", &BOTH, &["no sample twice"]),
    ("over_current_at_power_on = true", &BOTH, &["power comes"]),
];

#[test]
fn each_board_breaks_its_rule_of_values_and_streams_and_no_other() {
    check(&RULES, &CASES, session);
}

/// A stream goes on after its StreamStop, and a good one does not.
#[test]
fn a_stream_goes_on_after_its_stop() {
    for link in BOTH {
        let after = |keys: &str| {
            let mut host = Record::new(&format!("[board]\n{keys}\n"), link);
            host.hello(7);
            host.run(ms(100));
            host.post(&ModulePower { on: 1 });
            host.run(ms(300));
            host.post(&StreamStart { stream: 1, rate_hz: 100, count: 0, samples_per_frame: 0 });
            host.run(ms(500));
            host.post(&StreamStop { stream: 1 });
            host.run(ms(500));
            assert!(result::<StreamStop>(&host).is_some());
            let stopped = asked::<StreamStop>(&host)[0] + ms(100);
            streamed(&host, 1).iter().filter(|(at, _)| *at > stopped).count()
        };
        assert_eq!(after(""), 0);
        assert!(after("streams_go_on = true") >= 7);
    }
}

/// The record of the supply and the status tell the over-current.
#[test]
fn over_current_leaves_a_record_and_a_text() {
    for link in BOTH {
        let mut host = Record::new("[board]\nover_current_at_power_on = true\n", link);
        host.hello(7);
        host.run(ms(100));
        let power = host.post(&ModulePower { on: 1 });
        host.run(ms(300));
        host.post(&ErrorRecords { from: 0 });
        host.run(ms(300));
        let answers = host.answers(power);
        let payload = &answers.last().unwrap().frame.payload;
        assert_eq!(payload[..2], (FaultCode::DeviceFault as u16).to_le_bytes());
        assert_eq!(payload[6..], *b"\x21over current: 2.1 A, switched off".as_slice());
        let (_, ErrorRecordsReply { total, records }) = result::<ErrorRecords>(&host).unwrap();
        assert_eq!((total, records[0].kind, records[0].request), (1, ErrorKind::Supply as u16, power));
        assert!(host.beats().iter().all(|(_, beat)| beat.state & 2 == 0));
    }
}

/// A board that restarts by itself two seconds after its start.
fn restarted(personality: &str, link: Link) -> Record {
    let mut host = Record::new(&format!("{personality}[reboot]\nat_board_time_s = 2.5\n"), link);
    host.run(ms(6000));
    host
}

/// The heartbeats before the restart and after it.
fn either_side(record: &Record) -> [Vec<(u32, u64)>; 2] {
    let beats = record.beats();
    let (before, after): (Vec<_>, Vec<_>) = beats.iter().partition(|(at, _)| *at < ms(2500));
    let told = |beats: Vec<&(Duration, gnc_protocol::message::Heartbeat)>| {
        beats.iter().map(|(_, beat)| (beat.boot_id, beat.board_time_us)).collect()
    };
    [told(before.into_iter().collect()), told(after.into_iter().collect())]
}

const OF_RESTARTS: [Rule; 3] = [
    ("a new boot id", |record| {
        let [before, after] = either_side(record);
        before[0].0 != after[0].0
    }),
    ("board time from the start", |record| either_side(record)[1][0].1 < 300_000),
    ("board time never goes back in between", |record| {
        let rises = |beats: &[(u32, u64)]| beats.windows(2).all(|pair| pair[0].1 < pair[1].1);
        let [before, after] = either_side(record);
        rises(&before) && rises(&after)
    }),
];

#[test]
fn each_board_breaks_its_rule_of_restarts_and_no_other() {
    let cases: [Case; 3] = [
        ("keeps_boot_id = true", &BOTH, &["a new boot id"]),
        ("clock_runs_on = true", &BOTH, &["board time from the start"]),
        ("clock_back_at_s = 1.5\nclock_back_s = 1.2", &BOTH, &["board time never goes back in between"]),
    ];
    check(&OF_RESTARTS, &cases, restarted);
}
