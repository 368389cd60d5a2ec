//! The exact noise of a sensor, and a simulation of it without frames, codes and a world.
//!
//! The error of an axis beside its fixed bias is the sum of four parts, all Gaussian and independent:
//!
//! | part | what it is |
//! | --- | --- |
//! | white | each sample at `rate` has deviation `white sqrt(rate)`; the mean of a span `white / sqrt(span)` |
//! | slow | a Gauss-Markov process of deviation `slow` and correlation time `correlation_s` |
//! | flicker | the sum of four Gauss-Markov processes of deviation `flicker` each, with the correlation times [`FLICKER_S`]: its spectrum falls as 1/f between 16 microhertz and 16 millihertz, within 1 dB |
//! | turn-on | a constant of deviation `turn_on`, drawn at each power-on |
//!
//! Slow and flicker noise go on even without power. The samples of the bench hold them over steps of `STEP_S`;
//! [`NoiseSimulation::mean`] integrates them exactly, which for spans of seconds is the same to 1e-4.
//!
//! `V(T; t, p, n)` is the expectation of the sample variance of `n` means over `t`, begun every `p`, of a unit
//! Gauss-Markov process ([`variance_of_means`]). Bias stability comes from consecutive 10 s means for an hour, and
//! repeatability from six means of 600 s, every 1200 s, after power cycles. Their expected variances are
//!
//! ```text
//! stability^2     = white^2 / 10  + slow^2 V(T; 10, 10, 360)  + flicker^2 F(10, 10, 360)
//! repeatability^2 = white^2 / 600 + slow^2 V(T; 600, 1200, 6) + flicker^2 F(600, 1200, 6) + turn_on^2
//! ```
//!
//! with F the sum of V over [`FLICKER_S`]. `AxisNoise::published` solves them. The share of flicker in the second is
//! `FLICKER_SHARE`, or less if the first would leave too little for the slow part.

use nalgebra::Vector3;

use super::model::TriadModel;
use crate::noise::{Dice, GaussMarkov, RandomStream};

/// Step of the slow noise: 0.7 % of the shortest correlation time.
pub(crate) const STEP_S: f64 = 0.1;
/// Correlation times of the four processes that make flicker noise.
pub const FLICKER_S: [f64; 4] = [10.0, 100.0, 1000.0, 10_000.0];
/// Share of flicker noise in the repeatability's variance without white and slow noise.
pub(crate) const FLICKER_SHARE: f64 = 0.3;
/// Largest share of flicker noise in the stability's variance without white noise.
const FLICKER_OF_STABILITY: f64 = 0.5;

/// White noise of one conversion of each axis, of this density, at a rate whose root is `root_of_rate`.
pub(super) fn white_noise(density: &Vector3<f64>, root_of_rate: f64, dice: &mut Dice) -> Vector3<f64> {
    density.map(|density| density * root_of_rate * dice.normal())
}

/// The noise of one sensor, in its unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisNoise {
    /// White noise: deviation of a mean over one second.
    pub white: f64,
    /// Deviation of the slow noise.
    pub slow: f64,
    /// Correlation time of the slow noise.
    pub correlation_s: f64,
    /// Deviation of each process of the flicker noise.
    pub flicker: f64,
    /// Deviation of the bias from power-on to power-on.
    pub turn_on: f64,
}

impl Default for AxisNoise {
    /// No noise.
    fn default() -> Self {
        Self { white: 0.0, slow: 0.0, correlation_s: 100.0, flicker: 0.0, turn_on: 0.0 }
    }
}

/// Expectation of the sample variance (n - 1) of `count` means over `span_s`, begun every `every_s >= span_s`, of a
/// Gauss-Markov process of deviation 1.
#[must_use]
pub fn variance_of_means(correlation_s: f64, span_s: f64, every_s: f64, count: u32) -> f64 {
    let x = span_s / correlation_s;
    let fallen = 1.0 - (-x).exp();
    let variance = 2.0 / (x * x) * (x - fallen);
    let covariance = |lag: u32| (fallen / x).powi(2) * (-(f64::from(lag) * every_s - span_s) / correlation_s).exp();
    let n = f64::from(count);
    let pairs: f64 = (1..count).map(|lag| f64::from(count - lag) * covariance(lag)).sum();
    variance - 2.0 / (n * (n - 1.0)) * pairs
}

fn flicker_variance(span_s: f64, every_s: f64, count: u32) -> f64 {
    FLICKER_S.iter().map(|correlation_s| variance_of_means(*correlation_s, span_s, every_s, count)).sum()
}

impl AxisNoise {
    /// The noise whose expectations, as root mean squares, are these figures.
    #[must_use]
    pub(crate) fn published(white: f64, correlation_s: f64, stability: f64, repeatability: f64) -> Self {
        let slow_10 = variance_of_means(correlation_s, 10.0, 10.0, 360);
        let slow_600 = variance_of_means(correlation_s, 600.0, 1200.0, 6);
        let (flicker_10, flicker_600) = (flicker_variance(10.0, 10.0, 360), flicker_variance(600.0, 1200.0, 6));
        let first = (stability * stability - white * white / 10.0).max(0.0);
        let second = (repeatability * repeatability - white * white / 600.0).max(0.0);
        // flicker^2 flicker_600 = share (second - slow^2 slow_600), put into the first equation.
        let ratio = flicker_10 / flicker_600;
        let share = FLICKER_SHARE.min(FLICKER_OF_STABILITY * first / (ratio * second).max(f64::MIN_POSITIVE));
        let slow_2 = ((first - share * ratio * second) / (slow_10 - share * ratio * slow_600)).max(0.0);
        let rest = (second - slow_2 * slow_600).max(0.0);
        Self {
            white,
            slow: slow_2.sqrt(),
            correlation_s,
            flicker: (share * rest / flicker_600).sqrt(),
            turn_on: ((1.0 - share) * rest).sqrt(),
        }
    }
}

/// The slow parts of one sensor's noise.
#[derive(Debug, Clone, Copy)]
pub(super) struct SlowNoise {
    slow: GaussMarkov,
    flicker: [GaussMarkov; 4],
}

impl SlowNoise {
    pub(super) fn new(model: &AxisNoise, dice: &mut Dice) -> Self {
        Self {
            slow: GaussMarkov::new(model.slow, model.correlation_s, dice),
            flicker: FLICKER_S.map(|correlation_s| GaussMarkov::new(model.flicker, correlation_s, dice)),
        }
    }

    pub(super) fn step(&mut self, span_s: f64, dice: &mut Dice) {
        self.slow.step(span_s, dice);
        for part in &mut self.flicker {
            part.step(span_s, dice);
        }
    }

    pub(super) fn value(&self) -> f64 {
        self.slow.value() + self.flicker.iter().map(GaussMarkov::value).sum::<f64>()
    }

    fn mean(&mut self, span_s: f64, dice: &mut Dice) -> f64 {
        self.slow.mean(span_s, dice) + self.flicker.iter_mut().map(|part| part.mean(span_s, dice)).sum::<f64>()
    }
}

/// The errors of three sensors at a steady temperature, without a world, codes or frames. It serves parametric
/// bootstraps of the result that a test should find. Only the fixed bias and the noise of the model count.
#[derive(Debug, Clone)]
pub struct NoiseSimulation {
    model: TriadModel,
    slow: [SlowNoise; 3],
    turn_on: Vector3<f64>,
    dice: Dice,
}

impl NoiseSimulation {
    /// Sensors under a seed, just powered on.
    #[must_use]
    pub fn new(model: &TriadModel, seed: u64) -> Self {
        let mut dice = Dice::new(seed, RandomStream::Bootstrap);
        let slow = model.noise.map(|noise| SlowNoise::new(&noise, &mut dice));
        let mut simulation = Self { model: *model, slow, turn_on: Vector3::zeros(), dice };
        simulation.power_on();
        simulation
    }

    /// Switches power off and on.
    pub fn power_on(&mut self) {
        self.turn_on = Vector3::from_fn(|axis, _| self.model.noise[axis].turn_on * self.dice.normal());
    }

    /// Lets time pass without samples.
    pub fn pause(&mut self, span_s: f64) {
        for slow in &mut self.slow {
            slow.step(span_s, &mut self.dice);
        }
    }

    /// The mean over the next span, drawn from its exact distribution. It is as good as the mean of its samples at any
    /// rate, and takes the time of one sample.
    pub fn mean(&mut self, span_s: f64) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| {
            let white = self.model.noise[axis].white / span_s.sqrt() * self.dice.normal();
            self.model.bias[axis] + self.turn_on[axis] + self.slow[axis].mean(span_s, &mut self.dice) + white
        })
    }
}
