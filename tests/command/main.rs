//! The command line beside runs: where records are found, lists of them, the report for CI servers, the build.

#![expect(clippy::expect_used, clippy::panic, reason = "what cannot be set up fails the test that needs it")]

mod build;
mod clock;
mod guard;
mod help_files;
mod junit;
mod language;
mod list;
mod place;
mod trust;
mod wording;

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");
const MOCK: &str = env!("CARGO_BIN_EXE_mock-under-test");
