//! Spoilt records of each method, kind and share, 1,000 each: the interval covers the truth or the record is refused.
//! One thread. `cargo bench -p gnc-metrology --bench contamination [-- RECORDS METHOD ...]`; exits with 1 when a bound
//! is broken.

#![allow(clippy::print_stdout, missing_docs, dead_code, reason = "a benchmark prints its figures")]

#[path = "../tests/contamination/contamination.rs"]
mod contamination;

use contamination::{KINDS, Kind, METHODS, Spoil, Tally};

const SEED: u64 = 1;
const SHARES: [f64; 5] = [0.001, 0.005, 0.01, 0.02, 0.05];

fn main() {
    let records = std::env::args().skip(1).find_map(|a| a.parse().ok()).unwrap_or(1000);
    println!(
        "{records} records each, seed {SEED}; coverage at least the probability less 3.9 standard errors, or refused"
    );
    let mut broken = 0;
    let named: Vec<String> =
        std::env::args().skip(1).filter(|a| METHODS.iter().any(|method| method.name == a)).collect();
    for method in METHODS.iter().filter(|method| named.is_empty() || named.iter().any(|name| name == method.name)) {
        for kind in KINDS {
            for share in if kind == Kind::Nothing { &[0.0][..] } else { &SHARES[..] } {
                let tally = Tally::run(method, Spoil { kind, share: *share }, records, SEED);
                let Tally { refused, judged, coverage, bound } = tally;
                let word = if tally.holds() { "" } else { "  BROKEN" };
                println!(
                    "{:<13} {kind:<10} {:>4.1} %  coverage {:.2} % of {judged}, bound {:.2} %, refused {refused}{word}",
                    method.name,
                    100.0 * share,
                    100.0 * coverage,
                    100.0 * bound,
                    kind = format!("{kind:?}"),
                );
                broken += usize::from(!tally.holds());
            }
        }
    }
    if broken > 0 {
        std::process::exit(1);
    }
}
