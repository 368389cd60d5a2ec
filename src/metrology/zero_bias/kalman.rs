//! Inverse-variance fusion of the stored bias and the samples.

use super::Stored;
use crate::{Refusal, series};

/// What the module's own record shows about its bias, in the unit u of the rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasModel {
    /// Standard deviation of the bias from one power-on to the next, u.
    pub repeatability: f64,
    /// Random walk of the integral (Allan coefficient N), u sqrt(s).
    pub n: f64,
    /// Bias instability (Allan coefficient B), u.
    pub b: f64,
    /// Sample rate, Hz.
    pub rate_hz: f64,
}

/// A scalar Kalman filter. It starts from the stored biases with the variance of their mean and of a new power-on,
/// takes each still sample with the variance `N^2 rate`, and lets the bias walk at the speed at which the variance
/// settles at the floor `(0.664 B)^2` of the record.
#[derive(Debug, Clone)]
pub struct Kalman {
    bias: f64,
    variance: Option<f64>,
    sample_variance: f64,
    walk: f64,
}

impl Kalman {
    /// Starts from the biases that were stored. With nothing stored, the first still sample is the bias.
    ///
    /// # Errors
    /// [`Refusal::Parameter`] for figures that are not above zero.
    pub fn new(model: &BiasModel, stored: &Stored) -> Result<Self, Refusal> {
        series::positive("repeatability", model.repeatability)?;
        let n = series::positive("N", model.n)?;
        let floor = (0.664_282 * series::positive("B", model.b)?).powi(2);
        let sample_variance = n * n * series::positive("rate (Hz)", model.rate_hz)?;
        let power_on = model.repeatability.powi(2);
        let variance = stored.mean().map(|_| power_on * (1.0 + 1.0 / stored.biases().len() as f64));
        // Steady state of a scalar filter with slow walk: variance^2 = walk * sample variance.
        Ok(Self {
            bias: stored.mean().unwrap_or(0.0),
            variance,
            sample_variance,
            walk: floor * floor / sample_variance,
        })
    }

    /// Takes one sample and returns the rate less the bias. A sample that is not finite changes nothing.
    pub fn step(&mut self, rate: f64, still: bool) -> f64 {
        self.variance = self.variance.map(|v| v + self.walk);
        if still && rate.is_finite() {
            let gain = self.variance.map_or(1.0, |v| v / (v + self.sample_variance));
            self.bias += gain * (rate - self.bias);
            self.variance = Some(self.variance.map_or(self.sample_variance, |v| (1.0 - gain) * v));
        }
        rate - self.bias
    }

    /// Returns the present bias.
    #[must_use]
    pub fn bias(&self) -> f64 {
        self.bias
    }

    /// Returns the standard deviation of the bias by the model; infinite before anything is known.
    #[must_use]
    pub fn sd(&self) -> f64 {
        self.variance.map_or(f64::INFINITY, f64::sqrt)
    }
}
