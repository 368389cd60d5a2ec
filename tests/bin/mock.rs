//! The simulated board as a program, for tests.

fn main() -> std::process::ExitCode {
    hw_mocks::program::run(std::env::args_os())
}
