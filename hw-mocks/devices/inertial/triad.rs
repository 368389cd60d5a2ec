//! Three sensors of one kind: from what acts on them to codes, with their faults.

use gnc_protocol::stream::SATURATION;
use nalgebra::{Matrix3, Vector3};

use super::model::{REFERENCE_C, TriadModel};
use super::noise::SlowNoise;
use super::truth::TriadTruth;
use crate::noise::Dice;
use crate::world::Axis;

/// What is wrong with a triad. In the sensors' unit; zeros and `None` are good sensors.
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
    /// Added to the bias.
    pub offset: Vector3<f64>,
    /// The bias runs away by this in an hour, from each power-on on.
    pub drift_per_h: Vector3<f64>,
    /// Relative deviation of the scale factor from power-on to power-on.
    pub scale_turn_on: Vector3<f64>,
    /// Deviation of the response of X to the Y axis from power-on to power-on.
    pub coupling_turn_on: f64,
    /// Inputs along the axis smaller than this give nothing.
    pub deadband: Vector3<f64>,
    /// The signal moves in steps of this size; noise comes behind.
    pub step: Vector3<f64>,
    /// Outputs beyond this read as the end of the converter.
    pub range: Vector3<f64>,
}

impl Default for TriadFaults {
    fn default() -> Self {
        let none = Vector3::zeros();
        Self {
            stuck: [false; 3],
            dead: [false; 3],
            swapped: None,
            noise_factor: 1.0,
            offset: none,
            drift_per_h: none,
            scale_turn_on: none,
            coupling_turn_on: 0.0,
            deadband: none,
            step: none,
            range: none,
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
    /// The magnetometer's Y is sampled so much later than the rest.
    pub mag_y_skew_us: f64,
}

/// Three sensors of one kind.
#[derive(Debug, Clone)]
pub(super) struct Triad {
    model: TriadModel,
    faults: TriadFaults,
    lsb_per_unit: f64,
    slow: [SlowNoise; 3],
    turn_on: Vector3<f64>,
    drift: Vector3<f64>,
    /// The model's response with what this power-on made of it.
    response: Matrix3<f64>,
    first: Option<[i32; 3]>,
    /// Whether codes need a second look.
    altered: bool,
    white_lsb: Vector3<f64>,
    white_rate_hz: f64,
}

impl Triad {
    pub(super) fn new(model: TriadModel, faults: TriadFaults, lsb_per_unit: f64, slow_dice: &mut Dice) -> Self {
        let alters = faults.stuck != [false; 3] || faults.dead != [false; 3] || faults.swapped.is_some();
        Self {
            model,
            faults,
            lsb_per_unit,
            slow: model.noise.map(|noise| SlowNoise::new(&noise, slow_dice)),
            turn_on: Vector3::zeros(),
            drift: Vector3::zeros(),
            response: model.response,
            first: None,
            altered: alters || faults.range != Vector3::zeros(),
            white_lsb: Vector3::zeros(),
            white_rate_hz: 0.0,
        }
    }

    pub(super) fn power_on(&mut self, dice: &mut Dice) {
        self.turn_on = Vector3::from_fn(|axis, _| self.model.noise[axis].turn_on * dice.normal());
        // Drawn in every module, so that a fault leaves the other draws as they are.
        let scale = Vector3::from_fn(|axis, _| 1.0 + self.faults.scale_turn_on[axis] * dice.normal());
        self.response = Matrix3::from_diagonal(&scale) * self.model.response;
        self.response[(0, 1)] += self.faults.coupling_turn_on * dice.normal();
        self.drift = Vector3::zeros();
        self.first = None;
    }

    /// Slow noise and drift: `span_s` have passed, the module is under power for `powered_s`.
    pub(super) fn move_slowly(&mut self, span_s: f64, powered_s: f64, dice: &mut Dice) {
        for slow in &mut self.slow {
            slow.step(span_s, dice);
        }
        self.drift = self.faults.drift_per_h * (powered_s / 3600.0);
    }

    /// Response and bias at a temperature.
    pub(super) fn truth(&self, temperature_c: f64) -> TriadTruth {
        let warmer_k = temperature_c - REFERENCE_C;
        TriadTruth {
            response: self.response * (1.0 + self.model.response_per_k * warmer_k),
            bias: self.model.bias
                + self.faults.offset
                + self.turn_on
                + self.drift
                + Vector3::repeat(self.model.bias_per_k * warmer_k),
            slow: Vector3::from_fn(|axis, _| self.slow[axis].value()),
            lsb_per_unit: self.lsb_per_unit,
        }
    }

    /// The sensors' output without white noise, in their unit.
    pub(super) fn output(&self, input: &Vector3<f64>, temperature_c: f64) -> Vector3<f64> {
        let truth = self.truth(temperature_c);
        let felt = Vector3::from_fn(|axis, _| self.feel(input[axis], axis));
        truth.response * felt + truth.bias + truth.slow
    }

    fn feel(&self, input: f64, axis: usize) -> f64 {
        let (deadband, step) = (self.faults.deadband[axis], self.faults.step[axis]);
        let felt = if input.abs() < deadband { 0.0 } else { input };
        if step > 0.0 { (felt / step).round() * step } else { felt }
    }

    /// One code of each sensor. Noise is drawn for every axis, whatever its faults, so that a fault of one axis
    /// leaves the noise of the others as it was.
    pub(super) fn convert(&mut self, output: &Vector3<f64>, rate_hz: f64, dice: &mut Dice) -> [i32; 3] {
        if self.white_rate_hz != rate_hz {
            self.white_rate_hz = rate_hz;
            let factor = self.faults.noise_factor * rate_hz.sqrt() * self.lsb_per_unit;
            self.white_lsb = Vector3::from_fn(|axis, _| self.model.noise[axis].white * factor);
        }
        let mut codes = [0; 3];
        for (axis, code) in codes.iter_mut().enumerate() {
            let value = output[axis] * self.lsb_per_unit + self.white_lsb[axis] * dice.normal();
            // Half away from zero; a cast keeps what is out of range at the end of it.
            *code = ((value + 0.5_f64.copysign(value)) as i32).clamp(-SATURATION - 1, SATURATION);
        }
        if self.altered { self.alter(codes) } else { codes }
    }

    fn alter(&mut self, mut codes: [i32; 3]) -> [i32; 3] {
        for (axis, code) in codes.iter_mut().enumerate() {
            let range = self.faults.range[axis] * self.lsb_per_unit;
            if range > 0.0 && f64::from(*code).abs() > range {
                *code = if *code > 0 { SATURATION } else { -SATURATION - 1 };
            }
        }
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
