//! The station, for tests.

fn main() -> std::process::ExitCode {
    gnc_station::cli::main()
}
