//! Coverage of the calibrations' intervals, simulated without frames: `cargo bench -p gnc-station --bench coverage
//! [-- TRIALS]`; ends with 1 when a bound is broken.

#![allow(clippy::print_stdout, clippy::expect_used, clippy::panic, missing_docs, dead_code, unreachable_pub)]

use std::time::Instant;

// The simulation is that of the tests; these are the places where it looks for the station.
mod board {
    pub mod stream {
        pub use gnc_station::board::stream::Losses;
    }
}
mod capture {
    pub use gnc_station::capture::*;
}
mod figures {
    pub use gnc_station::figures::*;
}
#[path = "../figures/tests/coverage.rs"]
mod coverage;
#[path = "../figures/tests/coverage_field.rs"]
mod coverage_field;
#[path = "../figures/tests/world.rs"]
mod world;

const SEED: u64 = 1;

fn main() {
    let trials = std::env::args().skip(1).find_map(|argument| argument.parse().ok()).unwrap_or(1000);
    let start = Instant::now();
    let mut tallies = coverage::run(trials, SEED);
    tallies.extend(coverage_field::run(trials, SEED));
    println!("{trials} modules calibrated, seed {SEED}, in {:.1} s", start.elapsed().as_secs_f64());
    let percent = |held: usize| 100.0 * held as f64 / trials as f64;
    // Four binomial standard deviations about 95 %.
    let band = 4.0 * (0.95 * 0.05 / trials as f64).sqrt() * 100.0;
    let (mut broken, mut pooled) = (0, Vec::new());
    for tally in &tallies {
        let covered = percent(tally.held);
        let more = covered - 95.0;
        // A term that the bench draws once in a trial may hide what the others do.
        let dominated = dominated(tally, trials).filter(|_| more > band);
        let note =
            dominated.map(|(term, share)| format!("  dominated by {term}, {:.0} % of the variance", 100.0 * share));
        println!("  {:<40} {covered:.1} %{}", tally.name, note.as_deref().unwrap_or(""));
        if note.is_none() {
            broken += u32::from(more.abs() > band);
            pooled.push(covered);
        }
    }
    let pooled = pooled.iter().sum::<f64>() / pooled.len() as f64;
    println!("pooled {pooled:.2} %, bound 94 to 96 %; {broken} figures beyond four standard deviations");
    if broken > 0 || !(94.0..=96.0).contains(&pooled) {
        std::process::exit(1);
    }
}

/// The type B term that has more than half of the variance, and its share.
fn dominated(tally: &coverage::Tally, trials: usize) -> Option<(&str, f64)> {
    let shares = tally.shares.iter().map(|(name, sum)| (name.as_str(), sum / trials as f64));
    shares.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, share)| *share > 0.5)
}
