//! Models of good modules, and the sources of their numbers.
//!
//! The published results of five modules (table 2 of the module's specification) give two figures for the X axis of
//! each: the standard deviation of 10-second means over an hour (bias stability) and of 10-minute means after power
//! cycles (bias repeatability). Y and Z are not published; their values are of the same kind and stated here
//! ([`PUBLISHED`]).
//!
//! | number | gyroscope | accelerometer | from |
//! | --- | --- | --- | --- |
//! | stability, repeatability | [`PUBLISHED`] | [`PUBLISHED`] | X: table 2; Y, Z: stated |
//! | white noise `N` | 0.15 deg/sqrt(h) = 9 deg/h sqrt(s) | 0.1 mg sqrt(s) | below the best axis at 10 s |
//! | correlation time of the slow noise | 15 s | 8 s | the longest that keeps the table's repeatability below its stability |
//! | fixed bias, X Y Z | 0.08, -0.05, 0.06 deg/s | 5, -8, 6 mg | usual for MEMS parts before calibration |
//! | scale error, X Y Z | 0.21, -0.14, 0.08 % | 0.12, -0.09, 0.16 % | as above |
//! | misalignment | up to 1.6 mrad | up to 1.4 mrad | as above; above the published coupling, which holds after compensation |
//! | g-sensitivity | up to 0.012 deg/s/g | - | as above |
//! | temperature | 0.0008 deg/s/K | 0.03 mg/K, scale 30 ppm/K | small enough for the published hour after settling |
//! | bandwidth | 80 Hz, two poles | 80 Hz, two poles | industrial gyroscopes with a digital output: the ADXRS453 is of the kind |
//!
//! The magnetometer has 60 microgauss of white noise at 200 Hz (half the published resolution), up to 0.02 gauss of
//! hard iron, 1.5 % of soft iron, 3 microgauss of slow noise with 20 s of correlation, 10 microgauss/K, and no
//! bandwidth limit at any rate. A sample stands for the mean over its interval, so white noise grows with the root of
//! the rate, as far as the bandwidth lets it. Codes are those of a 24-bit converter: they saturate and do not wrap.

use nalgebra::{Matrix3, Vector3};

use super::bandwidth::{Bandwidth, FilterOrder};
use super::noise::AxisNoise;

/// Temperature at which the fixed errors are stated.
pub(crate) const REFERENCE_C: f64 = 25.0;

/// White noise of the gyroscopes, deg/s sqrt(s).
const GYRO_WHITE: f64 = 9.0 / 3600.0;
/// White noise of the accelerometers, g sqrt(s).
const ACCEL_WHITE: f64 = 0.1e-3;

/// Slow noise of the magnetometer, gauss, and its bias per kelvin: usual for magnetoresistive parts with set and reset.
const MAG_SLOW: f64 = 3e-6;
const MAG_PER_K: f64 = 10e-6;

/// Low-pass of the inertial chips.
const INDUSTRIAL: Bandwidth = Bandwidth { cutoff_hz: 80.0, order: FilterOrder::Second };

/// Bias stability and repeatability of a kind of sensors, X, Y, Z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Published {
    /// Deviation of 10 s means over an hour.
    pub stability: [f64; 3],
    /// Deviation of 10 min means after power cycles.
    pub repeatability: [f64; 3],
}

/// Gyroscopes (deg/h) and accelerometers (mg) of the five modules.
pub const PUBLISHED: [(Published, Published); 5] = [
    (
        Published { stability: [4.5995, 5.12, 4.07], repeatability: [1.2403, 1.58, 1.36] },
        Published { stability: [0.2423, 0.2051, 0.2268], repeatability: [0.0726, 0.0583, 0.0641] },
    ),
    (
        Published { stability: [9.1226, 7.84, 6.91], repeatability: [2.3253, 1.99, 2.64] },
        Published { stability: [0.0769, 0.0912, 0.0835], repeatability: [0.0149, 0.0203, 0.0178] },
    ),
    (
        Published { stability: [7.1639, 6.38, 7.55], repeatability: [3.6547, 3.11, 2.85] },
        Published { stability: [0.0984, 0.0877, 0.1043], repeatability: [0.0515, 0.0436, 0.0472] },
    ),
    (
        Published { stability: [3.5815, 4.26, 3.93], repeatability: [4.7739, 3.92, 4.31] },
        Published { stability: [0.1241, 0.1135, 0.1212], repeatability: [0.0286, 0.0334, 0.0275] },
    ),
    (
        Published { stability: [8.2676, 7.02, 7.71], repeatability: [2.4729, 2.93, 2.16] },
        Published { stability: [0.0891, 0.0968, 0.0814], repeatability: [0.0259, 0.0217, 0.0305] },
    ),
];

/// Errors and noise of three sensors of one kind, in their own unit (deg/s, g, gauss).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriadModel {
    /// Response: rows are sensors, columns axes; the identity is a perfect triad.
    pub response: Matrix3<f64>,
    /// Fixed bias at 25 degC.
    pub bias: Vector3<f64>,
    /// Noise of each sensor.
    pub noise: [AxisNoise; 3],
    /// Bias per kelvin.
    pub bias_per_k: f64,
    /// Relative change of the response per kelvin.
    pub response_per_k: f64,
    /// Growth of the white noise: its deviation has the factor exp(this times the kelvins above 25 degC).
    pub noise_per_k: Vector3<f64>,
    /// Low-pass in the chip; `None`: its effect is negligible.
    pub bandwidth: Option<Bandwidth>,
    /// Conversions of the chip a second; `None`: one for each read.
    pub update_rate_hz: Option<f64>,
}

impl TriadModel {
    /// Sets the noise from bias stabilities and repeatabilities, in the sensors' unit; see [`AxisNoise::published`].
    #[must_use]
    pub(crate) fn with_published(mut self, published: &Published) -> Self {
        self.noise = core::array::from_fn(|axis| {
            let AxisNoise { white, correlation_s, .. } = self.noise[axis];
            AxisNoise::published(white, correlation_s, published.stability[axis], published.repeatability[axis])
        });
        self
    }

    /// Gyroscopes like the published ones, deg/s, from figures in deg/h.
    #[must_use]
    pub fn gyroscopes(published: &Published) -> Self {
        let noise = [AxisNoise { white: GYRO_WHITE, correlation_s: 15.0, ..AxisNoise::default() }; 3];
        Self {
            response: Matrix3::new(1.0021, 0.0009, -0.0012, -0.0014, 0.9986, 0.0007, 0.0011, -0.0016, 1.0008),
            bias: Vector3::new(0.08, -0.05, 0.06),
            noise,
            bias_per_k: 0.0008,
            response_per_k: 0.0,
            noise_per_k: Vector3::zeros(),
            bandwidth: Some(INDUSTRIAL),
            update_rate_hz: None,
        }
        .with_published(&published.scaled(1.0 / 3600.0))
    }

    /// Accelerometers like the published ones, g, from figures in mg.
    #[must_use]
    pub fn accelerometers(published: &Published) -> Self {
        let noise = [AxisNoise { white: ACCEL_WHITE, correlation_s: 8.0, ..AxisNoise::default() }; 3];
        Self {
            response: Matrix3::new(1.0012, 0.0008, -0.0006, -0.0011, 0.9991, 0.0014, 0.0005, -0.0009, 1.0016),
            bias: Vector3::new(0.005, -0.008, 0.006),
            noise,
            bias_per_k: 0.03e-3,
            response_per_k: 30e-6,
            noise_per_k: Vector3::zeros(),
            bandwidth: Some(INDUSTRIAL),
            update_rate_hz: None,
        }
        .with_published(&published.scaled(1e-3))
    }

    /// The magnetometer, gauss: response is the soft iron, bias the hard iron.
    #[must_use]
    pub(crate) fn magnetometer() -> Self {
        let white = 60e-6 / 200.0_f64.sqrt();
        Self {
            response: Matrix3::new(1.012, 0.006, -0.004, 0.006, 0.991, 0.005, -0.004, 0.005, 1.008),
            bias: Vector3::new(0.020, -0.014, 0.009),
            noise: [AxisNoise { white, slow: MAG_SLOW, correlation_s: 20.0, ..AxisNoise::default() }; 3],
            bias_per_k: MAG_PER_K,
            response_per_k: 0.0,
            noise_per_k: Vector3::zeros(),
            bandwidth: None,
            update_rate_hz: None,
        }
    }
}

impl Published {
    /// The same figures in another unit.
    #[must_use]
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        let scale = |values: [f64; 3]| values.map(|value| value * factor);
        Self { stability: scale(self.stability), repeatability: scale(self.repeatability) }
    }
}

/// Models of all sensors of a module.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorModels {
    /// Gyroscopes, deg/s.
    pub gyro: TriadModel,
    /// Deg/s per g: rows are sensors, columns axes.
    pub gyro_per_g: Matrix3<f64>,
    /// Accelerometers, g.
    pub accel: TriadModel,
    /// Magnetometer, gauss.
    pub mag: TriadModel,
}

impl SensorModels {
    /// A module with the noise of one of [`PUBLISHED`].
    #[must_use]
    pub fn published((gyro, accel): &(Published, Published)) -> Self {
        Self {
            gyro: TriadModel::gyroscopes(gyro),
            gyro_per_g: Matrix3::new(0.012, -0.004, 0.003, 0.002, -0.009, 0.005, -0.003, 0.004, 0.010),
            accel: TriadModel::accelerometers(accel),
            mag: TriadModel::magnetometer(),
        }
    }
}

impl Default for SensorModels {
    /// Module 1 of the published table.
    fn default() -> Self {
        Self::published(&PUBLISHED[0])
    }
}
