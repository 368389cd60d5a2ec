//! What the end of a run says: of a module, or of chosen items alone.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::outcome::Outcome;

/// How a run ended.
///
/// Chosen items never pass a module, so their end is another thing than the end of a whole plan. A caller that wants the
/// outcome of a module asks [`Verdict::of_module`], and gets none for a selection.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "StoredVerdict", into = "StoredVerdict")]
pub enum Verdict {
    /// The whole plan was to run: the verdict on the module.
    Module(Outcome),
    /// Chosen items were to run: how they ended.
    Selection(Outcome),
}

/// Word for a selection whose items are all good. It holds no "pass", which a hasty reader could take for the module's.
const PARTIAL: &str = "partial";

impl Verdict {
    /// The verdict of a run of the whole plan, or of a selection, with this outcome of its items.
    pub fn new(outcome: Outcome, is_selection: bool) -> Self {
        if is_selection { Self::Selection(outcome) } else { Self::Module(outcome) }
    }

    /// The same end of a run that is known to be a selection. Earlier versions of the station filed the outcome of a
    /// selection as that of a module.
    #[must_use]
    pub fn of_selection_if(self, is_selection: bool) -> Self {
        if is_selection { Self::Selection(self.of_items()) } else { self }
    }

    /// The outcome for the module; `None` if the run was a selection.
    pub fn of_module(self) -> Option<Outcome> {
        match self {
            Self::Module(outcome) => Some(outcome),
            Self::Selection(_) => None,
        }
    }

    /// The outcome of chosen items; `None` if the whole plan was to run.
    pub fn of_selection(self) -> Option<Outcome> {
        match self {
            Self::Module(_) => None,
            Self::Selection(outcome) => Some(outcome),
        }
    }

    /// How the items that were to run ended, whether or not they are the whole plan.
    pub fn of_items(self) -> Outcome {
        match self {
            Self::Module(outcome) | Self::Selection(outcome) => outcome,
        }
    }

    /// Whether the module passed: the whole plan was run, and every limit is kept.
    pub fn passes_module(self) -> bool {
        self.of_module().is_some_and(Outcome::is_good)
    }

    /// The outcome whose word may stand for the run; `None` for good items of a selection, which have a word of their own.
    pub fn to_show(self) -> Option<Outcome> {
        match self {
            Self::Selection(outcome) if outcome.is_good() => None,
            Self::Module(outcome) | Self::Selection(outcome) => Some(outcome),
        }
    }

    /// The name in lists: that of the outcome, or "partial" for good items of a selection.
    pub fn as_str(self) -> &'static str {
        self.to_show().map_or(PARTIAL, Outcome::as_str)
    }

    /// The word in a sentence.
    pub(crate) fn words(self) -> &'static str {
        self.to_show().map_or(PARTIAL, crate::outcome::words)
    }

    /// The same verdict with an outcome of its items that is at least as bad as this one.
    #[must_use]
    pub fn at_least(self, outcome: Outcome) -> Self {
        let worst = Outcome::worst([self.of_items(), outcome]).unwrap_or(outcome);
        Self::new(worst, self.of_module().is_none())
    }

    /// The verdict that counts for several runs: aborted > errored > failed > selection > marginal > passed. `None` if
    /// there is no run.
    pub fn worst(verdicts: impl IntoIterator<Item = Verdict>) -> Option<Verdict> {
        verdicts.into_iter().max_by_key(|verdict| verdict.severity())
    }

    /// The verdicts that are shown by different words, each with its number among these runs; those that do not occur are
    /// left out.
    pub fn counts(verdicts: &[Verdict]) -> Vec<(Verdict, usize)> {
        let shown = Outcome::ALL.into_iter().map(Self::Module).chain([Self::Selection(Outcome::Passed)]);
        let count = |of: Verdict| verdicts.iter().filter(|one| one.to_show() == of.to_show()).count();
        shown.map(|of| (of, count(of))).filter(|(_, count)| *count > 0).collect()
    }

    /// A run that is skipped or not run as a whole says nothing about the module, like an errored one.
    fn severity(self) -> u8 {
        match (self, self.of_items()) {
            (_, Outcome::Aborted) => 6,
            (_, Outcome::Errored | Outcome::Skipped | Outcome::NotRun) => 5,
            (_, Outcome::Failed) => 4,
            (Self::Selection(_), Outcome::Marginal) => 3,
            (Self::Selection(_), Outcome::Passed) => 2,
            (Self::Module(_), Outcome::Marginal) => 1,
            (Self::Module(_), Outcome::Passed) => 0,
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.words())
    }
}

/// A verdict as records hold it: of two outcomes, one is null or absent.
#[derive(Serialize, Deserialize)]
struct StoredVerdict {
    outcome: Option<Outcome>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    selection_outcome: Option<Outcome>,
}

impl From<Verdict> for StoredVerdict {
    fn from(verdict: Verdict) -> Self {
        Self { outcome: verdict.of_module(), selection_outcome: verdict.of_selection() }
    }
}

/// Neither of the two outcomes, or both.
#[derive(Debug, thiserror::Error)]
#[error("a run ends with an outcome or with a selection_outcome, and here are {0} of them")]
struct NotOneOutcome(u8);

impl TryFrom<StoredVerdict> for Verdict {
    type Error = NotOneOutcome;

    fn try_from(stored: StoredVerdict) -> Result<Self, Self::Error> {
        match (stored.outcome, stored.selection_outcome) {
            (Some(outcome), None) => Ok(Self::Module(outcome)),
            (None, Some(outcome)) => Ok(Self::Selection(outcome)),
            (None, None) => Err(NotOneOutcome(0)),
            (Some(_), Some(_)) => Err(NotOneOutcome(2)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All verdicts, best first, by the order that README promises for exit codes.
    fn ladder() -> Vec<Verdict> {
        use Outcome::{Aborted, Errored, Failed, Marginal, Passed};
        vec![
            Verdict::Module(Passed),
            Verdict::Module(Marginal),
            Verdict::Selection(Passed),
            Verdict::Selection(Marginal),
            Verdict::Module(Failed),
            Verdict::Module(Errored),
            Verdict::Module(Aborted),
        ]
    }

    #[test]
    fn the_worst_of_several_runs_counts() {
        let ladder = ladder();
        for (i, a) in ladder.iter().enumerate() {
            for (j, b) in ladder.iter().enumerate() {
                assert_eq!(Verdict::worst([*a, *b]), Some(ladder[i.max(j)]));
            }
        }
        assert_eq!(Verdict::worst([]), None);
        for bad in [Outcome::Failed, Outcome::Errored, Outcome::Aborted] {
            let (selection, worst) = (Verdict::Selection(bad), Verdict::worst([Verdict::Selection(bad), ladder[3]]));
            assert_eq!(worst, Some(selection));
        }
    }

    #[test]
    fn a_selection_is_no_pass() {
        for outcome in Outcome::ALL {
            let (module, selection) = (Verdict::new(outcome, false), Verdict::new(outcome, true));
            assert_eq!((module.of_module(), module.of_selection()), (Some(outcome), None));
            assert_eq!((selection.of_module(), selection.of_selection()), (None, Some(outcome)));
            assert_eq!(module.passes_module(), outcome.is_good());
            assert!(!selection.passes_module() && !selection.as_str().contains("pass"));
            assert_eq!(module.of_selection_if(true), selection);
            assert_eq!(
                selection.of_selection_if(false),
                selection,
                "a selection never becomes the verdict on a module"
            );
            assert_eq!(selection.to_show().is_none(), outcome.is_good());
        }
    }

    #[test]
    fn runs_are_counted_by_the_words_that_people_see() {
        use Outcome::{Failed, Marginal, Passed};
        let runs = [Passed, Marginal, Failed, Passed].map(Verdict::Selection);
        let counted: Vec<String> =
            Verdict::counts(&runs).iter().map(|(verdict, count)| format!("{count} {verdict}")).collect();
        assert_eq!(counted, ["1 failed", "3 partial"]);
        let runs = [Passed, Failed, Passed].map(Verdict::Module);
        assert_eq!(Verdict::counts(&runs), [(Verdict::Module(Passed), 2), (Verdict::Module(Failed), 1)]);
    }

    #[test]
    fn records_hold_one_of_two_outcomes() {
        let text = |verdict: Verdict| serde_json::to_string(&verdict).unwrap();
        assert_eq!(text(Verdict::Module(Outcome::Passed)), r#"{"outcome":"passed"}"#);
        assert_eq!(text(Verdict::Selection(Outcome::Failed)), r#"{"outcome":null,"selection_outcome":"failed"}"#);
        for verdict in ladder() {
            assert_eq!(serde_json::from_str::<Verdict>(&text(verdict)).unwrap(), verdict);
        }
        for wrong in ["{}", r#"{"outcome":null}"#, r#"{"outcome":"passed","selection_outcome":"passed"}"#] {
            serde_json::from_str::<Verdict>(wrong).unwrap_err();
        }
    }
}
