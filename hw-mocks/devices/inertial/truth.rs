//! What the sensors are really like, in the words of a calibration: for tests that know the truth. Nothing of it may
//! reach the station.

use nalgebra::{Matrix3, Vector3};

use crate::world::STANDARD_GRAVITY;

/// A triad at one moment: `N = lsb_per_unit (response f + bias + slow) + white noise`, f in the sensors' unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriadTruth {
    /// Rows are sensors, columns axes; with what this power-on and the temperature make of it.
    pub response: Matrix3<f64>,
    /// Bias with turn-on, drift and temperature, in the sensors' unit.
    pub bias: Vector3<f64>,
    /// Slow and flicker noise, in the sensors' unit.
    pub slow: Vector3<f64>,
    /// Nominal scale, counts for one unit.
    pub lsb_per_unit: f64,
}

/// All sensors at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrueSensors {
    /// Gyroscopes, deg/s.
    pub gyro: TriadTruth,
    /// Deg/s per g: rows are sensors, columns axes.
    pub gyro_per_g: Matrix3<f64>,
    /// Accelerometers, g.
    pub accel: TriadTruth,
    /// Magnetometer, gauss.
    pub mag: TriadTruth,
}

/// The coefficients that compensate a module exactly, but for its noise:
/// `f = Ka N + nabla`, `w = Kg N - epsilon - Gamma f`, m/s^2 and rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrueCalibration {
    /// Ka, m/s^2 per count.
    pub accel_matrix: Matrix3<f64>,
    /// nabla, m/s^2.
    pub accel_offset: Vector3<f64>,
    /// Kg, rad/s per count.
    pub gyro_matrix: Matrix3<f64>,
    /// epsilon, rad/s.
    pub gyro_offset: Vector3<f64>,
    /// Gamma, rad/s per m/s^2.
    pub gyro_per_force: Matrix3<f64>,
}

impl TrueSensors {
    /// The exact compensation; `None` where a response has no inverse.
    #[must_use]
    pub fn calibration(&self) -> Option<TrueCalibration> {
        let (accel, gyro) = (self.accel.response.try_inverse()?, self.gyro.response.try_inverse()?);
        let rps = 1.0_f64.to_radians();
        Some(TrueCalibration {
            accel_matrix: accel * (STANDARD_GRAVITY / self.accel.lsb_per_unit),
            accel_offset: -(accel * self.accel.bias) * STANDARD_GRAVITY,
            gyro_matrix: gyro * (rps / self.gyro.lsb_per_unit),
            gyro_offset: gyro * self.gyro.bias * rps,
            gyro_per_force: gyro * self.gyro_per_g * (rps / STANDARD_GRAVITY),
        })
    }
}
