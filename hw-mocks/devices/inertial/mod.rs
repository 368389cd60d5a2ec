//! Gyroscopes, accelerometers and magnetometer: `N = M f + b + noise`, for the gyroscopes with a g-sensitivity.
//!
//! [`model`] says what a good module is like and where its numbers come from, [`noise`] what its noise is, with a fast
//! simulation of it alone; [`triad`] makes codes of what acts on three sensors, with their faults; here all nine of them
//! give samples, as the board's clock passes their moments.
//!
//! What changes slowly (temperature, slow noise, drifts) moves in steps of [`noise::STEP_S`] and is held between; white
//! noise is drawn for each sample. So the samples of a module that lies still cost nine random numbers each.

pub mod model;
pub mod noise;
pub mod triad;
pub mod truth;

use gnc_protocol::stream::{ACCEL_LSB_PER_G, GYRO_LSB_PER_DPS, ImuSample, MAG_LSB_PER_GAUSS, SATURATION};
use nalgebra::Vector3;

pub use model::{SensorModels, TriadModel};
pub use triad::{SensorFaults, TriadFaults};
pub use truth::{TriadTruth, TrueCalibration, TrueSensors};

use crate::noise::{Dice, Source};
use crate::world::{Influence, STANDARD_GRAVITY};
use triad::Triad;

/// The nine sensors and their two thermometers.
#[derive(Debug, Clone)]
pub struct Sensors {
    models: SensorModels,
    gyro: Triad,
    accel: Triad,
    mag: Triad,
    skew_s: f64,
    powered_at_s: f64,
    /// Steps of slow noise since the bench was started; -1 before the first sample.
    step: i64,
    /// What acts on the sensors and what they make of it without white noise, as long as neither changes.
    held: Option<Held>,
    thermometers: [i16; 2],
    white_dice: Dice,
    slow_dice: Dice,
    turn_on_dice: Dice,
    temperature_dice: Dice,
}

#[derive(Debug, Clone, Copy)]
struct Held {
    influence: Influence,
    field_of_y: Option<Vector3<f64>>,
    gyro: Vector3<f64>,
    accel: Vector3<f64>,
    mag: Vector3<f64>,
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
            skew_s: faults.mag_y_skew_us * 1e-6,
            powered_at_s: 0.0,
            step: -1,
            held: None,
            thermometers: [0; 2],
            white_dice: Dice::new(seed, Source::SensorWhite),
            slow_dice,
            turn_on_dice: Dice::new(seed, Source::TurnOn),
            temperature_dice: Dice::new(seed, Source::Temperature),
        }
    }

    /// Draws what is new at each power-on.
    pub fn power_on(&mut self, now_s: f64) {
        for triad in [&mut self.gyro, &mut self.accel, &mut self.mag] {
            triad.power_on(&mut self.turn_on_dice);
        }
        (self.powered_at_s, self.held) = (now_s, None);
    }

    /// How much later than the others the magnetometer's Y is sampled, s; 0 in a module without that fault.
    #[must_use]
    pub fn skew_s(&self) -> f64 {
        self.skew_s
    }

    /// Takes one sample.
    pub fn sample(&mut self, influence: &Influence, now_s: f64, rate_hz: f64) -> ImuSample {
        self.sample_skewed(influence, None, now_s, rate_hz)
    }

    /// Takes one sample, the magnetometer's Y in another field than the rest.
    pub fn sample_skewed(
        &mut self,
        influence: &Influence,
        field_of_y: Option<Vector3<f64>>,
        now_s: f64,
        rate_hz: f64,
    ) -> ImuSample {
        self.move_slowly(influence, now_s);
        let still = |held: &Held| held.influence == *influence && held.field_of_y == field_of_y;
        let held = self.held.filter(still).unwrap_or_else(|| self.outputs(influence, field_of_y));
        self.held = Some(held);
        ImuSample {
            gyro: self.gyro.convert(&held.gyro, rate_hz, &mut self.white_dice),
            accel: self.accel.convert(&held.accel, rate_hz, &mut self.white_dice),
            mag: self.mag.convert(&held.mag, rate_hz, &mut self.white_dice),
            gyro_temperature: self.thermometers[0],
            accel_temperature: self.thermometers[1],
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

    /// What the sensors are really like at a temperature, for tests that know the truth.
    #[must_use]
    pub fn truth(&self, temperature_c: f64) -> TrueSensors {
        TrueSensors {
            gyro: self.gyro.truth(temperature_c),
            gyro_per_g: self.models.gyro_per_g,
            accel: self.accel.truth(temperature_c),
            mag: self.mag.truth(temperature_c),
        }
    }

    /// Slow noise, drifts and thermometers, up to the step in which `now_s` lies.
    fn move_slowly(&mut self, influence: &Influence, now_s: f64) {
        let step = (now_s / noise::STEP_S) as i64;
        if step <= self.step {
            return;
        }
        let span_s = (step - self.step) as f64 * noise::STEP_S;
        (self.step, self.held) = (step, None);
        let powered_s = (now_s - self.powered_at_s).max(0.0);
        for triad in [&mut self.gyro, &mut self.accel, &mut self.mag] {
            triad.move_slowly(span_s, powered_s, &mut self.slow_dice);
        }
        // Each kind has its own thermometer in its package; both read a little warm.
        self.thermometers = [0.6, 0.4].map(|warm_k| {
            let reading_c = influence.temperature_c + warm_k + 0.02 * self.temperature_dice.normal();
            (reading_c * 100.0).round() as i16
        });
    }

    fn outputs(&self, influence: &Influence, field_of_y: Option<Vector3<f64>>) -> Held {
        let temperature_c = influence.temperature_c;
        let force_g = influence.force / STANDARD_GRAVITY;
        let rate_dps = influence.rate_rps.map(f64::to_degrees);
        let mut mag = self.mag.output(&influence.field_gauss, temperature_c);
        if let Some(field) = field_of_y {
            mag.y = self.mag.output(&field, temperature_c).y;
        }
        Held {
            influence: *influence,
            field_of_y,
            gyro: self.gyro.output(&rate_dps, temperature_c) + self.models.gyro_per_g * force_g,
            accel: self.accel.output(&force_g, temperature_c),
            mag,
        }
    }
}
