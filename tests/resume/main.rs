//! Runs that are interrupted and taken up again end as they would have ended.

#![expect(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "what cannot be set up fails the test that needs it"
)]

mod exchanged;
mod heat;
mod inside;
mod interruptions;
mod values;

/// The program under test.
const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");
/// A calibration as short as possible.
const SHORT: &str = include_str!("short.toml");
/// A module that depends on its temperature.
const WARM: &str = include_str!("warm.toml");
