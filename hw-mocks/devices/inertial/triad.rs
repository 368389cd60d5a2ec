//! Three sensors of one kind: from their inputs to codes, with their faults.

use gnc_protocol::stream::SATURATION;
use nalgebra::{Matrix3, Vector3};

use super::faults::{Dispersed, Failing, Spikes, TriadFaults};
use super::model::{REFERENCE_C, TriadModel};
use super::noise::SlowNoise;
use super::truth::TriadTruth;
use crate::noise::Dice;

/// Three sensors of one kind.
#[derive(Debug, Clone)]
pub(super) struct SensorTriad {
    model: TriadModel,
    faults: TriadFaults,
    lsb_per_unit: f64,
    slow: [SlowNoise; 3],
    turn_on: Vector3<f64>,
    drift: Vector3<f64>,
    /// The model's response, with the changes of this power-on.
    response: Matrix3<f64>,
    first: Option<[i32; 3]>,
    /// Whether faults may alter the codes.
    altered: bool,
    /// Root of the density of the white noise now.
    white: Vector3<f64>,
    spikes: Option<(Spikes, Dispersed)>,
    failing: Option<Failing>,
}

impl SensorTriad {
    pub(super) fn new(
        model: TriadModel,
        faults: TriadFaults,
        lsb_per_unit: f64,
        slow_dice: &mut Dice,
        upset_dice: &mut Dice,
    ) -> Self {
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
            white: Vector3::zeros(),
            spikes: faults.spikes.map(|spikes| (spikes, Dispersed::new(spikes.share, upset_dice))),
            failing: faults.failed_reads.map(|failed| Failing::new(&failed, upset_dice)),
        }
    }

    pub(super) fn power_on(&mut self, dice: &mut Dice) {
        self.turn_on = Vector3::from_fn(|axis, _| self.model.noise[axis].turn_on * dice.normal());
        // Drawn for every module, so that a fault does not shift the other draws.
        let scale = Vector3::from_fn(|axis, _| 1.0 + self.faults.scale_turn_on[axis] * dice.normal());
        self.response = Matrix3::from_diagonal(&scale) * self.model.response;
        self.response[(0, 1)] += self.faults.coupling_turn_on * dice.normal();
        self.drift = Vector3::zeros();
        self.first = None;
    }

    /// Moves slow noise, drift and the temperature's effect on white noise: `span_s` have passed, and the module has
    /// had power for `powered_s`.
    pub(super) fn move_slowly(&mut self, span_s: f64, powered_s: f64, temperature_c: f64, dice: &mut Dice) {
        for slow in &mut self.slow {
            slow.step(span_s, dice);
        }
        let turns = powered_s / self.faults.wander_s;
        self.drift =
            self.faults.drift_per_h * (powered_s / 3600.0) + self.faults.wander * (turns * std::f64::consts::TAU).sin();
        let warmer_k = temperature_c - REFERENCE_C;
        let factor = (self.model.noise_per_k * warmer_k).map(f64::exp) * self.faults.noise_factor;
        self.white = Vector3::from_fn(|axis, _| self.model.noise[axis].white * factor[axis]);
    }

    /// Root of the density of the white noise: deviation of a mean over one second.
    pub(super) fn white(&self) -> &Vector3<f64> {
        &self.white
    }

    /// The reads of the chip that fail, if any do.
    pub(super) fn failing(&mut self) -> Option<&mut Failing> {
        self.failing.as_mut()
    }

    /// Response at a temperature.
    pub(super) fn response(&self, temperature_c: f64) -> Matrix3<f64> {
        self.response * (1.0 + self.model.response_per_k * (temperature_c - REFERENCE_C))
    }

    /// Response and bias at a temperature.
    pub(super) fn truth(&self, temperature_c: f64) -> TriadTruth {
        let warmer_k = temperature_c - REFERENCE_C;
        TriadTruth {
            response: self.response(temperature_c),
            bias: self.model.bias
                + self.faults.offset
                + self.turn_on
                + self.drift
                + Vector3::repeat(self.model.bias_per_k * warmer_k),
            slow: Vector3::from_fn(|axis, _| self.slow[axis].value()),
            lsb_per_unit: self.lsb_per_unit,
        }
    }

    /// The sensors' output without white noise, vibration and filter, in their unit.
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

    /// One code of each sensor for what the converter sees.
    pub(super) fn convert(&mut self, mut seen: Vector3<f64>, dice: &mut Dice) -> [i32; 3] {
        if let Some((spikes, when)) = &mut self.spikes
            && when.comes(dice)
        {
            let (axis, size) = spikes.draw(dice);
            seen[axis] += size;
        }
        let mut codes = [0; 3];
        for (axis, code) in codes.iter_mut().enumerate() {
            // If the limits are in the wrong order, the upper one counts.
            let value = seen[axis].max(self.faults.clip_low[axis]).min(self.faults.clip_high[axis]) * self.lsb_per_unit;
            // Round half away from zero. The cast limits a value to the range of the type.
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
