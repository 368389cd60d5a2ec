//! Gyroscopes, accelerometers and magnetometer: `N = M f + b + noise`, for the gyroscopes with a g-sensitivity.
//!
//! [`model`] says what a good module is like and where its numbers come from, [`noise`] what its noise is, with a fast
//! simulation of it alone, [`bandwidth`] what its filters do, [`faults`] what may be wrong; [`triad`] makes codes of what
//! acts on three sensors; [`reader`] is what one stream of samples sees of them; here all nine of them give samples, as
//! the board's clock passes their moments.
//!
//! The way of a sample: what acts, the sensors' response, bias and slow noise, white noise and filter, vibration, spikes,
//! the converter with its range, and the read, which may fail or find an old conversion.
//!
//! What changes slowly (temperature, slow noise, drifts) moves in steps of [`noise::STEP_S`] and is held between; white
//! noise is drawn for each sample. So the samples of a module that lies still cost nine random numbers each.

pub mod bandwidth;
pub mod faults;
pub mod model;
pub mod noise;
pub mod reader;
pub mod triad;
pub mod truth;

use gnc_protocol::stream::{ACCEL_LSB_PER_G, GYRO_LSB_PER_DPS, ImuSample, MAG_LSB_PER_GAUSS, SATURATION};
use nalgebra::Vector3;

pub use bandwidth::Bandwidth;
pub use faults::{SensorFaults, TriadFaults};
pub use model::{SensorModels, TriadModel};
pub use reader::Reader;
pub use truth::{TriadTruth, TrueCalibration, TrueSensors};

use crate::noise::{Dice, Source};
use crate::world::{Influence, STANDARD_GRAVITY};
use faults::{Failing, MOST_VIBRATIONS};
use reader::Chip;
use triad::Triad;

/// The nine sensors and their two thermometers.
#[derive(Debug, Clone)]
pub struct Sensors {
    models: SensorModels,
    faults: SensorFaults,
    gyro: Part,
    accel: Part,
    mag: Part,
    powered_at_s: f64,
    /// Steps of slow noise since the bench was started; -1 before the first sample.
    step: i64,
    thermometers: [i16; 2],
    /// Reads of all three chips that fail.
    failing: Option<Failing>,
    /// For samples that no stream asks for.
    reader: Option<Reader>,
    white_dice: Dice,
    slow_dice: Dice,
    turn_on_dice: Dice,
    temperature_dice: Dice,
    upset_dice: Dice,
}

/// Three sensors and what they give, as long as neither they nor what acts on them changes.
#[derive(Debug, Clone)]
struct Part {
    triad: Triad,
    held: Option<Held>,
}

#[derive(Debug, Clone, Copy)]
struct Held {
    influence: Influence,
    field_of_y: Option<Vector3<f64>>,
    output: Vector3<f64>,
    shaken: [Vector3<f64>; MOST_VIBRATIONS],
}

impl Sensors {
    /// Sensors under a seed.
    #[must_use]
    pub fn new(models: SensorModels, faults: SensorFaults, seed: u64) -> Self {
        let mut slow_dice = Dice::new(seed, Source::SensorSlow);
        let mut upset_dice = Dice::new(seed, Source::SensorUpsets);
        let mut part = |model, faults, lsb| Part {
            triad: Triad::new(model, faults, lsb, &mut slow_dice, &mut upset_dice),
            held: None,
        };
        Self {
            models,
            faults,
            gyro: part(models.gyro, faults.gyro, GYRO_LSB_PER_DPS),
            accel: part(models.accel, faults.accel, ACCEL_LSB_PER_G),
            mag: part(models.mag, faults.mag, MAG_LSB_PER_GAUSS),
            powered_at_s: 0.0,
            step: -1,
            thermometers: [0; 2],
            reader: None,
            white_dice: Dice::new(seed, Source::SensorWhite),
            slow_dice,
            turn_on_dice: Dice::new(seed, Source::TurnOn),
            temperature_dice: Dice::new(seed, Source::Temperature),
            failing: faults.failed_reads.map(|failed| Failing::new(&failed, &mut upset_dice)),
            upset_dice,
        }
    }

    /// Draws what is new at each power-on.
    pub fn power_on(&mut self, now_s: f64) {
        for part in [&mut self.gyro, &mut self.accel, &mut self.mag] {
            part.triad.power_on(&mut self.turn_on_dice);
            part.held = None;
        }
        (self.powered_at_s, self.reader) = (now_s, None);
    }

    /// A reader for one stream of samples; its filters have felt for long what they feel first.
    #[must_use]
    pub fn reader(&self, rate_hz: f64) -> Reader {
        Reader::new(&self.models, &self.faults.vibrations, rate_hz)
    }

    /// Takes one sample of what acts at the moments that it is asked for: now, where a chip converted before that moment,
    /// and where a magnetometer is sampled late that moment.
    pub fn read(&mut self, reader: &mut Reader, mut at: impl FnMut(f64) -> Influence, now_s: f64) -> ImuSample {
        let now = at(now_s);
        self.move_slowly(&now, now_s);
        let mut seen = |moment_s: f64| if moment_s == now_s { now } else { at(moment_s) };
        let (per_g, vibrations, skew_s) = (self.models.gyro_per_g, self.faults.vibrations, self.skew_s());
        let (white, upset) = (&mut self.white_dice, &mut self.upset_dice);
        if let Some(moment_s) = reader.gyro.due(now_s) {
            let influence = seen(moment_s);
            let held = self.gyro.hold(&influence, None, |triad| {
                let rate_dps = influence.rate_rps.map(f64::to_degrees);
                let force_g = influence.force / STANDARD_GRAVITY;
                let response = triad.response(influence.temperature_c);
                (
                    triad.output(&rate_dps, influence.temperature_c) + per_g * force_g,
                    vibrations.map(|vibration| response * vibration.rate_dps + per_g * vibration.force_g),
                )
            });
            self.gyro.convert(&mut reader.gyro, &held, moment_s, white, upset);
        }
        if let Some(moment_s) = reader.accel.due(now_s) {
            let influence = seen(moment_s);
            let held = self.accel.hold(&influence, None, |triad| {
                let response = triad.response(influence.temperature_c);
                (
                    triad.output(&(influence.force / STANDARD_GRAVITY), influence.temperature_c),
                    vibrations.map(|vibration| response * vibration.force_g),
                )
            });
            self.accel.convert(&mut reader.accel, &held, moment_s, white, upset);
        }
        if let Some(moment_s) = reader.mag.due(now_s) {
            let influence = seen(moment_s);
            let field_of_y = (skew_s != 0.0).then(|| seen(moment_s + skew_s).field_gauss);
            let held = self.mag.hold(&influence, field_of_y, |triad| {
                let temperature_c = influence.temperature_c;
                let response = triad.response(temperature_c);
                let mut output = triad.output(&influence.field_gauss, temperature_c);
                if let Some(field) = field_of_y {
                    output.y = triad.output(&field, temperature_c).y;
                }
                (output, vibrations.map(|vibration| response * vibration.field_gauss))
            });
            self.mag.convert(&mut reader.mag, &held, moment_s, white, upset);
        }
        let all = self.failing.as_mut().and_then(|failing| failing.read(upset));
        let mut codes = |part: &mut Part, chip: &Chip| {
            let alone = part.triad.failed_read(upset);
            all.or(alone).unwrap_or(chip.codes)
        };
        ImuSample {
            gyro: codes(&mut self.gyro, &reader.gyro),
            accel: codes(&mut self.accel, &reader.accel),
            mag: codes(&mut self.mag, &reader.mag),
            gyro_temperature: self.thermometers[0],
            accel_temperature: self.thermometers[1],
        }
    }

    /// Takes one sample of a steady influence, as a stream at this rate would.
    pub fn sample(&mut self, influence: &Influence, now_s: f64, rate_hz: f64) -> ImuSample {
        let known = self.reader.take().filter(|reader| reader.rate_hz == rate_hz);
        let mut reader = known.unwrap_or_else(|| self.reader(rate_hz));
        let sample = self.read(&mut reader, |_| *influence, now_s);
        self.reader = Some(reader);
        sample
    }

    /// How much later than the others the magnetometer's Y is sampled, s; 0 in a module without that fault.
    fn skew_s(&self) -> f64 {
        self.faults.mag_y_skew_us * 1e-6
    }

    /// The magnetometer's analogue outputs, gauss as the sensors see it; they saturate where the codes do.
    #[must_use]
    pub fn analogue_gauss(&self, influence: &Influence) -> Vector3<f64> {
        let range_gauss = f64::from(SATURATION) / MAG_LSB_PER_GAUSS;
        let output = self.mag.triad.output(&influence.field_gauss, influence.temperature_c);
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
            gyro: self.gyro.triad.truth(temperature_c),
            gyro_per_g: self.models.gyro_per_g,
            accel: self.accel.triad.truth(temperature_c),
            mag: self.mag.triad.truth(temperature_c),
        }
    }

    /// Slow noise, drifts and thermometers, up to the step in which `now_s` lies.
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
            part.held = None;
        }
        // Each kind has its own thermometer in its package; both read a little warm. They are read by themselves, once in a
        // step, so that a read of the sensors that fails leaves them alone.
        self.thermometers = [0.6, 0.4].map(|warm_k| {
            let reading_c = influence.temperature_c + warm_k + 0.02 * self.temperature_dice.normal();
            (reading_c * 100.0).round() as i16
        });
    }
}

impl Part {
    /// Output and amplitudes of vibrations, worked out again only where something changed.
    fn hold(
        &mut self,
        influence: &Influence,
        field_of_y: Option<Vector3<f64>>,
        work_out: impl FnOnce(&Triad) -> (Vector3<f64>, [Vector3<f64>; MOST_VIBRATIONS]),
    ) -> Held {
        let still = |held: &Held| held.influence == *influence && held.field_of_y == field_of_y;
        let held = self.held.filter(still).unwrap_or_else(|| {
            let (output, shaken) = work_out(&self.triad);
            Held { influence: *influence, field_of_y, output, shaken }
        });
        self.held = Some(held);
        held
    }

    fn convert(&mut self, chip: &mut Chip, held: &Held, moment_s: f64, white: &mut Dice, upset: &mut Dice) {
        let felt = chip.feel(&held.output, self.triad.white(), white);
        let shaken = chip.shaken(&held.shaken, moment_s);
        chip.codes = self.triad.convert(felt + shaken, upset);
    }
}
