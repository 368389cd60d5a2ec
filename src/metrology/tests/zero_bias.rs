//! Bias elimination over 200 simulated power cycles compared with the truth, with power lost during writes.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test may end with a panic and says what it saw"
)]

#[path = "truth/truth.rs"]
mod truth;

use gnc_metrology::zero_bias::{BiasModel, Copies, Eliminator, Kalman, Stored, ZeroBiasSettings};
use truth::Dice;

const SEED: u64 = 17;
const CYCLES: usize = 200;
/// Cycles before the errors count, since nothing is stored at first.
const LEARNING: usize = 20;
const SAMPLES: usize = 8000;
const RATE_HZ: f64 = 100.0;

/// Root mean square of the bias errors of a method, early (at 1 s, where the stored bias counts) and late.
#[derive(Debug, Default)]
struct Errors {
    early: f64,
    late: f64,
}

impl Errors {
    fn add(&mut self, at: usize, error: f64) {
        let share = error * error / (CYCLES - LEARNING) as f64;
        match at {
            100 => self.early += share,
            _ if at == SAMPLES - 1 => self.late += share,
            _ => {}
        }
    }

    fn rms(&self) -> (f64, f64) {
        (self.early.sqrt(), self.late.sqrt())
    }
}

#[test]
fn two_hundred_power_cycles() {
    println!("seed {SEED}");
    let mut dice = Dice::new(SEED);
    // deg/h: a constant part, its change at power-on, the noise of a sample (0.3 deg/sqrt(h)), a slow walk.
    let (constant, model) = (120.0, BiasModel { repeatability: 10.0, n: 18.0, b: 2.0, rate_hz: RATE_HZ });
    let noise = model.n * RATE_HZ.sqrt();
    let (mut copies, mut for_kalman) = (Copies::default(), Stored::default());
    let (mut raw, mut print, mut fusion) = (Errors::default(), Errors::default(), Errors::default());
    let (mut writes, mut cuts) = (0, 0);
    for cycle in 0..CYCLES {
        let mut bias = constant + model.repeatability * dice.normal();
        let stored = copies.load();
        let mut eliminator = Eliminator::new(ZeroBiasSettings::default(), stored.clone()).unwrap();
        let mut kalman = Kalman::new(&model, &for_kalman).unwrap();
        for k in 0..SAMPLES {
            bias += 0.01 * dice.normal();
            // A second of motion at intervals, and at the start of every third cycle.
            let moving = k % 4500 > 4400 || (cycle % 3 == 0 && k < 80);
            let rate = bias + noise * dice.normal() + if moving { 30_000.0 } else { 0.0 };
            let out = eliminator.step(rate, !moving);
            kalman.step(rate, !moving);
            assert_eq!(out.rate, rate - out.bias);
            if let Some(new) = out.store {
                let before = copies.load();
                let (copy, bytes) = copies.plan(&new);
                writes += 1;
                // Every other write is cut off by a loss of power, at any byte.
                if dice.normal() > 0.0 {
                    cuts += 1;
                    let cut = ((dice.normal().abs() * 0.4).fract() * bytes.len() as f64) as usize;
                    let old = copies.0[copy].get(cut..).unwrap_or_default().to_vec();
                    copies.0[copy] = [&bytes[..cut], &old].concat();
                    assert_eq!(copies.load(), before, "a torn write must not show");
                } else {
                    copies.0[copy] = bytes;
                    assert_eq!(copies.load(), new);
                }
            }
            if cycle >= LEARNING {
                raw.add(k, bias);
                print.add(k, out.bias - bias);
                fusion.add(k, kalman.bias() - bias);
            }
        }
        for_kalman.push(kalman.bias(), ZeroBiasSettings::default().slots);
    }
    let stored = copies.load();
    println!("{writes} writes, {cuts} cut off; stored {:?}", stored.biases());
    println!(
        "rms error, deg/h, at 1 s and at the end: raw {:?}, print {:?}, inverse variance {:?}",
        raw.rms(),
        print.rms(),
        fusion.rms()
    );
    assert!(writes > 50 && cuts > 20);
    assert_eq!(stored.biases().len(), ZeroBiasSettings::default().slots);
    // The mean of the stored biases is the constant part: ten of them scatter by 10 / sqrt(10).
    assert!((stored.mean().unwrap() - constant).abs() < 4.0 * 10.0 / 10.0_f64.sqrt());
    let ((raw_early, _), (print_early, print_late), (fusion_early, fusion_late)) =
        (raw.rms(), print.rms(), fusion.rms());
    assert!(print_early < 0.3 * raw_early && fusion_early < 0.3 * raw_early);
    // A ring of 1500 samples has a white error of noise / sqrt(1500) = 4.6 deg/h; 15 % is four deviations of 200 cycles
    // and the walk.
    assert!((print_late / (noise / 1500.0_f64.sqrt()) - 1.0).abs() < 0.25, "{print_late}");
    assert!(fusion_early <= print_early && fusion_late < print_late, "the fusion by variances is the better one");
}
