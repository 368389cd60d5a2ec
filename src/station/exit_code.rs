//! The exit codes of a run, and that of a usage error. Scripts rely on them, and README lists them.

use std::process::ExitCode;

use gnc_executive::outcome::Outcome;

/// A mistake on the command line, or a plan or bench file that is refused.
pub(crate) const USAGE: u8 = 2;

/// The exit code for the outcome of a run.
pub(crate) fn of(outcome: Outcome) -> ExitCode {
    ExitCode::from(number(outcome))
}

/// A run that is skipped or not run as a whole says nothing about the module, so it ends like an errored one.
fn number(outcome: Outcome) -> u8 {
    match outcome {
        Outcome::Passed | Outcome::Marginal => 0,
        Outcome::Failed => 1,
        Outcome::Errored | Outcome::Skipped | Outcome::NotRun => 3,
        Outcome::Aborted => 4,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exit_codes_leave_two_to_usage() {
        assert_eq!(Outcome::ALL.map(number), [0, 0, 1, 3, 4, 3, 3]);
    }
}
