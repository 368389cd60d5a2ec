//! The command line beside runs: where records are found, lists of them, the report for CI servers, the build.

#![expect(clippy::expect_used, clippy::panic, reason = "what cannot be set up fails the test that needs it")]

mod build;
mod clock;
mod export;
mod files;
mod guard;
mod help_files;
mod junit;
mod language;
mod list;
mod outputs;
mod place;
mod trust;
mod wording;

use gnc_tests::Run;

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");
const MOCK: &str = env!("CARGO_BIN_EXE_mock-under-test");

/// A command's exit code, and what it must have said.
#[track_caller]
fn check(run: &Run, code: i32, words: &[&str]) {
    let said = format!("{}{}", run.stdout, run.stderr);
    assert_eq!(run.code, Some(code), "{said}");
    for word in words {
        assert!(said.contains(word), "{word:?} is missing: {said}");
    }
}
