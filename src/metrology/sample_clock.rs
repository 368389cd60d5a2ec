//! The clock of a capture: whether the times of its samples lie on the grid of the rate that was asked for.
//!
//! Some samples of a capture carry a time, truncated to a whole microsecond. The time of sample `n` less `n / rate` is
//! then the same for all of them to within a microsecond. A larger difference does not come from the resolution: the
//! samples come at another rate, or the clock jumped.

use thiserror::Error;

/// Resolution of the times: they are truncated to a microsecond.
const RESOLUTION_NS: i128 = 1000;
/// Largest step that may come from the resolution of two times.
const STEP_NS: i128 = 3 * RESOLUTION_NS;
/// Least number of times that separates one step from a rate that is wrong all the time.
const FEWEST_FOR_A_STEP: u32 = 4;

/// A sample and its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Stamp {
    number: u32,
    time_ns: u64,
}

/// The times of the samples of one capture, reduced to the few numbers that a check needs, however long the capture is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SampleClock {
    rate_hz: u16,
    stamps: u32,
    first: Stamp,
    last: Stamp,
    /// Least and greatest departure from the grid of the first time, in ns times `rate_hz`.
    least: i128,
    most: i128,
    before: i128,
    /// The last time that is not on the grid of the time before it, and its departure; at first the first time. Times
    /// that follow from a frame's own time are computed and do not show the rate.
    told: (Stamp, i128),
    /// The largest change of the departure from one time to the next, in the same unit, and the sample behind it.
    step: (i128, Stamp),
    /// The first time that does not lie after the time before it: the time before, and the sample.
    back: Option<(u64, Stamp)>,
}

/// The rate of a capture from the times of its samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleRate {
    /// Samples a second between the first and the last time.
    pub rate_hz: f64,
    /// Error of the rate, relative to the rate that was asked for, in parts per million.
    pub error_ppm: f64,
    /// Bound of the part of `error_ppm` that the resolution of the two times can cause, either way.
    pub bound_ppm: f64,
    /// Seconds between the first and the last time.
    pub span_s: f64,
}

/// What is wrong with the times of a capture.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum ClockFault {
    /// The samples came at another rate.
    #[error(
        "by the board's own time the samples came at {seen_hz:.4} Hz where {asked_hz} Hz were asked for: {error_ppm:+.1} ppm \
         (+-{bound_ppm:.1}), {off_us:.0} us in {span_s:.3} s, and {allowed_us} us may be"
    )]
    Rate {
        /// Samples a second that were asked for.
        asked_hz: u16,
        /// Samples a second between the first and the last time.
        seen_hz: f64,
        /// Relative difference.
        error_ppm: f64,
        /// Bound of the part of it that the resolution of the times can cause, either way.
        bound_ppm: f64,
        /// Seconds between the first and the last time.
        span_s: f64,
        /// How far the times leave the grid, in microseconds.
        off_us: f64,
        /// How far they may leave it, in microseconds.
        allowed_us: u32,
    },
    /// The time jumped between two samples.
    #[error(
        "the board's time jumps by {step_us:+.0} us before sample {number} ({at_s:.3} s): from first to last the samples came \
         at {seen_hz:.4} Hz where {asked_hz} Hz were asked for"
    )]
    Jump {
        /// The sample behind the jump.
        number: u32,
        /// Time of the sample in the capture, by the rate that was asked for.
        at_s: f64,
        /// The jump, less the time that should have passed.
        step_us: f64,
        /// Samples a second that were asked for.
        asked_hz: u16,
        /// Samples a second between the first and the last time.
        seen_hz: f64,
    },
    /// The time went back or stood still.
    #[error("the board's time goes back at sample {number}: {before_us} us, then {after_us} us")]
    Back {
        /// The sample with the earlier time.
        number: u32,
        /// The time of the sample before, in microseconds.
        before_us: u64,
        /// The time of the sample itself, in microseconds.
        after_us: u64,
    },
    /// The rate is unknown.
    #[error("{stamps} of the {samples} samples tell their board time: the rate of the samples cannot be checked")]
    Untimed {
        /// Samples that carry a time.
        stamps: u32,
        /// All samples.
        samples: u32,
    },
}

impl ClockFault {
    /// Returns what the operator can try.
    #[must_use]
    pub fn hint(&self) -> &'static str {
        match self {
            Self::Rate { .. } | Self::Jump { .. } => {
                "the slave board does not follow section 10 of the interface document: its samples must lie on the grid of its \
                 own clock; the board must resample a sensor that has its own oscillator"
            }
            Self::Back { .. } => {
                "the slave board does not follow section 10 of the interface document: check its supply and its firmware"
            }
            Self::Untimed { .. } => "capture longer: on CAN only every 64th sample carries its time",
        }
    }
}

impl SampleClock {
    /// A clock without a time, for a capture of this rate. A rate of 0 counts as 1.
    #[must_use]
    pub fn new(rate_hz: u16) -> Self {
        let none = Stamp { number: 0, time_ns: 0 };
        Self {
            rate_hz: rate_hz.max(1),
            stamps: 0,
            first: none,
            last: none,
            least: 0,
            most: 0,
            before: 0,
            told: (none, 0),
            step: (0, none),
            back: None,
        }
    }

    /// A clock of `samples` samples that all lie on the grid.
    #[must_use]
    pub fn even(rate_hz: u16, first_us: u64, samples: usize) -> Self {
        let mut clock = Self::new(rate_hz);
        clock.frame(0, first_us, samples);
        clock
    }

    /// Takes a frame: the time of its first sample, and the samples behind it on the grid, each truncated to a
    /// microsecond.
    pub fn frame(&mut self, first: u32, board_time_us: u64, samples: usize) {
        for (index, number) in (0..samples as u64).zip(first..=u32::MAX) {
            let after_us = index * 1_000_000 / u64::from(self.rate_hz);
            self.stamp(number, board_time_us.saturating_add(after_us).saturating_mul(1000));
        }
    }

    /// Takes the time of a sample. Numbers must rise; a sample whose number does not rise is skipped.
    pub fn stamp(&mut self, number: u32, time_ns: u64) {
        let stamp = Stamp { number, time_ns };
        if self.stamps == 0 {
            (self.first, self.last, self.told) = (stamp, stamp, (stamp, 0));
        } else if number <= self.last.number {
            return;
        }
        let departure = self.departure(&stamp);
        let step = departure - self.before;
        if step.abs() > self.step.0.abs() {
            self.step = (step, stamp);
        }
        // The comparison is not with the last time. That may be computed, and with a clock that runs fast it lies ahead
        // of the next frame.
        if self.stamps > 0 && time_ns <= self.told.0.time_ns {
            self.back.get_or_insert((self.last.time_ns, stamp));
        }
        if step.abs() > RESOLUTION_NS * i128::from(self.allowed_us()) * i128::from(self.rate_hz) {
            self.told = (stamp, departure);
        }
        (self.least, self.most) = (self.least.min(departure), self.most.max(departure));
        (self.before, self.last) = (departure, stamp);
        self.stamps = self.stamps.saturating_add(1);
    }

    /// Seconds between the first and the last time.
    #[must_use]
    pub fn span_s(&self) -> f64 {
        (i128::from(self.last.time_ns) - i128::from(self.first.time_ns)) as f64 * 1e-9
    }

    /// Returns the rate from the first to the last time; `None` unless two samples have a time and the time rose
    /// between them.
    #[must_use]
    pub fn rate(&self) -> Option<SampleRate> {
        // Where the clock keeps the grid, all of its times show the rate.
        let (last, departure) = if self.told.0 == self.first { (self.last, self.before) } else { self.told };
        let span_s = (i128::from(last.time_ns) - i128::from(self.first.time_ns)) as f64 * 1e-9;
        if span_s <= 0.0 {
            return None;
        }
        // The error follows from the departure, whose digits are exact, and not from the quotient of two large numbers.
        let asked_s = f64::from(last.number - self.first.number) / f64::from(self.rate_hz);
        let off_s = departure as f64 / f64::from(self.rate_hz) * 1e-9;
        let error = -off_s / (asked_s + off_s);
        Some(SampleRate {
            rate_hz: f64::from(self.rate_hz) * (1.0 + error),
            error_ppm: error * 1e6,
            bound_ppm: 1e-6 * f64::from(self.allowed_us()) / span_s * 1e6,
            span_s,
        })
    }

    /// Checks whether the times are those of the rate that was asked for. `samples` is the number of samples in the
    /// capture.
    ///
    /// # Errors
    /// [`ClockFault`].
    pub fn check(&self, samples: usize) -> Result<SampleRate, ClockFault> {
        if let Some((before_ns, stamp)) = self.back {
            return Err(ClockFault::Back {
                number: stamp.number,
                before_us: before_ns / 1000,
                after_us: stamp.time_ns / 1000,
            });
        }
        let Some(rate) = self.rate() else {
            let samples = u32::try_from(samples).unwrap_or(u32::MAX);
            return Err(ClockFault::Untimed { stamps: self.stamps, samples });
        };
        let asked = i128::from(self.rate_hz);
        let off = self.most - self.least;
        if off <= RESOLUTION_NS * i128::from(self.allowed_us()) * asked {
            return Ok(rate);
        }
        let us = |departure: i128| departure as f64 / f64::from(self.rate_hz) * 1e-3;
        let (step, stamp) = self.step;
        let is_step = step.abs() > STEP_NS * asked && 2 * step.abs() > off && self.stamps >= FEWEST_FOR_A_STEP;
        Err(if is_step {
            ClockFault::Jump {
                number: stamp.number,
                at_s: f64::from(stamp.number - self.first.number) / f64::from(self.rate_hz),
                step_us: us(step),
                asked_hz: self.rate_hz,
                seen_hz: rate.rate_hz,
            }
        } else {
            ClockFault::Rate {
                asked_hz: self.rate_hz,
                seen_hz: rate.rate_hz,
                error_ppm: rate.error_ppm,
                bound_ppm: rate.bound_ppm,
                span_s: rate.span_s,
                off_us: us(off),
                allowed_us: self.allowed_us(),
            }
        })
    }

    /// One microsecond. Where the period is not a whole number of microseconds, the times of samples between two that
    /// carry one are computed and truncated to a microsecond once more.
    fn allowed_us(&self) -> u32 {
        if 1_000_000 % u32::from(self.rate_hz) == 0 { 1 } else { 2 }
    }

    /// Departure of a time from the grid of the first time, in ns times `rate_hz`: whole numbers, so exact.
    fn departure(&self, stamp: &Stamp) -> i128 {
        let passed_ns = i128::from(stamp.time_ns) - i128::from(self.first.time_ns);
        passed_ns * i128::from(self.rate_hz) - i128::from(stamp.number - self.first.number) * 1_000_000_000
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::panic, reason = "a test may end with a panic")]
mod tests {
    use super::*;

    /// Times of every `every`-th sample, truncated to a microsecond: `s + n / rate`, with the rate off by `error_ppm`.
    fn board(rate_hz: u16, error_ppm: f64, samples: u32, every: u32, start_us: f64) -> SampleClock {
        let mut clock = SampleClock::new(rate_hz);
        let period_us = 1e6 / (f64::from(rate_hz) * (1.0 + error_ppm * 1e-6));
        for number in (0..samples).step_by(every as usize) {
            let time_us = (start_us + f64::from(number) * period_us).floor();
            clock.stamp(number, time_us as u64 * 1000);
        }
        clock
    }

    /// A frame of 10 samples at 200 Hz, of 12 at 1 kHz; every 64th sample on CAN; rates whose period is no whole number
    /// of microseconds; a start between two microseconds.
    #[test]
    fn a_board_that_keeps_its_rate_is_never_refused() {
        for rate_hz in [1, 7, 60, 100, 128, 200, 300, 333, 480, 999, 1000] {
            for every in [1, 3, 10, 12, 64] {
                for start_us in [0.0, 0.25, 0.999, 123_456_789.5] {
                    let clock = board(rate_hz, 0.0, 5000, every, start_us);
                    let rate = clock.check(5000).unwrap_or_else(|fault| panic!("{rate_hz} Hz, {every}: {fault}"));
                    assert!(rate.error_ppm.abs() <= rate.bound_ppm, "{rate_hz} Hz: {rate:?}");
                }
            }
        }
    }

    /// The captures of the plans: 400 samples at 200 Hz, a turn of 16 s at 1 kHz, 300 s at 200 Hz.
    #[test]
    fn thirty_ppm_to_five_per_cent_are_always_seen() {
        for (rate_hz, samples) in [(200, 400), (1000, 16_000), (200, 60_000)] {
            for every in [10, 64] {
                for error_ppm in [30.0, -30.0, 100.0, -5000.0, 5000.0, 50_000.0, -50_000.0] {
                    let clock = board(rate_hz, error_ppm, samples, every, 0.7);
                    let Err(ClockFault::Rate { seen_hz, error_ppm: seen_ppm, asked_hz, .. }) =
                        clock.check(samples as usize)
                    else {
                        panic!("{error_ppm} ppm at {rate_hz} Hz: {:?}", clock.check(samples as usize))
                    };
                    let bound_ppm = clock.rate().unwrap().bound_ppm;
                    assert_eq!(asked_hz, rate_hz);
                    assert!((seen_ppm - error_ppm).abs() <= bound_ppm, "{seen_ppm} for {error_ppm}");
                    assert!((seen_hz / f64::from(rate_hz) * 1e6 - 1e6 - error_ppm).abs() <= bound_ppm);
                }
            }
        }
    }

    /// The text names both rates; the figures are those of the report of a stream of 995 samples a second.
    #[test]
    fn the_fault_names_both_rates() {
        let fault = board(1000, -5000.0, 10_001, 10, 0.0).check(10_001).unwrap_err();
        let text = "by the board's own time the samples came at 995.0000 Hz where 1000 Hz were asked for: -5000.0 ppm \
                    (+-0.1), 50251 us in 10.050 s, and 1 us may be";
        assert_eq!(fault.to_string(), text);
    }

    /// As in a file: each sample of a frame has a time, computed from that of the frame. The last times do not show the
    /// rate.
    #[test]
    fn times_within_a_frame_do_not_water_the_rate_down() {
        let mut clock = SampleClock::new(1000);
        for frame in 0..10_u32 {
            // 995 samples a second in frames of 100.
            clock.frame(frame * 100, u64::from(frame) * 100_503, 100);
        }
        let rate = clock.rate().unwrap();
        assert!((rate.error_ppm + 5000.0).abs() < 10.0, "{rate:?}");
        assert!(matches!(clock.check(1000), Err(ClockFault::Rate { .. })), "{:?}", clock.check(1000));
        // 5 % fast over CAN: the last time that is computed lies ahead of the next time that is read, and no time went
        // back.
        let mut clock = SampleClock::new(1000);
        for frame in 0..20_u32 {
            clock.frame(frame * 64, u64::from(frame) * 60_952, 64);
        }
        assert!(matches!(clock.check(1280), Err(ClockFault::Rate { .. })), "{:?}", clock.check(1280));
    }

    #[test]
    fn a_jump_in_the_middle_is_seen_though_the_ends_agree() {
        let mut clock = SampleClock::new(200);
        for number in (0..400_u32).step_by(10) {
            let late_us = if (100..150).contains(&number) { 40 } else { 0 };
            clock.stamp(number, (u64::from(number) * 5000 + 1000 + late_us) * 1000);
        }
        assert_eq!(
            clock.check(400),
            Err(ClockFault::Jump { number: 100, at_s: 0.5, step_us: 40.0, asked_hz: 200, seen_hz: 200.0 })
        );
    }

    #[test]
    fn time_that_goes_back_is_seen() {
        let mut clock = SampleClock::new(200);
        for (number, time_us) in [(0, 7_000_000_u64), (10, 7_050_000), (20, 100_000), (30, 150_000)] {
            clock.stamp(number, time_us * 1000);
        }
        let back = ClockFault::Back { number: 20, before_us: 7_050_000, after_us: 100_000 };
        assert_eq!(clock.check(40), Err(back));
    }

    #[test]
    fn one_time_tells_no_rate() {
        let mut clock = SampleClock::new(1000);
        assert_eq!(clock.check(0), Err(ClockFault::Untimed { stamps: 0, samples: 0 }));
        clock.stamp(0, 5000);
        assert_eq!(clock.check(50), Err(ClockFault::Untimed { stamps: 1, samples: 50 }));
        assert!(SampleClock::even(1000, 5, 50).check(50).is_ok());
    }

    /// A file may hold any numbers.
    #[test]
    fn no_number_overflows() {
        let mut clock = SampleClock::new(u16::MAX);
        clock.stamp(0, u64::MAX);
        clock.stamp(u32::MAX, 0);
        assert!(matches!(clock.check(2), Err(ClockFault::Back { .. })));
        let mut clock = SampleClock::new(0);
        clock.stamp(0, 0);
        clock.stamp(1, u64::MAX);
        assert!(matches!(clock.check(2), Err(ClockFault::Rate { .. })));
    }
}
