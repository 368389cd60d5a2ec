//! Intervals of scale factors over simulated records cover the truth: 92.3 to 97.7 % of 1,000.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may end with a panic and says what it saw")]

#[path = "truth/truth.rs"]
mod truth;

use gnc_metrology::scale_factor::{RateRows, ScaleFactor, ScaleFactorOptions, fit};
use truth::Dice;

const SEED: u64 = 81;
const TRIALS: usize = 1000;

/// K in LSB per deg/s, F0 in LSB.
const K: f64 = 200.0;
const OFFSET: f64 = 31.0;
const RATES: [f64; 11] = [-300.0, -200.0, -100.0, -50.0, -20.0, 0.0, 20.0, 50.0, 100.0, 200.0, 300.0];

fn fitted(rates: &[f64], outputs: &[f64], cycles: Option<&[f64]>) -> ScaleFactor {
    fit(&RateRows { rates, outputs, cycles, points: None }.means().unwrap(), &ScaleFactorOptions::default()).unwrap()
}

/// How often the 95 % interval of a name covered the truth.
struct Coverage(Vec<(&'static str, usize)>);

impl Coverage {
    fn count(&mut self, name: &'static str, covered: bool) {
        match self.0.iter_mut().find(|(known, _)| *known == name) {
            Some((_, count)) => *count += usize::from(covered),
            None => self.0.push((name, usize::from(covered))),
        }
    }

    fn check(&self) {
        for (name, count) in &self.0 {
            println!("seed {SEED}: {name} covered in {count} of {TRIALS}");
            assert!((923..=977).contains(count), "{name}: {count} of {TRIALS}");
        }
    }
}

/// One cycle with white noise and a step of K by 100 ppm between the directions.
#[test]
fn one_cycle() {
    let mut dice = Dice::new(SEED);
    let mut coverage = Coverage(Vec::new());
    for _ in 0..TRIALS {
        let outputs = RATES.map(|w| K * w + OFFSET + 3.0 * dice.normal());
        let found = fitted(&RATES, &outputs, None);
        coverage.count("scale factor", (found.scale_factor.value - K).abs() <= found.scale_factor.expanded());
        coverage.count("offset", (found.offset.value - OFFSET).abs() <= found.offset.expanded());
        let asymmetry = found.asymmetry.unwrap();
        let (sd, dof) = asymmetry.uncertainty.unwrap();
        let signed = (asymmetry.positive - asymmetry.negative) / K;
        coverage.count("asymmetry", signed.abs() <= gnc_metrology::stats::coverage_factor(0.95, dof) * sd);
    }
    coverage.check();
}

/// Six power cycles, each with its own K and offset, on a sensor with a cubic term and asymmetry.
#[test]
fn power_cycles() {
    const ASYMMETRY: f64 = 100e-6;
    const TURN_ON: f64 = 50e-6;
    const CYCLES: usize = 6;
    let mut dice = Dice::new(SEED);
    let mut coverage = Coverage(Vec::new());
    let clean = |w: f64, k: f64| k * w * (1.0 + ASYMMETRY / 2.0 * w.signum()) + 2e-8 * K * w * w * w / 300.0;
    // The slope of the line itself, and its distance from the curve at each rate, without noise.
    let truth = fitted(&RATES, &RATES.map(|w| clean(w, K) + OFFSET), None);
    let (mut rates, mut cycles) = (Vec::new(), Vec::new());
    for cycle in 0..CYCLES {
        rates.extend(RATES);
        cycles.extend([cycle as f64; RATES.len()]);
    }
    let slope_sd = 3.0 / RATES.iter().map(|w| w * w).sum::<f64>().sqrt();
    let spread = (K * TURN_ON).hypot(slope_sd);
    let mut held = 0;
    for _ in 0..TRIALS {
        let mut outputs = Vec::new();
        for _ in 0..CYCLES {
            let (k, offset) = (K * (1.0 + TURN_ON * dice.normal()), OFFSET + 20.0 * dice.normal());
            outputs.extend(RATES.map(|w| clean(w, k) + offset + 3.0 * dice.normal()));
        }
        let found = fitted(&rates, &outputs, Some(&cycles));
        let error = found.scale_factor.value - truth.scale_factor.value;
        coverage.count("scale factor", error.abs() <= found.scale_factor.expanded());
        coverage.count("offset", (found.offset.value - truth.offset.value).abs() <= found.offset.expanded());
        let repeatability = found.repeatability.unwrap();
        coverage.count("repeatability", repeatability.sd_low <= spread && spread <= repeatability.sd_high);
        let (low, high) = found.nonlinearity_full_scale.interval.unwrap();
        held += usize::from((low..=high).contains(&truth.nonlinearity_full_scale.value));
        let (asymmetry, expected) = (found.asymmetry.unwrap(), truth.asymmetry.as_ref().unwrap());
        let (sd, dof) = asymmetry.uncertainty.unwrap();
        let error = (asymmetry.positive - asymmetry.negative - expected.positive + expected.negative) / K;
        coverage.count("asymmetry", error.abs() <= gnc_metrology::stats::coverage_factor(0.95, dof) * sd);
        coverage.count("noise of a point", {
            let test = found.lack_of_fit.unwrap();
            let (low, high) = gnc_metrology::stats::sd_interval(test.pure_sd, test.pure_dof, 0.95);
            low <= 3.0 && 3.0 <= high
        });
    }
    coverage.check();
    // The interval holds for all points at once, so it covers the largest more often than 95 %.
    println!("seed {SEED}: nonlinearity covered in {held} of {TRIALS}");
    assert!(held >= 923, "{held}");
}

/// The test of the line calls a linear sensor non-linear in one record of twenty.
#[test]
fn the_test_of_the_line_is_honest() {
    let mut dice = Dice::new(SEED);
    let rates = [RATES, RATES].concat();
    let mut kept = Coverage(Vec::new());
    for _ in 0..TRIALS {
        let outputs: Vec<f64> = rates.iter().map(|w| K * w + OFFSET + 3.0 * dice.normal()).collect();
        let found = fitted(&rates, &outputs, None);
        kept.count("linear", found.lack_of_fit.as_ref().unwrap().p > 0.05);
    }
    kept.check();
}
