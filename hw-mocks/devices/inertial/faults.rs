//! Faults of the sensors, of their mounting, and of the bus by which they are read.

use gnc_protocol::stream::SATURATION;
use nalgebra::Vector3;

use crate::noise::Dice;
use crate::world::ModuleAxis;

/// Most vibrations of one module: more would show nothing new, and each costs a sine for each sample.
pub(crate) const MOST_VIBRATIONS: usize = 4;

/// Faults of a triad, in the sensors' unit; zeros and `None` mean good sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriadFaults {
    /// The converter of an axis repeats its first code forever.
    pub stuck: [bool; 3],
    /// An axis gives no signal: its code is 0.
    pub dead: [bool; 3],
    /// The signals of two axes are exchanged.
    pub swapped: Option<(ModuleAxis, ModuleAxis)>,
    /// Factor on the model's white noise.
    pub noise_factor: f64,
    /// Added to the bias.
    pub offset: Vector3<f64>,
    /// Drift of the bias in an hour, from each power-on on.
    pub drift_per_h: Vector3<f64>,
    /// Amplitude of a sine in the bias, from each power-on on.
    pub wander: Vector3<f64>,
    /// Period of that sine.
    pub wander_s: f64,
    /// Relative deviation of the scale factor from power-on to power-on.
    pub scale_turn_on: Vector3<f64>,
    /// Deviation of the response of X to the Y axis from power-on to power-on.
    pub coupling_turn_on: f64,
    /// Inputs along the axis smaller than this give no output.
    pub deadband: Vector3<f64>,
    /// The signal moves in steps of this size; the noise is added after them.
    pub step: Vector3<f64>,
    /// Outputs beyond this read as the end of the converter's range.
    pub range: Vector3<f64>,
    /// Outputs below this read as this.
    pub clip_low: Vector3<f64>,
    /// Outputs above this read as this.
    pub clip_high: Vector3<f64>,
    /// Spikes in some conversions.
    pub spikes: Option<Spikes>,
    /// Some reads of the chip fail.
    pub failed_reads: Option<FailedReads>,
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
            wander: none,
            wander_s: 60.0,
            scale_turn_on: none,
            coupling_turn_on: 0.0,
            deadband: none,
            step: none,
            range: none,
            clip_low: Vector3::repeat(f64::NEG_INFINITY),
            clip_high: Vector3::repeat(f64::INFINITY),
            spikes: None,
            failed_reads: None,
        }
    }
}

/// Conversions with a spike in one sensor of the chip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spikes {
    /// Share of all conversions: one in each run of `1 / share`.
    pub share: f64,
    /// The size that is added or subtracted at random, in the sensors' unit.
    pub size: f64,
    /// The sensor; `None`: any of the three, at random.
    pub axis: Option<ModuleAxis>,
}

impl Spikes {
    /// The disturbed sensor and the value that is added to it.
    pub(super) fn draw(&self, dice: &mut Dice) -> (usize, f64) {
        // One number chooses among six cases: three sensors, two senses.
        let case = dice.between(0.0, 6.0) as usize;
        let axis = self.axis.map_or(case % 3, ModuleAxis::index);
        (axis, if case < 3 { self.size } else { -self.size })
    }
}

/// Failed reads: all channels of the chip then hold one value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FailedReads {
    /// Share of all reads: one in each run of `1 / share`.
    pub share: f64,
    /// The code that is read instead.
    pub code: i32,
}

impl FailedReads {
    /// The codes of a bus without a driver: zeros, ones, or an end of the converter's range.
    pub const CODES: [i32; 4] = [0, -1, SATURATION, -SATURATION - 1];
}

/// Events: one in each run of `1 / share` turns, at a random place in the run.
///
/// So the number of events for a number of turns is known to within one at either end. A fault near a limit is then on
/// the same side of it under every seed, and still comes at a place that no test can know.
#[derive(Debug, Clone, Copy)]
pub(super) struct Dispersed {
    share: f64,
    /// How much of the run has passed, and the place of the event in it.
    passed: f64,
    event: f64,
}

impl Dispersed {
    pub(super) fn new(share: f64, dice: &mut Dice) -> Self {
        Self { share, passed: 0.0, event: dice.between(0.0, 1.0) }
    }

    /// Whether the event comes at this turn.
    pub(super) fn comes(&mut self, dice: &mut Dice) -> bool {
        let from = self.passed;
        self.passed += self.share;
        let mut comes = (from..self.passed).contains(&self.event);
        if self.passed >= 1.0 {
            self.passed -= 1.0;
            self.event = dice.between(0.0, 1.0);
            comes |= self.event < self.passed;
        }
        comes
    }
}

/// Failed reads, as they occur.
#[derive(Debug, Clone, Copy)]
pub(super) struct Failing {
    when: Dispersed,
    codes: [i32; 3],
}

impl Failing {
    pub(super) fn new(failed: &FailedReads, dice: &mut Dice) -> Self {
        Self { when: Dispersed::new(failed.share, dice), codes: [failed.code; 3] }
    }

    /// The codes of this read if it fails.
    pub(super) fn read(&mut self, dice: &mut Dice) -> Option<[i32; 3]> {
        self.when.comes(dice).then_some(self.codes)
    }
}

/// A sinusoid that shakes the module: the same one in all sensors that respond to it, in phase.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Vibration {
    /// Frequency; 0: none.
    pub frequency_hz: f64,
    /// Amplitude of the angular rate, in the module's axes.
    pub rate_dps: Vector3<f64>,
    /// Amplitude of the specific force.
    pub force_g: Vector3<f64>,
    /// Amplitude of the magnetic field.
    pub field_gauss: Vector3<f64>,
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
    /// Delay of the magnetometer's Y sample against the rest.
    pub mag_y_skew_us: f64,
    /// The vibrations of the module.
    pub vibrations: [Vibration; MOST_VIBRATIONS],
    /// Some reads fail for all three chips at once.
    pub failed_reads: Option<FailedReads>,
}
