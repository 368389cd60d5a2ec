//! Records with failed reads, spikes and stale rows: the interval covers the truth, or the gate refuses the record.
//!
//! The records are drawn from the measurement models, and the truth is the input of these. This code does not know the
//! gate's thresholds.

#![allow(unreachable_pub, reason = "shared by a test and a benchmark")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a simulation may end with a panic")]

mod methods;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

pub use methods::METHODS;

/// Seeded dice.
pub struct Dice(ChaCha8Rng);

impl Dice {
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    pub fn even(&mut self) -> f64 {
        self.0.random()
    }
}

/// The damage to a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Nothing,
    /// All channels 0.
    Zeros,
    /// All channels at the lower end of 24 bits.
    RangeEnds,
    /// One channel off by 10 to 300 deviations of its noise, to one side.
    Spikes,
    /// The row before is repeated.
    Stale,
}

pub const KINDS: [Kind; 5] = [Kind::Nothing, Kind::Zeros, Kind::RangeEnds, Kind::Spikes, Kind::Stale];

/// The damage to a record.
#[derive(Debug, Clone, Copy)]
pub struct Spoil {
    pub kind: Kind,
    pub share: f64,
}

impl Spoil {
    /// Spoils rows of channels whose noise has this deviation.
    pub fn apply(self, channels: &mut [Vec<f64>], noise: f64, dice: &mut Dice) {
        for row in 1..channels[0].len() {
            if self.kind == Kind::Nothing || dice.even() >= self.share {
                continue;
            }
            let spiked = (dice.even() * channels.len() as f64) as usize;
            for (index, values) in channels.iter_mut().enumerate() {
                match self.kind {
                    Kind::Nothing => {}
                    Kind::Zeros => values[row] = 0.0,
                    Kind::RangeEnds => values[row] = -8_388_608.0,
                    Kind::Spikes if index == spiked => {
                        values[row] += (noise * 10.0 * 30.0_f64.powf(dice.even())).round();
                    }
                    Kind::Spikes => {}
                    Kind::Stale => values[row] = values[row - 1],
                }
            }
        }
    }
}

/// Whether each figure of a record lies within its interval; `None` where the record was refused.
pub type Trial = fn(Spoil, &mut Dice) -> Option<Vec<bool>>;

/// A method and the probability of its intervals.
pub struct Method {
    pub name: &'static str,
    pub probability: f64,
    pub trial: Trial,
}

/// The results of many records.
pub struct Tally {
    pub refused: usize,
    pub judged: usize,
    /// Smallest coverage of a figure.
    pub coverage: f64,
    /// Bound of the coverage: 3.9 standard errors below the probability.
    pub bound: f64,
}

impl Tally {
    pub fn run(method: &Method, spoil: Spoil, records: usize, seed: u64) -> Self {
        let mut dice = Dice::new(seed);
        let (mut judged, mut refused) = (0, 0);
        let mut covered: Vec<usize> = Vec::new();
        for _ in 0..records {
            let Some(figures) = (method.trial)(spoil, &mut dice) else {
                refused += 1;
                continue;
            };
            judged += 1;
            covered.resize(figures.len(), 0);
            covered.iter_mut().zip(figures).for_each(|(count, covers)| *count += usize::from(covers));
        }
        let least = covered.iter().min().copied().unwrap_or(0);
        let p = method.probability;
        let error = 3.9 * (p * (1.0 - p) / judged.max(1) as f64).sqrt();
        Self { refused, judged, coverage: least as f64 / judged.max(1) as f64, bound: p - error }
    }

    /// Whether the figures are covered, or all records were refused.
    pub fn holds(&self) -> bool {
        self.judged == 0 || self.coverage >= self.bound
    }
}
