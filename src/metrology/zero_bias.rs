//! Removal of a gyroscope's bias during operation: per axis, per sample, with a still flag.
//!
//! After the patent "MEMS gyroscope zero-position elimination system and method". Where its formulas are lost, the code
//! follows the rest of the text. Departures from the words: a count of valid slots is stored with the biases (the mean
//! over all slots would shrink towards zero during the first power cycles); the mean of the ring is that of its filled
//! slots (the text divides by one more); a stored bias needs both, a long rest and a new best bias.
//!
//! Known weaknesses: one block of 50 samples can be noisier than the stored bias; the earth's rotation is learned as
//! bias (subtract the part known from attitude and latitude first); the best bias freezes at the ring that was quietest
//! by chance. [`Kalman`] is the alternative: it weighs the stored bias and the samples by their variances.

mod kalman;
mod still;
mod store;

pub use kalman::{BiasModel, Kalman};
pub use still::StillDetector;
pub use store::{Copies, Stored};

use crate::Refusal;

/// Lengths of the method. The text gives the first three; it has no values for slots and rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ZeroBiasSettings {
    /// Samples over which the stored bias hands over to the measured one (FuseNum, below 1000).
    pub fusion: usize,
    /// Still samples of a block (M, at most 200).
    pub block: usize,
    /// Blocks of the ring (N, below 100).
    pub ring: usize,
    /// Stored biases (N0).
    pub slots: usize,
    /// Consecutive still samples before a bias is stored (P, at least a whole ring).
    pub rest: usize,
}

impl Default for ZeroBiasSettings {
    fn default() -> Self {
        Self { fusion: 500, block: 50, ring: 30, slots: 10, rest: 3000 }
    }
}

impl ZeroBiasSettings {
    /// # Errors
    /// [`Refusal::Parameter`] for the first length out of its range.
    pub fn check(&self) -> Result<(), Refusal> {
        let rules = [
            ("fusion (samples)", self.fusion, (1..1000).contains(&self.fusion), "1 to 999"),
            ("block (samples)", self.block, (2..=200).contains(&self.block), "2 to 200"),
            ("ring (blocks)", self.ring, (2..100).contains(&self.ring), "2 to 99"),
            ("slots", self.slots, (1..=store::MOST_SLOTS).contains(&self.slots), "1 to 64"),
            ("rest (samples)", self.rest, self.rest >= self.ring * self.block, "at least ring times block"),
        ];
        match rules.into_iter().find(|rule| !rule.2) {
            Some((name, value, _, expected)) => Err(Refusal::Parameter { name, value: value as f64, expected }),
            None => Ok(()),
        }
    }
}

/// The output for one sample.
#[derive(Debug, Clone, PartialEq)]
pub struct FilterOutput {
    /// Rate less the bias.
    pub rate: f64,
    /// The bias that was subtracted.
    pub bias: f64,
    /// Set when the stored biases changed. The caller must write them now.
    pub store: Option<Stored>,
}

/// The method, for one axis from one power-on to the next.
#[derive(Debug, Clone)]
pub struct Eliminator {
    settings: ZeroBiasSettings,
    stored: Stored,
    /// Samples since power-on, up to the end of the fusion (SC).
    count: usize,
    /// The present block: its sum and samples.
    sum: f64,
    filled: usize,
    /// Mean of the last complete block (B0).
    block: Option<f64>,
    ring: Vec<f64>,
    /// Next slot of the ring (FC).
    next: usize,
    bias: f64,
    /// Best bias (Wop) found since power-on and not yet stored.
    best: Option<f64>,
    /// Smallest variance of a full ring (Var0).
    best_variance: Option<f64>,
    /// Consecutive still samples.
    rest: usize,
}

impl Eliminator {
    /// Starts from the biases that were stored.
    ///
    /// # Errors
    /// As [`ZeroBiasSettings::check`].
    pub fn new(settings: ZeroBiasSettings, stored: Stored) -> Result<Self, Refusal> {
        settings.check()?;
        let bias = stored.mean().unwrap_or(0.0);
        Ok(Self {
            settings,
            stored,
            count: 0,
            sum: 0.0,
            filled: 0,
            block: None,
            ring: Vec::with_capacity(settings.ring),
            next: 0,
            bias,
            best: None,
            best_variance: None,
            rest: 0,
        })
    }

    /// Takes one sample. A sample that is not finite counts as moving and changes nothing.
    pub fn step(&mut self, rate: f64, still: bool) -> FilterOutput {
        let still = still && rate.is_finite();
        let fusing = self.count < self.settings.fusion;
        self.count = (self.count + 1).min(self.settings.fusion);
        self.rest = if still { self.rest + 1 } else { 0 };
        let complete = self.gather(rate, still);
        if fusing {
            self.block = complete.or(self.block);
            self.fuse();
        } else if let Some(mean) = complete {
            self.turn(mean);
        }
        let store = self.store();
        FilterOutput { rate: rate - self.bias, bias: self.bias, store }
    }

    /// Returns the present bias.
    #[must_use]
    pub fn bias(&self) -> f64 {
        self.bias
    }

    /// Adds a sample to the block; returns the mean of the block when it is complete. A moving sample drops the block.
    fn gather(&mut self, rate: f64, still: bool) -> Option<f64> {
        if !still {
            (self.sum, self.filled) = (0.0, 0);
            return None;
        }
        self.sum += rate;
        self.filled += 1;
        if self.filled < self.settings.block {
            return None;
        }
        let mean = self.sum / self.filled as f64;
        (self.sum, self.filled) = (0.0, 0);
        Some(mean)
    }

    /// `B = SC/FuseNum B0 + (1 - SC/FuseNum) mean(A)`.
    fn fuse(&mut self) {
        let part = self.count as f64 / self.settings.fusion as f64;
        self.bias = match (self.block, self.stored.mean()) {
            (Some(measured), Some(stored)) => part * measured + (1.0 - part) * stored,
            (Some(measured), None) => measured,
            (None, stored) => stored.unwrap_or(0.0),
        };
    }

    /// Puts a block into the ring, whose mean is the bias, and checks whether the ring is quieter.
    fn turn(&mut self, mean: f64) {
        let size = self.settings.ring;
        if self.ring.len() < size {
            self.ring.push(mean);
        } else {
            self.ring[self.next] = mean;
        }
        self.next = (self.next + 1) % size;
        let (mean, sd) = crate::stats::mean_sd(&self.ring);
        self.bias = mean;
        if self.ring.len() < size {
            return;
        }
        let variance = sd * sd;
        match self.best_variance {
            Some(least) if variance >= least => {}
            Some(_) => {
                self.best = Some(mean);
                self.best_variance = Some(variance);
            }
            // The first full ring only sets the mark.
            None => self.best_variance = Some(variance),
        }
    }

    fn store(&mut self) -> Option<Stored> {
        if self.rest < self.settings.rest {
            return None;
        }
        let best = self.best.take()?;
        self.rest = 0;
        self.stored.push(best, self.settings.slots);
        Some(self.stored.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: ZeroBiasSettings = ZeroBiasSettings { fusion: 10, block: 2, ring: 3, slots: 2, rest: 6 };

    fn powered(stored: &[f64]) -> Eliminator {
        let mut s = Stored::default();
        stored.iter().for_each(|b| s.push(*b, SMALL.slots));
        Eliminator::new(SMALL, s).unwrap()
    }

    #[test]
    fn fusion_hands_over_from_the_stored_bias() {
        let mut e = powered(&[4.0, 6.0]);
        // The first block is complete with the second sample.
        assert_eq!(e.step(1.0, true).bias, 5.0);
        assert_eq!(e.step(3.0, true).bias, 0.2 * 2.0 + 0.8 * 5.0);
        // Moving samples also count, with the same block.
        assert_eq!(e.step(9.0, false).bias, 0.3 * 2.0 + 0.7 * 5.0);
        for _ in 3..10 {
            e.step(9.0, false);
        }
        assert_eq!(e.bias(), 2.0);
    }

    #[test]
    fn without_anything_stored_the_block_is_the_bias() {
        let mut e = powered(&[]);
        assert_eq!([e.step(1.0, true).bias, e.step(3.0, true).bias], [0.0, 2.0]);
    }

    #[test]
    fn the_ring_takes_over_and_the_quietest_one_is_stored() {
        let mut e = powered(&[5.0]);
        for _ in 0..10 {
            e.step(5.0, true);
        }
        // A moving sample drops the half block; the bias of the fusion stays.
        e.step(8.0, true);
        assert_eq!(e.step(99.0, false).bias, 5.0);
        let feed = |e: &mut Eliminator, mean: f64| {
            e.step(mean - 1.0, true);
            e.step(mean + 1.0, true)
        };
        assert_eq!(feed(&mut e, 1.0).bias, 1.0);
        assert_eq!(feed(&mut e, 2.0).bias, 1.5);
        // Full: 1 2 6, variance 7. This sets the mark; nothing is stored.
        assert_eq!((feed(&mut e, 6.0).bias, e.best), (3.0, None));
        // 2 2 6 is quieter, and six still samples came before.
        let out = feed(&mut e, 2.0);
        assert!((out.bias - 10.0 / 3.0).abs() < 1e-12);
        let stored = out.store.unwrap();
        assert_eq!(stored.biases().len(), 2);
        assert!((stored.biases()[1] - 10.0 / 3.0).abs() < 1e-12);
        // Without a new best bias, nothing is stored.
        assert_eq!(feed(&mut e, 9.0).store, None);
    }

    #[test]
    fn samples_that_are_no_numbers_do_no_harm() {
        let mut e = powered(&[5.0]);
        e.step(1.0, true);
        e.step(f64::NAN, true);
        e.step(1.0, true);
        assert_eq!(e.step(1.0, true).bias, 0.4 * 1.0 + 0.6 * 5.0);
    }

    #[test]
    fn settings_are_checked() {
        let check = |s: ZeroBiasSettings| {
            Eliminator::new(s, Stored::default()).err().map(|e| e.to_string()).unwrap_or_default()
        };
        assert_eq!(check(ZeroBiasSettings::default()), "");
        assert_eq!(
            check(ZeroBiasSettings { rest: 100, ..ZeroBiasSettings::default() }),
            "rest (samples) is 100, expected at least ring times block"
        );
        assert_eq!(
            check(ZeroBiasSettings { block: 0, ..ZeroBiasSettings::default() }),
            "block (samples) is 0, expected 2 to 200"
        );
    }
}
