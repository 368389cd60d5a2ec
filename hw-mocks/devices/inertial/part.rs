//! One of the three chips in its module: the outputs of its sensors for what acts on the module.

use nalgebra::{Matrix3, Vector3};

use super::faults::{MOST_VIBRATIONS, Vibration};
use super::reader::Chip;
use super::triad::SensorTriad;
use crate::noise::Dice;
use crate::world::{Influence, STANDARD_GRAVITY};

/// What the sensors of a chip measure.
#[derive(Debug, Clone, Copy)]
pub(super) enum SensorKind {
    /// Angular rate, and force through their g-sensitivity, deg/s per g.
    Gyro { per_g: Matrix3<f64> },
    /// Specific force.
    Accel,
    /// The magnetic field; Y is sampled later by this time.
    Mag { y_skew_s: f64 },
}

/// A chip, with its outputs as long as neither it nor its inputs change.
#[derive(Debug, Clone)]
pub(super) struct ChipPart {
    kind: SensorKind,
    pub(super) triad: SensorTriad,
    held: Option<Held>,
}

#[derive(Debug, Clone, Copy)]
struct Held {
    influence: Influence,
    /// What acts when Y is sampled, if that is another moment.
    on_y: Option<Influence>,
    output: Vector3<f64>,
    shaken: [Vector3<f64>; MOST_VIBRATIONS],
}

/// The random numbers of white noise, and those of spikes and failed reads.
pub(super) struct Chance<'a> {
    pub(super) white: &'a mut Dice,
    pub(super) upset: &'a mut Dice,
}

impl ChipPart {
    pub(super) fn new(kind: SensorKind, triad: SensorTriad) -> Self {
        Self { kind, triad, held: None }
    }

    /// Discards the held outputs after a change: they must be computed again.
    pub(super) fn let_go(&mut self) {
        self.held = None;
    }

    /// The output without white noise, vibration and filter, in the sensors' unit.
    pub(super) fn output(&self, influence: &Influence) -> Vector3<f64> {
        let temperature_c = influence.temperature_c;
        let force_g = influence.force / STANDARD_GRAVITY;
        match self.kind {
            SensorKind::Gyro { per_g } => {
                self.triad.output(&influence.rate_rps.map(f64::to_degrees), temperature_c) + per_g * force_g
            }
            SensorKind::Accel => self.triad.output(&force_g, temperature_c),
            SensorKind::Mag { .. } => self.triad.output(&influence.field_gauss, temperature_c),
        }
    }

    /// Amplitudes of a vibration in the output.
    fn shaken(&self, vibration: &Vibration, temperature_c: f64) -> Vector3<f64> {
        let response = self.triad.response(temperature_c);
        match self.kind {
            SensorKind::Gyro { per_g } => response * vibration.rate_dps + per_g * vibration.force_g,
            SensorKind::Accel => response * vibration.force_g,
            SensorKind::Mag { .. } => response * vibration.field_gauss,
        }
    }

    /// Reads the chip: the three codes of its last conversion, or those of a failed read. A conversion that is due
    /// takes place first.
    pub(super) fn read(
        &mut self,
        chip: &mut Chip,
        at: &mut impl FnMut(f64) -> Influence,
        now_s: f64,
        vibrations: &[Vibration; MOST_VIBRATIONS],
        chance: &mut Chance<'_>,
    ) -> [i32; 3] {
        if let Some(moment_s) = chip.due(now_s) {
            let influence = at(moment_s);
            let on_y = match self.kind {
                SensorKind::Mag { y_skew_s } if y_skew_s != 0.0 => Some(at(moment_s + y_skew_s)),
                _ => None,
            };
            if !self.held.as_ref().is_some_and(|held| held.influence == influence && held.on_y == on_y) {
                let mut output = self.output(&influence);
                if let Some(on_y) = &on_y {
                    output.y = self.output(on_y).y;
                }
                let shaken = vibrations.each_ref().map(|vibration| self.shaken(vibration, influence.temperature_c));
                self.held = Some(Held { influence, on_y, output, shaken });
            }
            if let Some(Held { output, shaken, .. }) = &self.held {
                let felt = chip.feel(output, self.triad.white(), chance.white);
                chip.codes = self.triad.convert(felt + chip.shaken(shaken, moment_s), chance.upset);
            }
        }
        self.triad.failing().and_then(|failing| failing.read(chance.upset)).unwrap_or(chip.codes)
    }
}
