//! Starts the program.

use std::process::ExitCode;

fn main() -> ExitCode {
    hw_mocks::program::run(std::env::args_os())
}
