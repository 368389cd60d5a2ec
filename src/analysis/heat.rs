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

    /// The temperatures at the end of a capture; `None` for a capture without a thermometer.
    #[must_use]
    pub fn at_end_of(capture: &Capture) -> Option<Self> {
        let count = (LOOK_S * f64::from(capture.about.rate_hz)).ceil().max(1.0) as usize;
        let last = |len: usize| len.saturating_sub(count);
        let (raw, done) = (&capture.samples, &capture.compensated);
        if raw.is_empty() {
            let samples = done[last(done.len())..].iter();
            return Self::of(samples.map(|sample| (sample.gyro_temperature, sample.accel_temperature)));
        }
        let samples = raw[last(raw.len())..].iter();
        Self::of(samples.map(|sample| (sample.gyro_temperature, sample.accel_temperature)))
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
    within_k: f64,
    bound_s: f64,
    rate_hz: u16,
    look: Vec<(i16, i16)>,
    looks: VecDeque<Temperatures>,
    good: usize,
    samples: u64,
}

impl HeatWait {
    /// A wait for a temperature, to within a difference, for at most `bound_s` of board time.
    #[must_use]
    pub fn new(target: Temperatures, within_k: f64, bound_s: f64, rate_hz: u16) -> Self {
        Self {
            target,
            within_k,
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
        self.good = if now.apart_k(self.target) <= self.within_k { self.good + 1 } else { 0 };
        let waited_s = self.waited_s();
        let bound_s = (self.bound_s - waited_s).max(0.0);
        let warmth = Warmth { now, target: self.target, left_s: self.left_s(), bound_s, waited_s };
        Some(if self.good >= LOOKS {
            Waiting::Done(warmth)
        } else if bound_s == 0.0 && self.good == 0 {
            // A module that has just arrived gets its last looks.
            Waiting::GivenUp(warmth)
        } else {
            Waiting::On(warmth)
        })
    }

    /// Time until a first-order lag through the looks arrives.
    fn left_s(&self) -> Option<f64> {
        let step = (self.looks.len().checked_sub(1)? / 2).min(FORECAST);
        let last = self.looks.len() - 1;
        let at = |back: usize| self.looks.get(last - back * step).map(|look| look.mean_c());
        let (early, middle, late) = (at(2)?, at(1)?, at(0)?);
        let (first, second) = (middle - early, late - middle);
        let toward = self.target.mean_c() - late;
        if toward.abs() <= self.within_k {
            return Some(LOOKS as f64 * LOOK_S);
        }
        let part = second / first;
        if step == 0 || second.abs() < CHANGES_K || second * toward <= 0.0 || !(part > 0.0 && part < 1.0) {
            return None;
        }
        // Where the lag ends, and which part of the way to there is left when the module arrives.
        let end = late + second * part / (1.0 - part);
        let arrives = self.target.mean_c() - self.within_k.copysign(toward);
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
        let mut wait = HeatWait::new(at(target_c), 0.2, bound_s, RATE_HZ);
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
        // It passes through a temperature on its way to a higher one.
        let (_, over) = wait(25.0, 28.0, 1800.0);
        assert!(matches!(over, Waiting::Done(warmth) if warmth.now.apart_k(at(25.0)) <= 0.2), "{over:?}");
        // It is too warm from the start.
        let (_, over) = wait(22.0, 28.0, 60.0);
        assert!(matches!(over, Waiting::GivenUp(warmth) if warmth.waited_s == 60.0), "{over:?}");
        // No wait is allowed: a look is.
        let (_, over) = wait(28.0, 28.0, 0.0);
        assert!(matches!(over, Waiting::GivenUp(warmth) if warmth.waited_s == 5.0), "{over:?}");
        let (_, over) = wait(23.1, 23.0, 0.0);
        assert!(matches!(over, Waiting::Done(_)), "{over:?}");
    }

    /// Four of ten reads fail.
    #[test]
    fn failed_reads_do_not_end_a_wait() {
        let mut wait = HeatWait::new(at(28.0), 0.2, 60.0, RATE_HZ);
        let failed = |code| ImuSample { gyro_temperature: code, accel_temperature: code, ..ImuSample::default() };
        let read = |index: i32| match (index % 5, index % 2) {
            (0 | 1, 0) => failed(2850),
            (0 | 1, _) => failed(-1),
            _ => sample(24.0),
        };
        let samples: Vec<_> = (0..600).map(read).collect();
        assert!(matches!(wait.take(&samples), Some(Waiting::GivenUp(_))));
    }

    #[test]
    fn the_end_of_a_capture_counts() {
        let about = CaptureHead {
            label: "z+".into(),
            series: 1,
            pose: Pose::Still { up: [0.0, 0.0, 1.0], heading_deg: 0.0 },
            rate_hz: RATE_HZ,
        };
        let samples: Vec<_> = (0..1000).map(|index| sample(23.0 + f64::from(index) * 0.005)).collect();
        let mut capture = Capture {
            about,
            first_us: 0,
            samples,
            compensated: Vec::new(),
            losses: Losses::default(),
            receiver: ReceiverCapture::default(),
            timing: Timing::new(RATE_HZ),
        };
        // The middle of the last 50 samples.
        let end = Temperatures::at_end_of(&capture).expect("temperatures");
        assert!(end.apart_k(at(23.0 + 975.0 * 0.005)) < 0.011, "{end:?}");
        capture.samples.clear();
        assert_eq!(Temperatures::at_end_of(&capture), None);
    }
}
