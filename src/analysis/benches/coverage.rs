//! Coverage of the intervals of all items, simulated without frames:
//! `cargo bench -p gnc-analysis --bench coverage [-- TRIALS] [calibration|field|left|repeated|noise|sky]`; exits with 1
//! when a bound is broken.

#![allow(clippy::print_stdout, clippy::expect_used, clippy::panic, missing_docs, dead_code, unreachable_pub)]

use std::time::Instant;

// The simulation is that of the tests. It looks for the station under these names.
mod capture {
    pub use gnc_analysis::capture::*;
}
mod figures {
    pub use gnc_analysis::figures::*;
}
#[path = "../figures/tests/coverage.rs"]
mod coverage;
#[path = "../figures/tests/coverage_field.rs"]
mod coverage_field;
#[path = "../figures/tests/coverage_left.rs"]
mod coverage_left;
#[path = "../figures/tests/coverage_noise.rs"]
mod coverage_noise;
#[path = "../figures/tests/coverage_repeated.rs"]
mod coverage_repeated;
#[path = "../figures/tests/coverage_sky.rs"]
mod coverage_sky;
#[path = "../figures/tests/sky.rs"]
mod sky;
#[path = "../figures/tests/world.rs"]
mod world;

const SEED: u64 = 1;
/// Allowed deviation from the promised share, in standard errors: 92.3 to 97.7 % at 1000 trials of 95 %.
const STANDARD_ERRORS: f64 = 3.9;
/// A function that runs a number of trials from a seed.
type Run = fn(usize, u64) -> Vec<coverage::Tally>;
/// Parts of the run. Words of the command line choose among them.
const RUNS: [(&str, Run); 6] = [
    ("calibration", coverage::run),
    ("field", coverage_field::run),
    ("left", coverage_left::run),
    ("repeated", coverage_repeated::run),
    ("noise", coverage_noise::run),
    ("sky", coverage_sky::run),
];

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let trials = words.iter().find_map(|word| word.parse().ok()).unwrap_or(1000);
    let only: Vec<&String> = words.iter().filter(|word| RUNS.iter().any(|(name, _)| *name == word.as_str())).collect();
    let start = Instant::now();
    let wanted = RUNS.into_iter().filter(|(name, _)| only.is_empty() || only.iter().any(|word| word.as_str() == *name));
    let tallies: Vec<coverage::Tally> = wanted.flat_map(|(_, run)| run(trials, SEED)).collect();
    println!("{trials} modules, seed {SEED}, in {:.1} s", start.elapsed().as_secs_f64());
    let (mut broken, mut pooled) = (0, Vec::new());
    for tally in &tallies {
        let covered = 100.0 * tally.held as f64 / tally.given as f64;
        let (promised, p) = (100.0 * tally.probability, tally.probability);
        let more = covered - promised;
        let band = STANDARD_ERRORS * (p * (1.0 - p) / tally.given as f64).sqrt() * 100.0;
        // A term that the bench draws once in a trial may hide the effect of the other terms.
        let dominated = dominated(tally).filter(|_| more > band);
        let note =
            dominated.map(|(term, share)| format!("  dominated by {term}, {:.0} % of the variance", 100.0 * share));
        let given = if tally.given < trials { format!(" of the {} that gave it", tally.given) } else { String::new() };
        println!("  {:<46} {covered:.1} % for {promised:.1} %{given}{}", tally.name, note.as_deref().unwrap_or(""));
        if note.is_none() {
            if more.abs() > band {
                println!("    BROKEN: {band:.1} % are allowed");
                broken += 1;
            }
            pooled.push(more);
        }
    }
    let pooled = pooled.iter().sum::<f64>() / pooled.len() as f64;
    println!(
        "pooled {pooled:+.2} % to what is promised, bound -1 to 1 %; {broken} figures beyond {STANDARD_ERRORS} standard errors"
    );
    if broken > 0 || pooled.abs() > 1.0 {
        std::process::exit(1);
    }
}

/// The type B term with more than half of the variance, and its share.
fn dominated(tally: &coverage::Tally) -> Option<(&str, f64)> {
    let shares = tally.shares.iter().map(|(name, sum)| (name.as_str(), sum / tally.given as f64));
    shares.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, share)| *share > 0.5)
}
