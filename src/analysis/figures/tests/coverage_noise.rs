//! Checks that the intervals of noise hold the truth as often as they say: random walks, bias instability, densities.
//!
//! The items give coefficients of IEEE Std 952; the sensor's noise is white with flicker noise beside it.

use std::f64::consts::{SQRT_2, TAU};

use gnc_executive::catalogue::ItemId;
use gnc_protocol::stream::ImuSample;

use super::coverage::{AXES, Calibrated, Found, PLAN, Tally, params, seed_of, tally};
use super::world::{Dice, capture};
use crate::capture::{Capture, Pose};

const NOISE: &str = r#"
[[item]]
id = "allan"
phase = "setup"
params = { duration = "200 s", rate = "100 Hz" }
[[item]]
id = "psd"
phase = "setup"
params = { duration = "200 s", rate = "100 Hz", segment = 1024 }
"#;
const RATE_HZ: u16 = 100;
const SAMPLES: usize = 20_000;
/// N (deg/s and g in a second) and B of the gyroscopes and the accelerometers.
const GYRO: (f64, f64) = (0.0025, 0.0025);
const ACCEL: (f64, f64) = (0.1e-3, 0.1e-3);

/// Item, figure and truth: deg/s in a second is 60 deg/sqrt(h), g in a second 9.80665 * 60 m/s/sqrt(h); one-sided densities
/// are sqrt(2) N.
const FIGURES: [(&str, &str, f64); 6] = [
    ("allan", "angle_random_walk", GYRO.0 * 60.0),
    ("allan", "velocity_random_walk", ACCEL.0 * 9.80665 * 60.0),
    ("allan", "bias_instability_gyro", GYRO.1 * 3600.0),
    ("allan", "bias_instability_accel", ACCEL.1 * 1e3),
    ("psd", "density_gyro", GYRO.0 * SQRT_2),
    ("psd", "density_accel", ACCEL.0 * SQRT_2 * 1e6),
];

/// Names of the figures of a run. Now and then a record shows no bias instability.
pub(super) fn names() -> impl Iterator<Item = String> {
    FIGURES.iter().flat_map(|(item, figure, _)| AXES.iter().map(move |axis| format!("{item} {figure}_{axis}")))
}

/// Lets `trials` modules lie still.
pub(super) fn run(trials: usize, seed: u64) -> Vec<Tally> {
    let all = params(&format!("{PLAN}{NOISE}"));
    // The coefficients of one module serve all modules: an error of 30 ppm in scale factors does not matter to noise.
    let module = Calibrated::new(&all[..3], seed_of(trials, seed));
    tally(trials, |trial| {
        let captures = [still(&mut Dice::new(seed_of(trial, seed)))];
        let mut found = Vec::new();
        let allan = module.ask(ItemId::Allan, &all[3], &captures);
        let psd = module.ask(ItemId::Psd, &all[4], &captures);
        for (item, figure, truth) in FIGURES {
            let findings = if item == "allan" { &allan } else { &psd };
            found.extend(
                AXES.iter().filter_map(|axis| Found::given(item, findings, &format!("{figure}_{axis}"), truth)),
            );
        }
        found
    })
}

/// Noise of one channel: white noise, and flicker as a sum of relaxations whose corners stand an octave apart, from far
/// below one over the record to 6 Hz. The two-sided density follows `B^2 / (2 pi f)` (IEEE Std 952) below that, and
/// sampling folds nothing of it.
struct Channel {
    white: f64,
    states: Vec<f64>,
    relaxations: Vec<(f64, f64)>,
}

impl Channel {
    fn new((n, b): (f64, f64), dice: &mut Dice) -> Self {
        let variance = 2.0 * b * b * 2.0_f64.ln() / TAU;
        let octaves = (32.0 * SAMPLES as f64).log2() as i32;
        let keeps = (-octaves..-3).map(|octave| (-TAU * 2.0_f64.powi(octave)).exp());
        let relaxations: Vec<(f64, f64)> = keeps.map(|keep| (keep, (variance * (1.0 - keep * keep)).sqrt())).collect();
        let states = relaxations.iter().map(|_| variance.sqrt() * dice.normal()).collect();
        Self { white: n * f64::from(RATE_HZ).sqrt(), states, relaxations }
    }

    fn next(&mut self, dice: &mut Dice) -> f64 {
        for (state, (keep, step)) in self.states.iter_mut().zip(&self.relaxations) {
            *state = keep * *state + step * dice.normal();
        }
        self.states.iter().sum::<f64>() + self.white * dice.normal()
    }
}

fn still(dice: &mut Dice) -> Capture {
    let mut channels = [GYRO, GYRO, GYRO, ACCEL, ACCEL, ACCEL].map(|noise| Channel::new(noise, dice));
    let samples = (0..SAMPLES).map(|_| {
        let mut code =
            |channel: usize, level: f64, lsb: f64| ((level + channels[channel].next(dice)) * lsb).round() as i32;
        ImuSample {
            gyro: [0, 1, 2].map(|axis| code(axis, 0.05, 20_000.0)),
            accel: [0, 1, 2].map(|axis| code(3 + axis, if axis == 2 { 1.0 } else { 0.0 }, 160_000.0)),
            mag: [1, 2, 3],
            gyro_temperature: 2510,
            accel_temperature: 2490,
        }
    });
    capture("still", 1, Pose::Still { up: [0.0, 0.0, 1.0], heading_deg: 0.0 }, RATE_HZ, samples.collect())
}

#[cfg(test)]
#[test]
fn intervals_of_noise_hold_the_truth_as_often_as_they_say() {
    const SEED: u64 = 81;
    super::coverage::check(&run(6, SEED), SEED);
}
