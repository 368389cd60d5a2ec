//! Seeded noise: the same seed gives the same draws, whenever they are drawn.
//!
//! Every source of chance has a stream of its own of one ChaCha generator, so that reading one device more often
//! does not shift the noise of another.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// What the chance is for; each has its own stream of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u64)]
pub enum Source {
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
    /// What happens to bytes on their way to the host.
    Line = 13,
    /// 1PPS edges.
    Pps = 14,
    /// Duration of erases and writes of the internal flash.
    InternalFlash = 15,
    /// What happens to bytes on their way to the board.
    LineToBoard = 16,
    /// Faults of CAN on the way to the host.
    CanToHost = 17,
    /// Faults of CAN on the way to the board.
    CanToBoard = 18,
    /// The turntable: what is new each time.
    Table = 19,
    /// The turntable: what an orientation has whenever it is taken up.
    TablePosition = 20,
}

/// One stream of chance.
#[derive(Debug, Clone)]
pub struct Dice {
    generator: ChaCha8Rng,
}

impl Dice {
    /// The stream of `source` under `seed`, from its beginning.
    #[must_use]
    pub fn new(seed: u64, source: Source) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(source as u64);
        Self { generator }
    }

    /// A number of the standard normal distribution.
    pub fn normal(&mut self) -> f64 {
        self.generator.sample(StandardNormal)
    }

    /// A number from `low` to below `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.generator.random::<f64>()
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
pub struct GaussMarkov {
    deviation: f64,
    correlation_s: f64,
    value: f64,
}

impl GaussMarkov {
    /// A process in its stationary state.
    #[must_use]
    pub fn new(deviation: f64, correlation_s: f64, dice: &mut Dice) -> Self {
        Self { deviation, correlation_s, value: deviation * dice.normal() }
    }

    /// Moves on by `span_s` and gives the new value.
    pub fn step(&mut self, span_s: f64, dice: &mut Dice) -> f64 {
        let decay = (-span_s / self.correlation_s).exp();
        self.value = decay * self.value + (1.0 - decay * decay).max(0.0).sqrt() * self.deviation * dice.normal();
        self.value
    }

    /// The value now.
    #[must_use]
    pub fn value(&self) -> f64 {
        self.value
    }

    /// Standard deviation of the mean over `span_s` of a process of deviation 1:
    /// `2/x^2 (x - 1 + e^-x)` with `x = span/T`, under the root.
    #[must_use]
    pub fn deviation_of_mean(span_s: f64, correlation_s: f64) -> f64 {
        let x = span_s / correlation_s;
        (2.0 / (x * x) * (x - 1.0 + (-x).exp())).sqrt()
    }
}
