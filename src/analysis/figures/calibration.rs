//! The calibration that items find and later items work with. The JSON form is exact: numbers keep all their bits.

use gnc_executive::catalogue::ItemId;
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::json::{of_rows, rows};
use super::{FigureError, Findings};
use crate::details::DetailsPart;

/// The part of a module's calibration that an item found.
pub const CALIBRATION: DetailsPart<ModuleCalibration> = DetailsPart::new("calibration");
/// The coefficients for the module.
pub const COEFFICIENTS: DetailsPart<ModuleCoefficients> = DetailsPart::new("coefficients");

/// The calibration of a module as far as it is known. Matrices are stored row by row: rows are sensors, columns axes. N
/// is the raw output in counts, f the specific force in m/s^2, w the angular rate in rad/s.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModuleCalibration {
    /// Accelerometers, from `six-position`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accel: Option<AccelCalibration>,
    /// Gyroscopes at rest, from `gyro-still`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gyro_still: Option<GyroStillCalibration>,
    /// Gyroscopes turned, from `rotation`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gyro_scale: Option<GyroScale>,
    /// Magnetometer, from `magnetometer-ellipse`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mag: Option<Mag>,
}

/// Accelerometers: `f = Ka N + nabla`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AccelCalibration {
    /// Ka, m/s^2 per count.
    pub matrix: [[f64; 3]; 3],
    /// nabla, m/s^2.
    pub offset: [f64; 3],
}

/// Gyroscopes at rest: b and G of `N = S w + b + G f`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GyroStillCalibration {
    /// b, counts.
    pub bias: [f64; 3],
    /// G, counts per m/s^2.
    pub per_force: [[f64; 3]; 3],
}

/// Gyroscopes turned: S of `N = S w + b + G f`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GyroScale {
    /// S, counts per rad/s.
    pub response: [[f64; 3]; 3],
    /// Kg, the inverse of S, rad/s per count.
    pub matrix: [[f64; 3]; 3],
}

/// Magnetometer in its plane of rotation: `y' = ky (y - dy)`, `x' = ((x - dx) - y' sin_alpha) / cos(alpha)`, in gauss at
/// nominal scale.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mag {
    /// Zero of x, gauss.
    pub dx: f64,
    /// Zero of y, gauss.
    pub dy: f64,
    /// Factor on y.
    pub ky: f64,
    /// Sine of the departure from a right angle.
    pub sin_alpha: f64,
}

impl ModuleCalibration {
    /// Collects the calibration from all items so far. The newest item counts for each part.
    ///
    /// # Errors
    /// [`FigureError::BadCalibration`] for details that are not a calibration.
    pub fn of(earlier: &[(String, Findings)]) -> Result<Self, FigureError> {
        let mut all = Self::default();
        for (name, findings) in earlier {
            let Some(found) = findings.details.get(CALIBRATION.key()) else { continue };
            let found: Self = serde_json::from_value(found.clone())
                .map_err(|error| FigureError::BadCalibration { item: name.clone(), why: error.to_string() })?;
            all.accel = found.accel.or(all.accel);
            all.gyro_still = found.gyro_still.or(all.gyro_still);
            all.gyro_scale = found.gyro_scale.or(all.gyro_scale);
            all.mag = found.mag.or(all.mag);
        }
        Ok(all)
    }

    /// Returns the compensation of the accelerometers.
    ///
    /// # Errors
    /// [`FigureError::NotCalibrated`] names the item to run first.
    pub(super) fn force(&self) -> Result<Force, FigureError> {
        let accel = self.accel.ok_or(FigureError::NotCalibrated { item: ItemId::SixPosition })?;
        Ok(Force { matrix: of_rows(&accel.matrix), offset: Vector3::from(accel.offset) })
    }

    /// Returns the compensation of the gyroscopes.
    ///
    /// # Errors
    /// [`FigureError::NotCalibrated`] names the item to run first.
    pub(super) fn rate(&self) -> Result<RateModel, FigureError> {
        let still = self.gyro_still.ok_or(FigureError::NotCalibrated { item: ItemId::GyroStill })?;
        let scale = self.gyro_scale.ok_or(FigureError::NotCalibrated { item: ItemId::Rotation })?;
        let matrix = of_rows(&scale.matrix);
        let (epsilon, gamma) = (matrix * Vector3::from(still.bias), matrix * of_rows(&still.per_force));
        Ok(RateModel { force: self.force()?, matrix, epsilon, gamma })
    }
}

/// The compensation `f = Ka N + nabla`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Force {
    pub(super) matrix: Matrix3<f64>,
    offset: Vector3<f64>,
}

impl Force {
    /// Returns the specific force, m/s^2, of a raw output or of a mean of outputs: the compensation is linear.
    pub(super) fn of(&self, accel: &Vector3<f64>) -> Vector3<f64> {
        self.matrix * accel + self.offset
    }
}

/// The compensation `w = Kg N - epsilon - Gamma f`, with `epsilon = Kg b`, `Gamma = Kg G`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RateModel {
    force: Force,
    pub(super) matrix: Matrix3<f64>,
    pub(super) epsilon: Vector3<f64>,
    pub(super) gamma: Matrix3<f64>,
}

impl RateModel {
    /// Returns the angular rate, rad/s, of raw outputs of the same instant or of their means.
    pub(super) fn of(&self, gyro: &Vector3<f64>, accel: &Vector3<f64>) -> Vector3<f64> {
        self.matrix * gyro - self.epsilon - self.gamma * self.force.of(accel)
    }
}

/// The coefficients that a module keeps, in the order of its message.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModuleCoefficients {
    /// Ka of `f = Ka N + nabla`, m/s^2 per count.
    pub accel_matrix: [[f64; 3]; 3],
    /// nabla, m/s^2.
    pub accel_offset: [f64; 3],
    /// Kg of `w = Kg N - epsilon - Gamma f`, rad/s per count.
    pub gyro_matrix: [[f64; 3]; 3],
    /// epsilon, rad/s.
    pub gyro_offset: [f64; 3],
    /// Gamma, rad/s per m/s^2.
    pub gyro_per_force: [[f64; 3]; 3],
    /// Correction of the magnetometer; that of a perfect one where it was not calibrated.
    pub mag: Mag,
}

impl ModuleCoefficients {
    /// Takes the coefficients from a calibration. Accelerometers and gyroscopes are required.
    ///
    /// # Errors
    /// [`FigureError::NotCalibrated`] names the item to run first.
    pub fn of(calibration: &ModuleCalibration) -> Result<Self, FigureError> {
        let (force, rate) = (calibration.force()?, calibration.rate()?);
        Ok(Self {
            accel_matrix: rows(&force.matrix),
            accel_offset: force.offset.into(),
            gyro_matrix: rows(&rate.matrix),
            gyro_offset: rate.epsilon.into(),
            gyro_per_force: rows(&rate.gamma),
            mag: calibration.mag.unwrap_or(Mag { dx: 0.0, dy: 0.0, ky: 1.0, sin_alpha: 0.0 }),
        })
    }

    /// Returns the number of coefficients.
    #[must_use]
    pub(crate) fn count(&self) -> u64 {
        3 * 9 + 2 * 3 + 4
    }
}
