//! The exit codes of a run, and that of a usage error. Scripts rely on them, and README lists them.

use std::process::ExitCode;

use gnc_executive::outcome::Outcome;
use gnc_executive::verdict::Verdict;

/// A mistake on the command line, or a plan or bench file that is refused.
pub(crate) const USAGE: u8 = 2;

/// A person or a signal ended the run.
pub(crate) const ABORTED: u8 = 4;

/// Good items of a selection. A script must not take them for a pass of the module.
const SELECTION: u8 = 5;

/// A marginal module, if the caller asks for the difference.
const MARGINAL: u8 = 6;

/// Whether a marginal module has an exit code of its own (`--strict`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Strictness {
    /// Marginal is as good as passed.
    Lenient,
    /// Marginal is told apart from passed.
    Strict,
}

/// The exit code for the verdict of a run.
pub(crate) fn of(verdict: Verdict, strictness: Strictness) -> ExitCode {
    ExitCode::from(number(verdict, strictness))
}

/// The exit code of a command that is no run of a plan.
pub(crate) fn of_command(outcome: Outcome) -> ExitCode {
    of(Verdict::Module(outcome), Strictness::Lenient)
}

/// A run that is skipped or not run as a whole says nothing about the module, so it ends like an errored one.
fn number(verdict: Verdict, strictness: Strictness) -> u8 {
    match verdict.to_show() {
        None => SELECTION,
        Some(Outcome::Marginal) if strictness == Strictness::Strict => MARGINAL,
        Some(Outcome::Passed | Outcome::Marginal) => 0,
        Some(Outcome::Failed) => 1,
        Some(Outcome::Errored | Outcome::Skipped | Outcome::NotRun) => 3,
        Some(Outcome::Aborted) => ABORTED,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exit_codes_leave_two_to_usage() {
        let module = |strictness| Outcome::ALL.map(|outcome| number(Verdict::Module(outcome), strictness));
        assert_eq!(module(Strictness::Lenient), [0, 0, 1, 3, 4, 3, 3]);
        assert_eq!(module(Strictness::Strict), [0, 6, 1, 3, 4, 3, 3]);
    }

    #[test]
    fn good_items_of_a_selection_have_a_code_of_their_own() {
        for strictness in [Strictness::Lenient, Strictness::Strict] {
            let codes = Outcome::ALL.map(|outcome| number(Verdict::Selection(outcome), strictness));
            assert_eq!(codes, [5, 5, 1, 3, 4, 3, 3]);
        }
    }

    /// Of several runs or sockets the worst counts, and its exit code is the one that README promises.
    #[test]
    fn the_worst_of_several_decides() {
        use Outcome::{Aborted, Errored, Failed, Marginal, Passed};
        let verdicts = [
            Verdict::Module(Passed),
            Verdict::Module(Marginal),
            Verdict::Selection(Marginal),
            Verdict::Module(Failed),
            Verdict::Module(Errored),
            Verdict::Module(Aborted),
        ];
        let worst = |upto: usize| Verdict::worst(verdicts[..=upto].iter().rev().copied()).unwrap();
        let codes = [0, 1, 2, 3, 4, 5].map(|upto| number(worst(upto), Strictness::Strict));
        assert_eq!(codes, [0, 6, 5, 1, 3, 4]);
    }
}
