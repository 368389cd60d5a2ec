//! Checks that the intervals of whole calibrations after power cycles hold the truth as often as they say.

use gnc_executive::catalogue::ItemId;
use nalgebra::{Matrix3, Vector3};

use super::coverage::{AXES, Found, Tally, params, seed_of, tally, world};
use crate::figures::{AnalysisInput, analyse};

const PLAN: &str = r#"
name = "coverage"
version = "1"
[[item]]
id = "scale-factor-repeatability"
phase = "setup"
params = { calibrations = 4, dwell = "20 s", rate = "20 Hz", turn_rate = "100 Hz" }
[[item]]
id = "cross-coupling"
phase = "setup"
params = { of = "scale-factor-repeatability" }
"#;
/// Number of calibrations, and the scatter of their scale factors, which is far more than a calibration's own noise.
const CALIBRATIONS: u32 = 4;
const SCATTER: f64 = 1e-3;

/// Calibrates `trials` modules several times.
pub(super) fn run(trials: usize, seed: u64) -> Vec<Tally> {
    let params = params(PLAN);
    tally(trials, |trial| {
        let (mut world, site, mut errors) = world(seed_of(trial, seed));
        let module = (world.accel, world.gyro);
        let mut captures = Vec::new();
        for series in 1..=CALIBRATIONS {
            world.power_on();
            // A scale factor changes the whole output of its sensor, so that the responses to other axes stay in
            // proportion.
            let mut scaled = |response: &Matrix3<f64>| {
                Matrix3::from_diagonal(&Vector3::from_fn(|_, _| 1.0 + SCATTER * errors.normal())) * response
            };
            (world.accel, world.gyro) = (scaled(&module.0), scaled(&module.1));
            captures.extend(world.six(&format!("calibration {series} "), series, 20.0, 20));
            captures.extend(world.turns(&format!("calibration {series} "), series, 100));
        }
        let mut found = Vec::new();
        for (id, params) in [ItemId::ScaleFactorRepeatability, ItemId::CrossCoupling].into_iter().zip(&params) {
            let question = AnalysisInput { params, site: Some(&site), captures: &captures, earlier: &[] };
            let findings = analyse(id, &question).unwrap_or_else(|error| panic!("{id}: {error}"));
            let put = |name: String, truth: f64| Found::new(id.as_str(), &findings, &name, truth);
            for triad in ["gyro", "accel"] {
                if id == ItemId::ScaleFactorRepeatability {
                    let name = |axis| format!("scale_factor_repeatability_{triad}_{axis}");
                    found.extend(AXES.map(|axis| put(name(axis), SCATTER * 1e6)));
                    continue;
                }
                for pair in ["xy", "xz", "yz"] {
                    found.push(put(format!("nonorthogonality_{triad}_{pair}"), 0.0));
                }
                for pair in ["xy", "xz", "yx", "yz", "zx", "zy"] {
                    found.push(put(format!("coupling_{triad}_{pair}"), 0.0));
                }
            }
        }
        found
    })
}

#[cfg(test)]
#[test]
fn intervals_of_repeated_calibrations_hold_the_truth_as_often_as_they_say() {
    const SEED: u64 = 80;
    super::coverage::check(&run(8, SEED), SEED);
}
