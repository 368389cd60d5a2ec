//! Truth recovery, 10,000 simulated calibrations of each method, with the bounds beside the figures. One thread.
//! `cargo bench -p gnc-metrology --bench truth [-- TRIALS]`; exits with 1 when a bound is broken.

#![allow(clippy::print_stdout, clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs, dead_code)]

#[path = "../tests/truth/truth.rs"]
mod truth;

use std::time::Instant;

const SEED: u64 = 1;

fn main() {
    let only: Vec<String> =
        std::env::args().skip(1).filter(|a| !a.starts_with('-') && a.parse::<usize>().is_err()).collect();
    let wanted = |part: &str| only.is_empty() || only.iter().any(|o| part.contains(o.as_str()));
    let trials = std::env::args().skip(1).find_map(|a| a.parse().ok()).unwrap_or(10_000);
    println!(
        "{trials} trials, seed {SEED}; bounds: bias 3.9 se, rms/bound 0.97-1.03, coverage 94-96 %, pooled 94.5-95.5 %"
    );
    let mut broken = 0;
    for sensor in truth::noise::SENSORS.iter().filter(|s| wanted(&format!("allan {}", s.name))) {
        let start = Instant::now();
        let coverage = truth::noise::Coverage::run(sensor, trials, SEED);
        println!("{}  ({:.1} s)", coverage.line(), start.elapsed().as_secs_f64());
        for failure in coverage.failures() {
            println!("  BROKEN {failure}");
            broken += 1;
        }
    }
    for simulate in truth::METHODS.into_iter().filter(|_| wanted("calibrations")) {
        let start = Instant::now();
        let tally = simulate(trials, SEED);
        let v = tally.verdict();
        println!(
            "{:<20} bias {:.2} se, rms/bound {:.4}-{:.4}, coverage {:.2}-{:.2} %, pooled {:.2} %  ({:.1} s)",
            tally.method,
            v.bias,
            v.rms.0,
            v.rms.1,
            v.coverage.0,
            v.coverage.1,
            v.pooled,
            start.elapsed().as_secs_f64()
        );
        for failure in tally.failures() {
            println!("  BROKEN {failure}");
            broken += 1;
        }
    }
    if broken > 0 {
        std::process::exit(1);
    }
}
