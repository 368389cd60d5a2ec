//! Gyroscopes, accelerometers and magnetometer: `N = M f + b + noise`, for the gyroscopes with a g-sensitivity.
//!
//! [`model`] describes a good module and the sources of its numbers. [`noise`] describes its noise, with a fast
//! simulation of the noise alone. [`bandwidth`] describes its filters, and [`faults`] the possible faults. `triad`
//! makes codes from the inputs of the three sensors of a chip, and `reader` is the view of one sample stream on the
//! three chips. Here all nine sensors give samples at their moments of the board's clock.
//!
//! A sample is made in this order: input, response, bias and slow noise, white noise and filter, vibration, spikes, the
//! converter with its range, and the read, which may fail or find an old conversion.
//!
//! Slow changes (temperature, slow noise, drifts) move in steps of `noise::STEP_S` and are held between. White noise is
//! drawn for each sample. So each sample of a still module costs nine random numbers.

pub mod bandwidth;
pub mod faults;
pub mod model;
pub mod noise;
mod part;
pub(crate) mod reader;
pub(crate) mod triad;
pub(crate) mod truth;

use gnc_protocol::stream::{ACCEL_LSB_PER_G, GYRO_LSB_PER_DPS, ImuSample, MAG_LSB_PER_GAUSS, SATURATION};
use nalgebra::Vector3;

pub use bandwidth::Bandwidth;
pub use faults::{SensorFaults, TriadFaults};
pub use model::{SensorModels, TriadModel};
pub use reader::SensorReader;
pub use truth::{TriadTruth, TrueSensors};

use crate::noise::{Dice, RandomStream};
use crate::world::Influence;
use faults::{Failing, MOST_VIBRATIONS, Vibration};
use part::{Chance, ChipPart, SensorKind};
use reader::Chip;
use triad::SensorTriad;

/// The nine sensors and their two thermometers.
#[derive(Debug, Clone)]
pub struct Sensors {
    models: SensorModels,
    vibrations: [Vibration; MOST_VIBRATIONS],
    gyro: ChipPart,
    accel: ChipPart,
    mag: ChipPart,
    powered_at_s: f64,
    /// Steps of slow noise since the bench was started; -1 before the first sample.
    step: i64,
    thermometers: [i16; 2],
    /// Reads of all three chips that fail.
    failing: Option<Failing>,
    /// The reader for samples that do not belong to a stream.
    reader: Option<SensorReader>,
    white_dice: Dice,
    slow_dice: Dice,
    turn_on_dice: Dice,
    temperature_dice: Dice,
    upset_dice: Dice,
}

impl Sensors {
    /// Sensors under a seed.
    #[must_use]
    pub fn new(models: SensorModels, faults: SensorFaults, seed: u64) -> Self {
        let mut slow_dice = Dice::new(seed, RandomStream::SensorSlow);
        let mut upset_dice = Dice::new(seed, RandomStream::SensorUpsets);
        let mut triad = |model, faults, lsb| SensorTriad::new(model, faults, lsb, &mut slow_dice, &mut upset_dice);
        let gyro = triad(models.gyro, faults.gyro, GYRO_LSB_PER_DPS);
        let accel = triad(models.accel, faults.accel, ACCEL_LSB_PER_G);
        let mag = triad(models.mag, faults.mag, MAG_LSB_PER_GAUSS);
        Self {
            models,
            vibrations: faults.vibrations,
            gyro: ChipPart::new(SensorKind::Gyro { per_g: models.gyro_per_g }, gyro),
            accel: ChipPart::new(SensorKind::Accel, accel),
            mag: ChipPart::new(SensorKind::Mag { y_skew_s: faults.mag_y_skew_us * 1e-6 }, mag),
            powered_at_s: 0.0,
            step: -1,
            thermometers: [0; 2],
            reader: None,
            white_dice: Dice::new(seed, RandomStream::SensorWhite),
            slow_dice,
            turn_on_dice: Dice::new(seed, RandomStream::TurnOn),
            temperature_dice: Dice::new(seed, RandomStream::Temperature),
            failing: faults.failed_reads.map(|failed| Failing::new(&failed, &mut upset_dice)),
            upset_dice,
        }
    }

    /// Draws the values that are new at each power-on.
    pub fn power_on(&mut self, now_s: f64) {
        for part in [&mut self.gyro, &mut self.accel, &mut self.mag] {
            part.triad.power_on(&mut self.turn_on_dice);
            part.let_go();
        }
        (self.powered_at_s, self.reader) = (now_s, None);
    }

    /// A reader for one stream of samples; its filters are settled at their first input.
    #[must_use]
    pub fn reader(&self, rate_hz: f64) -> SensorReader {
        SensorReader::new(&self.models, &self.vibrations, rate_hz)
    }

    /// Takes one sample. `at` gives what acts at a moment: now, the earlier moment of a chip's conversion, and the
    /// later moment of a magnetometer axis that is sampled late.
    pub fn read(&mut self, reader: &mut SensorReader, mut at: impl FnMut(f64) -> Influence, now_s: f64) -> ImuSample {
        let now = at(now_s);
        self.move_slowly(&now, now_s);
        let mut seen = |moment_s: f64| if moment_s == now_s { now } else { at(moment_s) };
        let mut chance = Chance { white: &mut self.white_dice, upset: &mut self.upset_dice };
        let mut codes =
            |part: &mut ChipPart, chip: &mut Chip| part.read(chip, &mut seen, now_s, &self.vibrations, &mut chance);
        let gyro = codes(&mut self.gyro, &mut reader.gyro);
        let accel = codes(&mut self.accel, &mut reader.accel);
        let mag = codes(&mut self.mag, &mut reader.mag);
        let failed = self.failing.as_mut().and_then(|failing| failing.read(&mut self.upset_dice));
        ImuSample {
            gyro: failed.unwrap_or(gyro),
            accel: failed.unwrap_or(accel),
            mag: failed.unwrap_or(mag),
            gyro_temperature: self.thermometers[0],
            accel_temperature: self.thermometers[1],
        }
    }

    /// Takes one sample of a steady influence, like a stream at this rate.
    pub fn sample(&mut self, influence: &Influence, now_s: f64, rate_hz: f64) -> ImuSample {
        let known = self.reader.take().filter(|reader| reader.rate_hz == rate_hz);
        let mut reader = known.unwrap_or_else(|| self.reader(rate_hz));
        let sample = self.read(&mut reader, |_| *influence, now_s);
        self.reader = Some(reader);
        sample
    }

    /// The magnetometer's analogue outputs, gauss as the sensors see it; they saturate where the codes do.
    #[must_use]
    pub(crate) fn analogue_gauss(&self, influence: &Influence) -> Vector3<f64> {
        let range_gauss = f64::from(SATURATION) / MAG_LSB_PER_GAUSS;
        self.mag.output(influence).map(|gauss| gauss.clamp(-range_gauss, range_gauss))
    }

    /// The models, for tests that know the truth.
    #[must_use]
    pub(crate) fn models(&self) -> &SensorModels {
        &self.models
    }

    /// The sensors' true properties at a temperature, for tests that know the truth.
    #[must_use]
    pub fn truth(&self, temperature_c: f64) -> TrueSensors {
        TrueSensors {
            gyro: self.gyro.triad.truth(temperature_c),
            gyro_per_g: self.models.gyro_per_g,
            accel: self.accel.triad.truth(temperature_c),
            mag: self.mag.triad.truth(temperature_c),
        }
    }

    /// Moves slow noise, drifts and thermometers on to the step that contains `now_s`.
    fn move_slowly(&mut self, influence: &Influence, now_s: f64) {
        let step = (now_s / noise::STEP_S) as i64;
        if step <= self.step {
            return;
        }
        let span_s = (step - self.step) as f64 * noise::STEP_S;
        self.step = step;
        let powered_s = (now_s - self.powered_at_s).max(0.0);
        for part in [&mut self.gyro, &mut self.accel, &mut self.mag] {
            part.triad.move_slowly(span_s, powered_s, influence.temperature_c, &mut self.slow_dice);
            part.let_go();
        }
        // Each kind has its own thermometer in its package; both read a little too high. They are read separately, once
        // in a step, so that a failed read of the sensors does not affect them.
        self.thermometers = [0.6, 0.4].map(|warm_k| {
            let reading_c = influence.temperature_c + warm_k + 0.02 * self.temperature_dice.normal();
            (reading_c * 100.0).round() as i16
        });
    }
}
