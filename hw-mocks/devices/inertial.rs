//! Gyroscopes, accelerometers and magnetometer: `N = M f + b + noise`, for the gyroscopes with a g-sensitivity.
//!
//! # Where the numbers come from
//! The published results of five modules (table 2 of the module's specification) give for each the standard
//! deviation of 10-second means over an hour (bias stability) and of 10-minute means after power cycles (bias
//! repeatability). A sensor has here white noise of density `N`, a Gauss-Markov bias of correlation time `T`, and
//! a bias drawn at each power-on; the last two follow from the published figures:
//! `slow^2 d(10 s)^2 = stability^2 - N^2/10 s`, `turn_on^2 = repeatability^2 - slow^2 d(600 s)^2 - N^2/600 s`, with
//! `d(t)` the deviation of a mean over `t` of a unit Gauss-Markov process.
//!
//! | number | gyroscope | accelerometer | from |
//! | --- | --- | --- | --- |
//! | stability, repeatability | 4.5995, 1.2403 deg/h (module 1) | 0.2423, 0.0726 mg | table 2 |
//! | white noise `N` | 0.15 deg/sqrt(h) = 9 deg/h sqrt(s) | 0.1 mg sqrt(s) | below the best module of the table at 10 s |
//! | correlation time `T` | 15 s | 8 s | the longest that keeps the table's repeatability below its stability |
//! | fixed bias, X Y Z | 0.08, -0.05, 0.06 deg/s | 5, -8, 6 mg | usual for MEMS parts before calibration |
//! | scale error, X Y Z | 0.21, -0.14, 0.08 % | 0.12, -0.09, 0.16 % | as above |
//! | misalignment | up to 1.6 mrad | up to 1.4 mrad | as above; above the published coupling, which holds after compensation |
//! | g-sensitivity | up to 0.012 deg/s/g | - | as above |
//! | temperature | 0.0008 deg/s/K | 0.03 mg/K, scale 30 ppm/K | small enough for the published hour after settling |
//!
//! The magnetometer has 60 microgauss of white noise at 200 Hz (half the published resolution), up to 0.02 gauss of
//! hard iron, 1.5 % of soft iron. A sample stands for the mean over its interval, so white noise grows with the
//! root of the rate. Codes are those of a 24-bit converter: they saturate, they do not wrap.

use gnc_protocol::stream::{ACCEL_LSB_PER_G, GYRO_LSB_PER_DPS, ImuSample, MAG_LSB_PER_GAUSS, SATURATION};
use nalgebra::{Matrix3, Vector3};

use crate::noise::{Dice, GaussMarkov, Source};
use crate::world::{Axis, Influence, STANDARD_GRAVITY};

/// Temperature at which the fixed errors are stated.
const REFERENCE_C: f64 = 25.0;

/// Errors and noise of three sensors of one kind, in their own unit (deg/s, g, gauss).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriadModel {
    /// Response: rows are sensors, columns axes; the identity is a perfect triad.
    pub response: Matrix3<f64>,
    /// Fixed bias at 25 degC.
    pub bias: Vector3<f64>,
    /// White noise: deviation of a mean over one second.
    pub white: f64,
    /// Deviation of the slow bias.
    pub slow: f64,
    /// Correlation time of the slow bias.
    pub correlation_s: f64,
    /// Deviation of the bias from power-on to power-on.
    pub turn_on: f64,
    /// Bias per kelvin.
    pub bias_per_k: f64,
    /// Relative change of the response per kelvin.
    pub response_per_k: f64,
}

impl TriadModel {
    /// Sets the noise from a published bias stability (10 s means over an hour) and bias repeatability (10 min
    /// means after power cycles), as the module's documentation derives it.
    #[must_use]
    pub fn with_published(mut self, stability: f64, repeatability: f64) -> Self {
        let mean = |span_s| GaussMarkov::deviation_of_mean(span_s, self.correlation_s);
        let slow = (stability.powi(2) - self.white.powi(2) / 10.0).max(0.0).sqrt() / mean(10.0);
        let rest = repeatability.powi(2) - (slow * mean(600.0)).powi(2) - self.white.powi(2) / 600.0;
        (self.slow, self.turn_on) = (slow, rest.max(0.0).sqrt());
        self
    }

    /// Gyroscopes of the kind published, deg/s, with module 1's figures in deg/h.
    #[must_use]
    pub fn gyroscopes(stability_dph: f64, repeatability_dph: f64) -> Self {
        Self {
            response: Matrix3::new(1.0021, 0.0009, -0.0012, -0.0014, 0.9986, 0.0007, 0.0011, -0.0016, 1.0008),
            bias: Vector3::new(0.08, -0.05, 0.06),
            white: 9.0 / 3600.0,
            slow: 0.0,
            correlation_s: 15.0,
            turn_on: 0.0,
            bias_per_k: 0.0008,
            response_per_k: 0.0,
        }
        .with_published(stability_dph / 3600.0, repeatability_dph / 3600.0)
    }

    /// Accelerometers of the kind published, g.
    #[must_use]
    pub fn accelerometers(stability_mg: f64, repeatability_mg: f64) -> Self {
        Self {
            response: Matrix3::new(1.0012, 0.0008, -0.0006, -0.0011, 0.9991, 0.0014, 0.0005, -0.0009, 1.0016),
            bias: Vector3::new(0.005, -0.008, 0.006),
            white: 0.1e-3,
            slow: 0.0,
            correlation_s: 8.0,
            turn_on: 0.0,
            bias_per_k: 0.03e-3,
            response_per_k: 30e-6,
        }
        .with_published(stability_mg * 1e-3, repeatability_mg * 1e-3)
    }

    /// The magnetometer, gauss: response is the soft iron, bias the hard iron.
    #[must_use]
    pub fn magnetometer() -> Self {
        Self {
            response: Matrix3::new(1.012, 0.006, -0.004, 0.006, 0.991, 0.005, -0.004, 0.005, 1.008),
            bias: Vector3::new(0.020, -0.014, 0.009),
            white: 60e-6 / 200.0_f64.sqrt(),
            slow: 0.0,
            correlation_s: 100.0,
            turn_on: 0.0,
            bias_per_k: 0.0,
            response_per_k: 0.0,
        }
    }
}

/// What is wrong with a triad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriadFaults {
    /// The converter of an axis repeats its first code for ever.
    pub stuck: [bool; 3],
    /// An axis gives no signal: its code is 0.
    pub dead: [bool; 3],
    /// Two axes arrive in each other's place.
    pub swapped: Option<(Axis, Axis)>,
    /// White noise is so many times the model's.
    pub noise_factor: f64,
    /// Added to the bias, in the sensors' unit.
    pub offset: Vector3<f64>,
}

impl Default for TriadFaults {
    fn default() -> Self {
        Self { stuck: [false; 3], dead: [false; 3], swapped: None, noise_factor: 1.0, offset: Vector3::zeros() }
    }
}

/// Three sensors of one kind.
#[derive(Debug, Clone)]
pub struct Triad {
    model: TriadModel,
    faults: TriadFaults,
    lsb_per_unit: f64,
    slow: [GaussMarkov; 3],
    turn_on: Vector3<f64>,
    first: Option<[i32; 3]>,
}

impl Triad {
    fn new(model: TriadModel, faults: TriadFaults, lsb_per_unit: f64, slow_dice: &mut Dice) -> Self {
        let slow = core::array::from_fn(|_| GaussMarkov::new(model.slow, model.correlation_s, slow_dice));
        Self { model, faults, lsb_per_unit, slow, turn_on: Vector3::zeros(), first: None }
    }

    fn power_on(&mut self, dice: &mut Dice) {
        self.turn_on = Vector3::from_fn(|_, _| self.model.turn_on * dice.normal());
        self.first = None;
    }

    /// The sensors' output without white noise, in their unit.
    fn output(&self, truth: &Vector3<f64>, temperature_c: f64) -> Vector3<f64> {
        let warmer_k = temperature_c - REFERENCE_C;
        let slow = Vector3::from_fn(|axis, _| self.slow[axis].value());
        self.model.response * truth * (1.0 + self.model.response_per_k * warmer_k)
            + self.model.bias
            + self.faults.offset
            + self.turn_on
            + slow
            + Vector3::repeat(self.model.bias_per_k * warmer_k)
    }

    /// One code of each sensor. Noise is drawn for every axis, whatever its faults, so that a fault of one axis
    /// leaves the noise of the others as it was.
    fn convert(&mut self, output: Vector3<f64>, rate_hz: f64, dice: &mut Dice) -> [i32; 3] {
        let white = self.model.white * self.faults.noise_factor * rate_hz.sqrt();
        let codes = output.map(|value| {
            let code = ((value + white * dice.normal()) * self.lsb_per_unit).round();
            code.clamp(-f64::from(SATURATION) - 1.0, f64::from(SATURATION)) as i32
        });
        let mut codes: [i32; 3] = codes.into();
        let first = *self.first.get_or_insert(codes);
        for axis in 0..3 {
            if self.faults.stuck[axis] {
                codes[axis] = first[axis];
            }
            if self.faults.dead[axis] {
                codes[axis] = 0;
            }
        }
        if let Some((one, other)) = self.faults.swapped {
            codes.swap(one.index(), other.index());
        }
        codes
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

impl Default for SensorModels {
    /// Module 1 of the published table.
    fn default() -> Self {
        Self {
            gyro: TriadModel::gyroscopes(4.5995, 1.2403),
            gyro_per_g: Matrix3::new(0.012, -0.004, 0.003, 0.002, -0.009, 0.005, -0.003, 0.004, 0.010),
            accel: TriadModel::accelerometers(0.2423, 0.0726),
            mag: TriadModel::magnetometer(),
        }
    }
}

/// Faults of all sensors of a module.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SensorFaults {
    /// Gyroscopes.
    pub gyro: TriadFaults,
    /// Accelerometers.
    pub accel: TriadFaults,
    /// Magnetometer.
    pub mag: TriadFaults,
}

/// The nine sensors and their two thermometers.
#[derive(Debug, Clone)]
pub struct Sensors {
    models: SensorModels,
    gyro: Triad,
    accel: Triad,
    mag: Triad,
    moved_at_s: f64,
    white_dice: Dice,
    slow_dice: Dice,
    turn_on_dice: Dice,
    temperature_dice: Dice,
}

impl Sensors {
    /// Sensors under a seed.
    #[must_use]
    pub fn new(models: SensorModels, faults: SensorFaults, seed: u64) -> Self {
        let mut slow_dice = Dice::new(seed, Source::SensorSlow);
        Self {
            models,
            gyro: Triad::new(models.gyro, faults.gyro, GYRO_LSB_PER_DPS, &mut slow_dice),
            accel: Triad::new(models.accel, faults.accel, ACCEL_LSB_PER_G, &mut slow_dice),
            mag: Triad::new(models.mag, faults.mag, MAG_LSB_PER_GAUSS, &mut slow_dice),
            moved_at_s: 0.0,
            white_dice: Dice::new(seed, Source::SensorWhite),
            slow_dice,
            turn_on_dice: Dice::new(seed, Source::TurnOn),
            temperature_dice: Dice::new(seed, Source::Temperature),
        }
    }

    /// Draws the biases of this power-on.
    pub fn power_on(&mut self) {
        for triad in [&mut self.gyro, &mut self.accel, &mut self.mag] {
            triad.power_on(&mut self.turn_on_dice);
        }
    }

    /// Takes one sample.
    pub fn sample(&mut self, influence: &Influence, now_s: f64, rate_hz: f64) -> ImuSample {
        let span_s = (now_s - self.moved_at_s).max(0.0);
        self.moved_at_s = now_s;
        for triad in [&mut self.gyro, &mut self.accel, &mut self.mag] {
            for slow in &mut triad.slow {
                slow.step(span_s, &mut self.slow_dice);
            }
        }
        let force_g = influence.force / STANDARD_GRAVITY;
        let rate_dps = influence.rate_rps.map(f64::to_degrees);
        let gyro = self.gyro.output(&rate_dps, influence.temperature_c) + self.models.gyro_per_g * force_g;
        let accel = self.accel.output(&force_g, influence.temperature_c);
        let mag = self.mag.output(&influence.field_gauss, influence.temperature_c);
        // Each kind has its own thermometer in its package; both read a little warm.
        let mut thermometer = |warm_k: f64| {
            ((influence.temperature_c + warm_k + 0.02 * self.temperature_dice.normal()) * 100.0).round() as i16
        };
        let (gyro_temperature, accel_temperature) = (thermometer(0.6), thermometer(0.4));
        ImuSample {
            gyro: self.gyro.convert(gyro, rate_hz, &mut self.white_dice),
            accel: self.accel.convert(accel, rate_hz, &mut self.white_dice),
            mag: self.mag.convert(mag, rate_hz, &mut self.white_dice),
            gyro_temperature,
            accel_temperature,
        }
    }

    /// The magnetometer's analogue outputs, gauss as the sensors see it; they saturate where the codes do.
    #[must_use]
    pub fn analogue_gauss(&self, influence: &Influence) -> Vector3<f64> {
        let range_gauss = f64::from(SATURATION) / MAG_LSB_PER_GAUSS;
        let output = self.mag.output(&influence.field_gauss, influence.temperature_c);
        output.map(|gauss| gauss.clamp(-range_gauss, range_gauss))
    }

    /// The models, for tests that know the truth.
    #[must_use]
    pub fn models(&self) -> &SensorModels {
        &self.models
    }
}
