//! Bias and g-sensitivity of a gyroscope triad from still positions: `w_out = b + G f` after the earth's rotation is
//! subtracted.
//!
//! At rest `f = g u` with u up, and the vertical part of the earth's rotation is parallel to u. Without a correction
//! the fit would take it for g-sensitivity (0.86 deg/h per m/s^2 at 34 degrees). The correction needs the latitude
//! only. The horizontal part needs the heading of each position. Where that is not known, nothing is corrected, and the
//! bound of the part is given as a type-B contribution.

use nalgebra::{Matrix3, Matrix4, Vector3};

use crate::{
    AXES, Refusal, earth,
    position::Position,
    series,
    six_position::{TriadFit, resolution},
    stats,
};

/// The equation of the parameters.
pub const EQUATION: &str = "w_out = w + bias + g_sensitivity f, bias measured less true; rad/s and m/s^2";

/// The result of `calibrate`.
#[derive(Debug, Clone, PartialEq)]
pub struct StillGyro {
    /// Bias b, measured less true, rad/s: mean output without rotation and without specific force.
    pub bias_rps: Vector3<f64>,
    /// G, (rad/s) per (m/s^2); rows are sensors.
    pub g_sensitivity: Matrix3<f64>,
    /// Standard uncertainty of the bias (type A), rad/s.
    pub bias_sd_rps: Vector3<f64>,
    /// Standard uncertainty of `g_sensitivity` (type A).
    pub g_sensitivity_sd: Matrix3<f64>,
    /// Covariance of one sensor's row of `g_sensitivity` and its bias (type A); the same for all sensors, which are
    /// independent.
    pub covariance: Matrix4<f64>,
    /// Largest error of each bias from the horizontal earth rate where headings are unknown, rad/s; 0 where known.
    pub bias_heading_bound_rps: f64,
    /// Largest such error of each element of `g_sensitivity`.
    pub g_sensitivity_heading_bound: f64,
    /// Residual of each position, rad/s.
    pub residuals_rps: Vec<Vector3<f64>>,
    /// Root mean square of all residuals, rad/s.
    pub residual_rms_rps: f64,
    /// Condition number of the scaled design.
    pub condition: f64,
    /// Degrees of freedom: `3 n - 12`.
    pub dof: usize,
}

impl StillGyro {
    /// Factor of the 95 % intervals of the type-A part (Student's t).
    #[must_use]
    pub fn coverage_factor(&self) -> f64 {
        stats::coverage_factor(0.95, self.dof as f64)
    }

    /// Expanded uncertainties (95 %, type A) of bias and g-sensitivity. The bounds for unknown headings come on top.
    #[must_use]
    pub fn expanded(&self) -> (Vector3<f64>, Matrix3<f64>) {
        (self.bias_sd_rps * self.coverage_factor(), self.g_sensitivity_sd * self.coverage_factor())
    }
}

/// Computes bias and g-sensitivity from the means of still positions, in rad/s. `north` holds, for each position, the
/// unit vector to true north in the axes of the fixture, where the headings are known.
///
/// # Errors
/// As [`crate::six_position::calibrate`]; [`Refusal::Constant`] for a dead sensor, which shows one value in all
/// positions, so that its bias would have no uncertainty; [`Refusal::Lengths`] when `north` does not fit the positions.
pub fn calibrate(
    positions: &[Position],
    gravity_mps2: f64,
    latitude_deg: f64,
    north: Option<&[Vector3<f64>]>,
) -> Result<StillGyro, Refusal> {
    series::positive("gravity (m/s^2)", gravity_mps2)?;
    if let Some(north) = north.filter(|n| n.len() != positions.len()) {
        return Err(Refusal::Lengths { left: positions.len(), right: north.len() });
    }
    for (i, axis) in AXES.into_iter().enumerate() {
        if positions.len() > 1 && positions.iter().all(|p| p.mean[i] == positions[0].mean[i]) {
            let samples = positions.iter().map(|p| p.rows).sum();
            return Err(Refusal::Constant { channel: axis.to_owned(), samples, value: positions[0].mean[i] });
        }
    }
    let vertical = earth::vertical_rate_rps(latitude_deg)?;
    let horizontal = earth::north_rate_rps(latitude_deg)?;
    let mut still = positions.to_vec();
    for (i, position) in still.iter_mut().enumerate() {
        position.mean -= vertical * position.up;
        if let Some(north) = north {
            position.mean -= horizontal * north[i];
        }
    }
    let fit = TriadFit::solve(&still, gravity_mps2)?;
    let n = still.len();
    let dof = 3 * n - 12;
    let squares: f64 = fit.residuals.iter().map(Vector3::norm_squared).sum();
    let of_steps = Matrix4::from_diagonal(&(fit.reach * resolution(positions).max()).map(|worst| worst * worst));
    let covariance: Matrix4<f64> = fit.cofactor.fixed_view::<4, 4>(0, 0) * (squares / dof as f64) + of_steps;
    let sd = |k: usize| covariance[(k, k)].sqrt();
    // Worst case: every position contributes the full horizontal rate with the worst sign. For a parameter
    // `a = sum w_r y_r` the worst case is the 1-norm of w. Its bound is sqrt(n) times the 2-norm of w, and the cofactor
    // gives the 2-norm.
    let bound = |k: usize| {
        if north.is_some() { 0.0 } else { horizontal * (n as f64 * fit.cofactor[(k, k)]).sqrt() }
    };
    Ok(StillGyro {
        bias_rps: fit.offset,
        g_sensitivity: fit.matrix,
        bias_sd_rps: Vector3::repeat(sd(3)),
        g_sensitivity_sd: Matrix3::from_fn(|_, j| sd(j)),
        covariance,
        bias_heading_bound_rps: bound(3),
        g_sensitivity_heading_bound: (0..3).map(bound).fold(0.0, f64::max),
        residual_rms_rps: (squares / (3 * n) as f64).sqrt(),
        residuals_rps: fit.residuals,
        condition: fit.condition,
        dof,
    })
}
