//! Fourier transforms of real records, for `f64` alone.
//!
//! The library behind this crate is generic. Each crate that plans a transform with it compiles all transforms of all
//! lengths anew, which is half of the code of the metrology. Here they are compiled once.

use std::sync::Arc;

use realfft::RealFftPlanner;
pub use realfft::{ComplexToReal, RealToComplex};

/// A plan for the transform of `length` real samples into `length / 2 + 1` complex amplitudes:
/// `X[k] = sum over j of x[j] exp(-2 pi i j k / length)`, without normalisation.
#[must_use]
pub fn forward(length: usize) -> Arc<dyn RealToComplex<f64>> {
    RealFftPlanner::new().plan_fft_forward(length)
}

/// A plan for the transform of `length / 2 + 1` complex amplitudes into `length` real samples. Without normalisation:
/// the inverse of [`forward`] times `length`.
#[must_use]
pub fn inverse(length: usize) -> Arc<dyn ComplexToReal<f64>> {
    RealFftPlanner::new().plan_fft_inverse(length)
}
