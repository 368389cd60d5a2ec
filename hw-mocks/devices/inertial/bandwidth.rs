//! The bandwidth of a sensor: a low-pass on all of its inputs and on its white noise, exact at any sample rate.
//!
//! A sample is the mean of the filtered signal over its interval `T`, as an averaging decimator gives it. So the mean of
//! five samples at 1 kHz is distributed as one at 200 Hz, no noise folds down to frequency zero, and the spectrum of
//! white noise of the two-sided density `N^2` is
//!
//! ```text
//! S(f) = N^2 sum over k of |H(g)|^2 sinc^2(g T),  g = f + k / T,   sinc(x) = sin(pi x) / (pi x)
//! |H(f)|^2 = 1 / (1 + (f / f0)^(2 order))
//! ```
//!
//! The filter is the Butterworth filter of its order: `x1' = w (u - x1)`, or `x1' = w x2`,
//! `x2' = w (u - x1 - sqrt(2) x2)` with `w = 2 pi f0`, the output x1, the input u. Between samples the input is taken
//! as linear in time. White noise has no value to interpolate. Its part of the states and of the mean is Gaussian with
//! a covariance `Q`. The steady innovations form (Anderson and Moore, Optimal Filtering, 1979, chapter 9.3) gives a
//! process of exactly these covariances from one random number a sample.

use std::f64::consts::{PI, SQRT_2, TAU};

use nalgebra::{Matrix2, Matrix3, Matrix6, RowVector2, SMatrix, Vector2, Vector3};

use crate::noise::Dice;

/// A low-pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bandwidth {
    /// Frequency at which the power is down to a half.
    pub cutoff_hz: f64,
    /// Steepness of the roll-off.
    pub order: FilterOrder,
}

/// Poles of a low-pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FilterOrder {
    /// One: 20 dB a decade.
    First,
    /// Two, after Butterworth: 40 dB a decade.
    Second,
}

impl Bandwidth {
    /// The response to a sinusoid in means over `span_s`: the factor of its amplitude, and its delay against the
    /// sinusoid at the end of the span, rad.
    #[must_use]
    pub(crate) fn response(&self, frequency_hz: f64, span_s: f64) -> (f64, f64) {
        let ratio = frequency_hz / self.cutoff_hz;
        let (gain, lag) = match self.order {
            FilterOrder::First => (1.0 / 1.0_f64.hypot(ratio), ratio.atan()),
            FilterOrder::Second => (1.0 / 1.0_f64.hypot(ratio * ratio), (SQRT_2 * ratio).atan2(1.0 - ratio * ratio)),
        };
        let half_turn = PI * frequency_hz * span_s;
        let mean = if half_turn == 0.0 { 1.0 } else { half_turn.sin() / half_turn };
        (gain * mean, lag + half_turn)
    }

    /// `d/dt (x1, x2, integral of x1) = A (..) + B u`.
    fn system(&self) -> (Matrix3<f64>, Vector3<f64>) {
        let w = TAU * self.cutoff_hz;
        match self.order {
            FilterOrder::First => (Matrix3::new(-w, 0.0, 0.0, 0.0, -w, 0.0, 1.0, 0.0, 0.0), Vector3::new(w, 0.0, 0.0)),
            FilterOrder::Second => {
                (Matrix3::new(0.0, w, 0.0, -w, -SQRT_2 * w, 0.0, 1.0, 0.0, 0.0), Vector3::new(0.0, w, 0.0))
            }
        }
    }

    /// Variance of x1 and of x2 under white noise of density 1.
    fn stationary(&self) -> Matrix2<f64> {
        let w = TAU * self.cutoff_hz;
        match self.order {
            FilterOrder::First => Matrix2::new(w / 2.0, 0.0, 0.0, 0.0),
            FilterOrder::Second => Matrix2::identity() * (w / (2.0 * SQRT_2)),
        }
    }
}

/// A low-pass in steps of one interval: the matrices that take its states and inputs to the next ones and to the mean.
#[derive(Debug, Clone, Copy)]
pub(super) struct LowPass {
    states: Matrix2<f64>,
    states_of_input: Vector2<f64>,
    states_of_rise: Vector2<f64>,
    states_of_noise: Vector2<f64>,
    mean: RowVector2<f64>,
    mean_of_input: f64,
    mean_of_rise: f64,
    mean_of_noise: f64,
    /// A square root of the covariance of the states from past noise.
    spread: Matrix2<f64>,
}

/// The filter of one axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Filtered {
    states: Vector2<f64>,
    input: f64,
}

impl LowPass {
    pub(super) fn new(bandwidth: &Bandwidth, interval_s: f64) -> Self {
        let (a, b) = bandwidth.system();
        // The input and its rise over the interval are states too; time is in intervals.
        let mut whole = SMatrix::<f64, 5, 5>::zeros();
        whole.fixed_view_mut::<3, 3>(0, 0).copy_from(&(a * interval_s));
        whole.fixed_view_mut::<3, 1>(0, 3).copy_from(&(b * interval_s));
        whole[(3, 4)] = 1.0;
        let whole = whole.exp();
        let states = whole.fixed_view::<2, 2>(0, 0).into_owned();
        let integral = whole.fixed_view::<1, 2>(2, 0).into_owned();
        let q = noise_covariance(&a, &b, interval_s);
        let innovations = Innovations::steady(&states, &integral, &q, &bandwidth.stationary());
        Self {
            states,
            states_of_input: whole.fixed_view::<2, 1>(0, 3).into_owned(),
            states_of_rise: whole.fixed_view::<2, 1>(0, 4).into_owned(),
            states_of_noise: innovations.gain * innovations.deviation,
            mean: integral / interval_s,
            mean_of_input: whole[(2, 3)] / interval_s,
            mean_of_rise: whole[(2, 4)] / interval_s,
            mean_of_noise: innovations.deviation / interval_s,
            spread: root(&(bandwidth.stationary() - innovations.error)),
        }
    }

    /// The filter of an axis that has settled at `input` and noise of density `white^2`.
    pub(super) fn settled(&self, input: f64, white: f64, dice: &mut Dice) -> Filtered {
        let past = self.spread * Vector2::new(dice.normal(), dice.normal());
        Filtered { states: Vector2::new(input, 0.0) + past * white, input }
    }

    /// Mean over the interval that ends now with the input `input`; `chance` comes from the standard normal
    /// distribution.
    pub(super) fn step(&self, axis: &mut Filtered, input: f64, white: f64, chance: f64) -> f64 {
        let (before, rise, noise) = (axis.input, input - axis.input, white * chance);
        let signal = (self.mean * axis.states)[0] + self.mean_of_input * before + self.mean_of_rise * rise;
        axis.states = self.states * axis.states
            + self.states_of_input * before
            + self.states_of_rise * rise
            + self.states_of_noise * noise;
        axis.input = input;
        signal + self.mean_of_noise * noise
    }
}

/// Covariance that white noise of density 1 adds to the states in an interval: `integral of e^(A s) B B' e^(A' s)` (Van
/// Loan, Computing Integrals Involving the Matrix Exponential, 1978). It is computed over a part of the interval and
/// doubled until it covers the whole, since the exponential of `-A` overflows over a long interval.
fn noise_covariance(a: &Matrix3<f64>, b: &Vector3<f64>, interval_s: f64) -> Matrix3<f64> {
    let doublings = (a.abs().max() * interval_s).log2().ceil().max(0.0);
    let part_s = interval_s / doublings.exp2();
    let mut both = Matrix6::zeros();
    both.fixed_view_mut::<3, 3>(0, 0).copy_from(&(-a * part_s));
    both.fixed_view_mut::<3, 3>(0, 3).copy_from(&(b * b.transpose() * part_s));
    both.fixed_view_mut::<3, 3>(3, 3).copy_from(&(a.transpose() * part_s));
    let both = both.exp();
    let mut step = both.fixed_view::<3, 3>(3, 3).transpose();
    let mut covariance = step * both.fixed_view::<3, 3>(0, 3);
    for _ in 0..doublings as u32 {
        covariance += step * covariance * step.transpose();
        step *= step;
    }
    covariance
}

/// The new information in a mean, beyond all earlier means.
struct Innovations {
    deviation: f64,
    /// Change of the states for one unit of it.
    gain: Vector2<f64>,
    /// Covariance of the states that the means leave unknown.
    error: Matrix2<f64>,
}

impl Innovations {
    /// Steps the Riccati equation until it settles. This takes a few steps, since the means determine nearly all of the
    /// states.
    fn steady(states: &Matrix2<f64>, integral: &RowVector2<f64>, q: &Matrix3<f64>, stationary: &Matrix2<f64>) -> Self {
        const MOST_STEPS: u32 = 10_000;
        let (of_states, shared) = (q.fixed_view::<2, 2>(0, 0), q.fixed_view::<2, 1>(0, 2));
        let from = |error: &Matrix2<f64>| {
            let variance = (integral * error * integral.transpose())[0] + q[(2, 2)];
            let gain = (states * error * integral.transpose() + shared) / variance;
            Self { deviation: variance.sqrt(), gain, error: *error }
        };
        let mut known = from(stationary);
        for _ in 0..MOST_STEPS {
            let variance = known.deviation * known.deviation;
            let error =
                states * known.error * states.transpose() + of_states - known.gain * known.gain.transpose() * variance;
            let moved = (error - known.error).abs().max();
            known = from(&error);
            if moved <= 1e-14 * stationary[(0, 0)] {
                break;
            }
        }
        known
    }
}

/// A lower triangle whose square is a covariance; values below zero from rounding count as zero.
fn root(covariance: &Matrix2<f64>) -> Matrix2<f64> {
    let first = covariance[(0, 0)].max(0.0).sqrt();
    let across = if first > 0.0 { covariance[(1, 0)] / first } else { 0.0 };
    Matrix2::new(first, 0.0, across, (covariance[(1, 1)] - across * across).max(0.0).sqrt())
}
