//! Calibration, ellipse correction, Allan variance, spectra, statistics and uncertainty: the mathematics of the
//! station, usable by itself. A function takes slices and returns a result or a typed [`Refusal`]; it uses no files, no
//! clock and no screen.
//!
//! # Conventions
//! - `N` is the raw output of a triad (LSB, or whatever unit the record has), `f` the specific force in m/s^2 with +g on
//!   the axis that points up at rest, `w` the angular rate relative to inertial space in rad/s, right-handed.
//! - Measurement: `N = M f + b`, `N = S w + b + G f`. Compensation: `f = Ka N + nabla`, `w = Kg N - epsilon`, so
//!   `Ka = M^-1`, `nabla = -Ka b`, `Kg = S^-1`, `epsilon = Kg b`.
//! - A *bias* is measured less true, in LSB (`b`) as in m/s^2 (`Ka b = -nabla`) and rad/s (`Kg b = epsilon`). The
//!   constants that a compensation adds or subtracts keep the names nabla and epsilon.
//! - Rows of a matrix are sensors, columns are axes of the fixture.
//! - A `sd` is a standard uncertainty; with the degrees of freedom beside it, [`stats::coverage_factor`] gives the
//!   factor of a 95 % interval.

pub mod allan;
pub mod clock;
mod coefficient;
pub mod correlated;
pub mod earth;
pub mod ellipse;
pub mod ellipsoid;
pub mod gate;
pub mod gyro_still;
mod linear;
pub mod position;
pub mod psd;
mod quadric;
pub mod quantisation;
mod refusal;
pub mod rotation;
pub mod sample_clock;
pub mod scale_factor;
pub mod series;
pub mod six_position;
pub mod stability;
pub mod stats;
pub mod tilt;
pub mod triad;
pub mod zero_bias;

pub use linear::TriadCovariance;
pub use refusal::Refusal;

/// Names of the three axes of a triad, in order.
pub const AXES: [&str; 3] = ["x", "y", "z"];
