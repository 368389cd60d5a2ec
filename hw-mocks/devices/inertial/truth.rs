//! The true properties of the sensors, in the terms of a calibration, for tests that know the truth. They must not
//! reach the station.

use nalgebra::{Matrix3, Vector3};

/// A triad at one moment: `N = lsb_per_unit (response f + bias + slow) + white noise`, f in the sensors' unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriadTruth {
    /// Rows are sensors, columns axes; it includes the effects of this power-on and of the temperature.
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
