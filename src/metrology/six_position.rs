//! Calibration of an accelerometer triad in six positions, or in any known attitudes.
//!
//! The print (Cheng et al., *Computer Measurement & Control* 30(7), 2022, section 4.2) solves `F = [N 1] K`: it
//! regresses the known specific force on the noisy output. The noise is on the output, so the direct regression
//! `N = M f + b` is the better estimator. It is solved and then inverted. The result holds both.

use nalgebra::{DMatrix, Matrix3, Matrix4, Vector3, Vector4};

use crate::{AXES, Refusal, TriadCovariance, linear, position::Position, series, stats, triad};

/// The equation of the parameters.
pub const EQUATION: &str = "f = matrix N + nabla, bias = matrix bias_lsb = -nabla (measured less true); f in m/s^2, +g on the axis that points up at rest";

/// Largest distance of a position from the fit, over gravity (2.9 degrees). A position beyond it has a wrong label or
/// pose.
pub const POSE_LIMIT: f64 = 0.05;

/// The result of `calibrate`. Rows of matrices are the sensors x y z, columns the axes of the fixture.
#[derive(Debug, Clone, PartialEq)]
pub struct SixPositionCalibration {
    /// Gravity that was used, m/s^2.
    pub gravity_mps2: f64,
    /// Ka of `f = Ka N + nabla`, m/s^2 per LSB.
    pub matrix: Matrix3<f64>,
    /// nabla of the same equation, m/s^2: the constant that the compensation adds, the negative of the bias.
    pub nabla_mps2: Vector3<f64>,
    /// M of `N = M f + b`, LSB per m/s^2.
    pub response: Matrix3<f64>,
    /// b of the same equation, LSB: the bias, measured less true.
    pub bias_lsb: Vector3<f64>,
    /// Standard uncertainty of `matrix` (delta method).
    pub matrix_sd: Matrix3<f64>,
    /// Standard uncertainty of `nabla_mps2` and of the bias in m/s^2.
    pub bias_sd_mps2: Vector3<f64>,
    /// Standard uncertainty of `bias_lsb`.
    pub bias_sd_lsb: Vector3<f64>,
    /// Covariance of `matrix` (by rows) and `nabla_mps2`; the means of the positions are its only source (type A).
    pub covariance: TriadCovariance,
    /// `Ka` of the print's regression.
    pub matrix_as_printed: Matrix3<f64>,
    /// `nabla` of the print's regression, m/s^2.
    pub nabla_as_printed_mps2: Vector3<f64>,
    /// Residual of each position, `Ka N + nabla - f`, m/s^2.
    pub residuals_mps2: Vec<Vector3<f64>>,
    /// Root mean square of all residuals, m/s^2.
    pub residual_rms_mps2: f64,
    /// Condition number of the scaled design.
    pub condition: f64,
    /// Degrees of freedom of the residuals: `3 n - 12`.
    pub dof: usize,
}

impl SixPositionCalibration {
    /// Returns the bias, measured less true, m/s^2: `Ka b = -nabla`.
    #[must_use]
    pub fn bias_mps2(&self) -> Vector3<f64> {
        -self.nabla_mps2
    }

    /// Returns the response of sensor i to axis j relative to its own axis, `M_ij / M_ii`, relative to the fixture.
    #[must_use]
    pub fn coupling(&self) -> Matrix3<f64> {
        triad::coupling(&self.response)
    }

    /// Returns the departures of the angles between the sensing axes xy, xz, yz from 90 degrees, rad (positive: less
    /// than 90). They do not depend on how the module sits in the socket.
    #[must_use]
    pub fn nonorthogonality_rad(&self) -> Vector3<f64> {
        triad::nonorthogonality_rad(&self.response)
    }

    /// Returns the factor of the 95 % intervals: `U = factor * sd` (Student's t).
    #[must_use]
    pub fn coverage_factor(&self) -> f64 {
        stats::coverage_factor(0.95, self.dof as f64)
    }

    /// Returns the expanded uncertainties (95 %) of matrix and bias.
    #[must_use]
    pub fn expanded(&self) -> (Matrix3<f64>, Vector3<f64>) {
        (self.matrix_sd * self.coverage_factor(), self.bias_sd_mps2 * self.coverage_factor())
    }

    /// Returns the specific force of an output, m/s^2.
    #[must_use]
    pub fn compensate(&self, output: &Vector3<f64>) -> Vector3<f64> {
        self.matrix * output + self.nabla_mps2
    }
}

/// Computes the calibration from the means of still positions.
///
/// Each sensor is a regression of its own. The residual variance is pooled over the three sensors in m/s^2: this takes
/// their noise as equal in that unit, whatever their scale factors are.
///
/// # Errors
/// [`Refusal::TooFew`] below five positions, [`Refusal::IllConditioned`] for attitudes that do not span space,
/// [`Refusal::WrongSign`], [`Refusal::WrongAxis`] and [`Refusal::PoseResidual`] for wrong labels.
pub fn calibrate(positions: &[Position], gravity_mps2: f64) -> Result<SixPositionCalibration, Refusal> {
    series::positive("gravity (m/s^2)", gravity_mps2)?;
    let fit = TriadFit::solve(positions, gravity_mps2)?;
    let response = fit.matrix;
    check_axes(&response)?;
    let Some(matrix) = response.try_inverse() else {
        return Err(Refusal::IllConditioned { what: "the inverse response", condition: f64::INFINITY, limit: 1e4 });
    };
    let nabla_mps2 = -matrix * fit.offset;

    let residuals_mps2: Vec<Vector3<f64>> = fit.residuals.iter().map(|r| matrix * r).collect();
    let limit = POSE_LIMIT * gravity_mps2;
    let worst = residuals_mps2.iter().zip(positions).max_by(|a, b| a.0.norm().total_cmp(&b.0.norm()));
    if let Some((residual, position)) = worst.filter(|(r, _)| r.norm() > limit) {
        return Err(Refusal::PoseResidual { position: position.label.clone(), residual: residual.norm(), limit });
    }

    // Pooled variance in m/s^2. In LSB each sensor takes it times its own scale factor.
    let own = Vector3::from_fn(|i, _| response[(i, i)]);
    let squares: f64 = fit.residuals.iter().map(|r| r.component_div(&own).norm_squared()).sum();
    let dof = 3 * positions.len() - 12;
    let variance = squares / dof as f64;
    let resolution = resolution(positions);
    let covariance = [0, 1, 2].map(|i| {
        let of_steps = Matrix4::from_diagonal(&(fit.reach * resolution[i]).map(|worst| worst * worst));
        fit.cofactor.fixed_view::<4, 4>(0, 0) * (variance * own[i] * own[i]) + of_steps
    });
    let bias_sd_lsb = Vector3::from_fn(|i, _| covariance[i][(3, 3)].sqrt());
    let covariance = linear::inverse_covariance(&matrix, &nabla_mps2.push(1.0), &covariance);
    let (matrix_sd, bias_sd_mps2) = linear::standard_uncertainties(&covariance);
    let (matrix_as_printed, nabla_as_printed_mps2) = as_printed(positions, gravity_mps2)?;
    let total: f64 = residuals_mps2.iter().map(Vector3::norm_squared).sum();
    Ok(SixPositionCalibration {
        gravity_mps2,
        matrix,
        nabla_mps2,
        response,
        bias_lsb: fit.offset,
        matrix_sd,
        bias_sd_mps2,
        bias_sd_lsb,
        covariance,
        matrix_as_printed,
        nabla_as_printed_mps2,
        residual_rms_mps2: (total / (3 * positions.len()) as f64).sqrt(),
        residuals_mps2,
        condition: fit.condition,
        dof,
    })
}

/// The error that the steps of the output leave in a mean of each sensor, in its unit. The error may be the same in all
/// positions across a sensor, so that the residuals do not show it.
pub(crate) fn resolution(positions: &[Position]) -> Vector3<f64> {
    positions.iter().fold(Vector3::zeros(), |largest, position| largest.sup(&position.resolution_sd))
}

/// The print's regression of the specific force on the output.
fn as_printed(positions: &[Position], gravity: f64) -> Result<(Matrix3<f64>, Vector3<f64>), Refusal> {
    let n = positions.len();
    let design = DMatrix::from_fn(n, 4, |r, c| if c < 3 { positions[r].mean[c] } else { 1.0 });
    let data = DMatrix::from_fn(n, 3, |r, c| gravity * positions[r].up[c]);
    let k = linear::least_squares("the print's calibration matrix", &design, &data)?.solution;
    Ok((Matrix3::from_fn(|i, j| k[(j, i)]), Vector3::from_fn(|i, _| k[(3, i)])))
}

/// Checks that every sensor answers positively, and to its own axis most.
fn check_axes(response: &Matrix3<f64>) -> Result<(), Refusal> {
    for (i, axis) in AXES.into_iter().enumerate() {
        let own = response[(i, i)];
        for (j, other) in AXES.into_iter().enumerate() {
            let cross = response[(i, j)];
            if j != i && cross.abs() > own.abs() {
                return Err(Refusal::WrongAxis { axis, own, other, cross });
            }
        }
        if own <= 0.0 {
            return Err(Refusal::WrongSign { axis, response: own });
        }
    }
    Ok(())
}

/// A least-squares fit of `output = matrix * (gravity * up) + offset` for each sensor.
pub(crate) struct TriadFit {
    pub(crate) matrix: Matrix3<f64>,
    pub(crate) offset: Vector3<f64>,
    pub(crate) residuals: Vec<Vector3<f64>>,
    /// Cofactor of the four parameters of a sensor.
    pub(crate) cofactor: DMatrix<f64>,
    /// Largest error of each parameter where every mean is off by 1, with the worst signs.
    pub(crate) reach: Vector4<f64>,
    pub(crate) condition: f64,
}

impl TriadFit {
    pub(crate) fn solve(positions: &[Position], gravity: f64) -> Result<Self, Refusal> {
        let n = positions.len();
        if n < 5 {
            return Err(Refusal::TooFew { what: "still positions".to_owned(), got: n, needed: 5 });
        }
        let design = DMatrix::from_fn(n, 4, |r, c| if c < 3 { gravity * positions[r].up[c] } else { 1.0 });
        // A common level of each sensor is subtracted, so that a large offset costs no digits.
        let level = positions.iter().map(|p| p.mean).sum::<Vector3<f64>>() / n as f64;
        let data = DMatrix::from_fn(n, 3, |r, c| positions[r].mean[c] - level[c]);
        let fit = linear::least_squares("the response to gravity", &design, &data)?;
        Ok(Self {
            matrix: Matrix3::from_fn(|i, j| fit.solution[(j, i)]),
            offset: Vector3::from_fn(|i, _| fit.solution[(3, i)] + level[i]),
            residuals: (0..n).map(|r| Vector3::from_fn(|i, _| fit.residuals[(r, i)])).collect(),
            cofactor: fit.cofactor,
            reach: fit.reach.fixed_rows::<4>(0).into(),
            condition: fit.condition,
        })
    }
}
