//! Starts the station.

fn main() -> std::process::ExitCode {
    gnc_station::cli::main()
}
