//! Seeded noise: the same seed gives the same draws, at any time.
//!
//! Every source of chance has its own stream of one ChaCha generator, so that reading one device more often does not
//! shift the noise of another.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// The use of random numbers; each use has its own stream of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u64)]
pub enum RandomStream {
    /// Boot ids.
    Boot = 1,
    /// Supply voltage and current.
    Supply = 2,
    /// White noise of the inertial sensors and the magnetometer.
    SensorWhite = 3,
    /// Slow noise of the inertial sensors.
    SensorSlow = 4,
    /// Biases drawn at each power-on.
    TurnOn = 5,
    /// Timers.
    Timers = 6,
    /// AD converter.
    Ad = 7,
    /// Duration of erases and writes of the SPI flash.
    SpiFlash = 8,
    /// GNSS: acquisition.
    Acquisition = 9,
    /// GNSS: errors of position, velocity and signals.
    Gnss = 10,
    /// Temperature sensors.
    Temperature = 11,
    /// Content of memories at power-on.
    Content = 12,
    /// Faults of bytes on their way to the host.
    Line = 13,
    /// 1PPS edges.
    Pps = 14,
    /// Duration of erases and writes of the internal flash.
    InternalFlash = 15,
    /// Faults of bytes on their way to the board.
    LineToBoard = 16,
    /// Faults of CAN on the way to the host.
    CanToHost = 17,
    /// Faults of CAN on the way to the board.
    CanToBoard = 18,
    /// The turntable: errors that are new each time.
    Table = 19,
    /// The turntable: errors of an orientation that repeat whenever it is taken up.
    TablePosition = 20,
    /// Simulations of noise alone.
    Bootstrap = 21,
    /// Spikes and failed reads of the inertial sensors and the magnetometer.
    SensorUpsets = 22,
}

/// One stream of random numbers.
#[derive(Debug, Clone)]
pub struct Dice {
    generator: ChaCha8Rng,
}

impl Dice {
    /// The stream of `source` under `seed`, from its beginning.
    #[must_use]
    pub fn new(seed: u64, source: RandomStream) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(source as u64);
        Self { generator }
    }

    /// A number of the standard normal distribution.
    pub(crate) fn normal(&mut self) -> f64 {
        self.generator.sample(StandardNormal)
    }

    /// A number from `low` to below `high`.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.generator.random::<f64>()
    }

    /// Whether an event with this rate per million happens; without a rate no dice are thrown.
    pub(crate) fn happens(&mut self, per_million: f64) -> bool {
        per_million > 0.0 && self.between(0.0, 1e6) < per_million
    }

    /// A whole number from 0 to below `bound`; 0 if `bound` is below one.
    pub(crate) fn below(&mut self, bound: f64) -> usize {
        self.between(0.0, bound.max(1.0)) as usize
    }

    /// Any 32-bit number.
    pub fn word(&mut self) -> u32 {
        self.generator.random()
    }
}

/// A first-order Gauss-Markov process: stationary standard deviation and correlation time.
///
/// The step over any interval is exact: `x' = e^(-dt/T) x + sqrt(1 - e^(-2 dt/T)) s n`.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct GaussMarkov {
    deviation: f64,
    correlation_s: f64,
    value: f64,
    /// Decay and noise of the last interval: most intervals are equal.
    last: (f64, f64, f64),
}

impl GaussMarkov {
    /// A process in its stationary state.
    #[must_use]
    pub(crate) fn new(deviation: f64, correlation_s: f64, dice: &mut Dice) -> Self {
        Self { deviation, correlation_s, value: deviation * dice.normal(), last: (0.0, 1.0, 0.0) }
    }

    /// Moves on by `span_s` and returns the new value.
    pub(crate) fn step(&mut self, span_s: f64, dice: &mut Dice) -> f64 {
        // A process without deviation needs no random number.
        if self.deviation == 0.0 {
            return 0.0;
        }
        if self.last.0 != span_s {
            let decay = (-span_s / self.correlation_s).exp();
            self.last = (span_s, decay, (1.0 - decay * decay).max(0.0).sqrt() * self.deviation);
        }
        let (_, decay, noise) = self.last;
        self.value = decay * self.value + noise * dice.normal();
        self.value
    }

    /// Moves on by `span_s` and returns the mean over it. Let `x = span/T` and `e = e^-x`. Given the start `v`, the end
    /// and the integral have means `e v` and `T (1 - e) v`, variances `s^2 (1 - e^2)` and
    /// `s^2 T^2 (2 x - 3 + 4 e - e^2)`, and covariance `s^2 T (1 - e)^2`.
    pub(crate) fn mean(&mut self, span_s: f64, dice: &mut Dice) -> f64 {
        if self.deviation == 0.0 || span_s <= 0.0 {
            return self.value;
        }
        let x = span_s / self.correlation_s;
        let (e, fallen) = ((-x).exp(), -(-x).exp_m1());
        let end_deviation = (fallen * (1.0 + e)).sqrt();
        let covariance = fallen * fallen;
        // The closed form cancels for short spans; its series to the fifth power is good to 1e-9 there.
        let integral_variance = if x < 1e-2 {
            x.powi(3) * (2.0 / 3.0 - 0.5 * x + 7.0 / 30.0 * x * x)
        } else {
            2.0 * x - 3.0 + 4.0 * e - e * e
        };
        let (first, second) = (dice.normal(), dice.normal());
        let along = covariance / end_deviation;
        let across = (integral_variance - along * along).max(0.0).sqrt();
        let start = self.value;
        self.value = e * start + self.deviation * end_deviation * first;
        (fallen * start + self.deviation * (along * first + across * second)) / x
    }

    /// The value now.
    #[must_use]
    pub(crate) fn value(&self) -> f64 {
        self.value
    }
}
