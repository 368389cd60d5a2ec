//! Checks the port of the scanner. No module needs it, since a number can be typed: nothing here is worse than a warning.

use std::path::Path;

use gnc_executive::bench::ScannerSettings;

use super::holders::{Holder, Proc};
use super::{Finding, Health, port};

/// The program that listens to the scanner during a shift.
const STATION: &str = "gnc-station";

/// Whether the port opens, or which program has it. A port that another program has is not opened: that would set its
/// modes anew, and could take a scan away from the other program.
pub(super) fn look(scanner: &ScannerSettings, proc: &Proc) -> Vec<Finding> {
    let device = Path::new(&scanner.port);
    let holders = proc.holders(device).found;
    if holders.is_empty() {
        let mut found = port::opens(device, scanner.rate_bps, "[scanner] port");
        found.what = match found.health {
            Health::Good => format!("scanner at {}, {} bit/s", scanner.port, scanner.rate_bps),
            Health::Warning | Health::Bad => format!("scanner: {}", found.what),
        };
        found.soften();
        return vec![found];
    }
    holders.into_iter().map(|holder| held(&scanner.port, &holder)).collect()
}

fn held(port: &str, holder: &Holder) -> Finding {
    let who = format!("process {} ({})", holder.process, holder.command);
    let program = holder.command.split(' ').next().map(Path::new).and_then(Path::file_name);
    if program == Some(STATION.as_ref()) {
        return Finding::good(format!("scanner at {port}: the station listens to it, {who}; it was not opened"));
    }
    let what =
        format!("scanner at {port}: another program has the port, {who}, and takes the scans; it was not opened");
    Finding::warning(what, format!("end that program: kill {}", holder.process))
}
