//! The module's heat: the temperatures at the end of a capture, and a wait until the module has them again.
//!
//! A module under power warms up by some kelvins, as a first-order lag. From three means of equal distance the wait
//! knows where the lag ends, and so how long it still takes.

use std::collections::VecDeque;

use gnc_protocol::stream::ImuSample;

use crate::capture::Capture;

/// Time at the end of a capture, and of each look during a wait, whose median counts: the module changes by less than the
/// thermometers' resolution meanwhile.
const LOOK_S: f64 = 5.0;
/// Looks in a row that must be within the difference, so that one bad look does not end the wait.
const LOOKS: usize = 3;
/// Looks that a forecast uses: a minute on each side.
const FORECAST: usize = 24;
/// Temperature that a change must exceed for a forecast: the codes have a hundredth of a degree.
const CHANGES_K: f64 = 0.02;
/// Time before the end of the last capture over which its course is looked at, and the least change that shows a course: five
/// codes.
const COURSE_S: f64 = 300.0;
const COURSE_SHOWS_K: f64 = 0.05;
/// A module goes on by no more than this: its own heat.
const COURSE_K: f64 = 5.0;
/// Counts of a degree.
const PER_DEGREE: f64 = 100.0;

/// Temperatures of gyroscopes and accelerometers, degC.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Temperatures {
    /// Of the gyroscopes.
    pub gyro_c: f64,
    /// Of the accelerometers.
    pub accel_c: f64,
}

impl Temperatures {
    /// The medians of samples; `None` without a sample. A failed read moves no median.
    fn of<'s>(samples: impl Iterator<Item = (i16, i16)> + Clone + 's) -> Option<Self> {
        Some(Self { gyro_c: median(samples.clone().map(|pair| pair.0))?, accel_c: median(samples.map(|pair| pair.1))? })
    }

    /// The temperatures at the end of a capture; `None` for a capture without raw samples.
    fn at_end_of(capture: &Capture) -> Option<Self> {
        let samples = &capture.samples;
        Self::of(pairs(&samples[samples.len().saturating_sub(look_samples(capture))..]))
    }

    fn at_start_of(capture: &Capture) -> Option<Self> {
        let samples = &capture.samples;
        Self::of(pairs(&samples[..samples.len().min(look_samples(capture))]))
    }

    /// The mean of both, for people.
    #[must_use]
    pub fn mean_c(self) -> f64 {
        f64::midpoint(self.gyro_c, self.accel_c)
    }

    /// The larger of both differences.
    #[must_use]
    pub fn apart_k(self, other: Self) -> f64 {
        (self.gyro_c - other.gyro_c).abs().max((self.accel_c - other.accel_c).abs())
    }
}

fn look_samples(capture: &Capture) -> usize {
    (LOOK_S * f64::from(capture.about.rate_hz)).ceil().max(1.0) as usize
}

fn pairs(samples: &[ImuSample]) -> impl Iterator<Item = (i16, i16)> + Clone {
    samples.iter().map(|sample| (sample.gyro_temperature, sample.accel_temperature))
}

/// How warm a module was at the end of captures, and how it went on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeatLeft {
    /// At the end of the last capture.
    pub end: Temperatures,
    /// Its course then.
    pub kelvin_per_s: f64,
}

impl HeatLeft {
    /// What captures show, in the order in which they were made; `None` if none has a thermometer.
    #[must_use]
    pub fn by(captures: &[&Capture]) -> Option<Self> {
        let place = captures.iter().rposition(|capture| !capture.samples.is_empty())?;
        let last = captures[place];
        let end = Temperatures::at_end_of(last)?;
        let end_us = last.first_us.saturating_add(span_us(last));
        // Captures of another session with the board have other times.
        let near = |capture: &&&Capture| {
            capture.first_us <= last.first_us && end_us.saturating_sub(capture.first_us) as f64 * 1e-6 <= COURSE_S
        };
        let first = captures[..place].iter().rev().take_while(near).last().map_or(last, |first| *first);
        let span_s = end_us.saturating_sub(first.first_us) as f64 * 1e-6 - LOOK_S;
        let change_k = end.mean_c() - Temperatures::at_start_of(first)?.mean_c();
        let shows = span_s > LOOK_S && change_k.abs() >= COURSE_SHOWS_K;
        Some(Self { end, kelvin_per_s: if shows { change_k / span_s } else { 0.0 } })
    }

    /// How far the module would have gone on in this time, at most.
    fn course_k(&self, span_s: f64) -> f64 {
        (self.kelvin_per_s * span_s).clamp(-COURSE_K, COURSE_K)
    }
}

fn span_us(capture: &Capture) -> u64 {
    capture.samples.len() as u64 * 1_000_000 / u64::from(capture.about.rate_hz.max(1))
}

fn median(codes: impl Iterator<Item = i16>) -> Option<f64> {
    let mut codes: Vec<i16> = codes.collect();
    let middle = codes.len() / 2;
    (!codes.is_empty()).then(|| f64::from(*codes.select_nth_unstable(middle).1) / PER_DEGREE)
}

/// How a wait stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Warmth {
    /// The module now.
    pub now: Temperatures,
    /// The module at the end of the captures that are taken over.
    pub target: Temperatures,
    /// Board time that the wait still takes, by its course so far; `None` if that cannot be told.
    pub left_s: Option<f64>,
    /// Board time until the wait is given up.
    pub bound_s: f64,
    /// Board time of the wait so far.
    pub waited_s: f64,
}

/// Whether a wait goes on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Waiting {
    /// It goes on.
    On(Warmth),
    /// The module is as warm as it was.
    Done(Warmth),
    /// The time is over.
    GivenUp(Warmth),
}

/// A wait for the module's temperature, fed with all samples of one stream.
#[derive(Debug)]
pub struct HeatWait {
    target: Temperatures,
    /// Accepted differences from the target, below and above.
    within_k: (f64, f64),
    bound_s: f64,
    rate_hz: u16,
    look: Vec<(i16, i16)>,
    looks: VecDeque<Temperatures>,
    good: usize,
    samples: u64,
}

impl HeatWait {
    /// A wait for a temperature, to within a difference, for at most `bound_s` of board time. Temperatures that the module would
    /// have had in the `left_s` after the captures are good too.
    #[must_use]
    pub fn new(left: &HeatLeft, left_s: f64, within_k: f64, bound_s: f64, rate_hz: u16) -> Self {
        let course_k = left.course_k(left_s);
        Self {
            target: left.end,
            within_k: (course_k.min(0.0) - within_k, course_k.max(0.0) + within_k),
            bound_s,
            rate_hz: rate_hz.max(1),
            look: Vec::new(),
            looks: VecDeque::with_capacity(2 * FORECAST + 1),
            good: 0,
            samples: 0,
        }
    }

    /// Board time of the wait so far.
    #[must_use]
    pub fn waited_s(&self) -> f64 {
        self.samples as f64 / f64::from(self.rate_hz)
    }

    /// Takes samples. `None`: no look is complete.
    pub fn take(&mut self, samples: &[ImuSample]) -> Option<Waiting> {
        let mut waiting = None;
        for sample in samples {
            self.samples += 1;
            self.look.push((sample.gyro_temperature, sample.accel_temperature));
            if self.look.len() as f64 >= LOOK_S * f64::from(self.rate_hz) {
                waiting = self.looked().or(waiting);
                if !matches!(waiting, Some(Waiting::On(_))) {
                    break;
                }
            }
        }
        waiting
    }

    fn looked(&mut self) -> Option<Waiting> {
        let now = Temperatures::of(self.look.iter().copied())?;
        self.look.clear();
        if self.looks.len() > 2 * FORECAST {
            self.looks.pop_front();
        }
        self.looks.push_back(now);
        self.good = if self.is_good(now) { self.good + 1 } else { 0 };
        let waited_s = self.waited_s();
        let bound_s = (self.bound_s - waited_s).max(0.0);
        let warmth = Warmth { now, target: self.target, left_s: self.left_s(), bound_s, waited_s };
        Some(if self.good >= LOOKS || self.passed_through() {
            Waiting::Done(warmth)
        } else if bound_s == 0.0 && self.good == 0 {
            // A module that has just arrived gets its last looks.
            Waiting::GivenUp(warmth)
        } else {
            Waiting::On(warmth)
        })
    }

    fn is_good(&self, now: Temperatures) -> bool {
        let good = |now_c: f64, was_c: f64| (self.within_k.0..=self.within_k.1).contains(&(now_c - was_c));
        good(now.gyro_c, self.target.gyro_c) && good(now.accel_c, self.target.accel_c)
    }

    /// Whether a look is good for an end of the wait.
    #[must_use]
    pub fn is_there(&self) -> bool {
        self.good > 0
    }

    /// Whether the module went through the temperature that it had. It was on its way then, and it is now.
    fn passed_through(&self) -> bool {
        let mut newest = self.looks.iter().rev().map(|look| look.mean_c() > self.target.mean_c());
        match (newest.next(), newest.next(), newest.next()) {
            (Some(last), Some(before), Some(first)) => last == before && before != first,
            _ => false,
        }
    }

    /// Time until a first-order lag through the looks arrives.
    fn left_s(&self) -> Option<f64> {
        let step = (self.looks.len().checked_sub(1)? / 2).min(FORECAST);
        let last = self.looks.len() - 1;
        let at = |back: usize| self.looks.get(last - back * step).map(|look| look.mean_c());
        let (early, middle, late) = (at(2)?, at(1)?, at(0)?);
        let (first, second) = (middle - early, late - middle);
        let toward = self.target.mean_c() - late;
        if self.good > 0 {
            return Some(LOOKS as f64 * LOOK_S);
        }
        let part = second / first;
        if step == 0 || second.abs() < CHANGES_K || second * toward <= 0.0 || !(part > 0.0 && part < 1.0) {
            return None;
        }
        // Where the lag ends, and which part of the way to there is left when the module arrives.
        let end = late + second * part / (1.0 - part);
        let arrives = self.target.mean_c() + if toward > 0.0 { self.within_k.0 } else { self.within_k.1 };
        let left = (end - arrives) / (end - late);
        (left > 0.0).then(|| left.ln() / part.ln() * step as f64 * LOOK_S)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::{CaptureHead, Pose, ReceiverCapture, Timing};
    use gnc_protocol::stream::Losses;

    const RATE_HZ: u16 = 10;

    fn sample(temperature_c: f64) -> ImuSample {
        let code = (temperature_c * 100.0).round() as i16;
        ImuSample { gyro_temperature: code + 60, accel_temperature: code + 40, ..ImuSample::default() }
    }

    fn at(temperature_c: f64) -> Temperatures {
        Temperatures { gyro_c: temperature_c + 0.6, accel_c: temperature_c + 0.4 }
    }

    /// A module that comes from 23 degC and goes to `end_c` with a time constant of 180 s.
    fn wait(target_c: f64, end_c: f64, bound_s: f64) -> (Vec<Warmth>, Waiting) {
        let left = HeatLeft { end: at(target_c), kelvin_per_s: 0.0 };
        let mut wait = HeatWait::new(&left, 600.0, 0.2, bound_s, RATE_HZ);
        let mut told = Vec::new();
        for index in 0..200_000 {
            let now_s = f64::from(index) / f64::from(RATE_HZ);
            match wait.take(&[sample(end_c + (23.0 - end_c) * (-now_s / 180.0).exp())]) {
                Some(Waiting::On(warmth)) => told.push(warmth),
                Some(over) => return (told, over),
                None => {}
            }
        }
        panic!("the wait has no end")
    }

    /// 4.8 of 5 kelvins are there after 180 s ln 25.
    #[test]
    fn a_cold_module_is_waited_for_as_long_as_it_takes() {
        let (told, over) = wait(28.0, 28.0, 1800.0);
        let arrives_s = 180.0 * 25.0_f64.ln();
        // Three looks of 5 s, half a look that a median is late, and half a hundredth of a degree.
        assert!(matches!(over, Waiting::Done(warmth) if (warmth.waited_s - arrives_s).abs() < 25.0), "{over:?}");
        // The forecast is right to a sixth from two minutes on, and a bound is told beside it.
        for warmth in told.iter().filter(|warmth| (120.0..450.0).contains(&warmth.waited_s)) {
            let left_s = warmth.left_s.unwrap_or_else(|| panic!("{warmth:?}"));
            let truth_s = arrives_s - warmth.waited_s;
            assert!((left_s - truth_s).abs() < 20.0 + truth_s / 6.0, "{left_s} instead of {truth_s}: {warmth:?}");
            assert!((warmth.bound_s + warmth.waited_s - 1800.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_module_that_does_not_get_there_is_given_up() {
        // The room is two kelvins colder.
        let (told, over) = wait(28.0, 26.0, 1800.0);
        assert!(
            matches!(over, Waiting::GivenUp(warmth) if warmth.waited_s == 1800.0 && warmth.now.mean_c() < 26.6),
            "{over:?}"
        );
        assert!(told.iter().skip(48).all(|warmth| warmth.left_s.is_none()), "no forecast arrives");
        // It is too warm from the start.
        let (_, over) = wait(22.0, 28.0, 60.0);
        assert!(matches!(over, Waiting::GivenUp(warmth) if warmth.waited_s == 60.0), "{over:?}");
        // No wait is allowed: a look is.
        let (_, over) = wait(28.0, 28.0, 0.0);
        assert!(matches!(over, Waiting::GivenUp(warmth) if warmth.waited_s == 5.0), "{over:?}");
        let (_, over) = wait(23.1, 23.0, 0.0);
        assert!(matches!(over, Waiting::Done(_)), "{over:?}");
    }

    /// An earlier run that was interrupted early was on its way, and so is the module.
    #[test]
    fn a_module_that_passes_through_is_as_warm_as_it_was() {
        for target_c in [23.5, 24.0, 25.0, 27.0] {
            let (_, over) = wait(target_c, 28.0, 1800.0);
            // The module moves by 0.14 K in a look at first, and half of the looks are behind it.
            let near = |warmth: Warmth| (-0.2..0.3).contains(&(warmth.now.mean_c() - at(target_c).mean_c()));
            assert!(matches!(over, Waiting::Done(warmth) if near(warmth)), "{target_c}: {over:?}");
        }
        // It is on the other side from the start, and does not come through.
        let (_, over) = wait(22.0, 28.0, 600.0);
        assert!(matches!(over, Waiting::GivenUp(_)), "{over:?}");
    }

    /// Four of ten reads fail.
    #[test]
    fn failed_reads_do_not_end_a_wait() {
        let left = HeatLeft { end: at(28.0), kelvin_per_s: 0.0 };
        let mut wait = HeatWait::new(&left, 600.0, 0.2, 60.0, RATE_HZ);
        let failed = |code| ImuSample { gyro_temperature: code, accel_temperature: code, ..ImuSample::default() };
        let read = |index: i32| match (index % 5, index % 2) {
            (0 | 1, 0) => failed(2850),
            (0 | 1, _) => failed(-1),
            _ => sample(24.0),
        };
        let samples: Vec<_> = (0..600).map(read).collect();
        assert!(matches!(wait.take(&samples), Some(Waiting::GivenUp(_))));
    }

    /// A capture from this board time on, of temperatures from one to another.
    fn capture(first_s: f64, from_c: f64, to_c: f64, span_s: f64) -> Capture {
        let about = CaptureHead {
            label: "z+".into(),
            series: 1,
            pose: Pose::Still { up: [0.0, 0.0, 1.0], heading_deg: 0.0 },
            rate_hz: RATE_HZ,
        };
        let count = (span_s * f64::from(RATE_HZ)) as u32;
        let part = |index: u32| f64::from(index) / f64::from(count);
        Capture {
            about,
            first_us: (first_s * 1e6) as u64,
            samples: (0..count).map(|index| sample(from_c + (to_c - from_c) * part(index))).collect(),
            compensated: Vec::new(),
            losses: Losses::default(),
            receiver: ReceiverCapture::default(),
            timing: Timing::new(RATE_HZ),
        }
    }

    #[track_caller]
    fn check_left(captures: &[Capture], end_c: f64, kelvin_per_s: f64) {
        let left = HeatLeft::by(&captures.iter().collect::<Vec<_>>()).expect("a thermometer");
        // Half of a look lies before the end, and a code is a hundredth.
        assert!(left.end.apart_k(at(end_c - 2.5 * kelvin_per_s)) < 0.02, "{left:?}");
        assert!((left.kelvin_per_s - kelvin_per_s).abs() <= 0.05 * kelvin_per_s.abs(), "{left:?}");
    }

    #[test]
    fn captures_show_how_warm_the_module_was_and_where_it_went() {
        check_left(&[capture(100.0, 25.0, 25.0, 60.0)], 25.0, 0.0);
        check_left(&[capture(100.0, 25.0, 26.0, 100.0)], 26.0, 0.01);
        // Short captures with pauses between them.
        let short =
            [capture(10.0, 25.0, 25.1, 10.0), capture(60.0, 25.5, 25.6, 10.0), capture(110.0, 26.0, 26.1, 10.0)];
        check_left(&short, 26.1, 0.01);
        // One that is long ago, and one of another session with the board, show no course.
        check_left(&[capture(10.0, 20.0, 20.0, 10.0), capture(600.0, 25.0, 25.0, 60.0)], 25.0, 0.0);
        check_left(&[capture(9000.0, 20.0, 20.0, 10.0), capture(100.0, 25.0, 25.0, 60.0)], 25.0, 0.0);
        // A receiver has no thermometer.
        let mut receiver = capture(200.0, 0.0, 0.0, 10.0);
        receiver.samples.clear();
        check_left(&[capture(100.0, 25.0, 26.0, 100.0), receiver.clone()], 26.0, 0.01);
        assert_eq!(HeatLeft::by(&[&receiver]), None);
    }

    /// The captures ended at 25 degC and went up by 1 K in 100 s: for 150 s more, 26.5 degC are on their way.
    #[test]
    fn a_module_that_went_on_meanwhile_is_not_too_warm() {
        let look = |left: &HeatLeft, now_c: f64| {
            let mut wait = HeatWait::new(left, 150.0, 0.2, 60.0, RATE_HZ);
            matches!(wait.take(&vec![sample(now_c); 600]), Some(Waiting::Done(_)))
        };
        let up = HeatLeft { end: at(25.0), kelvin_per_s: 0.01 };
        assert_eq!([24.7, 24.9, 26.0, 26.6, 26.8].map(|now_c| look(&up, now_c)), [false, true, true, true, false]);
        let down = HeatLeft { kelvin_per_s: -0.01, ..up };
        assert_eq!([23.2, 23.4, 24.5, 25.1, 25.3].map(|now_c| look(&down, now_c)), [false, true, true, true, false]);
        let still = HeatLeft { kelvin_per_s: 0.0, ..up };
        assert_eq!([24.7, 24.9, 25.1, 25.3].map(|now_c| look(&still, now_c)), [false, true, true, false]);
    }
}
