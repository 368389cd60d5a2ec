//! A still flag for modules that do not give one.

use crate::{Refusal, series};

/// Detects a still module: the samples of a window scatter no more than noise, and no single sample leaves the window's
/// mean.
///
/// A gyroscope alone cannot separate a bias from a motion that is slower than the noise shows (a constant rate, the
/// earth's rotation).
#[derive(Debug, Clone)]
pub struct StillDetector {
    window: Vec<f64>,
    next: usize,
    filled: bool,
    noise: f64,
}

impl StillDetector {
    /// Scatter over noise at which a window counts as moving. For 50 samples of normal noise this is 4.5 standard
    /// deviations of the scatter away.
    const SCATTER: f64 = 1.45;
    /// Distance of a single sample from the mean of the window, in standard deviations of the noise.
    const SINGLE: f64 = 6.0;

    /// Creates a detector over `window` samples for a gyroscope whose samples have this standard deviation of noise.
    ///
    /// # Errors
    /// [`Refusal::Parameter`] for a window below 10 samples or noise that is not above zero.
    pub fn new(window: usize, noise: f64) -> Result<Self, Refusal> {
        series::positive("noise of a sample", noise)?;
        if window < 10 {
            return Err(Refusal::Parameter { name: "window", value: window as f64, expected: "at least 10 samples" });
        }
        Ok(Self { window: vec![0.0; window], next: 0, filled: false, noise })
    }

    /// Takes one sample. Returns `true` when the window that ends with it is still, but not before the first window is
    /// full.
    pub fn step(&mut self, rate: f64) -> bool {
        self.window[self.next] = rate;
        self.next = (self.next + 1) % self.window.len();
        self.filled |= self.next == 0;
        let (mean, sd) = crate::stats::mean_sd(&self.window);
        // A NaN makes both comparisons false.
        self.filled && sd < Self::SCATTER * self.noise && (rate - mean).abs() < Self::SINGLE * self.noise
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_still_and_motion_is_not() {
        let mut detector = StillDetector::new(50, 1.0).unwrap();
        // A noise of known scatter: +-1 in turn.
        let noise = |i: usize| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let flags: Vec<bool> = (0..300)
            .map(|i| detector.step(7.0 + noise(i) + if (100..150).contains(&i) { (i - 100) as f64 * 0.2 } else { 0.0 }))
            .collect();
        assert!(!flags[48] && flags[49..100].iter().all(|f| *f), "still from the first full window");
        assert!(flags[125..150].iter().all(|f| !*f) && flags[200..].iter().all(|f| *f));
        assert!(!detector.step(f64::NAN) && !detector.step(7.0));
        assert!(StillDetector::new(5, 1.0).is_err() && StillDetector::new(50, 0.0).is_err());
    }
}
