//! Breaches inside the board: its clock and power, the values it measures, the streams it makes.

use std::time::Duration;

use gnc_protocol::message::{AdReadReply, CpuWordsReply, PowerReply, StreamStopReply, TimerMeasureReply};
use gnc_protocol::stream::{ImuSample, StreamFrame};

/// What a restart and the clock do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct RestartBreaches {
    /// A restart draws no new boot id.
    pub(crate) keeps_boot_id: bool,
    /// Board time goes on over a restart.
    pub(crate) clock_runs_on: bool,
    /// At this board time of each start the clock goes back by that much.
    pub(crate) clock_back: Option<(Duration, Duration)>,
}

impl RestartBreaches {
    /// What the clock shows this long after it began.
    pub(crate) fn shown_ns(&self, since_ns: u64) -> u64 {
        let nanoseconds = |span: Duration| u64::try_from(span.as_nanos()).unwrap_or(u64::MAX);
        match self.clock_back {
            Some((at, by)) if since_ns >= nanoseconds(at) => since_ns.saturating_sub(nanoseconds(by)),
            _ => since_ns,
        }
    }
}

/// What the heartbeat says of the board, and what the supply does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct StateBreaches {
    /// Bits that the heartbeat always has, and those that it never has.
    pub(crate) bits_set: u8,
    pub(crate) bits_cleared: u8,
    /// The safe state leaves the supply on.
    pub(crate) safe_keeps_power: bool,
    /// The supply goes off by itself so long after it came on.
    pub(crate) powers_off_after: Option<Duration>,
    /// Each power-on ends with too much current.
    pub(crate) over_current_at_power_on: bool,
}

/// The order and the numbers of AD channels in a RESULT.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum AdOrder {
    Falling,
    FromZero,
}

/// What the board says that it measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct ValueBreaches {
    /// Factors of what was measured.
    pub(crate) supply_uv_times: Option<f64>,
    pub(crate) supply_ua_times: Option<f64>,
    pub(crate) timer_intervals_times: Option<f64>,
    pub(crate) flash_durations_times: Option<f64>,
    pub(crate) pps_times: Option<f64>,
    /// Raw codes are so many bits too high.
    pub(crate) imu_shift_bits: u32,
    pub(crate) ad_channels: Option<AdOrder>,
    /// Words in the answer of a core beyond those asked for.
    pub(crate) extra_words: u32,
}

/// A number of a field of 32 bits, multiplied; the cast ends at the largest number.
fn times(value: u32, factor: Option<f64>) -> u32 {
    factor.map_or(value, |factor| (f64::from(value) * factor) as u32)
}

impl ValueBreaches {
    pub(crate) fn supply(&self, reply: &PowerReply) -> PowerReply {
        PowerReply {
            supply_uv: times(reply.supply_uv, self.supply_uv_times),
            supply_ua: times(reply.supply_ua, self.supply_ua_times),
        }
    }

    pub(crate) fn timers(&self, mut reply: TimerMeasureReply) -> TimerMeasureReply {
        for interval_ns in &mut reply.intervals_ns {
            *interval_ns = times(*interval_ns, self.timer_intervals_times);
        }
        reply
    }

    pub(crate) fn flash_us(&self, duration_us: u32) -> u32 {
        times(duration_us, self.flash_durations_times)
    }

    pub(crate) fn words(&self, mut reply: CpuWordsReply) -> CpuWordsReply {
        for _ in 0..self.extra_words {
            // A full list takes no more.
            let _ = reply.words.push(0);
        }
        reply
    }

    pub(crate) fn channels(&self, mut reply: AdReadReply) -> AdReadReply {
        match self.ad_channels {
            Some(AdOrder::Falling) => reply.channels.reverse(),
            Some(AdOrder::FromZero) => reply.channels.iter_mut().for_each(|read| read.channel -= 1),
            None => {}
        }
        reply
    }

    pub(crate) fn capture_ns(&self, board_time_ns: u64) -> u64 {
        self.pps_times.map_or(board_time_ns, |factor| (board_time_ns as f64 * factor) as u64)
    }

    pub(crate) fn sample(&self, mut sample: ImuSample) -> ImuSample {
        let shift = |codes: &mut [i32; 3]| codes.iter_mut().for_each(|code| *code <<= self.imu_shift_bits);
        shift(&mut sample.gyro);
        shift(&mut sample.accel);
        shift(&mut sample.mag);
        sample
    }
}

/// The last of so many samples that are copies of the one before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Repeats {
    pub(crate) samples: u32,
    pub(crate) of: u32,
}

impl Repeats {
    /// Whether the sample of this number is a copy.
    pub(crate) fn hits(self, number: u32) -> bool {
        number % self.of >= self.of - self.samples
    }
}

/// What the streams do.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct StreamBreaches {
    /// Number of the first sample.
    pub(crate) numbers_from: u32,
    /// Error of `produced` in the account.
    pub(crate) produced_off: i32,
    /// One of so many frames never leaves, and is not counted.
    pub(crate) drops_frame_every: u32,
    /// Factor of the time in frames.
    pub(crate) time_times: Option<f64>,
    /// A stream that was stopped goes on.
    pub(crate) go_on: bool,
    /// The first samples leave before the RESULT.
    pub(crate) before_result: bool,
    /// Samples in a frame on RS-422, whatever was asked for; 0: those.
    pub(crate) samples_a_frame: u8,
    /// Samples beyond the count that was asked for.
    pub(crate) extra_samples: u32,
    pub(crate) repeats: Option<Repeats>,
}

impl StreamBreaches {
    /// Numbers and times a frame.
    pub(crate) fn number(&self, frame: &mut StreamFrame) {
        frame.head.first = frame.head.first.wrapping_add(self.numbers_from);
        if let Some(factor) = self.time_times {
            frame.head.board_time_us = (frame.head.board_time_us as f64 * factor) as u64;
        }
    }

    pub(crate) fn account(&self, reply: &StreamStopReply) -> StreamStopReply {
        StreamStopReply { produced: reply.produced.wrapping_add_signed(self.produced_off), dropped: reply.dropped }
    }
}
