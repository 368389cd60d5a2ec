//! A seeded run of spoilt records. `GNC_LONG` makes it longer; `cargo bench -p gnc-metrology --bench contamination` tries
//! a thousand of each.

#![allow(clippy::print_stdout, reason = "a test says what it saw")]

#[path = "contamination/contamination.rs"]
mod contamination;
#[path = "long/long.rs"]
mod long;

use contamination::{KINDS, Kind, METHODS, Spoil, Tally};
use long::records;

const SEED: u64 = 20_261_128;

fn check(name: &str) {
    let records = records(30, 120);
    println!("seed {SEED}, {records} records each");
    let mut broken = Vec::new();
    for method in METHODS.iter().filter(|method| method.name == name) {
        for kind in KINDS {
            let shares: &[f64] = if kind == Kind::Nothing { &[0.0] } else { &[0.001, 0.01, 0.04] };
            for share in shares {
                let tally = Tally::run(method, Spoil { kind, share: *share }, records, SEED);
                let Tally { refused, judged, coverage, bound } = tally;
                let line =
                    format!("{name} {kind:?} {share}: {coverage:.3} of {judged}, bound {bound:.3}, {refused} refused");
                println!("{line}");
                // An honest record is not refused, and one bad row in a thousand does not stop a mean.
                if !tally.holds() || (kind == Kind::Nothing && refused > 0) {
                    broken.push(line);
                }
            }
        }
    }
    assert_eq!(broken, Vec::<String>::new());
}

#[test]
fn six_positions() {
    check("six-position");
}

#[test]
fn still_gyroscopes() {
    check("gyro-still");
}

#[test]
fn rotations() {
    check("rotation");
}

#[test]
fn flips() {
    check("flip");
}

#[test]
fn ellipses() {
    check("ellipse");
}

#[test]
fn ellipsoids() {
    check("ellipsoid");
}

#[test]
fn deviations() {
    check("allan");
}

#[test]
fn densities() {
    check("psd");
}

#[test]
fn block_means() {
    check("stability");
}
