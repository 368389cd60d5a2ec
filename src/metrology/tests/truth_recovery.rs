//! A short seeded run of the simulated calibrations. `cargo bench -p gnc-metrology --bench truth` does the long run.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test may end with a panic and says what it saw"
)]

#[path = "truth/truth.rs"]
mod truth;

const SEED: u64 = 20_261_122;

fn check(trials: usize, simulate: fn(usize, u64) -> truth::Tally) {
    println!("seed {SEED}, {trials} trials");
    let tally = simulate(trials, SEED);
    println!("{}\n{}", tally.method, tally.verdict().lines);
    assert_eq!(tally.failures(), Vec::<String>::new());
}

#[test]
fn six_positions() {
    check(2000, truth::six_position);
}

#[test]
fn twelve_attitudes() {
    check(2000, truth::twelve_attitudes);
}

#[test]
fn still_gyroscope() {
    check(2000, truth::gyro_still);
}

#[test]
fn rotations() {
    check(200, truth::rotation);
}

#[test]
fn rotations_about_the_vertical() {
    check(200, truth::rotation_vertical);
}

#[test]
fn ellipses() {
    check(500, truth::ellipse);
}

#[test]
fn ellipsoids() {
    check(300, truth::ellipsoid);
}
