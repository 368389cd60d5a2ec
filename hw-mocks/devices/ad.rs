//! The AD converter: 16 bits over 0 to 6.144 V, eight channels, 10,000 samples a second of each.
//!
//! # What the channels are wired to
//! Channels 1 to 3 are the magnetometer's analogue outputs X, Y, Z: 2.5 V at zero field, +0.35 V per gauss.
//!
//! Channels 4 to 8 are wired through DIP switches 1 to 5 of the slave board:
//!
//! | channel | switch | ON | OFF |
//! | --- | --- | --- | --- |
//! | 4 | 1 | 5 V rail | 2.0 V |
//! | 5 | 2 | 3.3 V rail | 2.0 V |
//! | 6 | 3 | 1.2 V rail | 2.0 V |
//! | 7 | 4 | ground | 2.0 V |
//! | 8 | 5 | open | 2.0 V |
//!
//! OFF ties the input through 100 kOhm to a 2.0 V reference (2.0 V +- 2 %). ON connects the rail instead. On channel 8
//! ON opens the input: the converter's own 1 MOhm to ground then pulls it to 0 V, within 50 mV, with five times the
//! noise. All switches are OFF at the start.

use gnc_protocol::message::AdChannel;
use gnc_protocol::wire::List;
use nalgebra::Vector3;

use crate::noise::{Dice, RandomStream};

/// Samples a second of each channel.
pub(crate) const RATE_HZ: u32 = 10_000;
/// One step of the converter.
pub(crate) const LSB_V: f64 = 6.144 / 65_536.0;
/// Magnetometer output without field.
pub(crate) const MAG_ZERO_V: f64 = 2.5;
/// Magnetometer output per gauss.
pub(crate) const MAG_V_PER_GAUSS: f64 = 0.35;
/// Level of a channel whose switch is off.
pub(crate) const OFF_V: f64 = 2.0;
/// Deviation of a sample.
const NOISE_V: f64 = 0.3e-3;

/// Voltages of the module's rails.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rails {
    /// The 5 V rail.
    pub v5_v: f64,
    /// The 3.3 V rail.
    pub v3v3_v: f64,
    /// The 1.2 V rail.
    pub v1v2_v: f64,
}

impl Default for Rails {
    /// Within half a percent of nominal, as regulators are.
    fn default() -> Self {
        Self { v5_v: 4.985, v3v3_v: 3.306, v1v2_v: 1.203 }
    }
}

/// The converter with its switches.
#[derive(Debug, Clone)]
pub(crate) struct Ad {
    rails: Rails,
    unwired: [bool; 5],
    switches: [bool; 5],
    dice: Dice,
}

impl Ad {
    /// A converter under a seed; `unwired` switches do nothing.
    #[must_use]
    pub(crate) fn new(rails: Rails, unwired: [bool; 5], seed: u64) -> Self {
        Self { rails, unwired, switches: [false; 5], dice: Dice::new(seed, RandomStream::Ad) }
    }

    /// Flips DIP switch 1 to 5; other numbers do nothing.
    pub(crate) fn set_switch(&mut self, number: u8, on: bool) {
        if let Some(switch) = self.switches.get_mut(usize::from(number.wrapping_sub(1))) {
            *switch = on;
        }
    }

    /// The state of the switches 1 to 5.
    #[must_use]
    pub(crate) fn switches(&self) -> [bool; 5] {
        self.switches
    }

    /// Samples the channels of a mask (bit 0 is channel 1).
    pub(crate) fn read(&mut self, channels: u8, samples: u16, analogue_gauss: &Vector3<f64>) -> List<AdChannel, 8> {
        let mut list = List::new();
        for channel in (1..=8_u8).filter(|channel| channels >> (channel - 1) & 1 == 1) {
            let (level_v, noise_v) = self.level(channel, analogue_gauss);
            // The list holds eight channels, and there are at most eight.
            let _ = list.push(self.sample(channel, level_v, noise_v, samples));
        }
        list
    }

    /// Voltage and noise at an input.
    fn level(&self, channel: u8, analogue_gauss: &Vector3<f64>) -> (f64, f64) {
        if let axis @ 0..3 = usize::from(channel - 1) {
            return (MAG_ZERO_V + MAG_V_PER_GAUSS * analogue_gauss[axis], NOISE_V);
        }
        let switch = usize::from(channel - 4);
        if !self.switches[switch] || self.unwired[switch] {
            return (OFF_V * 1.004, NOISE_V);
        }
        match channel {
            4 => (self.rails.v5_v, NOISE_V),
            5 => (self.rails.v3v3_v, NOISE_V),
            6 => (self.rails.v1v2_v, NOISE_V),
            7 => (0.0, NOISE_V),
            _ => (0.02, 5.0 * NOISE_V),
        }
    }

    fn sample(&mut self, channel: u8, level_v: f64, noise_v: f64, samples: u16) -> AdChannel {
        // Offset and gain of the converter, different for each channel.
        let offset_v = 0.2e-3 * f64::from(i32::from(channel) % 3 - 1);
        let gain = 1.0 + 1e-4 * f64::from(i32::from(channel) % 5 - 2);
        let (mut sum, mut min, mut max) = (0.0, f64::MAX, f64::MIN);
        for _ in 0..samples {
            let volts = level_v * gain + offset_v + noise_v * self.dice.normal();
            let reading = (volts / LSB_V).round().clamp(0.0, 65_535.0) * LSB_V;
            sum += reading;
            min = reading.min(min);
            max = reading.max(max);
        }
        let microvolts = |volts: f64| (volts * 1e6).round() as i32;
        let mean_uv = microvolts(sum / f64::from(samples.max(1)));
        AdChannel { channel, mean_uv, min_uv: microvolts(min), max_uv: microvolts(max) }
    }
}
