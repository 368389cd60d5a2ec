//! The view of one sample stream on the sensors: three chips, each with its filter and its last conversion.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::SensorModels;
use super::bandwidth::{Filtered, LowPass};
use super::faults::{MOST_VIBRATIONS, Vibration};
use super::model::TriadModel;
use super::noise::white_noise;
use crate::noise::Dice;

/// Reads the sensors at one rate, starting with its first sample.
///
/// Gyroscopes, accelerometers and magnetometer are one chip each. A chip that converts less often than it is read gives
/// its last conversion again. A chip that converts at least as often gives the mean over the interval.
#[derive(Debug, Clone)]
pub struct SensorReader {
    pub(super) rate_hz: f64,
    pub(super) gyro: Chip,
    pub(super) accel: Chip,
    pub(super) mag: Chip,
}

impl SensorReader {
    /// A reader of sensors with these models and vibrations.
    pub(super) fn new(models: &SensorModels, vibrations: &[Vibration; MOST_VIBRATIONS], rate_hz: f64) -> Self {
        let chip = |model| Chip::new(model, vibrations, rate_hz);
        Self { rate_hz, gyro: chip(&models.gyro), accel: chip(&models.accel), mag: chip(&models.mag) }
    }
}

/// One chip under a reader.
#[derive(Debug, Clone)]
pub(super) struct Chip {
    /// The rate of conversions, if it is below the rate of reads.
    converts_hz: Option<f64>,
    /// Number of the last conversion.
    conversion: Option<i64>,
    /// Its codes.
    pub(super) codes: [i32; 3],
    filter: Option<LowPass>,
    /// Set from the first conversion on.
    filtered: Option<[Filtered; 3]>,
    /// White noise of a conversion without a filter, as a multiple of the density.
    root_of_rate: f64,
    /// Frequency, factor and lag of each vibration.
    vibrations: [(f64, f64, f64); MOST_VIBRATIONS],
}

impl Chip {
    fn new(model: &TriadModel, vibrations: &[Vibration; MOST_VIBRATIONS], rate_hz: f64) -> Self {
        let converts_hz = model.update_rate_hz.filter(|update_hz| *update_hz < rate_hz);
        let conversion_hz = converts_hz.unwrap_or(rate_hz);
        let through = |vibration: &Vibration| {
            let frequency_hz = vibration.frequency_hz;
            // Without a filter the sensors measure the motion at the moment.
            let response = model.bandwidth.map(|bandwidth| bandwidth.response(frequency_hz, 1.0 / conversion_hz));
            let (factor, lag) = response.unwrap_or((1.0, 0.0));
            (frequency_hz, factor, lag)
        };
        Self {
            converts_hz,
            conversion: None,
            codes: [0; 3],
            filter: model.bandwidth.map(|bandwidth| LowPass::new(&bandwidth, 1.0 / conversion_hz)),
            filtered: None,
            root_of_rate: conversion_hz.sqrt(),
            vibrations: vibrations.each_ref().map(through),
        }
    }

    /// The time of the conversion that is read at `now_s`; `None` if it was read before.
    pub(super) fn due(&mut self, now_s: f64) -> Option<f64> {
        let Some(converts_hz) = self.converts_hz else { return Some(now_s) };
        // A read at the exact moment of a conversion finds it, whatever the rounding of the product.
        let number = (now_s * converts_hz + 1e-6).floor();
        let due = self.conversion.is_none_or(|last| (last as f64) < number);
        self.conversion = Some(number as i64);
        due.then_some(number / converts_hz)
    }

    /// The input of the converter for a sensor output `output`, with white noise of the density `white`^2.
    pub(super) fn feel(&mut self, output: &Vector3<f64>, white: &Vector3<f64>, dice: &mut Dice) -> Vector3<f64> {
        let Some(filter) = &self.filter else {
            return output + white_noise(white, self.root_of_rate, dice);
        };
        let settled = |axis| filter.settled(output[axis], white[axis], dice);
        let filtered = self.filtered.get_or_insert_with(|| [0, 1, 2].map(settled));
        Vector3::from_fn(|axis, _| filter.step(&mut filtered[axis], output[axis], white[axis], dice.normal()))
    }

    /// The sum of vibrations of these output amplitudes at a moment.
    pub(super) fn shaken(&self, amplitudes: &[Vector3<f64>; MOST_VIBRATIONS], moment_s: f64) -> Vector3<f64> {
        let mut sum = Vector3::zeros();
        for (amplitude, (frequency_hz, factor, lag)) in amplitudes.iter().zip(&self.vibrations) {
            if *frequency_hz == 0.0 {
                continue;
            }
            sum += amplitude * (factor * (TAU * (frequency_hz * moment_s).fract() - lag).sin());
        }
        sum
    }
}
